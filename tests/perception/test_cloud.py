import numpy as np
import pytest
import trimesh

from ffhnet.errors import CloudError
from ffhnet.perception.camera import Intrinsics
from ffhnet.perception.cloud import (
    bounding_box,
    depth_to_cloud,
    estimate_normals,
    search_tree,
    validate_cloud,
)

K = Intrinsics(fx=90.0, fy=110.0, cx=31.5, cy=20.25, width=64, height=48)


def test_cloud_projects_back_to_its_pixels():
    rng = np.random.default_rng(0)
    depth = rng.uniform(0.4, 1.0, (48, 64))
    depth[rng.uniform(size=depth.shape) < 0.3] = 0
    depth[3, 5], depth[4, 6], depth[5, 7] = np.nan, -1, np.inf
    cloud, pixels = depth_to_cloud(depth, K)
    v, u = np.unravel_index(pixels, depth.shape)
    np.testing.assert_allclose(cloud[:, 0] / cloud[:, 2] * K.fx + K.cx, u, atol=1e-9)
    np.testing.assert_allclose(cloud[:, 1] / cloud[:, 2] * K.fy + K.cy, v, atol=1e-9)
    np.testing.assert_array_equal(cloud[:, 2], depth.ravel()[pixels])
    assert len(cloud) == (np.isfinite(depth) & (depth > 0)).sum()


def test_cloud_is_the_point_of_each_pixel_to_the_last_bit():
    depth = np.random.default_rng(1).uniform(-0.2, 1.0, (48, 64))
    depth[10, 10:20] = np.inf
    rays = [((u - K.cx) / K.fx, (v - K.cy) / K.fy, 1.0) for v in range(48) for u in range(64)]
    plain = [np.multiply(ray, z) for ray, z in zip(rays, depth.ravel(), strict=True) if 0 < z < np.inf]
    np.testing.assert_array_equal(depth_to_cloud(depth, K)[0], plain)


def test_bounding_box():
    points = np.random.default_rng(0).normal(size=(500, 3))
    np.testing.assert_array_equal(bounding_box(points), [points.min(axis=0), points.max(axis=0)])


def test_depth_of_another_size_is_refused():
    with pytest.raises(CloudError, match=r"\(48, 64\).*\(64, 48\)"):
        depth_to_cloud(np.ones((64, 48)), K)


def test_normals_of_a_sphere_point_at_the_viewer():
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(4000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    viewpoint = np.array([0.0, 0.0, 1.0])
    seen = directions[directions[:, 2] > 0.3]
    normals = estimate_normals(0.1 * seen, viewpoint)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-9)
    angle = np.degrees(np.arccos(np.clip(np.einsum("ij,ij->i", normals, seen), -1, 1)))
    assert np.percentile(angle, 95) < 5
    assert angle.max() < 45
    assert (estimate_normals(0.1 * seen, -viewpoint)[:, 2] < 0).mean() > 0.99


def test_search_tree_finds_what_brute_force_finds():
    rng = np.random.default_rng(0)
    surface = trimesh.creation.box((0.1, 0.2, 0.05)).sample(2000, seed=1)
    queries = rng.uniform(-0.3, 0.3, (300, 3))
    plain = np.linalg.norm(queries[:, None] - surface, axis=2).min(axis=1)
    np.testing.assert_allclose(search_tree(surface).query(queries)[0], plain, atol=1e-12)


def usable(n=100):
    return np.random.default_rng(0).uniform(-0.1, 0.1, (n, 3))


def with_nan(n, bad):
    points = usable(n)
    points[:bad, 1] = np.nan
    return points


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.zeros((0, 3)), "empty: 0 points"),
        (usable(49), "at least 50 points, got 49"),
        (with_nan(100, 60), "got 40 .60 not finite"),
        (with_nan(100, 100), "no finite point: all 100"),
        (usable()[:, :2], r"shape \(N, 3\), got \(100, 2\)"),
        (np.zeros(30), r"shape \(N, 3\)"),
        (np.full((100, 3), 0.3), "same point"),
        (usable() * 1000, "millimetres, wanted metres"),
        (np.full((100, 3), "a"), "numbers"),
    ],
)
def test_unusable_clouds_are_refused_with_one_line(points, message):
    with pytest.raises(CloudError, match=message) as caught:
        validate_cloud(points)
    assert "\n" not in str(caught.value)


def test_organised_clouds_lose_their_empty_pixels():
    image = np.full((20, 30, 6), np.nan, dtype=np.float32)
    image[5:15, 5:15] = 0.5
    image[5:15, 5:15, 0] = np.linspace(0, 0.1, 10)
    image[..., 3:] = np.nan
    cloud = validate_cloud(image)
    assert cloud.shape == (100, 3)
    assert cloud.dtype == np.float64


def test_a_few_absurd_readings_do_not_look_like_millimetres():
    points = usable(1000)
    points[:5] = 65.5
    assert len(validate_cloud(points)) == 1000
