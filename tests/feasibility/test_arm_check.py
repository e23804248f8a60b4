"""The arm's ways lead to the grasps, past what was seen; and they lift what stands there."""

import dataclasses

import numpy as np
import pytest
import trimesh
from feasibility_scenes import T_WORLD_CAMERA, box, grasps_from, observe, to_camera, tube

pytest.importorskip("mujoco", reason="needs the extra arm")
pytest.importorskip("frankik", reason="needs the extra arm")

from ffhnet.feasibility.arm import ArmCheck, Base, level_frame, observed_level_frame
from ffhnet.feasibility.reasons import Reason
from ffhnet.geometry.transforms import apply, invert, make_transform
from ffhnet.grasp_plan import GraspPlan
from ffhnet.hands import load_hand
from ffhnet.objects.grasp_object import GraspObject
from ffhnet.simulation.panda.execution import ArmExecution
from ffhnet.simulation.panda.kinematics import forward
from ffhnet.simulation.panda.scene import LIFT_DURATION, Mounting, build_arm_scene
from ffhnet.simulation.physics import Physics

T_WORLD_BASE = make_transform(position=np.array([-0.5, -0.1, 0.0]))
AROUND = grasps_from(np.linspace(0, 2 * np.pi, 12, endpoint=False))


def base_of(observation):
    return Base.of(invert(T_WORLD_CAMERA @ observed_level_frame(observation)) @ T_WORLD_BASE)


@pytest.fixture(scope="module")
def planned():
    observation, hand = observe(tube()), load_hand()
    arm = ArmCheck(hand, base_of(observation), Physics(lift_duration=LIFT_DURATION))
    reason, motion = arm.plan(to_camera(AROUND), observation, arm.look(observation))
    return reason, motion


def test_level_frame_is_below_the_camera():
    level = T_WORLD_CAMERA @ observed_level_frame(observe(tube()))
    np.testing.assert_allclose(level[:3, 3], [*T_WORLD_CAMERA[:2, 3], 0], atol=2e-3)
    ahead = T_WORLD_CAMERA[:3, 2] * [1, 1, 0]
    np.testing.assert_allclose(level[:3, 0], ahead / np.linalg.norm(ahead), atol=2e-3)
    np.testing.assert_allclose(level[:3, 2], [0, 0, 1], atol=2e-3)
    base = Base.of(Base(0.1, -0.2, 0.3, 0.4).T_level_base)
    np.testing.assert_allclose([base.x, base.y, base.z, base.yaw], [0.1, -0.2, 0.3, 0.4])
    np.testing.assert_allclose(level_frame(np.array([0, 0, 1.0]), -0.4, np.array([1.0, 0, 1]))[2, 3], -0.4)


def test_the_arm_ends_at_the_grasp(planned):
    reason, motion = planned
    reached = np.flatnonzero(reason == Reason.FEASIBLE)
    assert 2 <= len(reached) < 12
    hand, camera = load_hand(), to_camera(AROUND)
    T_camera_palm = motion.T_frame_base @ forward(motion.approach[reached, -1]) @ hand.T_root_palm
    np.testing.assert_allclose(T_camera_palm[:, :3, 3], camera.position[reached], atol=1e-3)
    np.testing.assert_allclose(T_camera_palm[:, :3, :3], camera.rotation[reached], atol=6e-3)
    assert np.isnan(motion.approach[reason != Reason.FEASIBLE]).all()


def test_a_wall_that_was_seen_is_in_the_way(planned):
    wall = trimesh.creation.box([0.02, 0.7, 0.5]).apply_translation([-0.3, -0.1, 0.25])
    points = apply(invert(T_WORLD_CAMERA), trimesh.sample.sample_surface(wall, 20000, seed=0)[0])
    seen = observe(tube())
    observation = dataclasses.replace(seen, scene=np.concatenate([seen.scene, points]))
    arm = ArmCheck(load_hand(), base_of(observation))
    reason, _ = arm.plan(to_camera(AROUND), observation, arm.look(observation))
    before = planned[0] == Reason.FEASIBLE
    assert (reason[before] == Reason.ARM_COLLISION).all()


def test_no_grasps_are_no_ways():
    observation = observe(tube())
    arm = ArmCheck(load_hand(), base_of(observation))
    reason, motion = arm.plan(to_camera(AROUND)[:0], observation, arm.look(observation))
    assert len(reason) == len(motion.approach) == len(motion.lift) == 0


def test_nobody_reaches_three_metres():
    observation = observe(tube())
    arm = ArmCheck(load_hand(), Base(3.0, 3.0, 0.0, 0.0))
    reason, motion = arm.plan(to_camera(AROUND), observation, arm.look(observation))
    assert (reason == Reason.UNREACHABLE).all()
    assert len(motion[:0].approach) == 0


@pytest.mark.parametrize(
    ("height", "others", "flags"),
    [(0.08, (), ()), (0.08, (box(-0.14, 0.0, 0.05),), ("neighbour",)), (0.055, (), ("table",))],
)
def test_a_plan_is_executed_and_contacts_are_noted(planned, height, others, flags):
    """The hand that lifts the tube; the same past a neighbour, and too low: both touch on the way."""
    hand, physics = load_hand(), Physics(lift_duration=LIFT_DURATION)
    observation = observe(tube())
    arm = ArmCheck(hand, base_of(observation), physics)
    grasp = to_camera(grasps_from(np.pi, height=height))
    reason, motion = arm.plan(grasp, observation, arm.look(observation))
    assert reason[0] == Reason.FEASIBLE
    plan = GraspPlan.of(hand, grasp, grasp[:0], (), physics.approach_distance, physics.control_period, motion)
    target = solid("tube", tube())
    scene = build_arm_scene(hand, target, physics, Mounting(T_WORLD_BASE), [solid("box", m) for m in others])
    done = ArmExecution(scene).execute(plan, 0, np.eye(4), np.tile(np.eye(4), (len(others), 1, 1)))
    assert all(getattr(done, flag) for flag in flags)
    assert done.success == (not flags)
    if not flags:
        assert done.rise > physics.min_rise


def solid(name, mesh):
    return GraspObject(name, name, mesh, (mesh,), 0.2, np.eye(4)[None], ("standing",))
