"""The renderer against geometry that is known by hand, and the pictures' rules."""

import numpy as np
import pytest
import trimesh
from PIL import Image

from ffhnet.errors import HandError, OptionError
from ffhnet.evaluation.picture import distinct, grasp_picture
from ffhnet.evaluation.render import BACKGROUND, Surface, camera_around, pixels_of, render, square_camera
from ffhnet.evaluation.shapes import (
    AXES,
    approach_arrows,
    cloud_surface,
    color_scale,
    frame_surfaces,
    hand_surfaces,
)
from ffhnet.evaluation.sheets import objects_picture
from ffhnet.geometry.rotations import matrix_from_rotation_vector
from ffhnet.geometry.transforms import make_transform
from ffhnet.grasps import Grasps
from ffhnet.hands import load_hand
from ffhnet.perception.observation import observe_object

ORANGE = np.array([0.9, 0.5, 0.1])
BLANK = np.round(255 * BACKGROUND)


def seen(picture):
    """Which pixels are not background."""
    return np.abs(picture.astype(float) - BLANK).max(axis=-1) > 3


@pytest.fixture(scope="module")
def ball():
    return trimesh.creation.icosphere(subdivisions=4, radius=0.1)


def test_a_ball_is_a_disc_of_the_right_size(ball):
    camera = square_camera(301, field_of_view_degrees=40)
    T_world_camera = make_transform(np.diag([1.0, -1, -1]), np.array([0, 0, 1.0]))  # looks down
    disc = seen(render([Surface(ball, ORANGE)], T_world_camera, camera))
    # The cone that touches a ball of radius r at distance d has the half angle asin(r / d).
    radius = camera.fx * np.tan(np.arcsin(0.1))
    assert disc.sum() == pytest.approx(np.pi * radius**2, rel=0.03)
    rows, columns = np.nonzero(disc)
    assert (rows.mean(), columns.mean()) == pytest.approx((150, 150), abs=0.1)


@pytest.mark.parametrize("azimuth", [0, 75, 200])
@pytest.mark.parametrize("elevation", [-20, 10, 60])
def test_camera_around_fills_the_picture(azimuth, elevation):
    points = np.random.default_rng(0).normal(size=(200, 3)) * [0.3, 0.1, 0.2] + [1, -2, 0.5]
    camera = square_camera(300)
    T_world_camera = camera_around(points, azimuth, elevation, camera, margin=1.1)
    pixels = pixels_of(points, T_world_camera, camera)
    assert pixels.min() >= -0.5
    assert pixels.max() <= 299.5
    assert np.ptp(pixels, axis=0).max() > 0.85 * 300
    back = -T_world_camera[:3, 2]
    assert np.degrees(np.arcsin(back[2])) == pytest.approx(elevation, abs=1e-6)
    assert np.degrees(np.arctan2(back[1], back[0])) % 360 == pytest.approx(azimuth, abs=1e-6)


def test_left_is_left_and_near_hides_far(ball):
    """Seen from +x, world +y is at the right and z up; the nearer of two balls is drawn."""
    red, green, blue = (Surface(ball.copy(), color) for color in AXES)
    red.mesh.apply_translation([0, 0.3, 0])
    green.mesh.apply_translation([0, 0, 0.3])
    blue.mesh.apply_translation([-0.5, 0.3, 0])  # behind the red one
    surfaces = [red, green, blue]
    points = np.concatenate([surface.mesh.vertices for surface in surfaces])
    camera = square_camera(120)
    T_world_camera = camera_around(points, 0, 0, camera)
    picture = render(surfaces, T_world_camera, camera).astype(int)
    centres = pixels_of(np.array([[0, 0.3, 0], [0, 0, 0.3]]), T_world_camera, camera).round().astype(int)
    (right, low), (middle, high) = centres
    assert right > middle
    assert low > high
    assert picture[low, right].argmax() == 0
    assert picture[high, middle].argmax() == 1


def test_the_ground_lies_where_it_should_and_takes_shadows(ball):
    camera = square_camera(80)
    T_world_camera = camera_around(ball.vertices, 0, 40, camera, margin=3)
    empty = trimesh.Trimesh()
    free = render([Surface(empty, ORANGE)], T_world_camera, camera, ground=-0.1).astype(int)
    shaded = render([Surface(ball, ORANGE)], T_world_camera, camera, ground=-0.1).astype(int)
    without = render([Surface(ball, ORANGE)], T_world_camera, camera)
    beside = ~seen(without)
    darker = (free - shaded)[beside].max(axis=-1) > 20
    assert 50 < darker.sum() < 0.5 * beside.sum()
    # A ground above the ball hides it from a camera that looks down.
    hidden = render([Surface(ball, ORANGE)], T_world_camera, camera, ground=0.11).astype(int)
    assert (hidden[..., 0] - hidden[..., 2]).max() < 30


