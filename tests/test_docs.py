"""The documentation: the site builds without a warning, and every command that it shows is one."""

import re
import shlex
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from pypcd4 import PointCloud

from ffhnet.apps import cli
from ffhnet.perception.camera import REALSENSE_D415, look_at, render_depth
from ffhnet.perception.capture import read_depth
from ffhnet.perception.cloud import depth_to_cloud

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "data/README.md", ROOT / "src/ffhnet/weights/README.md"]
PAGES += sorted((ROOT / "docs").rglob("*.md"))
FENCE = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)

QUICK = (
    ("grasp",),
    ("objects", "list"),
    ("objects", "show"),
    ("hand", "check"),
    ("data", "show"),
)
"""Commands that are not only read but run, in a folder that has the files they name."""


def commands(page):
    """The `ffhnet` commands in a page's code blocks, as lists of words."""
    text = page.read_text(encoding="utf-8").replace("FX FY CX CY", "615 615 320 240")
    for language, block in FENCE.findall(text):
        for line in block.replace("\\\n", " ").splitlines():
            if language == "" and line.startswith("ffhnet "):
                yield tuple(shlex.split(line, comments=True)[1:])


SHOWN = sorted({command for page in PAGES for command in commands(page)})


def is_quick(command):
    """Whether the command is run as it is shown."""
    return any(command[: len(start)] == start for start in QUICK)


def names(command):
    """A short name for a test."""
    return " ".join(command)[:60]


def test_pages_show_commands():
    assert len(SHOWN) >= 15
    assert any(command[0] == "grasp" for command in SHOWN)


@pytest.mark.skipif(shutil.which("make") is None, reason="there is no make here")
def test_make_knows_what_the_pages_make():
    blocks = [block for page in PAGES for _, block in FENCE.findall(page.read_text(encoding="utf-8"))]
    lines = [line for block in blocks for line in block.splitlines()]
    targets = sorted({line.split()[1] for line in lines if line.startswith("make ")})
    assert targets == ["demo", "test", "view"]
    subprocess.run(["make", "--dry-run", *targets], cwd=ROOT, check=True, capture_output=True)


def test_page_of_examples_shows_all():
    """They run in test_examples.py."""
    shown = re.findall(r"^python (examples/\S+)$", (ROOT / "docs/examples.md").read_text(), re.MULTILINE)
    assert shown == [path.relative_to(ROOT).as_posix() for path in sorted(ROOT.glob("examples/[0-9]*.py"))]


@pytest.mark.parametrize("command", SHOWN, ids=names)
def test_every_command_is_understood(command):
    """Its options exist and fit; whether its files do, the commands say when they run."""
    cli._parse(list(command))


def three_blocks():
    """A depth image (m) of three things on a table."""
    block = trimesh.creation.box((0.06, 0.06, 0.12))
    blocks = [block.copy().apply_translation([0, side, 0.06]) for side in (-0.18, 0, 0.18)]
    return render_depth(blocks, look_at([-0.6, 0, 0.5], [0, 0, 0.05]), REALSENSE_D415)


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with what the quick commands of the pages name."""
    folder = tmp_path_factory.mktemp("docs")
    example = ROOT / "examples" / "data" / "jar_2000004_depth.png"
    shutil.copytree(ROOT / "examples" / "data", folder / "examples" / "data")
    shutil.copytree(ROOT / "src" / "ffhnet" / "hands" / "dlr_hit_ii", folder / "my_hand")
    (folder / "data").symlink_to(ROOT / "data")
    Image.fromarray(np.rint(1000 * three_blocks()).astype(np.uint16)).save(folder / "scene_depth.png")
    scene, _ = depth_to_cloud(read_depth(example), REALSENSE_D415)
    trimesh.PointCloud(scene).export(folder / "scene.ply")
    block = trimesh.creation.box((0.06, 0.06, 0.15)).sample(2000, seed=0)
    np.save(folder / "object.npy", block)
    PointCloud.from_xyz_points((block @ [[1, 0, 0], [0, 0, 1], [0, -1, 0]]).astype(np.float32)).save(
        folder / "object.pcd"
    )
    return folder


@pytest.mark.parametrize("command", filter(is_quick, SHOWN), ids=names)
def test_quick_commands_run(command, place, monkeypatch, capsys):
    monkeypatch.chdir(place)
    cli.main(list(command))
    assert capsys.readouterr().out
    for word in command:
        if word.endswith(".png") and command[command.index(word) - 1] == "--plot":
            assert Image.open(place / word).size[0] > 100


def test_site_builds_without_a_warning(tmp_path, caplog):
    build = pytest.importorskip("mkdocs.commands.build", reason="the site needs the extra `docs`")
    pytest.importorskip("mkdocstrings", reason="the site needs the extra `docs`")
    from mkdocs.config import load_config

    config = load_config(str(ROOT / "mkdocs.yml"), strict=True, site_dir=str(tmp_path))
    build.build(config)
    reference = (tmp_path / "reference" / "inference" / "index.html").read_text(encoding="utf-8")
    assert "from_pretrained" in reference
    assert (tmp_path / "data-card" / "index.html").is_file()
    assert "GraspTracker" in (tmp_path / "examples" / "index.html").read_text(encoding="utf-8")
