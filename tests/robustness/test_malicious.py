"""Files that were written to do harm get an error that says what is wrong, within 1 GiB and 5 s."""

import os
import subprocess
import sys
from pathlib import Path

import malicious
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from doors import DOORS
from limits import limits
from PIL import Image

from ffhnet.errors import FFHNetError, HandError, WeightsError

ARRAYS = {"cloud.npy": "cloud", "cloud.npz": "cloud", "depth.npy": "depth", "grasps.npz": "palm_position"}

EVIL = {
    **{f"pickle in {file}": (file, malicious.pickle_file) for file in ARRAYS},
    "objects in cloud.npy": ("cloud.npy", malicious.pickled_npy),
    "objects in depth.npy": ("depth.npy", malicious.pickled_npy),
    "objects in cloud.npz": ("cloud.npz", lambda trace: malicious.pickled_npz(trace, "cloud")),
    "objects in grasps.npz": ("grasps.npz", lambda trace: malicious.pickled_npz(trace, "hand")),
    "pickle in weights": ("generator.safetensors", malicious.pickle_file),
    "huge cloud.npy": ("cloud.npy", malicious.huge_npy),
    "huge depth.npy": ("depth.npy", malicious.huge_npy),
    "huge cloud.npz": ("cloud.npz", lambda: malicious.huge_npz("cloud")),
    "huge grasps.npz": ("grasps.npz", lambda: malicious.huge_npz("palm_position")),
    "future cloud.npz": ("cloud.npz", lambda: malicious.future_npz("cloud")),
    "future grasps.npz": ("grasps.npz", lambda: malicious.future_npz("palm_position")),
    "bomb cloud.npz": ("cloud.npz", lambda: malicious.zip_bomb("cloud")),
    "bomb grasps.npz": ("grasps.npz", lambda: malicious.zip_bomb("palm_position")),
    "huge depth.png": ("depth.png", malicious.huge_png),
    "huge mask.png": ("mask.png", malicious.huge_png),
    "huge cloud.ply": ("cloud.ply", malicious.huge_ply),
    "huge cloud.pcd": ("cloud.pcd", malicious.huge_pcd),
    "huge count in cloud.pcd": ("cloud.pcd", lambda: malicious.huge_pcd(count=10**9, points=90)),
    "huge compressed cloud.pcd": ("cloud.pcd", lambda: malicious.huge_pcd(data="binary_compressed")),
    "huge mesh.ply": ("mesh.ply", malicious.huge_ply),
    "huge faces in mesh.ply": ("mesh.ply", lambda: malicious.huge_ply("face")),
    "huge mesh.stl": ("mesh.stl", malicious.huge_stl),
    "huge mesh.glb": ("mesh.glb", malicious.huge_glb),
    "deep grasps.json": ("grasps.json", malicious.deep_json),
    "deep config.json": ("config.json", malicious.deep_json),
    "deep calibration.json": ("calibration.json", malicious.deep_json),
    "deep dataset.json": ("dataset.json", malicious.deep_json),
    "deep hand.toml": ("hand.toml", malicious.deep_toml),
    "deep hand.xml": ("hand.xml", malicious.deep_xml),
    "laughing hand.xml": ("hand.xml", malicious.laughing_xml),
    "huge weights": ("generator.safetensors", malicious.huge_safetensors),
}
"""What is written to which file; what takes an argument leaves a trace there if it is ever run."""

INCLUDES = {
    "include": '<include file="secret.xml"/>',
    "include elsewhere": '<include file="../secret.xml"/>',
    "mesh elsewhere": '<asset><mesh name="m" file="../secret.stl"/></asset>',
    "mesh anywhere": '<asset><mesh name="m" file="/etc/passwd"/></asset>',
    "texture elsewhere": '<asset><texture name="t" type="cube" fileright="../secret.png"/></asset>',
    "directory elsewhere": '<compiler meshdir=".."/><asset><mesh name="m" file="secret.stl"/></asset>',
    "model elsewhere": '<asset><model name="m" file="../secret.xml"/></asset>',
}


@pytest.fixture
def door(tmp_path):
    """A valid input behind a door, given the file that will be damaged."""

    def enter(file, kind=""):
        found = next(door for door in DOORS if door.file == file and door.name.startswith(kind))
        folder = tmp_path / "input"
        folder.mkdir()
        found.build(folder)
        return found, folder

    return enter


@pytest.mark.parametrize(("file", "content"), EVIL.values(), ids=EVIL)
def test_harm_is_refused(door, tmp_path, file, content):
    found, folder = door(file)
    trace = tmp_path / "code was run"
    evil = content(trace) if content.__code__.co_argcount and not content.__defaults__ else content()
    (folder / file).write_bytes(evil)
    with limits(), pytest.raises(FFHNetError):
        found.open(folder)
    assert not trace.exists()


