"""The steps in which a flow carries noise to a grasp."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

FlowSolver = Literal["euler", "adams"]
"""Equal steps of Euler, or two-step Adams-Bashforth ones that grow longer."""

ADAMS_PACE = 0.7
"""After a share s of the steps the time is 1 - (1 - s)^0.7: a long last step goes to the mean of what is
still open, where short ones would follow the velocity's errors."""


@dataclass(frozen=True)
class FlowStep:
    """One step: the state gets `now` times the velocity at `time`, and `before` times the one before.

    Attributes:
        time: at which the velocity is asked for, 0 is noise and 1 a grasp.
        now: weight of that velocity.
        before: weight of the last step's velocity; 0 in the first.
    """

    time: float
    now: float
    before: float


def flow_steps(count: int, solver: FlowSolver) -> tuple[FlowStep, ...]:
    """The steps from time 0 to 1."""
    if solver == "euler":
        return tuple(FlowStep(step / count, 1 / count, 0.0) for step in range(count))
    times = [1 - (1 - step / count) ** ADAMS_PACE for step in range(count + 1)]
    lengths = [end - start for start, end in pairwise(times)]
    steps = [FlowStep(0.0, lengths[0], 0.0)]
    for time, (last, length) in zip(times[1:-1], pairwise(lengths), strict=True):
        # The line through both velocities, integrated over the step (Hairer, Norsett, Wanner, III.5).
        bend = length**2 / (2 * last)
        steps.append(FlowStep(time, length + bend, -bend))
    return tuple(steps)
