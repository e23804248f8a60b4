import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from perception_scenes import box_on_table, camera_at, distance_to_box, true_plane

from ffhnet.errors import CloudError, OptionError, SceneError
from ffhnet.geometry.rotations import about_z
from ffhnet.geometry.transforms import apply, invert
from ffhnet.perception.bps import encode
from ffhnet.perception.camera import REALSENSE_D415, random_camera, render_depth
from ffhnet.perception.cloud import depth_to_cloud
from ffhnet.perception.observation import observe_depth, observe_object, observe_objects, observe_scene
from ffhnet.perception.sensor_noise import StereoNoise
from ffhnet.perception.view_frame import view_frame

K = REALSENSE_D415


def view(pose, seed=0, noise=True):
    depth = render_depth([box_on_table()], pose, K)
    return StereoNoise().apply(depth, K, np.random.default_rng(seed)) if noise else depth


directions = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1)


@given(up=directions, looking=directions)
@settings(max_examples=100, deadline=None)
def test_view_frame_is_a_right_handed_frame_with_z_up(up, looking):
    cloud = np.random.default_rng(0).normal(size=(60, 3))
    T = view_frame(cloud, np.array(up), np.array(looking))
    np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-9)
    assert np.linalg.det(T[:3, :3]) == pytest.approx(1)
    np.testing.assert_allclose(T[:3, 2], np.array(up) / np.linalg.norm(up), atol=1e-12)
    np.testing.assert_allclose(apply(invert(T), cloud).mean(axis=0), 0, atol=1e-9)
    horizontal = np.cross(np.array(up) / np.linalg.norm(up), np.array(looking) / np.linalg.norm(looking))
    if np.linalg.norm(horizontal) > 0.05:
        assert abs(T[:3, 1] @ looking) < 1e-9
        assert T[:3, 0] @ looking > 0


