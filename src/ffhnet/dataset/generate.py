"""The generation job (section IV-B): one object is one unit of work and one pair of Parquet files."""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pyarrow as pa

from ffhnet.dataset.executors import Executor
from ffhnet.dataset.object_trials import GenerateConfig, try_object
from ffhnet.dataset.records import trials_table, views_table, write_header, write_table
from ffhnet.errors import DatasetError, ObjectError, OptionError
from ffhnet.files import only_writer, remove_unfinished, write_atomically
from ffhnet.hands import load_hand
from ffhnet.objects.catalogue import ObjectSource
from ffhnet.objects.graspability import why_not_graspable


def generate(
    sources: Sequence[ObjectSource],
    out: Path,
    config: GenerateConfig,
    executor: Executor,
    on_done: Callable[[str], None],
    on_failed: Callable[[str, str], None],
) -> dict[str, str]:
    """Runs the job: finished objects are left alone, failed ones are tried again.

    The workers only compute. All files are written here, so that workers need not share a file system, and
    nothing is written after this process ends. The bytes depend on objects and configuration alone.

    Args:
        sources: the objects, of different names.
        out: folder of the data set; made, or gone on with.
        config: what is tried.
        executor: where the objects are tried.
        on_done: called with the name of each object when its files are written.
        on_failed: called with the name of each object that cannot be used, and why in one line.

    Returns:
        The reasons of all objects that failed, also of those of earlier runs that are not among `sources`, by
        name, as kept in `failed.json`.

    Raises:
        DatasetError: two objects have the same name; the folder holds a data set of other settings, is
            being written by another job, or cannot be written.
    """
    names = {source.name for source in sources}
    if len(names) < len(sources):
        raise DatasetError(f"wanted objects of different names, got {len(names)} names for {len(sources)}")
    with _sole_writer(out):
        with _writing(out):
            write_header(out, _header(config))
            failures = _Failures(out / "failed.json")

        def done(unit: Unit, tables: UnitTables) -> None:
            name = unit.source.name
            with _writing(out):
                write_table(tables.views, out / "views" / f"{name}.parquet")
                # Last, because this file says that the object is done.
                write_table(tables.trials, _trials_path(out, name))
                failures.remove(name)
            on_done(name)

        def failed(unit: Unit, error: Exception) -> None:
            reason = str(error).split("\n", 1)[0]
            with _writing(out):
                failures.add(unit.source.name, reason)
            on_failed(unit.source.name, reason)

        units = [Unit(source, _for_workers(config)) for source in unfinished(sources, out)]
        executor.run(run_unit, units, done, failed)
    return failures.reasons


def unfinished(sources: Sequence[ObjectSource], out: Path) -> list[ObjectSource]:
    """The objects whose files are not there yet."""
    return [source for source in sources if not _trials_path(out, source.name).exists()]


def _trials_path(out: Path, name: str) -> Path:
    return out / "trials" / f"{name}.parquet"


def _header(config: GenerateConfig) -> dict[str, Any]:
    hand = load_hand(config.hand)
    closing = dataclasses.asdict(hand.closing)
    moves = closing.pop("moves")
    return {
        "hand": hand.name,
        "joint_names": list(hand.joint_names),
        "closes": [bool(joint) for joint in moves],
        "generation": {**dataclasses.asdict(config), "hand": hand.name, "closing": closing},
        "versions": {"ffhnet": version("ffhnet"), "mujoco": version("mujoco"), "numpy": version("numpy")},
        "generator_sha256": None if config.weights is None else _digest(Path(config.weights)),
    }


def _digest(weights: Path) -> str:
    """Which generator proposed: the path alone would not tell."""
    return hashlib.sha256((weights / "generator.safetensors").read_bytes()).hexdigest()


def _for_workers(config: GenerateConfig) -> GenerateConfig:
    """The same with an absolute path: workers of a cluster have other working folders."""
    if config.weights is None:
        return config
    return dataclasses.replace(config, weights=str(Path(config.weights).absolute()))


@contextlib.contextmanager
def _sole_writer(out: Path) -> Iterator[None]:
    """Holds the folder against other jobs, and clears what a killed one left."""
    with contextlib.ExitStack() as held:
        with _writing(out):
            out.mkdir(parents=True, exist_ok=True)
            try:
                alone = held.enter_context(only_writer(out))
            except BlockingIOError as error:
                raise DatasetError(f"another job is writing the data set {out}") from error
            # Where there are no locks, two jobs write the same bytes: harmless, but for this.
            if alone:
                remove_unfinished(out, ".json")
                for kind in ("views", "trials"):
                    remove_unfinished(out / kind, ".parquet")
        yield


@contextlib.contextmanager
def _writing(out: Path) -> Iterator[None]:
    try:
        yield
    except (OSError, OptionError) as error:
        raise DatasetError(f"cannot write the data set {out}: {error}") from error


class _Failures:
    """Why objects could not be used, by name, kept in a JSON file for as long as there are any."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.reasons: dict[str, str] = {}
        if path.exists():
            try:
                self.reasons = dict(json.loads(path.read_text(encoding="utf-8")))
            except ValueError as error:
                raise DatasetError(f"{path} is damaged ({error}): remove it") from error

    def add(self, name: str, reason: str) -> None:
        self.reasons[name] = reason
        self._write()

    def remove(self, name: str) -> None:
        if self.reasons.pop(name, None) is not None:
            self._write()

    def _write(self) -> None:
        if self.reasons:
            write_atomically(self._path, (json.dumps(self.reasons, indent=2) + "\n").encode())
        else:
            self._path.unlink()


@dataclass(frozen=True)
class Unit:
    """One unit of work: everything about one object."""

    source: ObjectSource
    config: GenerateConfig


@dataclass(frozen=True)
class UnitTables:
    """What comes of it."""

    trials: pa.Table
    views: pa.Table


def run_unit(unit: Unit) -> UnitTables:
    """What a worker does with a unit.

    Raises:
        ObjectError: the object cannot be grasped, or nothing could be tried at it; or what loading raises.
    """
    obj = unit.source.load()
    if reason := why_not_graspable(obj):
        raise ObjectError(reason)
    trials, views = try_object(obj, unit.config)
    if not trials:
        raise ObjectError("no grasp could be tried at any of its resting poses")
    return UnitTables(trials_table(obj.name, trials), views_table(obj.name, views))
