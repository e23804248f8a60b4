import struct

import numpy as np
import pytest
import trimesh
from PIL import Image
from pypcd4 import PointCloud

from ffhnet.errors import CloudError, InputFileError
from ffhnet.perception.capture import read_cloud, read_depth

POINTS = np.random.default_rng(0).uniform(0.3, 0.6, (200, 3)).astype(np.float32)
DEPTH = np.random.default_rng(1).integers(400, 900, (48, 64)).astype(np.uint16)


def write_cloud(path):
    if path.suffix == ".ply":
        trimesh.PointCloud(POINTS).export(path)
    elif path.suffix == ".pcd":
        PointCloud.from_xyz_points(POINTS).save(path)
    elif path.suffix == ".npy":
        np.save(path, POINTS)
    else:
        np.savez(path, colours=POINTS[:, :2], points=POINTS)
    return path


@pytest.mark.parametrize("name", ["a.ply", "a.pcd", "a.npy", "a.npz", "A.PLY"])
def test_clouds_survive_every_format(tmp_path, name):
    path = write_cloud(tmp_path / name.lower()).rename(tmp_path / name)
    np.testing.assert_allclose(read_cloud(path), POINTS, atol=1e-6)


def test_organised_and_wide_arrays(tmp_path):
    image = np.full((20, 10, 4), np.nan)
    image[:, :, :3] = POINTS.reshape(20, 10, 3)
    np.save(tmp_path / "a.npy", image)
    np.testing.assert_allclose(read_cloud(tmp_path / "a.npy"), POINTS)
    np.savez(tmp_path / "b.npz", anything=POINTS)
    np.testing.assert_allclose(read_cloud(tmp_path / "b.npz"), POINTS)


@pytest.mark.parametrize("name", ["a.ply", "a.pcd", "a.npy", "a.npz"])
@pytest.mark.parametrize("part", [0.0, 0.02, 0.5, 0.95])
def test_truncated_clouds_are_refused(tmp_path, name, part):
    path = write_cloud(tmp_path / name)
    data = path.read_bytes()
    path.write_bytes(data[: int(part * len(data))])
    with pytest.raises((InputFileError, CloudError)) as caught:
        read_cloud(path)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("name", ["a.ply", "a.pcd", "a.npy", "a.npz"])
@pytest.mark.parametrize("content", [b"hello world, this is no cloud\n" * 20, bytes(300)])
def test_rubbish_is_refused(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputFileError) as caught:
        read_cloud(tmp_path / name)
    assert "\n" not in str(caught.value)


def test_missing_and_unknown_files(tmp_path):
    with pytest.raises(InputFileError, match="no such file"):
        read_cloud(tmp_path / "none.ply")
    (tmp_path / "a.xyz").write_text("0 0 0")
    with pytest.raises(InputFileError, match=r"\.ply, \.pcd.*got '\.xyz'"):
        read_cloud(tmp_path / "a.xyz")
    with pytest.raises(InputFileError, match="no such file"):
        read_depth(tmp_path)


def test_pickles_are_not_opened(tmp_path):
    np.save(tmp_path / "a.npy", np.array([{"a": 1}] * 60, dtype=object), allow_pickle=True)
    with pytest.raises(InputFileError, match="NumPy"):
        read_cloud(tmp_path / "a.npy")


def test_unusable_points_name_the_file(tmp_path):
    np.save(tmp_path / "a.npy", POINTS * 1000)
    with pytest.raises(CloudError, match=r"a\.npy: .*millimetres"):
        read_cloud(tmp_path / "a.npy")
    np.savez(tmp_path / "b.npz", one=POINTS, two=POINTS)
    with pytest.raises(InputFileError, match="named cloud or points"):
        read_cloud(tmp_path / "b.npz")
    PointCloud.from_points(POINTS, ("a", "b", "c"), (np.float32,) * 3).save(tmp_path / "c.pcd")
    with pytest.raises(InputFileError, match="fields x, y and z, got a, b, c"):
        read_cloud(tmp_path / "c.pcd")


