"""Full disks and turned bits are told, and leave what was there; nothing goes by the clock of the day.

`benchmarks/faults.py` does the same more often, and kills what trains and evaluates.
"""

import ast
import random
from pathlib import Path

import pytest
from injections import contents, fill_disk, flip_bit
from writers import CHECKED, WRITERS

import ffhnet


@pytest.fixture(params=WRITERS, ids=lambda writer: writer.name)
def written(request, tmp_path):
    request.param.write(tmp_path)
    return request.param, tmp_path


@pytest.mark.parametrize("share", [0.0, 0.5, 0.99])
def test_a_full_disk_is_told_and_leaves_the_files(written, share):
    assert fill_disk(*written, share) == "refused"


def test_writing_again_changes_nothing(written):
    writer, folder = written
    before = contents(folder)
    writer.write(folder)
    assert contents(folder) == before


@pytest.mark.parametrize(
    ("writer", "file"), [pytest.param(w, f, id=f"{w.name} {f}") for w in CHECKED for f in w.files]
)
def test_a_turned_bit_is_found_and_the_file_named(tmp_path, writer, file):
    writer.write(tmp_path)
    chance = random.Random(0)
    outcomes = [flip_bit(writer, tmp_path, file, chance) for _ in range(12)]
    assert set(outcomes) <= {"found", "harmless"}
    assert outcomes.count("found") >= 6


CLOCK = {"time", "time_ns", "now", "today", "utcnow", "ctime", "localtime", "gmtime"}


def test_nothing_goes_by_the_clock_of_the_day():
    """So it may jump; intervals are measured with clocks that never do."""
    root = Path(ffhnet.__file__).parent
    for path in root.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if (
                isinstance(node, ast.Call)
                and isinstance(node.func, ast.Attribute)
                and node.func.attr in CLOCK
            ):
                owner = ast.unparse(node.func.value)
                assert owner not in {"time", "datetime", "datetime.datetime", "date"}, f"{path}:{node.lineno}"
