"""Damaged files open, or fail with a typed error: never otherwise, never slowly, never with much memory.

`benchmarks/fuzz.py` does the same for as long as one likes.
"""

import contextlib
import random

import pytest
from doors import DOORS
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from limits import limits

from ffhnet.errors import FFHNetError


@pytest.fixture(scope="module", params=DOORS, ids=lambda door: door.name)
def door(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("input")
    request.param.build(folder)
    request.param.open(folder)
    with pytest.MonkeyPatch.context() as patch:
        # MuJoCo writes a log of its warnings where it is.
        patch.chdir(folder)
        yield request.param, folder


@given(chance=st.randoms(use_true_random=False))
@settings(
    max_examples=15,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
def test_damage_is_told(door, chance: random.Random):
    opened, folder = door
    with limits(), contextlib.suppress(FFHNetError):
        opened.attempt(folder, chance)
