"""The arm under the hand: what it reaches, what it hits, and that it lifts what the floating hand lifts."""

import mujoco
import numpy as np
import pytest
import trimesh

from ffhnet.errors import OptionError
from ffhnet.geometry.transforms import invert, make_transform
from ffhnet.grasps import Grasps
from ffhnet.hands import load_hand
from ffhnet.objects.grasp_object import GraspObject
from ffhnet.simulation.panda.kinematics import forward, within_limits
from ffhnet.simulation.panda.reach import MAX_STEP, PandaReach, Reach
from ffhnet.simulation.panda.scene import Mounting, build_arm_scene
from ffhnet.simulation.panda.trial import ArmTrial
from ffhnet.simulation.physics import Physics
from ffhnet.simulation.scene import ARM, HAND, OBJECT, TABLE, build_scene
from ffhnet.simulation.trial import GraspTrial, Outcome

pytest.importorskip("frankik")


@pytest.fixture(scope="module")
def hand():
    return load_hand()


@pytest.fixture(scope="module")
def can():
    mesh = trimesh.creation.cylinder(0.03, 0.14, sections=32)
    mesh.apply_translation([0, 0, 0.07])
    return GraspObject("cylinder", "can", mesh, (mesh,), 0.15, np.eye(4)[None], ("standing",))


@pytest.fixture(scope="module")
def trial(hand, can):
    return ArmTrial(build_arm_scene(hand, can, Physics(lift_duration=1.0)))


def grasps_from(hand, directions, distance=0.12, height=0.08):
    """Palm x level, towards the world's z axis from horizontal directions (rad about z); palm y up."""
    back = np.stack([np.cos(directions), np.sin(directions), np.zeros(len(directions))], axis=1)
    up = np.broadcast_to([0.0, 0.0, 1.0], back.shape)
    return Grasps(
        rotation=np.stack([-back, up, np.cross(-back, up)], axis=2),
        position=distance * back + [0.0, 0.0, height],
        joints=np.zeros((len(back), hand.num_joints)),
        joint_names=hand.joint_names,
        hand=hand.name,
        frame="world",
    )


@pytest.fixture(scope="module")
def around(hand):
    return grasps_from(hand, np.linspace(0, 2 * np.pi, 24, endpoint=False))


def test_paths_follow_approach_grasp_and_lift_on_one_branch(hand, can, around):
    physics, mounting = Physics(), Mounting()
    paths = PandaReach.for_object(hand, can, physics, mounting).plan(around, np.eye(4))
    assert 3 <= paths.reachable.sum() < 24
    path = np.concatenate([paths.approach, paths.lift], axis=1)
    assert np.isnan(path[~paths.reachable]).all()
    assert within_limits(path[paths.reachable]).all()
    assert np.abs(np.diff(path[paths.reachable], axis=1)).max() <= MAX_STEP
    T_world_palm = mounting.T_world_base @ forward(path) @ mounting.T_flange_root @ hand.T_root_palm
    for i in np.flatnonzero(paths.reachable):
        position, turn = T_world_palm[i, :, :3, 3], T_world_palm[i, :, :3, :3]
        np.testing.assert_allclose(turn, np.broadcast_to(around.rotation[i], turn.shape), atol=5e-3)
        at_grasp = paths.approach.shape[1] - 1
        np.testing.assert_allclose(position[at_grasp], around.position[i], atol=5e-4)
        start = around.position[i] - physics.approach_distance * around.rotation[i, :, 0]
        np.testing.assert_allclose(position[0], start, atol=5e-4)
        top = around.position[i] + [0, 0, physics.lift_height]
        np.testing.assert_allclose(position[-1], top, atol=5e-4)


def test_reach_turns_with_the_arm(hand, can, around):
    """An arm at another side reaches the same grasps, seen from there, on the round object."""
    turned = np.eye(4)
    turned[:2, :2] = [[0.0, -1.0], [1.0, 0.0]]
    here = PandaReach.for_object(hand, can).reachable(around, np.eye(4))
    mounting = Mounting(T_world_base=turned @ Mounting().T_world_base)
    there = PandaReach.for_object(hand, can, mounting=mounting).reachable(
        around.to_frame(turned, "world"), turned
    )
    np.testing.assert_array_equal(here, there)


def test_far_grasps_have_no_posture(hand):
    far = grasps_from(hand, np.zeros(1)).to_frame(make_transform(position=np.array([2.0, 0, 0])), "world")
    paths = PandaReach.for_object(hand).plan(far)
    assert paths.reason.tolist() == [Reach.NO_POSTURE]


