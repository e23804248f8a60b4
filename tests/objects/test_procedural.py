import itertools
import time

import numpy as np
import pytest
import trimesh
from scipy.optimize import linprog
from scipy.sparse.csgraph import connected_components

from ffhnet.errors import ObjectError
from ffhnet.objects.grasp_object import DENSITY, MASS_RANGE
from ffhnet.objects.procedural import (
    PROCEDURAL,
    make_object,
    object_name,
    seed_of,
    split_seeds,
)

KIT_TEST_SIZES_MM = {
    "BakingSoda": (46, 46, 88),
    "BathDetergent": (57, 57, 191),
    "BroccoliSoup": (33, 94, 128),
    "CoughDropsLemon": (36, 80, 113),
    "Curry": (37, 37, 116),
    "FizzyTabletsCalcium": (27, 27, 163),
    "InstantSauce": (43, 84, 146),
    "NutCandy": (41, 129, 171),
    "PotatoeDumplings": (32, 104, 141),
    "Sprayflask": (46, 83, 218),
    "TomatoSoup": (58, 58, 101),
    "YellowSaltCube2": (49, 63, 143),
}
"""Box-equivalent sizes of the test objects of the paper's Table I."""


def halfspaces(piece: trimesh.Trimesh) -> np.ndarray:
    planes = np.column_stack(
        [piece.face_normals, -np.einsum("ij,ij->i", piece.face_normals, piece.triangles[:, 0])]
    )
    return planes[np.unique(np.round(planes, 7), axis=0, return_index=True)[1]]


def gap(a: trimesh.Trimesh, b: trimesh.Trimesh) -> float:
    """How far all planes must move out before the pieces share a point; minus the depth of an overlap."""
    planes = np.vstack([halfspaces(a), halfspaces(b)])
    found = linprog(
        [0, 0, 0, 1],
        A_ub=np.column_stack([planes[:, :3], -np.ones(len(planes))]),
        b_ub=-planes[:, 3],
        bounds=[(None, None)] * 4,
    )
    return found.x[3]


def test_every_family_is_reached_about_as_often_as_its_weight_says(objects):
    families = [obj.family for obj in objects]
    total = sum(family.weight for family in PROCEDURAL.values())
    assert len(PROCEDURAL) >= 10
    for name, family in PROCEDURAL.items():
        expected = len(objects) * family.weight / total
        assert abs(families.count(name) - expected) < 4 * np.sqrt(expected) + 1, name


def test_pieces_are_closed_convex_and_outward(objects):
    for obj in objects[:80]:
        for piece in obj.pieces:
            assert piece.is_watertight, obj.name
            assert piece.is_winding_consistent, obj.name
            assert piece.volume > 0, obj.name
            assert piece.volume == pytest.approx(piece.convex_hull.volume, rel=1e-6), obj.name


def test_pieces_touch_but_do_not_overlap(one_per_family):
    for obj in one_per_family:
        count = len(obj.pieces)
        touching = np.eye(count, dtype=bool)
        for i, j in itertools.combinations(range(count), 2):
            a, b = obj.pieces[i].bounds, obj.pieces[j].bounds
            if (a[0] > b[1] + 1e-6).any() or (b[0] > a[1] + 1e-6).any():
                continue
            distance = gap(obj.pieces[i], obj.pieces[j])
            assert distance > -1e-7, f"{obj.name}: pieces {i} and {j} overlap by {-distance} m"
            touching[i, j] = distance < 1e-6
        assert connected_components(touching, directed=False)[0] == 1, f"{obj.name} falls apart"


def test_volume_of_the_pieces_is_the_volume_of_their_union(one_per_family, rng):
    for obj in one_per_family:
        low, high = obj.visual.bounds
        points = rng.uniform(low, high, (20_000, 3))
        inside = np.zeros(len(points), dtype=bool)
        for planes in map(halfspaces, obj.pieces):
            inside |= (points @ planes[:, :3].T + planes[:, 3] < 0).all(axis=1)
        union = inside.mean() * np.prod(high - low)
        assert sum(piece.volume for piece in obj.pieces) == pytest.approx(union, rel=0.05), obj.name


