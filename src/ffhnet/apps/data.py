"""`ffhnet data`: what a data set holds, joining, describing, exchanging and rating its trials."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from ffhnet.apps.console import absent, busy, print_table
from ffhnet.apps.extras import require_sim


@dataclass(frozen=True)
class ShowOptions:
    """Trials by proposer and outcome."""

    folder: Annotated[Path, tyro.conf.Positional]
    """A data set."""


@dataclass(frozen=True)
class PackOptions:
    """Join the files of a data set into one of trials and one of views."""

    source: Annotated[Path, tyro.conf.Positional]
    """A data set."""
    target: Annotated[Path, tyro.conf.Positional]
    """Folder of the joined data set."""


@dataclass(frozen=True)
class DiversityOptions:
    """Success and diversity of each proposer's grasps."""

    folders: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Data sets, counted as one."""
    json: Annotated[Path | None, absent("FILE")] = None
    """Write the measures to this file."""
    seed: int = 0
    """Seed of the order in which trials are counted."""


@dataclass(frozen=True)
class CardOptions:
    """A page about data sets: contents, success, labels, settings."""

    folders: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Data sets."""
    out: Annotated[Path | None, absent("FILE.md", "standard output")] = None
    """The page."""
    commands: tuple[str, ...] = ()
    """The commands that made the data sets, each in quotes; they are quoted on the page."""


@dataclass(frozen=True)
class ExportOptions:
    """Write the trials as GraspGen's grasp files, with the meshes of the objects."""

    source: Annotated[Path, tyro.conf.Positional]
    """A data set."""
    target: Annotated[Path, tyro.conf.Positional]
    """Folder of the export."""
    objects: Annotated[str | None, absent("DIR", "all objects are procedural")] = None
    """Folder with the meshes of the scanned objects in the data set."""


@dataclass(frozen=True)
class ImportOptions:
    """Read a folder of grasp files, ours or GraspGen's own, and say what it holds."""

    folder: Annotated[Path, tyro.conf.Positional]
    """Folder of the JSON files."""


@dataclass(frozen=True)
class ScoreOptions:
    """How well an evaluator predicts the trials of a data set."""

    folder: Annotated[Path, tyro.conf.Positional]
    """A data set of objects that the evaluator has not seen."""
    weights: Annotated[Path | None, absent("DIR", "the shipped weights")] = None
    """Folder of weights."""


@dataclass(frozen=True)
class DataOptions:
    """Show, pack, describe, exchange or score a data set made by `ffhnet generate`."""

    command: (
        Annotated[ShowOptions, tyro.conf.subcommand("show")]
        | Annotated[PackOptions, tyro.conf.subcommand("pack")]
        | Annotated[DiversityOptions, tyro.conf.subcommand("diversity")]
        | Annotated[CardOptions, tyro.conf.subcommand("card")]
        | Annotated[ExportOptions, tyro.conf.subcommand("export")]
        | Annotated[ImportOptions, tyro.conf.subcommand("import")]
        | Annotated[ScoreOptions, tyro.conf.subcommand("score")]
    )


def run(options: DataOptions) -> None:
    """Run one of the commands."""
    require_sim("data")
    match options.command:
        case ShowOptions() as show:
            _show(show.folder)
        case PackOptions() as pack:
            _pack(pack)
        case DiversityOptions() as diversity:
            _diversity(diversity)
        case CardOptions() as card:
            _card(card)
        case ExportOptions() as export:
            _export(export)
        case ImportOptions() as importing:
            _import(importing)
        case ScoreOptions() as score:
            _score(score)


def _show(folder: Path) -> None:
    from ffhnet.dataset.statistics import summarise

    summary = summarise(folder)
    print_table(summary.title, summary.columns, summary.rows)


def _pack(options: PackOptions) -> None:
    from ffhnet.dataset.records import pack

    pack(options.source, options.target)
    _show(options.target)


def _diversity(options: DiversityOptions) -> None:
    from ffhnet.dataset.diversity import diversity_table, measure_diversity
    from ffhnet.files import check_output, write_atomically

    if options.json is not None:
        check_output(options.json, (".json",))
    with busy("comparing grasps"):
        measured = measure_diversity(options.folders, options.seed)
    table = diversity_table(measured, ", ".join(map(str, options.folders)))
    print_table(table.title, table.columns, table.rows)
    if options.json is not None:
        content = {
            "folders": [str(folder) for folder in options.folders],
            "seed": options.seed,
            "proposers": [m.to_json() for m in measured],
        }
        write_atomically(options.json, (json.dumps(content, indent=2) + "\n").encode())


def _card(options: CardOptions) -> None:
    from ffhnet.dataset.card import data_card
    from ffhnet.files import check_output, write_atomically

    if options.out is not None:
        check_output(options.out, (".md",))
    card = data_card(options.folders, options.commands)
    if options.out is None:
        print(card, end="")
    else:
        write_atomically(options.out, card.encode())


def _export(options: ExportOptions) -> None:
    from ffhnet.dataset.exchange import export_grasps
    from ffhnet.objects.catalogue import resolve_objects
    from ffhnet.objects.grasp_object import GraspObject

    scans = {source.name: source for source in resolve_objects(options.objects)} if options.objects else {}

    def load(name: str) -> GraspObject:
        return (scans[name] if name in scans else resolve_objects(name)[0]).load()

    with busy("writing grasps and meshes"):
        count = export_grasps(options.source, options.target, load)
    print(f"{options.target}: grasp files and meshes of {count} objects")


def _import(options: ImportOptions) -> None:
    from ffhnet.dataset.exchange import read_folder

    files = read_folder(options.folder)
    rows = [(file.mesh, str(len(file.success)), str(int(file.success.sum()))) for file in files]
    total = ("all", str(sum(len(f.success) for f in files)), str(sum(int(f.success.sum()) for f in files)))
    print_table(str(options.folder), ("object", "grasps", "held"), [*rows, total])


def _score(options: ScoreOptions) -> None:
    from ffhnet.dataset.records import read_training_data
    from ffhnet.dataset.scoring import score
    from ffhnet.inference.ffhnet import FFHNet

    data = read_training_data([options.folder])
    network = FFHNet.from_pretrained(options.weights, hand=data.hand, device="cpu")
    with busy("rating the trials"):
        scores = score(data, network.evaluator)
    print(
        f"{len(data.object_names)} objects, {data.num_views} views, {scores.executed} executed trials "
        f"({scores.successes} successes), {scores.collisions} start collisions\n"
        f"AUROC {scores.auroc_executed:.3f} on executed trials, {scores.auroc_all:.3f} with collisions; "
        f"ECE {scores.ece_executed:.3f} on executed trials"
    )