def test_high_grasps_cannot_be_lifted(hand):
    """The arm ends 1.19 m above its base: where a grasp can be reached, but not 20 cm higher."""
    high = grasps_from(hand, np.full(20, np.pi), distance=0.0, height=0.0)
    high = high.replace(position=high.position + np.linspace(0.3, 1.2, 20)[:, None] * [0, 0, 1])
    reasons = PandaReach.for_object(hand).plan(high).reason.tolist()
    assert reasons[0] == Reach.REACHABLE
    assert Reach.NO_PATH in reasons
    assert reasons[-1] == Reach.NO_POSTURE


def test_a_low_arm_hits_the_table(hand):
    """A table over the base's height is in the way of the arm that reaches for things under its edge."""
    sunken = Mounting(T_world_base=make_transform(position=np.array([-0.5, 0, -0.35])))
    side = grasps_from(hand, np.linspace(2.5, 3.8, 8), height=0.05)
    standing = PandaReach.for_object(hand).plan(side)
    low = PandaReach.for_object(hand, mounting=sunken).plan(side)
    assert standing.reachable.any()
    assert not low.reachable.any()
    assert (low.reason == Reach.HITS_TABLE).any()


def test_an_object_on_the_way_of_the_arm_is_hit(hand, around):
    """A tall wall between base and hand stands in the forearm's way, not in the hand's."""
    wall = trimesh.creation.box([0.02, 1.0, 1.2])
    wall.apply_translation([-0.28, 0, 0.6])
    screen = GraspObject("wall", "box", wall, (wall,), 1.0, np.eye(4)[None], ("standing",))
    free = PandaReach.for_object(hand).reachable(around)
    paths = PandaReach.for_object(hand, screen).plan(around, np.eye(4))
    assert free.any()
    assert not paths.reachable.any()
    assert (paths.reason[free] == Reach.HITS_OBJECT).all()


def test_reach_wants_a_pose_exactly_with_an_object(hand, can, around):
    with pytest.raises(OptionError, match="pose"):
        PandaReach.for_object(hand, can).plan(around)
    with pytest.raises(OptionError, match="pose"):
        PandaReach.for_object(hand).plan(around, np.eye(4))


def test_scene_is_the_floating_one_with_an_arm(hand, can):
    """What decides labels is the same: contacts, hand and object."""
    floating, arm = build_scene(hand, can), build_arm_scene(hand, can)
    for owner in (TABLE, OBJECT, HAND):
        for name in ("geom_friction", "geom_solref", "geom_solimp", "geom_condim", "geom_size"):
            one, other = getattr(floating.model, name), getattr(arm.model, name)
            np.testing.assert_array_equal(one[floating.geom_owner == owner], other[arm.geom_owner == owner])
    assert (arm.geom_owner == ARM).sum() == arm.model.ngeom - floating.model.ngeom
    assert arm.model.opt.timestep == floating.model.opt.timestep


def test_hand_is_placed_where_the_floating_one_is(hand, can, around):
    scene = build_arm_scene(hand, can)
    paths = PandaReach(scene).plan(around, np.eye(4))
    i = np.flatnonzero(paths.reachable)[0]
    scene.posture.branch = paths.approach[i, -1]
    T_world_root = make_transform(around.rotation[i], around.position[i]) @ invert(hand.T_root_palm)
    retreat = make_transform(position=-0.1 * around.rotation[i, :, 0])
    for pose in (T_world_root, retreat @ T_world_root):
        scene.place_hand(pose, np.zeros(hand.num_joints))
        mujoco.mj_kinematics(scene.model, scene.data)
        np.testing.assert_allclose(scene.data.body("hand").xpos, pose[:3, 3], atol=1e-5)
        np.testing.assert_allclose(scene.data.body("hand").xmat.reshape(3, 3), pose[:3, :3], atol=1e-5)


def test_arm_lifts_a_can_and_repeats_itself(hand, can, trial, around):
    chosen = around[np.flatnonzero(trial.free(around, np.eye(4)))[[0, -1]]]
    floating = GraspTrial(build_scene(hand, can)).run(chosen, np.eye(4))
    assert floating.success.all()
    first, second = trial.run(chosen, np.eye(4)), trial.run(chosen[::-1], np.eye(4))
    assert first.success.all()
    assert (first.rise > 0.17).all()
    np.testing.assert_array_equal(first.outcome, second.outcome[::-1])
    np.testing.assert_array_equal(first.rise, second.rise[::-1])
    # The arm gives way by a millimetre: the fingers end near where those of the floating hand do.
    assert np.abs(first.closed_joints - floating.closed_joints).mean() < 0.05


def test_grasps_out_of_reach_are_not_executed(hand, trial):
    far = grasps_from(hand, np.zeros(1), distance=1.0)
    assert not trial.free(far, np.eye(4))[0]
    results = trial.run(far, np.eye(4))
    assert Outcome(results.outcome[0]) == Outcome.COLLISION
    assert not results.executed[0]
