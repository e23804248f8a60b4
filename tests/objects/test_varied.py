"""Tableware, tools, toys and trinkets, drawn at random: what data generation takes for granted."""

from collections import Counter
from functools import lru_cache

import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull

from ffhnet.geometry.transforms import apply
from ffhnet.objects.convex import bar, ellipsoid
from ffhnet.objects.graspability import why_not_graspable
from ffhnet.objects.inertia import inertia
from ffhnet.objects.procedural import AWKWARD, FIRST_SEED, VARIED, make_object

COUNT = 150


@lru_cache
def drawn(collection):
    first = FIRST_SEED[f"{collection}-val"]
    return [make_object(seed) for seed in range(first, first + COUNT)]


@pytest.fixture(params=["varied", "awkward"])
def objects(request):
    return drawn(request.param)


def test_all_families_come_up_and_objects_differ_in_shape_from_cartons_and_cans():
    varied = drawn("varied")
    assert {obj.family for obj in varied} == set(VARIED)
    filled = [obj.visual.volume / obj.visual.convex_hull.volume for obj in varied]
    longest = [obj.visual.extents.max() / np.sort(obj.visual.extents)[1] for obj in varied]
    assert np.mean(np.array(filled) < 0.6) > 0.3
    assert np.mean(np.array(longest) > 1.8) > 0.2


def test_awkward_things_are_small_or_flat_or_thin_or_wide():
    awkward = drawn("awkward")
    assert {obj.family for obj in awkward} == set(AWKWARD)
    extents = np.sort([obj.visual.extents for obj in awkward], axis=1)
    small, flat, wide = extents[:, 2] < 0.06, extents[:, 0] < 0.03, extents[:, 1] > 0.13
    assert np.mean(small) > 0.1
    assert np.mean(flat) > 0.3
    assert np.mean(small | flat | wide) > 0.6


def test_pieces_are_closed_and_convex(objects):
    for obj in objects:
        for piece in obj.pieces:
            assert piece.is_watertight, obj.name
            assert piece.volume == pytest.approx(piece.convex_hull.volume, rel=1e-6), obj.name
            assert piece.volume > 0, obj.name


def test_objects_do_not_fall_apart(objects):
    for obj in objects:
        planes = [
            np.column_stack([p.face_normals, -(p.face_normals * p.triangles[:, 0]).sum(1)])
            for p in obj.pieces
        ]
        # Two pieces touch if a corner, or the middle of an edge or a face, of one is in or on the other.
        points = [
            np.vstack([p.vertices, p.triangles_center, p.vertices[p.edges_unique].mean(axis=1)])
            for p in obj.pieces
        ]
        touch = np.array(
            [
                [bool((pl[:, :3] @ pt.T + pl[:, 3:] < 5e-4).all(axis=0).any()) for pl in planes]
                for pt in points
            ]
        )
        assert connected_components(touch | touch.T, directed=False)[0] == 1, obj.name


def test_resting_poses_hold_the_centre_of_mass_over_their_support(objects):
    for obj in objects:
        assert len(obj.resting_poses) > 0, obj.name
        vertices = np.concatenate([piece.vertices for piece in obj.pieces])
        for pose in obj.resting_poses:
            placed = apply(pose, vertices)
            x, y, _ = apply(pose, inertia(obj).centre)
            support = ConvexHull(placed[placed[:, 2] < 1e-5, :2])
            assert (support.equations @ [x, y, 1.0]).max() < -1e-6, obj.name


@pytest.mark.parametrize(
    ("collection", "flat", "share"), [("varied", "plate", 0.9), ("awkward", "cutlery", 0.85)]
)
def test_the_hand_can_grasp_most_objects_of_every_family_but_a_flat_one(collection, flat, share):
    objects = drawn(collection)
    graspable = Counter(obj.family for obj in objects if why_not_graspable(obj) is None)
    for family, count in Counter(obj.family for obj in objects).items():
        assert graspable[family] >= 0.4 * count or family == flat, family
    assert graspable.total() > share * COUNT


def test_a_bar_reaches_from_end_to_end_in_any_direction(rng):
    for direction in (*np.eye(3), *rng.normal(size=(10, 3))):
        end = 0.1 * direction / np.linalg.norm(direction)
        rod = bar(np.zeros(3), end, (0.01, 0.02), taper=0.5)
        assert (rod.vertices @ end).min() == pytest.approx(0.0, abs=1e-9)
        assert (rod.vertices @ end).max() == pytest.approx(0.01)
        assert 0.9 < rod.volume / (np.pi * 0.01 * 0.02 * 0.1 * (1 + 0.5 + 0.25) / 3) < 1.1


def test_a_horizontal_bar_has_its_first_half_axis_in_the_table_plane():
    rod = bar(np.zeros(3), np.array([0.1, 0.0, 0.0]), (0.02, 0.005))
    assert rod.extents == pytest.approx([0.1, 0.04, 0.01], rel=1e-6)


def test_an_ellipsoid_has_its_half_axes():
    body = ellipsoid(np.array([0.1, 0.2, 0.3]), np.array([0.03, 0.02, 0.01]))
    assert body.extents == pytest.approx([0.06, 0.04, 0.02], rel=0.03)
    assert body.center_mass == pytest.approx([0.1, 0.2, 0.3], abs=1e-6)
