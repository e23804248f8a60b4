"""Real depth in, physics out: grasps planned from a capture, executed on the mesh registered to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Float

from ffhnet.errors import ObjectError, SceneError
from ffhnet.evaluation.captures import Capture, RegisteredMesh
from ffhnet.feasibility.planner import Planner
from ffhnet.geometry.rotations import matrix_from_rotation_vector
from ffhnet.geometry.transforms import apply, invert, make_transform
from ffhnet.hands import Hand
from ffhnet.objects.grasp_object import GraspObject
from ffhnet.objects.scans import load_scan
from ffhnet.perception.cloud import search_tree
from ffhnet.perception.observation import Observation
from ffhnet.simulation.scene import build_scene
from ffhnet.simulation.trial import GraspTrial, Outcome

NO_GRASP = "no feasible grasp"

_ON_MESH = 0.01
"""m from a registered mesh within which a point is taken for a point of the object."""

_ALONE = 0.8
"""Least share of a cluster's points on the mesh; else it is several objects that touch: the mask is used."""

_SAMPLE = 20000
_MAX_LEAN = np.radians(20.0)
"""Between a registered pose and the nearest resting pose: more is a wrong pose."""


@dataclass(frozen=True)
class CaptureTrial:
    """The best feasible grasp of one seed, executed.

    Attributes:
        seed: of plane, samples and all else that is random.
        masked: whether the mask was needed to tell the object from one that it touches.
        outcome: name of the `Outcome` in lower case, or `NO_GRASP`.
        feasible: grasps that could be done, of those sampled.
        sampled: grasps sampled.
        probability: predicted for the executed grasp, None without one.
        moved: m by which the middle of the object was moved from its registered pose to rest on the table.
        turned: rad likewise.
    """

    seed: int
    masked: bool
    outcome: str
    feasible: int
    sampled: int
    probability: float | None
    moved: float

    @property
    def success(self) -> bool:
        """Whether the object was lifted and held."""
        return self.outcome == Outcome.SUCCESS.name.lower()


class CapturePhysics:
    """Trials on one registered object of a capture; build once, run any number of seeds."""

    def __init__(self, capture: Capture, target: RegisteredMesh, hand: Hand, planner: Planner) -> None:
        """Reads the mesh; raises what `load_scan` raises."""
        self._capture, self._target, self._planner = capture, target, planner
        self.object: GraspObject = load_scan(target.path)
        self._trial = GraspTrial(build_scene(hand, self.object))

    def run(self, seed: int, num: int = 400) -> CaptureTrial:
        """Observes, plans and executes the best of `num` grasps that can be done."""
        observation, masked = observe_registered(self._capture, self._target, seed)
        plan = self._planner.plan(observation, num, seed)
        T_world_input = table_frame(self._capture, self._target, observation)
        T_registered = T_world_input @ self._target.T_input_mesh
        T_world_object = put_down(self.object, T_registered)
        vertices = np.asarray(self.object.visual.vertices)
        registered = apply(T_registered, vertices)
        outcome, probability = NO_GRASP, None
        if len(plan.grasps) > 0:
            best = plan.grasps[:1].to_frame(T_world_input, "world")
            outcome = Outcome(self._trial.run(best, T_world_object).outcome[0]).name.lower()
            assert best.probability is not None
            probability = float(best.probability[0])
        return CaptureTrial(
            seed=seed,
            masked=masked,
            outcome=outcome,
            feasible=len(plan.grasps),
            sampled=len(plan.grasps) + len(plan.dropped),
            probability=probability,
            moved=float(np.linalg.norm(apply(T_world_object, vertices) - registered, axis=1).max()),
        )


def observe_registered(capture: Capture, target: RegisteredMesh, seed: int) -> tuple[Observation, bool]:
    """The object of a registered mesh, and whether the mask was needed to tell it from what it touches.

    Raises:
        SceneError: nothing that was found, with the mask or without, is the object.
    """
    surface = trimesh.load_mesh(target.path, process=False).sample(_SAMPLE, seed=0)
    tree = search_tree(apply(target.T_input_mesh, surface))

    def on_mesh(observation: Observation) -> int:
        distance, _ = tree.query(observation.cloud, distance_upper_bound=_ON_MESH)
        return int(np.isfinite(distance).sum())

    found = capture.observe(seed)
    counts = [on_mesh(observation) for observation in found]
    best = int(np.argmax(counts))
    if counts[best] > _ALONE * len(found[best].cloud):
        return found[best], False
    if target.number is None:
        raise SceneError(f"{capture.name}: no object is where {target.name} was registered")
    return capture.observe_masked(target.number, seed), True


def table_frame(
    capture: Capture, target: RegisteredMesh, observation: Observation
) -> Float[np.ndarray, "4 4"]:
    """T_world_input with the estimated table at z = 0; that of an object without its scene is the mesh's."""
    if capture.cut_out:
        return invert(target.T_input_mesh)
    on_table = make_transform(position=np.array([0.0, 0.0, -observation.table_height]))
    return on_table @ invert(observation.T_input_view)


def put_down(obj: GraspObject, T_world_object: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "4 4"]:
    """The object in the resting pose nearest to a pose: turned least, about its middle, and lowered.

    A registered pose leans by the error of its fit, on an edge of the object, from which it would topple.

    Raises:
        ObjectError: it rests in no pose near this one.
    """
    ups = T_world_object[:3, :3] @ obj.resting_poses[:, 2, :3].T
    up = ups[:, np.argmax(ups[2])]
    angle = np.arccos(np.clip(up[2], -1, 1))
    if angle > _MAX_LEAN:
        raise ObjectError(
            f"{obj.name} wanted a resting pose within {np.degrees(_MAX_LEAN):.0f} degrees of the registered "
            f"pose, the nearest is {np.degrees(angle):.0f} degrees off"
        )
    axis = np.cross(up, [0.0, 0.0, 1.0])
    turn = matrix_from_rotation_vector(angle * axis / max(np.linalg.norm(axis), 1e-12))
    rotation = turn @ T_world_object[:3, :3]
    vertices = np.asarray(obj.visual.vertices)
    middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    position = apply(T_world_object, middle) - rotation @ middle
    position[2] = -(vertices @ rotation[2]).min()
    return make_transform(rotation, position)
