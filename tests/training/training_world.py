"""A small learnable world: an object is a point; within 3 cm of it a grasp succeeds, low ones collide."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest
import torch

from ffhnet.dataset.training_data import TrainingData
from ffhnet.geometry.rotations import about_z
from ffhnet.geometry.transforms import apply, invert, make_transform
from ffhnet.model.config import ModelConfig

torch.set_num_threads(1)

JOINT_NAMES = ("a", "b", "c")
JOINT_LIMITS = ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
SUCCESS_RADIUS = 0.03
BASIS = np.random.default_rng(99).normal(size=(64, 3)) * 0.1
MODEL = ModelConfig(
    num_joints=3,
    bps_size=64,
    pca_components=12,
    inner_width=48,
    width=64,
    dropout=0.1,
    generator="cvae",
    palm_points=0,
    flow_width=64,
    flow_blocks=2,
)


@contextmanager
def killed(task: type, at: int) -> Iterator[None]:
    """Trainings of this task in here die at a step, as by Ctrl-C."""
    plain_loss = task.loss

    def dies(self, step: int, rng: np.random.Generator):
        if step == at:
            raise KeyboardInterrupt
        return plain_loss(self, step, rng)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(task, "loss", dies)
        with pytest.raises(KeyboardInterrupt):
            yield
    torch.manual_seed(12345)  # resuming must not lean on the state of global generators


def point_world(seed: int, objects: int = 60, views: int = 3, trials: int = 60) -> TrainingData:
    """One placement per object; the third joint of a trial is its index, so that tests can find it again."""
    rng = np.random.default_rng(seed)
    point = rng.uniform([-0.4, -0.4, 0.0], [0.4, 0.4, 0.1], size=(objects, 3))
    view_placement = np.repeat(np.arange(objects), views)
    trial_placement = rng.permutation(np.repeat(np.arange(objects), trials))
    yaw = rng.uniform(-np.pi, np.pi, len(view_placement))
    T_world_view = make_transform(
        np.stack([about_z(a) for a in yaw]),
        point[view_placement] + rng.uniform(-0.06, 0.06, (len(view_placement), 3)),
    )
    bps = np.stack(
        [
            np.linalg.norm(BASIS - apply(invert(T), point[p]), axis=1)
            for T, p in zip(T_world_view, view_placement, strict=True)
        ]
    )
    position = point[trial_placement] + rng.uniform(-0.04, 0.04, (len(trial_placement), 3))
    executed = position[:, 2] > point[trial_placement, 2] - 0.02
    near = np.linalg.norm(position - point[trial_placement], axis=1) < SUCCESS_RADIUS
    joints = rng.random((len(position), 3))
    joints[:, 2] = np.arange(len(position)) / len(position)
    return TrainingData(
        hand="point_hand",
        joint_names=JOINT_NAMES,
        closes=np.ones(len(JOINT_NAMES), bool),
        object_names=tuple(f"object_{k}" for k in range(objects)),
        placement_object=np.arange(objects),
        view_placement=view_placement,
        bps=bps.astype(np.float32),
        table_height=-T_world_view[:, 2, 3],
        T_world_view=T_world_view,
        trial_placement=trial_placement,
        rotation=np.stack([about_z(a) for a in rng.uniform(-np.pi, np.pi, len(position))]),
        position=position,
        joints=joints,
        closed_joints=joints,
        margin=np.ones(len(joints)),
        label=(near & executed).astype(float),
        robust=np.where(np.arange(len(joints)) % 3 == 0, near & executed, np.nan),
        executed=executed,
        proposer=np.zeros(len(position), dtype=int),
    )
