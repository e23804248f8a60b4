"""Grasp files: what is written comes back, other people's files are read, broken ones are refused."""

import json

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation
from trial_makers import HAND, make_trials, write_data_set

from ffhnet.dataset.columns import read_trial_columns
from ffhnet.dataset.exchange import export_grasps, read_folder, read_grasps
from ffhnet.errors import DatasetError
from ffhnet.geometry.rotations import matrix_from_quaternion
from ffhnet.geometry.transforms import make_transform
from ffhnet.objects.catalogue import resolve_objects


def load(name):
    return resolve_objects(name)[0].load()


@pytest.fixture(scope="module")
def data_set(tmp_path_factory):
    """Forty trials on two objects of two splits, in two resting poses."""
    rng, n = np.random.default_rng(5), 40
    outcomes = rng.choice(["success", "missed", "slipped", "collision"], n)
    closed = rng.uniform(0, 1.1, (n, HAND.num_joints))
    closed[outcomes == "collision"] = np.nan
    trials = make_trials(
        outcomes,
        object_name=np.where(np.arange(n) < 25, "tube_000008", "rounded_block_1000000"),
        placement=np.arange(n) % 2,
        proposer=rng.choice(["power", "perturb"], n),
        position=rng.uniform(-0.2, 0.2, (n, 3)),
        quaternion_wxyz=Rotation.random(n, random_state=0).as_quat(canonical=True)[:, [3, 0, 1, 2]],
        joints=rng.uniform(0, 1.1, (n, HAND.num_joints)),
        closed_joints=closed,
        repeats=np.full(n, 6),
        held=rng.integers(0, 7, n),
    )
    return write_data_set(tmp_path_factory.mktemp("data") / "set", trials)


@pytest.fixture(scope="module")
def exported(data_set, tmp_path_factory):
    out = tmp_path_factory.mktemp("export")
    assert export_grasps(data_set, out, load) == 2
    return out


def test_round_trip(data_set, exported):
    stored = read_trial_columns([data_set])
    for file in read_folder(exported / "grasps"):
        mine = stored[stored.object_name == file.mesh.removesuffix(".obj")]
        T_world_palm = make_transform(matrix_from_quaternion(mine.quaternion_wxyz), mine.position)
        np.testing.assert_allclose(file.T_world_palm(), T_world_palm, atol=1e-6)
        np.testing.assert_array_equal(file.success, mine.success)
        extra = file.extra
        assert extra.outcome == tuple(mine.outcome)
        assert extra.proposer == tuple(mine.proposer)
        np.testing.assert_array_equal(extra.placement, mine.placement)
        np.testing.assert_array_equal(extra.held, mine.held)
        np.testing.assert_allclose(extra.joints, mine.joints, atol=1e-5)
        np.testing.assert_allclose(extra.closed_joints, mine.closed_joints, atol=1e-5)
        assert extra.joint_names == HAND.joint_names


def test_poses_are_of_the_hand_base_in_the_frame_of_the_mesh(data_set, exported):
    """The plain format, without our fields, is enough to put the hand where the trial had it."""
    stored = read_trial_columns([data_set])
    content = json.loads((exported / "grasps" / "tube_000008.json").read_text())
    obj = load("tube_000008")
    T_object_base = np.array(content["grasps"]["transforms"][1])
    assert stored.placement[1] == 1
    wanted = HAND.root_pose(matrix_from_quaternion(stored.quaternion_wxyz[1]), stored.position[1])
    np.testing.assert_allclose(obj.resting_poses[1] @ T_object_base, wanted, atol=1e-6)
    mesh = trimesh.load(exported / "meshes" / content["object"]["file"], force="mesh")
    np.testing.assert_allclose(mesh.bounds, obj.visual.bounds, atol=1e-6)
    assert content["object"]["scale"] == 1
    assert all(type(held) is bool for held in content["grasps"]["object_in_gripper"])


def test_split_files_name_the_meshes_of_the_grasp_files(exported):
    splits = {file.name: file.read_text().split() for file in (exported / "splits").iterdir()}
    assert splits == {"train.txt": ["tube_000008.obj"], "valid.txt": ["rounded_block_1000000.obj"]}
    assert {file.mesh for file in read_folder(exported / "grasps")} == {
        mesh for meshes in splits.values() for mesh in meshes
    }


def test_a_plain_file_of_another_gripper(tmp_path):
    poses = [np.eye(4).tolist(), make_transform(position=np.array([0, 0, 0.1])).tolist()]
    content = {
        "object": {"file": "mug.obj", "scale": 0.5},
        "grasps": {"transforms": poses, "object_in_gripper": [[1], [0]]},
    }
    (tmp_path / "mug.json").write_text(json.dumps(content))
    found = read_grasps(tmp_path / "mug.json")
    assert found.success.tolist() == [True, False]
    assert (found.mesh, found.scale, found.extra) == ("mug.obj", 0.5, None)
    with pytest.raises(DatasetError, match="no palm frame"):
        found.T_world_palm()


def shorten(content):
    content["grasps"]["object_in_gripper"].pop()


def stretch(content):
    content["grasps"]["transforms"][0][0][0] = 2.0


def forget(content):
    del content["grasps"]["transforms"]


def misplace(content):
    content["grasps"]["placement"][0] = 99


def no_numbers(content):
    content["grasps"]["transforms"][0][0][0] = "x"


def not_finite(content):
    content["grasps"]["transforms"][0][0][3] = float("nan")


@pytest.mark.parametrize("damage", [shorten, stretch, forget, misplace, no_numbers, not_finite])
def test_broken_files_are_refused(exported, tmp_path, damage):
    content = json.loads((exported / "grasps" / "tube_000008.json").read_text())
    damage(content)
    (tmp_path / "broken.json").write_text(json.dumps(content))
    with pytest.raises(DatasetError, match=r"broken\.json"):
        read_grasps(tmp_path / "broken.json")


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"object": 1, "grasps": 2}', '{"grasps": '])
def test_files_that_are_none(tmp_path, text):
    (tmp_path / "none.json").write_text(text)
    with pytest.raises(DatasetError, match="no grasp file"):
        read_grasps(tmp_path / "none.json")


def test_an_empty_folder_is_refused(tmp_path):
    with pytest.raises(DatasetError, match="no grasp files"):
        read_folder(tmp_path)
