"""From a noisy depth image to the lifted object with the arm: scenes, plans, and what became of them.

A simulated depth image is all that the planner is given, and the pose of the arm's base as a user gives it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from zlib import crc32

import numpy as np
import torch
import trimesh
from jaxtyping import Float

from ffhnet.errors import CloudError, SceneError
from ffhnet.evaluation.protocol import load_network
from ffhnet.feasibility.arm import ArmCheck, Base, level_frame, observed_level_frame
from ffhnet.feasibility.planner import Planner
from ffhnet.feasibility.reasons import Reason
from ffhnet.geometry.rotations import matrix_from_rotation_vector
from ffhnet.geometry.transforms import apply, invert, make_transform
from ffhnet.hands import load_hand
from ffhnet.objects.catalogue import ObjectSource
from ffhnet.objects.grasp_object import GraspObject
from ffhnet.perception.camera import REALSENSE_D415, random_camera, render_depth
from ffhnet.perception.observation import Observation, observe_depth
from ffhnet.perception.sensor_noise import StereoNoise
from ffhnet.simulation.panda.execution import ArmExecution, Execution
from ffhnet.simulation.panda.scene import LIFT_DURATION, Mounting, build_arm_scene
from ffhnet.simulation.physics import Physics

BASE = make_transform(position=np.array([-0.6, 0.0, 0.0]))
"""Pose of the arm's base in the world: objects stand around the origin, 0.6 m ahead of it."""

_GAP = (0.02, 0.06)
"""m between the circles around neighbours, drawn uniformly."""

_LONE_SPREAD = 0.05
"""m: the first object stands within this of the origin along both axes."""


@dataclass(frozen=True)
class ArmProtocol:
    """How scenes with the arm are made.

    Attributes:
        weights: folder of weights, or None for the shipped ones.
        placements: scenes for each object.
        neighbours: other objects in each scene.
        samples: grasps sampled at a time.
        seed: of all that is random.
        physics: of the executions.
    """

    weights: str | None = None
    placements: int = 1
    neighbours: int = 0
    samples: int = 400
    seed: int = 0
    physics: Physics = field(default_factory=lambda: Physics(lift_duration=LIFT_DURATION))


@dataclass(frozen=True)
class ArmJob:
    """One scene: the first object and its neighbours."""

    sources: tuple[ObjectSource, ...]
    placement: int
    protocol: ArmProtocol


@dataclass(frozen=True)
class ArmOutcome:
    """What became of one scene.

    Attributes:
        objects: names, the one that was to be grasped first.
        azimuth: rad of the camera around the scene, 0 = where the arm stands, pi = opposite.
        sampled: grasps.
        feasible: of these, for the hand alone.
        reasons: how many grasps were dropped for each reason.
        base_error: m by which the observed table puts the base wrong, at the object.
        execution: of the best feasible grasp, or None where there is none.
    """

    objects: tuple[str, ...]
    azimuth: float
    sampled: int = 0
    feasible: int = 0
    reasons: dict[str, int] = field(default_factory=dict)
    base_error: float = float("nan")
    execution: Execution | None = None

    @property
    def success(self) -> bool:
        """Whether the object was lifted and held, and nothing else was touched before closing."""
        return self.execution is not None and self.execution.success

    @property
    def result(self) -> str:
        """In a word or two."""
        if self.execution is None:
            return "no feasible grasp" if self.sampled else "no object seen"
        touched = {
            "touched table": self.execution.table,
            "touched neighbour": self.execution.neighbour,
            "arm touched": self.execution.arm,
        }
        return next((word for word, is_so in touched.items() if is_so), self.execution.outcome.name.lower())


def arm_jobs(sources: list[ObjectSource], protocol: ArmProtocol) -> list[ArmJob]:
    """All scenes; the neighbours of an object are the next ones in the list."""
    count = protocol.neighbours + 1
    return [
        ArmJob(tuple(sources[(i + k) % len(sources)] for k in range(count)), placement, protocol)
        for i in range(len(sources))
        for placement in range(protocol.placements)
    ]


