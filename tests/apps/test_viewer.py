"""The viewer behind the browser: files, sliders, choices, motions; no socket has to be listened to."""

from types import SimpleNamespace

import numpy as np
import pytest

from ffhnet.apps.capture_options import CaptureOptions, NetworkOptions
from ffhnet.hands import load_hand
from ffhnet.inference import FFHNet

viser = pytest.importorskip("viser", reason="the viewer needs the extra `viewer`")

EXAMPLE = "spray_flask_2000005"


@pytest.fixture(scope="module")
def looker():
    from ffhnet.apps.viewer.sight import Looker

    return Looker(FFHNet.from_pretrained(), load_hand(), NetworkOptions(num=60))


@pytest.fixture(scope="module")
def example(looker):
    return looker.example(EXAMPLE)


@pytest.fixture(scope="module")
def served(looker):
    from ffhnet.apps.viewer.viewer import Viewer

    server = viser.ViserServer("127.0.0.1", 0, verbose=False)
    yield Viewer(server, load_hand(), looker, CaptureOptions())
    server.stop()


@pytest.fixture
def viewer(served, example):
    panel = served.panel
    panel.threshold.value, panel.count.value, panel.distinct.value = 0.0, 5, True
    served.show(example)
    return served


def upload(viewer, name, content):
    """What a browser does when somebody opens a file."""
    viewer._open_upload(viser.UploadedFile(name, content))


def test_sliders_decide_how_many_hands(viewer, example):
    panel = viewer.panel
    assert viewer.stage.crowd_size == 5
    panel.count.value = 3
    assert viewer.stage.crowd_size == 3
    panel.distinct.value = False
    panel.count.value = 60
    assert viewer.stage.crowd_size == len(example.grasps) > 20
    panel.threshold.value = float(np.median(example.grasps.probability))
    reach = int((example.grasps.probability >= panel.threshold.value).sum())
    assert viewer.stage.crowd_size == reach
    assert f"{reach} hands shown; {reach} of {len(example.grasps)}" in panel.shown.content


def test_a_choice_shows_the_numbers_that_grasp_prints(viewer, example):
    panel = viewer.panel
    panel.grasp.value = panel.grasp.options[1]
    assert f"{example.in_input.position[0][0]:+.3f}" in panel.numbers.content
    assert "camera frame" in panel.numbers.content
    assert not panel.close.disabled
    panel.threshold.value = 1.0
    assert panel.grasp.value == "none"
    assert panel.close.disabled


def test_a_world_has_its_table_at_zero(looker, example, depth_png):
    """The object is known to stand there; a file's table is where it was found."""
    from_file = looker.file(depth_png, CaptureOptions(intrinsics=(615, 615, 320, 240)))
    for sight in (example, from_file):
        assert 0 < sight.cloud[:, 2].min() < 0.015
        assert abs(sight.forward[2]) < 0.01
    palms = np.linalg.norm(from_file.grasps.position - from_file.cloud.mean(axis=0), axis=1)
    assert np.median(palms) < 0.25


@pytest.mark.parametrize(
    ("name", "content", "word"),
    [
        ("cloud.ply", b"nothing like a cloud", "cloud.ply"),
        ("cloud.npy", b"", "empty"),
        ("notes.txt", b"hello", ".txt"),
        ("../../escape.ply", b"ply\n", "escape.ply"),
        ("..", b"x", "file"),
        ("depth.png", b"\x89PNG", "depth.png"),
    ],
)
def test_a_bad_upload_is_one_line_and_changes_nothing(viewer, name, content, word):
    upload(viewer, name, content)
    assert word in viewer.panel.status.content
    assert "c92a2a" in viewer.panel.status.content
    assert "/tmp" not in viewer.panel.status.content
    assert viewer.stage.crowd_size == 5


def test_a_good_upload_replaces_what_is_seen(viewer, depth_png):
    viewer.panel.intrinsics.value = "615 615 320"
    upload(viewer, "depth.png", depth_png.read_bytes())
    assert "fx fy cx cy" in viewer.panel.status.content
    viewer.panel.intrinsics.value = "615, 615, 320, 240"
    upload(viewer, "depth.png", depth_png.read_bytes())
    assert "depth.png:" in viewer.panel.status.content
    viewer.panel.grasp.value = viewer.panel.grasp.options[1]
    # Of this object nobody knows the far side.
    assert viewer.panel.trial.disabled


def test_the_hand_closes_to_the_grasp(example):
    from ffhnet.apps.viewer.motion import APPROACH, approach, closing

    hand, grasp = load_hand(), example.grasps[0]
    way, close = approach(hand, grasp), closing(hand, grasp)
    assert np.allclose(way[0].joints, hand.open(grasp.joints[0]))
    assert np.linalg.norm(way[0].T_world_palm[:3, 3] - grasp.position[0]) == pytest.approx(APPROACH)
    assert np.allclose(way[-1].T_world_palm, close[0].T_world_palm)
    assert np.allclose(close[-1].joints, grasp.joints[0])


def test_a_trial_is_played_as_it_ended(example):
    pytest.importorskip("mujoco", reason="trials need the extra `sim`")
    from ffhnet.apps.viewer.trial import describe, record_trial
    from ffhnet.simulation.trial import Outcome

    recording = record_trial(load_hand(), example.known, example.grasps[0])
    assert recording.outcome == Outcome.SUCCESS
    start, end = example.known.T_world_object, recording.frames[-1].T_world_object
    assert end[2, 3] - start[2, 3] > 0.15
    palm = np.array([frame.T_world_palm[2, 3] for frame in recording.frames])
    assert palm[-1] - example.grasps.position[0][2] == pytest.approx(0.20, abs=0.02)
    assert "held" in describe(recording)

    below = example.grasps[0].replace(position=example.grasps.position[:1] - [0, 0, 1])
    hit = record_trial(load_hand(), example.known, below)
    assert hit.outcome == Outcome.COLLISION
    assert all(frame.T_world_object is None for frame in hit.frames)


def test_motions_are_played_until_something_else_is_chosen(viewer, monkeypatch):
    pytest.importorskip("mujoco", reason="trials need the extra `sim`")
    played = []
    monkeypatch.setattr("ffhnet.apps.viewer.viewer.time", SimpleNamespace(sleep=played.append))
    viewer.panel.grasp.value = viewer.panel.grasp.options[1]
    viewer._close()
    closing = len(played)
    assert closing > 30
    viewer._try()
    assert len(played) - closing > closing
    assert "held" in viewer.panel.outcome.content

    away = SimpleNamespace(sleep=lambda _: viewer._choose(None))
    monkeypatch.setattr("ffhnet.apps.viewer.viewer.time", away)
    viewer._try()
    assert viewer.panel.outcome.content == ""
    assert viewer.stage.crowd_size == 5


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("nothing.ply",), "no such file"),
        (("cloud.ply", "--camera", 0, 0, 1), "--camera"),
        (("--host", "192.0.2.1", "--port", 8080), "192.0.2.1"),
        (("--port", 99999), "99999"),
    ],
)
def test_errors_are_one_line(ffhnet, arguments, word):
    status, out, err = ffhnet("view", *arguments)
    assert (status, out) == (2, "")
    assert word in err
    assert err.count("\n") == 1
