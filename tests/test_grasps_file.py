"""Grasp files come back as they were written, and damaged ones are refused."""

import json

import numpy as np
import pytest

from ffhnet.errors import InputFileError, OptionError
from ffhnet.geometry.rotations import matrix_from_rotation_vector
from ffhnet.grasp_plan import ArmMotion, GraspPlan
from ffhnet.grasps import Grasps
from ffhnet.grasps_file import load_grasps, load_plan, save_grasps, save_plan
from ffhnet.hands import load_hand


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


def make_plan(kept, dropped, arm=False):
    hand, rng = load_hand(), np.random.default_rng(1)

    def draw(count):
        return Grasps(
            rotation=matrix_from_rotation_vector(rng.normal(size=(count, 3))),
            position=rng.normal(size=(count, 3)),
            joints=rng.uniform(hand.lower, hand.upper, size=(count, hand.num_joints)),
            joint_names=hand.joint_names,
            hand=hand.name,
            frame="camera",
            probability=rng.uniform(size=count),
        )

    reasons = tuple(["table", "object"][i % 2] for i in range(dropped))
    motion = ArmMotion("panda", ("j1", "j2"), np.eye(4), rng.normal(size=(kept, 5, 2)), np.ones((kept, 3, 2)))
    return GraspPlan.of(hand, draw(kept), draw(dropped), reasons, 0.1, 0.012, motion if arm else None)


@pytest.mark.parametrize("suffix", [".json", ".npz"])
@pytest.mark.parametrize(
    ("kept", "dropped", "arm"), [(5, 3, True), (5, 0, False), (0, 4, True), (0, 0, False)]
)
def test_plans_come_back(tmp_path, suffix, kept, dropped, arm):
    plan, path = make_plan(kept, dropped, arm), tmp_path / f"plan{suffix}"
    save_plan(plan, path)
    back = load_plan(path)
    for wanted, came in ((plan.grasps, back.grasps), (plan.dropped, back.dropped)):
        np.testing.assert_array_equal(came.position, wanted.position)
        np.testing.assert_array_equal(came.joints, wanted.joints)
        np.testing.assert_array_equal(came.probability, wanted.probability)
    np.testing.assert_array_equal(load_grasps(path).position, plan.grasps.position)
    np.testing.assert_allclose(back.pregrasp_position, plan.pregrasp_position, atol=1e-12)
    np.testing.assert_array_equal(back.preshape, plan.preshape)
    np.testing.assert_array_equal(back.torque_limit, plan.torque_limit)
    assert (back.standoff, back.lead) == (plan.standoff, plan.lead)
    assert back.reasons == plan.reasons
    if kept:
        np.testing.assert_allclose(back.closing.times, plan.closing.times, atol=1e-6)
        np.testing.assert_allclose(back.closing.joints, plan.closing.joints, atol=1e-6)
    assert (back.arm is None) == (not arm)
    if arm:
        assert back.arm.joint_names == plan.arm.joint_names
        np.testing.assert_array_equal(back.arm.approach.reshape(-1), plan.arm.approach.reshape(-1))


def test_times_in_json_end_with_the_motion(tmp_path):
    """Grasps differ in the number of waypoints: JSON has no filling."""
    plan = make_plan(6, 0)
    assert np.isnan(plan.closing.times).any()
    save_plan(plan, tmp_path / "plan.json")
    for row in json.loads((tmp_path / "plan.json").read_text())["grasps"]:
        assert None not in row["closing_times"]
        assert len(row["closing_times"]) == len(row["closing_joint_angles"])
        assert (np.diff(row["closing_times"]) > 0).all()


def test_grasps_without_a_plan_are_no_plan(tmp_path):
    for suffix in (".json", ".npz"):
        save_grasps(make_grasps(2), tmp_path / f"grasps{suffix}")
        with pytest.raises(InputFileError, match="not a grasp file"):
            load_plan(tmp_path / f"grasps{suffix}")
