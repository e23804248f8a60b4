"""The commands do what they say, and cost nothing before they are asked."""

import json
import signal
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from ffhnet.apps import cli
from ffhnet.grasps_file import load_grasps
from ffhnet.hands import load_hand

MAIN = "from ffhnet.apps.cli import main; main()"
INTRINSICS = ("--intrinsics", 615, 615, 320, 240)


def run_without_loading(libraries, *arguments):
    """What a command prints in a process of its own, which must not load any of the libraries."""
    check = (
        "import sys\nfrom ffhnet.apps.cli import main\n"
        f"try:\n    main({[str(word) for word in arguments]!r})\n"
        "except SystemExit as stop:\n    assert not stop.code\n"
        f"heavy = {libraries!r} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    done = subprocess.run([sys.executable, "-c", check], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_help_loads_no_heavy_library():
    text = run_without_loading({"torch", "numpy", "scipy", "trimesh", "mujoco", "PIL"}, "--help")
    for command in cli.COMMANDS:
        assert command.name in text


def test_grasps_for_a_cloud_load_no_library_of_meshes_or_physics(cloud_npy, untrained_weights, tmp_path):
    """They would add half a second to every cold start."""
    heavy = {"trimesh", "networkx", "mujoco", "pyarrow", "numba", "ray", "viser"}
    settings = ("--world", "--weights", untrained_weights, "--out", tmp_path / "grasps.json")
    run_without_loading(heavy, "grasp", cloud_npy, *settings)


def test_every_command_has_help(ffhnet):
    for command in cli.COMMANDS:
        status, out, err = ffhnet(command.name, "--help")
        assert (status, err) == (0, "")
        assert "usage: ffhnet" in out


def test_no_command_is_an_error(ffhnet):
    status, _, err = ffhnet()
    assert status == 2
    assert err.count("\n") == 1


def test_grasp_from_a_depth_image(ffhnet, tmp_path, depth_png, untrained_weights):
    out, plot = tmp_path / "grasps.json", tmp_path / "grasps.png"
    weights = ("--weights", untrained_weights, "--no-feasibility")
    arguments = (*INTRINSICS, *weights, "--num", 30, "--out", out, "--plot", plot)
    status, printed, err = ffhnet("grasp", depth_png, *arguments)
    assert (status, err) == (0, "")
    assert "30 grasps" in printed
    content = json.loads(out.read_text())
    assert list(content) == [
        "hand", "frame", "joint_names", "standoff", "torque_limits", "target_lead", "grasps", "dropped",
    ]  # fmt: skip
    assert content["hand"] == "dlr_hit_ii"
    assert content["frame"] == "camera"
    assert content["joint_names"] == list(load_hand().joint_names)
    assert len(content["grasps"]) == 30
    for grasp in content["grasps"]:
        assert set(grasp) == {
            "palm_position", "palm_quaternion_wxyz", "joint_angles", "success_probability",
            "robust_probability", "pregrasp_palm_position", "preshape_joint_angles", "closing_times",
            "closing_joint_angles",
        }  # fmt: skip
    scores = [grasp["robust_probability"] for grasp in content["grasps"]]
    assert scores == sorted(scores, reverse=True)
    # The box stands about 0.7 m before the camera; untrained networks propose palms near its middle.
    assert np.median([grasp["palm_position"][2] for grasp in content["grasps"]]) == pytest.approx(
        0.66, abs=0.15
    )
    with Image.open(plot) as picture:
        assert picture.size[0] > 1000
    assert {path.name for path in tmp_path.iterdir()} == {"grasps.json", "grasps.png"}


def test_same_seed_same_file_and_json_equals_npz(ffhnet, tmp_path, cloud_npy, untrained_weights):
    arguments = ("--world", "--weights", untrained_weights, "--num", 15)
    for name in ("a.json", "b.json", "a.npz"):
        assert ffhnet("grasp", cloud_npy, *arguments, "--out", tmp_path / name)[0] == 0
    assert ffhnet("grasp", cloud_npy, *arguments, "--seed", 1, "--out", tmp_path / "c.json")[0] == 0
    texts = [(tmp_path / f"{name}.json").read_text() for name in "abc"]
    assert texts[0] == texts[1] != texts[2]
    from_json, from_npz = load_grasps(tmp_path / "a.json"), load_grasps(tmp_path / "a.npz")
    assert from_json.frame == from_npz.frame == "world"
    for field in ("rotation", "position", "joints", "probability"):
        np.testing.assert_array_equal(getattr(from_json, field), getattr(from_npz, field))


def test_mask_and_segmentation_find_the_same_object(ffhnet, tmp_path, depth, depth_png, untrained_weights):
    """A mask with a margin of table around the object gives nearly the same view frame."""
    mask = tmp_path / "mask.png"
    pixels = np.zeros(depth.shape, dtype=np.uint8)
    pixels[100:400, 200:440] = 255
    Image.fromarray(pixels).save(mask)
    found = []
    for name, extra in (("a.npz", ()), ("b.npz", ("--mask", mask))):
        weights = ("--weights", untrained_weights, "--no-feasibility")
        arguments = (*INTRINSICS, *weights, "--num", 50, "--out", tmp_path / name)
        assert ffhnet("grasp", depth_png, *arguments, *extra)[0] == 0
        found.append(load_grasps(tmp_path / name).position.mean(axis=0))
    np.testing.assert_allclose(found[0], found[1], atol=0.01)


def test_camera_position_turns_the_view_frame(ffhnet, tmp_path, cloud_npy, untrained_weights):
    """Networks see the object from the camera's side: another camera, other grasps in the world."""
    positions = []
    for i, camera in enumerate([(-0.5, 0.1, 0.45), (0.5, 0.1, 0.45)]):
        out = tmp_path / f"{i}.npz"
        arguments = ("--world", "--weights", untrained_weights, "--num", 5, "--camera", *camera, "--out", out)
        assert ffhnet("grasp", cloud_npy, *arguments)[0] == 0
        positions.append(load_grasps(out).position)
    assert np.abs(positions[0] - positions[1]).max() > 1e-3


def test_objects_list_and_show(ffhnet, tmp_path):
    status, out, _ = ffhnet("objects", "list", "procedural-test:3")
    assert status == 0
    names = out.split()
    assert len(names) == 3
    status, out, _ = ffhnet("objects", "show", names[0], "--plot", tmp_path / "object.png")
    assert status == 0
    assert names[0] in out
    assert (tmp_path / "object.png").stat().st_size > 1000
    status, _, err = ffhnet("objects", "show", "teapot")
    assert status == 2
    assert err.count("\n") == 1


def test_hand_check(ffhnet, tmp_path):
    status, out, _ = ffhnet("hand", "check", "dlr_hit_ii", "--plot", tmp_path / "hand.png")
    assert status == 0
    assert "thumb_pip" in out
    assert "agree with MuJoCo" in out
    assert (tmp_path / "hand.png").stat().st_size > 1000


def test_hand_check_finds_eigengrasps_out_of_range(ffhnet, tmp_path):
    hand = load_hand()
    description = (hand.mjcf.parent / "hand.toml").read_text().replace("-0.26179, 0.087266", "-0.5, 0.087266")
    (tmp_path / "hand.toml").write_text(description)
    (tmp_path / "hand.xml").write_text(hand.mjcf.read_text())
    status, _, err = ffhnet("hand", "check", tmp_path / "hand.toml")
    assert status == 2
    assert "thumb_abduction" in err


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_ctrl_c_is_quiet():
    """An interrupt in the middle of the work: status 130 and not a word."""
    interrupt = "os.kill(os.getpid(), signal.SIGINT)"
    # A parent in the background may have left SIGINT ignored.
    code = "import os, signal\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n"
    code += f"import ffhnet.apps.objects as o\ndef stop(options):\n    {interrupt}\no._list = stop\n{MAIN}"
    done = subprocess.run(
        [sys.executable, "-c", code, "objects", "list"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 128 + signal.SIGINT
    assert (done.stdout, done.stderr) == ("", "")


def test_a_closed_pipe_is_quiet():
    command = f"{sys.executable} -c '{MAIN}' objects list procedural-test:3000 | head -1"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False)
    assert done.stderr == ""
    assert done.stdout.count("\n") == 1


def test_shipped_weights_grasp_the_example(ffhnet, tmp_path, request):
    image = request.config.rootpath / "examples" / "data" / "spray_flask_2000005_depth.png"
    out = tmp_path / "grasps.npz"
    status, _, err = ffhnet("grasp", image, *INTRINSICS, "--out", out)
    assert (status, err) == (0, "")
    grasps = load_grasps(out)
    assert 200 < len(grasps) <= 400
    assert grasps.probability[0] > 0.5
