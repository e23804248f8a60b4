import numpy as np
import pytest
import trimesh

from ffhnet.errors import ObjectError
from ffhnet.geometry.rotations import geodesic_angle, matrix_from_quaternion, quaternion_from_matrix
from ffhnet.geometry.transforms import apply, make_transform
from ffhnet.objects.convex import circle, convex_hull, rectangle, stack
from ffhnet.objects.inertia import inertia
from ffhnet.objects.resting import resting_poses


def column(section, height):
    return stack([(0.0, section), (height, section)])


def test_a_box_rests_in_three_ways_with_the_solid_angles_of_its_faces():
    poses = resting_poses(column(rectangle(0.02, 0.04), 0.12))
    assert [pose.name for pose in poses] == ["standing", "lying_0", "lying_1"]
    np.testing.assert_array_equal(poses[0].T_world_object, np.eye(4))
    assert sum(pose.probability for pose in poses) == pytest.approx(1.0)
    a, b, c = 0.02, 0.04, 0.06
    angles = [4 * np.arcsin(p * q / np.sqrt((p * p + r * r) * (q * q + r * r)))
              for p, q, r in [(a, b, c), (b, c, a), (a, c, b)]]  # fmt: skip
    for pose, angle in zip(poses, angles, strict=True):
        assert pose.probability == pytest.approx(2 * angle / (4 * np.pi), abs=0.01)
        assert not pose.rolls


def test_a_cylinder_stands_or_lies_and_rolls_only_when_lying():
    poses = resting_poses(column(circle(0.03), 0.1))
    assert [(pose.name, pose.rolls) for pose in poses] == [("standing", False), ("lying_0", True)]
    assert poses[1].T_world_object[2, 3] == pytest.approx(0.03)


def test_a_finely_meshed_ball_rests_in_one_way_and_rolls():
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.03)
    poses = resting_poses([convex_hull(np.asarray(ball.vertices))])
    assert len(poses) == 1
    assert poses[0].rolls
    assert poses[0].probability == pytest.approx(1.0)


def test_a_rod_on_its_end_is_too_shaky_to_stand():
    # Half the side over half the height: tips over at 2.3 degrees.
    poses = resting_poses(column(rectangle(0.004, 0.004), 0.2))
    assert [pose.name for pose in poses] == ["lying_0"]


def test_the_tilt_margin_decides():
    height = 0.2
    for degrees, name in [(4.5, "lying_0"), (5.5, "standing")]:
        half = height / 2 * np.tan(np.radians(degrees))
        assert resting_poses(column(rectangle(half, half), height))[0].name == name


def test_the_centre_of_mass_is_that_of_the_pieces_not_of_the_hull():
    # The heavy arm is long enough to tip the foot over, though the hull's own centre would not.
    foot = column(rectangle(0.02, 0.02), 0.06)
    arm = trimesh.creation.box(bounds=[[-0.02, -0.02, 0.06], [0.1, 0.02, 0.1]])
    names = [pose.name for pose in resting_poses([*foot, arm])]
    assert "standing" not in names


def test_max_lying_keeps_the_likeliest():
    pieces = column(rectangle(0.02, 0.04), 0.12)
    every = resting_poses(pieces)
    assert [p.probability for p in resting_poses(pieces, max_lying=1)] == [p.probability for p in every[:2]]


def test_a_body_that_nothing_holds_is_refused(monkeypatch):
    monkeypatch.setattr("ffhnet.objects.resting.TILT_MARGIN", np.radians(89))
    with pytest.raises(ObjectError, match="tip over"):
        resting_poses(column(rectangle(0.02, 0.04), 0.12))


def test_poses_rest_on_zero_below_the_centre_of_mass(objects):
    for obj in objects[:100]:
        _, centre, _ = inertia(obj)
        vertices = np.concatenate([piece.vertices for piece in obj.pieces])
        assert len(obj.pose_names) == len(obj.resting_poses) == len(set(obj.pose_names)) <= 5
        for pose in obj.resting_poses:
            np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-9)
            assert np.linalg.det(pose[:3, :3]) > 0
            assert abs(apply(pose, vertices)[:, 2].min()) < 1e-9, obj.name
            np.testing.assert_allclose(apply(pose, centre)[:2], 0, atol=1e-9, err_msg=obj.name)


def test_most_objects_stand_and_lie(objects):
    assert np.mean([obj.pose_names[0] == "standing" for obj in objects]) > 0.95
    assert np.mean([len(obj.pose_names) >= 2 for obj in objects]) > 0.95


def test_poses_stay_put_in_physics(one_per_family, compile_object):
    mujoco = pytest.importorskip("mujoco")
    for obj in one_per_family:
        model = compile_object(obj)
        data = mujoco.MjData(model)
        _, centre, _ = inertia(obj)
        for name, pose in zip(obj.pose_names, obj.resting_poses, strict=True):
            mujoco.mj_resetData(model, data)
            data.qpos[:3] = pose[:3, 3]
            data.qpos[3:7] = quaternion_from_matrix(pose[:3, :3])
            mujoco.mj_step(model, data, nstep=500)
            after = make_transform(matrix_from_quaternion(data.qpos[3:7]), data.qpos[:3])
            moved = np.linalg.norm(apply(after, centre) - apply(pose, centre))
            turned = np.degrees(geodesic_angle(pose[:3, :3], after[:3, :3]))
            assert moved < 0.005, f"{obj.name} {name} moved by {moved * 1e3:.1f} mm"
            assert turned < 3, f"{obj.name} {name} turned by {turned:.1f} degrees"
