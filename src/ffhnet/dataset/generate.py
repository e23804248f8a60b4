"""The generation job (section IV-B): one object is one unit of work and one pair of Parquet files."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

from ffhnet.dataset.executors import run_jobs
from ffhnet.dataset.object_trials import GenerateConfig, try_object
from ffhnet.dataset.records import trials_table, views_table, write_header, write_table
from ffhnet.errors import DatasetError
from ffhnet.hands import load_hand
from ffhnet.objects.catalogue import ObjectSource


def generate(
    sources: list[ObjectSource],
    out: Path,
    config: GenerateConfig,
    workers: int,
    on_done: Callable[[str], None],
) -> None:
    """Runs the job; objects that are already there are left alone.

    Args:
        sources: the objects.
        out: folder of the data set; made, or gone on with.
        config: what is tried.
        workers: processes.
        on_done: called with the name of each object when its files are written.

    Raises:
        DatasetError: the folder holds a data set of other settings, or cannot be written.
    """
    hand = load_hand(config.hand)
    header = {
        "hand": hand.name,
        "joint_names": list(hand.joint_names),
        "closes": [bool(moves) for moves in hand.closing.moves],
        "generation": dataclasses.asdict(config),
    }
    try:
        write_header(out, header)
    except OSError as error:
        raise DatasetError(f"cannot write the data set {out}: {error}") from error
    todo = [source for source in sources if not _trials_path(out, source.name).exists()]
    run_jobs(_generate_object, [(source, out, config) for source in todo], workers, on_done)


def _trials_path(out: Path, name: str) -> Path:
    return out / "trials" / f"{name}.parquet"


def _generate_object(job: tuple[ObjectSource, Path, GenerateConfig]) -> str:
    """One unit of work: everything about one object."""
    source, out, config = job
    obj = source.load()
    trials, views = try_object(obj, config)
    if trials:
        write_table(views_table(obj.name, views), out / "views" / f"{obj.name}.parquet")
        # Last, because this file says that the object is done.
        write_table(trials_table(obj.name, trials), _trials_path(out, obj.name))
    return obj.name
