"""Hands whose model comes with another package: rewritten as it was, and read from nowhere else."""

import sys
from importlib.util import find_spec
from pathlib import Path

import mujoco
import numpy as np
import pytest
import torch
import trimesh

import ffhnet.hands
from ffhnet.errors import HandError
from ffhnet.geometry.transforms import invert, make_transform
from ffhnet.hands import load_hand
from ffhnet.hands.hand import tomllib
from ffhnet.hands.package_files import package_folder
from ffhnet.hands.packaged import PackagedModel
from ffhnet.simulation.scene import build_scene

SHIPPED = {"shadow": "gymnasium_robotics", "mpl": "dexterity"}

MODEL = """
<mujoco>
  <compiler angle="degree" meshdir="meshes" coordinate="local"/>
  <option apirate="50"/>
  <default><geom material="skin"/></default>
  <asset><include file="meshes.xml"/><material name="skin"/><mesh name="unused" file="gone.stl"/></asset>
  <worldbody>
    <body name="arm" pos="1 0 0">
      <joint name="wrist" axis="0 1 0" range="-90 90"/>
      <geom size="0.1"/>
      <body name="palm" pos="0 0 0.3" euler="0 0 30">
        <joint name="turn" axis="0 0 1" range="-90 90"/>
        <geom type="box" size="0.04 0.01 0.04"/>
        <geom type="mesh" mesh="unused" contype="0" conaffinity="0"/>
        <body name="f1" pos="0.02 0 0.04">
          <joint name="spread" axis="0 1 0" range="-20 20"/>
          <geom size="0.001"/>
          <body name="f2" euler="0 20 0">
            <joint name="bend" axis="1 0 0" range="-90 0"/>
            <geom type="capsule" fromto="0 0 0.01 0 0 0.04" size="0.008"/>
            <body name="f3" pos="0 0 0.05">
              <joint name="curl" axis="1 0 0" range="-90 0"/>
              <geom type="mesh" mesh="link"/>
            </body>
          </body>
        </body>
        <body name="t1" pos="-0.03 0 0">
          <joint name="thumb" axis="0 1 0" range="0 60"/>
          <geom pos="0 -0.03 0" size="0.01"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator><position joint="bend" nosuch="1"/></actuator>
</mujoco>
"""

DESCRIPTION = """
name = "claw"
[package]
name = "claw_models"
model = "mjcf/claw.xml"
root = "palm"
joints.index = { abduction = "spread", mcp = "-bend", pip = "-curl" }
joints.thumb = { mcp = "thumb" }
coupled = { pip = ["mcp", 0.5] }
limits = { index_mcp = [0.0, 1.5] }
drive = { stiffness = 5.0, torque = 0.8, damping = 0.3, armature = 0.002 }
[palm]
position = [0, 0, 0]
rpy = [0, 0, 0]
[eigengrasps]
origin = [0, 0, 0]
directions = [[0, 1, 0]]
[closing]
joints = ["index_mcp", "thumb_mcp"]
speed = 1.5
lead = 0.14
duration = 1.2
squeeze = 0.1
"""


@pytest.fixture
def claw(tmp_path, monkeypatch):
    """A package with a hand, on the path; gives its folder."""
    folder = tmp_path / "site" / "claw_models"
    (folder / "mjcf" / "meshes").mkdir(parents=True)
    (folder / "__init__.py").write_text("raise RuntimeError('the package must not be run')")
    (folder / "mjcf" / "claw.xml").write_text(MODEL)
    meshes = '<mujocoinclude><mesh name="link" file="link.stl"/></mujocoinclude>'
    (folder / "mjcf" / "meshes.xml").write_text(meshes)
    link = trimesh.creation.cylinder(0.006, 0.03).apply_translation([0, 0, 0.02])
    link.export(folder / "mjcf" / "meshes" / "link.stl")
    (tmp_path / "hand.toml").write_text(DESCRIPTION)
    monkeypatch.syspath_prepend(str(folder.parent))
    load_hand.cache_clear()
    return folder


