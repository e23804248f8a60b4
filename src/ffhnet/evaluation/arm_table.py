"""What an evaluation with the arm counted, as a table and as JSON."""

from __future__ import annotations

import dataclasses
import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ffhnet.evaluation.arm import ArmOutcome
from ffhnet.metrics import Interval, wilson_interval


@dataclass(frozen=True)
class Share:
    """A count of a total, with its 95 % Wilson interval."""

    name: str
    count: int
    total: int

    @property
    def interval(self) -> Interval:
        """Of the share."""
        return wilson_interval(self.count, self.total)

    @property
    def text(self) -> str:
        """Share, counts and interval."""
        if self.total == 0:
            return "-"
        low, high = 100 * self.interval.low, 100 * self.interval.high
        return f"{self.count / self.total:.1%} ({self.count}/{self.total}; {low:.1f} to {high:.1f})"

    def to_json(self) -> dict[str, Any]:
        """Count, total and interval."""
        return {"count": self.count, "total": self.total, "interval": dataclasses.astuple(self.interval)}


def shares(outcomes: Sequence[ArmOutcome]) -> tuple[Share, ...]:
    """What the scenes have come to."""
    done = [o.execution for o in outcomes if o.execution is not None]

    def of_done(name: str, flags: list[bool]) -> Share:
        return Share(name, sum(flags), len(done))

    return (
        Share(
            "best feasible grasp lifts and holds, nothing else touched",
            sum(o.success for o in outcomes),
            len(outcomes),
        ),
        of_done("of the executed", [e.success for e in done]),
        of_done("hand touches no table before closing", [not e.table for e in done]),
        of_done("hand touches no neighbour before closing", [not e.neighbour for e in done]),
        of_done("arm touches nothing", [not e.arm for e in done]),
        of_done("hand touches the object before closing", [e.object for e in done]),
        of_done("a neighbour moved by more than 1 cm", [e.moved > 0.01 for e in done]),
        Share(
            "samples that the hand can do",
            sum(o.feasible for o in outcomes),
            sum(o.sampled for o in outcomes),
        ),
    )


def results(outcomes: Sequence[ArmOutcome]) -> dict[str, int]:
    """How many scenes ended how, the most frequent first."""
    return dict(Counter(o.result for o in outcomes).most_common())


def to_json(outcomes: Sequence[ArmOutcome], protocol: dict[str, Any]) -> str:
    """Protocol, shares, results and every scene."""
    errors = [o.base_error for o in outcomes if np.isfinite(o.base_error)]
    report = {
        "protocol": protocol,
        "shares": {share.name: share.to_json() for share in shares(outcomes)},
        "results": results(outcomes),
        "median_base_error_m": float(np.median(errors)) if errors else None,
        "scenes": [_scene(o) for o in outcomes],
    }
    return json.dumps(report, indent=1) + "\n"


def _scene(outcome: ArmOutcome) -> dict[str, Any]:
    row = {
        "objects": outcome.objects,
        "camera_azimuth": round(outcome.azimuth, 4),
        "result": outcome.result,
        "sampled": outcome.sampled,
        "feasible": outcome.feasible,
        "dropped": outcome.reasons,
    }
    done = outcome.execution
    if done is None:
        return row
    return row | {
        "lift": done.outcome.name.lower(),
        "rise": round(done.rise, 4),
        "touched_object": done.object,
        "neighbour_moved": round(done.moved, 4),
    }
