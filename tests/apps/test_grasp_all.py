"""`ffhnet grasp --all-objects`: grasps for every object of a scene."""

import numpy as np
import trimesh

from ffhnet.grasps_file import load_plan
from ffhnet.perception.camera import REALSENSE_D415, look_at, render_depth

INTRINSICS = ("--intrinsics", 615, 615, 320, 240)


def write_scene(path):
    """A depth image of two boxes, 25 cm apart, as NumPy writes it."""
    boxes = []
    for y, height in ((0.0, 0.16), (0.25, 0.12)):
        box = trimesh.creation.box((0.06, 0.08, height))
        box.apply_translation([0, y, height / 2])
        boxes.append(box)
    T_world_camera = look_at(np.array([-0.5, -0.1, 0.5]), np.array([0.0, 0.1, 0.06]))
    np.save(path, render_depth(boxes, T_world_camera, REALSENSE_D415))
    return path


def test_every_object_has_files_of_its_own(ffhnet, tmp_path, untrained_weights):
    scene = write_scene(tmp_path / "scene.npy")
    common = ("grasp", scene, *INTRINSICS, "--weights", untrained_weights, "--num", 20, "--no-feasibility")
    status, printed, err = ffhnet(*common, "--all-objects", "--out", tmp_path / "grasps.npz")
    assert (status, err) == (0, "")
    assert "object 0 of 2" in printed
    assert "object 1 of 2" in printed
    assert ffhnet(*common, "--object", 1, "--out", tmp_path / "second.npz")[0] == 0
    first, second, same = (load_plan(tmp_path / f"{name}.npz") for name in ("grasps_0", "grasps_1", "second"))
    np.testing.assert_allclose(second.grasps.position, same.grasps.position, atol=1e-9)
    apart = second.grasps.position.mean(axis=0) - first.grasps.position.mean(axis=0)
    assert np.linalg.norm(apart) > 0.15


def test_one_object_is_not_all_of_them(ffhnet, tmp_path):
    scene = write_scene(tmp_path / "scene.npy")
    for options in (("--object", 1), ("--mask", tmp_path / "mask.png")):
        status, _, err = ffhnet("grasp", scene, *INTRINSICS, "--all-objects", *options)
        assert status != 0
        assert "--all-objects" in err
