import json

import numpy as np
import pytest
import trimesh
from perception_scenes import box_on_table, camera_at, true_plane
from PIL import Image

from ffhnet.errors import SceneError
from ffhnet.geometry.transforms import apply, invert, make_transform
from ffhnet.perception.camera import KINECT_V1, REALSENSE_D415, Intrinsics, render_depth
from ffhnet.perception.capture import read_depth
from ffhnet.perception.cloud import depth_to_cloud
from ffhnet.perception.segment import segment_objects
from ffhnet.perception.sensor_noise import StereoNoise
from ffhnet.perception.table import Plane, fit_table

K = REALSENSE_D415


def noisy_cloud(meshes, pose, seed=0, table=True):
    rng = np.random.default_rng(seed)
    depth = render_depth(meshes, pose, K, table=table)
    return depth_to_cloud(StereoNoise().apply(depth, K, rng), K)[0]


def slab(size, centre):
    mesh = trimesh.creation.box(size)
    mesh.apply_translation(centre)
    return mesh


def assert_plane(found, wanted, pose):
    assert np.degrees(np.arccos(np.clip(found.normal @ wanted.normal, -1, 1))) < 1
    below_object = apply(invert(pose), np.zeros(3))
    assert abs(found.height(below_object) - wanted.height(below_object)) < 0.003


@pytest.mark.parametrize("tilt", [15, 30, 50, 75, 90])
def test_table_is_found_from_any_tilt(tilt):
    pose = camera_at(tilt)
    for seed in range(3):
        found = fit_table(noisy_cloud([box_on_table()], pose, seed), np.random.default_rng(seed))
        assert_plane(found, true_plane(pose), pose)


def test_a_wall_is_not_a_table():
    pose = camera_at(30, azimuth=0.0)
    wall = slab((0.02, 2.0, 2.0), (-0.45, 0.0, 0.5))
    found = fit_table(noisy_cloud([box_on_table(), wall], pose), np.random.default_rng(0))
    assert_plane(found, true_plane(pose), pose)
    objects = segment_objects(noisy_cloud([box_on_table(), wall], pose), found)
    assert np.abs(apply(pose, noisy_cloud([box_on_table(), wall], pose)[objects[0]])).max() < 0.2


def test_a_small_table_is_preferred_to_the_floor_around_it():
    pose = camera_at(50, distance=0.9)
    stool = slab((0.5, 0.5, 0.03), (0, 0, -0.015))
    floor = slab((6, 6, 0.02), (0, 0, -0.51))
    cloud = noisy_cloud([box_on_table(), stool, floor], pose, table=False)
    assert (np.abs(apply(pose, cloud)[:, 2] + 0.5) < 0.05).sum() > (
        np.abs(apply(pose, cloud)[:, 2]) < 0.01
    ).sum()
    assert_plane(fit_table(cloud, np.random.default_rng(0)), true_plane(pose), pose)


def test_an_up_hint_overrules_the_guess():
    pose = camera_at(10, azimuth=0.0)
    wall = slab((0.02, 2.0, 2.0), (-0.3, 0.0, 0.5))
    cloud = noisy_cloud([wall], pose)
    up = invert(pose)[:3, 2]
    assert_plane(fit_table(cloud, np.random.default_rng(0), up_hint=up), true_plane(pose), pose)


def test_no_table_is_an_error():
    cloud = np.random.default_rng(0).uniform(-0.5, 0.5, (5000, 3)) + np.array([0, 0, 1])
    with pytest.raises(SceneError, match="no table"):
        fit_table(cloud, np.random.default_rng(0))
    line = np.linspace(0, 1, 500)[:, None] * [0.1, 0.2, 0.3] + [0, 0, 0.5]
    with pytest.raises(SceneError, match="no table"):
        fit_table(line, np.random.default_rng(0))


def test_an_empty_table_holds_no_object():
    pose = camera_at(40)
    cloud = noisy_cloud([], pose)
    with pytest.raises(SceneError, match="no object"):
        segment_objects(cloud, true_plane(pose))


