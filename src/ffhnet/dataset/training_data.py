"""`TrainingData`: the arrays that training needs, whatever files they came from."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from ffhnet.errors import DatasetError

TRIAL_FIELDS = (
    "trial_placement",
    "rotation",
    "position",
    "joints",
    "closed_joints",
    "margin",
    "label",
    "robust",
    "executed",
    "proposer",
)
"""Attributes of `TrainingData` with one row per trial."""


@dataclass(frozen=True)
class TrainingData:
    """V camera views and T grasp trials of P placements of some objects.

    A grasp belongs to a placement (an object resting in the world), not to the view it was found from:
    it is trained with every view of its placement.

    Attributes:
        hand: name of the hand.
        joint_names: order of the joint angles.
        closes: for each joint, whether it takes part in the closing motion.
        object_names: one name per object.
        placement_object: index into `object_names` for each placement.
        view_placement: placement that each view shows.
        bps: basis point set vector of each view, metres (16 or 32 bit).
        table_height: z of the table in the view frame, metres (negative).
        T_world_view: pose of the view frame in the world.
        trial_placement: placement of each trial.
        rotation: palm axes as columns, world frame.
        position: palm origin in metres, world frame.
        joints: joint angles to which the open hand was closed, radians.
        closed_joints: joint angles that it reached, against object or limit, radians.
        margin: share of neighbouring palm poses at which the open hand touches nothing either.
        label: success in [0, 1] in nominal physics.
        robust: share of repeats under varied physics that succeeded; NaN where a trial was not repeated.
            Those that cannot succeed (start collisions, no contact) are 0 as often as the others were
            repeated, so that what is known is a fair sample of all.
        executed: False where the hand collided at the start, so that nothing was executed (label 0).
        proposer: code of what proposed the grasp.
    """

    hand: str
    joint_names: tuple[str, ...]
    closes: Bool[np.ndarray, " J"]
    object_names: tuple[str, ...]
    placement_object: Int[np.ndarray, " P"]
    view_placement: Int[np.ndarray, " V"]
    bps: Float[np.ndarray, "V 4096"]
    table_height: Float[np.ndarray, " V"]
    T_world_view: Float[np.ndarray, "V 4 4"]
    trial_placement: Int[np.ndarray, " T"]
    rotation: Float[np.ndarray, "T 3 3"]
    position: Float[np.ndarray, "T 3"]
    joints: Float[np.ndarray, "T J"]
    closed_joints: Float[np.ndarray, "T J"]
    margin: Float[np.ndarray, " T"]
    label: Float[np.ndarray, " T"]
    robust: Float[np.ndarray, " T"]
    executed: Bool[np.ndarray, " T"]
    proposer: Int[np.ndarray, " T"]

    def __post_init__(self) -> None:
        views, trials = self.num_views, self.num_trials
        wanted: dict[str, tuple[int, ...]] = {
            "bps": (views, *np.shape(self.bps)[1:2]),
            "table_height": (views,),
            "T_world_view": (views, 4, 4),
            "rotation": (trials, 3, 3),
            "position": (trials, 3),
            "joints": (trials, len(self.joint_names)),
            "closed_joints": (trials, len(self.joint_names)),
            "margin": (trials,),
            "label": (trials,),
            "robust": (trials,),
            "executed": (trials,),
            "proposer": (trials,),
        }
        for name, shape in wanted.items():
            came = np.shape(getattr(self, name))
            if came != shape:
                raise DatasetError(f"TrainingData.{name} must have shape {shape}, got {came}")
        _check_indices("placement_object", self.placement_object, len(self.object_names))
        _check_indices("view_placement", self.view_placement, self.num_placements)
        _check_indices("trial_placement", self.trial_placement, self.num_placements)
        if not np.all((self.label >= 0) & (self.label <= 1)):
            raise DatasetError("labels must lie between 0 and 1")
        if np.any(self.label[~self.executed] != 0):
            raise DatasetError("a trial that was not executed must have label 0")

    @property
    def num_views(self) -> int:
        """V."""
        return len(self.view_placement)

    @property
    def num_trials(self) -> int:
        """T."""
        return len(self.trial_placement)

    @property
    def num_placements(self) -> int:
        """P."""
        return len(self.placement_object)

    @property
    def success(self) -> Bool[np.ndarray, " T"]:
        """Executed trials that lift the object at least every other time."""
        return self.executed & (self.label >= 0.5)

    def select_objects(self, keep: Bool[np.ndarray, " O"] | Sequence[str]) -> TrainingData:
        """The placements, views and trials of some objects, given by a mask or by names.

        Raises:
            DatasetError: a name that is not among `object_names`.
        """
        if isinstance(keep, np.ndarray):
            mask = keep.astype(bool)
        else:
            unknown = sorted(set(keep) - set(self.object_names))
            if unknown:
                raise DatasetError(f"objects not in this data set: {', '.join(unknown)}")
            mask = np.isin(self.object_names, list(keep))
        new_object = np.cumsum(mask) - 1
        placements = mask[self.placement_object]
        new_placement = np.cumsum(placements) - 1
        views, trials = placements[self.view_placement], placements[self.trial_placement]
        kept = self.select_trials(trials)
        return dataclasses.replace(
            kept,
            object_names=tuple(n for n, chosen in zip(self.object_names, mask, strict=True) if chosen),
            placement_object=new_object[self.placement_object[placements]],
            view_placement=new_placement[self.view_placement[views]],
            bps=self.bps[views],
            table_height=self.table_height[views],
            T_world_view=self.T_world_view[views],
            trial_placement=new_placement[kept.trial_placement],
        )

    def select_trials(self, keep: Bool[np.ndarray, " T"]) -> TrainingData:
        """All objects and views with some of the trials."""
        return dataclasses.replace(self, **{name: getattr(self, name)[keep] for name in TRIAL_FIELDS})


def _check_indices(name: str, index: np.ndarray, size: int) -> None:
    if len(index) and (index.min() < 0 or index.max() >= size):
        raise DatasetError(f"TrainingData.{name} must lie in [0, {size}), got {index.min()} to {index.max()}")
