"""Changes geometry, frames and labels in small ways, one at a time, and counts what the tests notice.

    python benchmarks/mutants.py --json mutants.json

Each mutant is one line of a copy of the package, which only the named tests see, in a process that has
imported all that takes long before. Leaves with status 1 where a mutant survived, or where the tests fail
without any.
"""

from __future__ import annotations

import json
import os
import shutil
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import hypothesis  # noqa: F401
import mujoco  # noqa: F401
import pytest
import torch  # noqa: F401
import trimesh  # noqa: F401
import tyro

from ffhnet.apps.console import absent, print_table

ROOT = Path(__file__).parents[1]


@dataclass(frozen=True)
class Mutant:
    """One change.

    Attributes:
        file: in `src/ffhnet`.
        old: what stands there once.
        new: what stands there then.
    """

    file: str
    old: str
    new: str


ROTATIONS, TRANSFORMS = "geometry/rotations.py", "geometry/transforms.py"
GRASPS, VIEW, TABLE = "grasps.py", "perception/view_frame.py", "perception/table.py"
OBSERVATION, TRIAL = "perception/observation.py", "simulation/trial.py"
LOCAL, RECORDS = "dataset/robustness.py", "dataset/records.py"
LINKS = "model/placed_links.py"

MUTANTS = {
    "tests/geometry": (
        Mutant(ROTATIONS, "torch.linalg.cross(x, b)", "torch.linalg.cross(b, x)"),
        Mutant(ROTATIONS, "y = torch.linalg.cross(z, x)", "y = b"),
        Mutant(ROTATIONS, "torch.stack([x, y, z], dim=-1)", "torch.stack([x, y, z], dim=-2)"),
        Mutant(ROTATIONS, "rotation[..., :, 1]], dim=-1", "rotation[..., :, 2]], dim=-1"),
        Mutant(ROTATIONS, "xyzw[:, [3, 0, 1, 2]]", "xyzw[:, [0, 1, 2, 3]]"),
        Mutant(ROTATIONS, "[:, [1, 2, 3, 0]]", "[:, [0, 1, 2, 3]]"),
        Mutant(ROTATIONS, 'from_euler("xyz"', 'from_euler("XYZ"'),
        Mutant(ROTATIONS, "(trace - 1) / 2", "trace / 3"),
        Mutant(TRANSFORMS, "np.swapaxes(transform[..., :3, :3], -1, -2)", "transform[..., :3, :3]"),
        Mutant(TRANSFORMS, "-np.einsum", "np.einsum"),
        Mutant(TRANSFORMS, "points @ transform[:3, :3].T +", "points @ transform[:3, :3] +"),
        Mutant(TRANSFORMS, "+ transform[:3, 3]", "- transform[:3, 3]"),
    ),
    "tests/test_grasps.py": (
        Mutant(GRASPS, "np.argsort(-self.score", "np.argsort(self.score"),
        Mutant(GRASPS, "rotation=T_new_old[:3, :3] @ self.rotation", "rotation=self.rotation"),
        Mutant(GRASPS, "T_new_old[:3, :3].T + T_new_old[:3, 3]", "T_new_old[:3, :3].T"),
        Mutant(GRASPS, "self.probability if self.robustness is None", "self.probability if True"),
        Mutant(GRASPS, "joints=self.joints[index]", "joints=self.joints[: len(self.position[index])]"),
    ),
    "tests/perception/test_observation.py": (
        Mutant(VIEW, "np.column_stack([x, np.cross(z, x), z])", "np.column_stack([x, np.cross(x, z), z])"),
        Mutant(VIEW, "- np.dot(direction, z) * z", "+ np.dot(direction, z) * z"),
        Mutant(VIEW, ".mean(axis=0)\n    )", ".min(axis=0)\n    )"),
        Mutant(OBSERVATION, "apply(invert(T_input_view), cloud))\n    return", "cloud)\n    return"),
        Mutant(OBSERVATION, "-float(self.plane.height(", "float(self.plane.height("),
        Mutant(OBSERVATION, "T @ T_optical_view, table_height", "T_optical_view, table_height"),
        Mutant(TABLE, "points @ self.normal - self.offset", "points @ self.normal + self.offset"),
    ),
    "tests/model/test_placed_links.py": (
        Mutant(LINKS, "nothing, -z, y, z", "nothing, z, y, -z"),
        Mutant(LINKS, "torch.cat([opened, joints])", "torch.cat([joints, opened])"),
        Mutant(LINKS, "poses[:, self.parent[generation]] @ local", "poses[:, generation] @ local"),
        Mutant(LINKS, "angle * of_leader + self", "angle + self"),
        Mutant(LINKS, ".squeeze(-1) + poses[..., :3, 3]", ".squeeze(-1)"),
    ),
    "tests/simulation/test_trial.py": (
        Mutant(TRIAL, "-back[:, None] * grasps", "back[:, None] * grasps"),
        Mutant(TRIAL, "if row.rise < physics.min_rise:", "if row.rise > physics.min_rise:"),
        Mutant(TRIAL, "if links == 0:", "if links != 0:"),
        Mutant(TRIAL, "return links > 0 and not on_table", "return links > 0"),
        Mutant(TRIAL, "outcome = Outcome.SLIPPED", "outcome = Outcome.SUCCESS"),
        Mutant(TRIAL, "return _Row(Outcome.COLLISION, joints)", "pass"),
        Mutant(TRIAL, "return not self._hand_geoms.isdisjoint", "return self._hand_geoms.isdisjoint"),
    ),
    "tests/dataset/test_training_data.py": (
        Mutant(LOCAL, "np.fill_diagonal(weight, 0.0)", "np.fill_diagonal(weight, 1.0)"),
        Mutant(LOCAL, "-0.5 * (", "-0.1 * ("),
    ),
    "tests/dataset/test_generate.py": (
        Mutant(RECORDS, '(outcome == "success")', '(outcome != "collision")'),
        Mutant(RECORDS, '"held": pa.array(block.held', '"held": pa.array(block.repeats'),
    ),
}
"""What is changed, by the tests that must notice."""


