"""`ffhnet export`."""

import pytest

pytest.importorskip("onnx", reason="the extra `onnx` brings it")


def test_writes_both_networks_and_their_description(ffhnet, untrained_weights, tmp_path):
    status, printed, err = ffhnet("export", untrained_weights, "--out", tmp_path / "onnx")
    assert (status, err) == (0, "")
    files = {file.name for file in (tmp_path / "onnx").iterdir()}
    assert files == {"generator.onnx", "evaluator.onnx", "description.json"}
    assert all(name in printed for name in files)


def test_missing_weights(ffhnet, tmp_path):
    status, _, err = ffhnet("export", tmp_path / "nothing")
    assert status == 2
    assert "no folder" in err
