"""Whatever is wrong with the input of `ffhnet grasp`, the answer is status 2 and one line that says so."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from pypcd4 import PointCloud

INTRINSICS = ("--intrinsics", 615, 615, 320, 240)


def assert_one_line(result, *words):
    status, out, err = result
    assert status == 2
    assert out == ""
    assert err.startswith("ffhnet: error: ")
    assert err.count("\n") == 1
    assert "Traceback" not in err
    for word in words:
        assert word in err


def truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2 + 5])


def save(path: Path, cloud: np.ndarray) -> None:
    if path.suffix == ".ply":
        trimesh.PointCloud(cloud).export(path)
    elif path.suffix == ".pcd":
        PointCloud.from_xyz_points(cloud.astype(np.float32)).save(path)
    else:
        np.save(path, cloud)


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".npy", ".npz"])
def test_missing_file(ffhnet, tmp_path, suffix):
    assert_one_line(ffhnet("grasp", tmp_path / f"nothing{suffix}", "--world"), "nothing", "no such file")


def test_missing_depth_image(ffhnet, tmp_path):
    assert_one_line(ffhnet("grasp", tmp_path / "nothing.png", *INTRINSICS), "no such file")


@pytest.mark.parametrize(
    ("cloud", "words"),
    [
        (np.zeros((0, 3)), ["empty"]),
        (np.full((500, 3), np.nan), ["finite"]),
        (np.random.default_rng(0).uniform(0, 0.1, (5, 3)), ["5"]),
        (np.random.default_rng(0).uniform(0, 100, (500, 3)), ["millimetres"]),
        (np.zeros((500, 2)), ["(500, 2)"]),
        (np.zeros((480, 640)), ["intrinsics"]),
    ],
    ids=["empty", "nan", "5 points", "millimetres", "two columns", "depth image as cloud"],
)
def test_bad_cloud(ffhnet, tmp_path, cloud, words):
    path = tmp_path / "cloud.npy"
    np.save(path, cloud)
    assert_one_line(ffhnet("grasp", path, "--world"), *words)


def test_wrong_extension(ffhnet, tmp_path):
    path = tmp_path / "cloud.xyz"
    path.write_text("0 0 0\n")
    assert_one_line(ffhnet("grasp", path, "--world"), ".xyz", ".ply")


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".npy"])
def test_truncated_cloud(ffhnet, tmp_path, object_cloud, suffix):
    path = tmp_path / f"cloud{suffix}"
    save(path, object_cloud)
    truncate(path)
    assert_one_line(ffhnet("grasp", path, "--world"), path.name)


def test_truncated_png(ffhnet, tmp_path, depth_png):
    path = tmp_path / "depth.png"
    path.write_bytes(depth_png.read_bytes())
    truncate(path)
    assert_one_line(ffhnet("grasp", path, *INTRINSICS), "depth.png")


def test_pickled_array_is_not_loaded(ffhnet, tmp_path):
    path = tmp_path / "cloud.npy"
    np.save(path, np.array([{"x": 1}], dtype=object), allow_pickle=True)
    assert_one_line(ffhnet("grasp", path, "--world"), "cloud.npy")


def test_depth_without_intrinsics(ffhnet, depth_png):
    assert_one_line(ffhnet("grasp", depth_png), "--intrinsics")


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("--hand", "no_such_hand"), "no_such_hand"),
        (("--hand", "nothing.toml"), "nothing.toml"),
        (("--weights", "nowhere"), "nowhere"),
        (("--up", 0, 0, 1), "not both"),
        (("--mask", "mask.png"), "--mask"),
        (("--depth-scale", 0.001), "--depth-scale"),
        (("--object", 1), "--object"),
        (("--out", "grasps.csv"), ".json"),
        (("--out", "no/such/folder/grasps.json"), "does not exist"),
        (("--plot", "no/such/folder/grasps.png"), "does not exist"),
        (("--num", "many"), "--num"),
        (("--nonsense",), "--nonsense"),
    ],
)
def test_bad_option(ffhnet, cloud_npy, arguments, word):
    assert_one_line(ffhnet("grasp", cloud_npy, "--world", *arguments), word)


@pytest.mark.parametrize("up", [(0, 0, 0), ("nan", 0, 1), ("inf", 0, 1)])
def test_bad_up(ffhnet, cloud_npy, up):
    assert_one_line(ffhnet("grasp", cloud_npy, "--up", *up), "up")


def test_camera_without_up(ffhnet, cloud_npy):
    assert_one_line(ffhnet("grasp", cloud_npy, "--camera", 0, 0, 1), "--camera")


@pytest.mark.parametrize(("option", "value"), [("--num", 0), ("--num", -3), ("--threshold", 1.5)])
def test_bad_number(ffhnet, cloud_npy, untrained_weights, option, value):
    assert_one_line(ffhnet("grasp", cloud_npy, "--world", "--weights", untrained_weights, option, value))


def test_damaged_weights(ffhnet, tmp_path, cloud_npy, untrained_weights):
    for file in untrained_weights.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    truncate(tmp_path / "generator.safetensors")
    assert_one_line(ffhnet("grasp", cloud_npy, "--world", "--weights", tmp_path), "generator")


def test_bad_masks(ffhnet, tmp_path, depth_png):
    mask = tmp_path / "mask.png"
    assert_one_line(ffhnet("grasp", depth_png, *INTRINSICS, "--mask", mask), "no such file")
    mask.write_bytes(b"nothing like an image")
    assert_one_line(ffhnet("grasp", depth_png, *INTRINSICS, "--mask", mask), "mask.png")
    Image.fromarray(np.ones((48, 64), dtype=np.uint8)).save(mask)
    assert_one_line(ffhnet("grasp", depth_png, *INTRINSICS, "--mask", mask), "(48, 64)")


def test_scene_without_a_second_object(ffhnet, depth_png):
    assert_one_line(ffhnet("grasp", depth_png, *INTRINSICS, "--object", 7), "7")


def test_a_threshold_that_nothing_reaches(ffhnet, tmp_path, cloud_npy, untrained_weights):
    """The file is written, empty; a picture cannot be."""
    arguments = ("grasp", cloud_npy, "--world", "--weights", untrained_weights, "--threshold", 1, "--num", 20)
    status, out, err = ffhnet(*arguments, "--out", tmp_path / "grasps.json")
    assert (status, err) == (0, "")
    assert "no grasp" in out
    status, _, err = ffhnet(*arguments, "--plot", tmp_path / "grasps.png")
    assert status == 2
    assert err.count("\n") == 1
    assert not (tmp_path / "grasps.png").exists()


def test_as_a_process(tmp_path):
    """The same through the interpreter: nothing is printed behind main's back."""
    command = [sys.executable, "-c", "from ffhnet.apps.cli import main; main()", "grasp"]
    done = subprocess.run(
        [*command, str(tmp_path / "nothing.ply"), "--world"], capture_output=True, text=True, check=False
    )
    assert_one_line((done.returncode, done.stdout, done.stderr), "no such file")
