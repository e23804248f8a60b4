import dataclasses

import numpy as np
import pytest
from perception_scenes import box_on_table, camera_at

from ffhnet.perception.camera import REALSENSE_D415, render_depth
from ffhnet.perception.sensor_noise import StereoNoise

K = REALSENSE_D415
FLAT = np.full((K.height, K.width), 0.7)
PERFECT = StereoNoise(
    white_sd=0, correlated_sd=0, edge_dropout=0, flying=0, edge_reach=0, grazing_cosine=0, grazing_spread=0
)


def test_depth_noise_is_a_millimetre_and_grows_with_depth_squared():
    rng = np.random.default_rng(0)
    sd = {z: StereoNoise().apply(np.full_like(FLAT, z), K, rng).std() for z in (0.5, 0.7, 1.0)}
    assert 0.8e-3 < sd[0.7] < 1.2e-3
    assert sd[1.0] / sd[0.5] == pytest.approx(4, rel=0.1)


def test_noise_is_unbiased_and_smooth_over_neighbours():
    error = StereoNoise().apply(FLAT, K, np.random.default_rng(0)) - FLAT
    assert abs(error.mean()) < 5e-5

    def correlation(step):
        return np.corrcoef(error[:, :-step].ravel(), error[:, step:].ravel())[0, 1]

    assert correlation(2) > 0.5
    assert abs(correlation(40)) < 0.1
    # The coarse grid behind the smooth noise must not show as stripes of quiet pixels.
    assert error.std(axis=0).min() > 0.6 * error.std()


def test_same_seed_same_image():
    depth = render_depth([box_on_table()], camera_at(30), K)
    first, second = (StereoNoise().apply(depth, K, np.random.default_rng(3)) for _ in range(2))
    np.testing.assert_array_equal(first, second)
    assert (first != StereoNoise().apply(depth, K, np.random.default_rng(4))).any()


def test_without_errors_only_quantisation_is_left():
    depth = np.tile(np.linspace(0.5, 0.9, K.height)[:, None], (1, K.width))
    noisy = PERFECT.apply(depth, K, np.random.default_rng(0))
    disparity = K.fx * PERFECT.baseline / noisy
    np.testing.assert_allclose(disparity * 32, np.rint(disparity * 32), atol=1e-6)
    assert np.abs(disparity - K.fx * PERFECT.baseline / depth).max() <= 0.5 / 32 + 1e-5


def test_the_shadow_lies_left_of_a_near_object_and_is_as_wide_as_the_disparity_step():
    depth = FLAT.copy()
    depth[100:200, 300:400] = 0.5
    noisy = PERFECT.apply(depth, K, np.random.default_rng(0))
    width = K.fx * PERFECT.baseline * (1 / 0.5 - 1 / 0.7)
    lost = np.flatnonzero(noisy[150] == 0)
    assert len(lost) == pytest.approx(width, abs=1)
    assert lost.max() == 299
    assert lost.min() == 300 - len(lost)
    assert (noisy[50] > 0).all()


def test_no_reading_stays_no_reading_away_from_edges():
    depth = FLAT.copy()
    depth[:, :200] = 0
    noisy = StereoNoise().apply(depth, K, np.random.default_rng(0))
    assert not noisy[:, :190].any()
    assert not StereoNoise().apply(np.zeros_like(FLAT), K, np.random.default_rng(0)).any()


def test_grazing_surfaces_are_lost_and_others_kept():
    x, y = K.rays()

    def slanted(cosine):
        # Plane through (0, 0, 0.7) turned about the image's x axis: depth = 0.7 / (1 + y tan).
        slope = np.sqrt(1 / cosine**2 - 1)
        # Around the image centre the line of sight is the optical axis.
        return (0.7 / (1 + y * slope))[:, None] * np.ones_like(x)

    def kept_share(cosine):
        patch = (slice(235, 245), slice(300, 340))
        noise = dataclasses.replace(StereoNoise(), edge_jump=100.0)
        with np.errstate(divide="ignore"):
            depth = np.clip(slanted(cosine), 0, 5)
        return np.mean([noise.apply(depth, K, np.random.default_rng(s))[patch] > 0 for s in range(5)])

    assert kept_share(0.5) == 1
    assert kept_share(0.2) > 0.95
    assert kept_share(0.05) < 0.05


def test_flying_pixels_lie_between_the_two_sides():
    depth = FLAT.copy()
    depth[:, 320:] = 0.5
    flying = dataclasses.replace(PERFECT, flying=0.5, edge_reach=2, edge_dropout=0.2)
    noisy = flying.apply(depth, K, np.random.default_rng(0))
    near_edge = noisy[:, 310:330]
    between = (near_edge > 0.52) & (near_edge < 0.68)
    assert between.sum() > 50
    assert noisy[noisy > 0].min() > 0.49
    assert noisy.max() < 0.71
    assert ((noisy[:, 320] == 0).mean()) == pytest.approx(0.2, abs=0.06)
