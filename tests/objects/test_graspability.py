from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from ffhnet.objects.convex import circle, convex_hull, hollow_wall, rectangle, stack
from ffhnet.objects.grasp_object import GraspObject
from ffhnet.objects.graspability import HandLimits, find_grips, why_not_graspable
from ffhnet.objects.resting import resting_poses
from ffhnet.objects.scans import read_in_metres

MESHES = Path(__file__).parents[2] / "../shared/data/meshes"


def made_of(pieces: list[trimesh.Trimesh], mass: float = 0.2) -> GraspObject:
    poses = resting_poses(pieces)
    return GraspObject(
        name="thing",
        family="test",
        visual=trimesh.util.concatenate(pieces),
        pieces=tuple(pieces),
        mass=mass,
        resting_poses=np.stack([pose.T_world_object for pose in poses]),
        pose_names=tuple(pose.name for pose in poses),
    )


def block(x: float, y: float, z: float) -> list[trimesh.Trimesh]:
    section = rectangle(x / 2, y / 2)
    return stack([(0.0, section), (z, section)])


def pan() -> list[trimesh.Trimesh]:
    """A disc too wide for the hand, with a bar as handle."""
    return [*block(0.2, 0.2, 0.03), trimesh.creation.box(bounds=[[0.1, -0.012, 0.005], [0.26, 0.012, 0.027]])]


def bowl() -> list[trimesh.Trimesh]:
    floor = stack([(0.0, circle(0.09)), (0.01, circle(0.09))])
    return floor + hollow_wall([(0.01, 0.09), (0.07, 0.1)], 0.08, 0.09)


@pytest.mark.parametrize(
    ("pieces", "reason"),
    [
        (block(0.06, 0.06, 0.15), None),
        (block(0.2, 0.09, 0.2), None),
        (block(0.11, 0.11, 0.11), "too big: 110 mm at its narrowest, the hand opens 95 mm"),
        # Only its height is small enough for the hand, and the table is in the way.
        (block(0.24, 0.24, 0.02), "too big: 240 mm at its narrowest, the hand opens 95 mm"),
        (block(0.15, 0.15, 0.012), "too flat: at most 12 mm above the table"),
        (block(0.012, 0.012, 0.15), "too flat: at most 12 mm above the table"),
        (pan(), None),
        (bowl(), None),
        # A flat pyramid: every side leans back.
        (
            [convex_hull(np.array([[1, 1, 0], [1, -1, 0], [-1, 1, 0], [-1, -1, 0], [0, 0, 0.4]]) * 0.1)],
            "no sides",
        ),
    ],
)
def test_known_shapes(pieces, reason):
    found = why_not_graspable(made_of(pieces))
    assert found == reason if reason != "no sides" else found is not None and found.startswith("no sides")


def test_a_heavy_thing_is_refused():
    can = made_of(block(0.06, 0.06, 0.15), mass=1.2)
    assert why_not_graspable(can) == "too heavy: 1200 g, the hand holds 1000 g"
    assert why_not_graspable(can, HandLimits(max_mass=1.5)) is None


@settings(max_examples=25, deadline=None)
@given(st.floats(0.02, 0.2), st.floats(0.02, 0.2), st.floats(0.05, 0.2))
def test_a_box_is_as_wide_as_its_narrower_side_in_the_pose(x, y, z):
    box = made_of(block(x, y, z))
    standing = replace(box, resting_poses=box.resting_poses[:1], pose_names=("standing",))
    if box.pose_names[0] != "standing":
        return
    width = min(x, y)
    assert why_not_graspable(standing, HandLimits(opening=width * 1.001)) is None
    assert "too big" in (why_not_graspable(standing, HandLimits(opening=width * 0.999)) or "")


def test_splitting_a_body_into_pieces_does_not_change_its_widths():
    whole = block(0.04, 0.06, 0.12)
    halves = [
        *block(0.04, 0.06, 0.05),
        trimesh.creation.box(bounds=[[-0.02, -0.03, 0.05], [0.02, 0.03, 0.12]]),
    ]
    for pieces in (whole, halves):
        grips = find_grips(pieces)
        sides = np.abs(grips.normals) @ [0.04, 0.06, 0.12]
        np.testing.assert_allclose(grips.widths, sides, atol=1e-9)
    outside = np.isclose(np.abs(grips.points), [0.02, 0.03, 9]).any(axis=1) | np.isclose(
        grips.points[:, 2], 0
    )
    assert (outside | np.isclose(grips.points[:, 2], 0.12)).all(), "no grip is on the cut between the halves"


def test_the_points_cover_the_surface_evenly():
    grips = find_grips(block(0.04, 0.06, 0.12))
    total = 2 * (0.04 * 0.06 + 0.04 * 0.12 + 0.06 * 0.12)
    assert grips.area * len(grips.points) == pytest.approx(total)
    for axis, area in enumerate([0.06 * 0.12, 0.04 * 0.12, 0.04 * 0.06]):
        for sign in (1, -1):
            assert grips.area * (grips.normals[:, axis] * sign > 0.9).sum() == pytest.approx(area, rel=0.02)


def test_widths_agree_with_rays_through_the_surface(one_per_family):
    for obj in one_per_family:
        if len(obj.pieces) > 1:
            continue
        grips = find_grips(obj.pieces)
        starts = grips.points - 1e-6 * grips.normals
        hits, rays, _ = obj.visual.ray.intersects_location(starts, -grips.normals, multiple_hits=False)
        widths = np.linalg.norm(hits - grips.points[rays], axis=1)
        assert len(rays) > 0.98 * len(starts)
        assert np.mean(np.abs(widths - grips.widths[rays]) < 1e-4) > 0.98, obj.name


@pytest.mark.skipif(not MESHES.is_dir(), reason="the shared meshes (../shared/data) are not here")
@pytest.mark.parametrize(
    ("file", "reason"),
    [
        ("kit_test/kit_Sprayflask.obj", None),
        ("kit_test/kit_NutCandy.obj", None),
        ("contactdb/cdb_cubelarge.obj", "too big"),
        ("contactdb/cdb_toothbrush.obj", "too flat"),
    ],
)
def test_real_scans(file, reason):
    mesh, _ = read_in_metres(MESHES / file, 1.0)
    # The hull stands in for the convex pieces, whose making takes long.
    found = why_not_graspable(made_of([convex_hull(np.asarray(mesh.vertices))]))
    assert found is None if reason is None else found is not None and found.startswith(reason)
