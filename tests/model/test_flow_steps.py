"""The solvers integrate known velocities: what a flow's steps must get right whatever the network says."""

import numpy as np
import pytest

from ffhnet.errors import OptionError
from ffhnet.model.config import ModelConfig
from ffhnet.model.flow_steps import flow_steps


def integral(velocity, count, solver) -> float:
    """From time 0 to 1, of a velocity that depends on time alone."""
    total, before = 0.0, 0.0
    for step in flow_steps(count, solver):
        now = velocity(step.time)
        total += step.now * now + step.before * before
        before = now
    return total


@pytest.mark.parametrize("solver", ["euler", "adams"])
@pytest.mark.parametrize("count", [1, 2, 8])
def test_a_constant_velocity_is_followed_exactly(solver, count):
    assert integral(lambda time: 3.0, count, solver) == pytest.approx(3.0)


def test_steps_of_adams_follow_a_straight_velocity_but_for_the_first_one():
    first = flow_steps(8, "adams")[1].time
    assert integral(lambda time: 2 * time, 8, "adams") == pytest.approx(1 - first**2)


@pytest.mark.parametrize(("velocity", "wanted"), [(np.cos, np.sin(1)), (np.exp, np.e - 1)])
def test_steps_of_adams_err_less_than_those_of_euler(velocity, wanted):
    euler, adams = (abs(integral(velocity, 8, solver) - wanted) for solver in ("euler", "adams"))
    assert adams < euler / 3


def test_steps_of_adams_begin_at_noise_and_grow():
    times = [step.time for step in flow_steps(8, "adams")] + [1.0]
    assert times[0] == 0
    assert (np.diff(times, n=2) > 0).all()


def test_another_solver_is_refused():
    with pytest.raises(OptionError, match="'euler' or 'adams', got 'runge'"):
        ModelConfig(flow_solver="runge")
