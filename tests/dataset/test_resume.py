"""What can go wrong in a job (kills, full disks, broken meshes, two jobs at once), and going on after it."""

import errno
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from executor_work import HereExecutor

from ffhnet.apps.cli import main
from ffhnet.dataset.executors import LocalExecutor, RayExecutor
from ffhnet.dataset.generate import generate, unfinished
from ffhnet.dataset.object_trials import GenerateConfig
from ffhnet.errors import DatasetError, OptionError
from ffhnet.files import only_writer, write_atomically
from ffhnet.objects.catalogue import resolve_objects

SOURCES = resolve_objects("procedural-test:3")
SMALL = GenerateConfig(placements=1, views=1, heuristic=2, power=2, perturb_rounds=0, max_collisions=2)
REPOSITORY = Path(__file__).parents[2]


def run(out, sources=SOURCES, executor=None):
    done, failed = [], []
    failures = generate(
        sources, out, SMALL, executor or HereExecutor(), done.append, lambda name, _: failed.append(name)
    )
    assert set(failed) <= set(failures)
    return done, failures


def contents(out):
    """All files, hidden ones too, but for the lock."""
    return {
        str(path.relative_to(out)): path.read_bytes()
        for path in out.rglob("*")
        if path.is_file() and path.name != ".lock"
    }


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    out = tmp_path_factory.mktemp("data") / "undisturbed"
    assert run(out) == ([source.name for source in SOURCES], {})
    return contents(out)


@pytest.fixture
def meshes(tmp_path):
    """Two good boxes and three files that are none."""
    folder = tmp_path / "meshes"
    folder.mkdir()
    trimesh.creation.box([0.05, 0.06, 0.12]).export(folder / "box.ply")
    trimesh.creation.box([50, 60, 120]).export(folder / "millimetres.ply")
    trimesh.creation.cylinder(0.03, 0.12).export(folder / "can.stl")
    (folder / "garbage.obj").write_text("no mesh\n")
    (folder / "cut.stl").write_bytes((folder / "can.stl").read_bytes()[:300])
    return folder


@pytest.mark.parametrize("kind", ["local", "ray"])
def test_the_bytes_are_the_same_on_every_executor(kind, undisturbed, tmp_path, request):
    if kind == "local":
        executor = LocalExecutor(2)
    else:
        executor = RayExecutor(request.getfixturevalue("cluster").address)
    done, failures = run(tmp_path, executor=executor)
    assert sorted(done) == sorted(source.name for source in SOURCES)
    assert failures == {}
    assert contents(tmp_path) == undisturbed


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="finds the processes to kill in /proc")
def test_killed_jobs_end_with_the_same_files_when_resumed():
    command = [sys.executable, REPOSITORY / "benchmarks" / "kills.py"]
    options = ["--kills", "2", "--objects", "2", "--workers", "1", "--longest", "9"]
    ended = subprocess.run([*command, *options], capture_output=True, text=True, timeout=200)
    assert ended.returncode == 0, ended.stderr
    report = json.loads(ended.stdout)
    assert sum(report["kills"].values()) == 2
    assert report["identical"]


def test_a_full_disk_stops_the_job_and_leaves_nothing_half(undisturbed, tmp_path, monkeypatch):
    """The disk is full after some more files each time; every write is once the one that fails."""
    sync, space = os.fsync, 0

    def fsync(file):
        nonlocal space
        space -= 1
        if space < 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        sync(file)

    monkeypatch.setattr(os, "fsync", fsync)
    for files in (0, 1, 1, 3):
        space = files
        with pytest.raises(DatasetError, match=r"^cannot write the data set .*No space left on device$"):
            run(tmp_path)
        found = contents(tmp_path)
        assert found.items() <= undisturbed.items()
    assert 0 < len(unfinished(SOURCES, tmp_path)) < len(SOURCES)
    space = 100
    run(tmp_path)
    assert contents(tmp_path) == undisturbed


def test_what_a_killed_job_left_is_cleared_and_done_again(undisturbed, tmp_path):
    run(tmp_path, SOURCES[:1])
    # Killed between the two files of an object, and in the middle of writing one.
    (tmp_path / "trials" / f"{SOURCES[0].name}.parquet").unlink()
    (tmp_path / "views" / f".{SOURCES[1].name}.parquet.abcd_123").write_bytes(b"half")
    (tmp_path / ".failed.json.abcd_123").write_bytes(b"{")
    run(tmp_path)
    assert contents(tmp_path) == undisturbed


