import numpy as np
import pytest

from ffhnet.objects.convex import circle, convex_hull, ellipse, extrude_xz, rounded_rectangle, stack


def test_hull_of_random_points_is_closed_and_outward(rng):
    for _ in range(20):
        hull = convex_hull(rng.normal(size=(60, 3)) * 0.05)
        assert hull.is_watertight
        assert hull.volume == pytest.approx(hull.convex_hull.volume)
        assert hull.volume > 0


@pytest.mark.parametrize("section", [circle(0.03), ellipse(0.03, 0.02), rounded_rectangle(0.03, 0.02, 0.004)])
def test_sections_have_the_stated_half_sides_and_turn_left(section):
    np.testing.assert_allclose(section.max(axis=0), -section.min(axis=0))
    assert section[:, 0].max() == pytest.approx(0.03)
    edges = np.roll(section, -1, axis=0) - section
    following = np.roll(edges, -1, axis=0)
    assert (edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0] > -1e-15).all()


def test_a_convex_stack_is_one_piece_and_a_waist_or_a_step_splits_it():
    wide, thin = circle(0.04), circle(0.02)
    assert len(stack([(0.0, thin), (0.02, wide), (0.08, wide), (0.1, thin)])) == 1
    assert len(stack([(0.0, wide), (0.05, thin), (0.1, wide)])) == 2
    step = stack([(0.0, wide), (0.05, wide), (0.05, thin), (0.1, thin)])
    assert len(step) == 2
    assert step[1].bounds[0, 2] == 0.05


def test_a_frustum_has_its_exact_volume():
    area = 24 * np.tan(np.pi / 24) * 0.04**2
    (piece,) = stack([(0.0, circle(0.04)), (0.1, circle(0.02))])
    assert piece.volume == pytest.approx(0.1 / 3 * area * (1 + 0.5 + 0.25))


def test_extrusion_spans_the_width():
    bar = extrude_xz([(0.0, 0.0), (0.02, 0.0), (0.02, 0.01)], 0.005)
    np.testing.assert_allclose(bar.extents, [0.02, 0.01, 0.01])
    assert bar.volume == pytest.approx(1e-6)
