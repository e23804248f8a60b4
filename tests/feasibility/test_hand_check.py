"""Each reason is given where it holds, and only there."""

from types import SimpleNamespace

import numpy as np
import pytest
from feasibility_scenes import box, grasps_from, observe, to_camera, tube

from ffhnet.feasibility.hand_check import HandCheck
from ffhnet.feasibility.planner import ENOUGH, VARIETY, Planner
from ffhnet.feasibility.reasons import Reason
from ffhnet.geometry.rotations import matrix_from_rotation_vector
from ffhnet.grasps import Grasps
from ffhnet.hands import load_hand

SIDE = np.pi / 2
"""The hand comes along the y axis, and its palm ends at y = 0.12."""


@pytest.fixture(scope="module")
def check():
    return HandCheck(load_hand())


def reason(check, grasp, *meshes):
    observation = observe(*meshes)
    return Reason(check(to_camera(grasp), check.look(observation))[0])


@pytest.mark.parametrize(
    ("grasp", "others", "wanted"),
    [
        (grasps_from(SIDE), (), Reason.FEASIBLE),
        (grasps_from(SIDE), (box(-0.1, -0.15),), Reason.FEASIBLE),
        (grasps_from(SIDE, height=0.04), (), Reason.TABLE),
        (grasps_from(SIDE, height=-0.3), (), Reason.TABLE),
        (grasps_from(np.pi, distance=0.05), (), Reason.OBJECT),
        (grasps_from(SIDE), (box(0.0, 0.14),), Reason.SCENE),
        (grasps_from(SIDE), (box(0.0, 0.27),), Reason.APPROACH),
    ],
)
def test_reasons(check, grasp, others, wanted):
    assert reason(check, grasp, tube(), *others) == wanted


def random_grasps(count):
    hand, rng = load_hand(), np.random.default_rng(0)
    return Grasps(
        rotation=matrix_from_rotation_vector(2 * rng.normal(size=(count, 3))),
        position=rng.uniform([-0.2, -0.2, -0.2], [0.2, 0.2, 0.3], size=(count, 3)),
        joints=rng.uniform(hand.lower, hand.upper, size=(count, hand.num_joints)),
        joint_names=hand.joint_names,
        hand=hand.name,
        frame="world",
        probability=rng.uniform(size=count),
    )


def test_nothing_of_a_feasible_hand_is_under_the_table(check):
    """Against the mesh of the hand, at the grasp and where the approach begins."""
    grasps, hand = random_grasps(80), load_hand()
    reasons = check(to_camera(grasps), check.look(observe(tube())))
    feasible = np.flatnonzero(reasons == Reason.FEASIBLE)
    assert 5 < len(feasible) < 60
    for i in feasible[:12]:
        corners = hand.shape(hand.open(grasps.joints[i])).vertices @ grasps.rotation[i].T + grasps.position[i]
        back = check.physics.approach_distance * grasps.rotation[i, 2, 0]
        assert corners[:, 2].min() - max(back, 0) > 0


def test_the_order_of_grasps_does_not_matter(check):
    grasps, scene = to_camera(random_grasps(50)), check.look(observe(tube(), box(0.0, 0.2)))
    order = np.random.default_rng(1).permutation(50)
    np.testing.assert_array_equal(check(grasps, scene)[order], check(grasps[order], scene))
    assert len(check(grasps[:0], scene)) == 0


class Network:
    """Samples of which few can be done."""

    def __init__(self, share):
        self.seeds, self.temperatures, self._share = [], [], share
        self.info = SimpleNamespace(model=SimpleNamespace(temperature=1.5))

    def grasp(self, observation, num, seed, threshold, temperature):
        self.seeds.append(seed)
        self.temperatures.append(temperature)
        good = np.arange(num) < self._share * num
        parts = [grasps_from(SIDE) if ok else grasps_from(SIDE, height=-0.3) for ok in good]
        rng = np.random.default_rng(seed)
        batch = Grasps.concatenate(parts).replace(probability=rng.uniform(size=num))
        return to_camera(batch).ranked()


@pytest.mark.parametrize(("share", "batches"), [(0.5, 1), (0.2, 3), (0.0, len(VARIETY))])
def test_more_are_sampled_where_too_few_are_left(share, batches):
    network = Network(share)
    plan = Planner(network, load_hand()).plan(observe(tube()), num=20)
    assert len(set(network.seeds)) == len(network.seeds) == batches
    assert network.temperatures == [1.5, 2.0, 2.0, 2.0][:batches]  # 2.4 would be noise
    assert len(plan.grasps) == round(20 * share) * batches
    assert len(plan.grasps) >= ENOUGH or batches == len(VARIETY)
    assert plan.counts == ({"table": len(plan.dropped)} if len(plan.dropped) else {})
    assert len(plan.grasps) + len(plan.dropped) == 20 * batches
    assert (np.diff(plan.grasps.score) <= 0).all()
    np.testing.assert_array_equal(plan.preshape, load_hand().open(plan.grasps.joints))
