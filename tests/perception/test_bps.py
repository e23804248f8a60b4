import sys

import numpy as np
import pytest

from ffhnet.errors import MissingExtraError
from ffhnet.geometry.basis import basis_points
from ffhnet.perception import bps
from ffhnet.perception.bps import compile_encoder, encode, encode_cloud_centroid
from ffhnet.perception.capture import read_cloud


def test_basis_fills_the_ball_evenly():
    basis = basis_points()
    radius = np.linalg.norm(basis, axis=1)
    assert basis.shape == (4096, 3)
    assert radius.max() <= 0.2
    # Uniform in volume: (r / R)³ is uniform.
    assert np.abs(np.histogram((radius / 0.2) ** 3, bins=8, range=(0, 1))[0] / 512 - 1).max() < 0.2
    assert np.abs(basis.mean(axis=0)).max() < 0.01


def test_basis_never_changes():
    # Weights depend on it: direction and radius of the first and last point, written down once.
    np.testing.assert_allclose(basis_points()[0], [-0.0953192428, 0.1008553934, -0.0059545976], atol=1e-9)
    np.testing.assert_allclose(basis_points()[-1], [0.1327272367, -0.0936032357, 0.0090179731], atol=1e-9)
    with pytest.raises(ValueError, match="read-only"):
        basis_points()[0, 0] = 1
    assert basis_points() is basis_points()


def test_encoding_is_the_plain_nearest_distance():
    cloud = np.random.default_rng(0).normal(size=(500, 3)) * 0.05
    plain = np.linalg.norm(basis_points()[:, None] - cloud, axis=2).min(axis=1)
    code = encode(cloud)
    assert code.dtype == np.float32
    np.testing.assert_allclose(code, plain, atol=1e-7)
    np.testing.assert_array_equal(code, encode(cloud[::-1]))


def test_centroid_encoding_does_not_depend_on_where_the_cloud_is():
    cloud = np.random.default_rng(0).normal(size=(500, 3)) * 0.05
    np.testing.assert_allclose(
        encode_cloud_centroid(cloud), encode_cloud_centroid(cloud + np.array([0.3, -1.0, 0.7])), atol=1e-7
    )


@pytest.mark.parametrize("name", ["cheez_it", "mustard_bottle", "red_mug", "soft_scrub"])
def test_published_encodings_of_real_clouds(captures, name):
    folder = captures / "d415_objects" / name
    golden = np.load(folder / "bps_4096.npy").ravel()
    np.testing.assert_allclose(encode_cloud_centroid(read_cloud(folder / "cloud.ply")), golden, atol=1e-6)


def shell(m: int) -> np.ndarray:
    """One side of a cylinder, as a camera sees it."""
    angle, height = np.random.default_rng(m).uniform([[-1.6], [-0.08]], [[1.6], [0.08]], (2, m))
    return np.column_stack([-0.035 * np.cos(angle), 0.035 * np.sin(angle), height])


CLOUDS = {
    "one point": np.array([[0.01, 0.02, -0.03]]),
    "ball": np.random.default_rng(1).normal(size=(777, 3)) * 0.05,
    "shell": shell(2000),
    "much larger than the basis": np.random.default_rng(2).normal(size=(500, 3)) * 2,
    "the basis itself": basis_points()[::-1],
    "every point twice": np.repeat(shell(300), 2, axis=0),
    "far away": shell(200) + 3.0,
    "float32": shell(1000).astype(np.float32),
}


@pytest.mark.parametrize("name", CLOUDS)
def test_compiled_encoding_is_the_nearest_distance(name):
    pytest.importorskip("numba", reason="the extra `fast` brings numba")
    from ffhnet.perception import nearest_kernel as kernel

    distances = kernel.nearest_distances(CLOUDS[name])
    assert distances.dtype == np.float32
    np.testing.assert_allclose(distances, encode(CLOUDS[name]), atol=6e-8, rtol=3e-7)


def test_encoder_compiles_once_for_all(monkeypatch):
    pytest.importorskip("numba", reason="the extra `fast` brings numba")
    from ffhnet.perception import nearest_kernel as kernel

    monkeypatch.setattr(bps, "_encode", bps._encode)
    compile_encoder()
    np.testing.assert_array_equal(encode(CLOUDS["shell"]), kernel.nearest_distances(CLOUDS["shell"]))
    other = basis_points(100, radius=0.3, seed=1)
    np.testing.assert_allclose(encode(other[:50], other)[:50], 0, atol=1e-9)


def test_compiling_needs_numba(monkeypatch):
    monkeypatch.setitem(sys.modules, "ffhnet.perception.nearest_kernel", None)
    with pytest.raises(MissingExtraError, match=r"ffhnet\[fast\]"):
        compile_encoder()
