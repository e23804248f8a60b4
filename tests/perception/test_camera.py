import numpy as np
import pytest
import trimesh
from perception_scenes import box_on_table, camera_at, distance_to_box

from ffhnet.errors import OptionError
from ffhnet.geometry.transforms import apply
from ffhnet.perception.camera import (
    PRESETS,
    REALSENSE_D415,
    TABLE_SIZE,
    Intrinsics,
    look_at,
    random_camera,
    render_depth,
)
from ffhnet.perception.cloud import depth_to_cloud
from ffhnet.perception.raycast import RayScene

SMALL = Intrinsics(fx=100.0, fy=105.0, cx=70.0, cy=62.0, width=144, height=120)


def test_look_at_is_an_optical_frame():
    pose = look_at(np.array([1.0, 0.0, 1.0]), np.zeros(3))
    np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-12)
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1)
    np.testing.assert_allclose(pose[:3, 2], np.array([-1, 0, -1]) / np.sqrt(2), atol=1e-12)
    # Seen from +x, world +y is on the right; the image's y axis points down.
    np.testing.assert_allclose(pose[:3, 0], [0, 1, 0], atol=1e-12)
    assert pose[2, 1] < 0


def test_looking_straight_down_world_y_is_up():
    pose = look_at(np.array([0.0, 0.0, 1.0]), np.zeros(3))
    np.testing.assert_allclose(pose[:3, :3], np.diag([1.0, -1.0, -1.0]), atol=1e-12)


def test_a_camera_cannot_look_at_itself():
    with pytest.raises(OptionError, match="own position"):
        look_at(np.ones(3), np.ones(3))


def test_random_cameras_keep_their_ranges():
    target = np.array([0.1, -0.2, 0.05])
    azimuths = []
    for seed in range(200):
        pose = random_camera(np.random.default_rng(seed), target)
        back = pose[:3, 3] - target
        distance = np.linalg.norm(back)
        assert 0.5 <= distance <= 1.0
        assert 15 - 1e-6 <= np.degrees(np.arcsin(back[2] / distance)) <= 75 + 1e-6
        np.testing.assert_allclose(pose[:3, 2], -back / distance, atol=1e-9)
        azimuths.append(np.arctan2(back[1], back[0]))
    assert np.histogram(azimuths, bins=4, range=(-np.pi, np.pi))[0].min() > 25
    np.testing.assert_array_equal(pose, random_camera(np.random.default_rng(199), target))


@pytest.mark.parametrize("tilt", [16, 45, 75])
def test_rendered_points_lie_on_the_box_or_the_table(tilt):
    pose = camera_at(tilt)
    depth = render_depth([box_on_table()], pose, REALSENSE_D415)
    cloud, _ = depth_to_cloud(depth, REALSENSE_D415)
    world = apply(pose, cloud)
    off = np.minimum(distance_to_box(world), np.abs(world[:, 2]))
    assert off.max() < 2e-6
    assert np.abs(world[:, :2]).max() <= TABLE_SIZE / 2 + 1e-6
    assert (world[:, 2] > 0.01).sum() > 3000


@pytest.mark.parametrize("seed", range(4))
def test_window_and_flat_table_agree_with_casting_every_ray_at_a_mesh(seed):
    rng = np.random.default_rng(seed)
    pose = random_camera(rng, np.array([0.0, 0.0, 0.05]), roll_sd_degrees=20)
    box = box_on_table(*rng.uniform(-0.2, 0.2, 2))
    slab = trimesh.creation.box((TABLE_SIZE, TABLE_SIZE, 0.02))
    slab.apply_translation([0, 0, -0.01])
    x, y = np.meshgrid(*SMALL.rays())
    rays = np.stack([x, y, np.ones_like(x)], axis=-1).reshape(-1, 3) @ pose[:3, :3].T
    hits = RayScene([box, slab]).cast(pose[None, :3, 3], rays)
    plain = np.where(hits.hit & ~((hits.mesh == 1) & (hits.normal[:, 2] < 0.5)), hits.distance, 0)
    fast = render_depth([box], pose, SMALL).ravel()
    differ = ~np.isclose(plain, fast, atol=1e-5)
    # Rays through the table's rim may be counted to either side.
    assert differ.mean() < 2e-4


def test_without_table_only_the_object_is_seen():
    depth = render_depth([box_on_table()], camera_at(30), SMALL, table=False)
    world = apply(camera_at(30), depth_to_cloud(depth, SMALL)[0])
    assert distance_to_box(world).max() < 2e-6
    assert 0 < len(world) < depth.size / 4


def test_objects_behind_or_around_the_camera():
    behind = box_on_table(x=5.0)
    pose = look_at(np.array([1.0, 0.0, 0.5]), np.zeros(3))
    assert not render_depth([behind], pose, SMALL, table=False).any()
    room = trimesh.creation.box((4.0, 4.0, 4.0))
    assert render_depth([room], pose, SMALL, table=False).all()
    assert not render_depth([], pose, SMALL, table=False).any()


def test_presets_and_bad_intrinsics():
    assert {preset.width for preset in PRESETS.values()} == {640}
    with pytest.raises(OptionError, match="positive"):
        Intrinsics(-1.0, 1.0, 0.0, 0.0)
    with pytest.raises(OptionError, match="finite"):
        Intrinsics(1.0, 1.0, np.nan, 0.0)