def test_a_depth_image_is_not_a_cloud(tmp_path):
    np.save(tmp_path / "a.npy", DEPTH * 0.001)
    with pytest.raises(InputFileError, match="intrinsics"):
        read_cloud(tmp_path / "a.npy")


def test_depth_from_png_and_arrays(tmp_path):
    DEPTH[0, :5] = 0
    Image.fromarray(DEPTH).save(tmp_path / "a.png")
    np.testing.assert_allclose(read_depth(tmp_path / "a.png"), DEPTH * 0.001)
    np.testing.assert_allclose(read_depth(tmp_path / "a.png", 0.0005), DEPTH * 0.0005)
    metres = DEPTH * 0.001
    metres[3, 3], metres[3, 4] = np.nan, -1
    np.save(tmp_path / "a.npy", metres[:, :, None])
    found = read_depth(tmp_path / "a.npy")
    assert found[3, 3] == found[3, 4] == 0
    np.testing.assert_allclose(found[4:], metres[4:])
    np.savez(tmp_path / "a.npz", depth=DEPTH, colour=DEPTH)
    np.testing.assert_allclose(read_depth(tmp_path / "a.npz"), DEPTH * 0.001)


def test_wrong_depth_images_are_refused(tmp_path):
    def refused(match, scale=None, name="a.png"):
        with pytest.raises(InputFileError, match=match) as caught:
            read_depth(tmp_path / name, scale)
        assert "\n" not in str(caught.value)

    Image.fromarray((DEPTH // 4).astype(np.uint8)).save(tmp_path / "a.png")
    refused("16 bits")
    Image.fromarray(np.zeros((48, 64, 3), np.uint8)).save(tmp_path / "a.png")
    refused("one channel of 16 bits")
    Image.fromarray(np.zeros_like(DEPTH)).save(tmp_path / "a.png")
    refused("no reading")
    Image.fromarray(DEPTH).save(tmp_path / "a.png")
    refused("another scale", scale=1.0)
    refused("another scale", scale=1e-6)
    refused("positive", scale=-1.0)
    data = (tmp_path / "a.png").read_bytes()
    (tmp_path / "a.png").write_bytes(data[: len(data) // 2])
    refused("damaged")
    Image.fromarray((DEPTH // 4).astype(np.uint8)).save(tmp_path / "b.jpg")
    (tmp_path / "a.png").write_bytes((tmp_path / "b.jpg").read_bytes())
    refused("PNG")
    np.save(tmp_path / "a.npy", POINTS)
    refused(r"shape \(H, W\), got \(200, 3\)", name="a.npy")
    (tmp_path / "c.png").write_bytes(b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13))
    refused("damaged", name="c.png")


def test_real_captures_are_read(captures):
    assert len(read_cloud(captures / "gpd_clouds" / "krylon" / "cloud.ply")) == 4467
    depth = read_depth(captures / "kinect_osd" / "learn0" / "depth.png", 0.0001)
    assert depth.shape == (480, 640)
    assert 0.3 < np.median(depth[depth > 0]) < 3


def test_files_cut_between_two_points_are_refused(tmp_path):
    binary = write_cloud(tmp_path / "a.pcd").read_bytes()
    row = len(POINTS[0].tobytes())
    (tmp_path / "a.pcd").write_bytes(binary[: -50 * row])
    with pytest.raises(InputFileError, match=r"200|damaged"):
        read_cloud(tmp_path / "a.pcd")
    lines = ["ply", "format ascii 1.0", "element vertex 200"]
    lines += [f"property float {axis}" for axis in "xyz"] + ["end_header"]
    lines += [" ".join(map(str, point)) for point in POINTS[:150]]
    (tmp_path / "b.ply").write_text("\n".join(lines) + "\n")
    with pytest.raises(InputFileError, match=r"200|damaged"):
        read_cloud(tmp_path / "b.ply")