def evaluate_scene(job: ArmJob) -> ArmOutcome:
    """Looks, plans and executes one scene; decided by the objects' names, the placement and the seed."""
    torch.set_num_threads(1)
    protocol = job.protocol
    objects = [source.load() for source in job.sources]
    rng = np.random.default_rng([protocol.seed, crc32(objects[0].name.encode()), job.placement])
    poses = _place(objects, rng)
    T_world_camera = random_camera(rng, np.array([0.0, 0.0, 0.08]))
    azimuth = float(np.arctan2(T_world_camera[1, 3], -T_world_camera[0, 3]))
    meshes = [obj.visual.copy().apply_transform(pose) for obj, pose in zip(objects, poses, strict=True)]
    depth = render_depth(meshes, T_world_camera, REALSENSE_D415)
    depth = StereoNoise().apply(depth, REALSENSE_D415, rng)
    try:
        observation = observe_depth(depth, REALSENSE_D415, rng)
    except (CloudError, SceneError):
        return ArmOutcome(tuple(obj.name for obj in objects), azimuth)

    target = _target(observation, T_world_camera, meshes)
    order = [target, *(i for i in range(len(objects)) if i != target)]
    objects, poses = [objects[i] for i in order], poses[order]
    network = load_network(protocol.weights)
    hand = load_hand(network.info.hand)
    T_camera_level = _true_level_frame(T_world_camera)
    T_level_base = invert(T_world_camera @ T_camera_level) @ BASE
    arm = ArmCheck(hand, Base.of(T_level_base), protocol.physics)
    planner = Planner(network, hand, arm, physics=protocol.physics)
    plan = planner.plan(observation, protocol.samples, seed=int(rng.integers(2**31)))
    of_arm = {Reason.UNREACHABLE.word, Reason.ARM_COLLISION.word, Reason.NOT_TRIED.word}
    by_arm = sum(count for reason, count in plan.counts.items() if reason in of_arm)
    execution = None
    if len(plan.grasps):
        scene = build_arm_scene(hand, objects[0], protocol.physics, Mounting(BASE), objects[1:])
        execution = ArmExecution(scene).execute(plan, 0, poses[0], poses[1:])
    seen_base = observed_level_frame(observation) @ T_level_base
    wrong = apply(invert(seen_base) @ T_camera_level @ T_level_base, np.array([0.6, 0.0, 0.1]))
    return ArmOutcome(
        objects=tuple(obj.name for obj in objects),
        azimuth=azimuth,
        sampled=len(plan.grasps) + len(plan.dropped),
        feasible=len(plan.grasps) + by_arm,
        reasons=plan.counts,
        base_error=float(np.linalg.norm(wrong - np.array([0.6, 0.0, 0.1]))),
        execution=execution,
    )


def _place(objects: list[GraspObject], rng: np.random.Generator) -> Float[np.ndarray, "K 4 4"]:
    """Poses (world) of objects in their first resting pose at random yaw, side by side without touching."""
    poses, centres, radii = [], np.zeros((0, 2)), np.zeros(0)
    for obj in objects:
        turn = matrix_from_rotation_vector(np.array([0.0, 0.0, rng.uniform(0, 2 * np.pi)]))
        pose = make_transform(turn) @ obj.resting_poses[0]
        corners = apply(pose, obj.visual.vertices)[:, :2]
        middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
        radius = np.linalg.norm(corners - middle, axis=1).max()
        centre = rng.uniform(-_LONE_SPREAD, _LONE_SPREAD, size=2)
        if len(centres):
            # Outwards from the origin in a random direction until there is room.
            angle, gap = rng.uniform(0, 2 * np.pi), rng.uniform(*_GAP)
            ways = np.arange(0.0, 1.0, 0.005)[:, None] * [np.cos(angle), np.sin(angle)]
            room = np.linalg.norm(ways[:, None] - centres, axis=2) - radii
            centre = ways[np.argmax((room > radius + gap).all(axis=1))]
        pose[:2, 3] += centre - middle
        poses.append(pose)
        centres, radii = np.vstack([centres, centre]), np.append(radii, radius)
    return np.array(poses)


def _target(
    observation: Observation, T_world_camera: Float[np.ndarray, "4 4"], meshes: list[trimesh.Trimesh]
) -> int:
    """The object that the observed points belong to."""
    points = apply(T_world_camera, observation.cloud)
    inside = [
        ((points > mesh.bounds[0] - 0.01) & (points < mesh.bounds[1] + 0.01)).all(axis=1).sum()
        for mesh in meshes
    ]
    return int(np.argmax(inside))


def _true_level_frame(T_world_camera: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "4 4"]:
    """T_camera_level of the table as it is, which is how well the user knows where the base stands."""
    return level_frame(T_world_camera[2, :3], -float(T_world_camera[2, 3]), np.array([0.0, 0.0, 1.0]))
