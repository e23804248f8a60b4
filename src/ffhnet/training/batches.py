"""Batches grouped by view: V views, and for each G grasps of its placement in its view frame."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from ffhnet.dataset.robustness import local_success
from ffhnet.dataset.training_data import TrainingData
from ffhnet.errors import DatasetError
from ffhnet.geometry.rotations import matrix_from_euler_xyz
from ffhnet.model.tensors import GraspTensors, ObjectTensors
from ffhnet.training.config import ClassShares

HARD_NEGATIVE_SHIFT = 0.03
"""Metres by which a hard negative is moved along each axis (III-D)."""

HARD_NEGATIVE_TURN = 0.6
"""Radians by which a hard negative is turned about each fixed axis (III-D)."""

ANY, SUCCESS, FAILURE, COLLISION, HARD_NEGATIVE = range(5)


@dataclass(frozen=True)
class Batch:
    """What one training step sees.

    Attributes:
        views: which views of the data.
        objects: the same as the networks see them.
        grasps: G grasps of each view's placement, in its view frame.
        label: success in nominal physics.
        robust: success under varied physics; NaN where unknown.
        collision: 1 where the start collided.
    """

    views: Int[np.ndarray, " V"]
    objects: ObjectTensors
    grasps: GraspTensors
    label: Float[Tensor, "V G"]
    robust: Float[Tensor, "V G"]
    collision: Float[Tensor, "V G"]

    def to(self, device: torch.device) -> Batch:
        """The same on another device."""
        return Batch(
            self.views,
            self.objects.to(device),
            self.grasps.to(device),
            self.label.to(device),
            self.robust.to(device),
            self.collision.to(device),
        )


class BatchMaker:
    """Draws batches from training data.

    Args:
        data: views and trials.
        classes: the class of trials that each share in `shares` asks for.
        shares: share of each class in a batch.

    Raises:
        DatasetError: no view shows a placement that has trials of the first class.
    """

    def __init__(self, data: TrainingData, classes: tuple[int, ...], shares: tuple[float, ...]):
        self.data = data
        self.classes = np.array(classes)
        self.shares = np.array(shares)
        trials_of = {
            ANY: np.ones(data.num_trials, dtype=bool),
            SUCCESS: data.success,
            FAILURE: data.executed & ~data.success,
            COLLISION: ~data.executed,
            HARD_NEGATIVE: data.success,
        }
        # Trials of each class sorted by placement, all in one list; a class and a placement give a
        # stretch of it.
        self._trials = np.empty(0, dtype=np.int64)
        self._first = np.zeros((len(trials_of), data.num_placements), dtype=np.int64)
        self._count = np.zeros_like(self._first)
        for kind, mask in trials_of.items():
            trials = np.flatnonzero(mask)
            placement = data.trial_placement[trials]
            self._count[kind] = np.bincount(placement, minlength=data.num_placements)
            self._first[kind] = len(self._trials) + np.cumsum(self._count[kind]) - self._count[kind]
            self._trials = np.concatenate([self._trials, trials[np.argsort(placement, kind="stable")]])
        needed = classes[0] if len(classes) == 1 else ANY
        self._views = np.flatnonzero(self._count[needed][data.view_placement] > 0)
        if len(self._views) == 0:
            raise DatasetError("no view shows a placement with grasps to train on")

    @classmethod
    def for_generator(
        cls, data: TrainingData, min_local_success: float = 0.0, min_margin: float = 0.0
    ) -> BatchMaker:
        """Successful grasps only, with the flexion in which the hand held the object.

        The flexion that was asked for is mostly chance; the one that was reached follows from object and
        palm pose, and closing towards it ends in the same grasp. Joints that do not close keep the angle
        that was asked for: with it the hand has to come in.

        Args:
            data: views and trials.
            min_local_success: successes whose neighbours succeed less often are left out.
            min_margin: successes with a smaller margin to start collisions are left out.
        """
        good = data.success & (data.margin >= min_margin)
        if min_local_success > 0:
            good = good & (local_success(data) >= min_local_success)
        joints = np.where(data.closes, data.closed_joints, data.joints)
        held = dataclasses.replace(data, joints=joints, label=np.where(good, data.label, 0.0))
        return cls(held, (SUCCESS,), (1.0,))

    @classmethod
    def for_evaluator(cls, data: TrainingData, shares: ClassShares | None) -> BatchMaker:
        """Grasps of all classes in the given shares; None draws trials as often as they occur."""
        if shares is None:
            return cls(data, (ANY,), (1.0,))
        wanted = (shares.success, shares.failure, shares.collision, shares.hard_negative)
        return cls(data, (SUCCESS, FAILURE, COLLISION, HARD_NEGATIVE), wanted)

    def draw(self, rng: np.random.Generator, views: int, grasps: int) -> Batch:
        """A batch of V = `views` random views with G = `grasps` random grasps each."""
        view = rng.choice(self._views, size=views)
        kind = self._draw_kinds(rng, view, grasps)
        placement = self.data.view_placement[view][:, None]
        count = self._count[kind, placement]
        trial = self._trials[self._first[kind, placement] + (rng.random(kind.shape) * count).astype(np.int64)]
        return self._assemble(rng, view, trial, kind == HARD_NEGATIVE)

    def _draw_kinds(self, rng: np.random.Generator, view: np.ndarray, grasps: int) -> Int[np.ndarray, "V G"]:
        """A class per slot, in exact shares over the batch; ANY where the placement has none of it."""
        slots = len(view) * grasps
        bounds = np.round(np.cumsum(self.shares) * slots).astype(int)
        in_order = np.repeat(self.classes, np.diff(bounds, prepend=0))
        kind = rng.permutation(in_order).reshape(len(view), grasps)
        placement = self.data.view_placement[view][:, None]
        return np.where(self._count[kind, placement] > 0, kind, ANY)

    def _assemble(
        self, rng: np.random.Generator, view: np.ndarray, trial: np.ndarray, moved: np.ndarray
    ) -> Batch:
        data = self.data
        T_world_view = data.T_world_view[view]
        rotation_wv, origin_w = T_world_view[:, None, :3, :3], T_world_view[:, None, :3, 3]
        rotation = np.swapaxes(rotation_wv, -1, -2) @ data.rotation[trial]
        # A row vector times R_world_view is R_view_world times the column vector.
        position = ((data.position[trial] - origin_w)[:, :, None] @ rotation_wv)[:, :, 0]
        label = np.where(moved, 0.0, data.label[trial])
        if moved.any():
            rotation[moved], position[moved] = hard_negatives(rng, rotation[moved], position[moved])
        return Batch(
            views=view,
            objects=view_tensors(data, view),
            grasps=GraspTensors(_tensor(rotation), _tensor(position), _tensor(data.joints[trial])),
            label=_tensor(label),
            robust=_tensor(np.where(moved, np.nan, data.robust[trial])),
            collision=_tensor(np.where(moved, 0.0, ~data.executed[trial])),
        )


def view_tensors(data: TrainingData, views: Int[np.ndarray, " V"]) -> ObjectTensors:
    """Some views as the networks see them."""
    return ObjectTensors(_tensor(data.bps[views]), _tensor(data.table_height[views]))


def hard_negatives(
    rng: np.random.Generator, rotation: Float[np.ndarray, "N 3 3"], position: Float[np.ndarray, "N 3"]
) -> tuple[Float[np.ndarray, "N 3 3"], Float[np.ndarray, "N 3"]]:
    """Poses moved by exactly ±3 cm along and ±0.6 rad about each axis of their frame (III-D)."""
    shift = HARD_NEGATIVE_SHIFT * rng.choice([-1.0, 1.0], size=position.shape)
    turn = matrix_from_euler_xyz(HARD_NEGATIVE_TURN * rng.choice([-1.0, 1.0], size=position.shape))
    return turn @ rotation, position + shift


def _tensor(array: np.ndarray) -> Tensor:
    return torch.from_numpy(np.ascontiguousarray(array, dtype=np.float32))