def test_objects_are_taken_apart_and_the_middle_one_comes_first():
    pose = camera_at(45)
    middle = box_on_table(sides=(0.06, 0.08, 0.12))
    aside = box_on_table(0.05, 0.22, sides=(0.07, 0.09, 0.14))
    flat = box_on_table(-0.1, -0.2, sides=(0.08, 0.08, 0.02))
    cloud = noisy_cloud([middle, aside, flat], pose)
    objects = segment_objects(cloud, fit_table(cloud, np.random.default_rng(0)))
    assert len(objects) == 3
    assert len(np.unique(np.concatenate(objects))) == sum(map(len, objects))
    means = [apply(pose, cloud[members]).mean(axis=0) for members in objects]
    assert np.linalg.norm(means[0][:2]) < 0.05
    assert {tuple(np.sign(mean[:2])) for mean in means[1:]} == {(1.0, 1.0), (-1.0, -1.0)}


def mug_with_handle():
    """A tall cup and a vertical bar beside it, 2 cm away and clear of the table: the gap is wider than any
    that noise leaves, so that the bar is a cluster of its own."""
    cup = trimesh.creation.cylinder(radius=0.035, height=0.12)
    cup.apply_translation([0, 0, 0.06])
    return [cup, slab((0.015, 0.03, 0.06), (0.0, -0.075, 0.07))]


@pytest.mark.parametrize("tilt", [20, 40, 60])
def test_a_part_that_hangs_in_the_air_belongs_to_what_is_beside_it(tilt):
    for seed in range(3):
        pose = camera_at(tilt, azimuth=0.0)
        cloud = noisy_cloud(mug_with_handle(), pose, seed)
        objects = segment_objects(cloud, true_plane(pose))
        assert len(objects) == 1
        world = apply(pose, cloud)
        on_bar = np.flatnonzero((np.abs(world[:, 1] + 0.075) < 0.015) & (np.abs(world[:, 2] - 0.07) < 0.03))
        assert np.isin(on_bar, objects[0]).mean() > 0.9


@pytest.mark.parametrize("seed", range(3))
def test_a_part_over_the_rest_is_joined_where_it_hides_the_neck(seed):
    # From above, the head of a duck is an island: its neck is not seen.
    head = slab((0.05, 0.05, 0.01), (0.0, 0.0, 0.12))
    pose = camera_at(80)
    objects = segment_objects(
        noisy_cloud([box_on_table(sides=(0.1, 0.14, 0.06)), head], pose, seed), true_plane(pose)
    )
    assert len(objects) == 1


def test_what_stands_alone_in_the_air_stays_alone():
    pose = camera_at(40, azimuth=0.0)
    far = slab((0.03, 0.03, 0.06), (0.0, -0.2, 0.07))
    assert len(segment_objects(noisy_cloud([box_on_table(), far], pose), true_plane(pose))) == 2


@pytest.mark.parametrize("gap", [0.04, 0.06])
@pytest.mark.parametrize("tilt", [20, 35])
def test_an_object_behind_another_keeps_to_itself_though_its_foot_is_hidden(gap, tilt):
    pose = camera_at(tilt, azimuth=0.0)
    front = box_on_table(0.05, sides=(0.06, 0.12, 0.08))
    rear = box_on_table(0.02 - gap - 0.03, sides=(0.06, 0.08, 0.18))
    for seed in range(3):
        assert len(segment_objects(noisy_cloud([front, rear], pose, seed), true_plane(pose))) == 2


def test_overhead_views_of_neighbours_are_not_joined():
    for tilt in (75, 88):
        pose = camera_at(tilt)
        boxes = [box_on_table(x, sides=(0.06, 0.06, 0.12)) for x in (-0.045, 0.045)]
        assert len(segment_objects(noisy_cloud(boxes, pose), true_plane(pose))) == 2


def test_an_object_seen_against_nothing_is_not_cut_off():
    # The tall box rises over the far edge of the table, where no camera reading is: the highest of the cloud.
    pose = camera_at(16, distance=0.8)
    tall, short = box_on_table(sides=(0.08, 0.1, 0.3)), box_on_table(0.0, 0.2, sides=(0.04, 0.04, 0.05))
    cloud = noisy_cloud([tall, short], pose)
    objects = segment_objects(cloud, true_plane(pose))
    assert len(objects) == 2
    assert np.abs(apply(pose, cloud[objects[0]]).mean(axis=0)[:2]).max() < 0.06