def test_looking_straight_down_x_is_up_in_the_image():
    T = view_frame(np.eye(3), np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(T[:3, 0], [0, -1, 0], atol=1e-12)
    slightly_tilted = view_frame(np.eye(3), np.array([0.0, -0.1, -1.0]), np.array([0.0, 0.0, 1.0]))
    assert slightly_tilted[:3, 0] @ T[:3, 0] > 0.99


@pytest.mark.parametrize("seed", range(5))
def test_simulated_views_recover_plane_and_object(seed):
    rng = np.random.default_rng(seed)
    pose = random_camera(rng, np.array([0.0, 0.0, 0.08]))
    seen = observe_depth(view(pose, seed), K, rng)
    wanted = true_plane(pose)
    assert np.degrees(np.arccos(np.clip(seen.plane.normal @ wanted.normal, -1, 1))) < 1
    assert abs(seen.plane.height(apply(invert(pose), np.zeros(3)))) < 0.003
    world = apply(pose, seen.cloud)
    off = distance_to_box(world)
    assert np.median(off) < 0.0015
    assert np.percentile(off, 99) < 0.006
    # Nearly all pixels that show the box more than 8 mm above the table are there.
    perfect = apply(pose, depth_to_cloud(view(pose, noise=False), K)[0])
    assert len(seen.cloud) > 0.9 * (perfect[:, 2] > 0.008).sum()


def test_parts_of_an_observation_fit_together():
    pose = camera_at(35)
    seen = observe_depth(view(pose), K, np.random.default_rng(0))
    assert seen.frame == "camera"
    np.testing.assert_allclose(seen.cloud_view.mean(axis=0), 0, atol=1e-9)
    np.testing.assert_array_equal(seen.bps, encode(seen.cloud_view))
    np.testing.assert_allclose(seen.up, seen.plane.normal)
    heights = seen.plane.height(seen.cloud)
    np.testing.assert_allclose(seen.cloud_view[:, 2] - seen.table_height, heights, atol=1e-9)
    assert seen.table_height == pytest.approx(-apply(pose, seen.cloud)[:, 2].mean(), abs=0.002)
    # The camera stands on the -x side, in the plane y = 0.
    eye = apply(invert(seen.T_input_view), np.zeros(3))
    assert eye[0] < -0.4
    assert abs(eye[1]) < 1e-9


def test_the_view_frame_does_not_see_the_camera_tilt_or_azimuth():
    codes = []
    for azimuth, turn in ((0.0, 0.0), (2.0, 2.0)):
        pose = camera_at(35, azimuth=azimuth)
        box = box_on_table().apply_transform(np.block([[about_z(turn), np.zeros((3, 1))], [np.zeros(3), 1]]))
        depth = render_depth([box], pose, K)
        codes.append(observe_depth(depth, K, np.random.default_rng(0)).bps)
    np.testing.assert_allclose(*codes, atol=1e-3)


def test_a_cut_out_object_gives_the_same_observation_as_its_scene():
    seen = observe_depth(view(camera_at(35)), K, np.random.default_rng(0))
    again = observe_object(seen.cloud, seen.up, "camera", table_height=seen.table_height)
    np.testing.assert_allclose(again.T_input_view, seen.T_input_view, atol=1e-9)
    np.testing.assert_allclose(again.bps, seen.bps, atol=1e-6)
    guessed = observe_object(seen.cloud, 3 * seen.up, "camera")
    assert abs(guessed.table_height - seen.table_height) < 0.01


def test_viewing_direction_of_centred_and_world_clouds():
    seen = observe_depth(view(camera_at(35)), K, np.random.default_rng(0))
    centred = seen.cloud - seen.cloud.mean(axis=0)
    x = observe_object(centred, seen.up, "camera").T_input_view[:3, 0]
    assert x[0] == pytest.approx(0, abs=0.02)
    assert x[2] > 0
    world = apply(camera_at(35), seen.cloud)
    up = np.array([0.0, 0.0, 1.0])
    np.testing.assert_allclose(observe_object(world, up, "world").T_input_view[:3, 0], [1, 0, 0], atol=1e-12)
    turned = observe_object(world, up, "world", viewing_direction=np.array([0.0, 2.0, -1.0]))
    np.testing.assert_allclose(turned.T_input_view[:3, 0], [0, 1, 0], atol=1e-12)


def test_a_mask_chooses_the_object():
    pose = camera_at(45)
    meshes = [box_on_table(), box_on_table(0.05, 0.22)]
    depth = StereoNoise().apply(render_depth(meshes, pose, K), K, np.random.default_rng(0))
    only_second = render_depth([meshes[1]], pose, K, table=False)
    mask = (only_second > 0) & (np.abs(depth - only_second) < 0.01)
    seen = observe_depth(depth, K, np.random.default_rng(0), mask=mask)
    np.testing.assert_allclose(apply(pose, seen.cloud).mean(axis=0)[:2], [0.05, 0.22], atol=0.05)
    cloud, pixels = depth_to_cloud(depth, K)
    organised = np.full((*depth.shape, 3), np.nan)
    organised.reshape(-1, 3)[pixels] = cloud
    same = observe_scene(organised, np.random.default_rng(0), mask=mask)
    np.testing.assert_array_equal(seen.bps, same.bps)
    second = observe_depth(depth, K, np.random.default_rng(0), object_index=1)
    np.testing.assert_allclose(apply(pose, second.cloud).mean(axis=0)[:2], [0.05, 0.22], atol=0.05)


def test_same_seed_same_observation():
    depth = view(camera_at(35))
    first, second = (observe_depth(depth, K, np.random.default_rng(1)) for _ in range(2))
    np.testing.assert_array_equal(first.cloud, second.cloud)
    np.testing.assert_array_equal(first.bps, second.bps)


@pytest.mark.parametrize("tilt", [35, 90])
def test_axes_of_computer_graphics_show_the_same_scene(tilt):
    cloud, _ = depth_to_cloud(view(camera_at(tilt)), K)
    turned = np.diag([1.0, -1.0, -1.0, 1.0])
    usual = observe_scene(cloud, np.random.default_rng(0))
    other = observe_scene(apply(turned, cloud), np.random.default_rng(0))
    np.testing.assert_allclose(other.T_input_view, turned @ usual.T_input_view, atol=1e-9)
    np.testing.assert_allclose(other.bps, usual.bps, atol=1e-6)
    np.testing.assert_allclose(other.plane.height(apply(turned, cloud)), usual.plane.height(cloud), atol=1e-9)
    assert other.table_height == pytest.approx(usual.table_height)


def test_all_objects_are_the_ones_that_a_number_chooses():
    depth = render_depth([box_on_table(), box_on_table(0.05, 0.22)], camera_at(45), K)
    cloud, _ = depth_to_cloud(StereoNoise().apply(depth, K, np.random.default_rng(0)), K)
    found = observe_objects(cloud, np.random.default_rng(0))
    assert len(found) == 2
    for i, seen in enumerate(found):
        one = observe_scene(cloud, np.random.default_rng(0), object_index=i)
        np.testing.assert_array_equal(seen.bps, one.bps)
        assert seen.scene is not seen.cloud
        assert len(seen.scene) == len(cloud)


def test_bad_input_is_refused():
    rng = np.random.default_rng(0)
    depth = view(camera_at(35))
    cloud, _ = depth_to_cloud(depth, K)
    with pytest.raises(SceneError, match="wanted object 3, but the scene has 1"):
        observe_depth(depth, K, rng, object_index=3)
    with pytest.raises(CloudError, match="at least 50 readings, got 0"):
        observe_depth(np.zeros_like(depth), K, rng)
    with pytest.raises(OptionError, match="mask"):
        observe_depth(depth, K, rng, mask=np.ones((3, 3), dtype=bool))
    with pytest.raises(OptionError, match="mask"):
        observe_scene(cloud, rng, mask=np.ones(7, dtype=bool))
    with pytest.raises(SceneError, match="of the mask"):
        observe_depth(depth, K, rng, mask=np.zeros_like(depth, dtype=bool))
    with pytest.raises(CloudError, match="camera's frame"):
        observe_scene(cloud - [0, 0, np.median(cloud[:, 2])], rng)
    with pytest.raises(CloudError, match="millimetres"):
        observe_scene(cloud * 1000, rng)
    with pytest.raises(OptionError, match="up direction"):
        observe_object(cloud, np.zeros(3), "camera")
    with pytest.raises(OptionError, match="below"):
        observe_object(cloud, np.array([0.0, -1.0, 0.0]), "camera", table_height=0.1)
