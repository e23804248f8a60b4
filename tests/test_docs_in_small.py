"""The commands on the pages that take minutes or hours, run with the smallest numbers that make sense.

Options stay as shown but for numbers, files and names, so that what a reader types works as a whole. Left to
other tests: servers (`view`, `ros`), Ray clusters that are not there, and `benchmark`.
"""

import shlex
import shutil
from itertools import pairwise

import pytest
import trimesh

from ffhnet.apps import cli
from test_docs import ROOT, SHOWN, is_quick

FEW = {
    "generate": {
        "--count": 1,
        "--placements": 1,
        "--views": 1,
        "--workers": 1,
        "--heuristic": 1,
        "--power": 3,
        "--perturb": 1,
        "--rounds": 1,
    },
    "train": {"--steps": 2, "--threads": 1},
    "refine": {"--steps": 2, "--threads": 1},
    "distil": {"--steps": 2, "--threads": 1},
    "calibrate": {
        "--objects": "procedural-val:4",
        "--first": 0,
        "--fit": 2,
        "--samples": 20,
        "--views": 1,
        "--executed": 2,
        "--workers": 1,
    },
    "evaluate": {"--placements": 1, "--samples": 10, "--executed": 2, "--full-views": 0, "--workers": 1},
    "objects import": {},
    "export": {},
}
"""What is set, shown or not, by command."""

IF_SHOWN = {"--learned": "2", "--neighbours": "1", "--repeats": "1"}
"""What is made small where it is shown."""

NAMES = {
    "KIT": "my_objects",
    "FOLDER": "my_objects",
    "MESHES": "meshes",
    "DIR": "meshes",
    "data/train?": "tiny",
    "data/train[0-6]": "tiny",
    "data/val0": "tiny",
    "data/shadow": "shadow_data",
    "my_weights": "shadow_weights",
    **{f"WEIGHTS_{n}": "WEIGHTS" for n in range(9)},
}
"""Files and folders of the pages, and what stands for them in `place`."""


def small(command):
    """The command with small numbers, and the names of what is there; None if it is not run here."""
    name = next((name for name in FEW if " ".join(command).startswith(name)), None)
    if name is None or "ray" in command:
        return None
    words = list(command)
    for i, (previous, word) in enumerate(pairwise(command), 1):
        if previous == "--objects" and ":" in word:
            first = int(command[command.index("--first") + 1]) if "--first" in command else 0
            words[i] = f"{word.split(':')[0]}:{first + 1 + ('--neighbours' in command)}"
        elif previous in ("--out", "generate"):
            words[i] = f"out/{word.replace('/', '_')}"
        elif previous == "--json":
            words[i] = "out/result.json"
        else:
            words[i] = IF_SHOWN.get(previous, NAMES.get(word, word))
    if name == "evaluate" and "--objects" not in words:
        words += ["--objects", "procedural-test:1"]
    for option, value in FEW[name].items():
        if option in words:
            words[words.index(option) + 1] = str(value)
        else:
            words += [option, str(value)]
    return tuple(words)


SMALL = sorted(filter(None, {small(command) for command in SHOWN}))


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with weights, a mesh, imported objects, and data of two hands under the names on the pages."""
    folder = tmp_path_factory.mktemp("small")
    shipped = ROOT / "src" / "ffhnet" / "weights"
    shutil.copytree(shipped, folder / "WEIGHTS")
    shutil.copytree(shipped / "shadow", folder / "shadow_weights")
    (folder / "meshes").mkdir()
    trimesh.creation.box((0.05, 0.06, 0.12)).export(folder / "meshes" / "carton.obj")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        few = [word for option, value in FEW["generate"].items() for word in (option, str(value))]
        cli.main(["objects", "import", "meshes", "--out", "my_objects"])
        cli.main(["generate", "tiny", "--objects", "procedural-val:2", *few, "--count", "2", "--power", "24"])
        cli.main(["generate", "shadow_data", "--hand", "shadow", *few, "--count", "2", "--power", "9"])
    return folder


@pytest.mark.parametrize("command", SMALL, ids=shlex.join)
def test_long_commands_run_in_small(command, place, monkeypatch, capsys):
    monkeypatch.chdir(place)
    shutil.rmtree("out", ignore_errors=True)
    (place / "out").mkdir()
    cli.main(list(command))
    assert capsys.readouterr().out


def test_all_that_is_left_out_is_known():
    left = {command[0] for command in SHOWN if small(command) is None and not is_quick(command)}
    assert left == {"benchmark", "view", "ros", "generate"}
