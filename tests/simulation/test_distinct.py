"""Grasp types and distinct grasps on grasps whose answer is known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ffhnet.geometry.rotations import geodesic_angle, matrix_from_rotation_vector
from ffhnet.hands import load_hand
from ffhnet.simulation.distinct import NEAR_ANGLE, NEAR_JOINTS, NEAR_POSITION, is_distinct
from ffhnet.simulation.grasp_types import KINDS, entropy_bits, grasp_types

HAND = load_hand()


def test_entropy_of_known_mixtures():
    assert entropy_bits(np.zeros(10, dtype=int)) == 0
    assert entropy_bits(np.repeat([3, 5, 8, 9], 7)) == pytest.approx(2)
    assert entropy_bits(np.array([0] * 3 + [1])) == pytest.approx(0.811278, abs=1e-6)
    assert np.isnan(entropy_bits(np.zeros(0, dtype=int)))


def closed(*idle):
    """Joints of a hand whose named fingers closed fully and the others stopped half way."""
    joints = 0.5 * HAND.upper
    for i, name in enumerate(HAND.joint_names):
        if name.partition("_")[0] in idle:
            joints[i] = HAND.upper[i]
    return joints


def test_idle_fingers_take_no_part_and_wrapping_is_power():
    joints = np.stack([closed(), closed("little", "ring"), closed("little"), closed("little")])
    types = grasp_types(joints, np.array([5, 3, 5, 6]), HAND)
    assert set(types.fingers) == {"thumb", "index", "middle", "ring", "little"}
    assert types.takes_part.sum(axis=1).tolist() == [5, 3, 4, 4]
    assert not types.takes_part[1, types.fingers.index("ring")]
    assert [KINDS[k] for k in types.kind] == ["precision", "precision", "intermediate", "power"]
    assert len(set(types.code.tolist())) == 4
    assert types.label(3) == "power, 4 fingers"


@pytest.mark.parametrize("what", ["position", "rotation", "joints"])
def test_clusters_are_counted_once_and_any_measure_tells_them_apart(what):
    """Five clusters of 20 grasps, apart in one measure only, close within."""
    rng = np.random.default_rng(1)
    cluster = np.repeat(np.arange(5), 20)
    position = rng.uniform(-1, 1, (100, 3)) * 0.2 * NEAR_POSITION
    turn = rng.uniform(-1, 1, (100, 3)) * 0.2 * NEAR_ANGLE
    joints = rng.uniform(-1, 1, (100, 15)) * 0.2 * NEAR_JOINTS
    shift = 1.9 * cluster
    if what == "position":
        position[:, 0] += shift * NEAR_POSITION
    elif what == "rotation":
        turn[:, 0] = shift * NEAR_ANGLE
    else:
        joints += shift[:, None] * NEAR_JOINTS
    order = rng.permutation(100)
    rotation = matrix_from_rotation_vector(turn)
    distinct = is_distinct(position[order], rotation[order], joints[order])
    assert distinct.sum() == 5
    assert sorted(cluster[order][distinct].tolist()) == [0, 1, 2, 3, 4]


@given(st.integers(0, 2**32 - 1), st.integers(1, 60))
@settings(max_examples=25, deadline=None)
def test_distinct_agrees_with_the_plain_loop(seed, n):
    rng = np.random.default_rng(seed)
    position = rng.uniform(0, 2.5 * NEAR_POSITION, (n, 3))
    rotation = matrix_from_rotation_vector(rng.uniform(-1, 1, (n, 3)) * NEAR_ANGLE)
    joints = rng.uniform(0, 2.5 * NEAR_JOINTS, (n, 15))
    kept = []
    for i in range(n):
        same = [
            np.linalg.norm(position[i] - position[k]) <= NEAR_POSITION
            and geodesic_angle(rotation[i], rotation[k]) <= NEAR_ANGLE
            and np.sqrt(np.mean((joints[i] - joints[k]) ** 2)) <= NEAR_JOINTS
            for k in kept
        ]
        if not any(same):
            kept.append(i)
    assert np.flatnonzero(is_distinct(position, rotation, joints)).tolist() == kept
