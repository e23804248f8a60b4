"""The built-in hand against MuJoCo and against published fingertip positions."""

import mujoco
import numpy as np
import pytest
import torch

from ffhnet.errors import HandError
from ffhnet.geometry.transforms import apply, invert
from ffhnet.hands import load_hand

FINGERS = ("index", "little", "middle", "ring", "thumb")
# Fingertips in the root frame, metres; ring x follows the value that four of five sources give.
STRAIGHT = {
    "thumb": (0.107, 0.064, 0.172),
    "index": (-0.0025, 0.0368, 0.2128),
    "middle": (-0.0037, 0.01, 0.2228),
    "ring": (-0.0025, -0.0168, 0.2176),
    "little": (0.001, -0.0434, 0.1986),
}
BENT = {
    "thumb": (0.015, 0.003, 0.147),
    "index": (0.084, 0.029, 0.140),
    "middle": (0.083, 0.010, 0.150),
    "ring": (0.0865 - 0.0025, -0.009, 0.145),
    "little": (0.0865, -0.028, 0.126),
}


@pytest.fixture(scope="module")
def hand():
    return load_hand()


@pytest.fixture(scope="module")
def model(hand):
    return mujoco.MjModel.from_xml_path(str(hand.mjcf))


def fingertips_in_root(hand, joints):
    tips = hand.fingertips(torch.as_tensor(joints, dtype=torch.float64)[None])[0].numpy()
    return dict(zip(FINGERS, apply(hand.T_root_palm, tips), strict=True))


@pytest.mark.parametrize(("angles", "table"), [((0, 0, 0), STRAIGHT), ((0, 0.8, 0.6), BENT)])
def test_fingertip_table(hand, angles, table):
    tips = fingertips_in_root(hand, np.tile(angles, 5))
    for finger, position in table.items():
        np.testing.assert_allclose(tips[finger], position, atol=5e-4)


def test_forward_kinematics_matches_mujoco(hand, model):
    rng = np.random.default_rng(0)
    data = mujoco.MjData(model)
    joints = rng.uniform(hand.lower, hand.upper, (50, hand.num_joints))
    poses = hand.tree.body_poses(torch.as_tensor(joints), hand.joint_names).numpy()
    for row, links in zip(joints, poses, strict=True):
        for name, angle in zip(hand.joint_names, row, strict=True):
            data.joint(name).qpos = angle
            if name.endswith("pip"):
                data.joint(name.replace("pip", "dip")).qpos = angle
        mujoco.mj_kinematics(model, data)
        for body, T_root_body in zip(hand.tree.bodies, links, strict=True):
            np.testing.assert_allclose(T_root_body[:3, 3], data.body(body.name).xpos, atol=1e-9)
            np.testing.assert_allclose(
                T_root_body[:3, :3], data.body(body.name).xmat.reshape(3, 3), atol=1e-8
            )


def test_geoms_match_mujoco(hand, model):
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    poses = hand.tree.body_poses(torch.zeros(1, 15, dtype=torch.float64), hand.joint_names)[0].numpy()
    assert len(hand.tree.geoms) == model.ngeom
    for geom in hand.tree.geoms:
        T_root_geom = poses[geom.body] @ geom.T_body_geom
        np.testing.assert_allclose(T_root_geom[:3, 3], data.geom(geom.name).xpos, atol=1e-8)
        axis = data.geom(geom.name).xmat.reshape(3, 3)[:, 2]
        assert abs(T_root_geom[:3, 2] @ axis) > 1 - 1e-8
        np.testing.assert_allclose(model.geom(geom.name).size[: len(geom.size)], geom.size, atol=1e-9)


def test_shape_mesh_has_the_extent_of_mujocos_geoms(hand):
    mesh = hand.shape(np.zeros(15))
    mesh.apply_transform(hand.T_root_palm)
    # The highest point is the middle finger's tip: 0.1178 + 0.055 + 0.025 + 0.0149 + radius 0.0115.
    assert mesh.bounds[1, 2] == pytest.approx(0.1178 + 0.055 + 0.025 + 0.0149 + 0.0115, abs=1e-3)
    assert mesh.bounds[0, 2] == pytest.approx(-0.002, abs=1e-3)


def test_mass_and_couplings(hand, model):
    assert model.body_mass.sum() == pytest.approx(1.50, abs=1e-9)
    assert model.nu == 15
    assert model.njnt == 20
    assert [(c.leader, c.follower) for c in hand.tree.couplings] == [
        (f"{f}_pip", f"{f}_dip") for f in FINGERS
    ]
    poses = hand.tree.body_poses(torch.full((1, 15), 0.7, dtype=torch.float64), hand.joint_names)[0]
    names = [body.name for body in hand.tree.bodies]
    for finger in FINGERS:
        proximal, medial, distal = (
            poses[names.index(f"{finger}_{link}")] for link in ("proximal", "medial", "distal")
        )
        angle = np.arccos((np.trace((invert(proximal.numpy()) @ medial.numpy())[:3, :3]) - 1) / 2)
        # The distal link's frame is turned by -90 degrees about the joint axis at zero.
        relative = (invert(medial.numpy()) @ distal.numpy())[:3, :3]
        distal_angle = np.arctan2(relative[1, 0], relative[0, 0]) + np.pi / 2
        assert distal_angle == pytest.approx(angle, abs=1e-12)


def test_palm_x_is_between_fingers_and_thumb(hand):
    """The approach axis runs mostly along the fingers: fingers on one side (+z), thumb on the other."""
    tips = hand.fingertips(torch.zeros(1, 15, dtype=torch.float64))[0].numpy()
    assert (tips[:, 0] > 0.12).all()
    assert (tips[:4, 2] > 0.04).all()
    assert tips[4, 2] < -0.04


def test_eigengrasps_reach_published_extremes(hand):
    open_end = hand.eigengrasp_origin
    full = hand.eigengrasp_origin + hand.eigengrasps.sum(axis=0)
    index, thumb = slice(0, 3), slice(12, 15)
    np.testing.assert_allclose(open_end[index], [0.09, 0.087266, 0.087266])
    np.testing.assert_allclose(full[index], [-0.26179, 1.0, 1.0])
    np.testing.assert_allclose(full[thumb], [0.1, 0.7, 1.0])
    assert (open_end >= hand.lower - 1e-6).all()
    assert (full <= hand.upper + 1e-6).all()


def test_unknown_hand_and_broken_description(tmp_path):
    with pytest.raises(HandError, match="unknown hand 'claw'"):
        load_hand("claw")
    broken = tmp_path / "hand.toml"
    broken.write_text("name = 'x'\njoint_order = ['a']\n")
    with pytest.raises(HandError, match="missing or malformed"):
        load_hand(str(broken))
