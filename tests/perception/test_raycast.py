import numpy as np
import pytest
import trimesh

from ffhnet.perception.raycast import RayScene


def plain_first_hit(triangles, origin, direction):
    """Möller-Trumbore over every triangle, float64: the plain path."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    e1, e2 = b - a, c - a
    p = np.cross(direction, e2)
    det = np.einsum("ij,ij->i", e1, p)
    with np.errstate(divide="ignore", invalid="ignore"):
        t0 = origin - a
        u = np.einsum("ij,ij->i", t0, p) / det
        q = np.cross(t0, e1)
        v = q @ direction / det
        t = np.einsum("ij,ij->i", e2, q) / det
    t[~((np.abs(det) > 1e-14) & (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0))] = np.inf
    return t


@pytest.fixture
def scene_meshes():
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.05)
    box = trimesh.creation.box((0.1, 0.05, 0.2))
    box.apply_translation([0.2, 0.1, 0.05])
    return [ball, trimesh.Trimesh(), box]


@pytest.mark.parametrize("shift", [0.0, 3.0])
def test_same_as_the_plain_path(scene_meshes, shift):
    rng = np.random.default_rng(0)
    offset = np.array([shift, -shift, shift])
    for mesh in scene_meshes:
        mesh.apply_translation(offset)
    origins = rng.normal(size=(300, 3)) * 0.5 + offset
    targets = rng.uniform([-0.05, -0.05, -0.05], [0.25, 0.15, 0.15], (300, 3)) + offset
    directions = targets - origins
    scene = RayScene(scene_meshes)
    hits = scene.cast(origins, directions)
    filled = [0, 2]
    for i in range(300):
        per_mesh = [plain_first_hit(scene_meshes[m].triangles, origins[i], directions[i]) for m in filled]
        nearest = [t.min() for t in per_mesh]
        best = int(np.argmin(nearest))
        if np.isinf(nearest[best]):
            assert np.isinf(hits.distance[i])
            assert (hits.mesh[i], hits.triangle[i]) == (-1, -1)
            continue
        assert hits.distance[i] == pytest.approx(nearest[best], abs=2e-6)
        assert hits.mesh[i] == filled[best]
        # At an edge either neighbour is right, so the face is compared by its distance.
        assert per_mesh[best][hits.triangle[i]] == pytest.approx(nearest[best], abs=2e-6)
        face_normal = scene_meshes[hits.mesh[i]].face_normals[hits.triangle[i]]
        np.testing.assert_allclose(hits.normal[i], face_normal)
    assert 50 < hits.hit.sum() < 300
    np.testing.assert_array_equal(scene.distances(origins, directions), hits.distance)
    np.testing.assert_array_equal(scene.occluded(origins, directions), hits.hit)


def test_no_ray_slips_between_triangles():
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.05)
    edges = ball.vertices[ball.edges_unique].mean(axis=1)
    targets = np.concatenate([ball.vertices, edges])
    hits = RayScene([ball]).cast(np.zeros((1, 3)), targets)
    assert hits.hit.all()
    np.testing.assert_allclose(hits.distance, 1.0, atol=2e-4)


def test_occlusion_ends_at_the_given_distance():
    box = trimesh.creation.box((0.1, 0.1, 0.1))
    scene = RayScene([box])
    down = np.array([[0.0, 0.0, -1.0]])
    above = np.array([[0.0, 0.0, 1.0]])
    assert not scene.occluded(above, down, max_distance=0.94)[0]
    assert scene.occluded(above, down, max_distance=0.96)[0]


def test_a_scene_without_triangles_is_never_hit():
    hits = RayScene([]).cast(np.zeros((1, 3)), np.eye(3))
    assert not hits.hit.any()
    assert np.isinf(hits.distance).all()
    assert not RayScene([]).occluded(np.zeros((1, 3)), np.eye(3)).any()