def load(folder: Path):
    load_hand.cache_clear()
    return load_hand(str(folder.parents[1] / "hand.toml"))


def change(folder: Path, old: str, new: str, file: str = "mjcf/claw.xml") -> None:
    text = (folder / file).read_text()
    assert old in text
    (folder / file).write_text(text.replace(old, new))


def assert_moves_like(hand, model: mujoco.MjModel, source: PackagedModel) -> None:
    """Bodies stand as in the package's own model, whose other joints stay at zero."""
    data, rng = mujoco.MjData(model), np.random.default_rng(0)
    joints = rng.uniform(hand.lower, hand.upper, (20, hand.num_joints))
    links = hand.tree.body_poses(torch.as_tensor(joints), hand.joint_names).numpy()
    for row, poses in zip(joints, links, strict=True):
        angles = dict(zip(hand.joint_names, row, strict=True))
        for name, joint in source.joints.items():
            angle = angles[name] if joint.leader is None else joint.factor * angles[joint.leader]
            data.joint(joint.theirs).qpos = joint.sign * angle
        mujoco.mj_kinematics(model, data)
        root = data.body(source.root)
        T_root_world = invert(make_transform(root.xmat.reshape(3, 3), root.xpos))
        for body, pose in zip(hand.tree.bodies, poses, strict=True):
            theirs = data.body(body.name)
            T_root_body = T_root_world @ make_transform(theirs.xmat.reshape(3, 3), theirs.xpos)
            np.testing.assert_allclose(pose, T_root_body, atol=1e-9)


def source_of(toml: Path) -> PackagedModel:
    return PackagedModel.from_description(tomllib.loads(toml.read_text())["package"])


def test_a_packaged_hand_moves_like_the_model_of_its_package(claw):
    hand = load(claw)
    assert hand.joint_names == ("index_abduction", "index_mcp", "thumb_mcp")
    np.testing.assert_allclose(hand.lower, [-np.pi / 9, 0, 0])
    np.testing.assert_allclose(hand.upper, [np.pi / 9, 1.5, np.pi / 3])
    source = source_of(claw.parents[1] / "hand.toml")
    assert_moves_like(hand, source._compile(package_folder("claw_models", "")), source)
    assert "claw_models" not in sys.modules


def test_what_is_written_is_what_a_hand_needs(claw):
    hand = load(claw)
    model = hand.spec().compile()
    assert {joint.name for joint in map(model.joint, range(model.njnt))} == {*hand.joint_names, "index_pip"}
    assert [model.actuator(i).name for i in range(model.nu)] == list(hand.joint_names)
    np.testing.assert_allclose(hand.torque_limit, 0.8)
    # The mesh became a capsule of about its size, the marker went, arm and looks too.
    assert [geom.type for geom in hand.tree.geoms] == ["box", "capsule", "capsule", "sphere"]
    np.testing.assert_allclose(hand.tree.geoms[2].size, [0.006, 0.0135], atol=0.004)
    index, thumb = hand.tree.sites
    np.testing.assert_allclose(index.position, [0, 0, 0.035], atol=0.003)
    np.testing.assert_allclose(thumb.position, [0, -0.04, 0], atol=1e-9)
    bits = {geom.name[:2]: (geom.contype, geom.conaffinity) for geom in hand.spec().geoms}
    assert bits == {"pa": (8, 1), "f2": (2, 9), "f3": (2, 9), "t1": (4, 11)}


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('file="meshes.xml"', 'file="../../../secret.xml"', "in its folder"),
        ('file="meshes.xml"', 'file="claw.xml"', "includes more than"),
        ('file="meshes.xml"', 'file="nosuch.xml"', "nosuch.xml"),
        ('meshdir="meshes"', 'meshdir="../../.."', "in its folder"),
        ('name="curl"', 'name="curl" pos="0 0 0.01"', "only hinge, at its origin"),
        ('name="curl" axis="1 0 0" range="-90 0"', 'name="curl" axis="1 0 0" range="-9 0"', "index_pip goes"),
        ('name="thumb"', 'name="pollex"', "no joint thumb"),
        ('pos="0 -0.03 0"', 'pos="0 0 0"', "where is its tip"),
        ('pos="0 -0.03 0" size="0.01"', 'type="ellipsoid" size="0.01 0.02 0.03"', "type ellipsoid"),
    ],
)
def test_a_model_that_cannot_be_used_says_why(claw, old, new, said):
    change(claw, old, new)
    with pytest.raises(HandError, match=said):
        load(claw)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('joints.thumb = { mcp = "thumb" }', 'joints.thumb = "thumb"'),
        ('mcp = "thumb"', "mcp = 3"),
        ("torque = 0.8", "strength = 0.8"),
        ('["mcp", 0.5]', "0.5"),
        ('name = "claw_models"', ""),
    ],
)
def test_a_malformed_section_is_refused(claw, old, new):
    change(claw.parents[1], old, new, "hand.toml")
    with pytest.raises(HandError, match="missing or malformed"):
        load(claw)


