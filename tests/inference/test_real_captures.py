"""The whole path on real depth data: ranked grasps whose palms lie outside the cloud and approach it."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from ffhnet.inference import FFHNet
from ffhnet.perception.camera import Intrinsics
from ffhnet.perception.capture import read_cloud, read_depth
from ffhnet.perception.observation import observe_depth, observe_object

CAPTURES = Path(__file__).parents[3] / "shared" / "data" / "captures"
OBJECTS = ("cheez_it", "mustard_bottle", "red_mug", "soft_scrub")
SCENES = (
    "realsense_single/mustard",
    "realsense_single/sugar",
    "realsense_single/red_mug",
    "kinect_osd/learn0",
)

pytestmark = pytest.mark.skipif(
    not CAPTURES.is_dir(), reason="real captures are not part of the repository (licences)"
)


@pytest.fixture(scope="module")
def network():
    return FFHNet.from_pretrained()


def check(network, observation):
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
def test_object_clouds_of_a_d415(network, name):
    folder = CAPTURES / "d415_objects" / name
    up = np.array(json.loads((folder / "meta.json").read_text())["T_cloud_mesh"])[:3, 2]
    check(network, observe_object(read_cloud(folder / "cloud.ply"), up, "camera"))


@pytest.mark.parametrize("name", SCENES)
def test_table_scenes(network, name):
    folder = CAPTURES / name
    meta = json.loads((folder / "meta.json").read_text())
    depth = read_depth(folder / "depth.png", meta["depth_scale_m_per_unit"])
    K = np.array(meta["K"])
    intrinsics = Intrinsics(K[0, 0], K[1, 1], K[0, 2], K[1, 2], depth.shape[1], depth.shape[0])
    check(network, observe_depth(depth, intrinsics, np.random.default_rng(0)))