def test_same_picture_every_time(ball):
    camera = square_camera(60)
    T_world_camera = camera_around(ball.vertices, 20, 30, camera)
    first, second = (render([Surface(ball, ORANGE)], T_world_camera, camera, ground=-0.1) for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_axes_point_along_the_frame():
    T_world_frame = make_transform(matrix_from_rotation_vector([0.3, -1.1, 0.7]), np.array([0.1, 0.2, 0.3]))
    for axis, surface in enumerate(frame_surfaces(T_world_frame, length=0.2, radius=0.002)):
        ends = (surface.mesh.vertices - T_world_frame[:3, 3]) @ T_world_frame[:3, :3]
        assert ends[:, axis].max() == pytest.approx(0.2)
        assert np.abs(np.delete(ends, axis, axis=1)).max() < 0.01
        np.testing.assert_array_equal(surface.color, AXES[axis])


def test_approach_arrows_start_at_the_palms_and_follow_palm_x():
    rotation = matrix_from_rotation_vector(np.random.default_rng(0).normal(size=(4, 3)))
    position = np.random.default_rng(1).normal(size=(4, 3))
    surface = approach_arrows(rotation, position, color_scale(np.linspace(0, 1, 4)), length=0.05)
    vertices = surface.mesh.vertices.reshape(4, -1, 3)
    for arrow, R, origin in zip(vertices, rotation, position, strict=True):
        along = (arrow - origin) @ R[:, 0]
        assert (along.min(), along.max()) == pytest.approx((0, 0.05), abs=1e-9)


def test_hand_surfaces_are_the_hand():
    """Three colours, together the faces of Hand.shape at the palm pose."""
    hand = load_hand()
    T_world_palm = make_transform(matrix_from_rotation_vector([0.3, -1.1, 0.7]), np.array([0.1, 0.2, 0.3]))
    whole = hand.shape(hand.eigengrasp_origin).apply_transform(T_world_palm)
    parts = hand_surfaces(hand, hand.eigengrasp_origin, T_world_palm)
    assert len(parts) == 3
    assert sum(len(part.mesh.faces) for part in parts) == len(whole.faces)
    joined = trimesh.util.concatenate([part.mesh for part in parts])
    np.testing.assert_allclose(joined.bounds, whole.bounds, atol=1e-9)
    assert joined.area == pytest.approx(whole.area)
    palm = parts[0].mesh
    assert len(palm.faces) == 4 * 12  # four boxes


def test_a_thinned_cloud_covers_the_cloud():
    cloud = np.random.default_rng(0).uniform(-0.1, 0.1, (20_000, 3))
    surface = cloud_surface(cloud, detail=20)
    centres = surface.mesh.triangles_center
    assert len(centres) <= 21**3 * 20
    np.testing.assert_allclose(surface.mesh.bounds, [cloud.min(axis=0), cloud.max(axis=0)], atol=0.02)


def make_grasps(position, probability, frame="world", hand=None):
    hand = hand or load_hand()
    n = len(position)
    return Grasps(
        rotation=np.tile(np.eye(3), (n, 1, 1)),
        position=np.asarray(position, dtype=float),
        joints=np.tile(hand.eigengrasp_origin, (n, 1)),
        joint_names=hand.joint_names,
        hand=hand.name,
        frame=frame,
        probability=None if probability is None else np.asarray(probability, dtype=float),
    )


def test_distinct_skips_near_duplicates_only():
    grasps = make_grasps([[0, 0, 0], [0.01, 0, 0], [0.1, 0, 0], [0, 0, 0], [0.2, 0, 0]], np.linspace(1, 0, 5))
    turned = grasps.rotation.copy()
    turned[3] = matrix_from_rotation_vector([0, 0, 1.0])
    grasps = grasps.replace(rotation=turned)
    assert distinct(grasps, 10) == [0, 2, 3, 4]
    assert distinct(grasps, 2) == [0, 2]
    assert distinct(grasps[:0], 2) == []


@pytest.fixture(scope="module")
def observation():
    cloud = np.random.default_rng(0).uniform(-0.03, 0.03, (300, 3)) + np.array([0.3, 0.1, 0.1])
    return observe_object(cloud, np.array([0, 0, 1.0]), "world")


def test_grasp_picture_of_one_grasp(observation, tmp_path):
    """One grasp has no second one beside it: the panels that are left stay white."""
    path = tmp_path / "picture.png"
    grasp_picture(observation, make_grasps([[0.17, 0.1, 0.1]], [0.7]), load_hand(), path)
    with Image.open(path) as image:
        picture = np.asarray(image)
    assert picture.shape[2] == 3
    assert picture.std() > 20
    assert [file.name for file in tmp_path.iterdir()] == ["picture.png"]


def test_grasp_picture_refuses(observation, tmp_path):
    hand, path, position = load_hand(), tmp_path / "picture.png", [[0.1, 0, 0]]
    with pytest.raises(OptionError, match="at least one grasp"):
        grasp_picture(observation, make_grasps(position, [0.5])[:0], hand, path)
    with pytest.raises(OptionError, match="probability"):
        grasp_picture(observation, make_grasps(position, None), hand, path)
    with pytest.raises(OptionError, match="'world', got 'camera'"):
        grasp_picture(observation, make_grasps(position, [0.5], frame="camera"), hand, path)
    with pytest.raises(HandError, match="other_hand"):
        grasp_picture(observation, make_grasps(position, [0.5]).replace(hand="other_hand"), hand, path)
    assert not path.exists()


def test_objects_picture_refuses_none(tmp_path):
    with pytest.raises(OptionError, match="1 to"):
        objects_picture([], tmp_path / "objects.png")
