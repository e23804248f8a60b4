"""Grasp files come back as they were written, and damaged ones are refused."""

import json

import numpy as np
import pytest

from ffhnet.errors import InputFileError, OptionError
from ffhnet.geometry.rotations import matrix_from_rotation_vector
from ffhnet.grasps import Grasps
from ffhnet.grasps_file import load_grasps, save_grasps


def make_grasps(count, scored=True, robust=True):
    rng = np.random.default_rng(0)
    return Grasps(
        rotation=matrix_from_rotation_vector(rng.normal(size=(count, 3))),
        position=rng.normal(size=(count, 3)),
        joints=rng.normal(size=(count, 2)),
        joint_names=("a", "b"),
        hand="some_hand",
        frame="world",
        probability=rng.uniform(size=count) if scored else None,
        robustness=rng.uniform(size=count) if scored and robust else None,
    )


@pytest.mark.parametrize("suffix", [".json", ".npz"])
@pytest.mark.parametrize(
    ("count", "scored", "robust"),
    [(7, True, True), (7, True, False), (7, False, False), (1, True, True), (0, True, True)],
)
def test_round_trip(tmp_path, suffix, count, scored, robust):
    grasps = make_grasps(count, scored, robust)
    path = tmp_path / f"grasps{suffix}"
    save_grasps(grasps, path)
    back = load_grasps(path)
    assert (back.hand, back.frame, back.joint_names) == (grasps.hand, grasps.frame, grasps.joint_names)
    np.testing.assert_allclose(back.rotation, grasps.rotation, atol=1e-12)
    np.testing.assert_array_equal(back.position, grasps.position)
    np.testing.assert_array_equal(back.joints, grasps.joints)
    for name in ("probability", "robustness"):
        wanted, came = getattr(grasps, name), getattr(back, name)
        assert (came is None) == (wanted is None)
        if wanted is not None:
            np.testing.assert_array_equal(came, wanted)
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


def test_quaternions_are_wxyz(tmp_path):
    """A quarter turn about z, by hand."""
    grasps = make_grasps(1).replace(rotation=np.array([[[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]]))
    save_grasps(grasps, tmp_path / "grasps.json")
    content = json.loads((tmp_path / "grasps.json").read_text())
    half = np.sqrt(0.5)
    np.testing.assert_allclose(content["grasps"][0]["palm_quaternion_wxyz"], [half, 0, 0, half])


@pytest.mark.parametrize("suffix", [".json", ".npz"])
def test_damaged_files(tmp_path, suffix):
    path = tmp_path / f"grasps{suffix}"
    with pytest.raises(InputFileError, match="no such file"):
        load_grasps(path)
    save_grasps(make_grasps(5), path)
    path.write_bytes(path.read_bytes()[:-40])
    with pytest.raises(InputFileError, match="not a grasp file"):
        load_grasps(path)
    path.write_bytes(b"")
    with pytest.raises(InputFileError, match="not a grasp file"):
        load_grasps(path)


def test_other_content(tmp_path):
    path = tmp_path / "grasps.json"
    for content in ("[]", "{}", '{"hand": "h", "frame": "f", "joint_names": [], "grasps": [{}]}'):
        path.write_text(content)
        with pytest.raises(InputFileError, match="not a grasp file"):
            load_grasps(path)
    save_grasps(make_grasps(1), path)
    content = json.loads(path.read_text())
    content["grasps"][0]["palm_quaternion_wxyz"] = [1, 1, 0, 0]
    path.write_text(json.dumps(content))
    with pytest.raises(InputFileError, match="length 1"):
        load_grasps(path)


def test_objects_in_arrays_are_refused(tmp_path):
    path = tmp_path / "grasps.npz"
    np.savez(path, hand=np.array({"x": 1}, dtype=object))
    with pytest.raises(InputFileError, match="not a grasp file"):
        load_grasps(path)


def test_bad_places_to_write(tmp_path):
    with pytest.raises(OptionError, match=r"\.json or \.npz"):
        save_grasps(make_grasps(1), tmp_path / "grasps.csv")
    with pytest.raises(OptionError, match="does not exist"):
        save_grasps(make_grasps(1), tmp_path / "nowhere" / "grasps.json")


def test_a_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "grasps.json"
    save_grasps(make_grasps(1), path)
    before = path.read_bytes()

    def full_disk(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", full_disk)
    with pytest.raises(OptionError, match="No space left"):
        save_grasps(make_grasps(3), path)
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == [path.name]
