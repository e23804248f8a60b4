"""A capture made by a simulated camera, read back, observed, surveyed, and tried in physics."""

import dataclasses
import json

import numpy as np
import pytest
import trimesh
from PIL import Image

from ffhnet.errors import InputFileError, ObjectError, OptionError, SceneError
from ffhnet.evaluation.captures import find_captures, read_capture
from ffhnet.evaluation.captures_physics import CapturePhysics, observe_registered, put_down, table_frame
from ffhnet.evaluation.captures_survey import survey
from ffhnet.feasibility.planner import Planner
from ffhnet.geometry.rotations import matrix_from_rotation_vector
from ffhnet.geometry.transforms import apply, invert, make_transform
from ffhnet.hands import load_hand
from ffhnet.inference import FFHNet
from ffhnet.objects.scans import load_scan
from ffhnet.perception.camera import REALSENSE_D415, look_at, render_depth
from ffhnet.perception.sensor_noise import StereoNoise

CARTON = (0.05, 0.07, 0.16)
AT = np.array([0.02, 0.0, 0.0])
"""m: where the carton stands."""

K = REALSENSE_D415


def box(sides, at):
    mesh = trimesh.creation.box(sides)
    mesh.apply_translation(np.array(at) + [0, 0, sides[2] / 2])
    return mesh


def write_capture(root, others=()):
    """A carton of known pose among other boxes, as captures/group/scene with its mesh beside `captures`."""
    folder = root / "captures" / "group" / "scene"
    folder.mkdir(parents=True)
    box(CARTON, (0, 0, 0)).export(root / "carton.obj")
    T_world_camera = look_at(np.array([-0.5, 0.3, 0.55]), np.array([0.0, 0.0, 0.06]))
    carton, rng = box(CARTON, AT), np.random.default_rng(0)
    clean = render_depth([carton, *others], T_world_camera, K)
    depth = StereoNoise().apply(clean, K, rng)
    alone = render_depth([carton], T_world_camera, K, table=False)
    mask = 2 * ((alone > 0) & (alone <= clean + 1e-6)).astype(np.uint8)
    Image.fromarray(np.rint(10000 * depth).astype(np.uint16)).save(folder / "depth.png")
    Image.fromarray(mask + (mask == 0)).save(folder / "mask.png")
    meta = {
        "K": [[K.fx, 0, K.cx], [0, K.fy, K.cy], [0, 0, 1]],
        "depth_scale_m_per_unit": 0.0001,
        "mask_origin": "made: 1 = table, 2.. = objects",
        "objects": [
            {
                "label": 2,
                "mesh": "carton.obj",
                "T_camera_mesh": (invert(T_world_camera) @ make_transform(position=AT)).tolist(),
            },
            {"label": 3, "mesh": "not in this set"},
        ],
    }
    (folder / "meta.json").write_text(json.dumps(meta))
    return root / "captures"


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    folder = write_capture(tmp_path_factory.mktemp("data"), [box((0.2, 0.16, 0.1), (0.0, -0.22, 0))])
    return read_capture(find_captures(folder)[0])


@pytest.fixture(scope="module")
def planner():
    network = FFHNet.from_pretrained()
    return Planner(network, load_hand(network.info.hand))


def test_what_stands_in_the_folder_is_read(capture):
    assert capture.name == "group/scene"
    assert capture.objects == (2,)
    assert not capture.cut_out
    (target,) = capture.registered
    assert (target.name, target.number) == ("carton", 2)
    on_mask = apply(invert(target.T_input_mesh), capture.cloud[capture.numbers == 2])
    assert (np.abs(on_mask[:, :2]) < np.array(CARTON[:2]) / 2 + 0.01).all(axis=1).mean() > 0.97


def test_what_is_no_capture_is_refused(tmp_path):
    with pytest.raises(InputFileError, match="found none"):
        find_captures(tmp_path)
    (tmp_path / "meta.json").write_text("{")
    with pytest.raises(InputFileError, match="not JSON"):
        read_capture(tmp_path)


def test_the_registered_object_is_found_without_the_mask(capture):
    target = capture.registered[0]
    observation, masked = observe_registered(capture, target, seed=0)
    assert not masked
    T = table_frame(capture, target, observation) @ target.T_input_mesh
    assert abs(T[2, 3]) < 0.003
    assert T[2, 2] > np.cos(np.radians(1))


def test_the_mask_tells_objects_apart_that_touch(tmp_path):
    touching = box((0.15, 0.08, 0.12), AT + [0.0, 0.076, 0.0])
    capture = read_capture(find_captures(write_capture(tmp_path, [touching]))[0])
    observation, masked = observe_registered(capture, capture.registered[0], seed=0)
    assert masked
    assert len(observation.cloud) < len(capture.observe()[0].cloud)
    with pytest.raises(OptionError, match="no mask"):
        dataclasses.replace(capture, numbers=None).observe_masked(2)


def test_a_mesh_that_is_not_there_is_noticed(capture):
    target = capture.registered[0]
    away = target.T_input_mesh @ make_transform(position=np.array([0.0, -0.3, 0.0]))
    with pytest.raises(SceneError, match="no object is where carton was registered"):
        observe_registered(capture, dataclasses.replace(target, T_input_mesh=away, number=None), seed=0)


def test_objects_are_put_down_upright_and_stay_in_place(capture):
    carton = load_scan(capture.registered[0].path)
    for axis in np.eye(3):
        leaning = make_transform(matrix_from_rotation_vector(0.1 * axis), np.array([0.3, -0.2, 0.007]))
        rests = put_down(carton, leaning)
        corners = apply(rests, carton.visual.vertices)
        assert abs(corners[:, 2].min()) < 1e-9
        assert rests[2, 2] == pytest.approx(1)
        # Turned about its middle: only the height of that changes.
        middle = np.array([0, 0, CARTON[2] / 2])
        np.testing.assert_allclose(apply(rests, middle)[:2], apply(leaning, middle)[:2], atol=1e-9)
        assert np.arctan2(rests[1, 0], rests[0, 0]) == pytest.approx(0.1 * axis[2], abs=0.01)
    with pytest.raises(ObjectError, match="45 degrees off"):
        put_down(carton, make_transform(matrix_from_rotation_vector(np.array([np.pi / 4, 0, 0]))))


def test_survey_says_what_is_clearly_graspable(capture, planner):
    seen = survey(capture, planner, num=60)
    assert seen.refusal is None
    assert seen.good
    carton, crate = sorted(seen.found, key=lambda one: one.width)
    assert carton.obstacle is None
    assert carton.feasible > 0
    assert carton.height == pytest.approx(CARTON[2], abs=0.005)
    assert crate.obstacle == "too wide"
    assert crate.width == pytest.approx(0.16, abs=0.015)
    assert [one.number for one in seen.masked] == [2]
    bare = survey(dataclasses.replace(capture, cloud=capture.cloud[:20]), planner)
    assert "at least 50 points" in bare.refusal
    assert not bare.good


def test_grasps_of_the_depth_are_executed_on_the_mesh(capture, planner):
    physics = CapturePhysics(capture, capture.registered[0], load_hand(), planner)
    trial = physics.run(seed=0, num=100)
    assert trial == physics.run(seed=0, num=100)
    assert trial.success
    assert trial.feasible > 0
    assert trial.moved < 0.005