@pytest.mark.parametrize("package", ["no_such_package", "os", "os.path", "../claw_models", "claw models"])
def test_a_package_that_is_not_there_is_named_with_how_to_get_it(claw, package):
    change(claw.parents[1], 'name = "claw_models"', f'name = "{package}"', "hand.toml")
    with pytest.raises(HandError, match=r"pip install"):
        load(claw)


def test_the_model_lies_in_its_package(claw):
    change(claw.parents[1], '"mjcf/claw.xml"', '"../../hand.toml"', "hand.toml")
    with pytest.raises(HandError, match="in its folder"):
        load(claw)


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_descriptions_fit_their_packages(name):
    if find_spec(SHIPPED[name]) is None:
        pytest.skip(f"the hand {name} comes with {SHIPPED[name]}, which is not installed")
    hand = load_hand(name)
    toml = Path(ffhnet.hands.__file__).parent / name / "hand.toml"
    source = source_of(toml)
    assert_moves_like(hand, source._compile(package_folder(source.package, "")), source)
    assert len(hand.tree.sites) == 5
    # Palm frame: straight fingers along x, thumb towards y and in front of the palm, fingers close on it.
    opened, bent = hand.open(hand.eigengrasp_origin), np.minimum(hand.lower + 0.6, hand.upper)
    tips = hand.fingertips(torch.as_tensor(np.stack([opened, bent])))
    by_name = {site.name: tips[:, i].numpy() for i, site in enumerate(hand.tree.sites)}
    thumb = by_name.pop("thumb_tip")
    fingers = np.stack(list(by_name.values()))
    assert (fingers[:, 0, 0] > 0.09).all()
    assert (fingers[:, 0, 2] > 0.02).all()
    assert thumb[0, 1] > 0
    assert thumb[0, 2] < -0.02
    assert (fingers[:, 1, 2] < fingers[:, 0, 2] - 0.03).all()


@pytest.mark.parametrize("name", SHIPPED)
def test_open_hands_do_not_touch_themselves(name):
    if find_spec(SHIPPED[name]) is None:
        pytest.skip(f"the hand {name} comes with {SHIPPED[name]}, which is not installed")
    hand = load_hand(name)
    scene, rng = build_scene(hand, None), np.random.default_rng(0)
    for weights in rng.uniform(size=(30, len(hand.eigengrasps))):
        joints = hand.open(hand.eigengrasp_origin + weights @ hand.eigengrasps)
        scene.place_hand(make_transform(position=np.array([0, 0, 1.0])), joints)
        mujoco.mj_forward(scene.model, scene.data)
        assert scene.data.ncon == 0
