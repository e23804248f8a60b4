"""What becomes of each object of a real capture: a grasp that can be done, or why there is none."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial import ConvexHull

from ffhnet.errors import CloudError, SceneError
from ffhnet.evaluation.captures import Capture
from ffhnet.feasibility.planner import Planner
from ffhnet.perception.camera import Intrinsics
from ffhnet.perception.observation import Observation

MAX_WIDTH = 0.09
"""m: wider things are too wide for a hand of human size, unless by a rim or a handle."""

MIN_HEIGHT = 0.03
"""m: lower things lie flat; a hand of this size takes some of them, but not clearly."""

MIN_SEEN = 500
"""Points below which not enough is seen of an object: it is far away, or what is left behind others."""

_BORDER = 3
"""Pixels from the edge of the image within which an object is cut off by it."""


@dataclass(frozen=True)
class FoundObject:
    """One object of a capture.

    Attributes:
        number: its number in the mask, None where it was found without.
        points: how many are seen of it.
        width: of what is seen, the narrower way along the table, m.
        height: above the table, m.
        cut_off: whether the edge of the image cuts it off.
        sampled: grasps sampled for it.
        feasible: how many of these can be done.
        probability: predicted for the best feasible one, None without one.
        dropped: how many were dropped for each reason.
    """

    number: int | None
    points: int
    width: float
    height: float
    cut_off: bool
    sampled: int
    feasible: int
    probability: float | None
    dropped: dict[str, int]

    @property
    def obstacle(self) -> str | None:
        """Why it is not clearly graspable, None if it is."""
        if self.cut_off:
            return "cut off by the view"
        if self.points < MIN_SEEN:
            return "hardly seen"
        if self.width > MAX_WIDTH:
            return "too wide"
        return "too flat" if self.height < MIN_HEIGHT else None


@dataclass(frozen=True)
class SurveyedCapture:
    """All objects of a capture.

    Attributes:
        name: of the capture.
        refusal: the message with which it was refused, None if it was not.
        found: objects that were found in the depth alone, the main one first.
        masked: the objects of the mask, each told from the rest by it.
    """

    name: str
    refusal: str | None
    found: tuple[FoundObject, ...]
    masked: tuple[FoundObject, ...]

    @property
    def good(self) -> bool:
        """Whether every clearly graspable object found has a grasp that can be done."""
        return self.refusal is None and all(seen.feasible for seen in self.found if seen.obstacle is None)


def survey(capture: Capture, planner: Planner, num: int = 400, seed: int = 0) -> SurveyedCapture:
    """Plans grasps for every object of a capture."""
    try:
        seen = capture.observe(seed)
    except (CloudError, SceneError) as error:
        return SurveyedCapture(capture.name, str(error), (), ())

    def plan(observation: Observation, number: int | None) -> FoundObject:
        planned = planner.plan(observation, num, seed)
        best = planned.grasps.probability
        return FoundObject(
            number=number,
            points=len(observation.cloud),
            width=_width(observation.cloud_view[:, :2]),
            height=float(np.percentile(observation.cloud_view[:, 2], 99.5)) - observation.table_height,
            cut_off=capture.intrinsics is not None and _at_border(observation.cloud, capture.intrinsics),
            sampled=len(planned.grasps) + len(planned.dropped),
            feasible=len(planned.grasps),
            probability=float(best[0]) if best is not None and len(best) else None,
            dropped=planned.counts,
        )

    masked = []
    for number in capture.objects:
        try:
            masked.append(plan(capture.observe_masked(number, seed), number))
        except SceneError:
            continue
    return SurveyedCapture(capture.name, None, tuple(plan(one, None) for one in seen), tuple(masked))


def _width(plan: Float[np.ndarray, "N 2"]) -> float:
    """The narrowest way through points in the plane, m; a hundredth at either end is left out as stray."""
    hull = plan[ConvexHull(plan).vertices]
    edges = np.diff(hull, axis=0, append=hull[:1])
    normals = np.column_stack([-edges[:, 1], edges[:, 0]]) / np.linalg.norm(edges, axis=1)[:, None]
    low, high = np.percentile(plan @ normals.T, [1, 99], axis=0)
    return float((high - low).min())


def _at_border(points: Float[np.ndarray, "N 3"], intrinsics: Intrinsics) -> bool:
    """Whether some of the points are at the edge of the image."""
    x, y, z = points.T
    u, v = intrinsics.fx * x / z + intrinsics.cx, intrinsics.fy * y / z + intrinsics.cy
    inside = (u > _BORDER) & (u < intrinsics.width - 1 - _BORDER)
    inside &= (v > _BORDER) & (v < intrinsics.height - 1 - _BORDER)
    return not inside.all()