@dataclass(frozen=True)
class Options:
    """Mutants."""

    only: str = ""
    """Only those whose tests have this in their name."""
    json: Annotated[Path | None, absent("FILE")] = None
    """Write which was noticed to this file."""


def main(options: Options) -> None:
    chosen = {tests: mutants for tests, mutants in MUTANTS.items() if options.only in tests}
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        for name in ("src", "tests"):
            shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
        shutil.copy(ROOT / "pyproject.toml", copy)
        for tests, mutants in chosen.items():
            if not passes(copy, tests):
                sys.exit(f"{tests} fails without any mutant")
            for mutant in mutants:
                rows.append((tests, mutant, "killed" if killed(copy, tests, mutant) else "survived"))
                print(f"{rows[-1][-1]}: {mutant.file}: {mutant.new!r}", flush=True)
    print_table(
        f"{sum(fate == 'killed' for *_, fate in rows)} of {len(rows)} mutants killed",
        ("file", "was", "becomes", ""),
        [[m.file, *(" ".join(text.split()) for text in (m.old, m.new)), fate] for _, m, fate in rows],
    )
    if options.json is not None:
        fates = [{"tests": tests, **vars(mutant), "fate": fate} for tests, mutant, fate in rows]
        options.json.write_text(json.dumps(fates, indent=1) + "\n")
    sys.exit(int(any(fate == "survived" for *_, fate in rows)))


def killed(copy: Path, tests: str, mutant: Mutant) -> bool:
    """Whether a test fails with the change."""
    path = copy / "src" / "ffhnet" / mutant.file
    text = path.read_text()
    if text.count(mutant.old) != 1:
        sys.exit(f"{mutant.old!r} stands {text.count(mutant.old)} times in {mutant.file}, wanted once")
    path.write_text(text.replace(mutant.old, mutant.new))
    try:
        return not passes(copy, tests)
    finally:
        path.write_text(text)


def passes(copy: Path, tests: str) -> bool:
    child = os.fork()
    if child == 0:
        os.chdir(copy)
        for stream in (1, 2):
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
        for name in [name for name in sys.modules if name.partition(".")[0] == "ffhnet"]:
            del sys.modules[name]
        sys.path.insert(0, str(copy / "src"))
        sys.dont_write_bytecode = True
        os._exit(pytest.main(["-q", "-x", "-p", "no:cacheprovider", tests]))
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if status not in (0, 1):
        sys.exit(f"pytest ended with status {status} at {tests}")
    return status == 0


if __name__ == "__main__":
    main(tyro.cli(Options))