def test_one_job_at_a_time_writes_a_folder(tmp_path):
    with only_writer(tmp_path) as held:
        if not held:
            pytest.skip("no file locks here")
        with pytest.raises(DatasetError, match="another job is writing"):
            run(tmp_path)
    assert run(tmp_path, [])[0] == []


def test_broken_meshes_are_named_and_tried_again(meshes, tmp_path):
    out = tmp_path / "out"
    done, failures = run(out, resolve_objects(str(meshes), tmp_path / "cache"))
    assert done == ["box", "can"]
    assert set(failures) == {"cut", "garbage", "millimetres"}
    assert failures["garbage"].startswith("wanted a mesh with faces")
    assert json.loads((out / "failed.json").read_text()) == failures
    # One is repaired; of the others the next run tells too, even when it is not about them.
    trimesh.creation.box([0.05, 0.06, 0.12]).export(meshes / "millimetres.ply")
    again = [s for s in resolve_objects(str(meshes), tmp_path / "cache") if s.name != "cut"]
    done, failures = run(out, again)
    assert done == ["millimetres"]
    assert set(failures) == {"cut", "garbage"}
    trimesh.creation.box([0.05, 0.05, 0.12]).export(meshes / "cut.stl")
    (meshes / "garbage.obj").write_bytes(trimesh.creation.icosphere(1, 0.04).export(file_type="obj").encode())
    done, failures = run(out, resolve_objects(str(meshes), tmp_path / "cache"))
    assert (done, failures) == (["cut", "garbage"], {})
    assert not (out / "failed.json").exists()


def test_objects_of_the_same_name_are_refused(tmp_path):
    with pytest.raises(DatasetError, match="different names"):
        run(tmp_path, [SOURCES[0], SOURCES[0]])


def test_a_file_is_written_whole_or_not_at_all(tmp_path, monkeypatch):
    path = tmp_path / "file.bin"
    write_atomically(path, b"old")
    monkeypatch.setattr(os, "fsync", lambda _: (_ for _ in ()).throw(OSError(errno.EIO, "broken disk")))
    with pytest.raises(OptionError, match="broken disk"):
        write_atomically(path, np.random.default_rng(0).bytes(1000))
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["file.bin"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--workers", "0"], "--workers must be at least 1, got 0"),
        (["--count", "0"], "--count must be at least 1"),
        (["--first", "-1"], "--first at least 0"),
        (["--address", "auto"], "goes with --executor ray"),
        (["--objects", "procedural-test:2", "--split", "val"], "--objects and --split both name objects"),
        (["--objects", "procedural-test:2", "--first", "2"], "leaves out all 2 objects"),
        (["--objects", "nonsense"], "got 'nonsense'"),
        (["--learned", "5"], "--weights and --learned go together"),
        (["--executor", "dask"], "dask"),
    ],
)
def test_options_are_checked_before_anything_is_done(arguments, message, tmp_path, capsys):
    status, error = command(tmp_path / "out", *arguments, capsys=capsys)
    assert status == 2
    assert message in error
    assert len(error.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_the_command_names_broken_meshes_and_fails_where_there_are_no_others(
    meshes, tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr("ffhnet.dataset.executors.LocalExecutor", lambda workers: HereExecutor())
    few = ["--placements", "1", "--views", "1", "--heuristic", "2", "--power", "0", "--perturb", "0"]
    status, error = command(
        tmp_path / "out", "--objects", meshes, "--first", "1", "--count", "2", *few, capsys=capsys
    )
    assert status == 0
    assert len([line for line in error.splitlines() if line.startswith("failed: cut: ")]) == 1
    assert [path.stem for path in (tmp_path / "out" / "trials").glob("*.parquet")] == ["can"]
    status, error = command(tmp_path / "none", "--objects", meshes / "garbage.obj", capsys=capsys)
    assert status == 2
    assert "  garbage: wanted a mesh with faces" in error
    assert error.splitlines()[-1] == "ffhnet: error: none of the 1 objects could be used"


def command(*arguments, capsys):
    """Exit status and standard error of `ffhnet generate`."""
    status = 0
    try:
        main(["generate", *map(str, arguments)])
    except SystemExit as stop:
        status = stop.code
    return status, capsys.readouterr().err