def test_what_the_view_cuts_off_comes_last():
    pose = camera_at(45)
    cut_off = box_on_table(-0.13, 0.3, sides=(0.15, 0.15, 0.2))
    cloud = noisy_cloud([box_on_table(sides=(0.04, 0.04, 0.06)), cut_off], pose)
    objects = segment_objects(cloud, true_plane(pose))
    assert len(objects[0]) < len(objects[1])
    assert np.linalg.norm(apply(pose, cloud[objects[0]]).mean(axis=0)[:2]) < 0.05


def test_the_bottom_of_the_object_is_kept_and_the_table_left():
    pose = camera_at(30)
    cloud = noisy_cloud([box_on_table()], pose)
    members = segment_objects(cloud, true_plane(pose))[0]
    world = apply(pose, cloud)
    on_box = (np.abs(world[:, :2]) < [0.033, 0.053]).all(axis=1) & (world[:, 2] > 0.006)
    kept = np.isin(np.flatnonzero(on_box), members).mean()
    assert kept > 0.98
    assert np.percentile(world[members, 2], 0.5) < 0.007
    assert (np.abs(world[members, :2]) < [0.04, 0.06]).all(axis=1).mean() > 0.99


def test_a_plane_keeps_its_heights_in_another_frame():
    pose = camera_at(33)
    plane = Plane(np.array([0.6, 0.0, 0.8]), 0.25)
    points = np.random.default_rng(0).normal(size=(20, 3))
    np.testing.assert_allclose(plane.to_frame(pose).height(apply(pose, points)), plane.height(points))
    flat = plane.coordinates(points)
    lifted = plane.coordinates(points + 0.3 * plane.normal)
    np.testing.assert_allclose(flat, lifted, atol=1e-12)
    across = np.linalg.norm(np.diff(points - plane.height(points)[:, None] * plane.normal, axis=0), axis=1)
    np.testing.assert_allclose(np.linalg.norm(np.diff(flat, axis=0), axis=1), across)


def load_capture(folder):
    meta = json.loads((folder / "meta.json").read_text())
    k = np.array(meta["K"])
    intrinsics = Intrinsics(k[0, 0], k[1, 1], k[0, 2], k[1, 2], meta["width"], meta["height"])
    return read_depth(folder / "depth.png", meta["depth_scale_m_per_unit"]), intrinsics, meta


@pytest.mark.parametrize("name", ["cheezit", "cylinder", "green_bowl", "mustard", "red_mug", "sugar"])
def test_real_single_objects_match_their_masks(captures, name):
    depth, intrinsics, meta = load_capture(captures / "realsense_single" / name)
    cloud, pixels = depth_to_cloud(depth, intrinsics)
    plane = fit_table(cloud, np.random.default_rng(0))
    if "table_plane_camera" in meta:
        wanted = np.array(meta["table_plane_camera"])
        assert np.degrees(np.arccos(np.clip(plane.normal @ wanted[:3], -1, 1))) < 1
    found = np.zeros(depth.size, dtype=bool)
    found[pixels[segment_objects(cloud, plane)[0]]] = True
    mask = (np.asarray(Image.open(captures / "realsense_single" / name / "mask.png")) > 0) & (depth > 0)
    both = (found & mask.ravel()).sum()
    assert both / (found | mask.ravel()).sum() > 0.96


@pytest.mark.parametrize("name", ["00", "02", "05"])
def test_real_overhead_views_find_the_object_beside_the_robot(captures, name):
    depth, intrinsics, meta = load_capture(captures / "primesense_single" / name)
    cloud, pixels = depth_to_cloud(depth, intrinsics)
    plane = fit_table(cloud, np.random.default_rng(0))
    up = np.array(meta["camera_to_world"]["rotation"])[2]
    assert np.degrees(np.arccos(np.clip(plane.normal @ up, -1, 1))) < 1
    found = pixels[segment_objects(cloud, plane)[0]]
    mask = (np.asarray(Image.open(captures / "primesense_single" / name / "mask.png")) > 0).ravel()
    assert mask[found].mean() > 0.8


def test_the_camera_may_be_another_one():
    pose = camera_at(40) @ make_transform(position=np.array([0.02, 0.01, 0.0]))
    depth = render_depth([box_on_table()], pose, KINECT_V1)
    cloud, _ = depth_to_cloud(
        StereoNoise(baseline=0.075).apply(depth, KINECT_V1, np.random.default_rng(0)), KINECT_V1
    )
    assert_plane(fit_table(cloud, np.random.default_rng(0)), true_plane(pose), pose)
