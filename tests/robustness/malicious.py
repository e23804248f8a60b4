"""Files that somebody wrote to do harm: run code, read other files, fill the memory."""

from __future__ import annotations

import io
import json
import pickle
import struct
import zipfile
import zlib
from pathlib import Path

import numpy as np

HUGE = 10**12
"""Points, faces or bytes that a header promises."""

DEEP = 200_000
"""Levels of brackets, more than any parser's stack."""


class Bomb:
    """Unpickled, it makes a file: whoever loads it has run its code."""

    def __init__(self, trace: Path) -> None:
        self.trace = trace

    def __reduce__(self):
        return (open, (str(self.trace), "w"))


def pickled_npy(trace: Path) -> bytes:
    """An array of objects."""
    buffer = io.BytesIO()
    np.save(buffer, np.array([Bomb(trace)] * 60, dtype=object), allow_pickle=True)
    return buffer.getvalue()


def pickled_npz(trace: Path, name: str) -> bytes:
    """The same in an archive."""
    buffer = io.BytesIO()
    np.savez(buffer, **{name: np.array([Bomb(trace)] * 60, dtype=object)})
    return buffer.getvalue()


def pickle_file(trace: Path) -> bytes:
    """Nothing but a pickle."""
    return pickle.dumps(Bomb(trace))


def huge_npy() -> bytes:
    """An array of terabytes, by its header."""
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(buffer, {"descr": "<f8", "fortran_order": False, "shape": (HUGE, 3)})
    return buffer.getvalue() + bytes(1000)


def huge_npz(name: str) -> bytes:
    """The same in an archive."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr(f"{name}.npy", huge_npy())
    return buffer.getvalue()


def future_npz(name: str) -> bytes:
    """An archive that asks for version 9.9 of the format."""
    archive = bytearray(huge_npz(name))
    place = archive.index(b"PK\x01\x02") + 6
    archive[place : place + 2] = struct.pack("<H", 99)
    return bytes(archive)


def zip_bomb(name: str, size: int = 3 * 2**30) -> bytes:
    """An array of zeros that takes a thousandth of its size in the archive."""
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        header, {"descr": "<f8", "fortran_order": False, "shape": (size // 24, 3)}
    )
    piece = bytes(2**24)
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    # A full flush makes pieces independent of each other, so that one can be repeated.
    first = packer.compress(header.getvalue()) + packer.flush(zlib.Z_FULL_FLUSH)
    packed = packer.compress(piece) + packer.flush(zlib.Z_FULL_FLUSH)
    body = first + packed * (size // len(piece)) + packer.flush()
    length = len(header.getvalue()) + size
    file = f"{name}.npy".encode()
    # Without the right checksum the bomb goes off all the same: it is compared at the end.
    fields = struct.pack("<HHHHHIII", 20, 0, 8, 0, 0, 0, len(body), length)
    local = b"PK\x03\x04" + fields + struct.pack("<HH", len(file), 0) + file + body
    central = b"PK\x01\x02\x14\x00" + fields + struct.pack("<HHHHHII", len(file), 0, 0, 0, 0, 0, 0) + file
    end = b"PK\x05\x06" + struct.pack("<HHHHIIH", 0, 0, 1, 1, len(central), len(local), 0)
    return local + central + end


def huge_png() -> bytes:
    """A 16-bit image of 13 000 x 13 000 pixels, all black, in a few hundred kilobytes."""
    side = 13_000

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    rows = zlib.compress(bytes((2 * side + 1) * side), 1)
    head = struct.pack(">IIBBBBB", side, side, 16, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")


def huge_ply(element: str = "vertex") -> bytes:
    """Terabytes of points or faces, by the header."""
    counts = {"vertex": 3, "face": 1} | {element: HUGE}
    return (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {counts['vertex']}\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {counts['face']}\nproperty list uchar int vertex_indices\nend_header\n"
    ).encode() + bytes(1000)


def huge_pcd(count: int = 1, points: int = HUGE, data: str = "binary") -> bytes:
    """Terabytes of points, by the header."""
    lines = (
        "VERSION 0.7", "FIELDS x y z", "SIZE 4 4 4", "TYPE F F F", f"COUNT 1 1 {count}", f"WIDTH {points}",
        "HEIGHT 1", "VIEWPOINT 0 0 0 1 0 0 0", f"POINTS {points}", f"DATA {data}", "",
    )  # fmt: skip
    return "\n".join(lines).encode() + struct.pack("<II", 8, 2**32 - 1) + bytes(1000)


def huge_stl() -> bytes:
    """Four thousand million triangles, by the header."""
    return bytes(80) + struct.pack("<I", 2**32 - 1) + bytes(1000)


def huge_glb() -> bytes:
    """A binary chunk and an accessor of terabytes, by their headers."""
    return glb(_scene({"byteLength": HUGE}), struct.pack("<II", 2**32 - 1, 0x004E4942) + bytes(100))


def foreign_glb(path: str) -> bytes:
    """A mesh whose numbers lie in another file."""
    return glb(_scene({"byteLength": 36, "uri": path}), b"")


def _scene(buffer: dict) -> dict:
    return {
        "asset": {"version": "2.0"},
        "buffers": [buffer],
        "bufferViews": [{"buffer": 0, "byteLength": buffer["byteLength"]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
    }


def glb(scene: dict, rest: bytes) -> bytes:
    """A GLB file of a scene and what follows it."""
    text = json.dumps(scene).encode()
    text += b" " * (-len(text) % 4)
    length = 20 + len(text) + len(rest)
    return b"glTF" + struct.pack("<III", 2, length, len(text)) + b"JSON" + text + rest


def deep_json() -> bytes:
    """Brackets in brackets."""
    return b"[" * DEEP


def deep_toml() -> bytes:
    """The same in TOML."""
    return b"x = " + b"[" * DEEP


def deep_xml() -> bytes:
    """Bodies in bodies, each of them allowed."""
    return b"<mujoco><worldbody>" + b"<body>" * 20_000 + b"</body>" * 20_000 + b"</worldbody></mujoco>"


def laughing_xml() -> bytes:
    """Entities of entities: gigabytes of text in a few hundred bytes."""
    lines = [f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 12)]
    return f'<!DOCTYPE m [<!ENTITY l0 "ha">{"".join(lines)}]><mujoco>&l11;</mujoco>'.encode()


def huge_safetensors() -> bytes:
    """A tensor of terabytes, by the header."""
    header = {"x": {"dtype": "F32", "shape": [HUGE], "data_offsets": [0, 4 * HUGE]}}
    text = json.dumps(header).encode()
    return struct.pack("<Q", len(text)) + text