def test_objects_stand_on_zero_and_fit_the_hand(objects):
    for obj in objects:
        assert min(piece.vertices[:, 2].min() for piece in obj.pieces) == 0.0, obj.name
        width, depth, height = obj.visual.extents
        assert min(width, depth) <= 0.0901, obj.name
        assert min(width, depth, height) >= 0.0249, obj.name
        assert 0.03 <= height <= 0.26, obj.name


def test_sizes_cover_the_papers_test_objects(objects):
    sizes = np.array([sorted(obj.visual.extents * 1e3) for obj in objects])
    for name, wanted in KIT_TEST_SIZES_MM.items():
        nearest = np.abs(sizes - wanted).max(axis=1).min()
        assert nearest < 12, f"{name}: the nearest object differs by {nearest:.0f} mm"
    extents = np.array([obj.visual.extents for obj in objects]) * 1e3
    assert extents[:, :2].min() < 28
    assert extents[:, :2].max() > 125
    assert extents[:, 2].min() < 45
    assert extents[:, 2].max() > 215


def test_mass_is_density_times_volume_within_the_range(objects):
    for obj in objects:
        volume = sum(piece.volume for piece in obj.pieces)
        assert obj.mass == pytest.approx(np.clip(DENSITY * volume, *MASS_RANGE), rel=1e-6)
    assert np.mean([MASS_RANGE[0] < obj.mass < MASS_RANGE[1] for obj in objects]) > 0.3


def test_a_ray_down_a_cup_meets_its_floor(objects):
    cups = [obj for obj in objects if obj.family == "cup"]
    for cup in cups:
        hit = cup.visual.ray.intersects_location([[0.0, 0.0, 1.0]], [[0.0, 0.0, -1.0]])[0][:, 2]
        assert 0.004 < hit.max() < 0.01
    handles = [np.ptp(cup.visual.bounds[:, 0]) > 1.05 * np.ptp(cup.visual.bounds[:, 1]) for cup in cups]
    assert any(handles)
    assert not all(handles)


def test_same_seed_same_object(objects):
    for seed in (0, 4, 9, 77):
        again = make_object(seed)
        assert again.name == objects[seed].name
        np.testing.assert_array_equal(again.visual.vertices, objects[seed].visual.vertices)
        np.testing.assert_array_equal(again.resting_poses, objects[seed].resting_poses)
    assert len({obj.visual.volume for obj in objects}) == len(objects)


def test_names_lead_back_to_seeds(objects):
    for seed, obj in enumerate(objects):
        assert obj.name == object_name(seed)
        assert seed_of(obj.name) == seed


@pytest.mark.parametrize("name", ["", "bottle", "bottle_", "bottle_x1", "mug_000000", "bottle_-00001"])
def test_unknown_names_are_refused(name):
    with pytest.raises(ObjectError, match="name of a procedural object"):
        seed_of(name)


def test_splits_are_disjoint_and_prefixes_of_each_other():
    splits = [
        split_seeds(f"{collection}-{split}", 5000)
        for collection in ("procedural", "varied")
        for split in ("train", "val", "test")
    ]
    assert [seeds[0] for seeds in splits] == [million * 1_000_000 for million in range(6)]
    assert len(set().union(*splits)) == 30_000
    assert split_seeds("procedural-val", 10) == splits[1][:10]


@pytest.mark.parametrize(
    ("split", "count"),
    [("procedural-tests", 3), ("train", 3), ("procedural-train", 0), ("varied-val", 1_000_001)],
)
def test_bad_splits_are_refused(split, count):
    with pytest.raises(ObjectError, match="wanted"):
        split_seeds(split, count)


def test_negative_seeds_are_refused():
    with pytest.raises(ObjectError, match="-1"):
        make_object(-1)


def test_making_an_object_is_quick():
    times = []
    for seed in range(15):
        start = time.process_time()
        make_object(seed)
        times.append(time.process_time() - start)
    assert np.median(times) < 0.05
