"""The physics constants that decide labels, in one place, with units and reasons.

Masses stand in `objects.grasp_object`, torques and closing motion with the hand.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Physics:
    """Simulator settings and the definition of success.

    Attributes:
        timestep: s. How far labels depend on it: `docs/figures.md`, "Labels".
        control_period: s between updates of the finger targets; a multiple of the timestep.
        friction: sliding, torsional (m), rolling (m) coefficients of every contact.
        contact_time_constant: s of MuJoCo's soft contact (solref); at least two timesteps.
        impratio: friction is this much stiffer than the normal force; 1 lets round objects creep out, 10 lets
            held objects creep by 3 mm/s.
        lift_height: m that the hand rises relative to the table (section III-A).
        lift_duration: s of the quintic lift.
        hold_duration: s of holding at the top.
        min_rise: m that the object must have risen at the end (the authors' label: 15 of 20 cm).
        max_hold_slip: m that the object may move in the hand during the hold ("without slippage").
        approach_distance: m of straight approach along the palm's x axis that must be free.
        approach_steps: number of poses checked along it.
    """

    timestep: float = 0.002
    control_period: float = 0.012
    friction: tuple[float, float, float] = (0.8, 0.005, 0.0001)
    contact_time_constant: float = 0.01
    impratio: float = 30.0
    lift_height: float = 0.20
    lift_duration: float = 0.7
    hold_duration: float = 0.5
    min_rise: float = 0.15
    max_hold_slip: float = 0.005
    approach_distance: float = 0.10
    approach_steps: int = 5
