import struct

import numpy as np
import pytest
import trimesh

from ffhnet.errors import InputFileError, ObjectError
from ffhnet.objects import mesh_files
from ffhnet.objects.mesh_files import announced_faces, read_mesh


def ball(subdivisions: int = 2) -> trimesh.Trimesh:
    return trimesh.creation.icosphere(subdivisions=subdivisions, radius=0.04)


@pytest.mark.parametrize(
    ("suffix", "options"),
    [
        (".obj", {}),
        (".ply", {}),
        (".ply", {"encoding": "ascii"}),
        (".stl", {}),
        (".stl", {"file_type": "stl_ascii"}),
        (".glb", {}),
    ],
)
def test_faces_are_counted_without_reading_the_mesh(tmp_path, monkeypatch, suffix, options):
    # Blocks of a few bytes cut through the words that are counted.
    monkeypatch.setattr(mesh_files, "_BLOCK", 7)
    path = tmp_path / f"ball{suffix}"
    ball().export(path, **options)
    assert announced_faces(path) == len(ball().faces) == len(read_mesh(path).faces)


def test_the_first_line_of_an_obj_counts_too(tmp_path):
    (tmp_path / "odd.obj").write_text("f 1 2 3\nf 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n")
    assert announced_faces(tmp_path / "odd.obj") == 2


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".stl"])
def test_two_million_faces_are_refused_before_they_are_read(tmp_path, monkeypatch, suffix):
    path = tmp_path / f"raw{suffix}"
    count = 2_000_000
    path.write_bytes(
        {
            ".obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\n" + b"f 1 2 3\n" * count,
            ".ply": b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\n"
            b"element face %d\nproperty list uchar int vertex_indices\nend_header\n" % count,
            ".stl": b" " * 80 + struct.pack("<I", count) + bytes(50 * count),
        }[suffix]
    )

    def forbidden(*_, **__):
        raise AssertionError("the mesh was read")

    monkeypatch.setattr(trimesh, "load_mesh", forbidden)
    with pytest.raises(ObjectError, match=r"at most 200000 faces, .*raw.* has 2000000"):
        read_mesh(path)


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".stl", ".glb"])
def test_files_cut_anywhere_or_with_flipped_bytes_are_read_or_refused(tmp_path, rng, suffix):
    path = tmp_path / f"ball{suffix}"
    exported = ball(1).export(file_type=suffix[1:])
    whole = np.frombuffer(exported.encode() if isinstance(exported, str) else exported, np.uint8)
    for _ in range(40):
        data = whole[: rng.integers(len(whole))].copy()
        if len(data):
            data[rng.integers(len(data), size=3)] ^= rng.integers(1, 256, 3).astype(np.uint8)
        path.write_bytes(data.tobytes())
        try:
            mesh = read_mesh(path)
        except (InputFileError, ObjectError):
            continue
        assert np.isfinite(mesh.vertices).all()
        assert mesh.faces.max() < len(mesh.vertices)
