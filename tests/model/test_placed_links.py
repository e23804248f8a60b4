"""Points on links inside a network against the hand's own forward kinematics."""

import numpy as np
import pytest
import torch

from ffhnet.hands import load_hand
from ffhnet.hands.link_points import link_points
from ffhnet.model.placed_links import PlacedLinks


@pytest.fixture(scope="module")
def hand():
    return load_hand()


@pytest.fixture(scope="module")
def links(hand):
    return link_points(hand)


@pytest.fixture(scope="module")
def module(hand, links):
    placed = PlacedLinks(len(links.parent), len(links.points), hand.num_joints)
    placed.take(links)
    return placed


def random_joints(hand, count=50):
    return np.random.default_rng(0).uniform(hand.lower, hand.upper, size=(count, hand.num_joints))


def test_points_stand_where_the_hands_kinematics_puts_them(hand, links, module):
    joints = random_joints(hand)
    placed = module(torch.tensor(joints).float()).numpy()
    wanted = []
    for posture in (hand.open(joints), joints):
        poses = hand.body_poses(torch.tensor(posture)).numpy()[:, links.link]
        wanted.append(np.einsum("nkij,kj->nki", poses[..., :3, :3], links.points) + poses[..., :3, 3])
    np.testing.assert_allclose(placed, np.concatenate(wanted, axis=1), atol=1e-6)


def test_points_lie_on_every_link_that_moves(hand, links):
    moving = {
        i
        for i, body in enumerate(hand.tree.bodies)
        if i > 0 and len(hand.body_shapes[i].vertices) and len(hand.body_shapes[i].faces)
    }
    assert set(links.link) <= moving
    assert len(links.points) == 4 * 15
    for link in set(links.link):
        shape = hand.body_shapes[link]
        points = links.points[links.link == link]
        # Not all on one spot, and none off the link's box.
        assert np.ptp(points, axis=0).max() > 0.5 * shape.extents.max()
        assert np.all(points >= shape.bounds[0] - 1e-9)
        assert np.all(points <= shape.bounds[1] + 1e-9)


def test_open_hand_does_not_depend_on_the_closing_joints(hand, module):
    joints = random_joints(hand, 2)
    joints[1] = np.where(hand.closing.moves > 0, joints[1], joints[0])
    first, second = module(torch.tensor(joints).float()).chunk(2, dim=1)
    torch.testing.assert_close(first[0], first[1])
    assert not torch.allclose(second[0], second[1])
