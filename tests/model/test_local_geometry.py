"""The distance field from a basis point set vector, against distances to the cloud itself."""

import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree

from ffhnet.geometry.basis import BASIS_SIZE, basis_points
from ffhnet.geometry.rotations import rotation_from_6d
from ffhnet.model import GraspTensors, ObjectTensors
from ffhnet.model.local_geometry import FAR, HEIGHT_EVERY, NEAR, DistanceField, LocalGeometry

RNG = np.random.default_rng(5)


def half_cylinder(radius: float, height: float) -> np.ndarray:
    """Points on the visible side of a standing cylinder, centred on their mean."""
    angle, z = RNG.uniform(-np.pi / 2, np.pi / 2, 1500), RNG.uniform(0, height, 1500)
    cloud = np.stack([-radius * np.cos(angle), radius * np.sin(angle), z], axis=1)
    return cloud - cloud.mean(axis=0)


def bps_of(cloud: np.ndarray) -> torch.Tensor:
    return torch.from_numpy(cKDTree(cloud).query(basis_points())[0]).float()


def test_field_gives_distances_to_clouds_within_a_few_millimetres():
    clouds = [half_cylinder(0.03, 0.12), half_cylinder(0.05, 0.05)]
    field = DistanceField(BASIS_SIZE)
    grid = field(torch.stack([bps_of(cloud) for cloud in clouds]))
    points = RNG.uniform(-0.1, 0.1, (2, 4, 200, 3))
    read = field.read(grid, torch.from_numpy(points).float()).numpy()
    for view, cloud in enumerate(clouds):
        error = read[view] - cKDTree(cloud).query(points[view])[0]
        assert np.sqrt(np.mean(error**2)) < 0.0035


def test_field_is_exact_for_a_distance_that_changes_linearly():
    direction = np.array([0.5, -0.2, 0.7])
    grid = DistanceField(BASIS_SIZE)(torch.from_numpy(basis_points() @ direction).float()[None])
    points = RNG.uniform(-0.09, 0.09, (1, 5, 20, 3))
    read = DistanceField.read(grid, torch.from_numpy(points).float()).numpy()
    # The small ridge of the plane fit costs some of the slope.
    np.testing.assert_allclose(read, points @ direction, atol=1.5e-3)


def test_features_are_of_points_that_move_with_the_palm():
    cloud = half_cylinder(0.03, 0.1)
    geometry = LocalGeometry(12, BASIS_SIZE)
    points = RNG.uniform(-0.05, 0.05, (12, 3))
    geometry.set_points(points)
    rotation = rotation_from_6d(torch.from_numpy(RNG.normal(size=(1, 3, 6))))
    position = RNG.uniform(-0.05, 0.05, (1, 3, 3))
    objects = ObjectTensors(bps_of(cloud)[None], torch.tensor([-0.06]))
    grasps = GraspTensors(rotation.float(), torch.from_numpy(position).float(), torch.zeros(1, 3, 15))
    features = geometry(geometry.field(objects.bps), objects, grasps)[0].numpy()
    assert features.shape == (3, geometry.width)
    for g in range(3):
        placed = points @ rotation[0, g].numpy().T + position[0, g]
        distance = cKDTree(cloud).query(placed)[0]
        np.testing.assert_allclose(-NEAR * np.log(features[g, :12]), distance, atol=0.012)
        np.testing.assert_allclose(FAR * (features[g, 12:24] + 1), distance, atol=0.012)
        height = (placed[::HEIGHT_EVERY, 2] + 0.06) / FAR
        np.testing.assert_allclose(features[g, 24:], np.clip(height, -3, 3), atol=1e-4)


@pytest.mark.parametrize("offset", [0.3, 1.0])
def test_points_beyond_the_grid_read_its_border(offset: float):
    grid = DistanceField(BASIS_SIZE)(bps_of(half_cylinder(0.03, 0.1))[None])
    outside = torch.tensor([[[[offset, 0.0, 0.0]]]])
    border = torch.tensor([[[[0.2, 0.0, 0.0]]]])
    torch.testing.assert_close(DistanceField.read(grid, outside), DistanceField.read(grid, border))
