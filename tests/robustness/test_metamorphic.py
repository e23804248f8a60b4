"""What must not change the grasps does not change them, and what may change them little does so little.

Bounds are stated in `docs/robustness.md`; the weights are the package's own.
"""

import numpy as np
import pytest
from scenes import LIKE_OBJECTS, STRANGE, depth_view, object_view

from ffhnet.errors import CloudError
from ffhnet.geometry.rotations import about_z, matrix_from_rotation_vector
from ffhnet.geometry.transforms import apply, make_transform
from ffhnet.inference import FFHNet
from ffhnet.inference.novelty import novelty
from ffhnet.perception.camera import REALSENSE_D415
from ffhnet.perception.cloud import depth_to_cloud
from ffhnet.perception.observation import observe_depth, observe_object, observe_scene

UP = np.array([0.0, 0.0, 1.0])
VIEWS = [("spray_flask_2000005", 1), ("jar_2000004", 2), ("thin_box_2000008", 3)]
NUM = 60


@pytest.fixture(scope="module")
def network():
    return FFHNet.from_pretrained()


@pytest.fixture(scope="module", params=VIEWS, ids=lambda view: view[0])
def view(request):
    return request.param


@pytest.fixture(scope="module")
def cut_out(view, network):
    """The points of an object, where the camera stands, and the grasps (world frame)."""
    cloud, camera = object_view(*view)
    return cloud, camera, network.grasp(see(cloud, camera), NUM)


@pytest.fixture(scope="module")
def scene(view, network):
    """The points of a whole scene and the grasps (camera frame)."""
    depth, _ = depth_view(*view, noise=1.0)
    cloud, _ = depth_to_cloud(depth, REALSENSE_D415)
    return cloud, network.grasp(look(cloud), NUM)


def see(cloud, camera):
    return observe_object(cloud, UP, "world", viewing_direction=cloud.mean(axis=0) - camera)


def look(cloud):
    return observe_scene(cloud, np.random.default_rng(0))


def change(network, observation, grasps):
    """By how much the probabilities of the same grasps differ in another observation."""
    return np.abs(network.evaluate(observation, grasps).probability - grasps.probability)


@pytest.mark.parametrize("angle", [0.7, -2.9])
def test_grasps_turn_and_move_with_the_scene(network, cut_out, angle):
    cloud, camera, grasps = cut_out
    T = make_transform(about_z(angle), np.array([0.3, -1.2, 0.4]))
    moved = network.grasp(see(apply(T, cloud), apply(T, camera[None])[0]), NUM)
    wanted = grasps.to_frame(T, "world")
    np.testing.assert_allclose(moved.position, wanted.position, atol=1e-9)
    np.testing.assert_allclose(moved.rotation, wanted.rotation, atol=1e-9)
    np.testing.assert_allclose(moved.probability, wanted.probability, atol=1e-6)


def test_a_camera_that_rolls_finds_the_same_table(network, scene):
    cloud, grasps = scene
    T = make_transform(matrix_from_rotation_vector(np.array([0.0, 0.0, 0.2])))
    assert change(network, look(apply(T, cloud)), grasps.to_frame(T, "camera")).max() < 0.05


def test_the_order_of_points_does_not_matter(network, cut_out, scene):
    rng = np.random.default_rng(1)
    cloud, camera, grasps = cut_out
    assert change(network, see(rng.permutation(cloud), camera), grasps).max() < 1e-3
    cloud, grasps = scene
    assert change(network, look(rng.permutation(cloud)), grasps).max() < 0.01


def test_points_that_come_twice_do_not_matter(network, cut_out, scene):
    cloud, camera, grasps = cut_out
    assert change(network, see(np.concatenate([cloud, cloud]), camera), grasps).max() < 1e-3
    half = cloud[np.random.default_rng(0).random(len(cloud)) < 0.5]
    assert change(network, see(np.concatenate([cloud, half]), camera), grasps).max() < 0.03
    cloud, grasps = scene
    assert change(network, look(np.concatenate([cloud, cloud])), grasps).max() < 0.01


@pytest.mark.parametrize(("share", "mean"), [(0.5, 0.03), (0.25, 0.05)])
def test_fewer_points_matter_little(network, scene, share, mean):
    cloud, grasps = scene
    thin = cloud[np.random.default_rng(2).random(len(cloud)) < share]
    assert change(network, look(thin), grasps).mean() < mean


def test_noise_does_not_raise_hopes(network):
    def hope(noise):
        views = (depth_view(*view, noise)[0] for view in VIEWS)
        seen = [observe_depth(depth, REALSENSE_D415, np.random.default_rng(0)) for depth in views]
        return np.mean([network.grasp(observation, NUM).probability.mean() for observation in seen])

    usual = hope(1.0)
    assert hope(4.0) < usual + 0.02
    assert hope(8.0) < usual - 0.2


@pytest.mark.parametrize(
    ("cloud", "bound"),
    [
        (STRANGE["table top, 60 cm"], 0.1),
        (STRANGE["wall, 80 cm"], 0.1),
        (STRANGE["car"], 0.1),
        (LIKE_OBJECTS["wire, 40 cm"], 0.4),
    ],
    ids=["plane", "wall", "car", "wire"],
)
def test_what_no_network_was_trained_on_promises_little(network, cloud, bound):
    assert network.grasp(observe_object(cloud, UP, "world"), NUM).probability.mean() < bound


@pytest.mark.parametrize("name", STRANGE)
def test_what_is_no_object_is_stranger_than_objects(network, cut_out, name):
    def score(seen):
        return novelty(network.evaluator.condition, seen.bps)

    cloud, camera, _ = cut_out
    assert score(observe_object(STRANGE[name], UP, "world")) > 1.5 * score(see(cloud, camera))


@pytest.mark.parametrize("far", [1.0, 100.0, 1e6, 1e30])
def test_a_stray_point_far_off_does_not_matter(network, cut_out, far):
    cloud, camera, grasps = cut_out
    strayed = observe_object(
        np.concatenate([cloud, np.full((1, 3), far)]), UP, "world", cloud.mean(axis=0) - camera
    )
    np.testing.assert_array_equal(strayed.cloud, cloud)
    assert change(network, strayed, grasps).max() < 1e-6


@pytest.mark.parametrize(("scale", "unit"), [(0.001, "kilometres"), (1000.0, "millimetres")])
def test_other_units_than_metres_are_refused(cut_out, scale, unit):
    cloud, camera, _ = cut_out
    with pytest.raises(CloudError, match=f"looks like {unit}, wanted metres"):
        see(scale * cloud, scale * camera)
