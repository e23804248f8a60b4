"""The whole path on real depth data: ranked grasps whose palms lie outside the cloud and approach it."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from ffhnet.errors import CloudError
from ffhnet.evaluation.captures import find_captures, read_capture
from ffhnet.evaluation.captures_physics import observe_registered
from ffhnet.inference import FFHNet

CAPTURES = Path(__file__).parents[3] / "shared" / "data" / "captures"
GRASPED = (
    "d415_objects/cheez_it",
    "d415_objects/mustard_bottle",
    "d415_objects/red_mug",
    "d415_objects/soft_scrub",
    "realsense_single/mustard",
    "realsense_single/sugar",
    "realsense_single/red_mug",
    "kinect_osd/learn0",
)
OBJECTS = {
    "kinect_osd/learn33": 5,
    "kinect_osd/learn39": 4,
    "kinect_osd/test36": 3,
    "realsense_ycb_poses/00": 5,
    "realsense_ycb_poses/01": 6,
    "xtion_ycb/03": 3,
}
"""Captures in which no object touches another, and how many objects clustering finds in each."""

pytestmark = pytest.mark.skipif(
    not CAPTURES.is_dir(), reason="real captures are not part of the repository (licences)"
)


@pytest.fixture(scope="module")
def network():
    return FFHNet.from_pretrained()


@pytest.mark.parametrize("name", GRASPED)
def test_best_grasps_approach_the_object_from_outside(network, name):
    observation = read_capture(CAPTURES / name).observe()[0]
    grasps = network.grasp(observation, num=400)
    assert len(grasps) == 400
    assert (np.diff(grasps.score) <= 0).all()
    best = grasps[:20]
    distance = cKDTree(observation.cloud).query(best.position)[0]
    # The palm origin lies 6 cm inside the hand: nearer than 3 cm, the palm would be in the object.
    assert (distance > 0.03).all()
    assert (distance < 0.20).all()
    to_object = observation.cloud.mean(axis=0) - best.position
    cosine = np.einsum("ij,ij->i", to_object, best.rotation[:, :, 0]) / np.linalg.norm(to_object, axis=1)
    assert (cosine > 0.5).all()
    height = (best.position - observation.T_input_view[:3, 3]) @ observation.up - observation.table_height
    assert (height > 0.0).all()


@pytest.mark.parametrize("name", OBJECTS)
def test_as_many_objects_as_stand_there(name):
    assert len(read_capture(CAPTURES / name).observe()) == OBJECTS[name]


def test_every_capture_can_be_read():
    captures = [read_capture(folder) for folder in find_captures(CAPTURES)]
    assert len(captures) == 44
    assert sum(len(capture.registered) for capture in captures) == 15
    assert all(len(capture.cloud) > 4000 for capture in captures)


def test_a_camera_that_looks_along_minus_z():
    found = read_capture(CAPTURES / "pcl_scenes" / "milk_cartoon_all_small_clorox").observe()
    up = np.array([seen.up for seen in found])
    assert (up[:, 1] > 0.7).all()
    assert sum(len(seen.cloud) > 5000 for seen in found) == 3


def test_a_cloud_that_is_no_scene_is_refused():
    with pytest.raises(CloudError, match="give the up direction"):
        read_capture(CAPTURES / "gpd_clouds" / "krylon").observe()


@pytest.mark.parametrize(
    ("capture", "mesh"), [("realsense_ycb_poses/01", "025_mug"), ("realsense_ycb_poses/02", "011_banana")]
)
def test_registered_meshes_are_where_something_was_seen(capture, mesh):
    read = read_capture(CAPTURES / capture)
    target = next(one for one in read.registered if one.name.endswith(mesh))
    observation, masked = observe_registered(read, target, seed=0)
    # The banana touches a box: only the mask tells them apart.
    assert masked == mesh.endswith("banana")
    off = np.linalg.norm(observation.cloud.mean(axis=0) - target.T_input_mesh[:3, 3])
    assert off < 0.08