@pytest.mark.parametrize("element", INCLUDES.values(), ids=INCLUDES)
def test_a_hand_reads_nothing_outside_its_folder(door, element):
    found, folder = door("hand.xml")
    file = folder / "hand.xml"
    file.write_text(file.read_text().replace("<worldbody>", f"{element}<worldbody>", 1))
    with pytest.raises(HandError, match=r"one file|in its folder"):
        found.open(folder)


@pytest.mark.parametrize("model", ["../hand.xml", "/etc/passwd", "link.xml"])
def test_the_model_of_a_hand_lies_beside_its_description(door, model):
    found, folder = door("hand.toml")
    (folder / "hand.xml").rename(folder.parent / "hand.xml")
    (folder / "link.xml").symlink_to(folder.parent / "hand.xml")
    file = folder / "hand.toml"
    file.write_text(file.read_text().replace('"hand.xml"', f'"{model}"'))
    with pytest.raises(HandError, match="in its folder"):
        found.open(folder)


def test_a_mesh_of_another_file_is_refused(door):
    found, folder = door("mesh.glb")
    (folder.parent / "secret.bin").write_bytes(np.arange(9, dtype="f4").tobytes())
    (folder / "mesh.glb").write_bytes(malicious.foreign_glb("../secret.bin"))
    with pytest.raises(FFHNetError):
        found.open(folder)


NAMING = (
    ("cloud", "cloud.ply", b"element", b"comment TextureFile ../private.png\n"),
    ("mesh", "mesh.ply", b"element", b"comment TextureFile ../private.png\n"),
    ("mesh", "mesh.obj", b"v ", b"mtllib ../private.mtl\n"),
)
"""What is put before which bytes of a file, so that it names another one."""

OPENED = """
import sys
sys.path.append({here!r})
opened = []
sys.addaudithook(lambda event, arguments: opened.append(str(arguments[0])) if event == "open" else None)
from pathlib import Path
from doors import DOORS
from test_malicious import NAMING
for kind, file, _, _ in NAMING:
    door = next(door for door in DOORS if door.file == file and door.name.startswith(kind))
    door.open(Path({root!r}, kind))
    assert any(name.endswith(file) for name in opened), "the hook hears nothing"
sys.exit(", ".join(name for name in opened if name.endswith(("private.png", "private.mtl"))) or 0)
"""


def test_what_a_file_names_is_not_opened(tmp_path):
    (tmp_path / "private.mtl").write_text("newmtl m\nmap_Kd private.png\n")
    Image.fromarray(np.zeros((2, 2), np.uint8)).save(tmp_path / "private.png")
    for kind, file, before, line in NAMING:
        (tmp_path / kind).mkdir(exist_ok=True)
        next(door for door in DOORS if door.file == file and door.name.startswith(kind)).build(
            tmp_path / kind
        )
        content = (tmp_path / kind / file).read_bytes()
        assert before in content
        (tmp_path / kind / file).write_bytes(content.replace(before, line + before, 1))
    program = OPENED.format(here=str(Path(__file__).parent), root=str(tmp_path))
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_a_thousand_million_rows_in_a_few_kilobytes(door):
    found, folder = door("trials/tube_000008.parquet")
    rows = pq.ParquetWriter(
        folder / found.file, pa.schema({"object": pa.dictionary(pa.int32(), pa.string())})
    )
    group = pa.table({"object": pa.DictionaryArray.from_arrays(np.zeros(10**6, np.int32), ["a"])})
    for _ in range(100):
        rows.write_table(group)
    rows.close()
    assert os.path.getsize(folder / found.file) < 10**6
    with limits(), pytest.raises(FFHNetError, match="rows in"):
        found.open(folder)


def test_another_table_is_no_data_set(door):
    found, folder = door("trials/tube_000008.parquet")
    pq.write_table(pa.table({"a": [1]}), folder / found.file)
    with pytest.raises(FFHNetError, match="object"):
        found.open(folder)


@pytest.mark.parametrize(
    "size", ["flow_width", "flow_blocks", "width", "inner_width", "bps_size", "flow_steps"]
)
def test_weights_of_a_network_that_fills_the_memory(door, size):
    found, folder = door("config.json")
    file = folder / "config.json"
    old = next(line for line in file.read_text().splitlines() if f'"{size}"' in line)
    file.write_text(file.read_text().replace(old, f'"{size}": 1000000,'))
    with limits(), pytest.raises(WeightsError):
        found.open(folder)
