"""Outcomes of views made by hand."""

import numpy as np

from ffhnet.evaluation.outcomes import Condition, Coverage, Samples, Tries, ViewOutcome
from ffhnet.grasps import Grasps


def tries(success, executed=None):
    success = np.array(success, dtype=bool)
    return Tries(success, np.ones(len(success), bool) if executed is None else np.array(executed, bool))


def condition(name="nominal", top=(1,), random=(), any_yaw=(0,), short_side=(0,)):
    return Condition(name, tries(top), tries(random), tries(any_yaw), tries(short_side))


def view(
    name,
    probability,
    success,
    executed=None,
    *,
    drawn=None,
    score=None,
    heuristic=(),
    pose="standing",
    height=0.1,
    conditions=None,
    distinct=None,
):
    """Samples are given best first; all are drawn unless said otherwise."""
    n = len(probability)
    grasps = Grasps(
        rotation=np.tile(np.eye(3), (n, 1, 1)),
        position=np.zeros((n, 3)),
        joints=np.zeros((n, 1)),
        joint_names=("a",),
        hand="made",
        frame="world",
        probability=np.array(probability, dtype=float),
    )
    samples = Samples(
        rank=np.arange(n),
        score=np.array(probability if score is None else score, dtype=float),
        drawn=np.ones(n, bool) if drawn is None else np.array(drawn, bool),
        grasps=grasps,
        tries=tries(success, executed),
    )
    return ViewOutcome(
        object_name=name,
        pose_name=pose,
        height=height,
        samples=samples,
        heuristic=tries(heuristic),
        conditions=(condition(top=success[:5]),) if conditions is None else conditions,
        strict=(),
        coverage=None if distinct is None else Coverage(distinct + 1, distinct, 2, 1.0),
        T_world_object=np.eye(4),
        view=None,
    )
