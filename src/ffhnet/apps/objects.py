"""`ffhnet objects`: what objects there are, what they look like, and which scanned meshes can be used."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from ffhnet.apps.console import absent, busy, print_table, progress_bar

if TYPE_CHECKING:
    from ffhnet.objects.grasp_object import GraspObject
    from ffhnet.objects.importing import BrokenMesh, UsableMesh

_COLUMNS = ("name", "size (mm)", "mass (g)", "pieces", "resting poses")


@dataclass(frozen=True)
class ListOptions:
    """Names of objects, without building them."""

    spec: Annotated[str, tyro.conf.Positional] = "procedural-test:20"
    """procedural-train, -val or -test, with :COUNT for the first COUNT; or a folder of meshes."""


@dataclass(frozen=True)
class ShowOptions:
    """Size, mass, convex pieces and resting poses of objects."""

    spec: Annotated[str, tyro.conf.Positional]
    """Name of one object (as printed by `list`), a mesh file, or anything that `list` takes."""
    plot: Annotated[Path | None, absent("FILE")] = None
    """Write a picture of the objects to this .png."""


@dataclass(frozen=True)
class ImportOptions:
    """Check a folder of scanned meshes: size, closed surface, convex pieces, resting poses, graspability."""

    folder: Annotated[Path, tyro.conf.Positional]
    """KIT, BigBIRD, YCB, Google Scanned Objects or HOPE; or any folder of .obj, .ply, .stl or .glb."""
    out: Annotated[Path | None, absent("FOLDER")] = None
    """Write the graspable objects there, closed and in metres, as a folder that other commands take."""
    scale: Annotated[float | Literal["auto"], tyro.conf.arg(metavar="S|auto")] = 1.0
    """Metres per unit of the files: 0.001 for millimetres; "auto" judges each by its size."""
    layout: Annotated[
        Literal["ycb", "gso", "bigbird", "kit", "hope", "bare"] | None,
        absent("{ycb,gso,bigbird,kit,hope,bare}", "found for each object"),
    ] = None
    """Take only files that lie as in this data set."""
    keep_all: bool = False
    """Write objects that the hand cannot grasp, too."""


@dataclass(frozen=True)
class ObjectsOptions:
    """List, show and import procedural or scanned objects."""

    command: (
        Annotated[ListOptions, tyro.conf.subcommand("list")]
        | Annotated[ShowOptions, tyro.conf.subcommand("show")]
        | Annotated[ImportOptions, tyro.conf.subcommand("import")]
    )


def run(options: ObjectsOptions) -> None:
    """List, show or import."""
    if isinstance(options.command, ListOptions):
        _list(options.command)
    elif isinstance(options.command, ShowOptions):
        _show(options.command)
    else:
        _import(options.command)


def _list(options: ListOptions) -> None:
    from ffhnet.objects.catalogue import resolve_objects

    for source in resolve_objects(options.spec):
        print(source.name)


def _show(options: ShowOptions) -> None:
    from ffhnet.files import check_output
    from ffhnet.objects.catalogue import resolve_objects

    if options.plot is not None:
        check_output(options.plot, (".png",))
    sources = resolve_objects(options.spec)
    with busy("building objects"):
        objects = [source.load() for source in sources]
    print_table(f"{len(objects)} objects", _COLUMNS, [_row(obj) for obj in objects])
    if options.plot is not None:
        with busy("drawing"):
            from ffhnet.evaluation.sheets import objects_picture

            objects_picture(objects, options.plot)
        print(f"picture written to {options.plot}")


def _import(options: ImportOptions) -> None:
    from ffhnet.objects.importing import BrokenMesh, UsableMesh, check_any_usable, import_mesh
    from ffhnet.objects.layouts import find_meshes
    from ffhnet.objects.units import check_scale

    check_scale(options.scale)
    found = find_meshes(options.folder, options.layout)
    if options.out is not None:
        _check_target(options.out, options.folder)
    results: list[UsableMesh | BrokenMesh] = []
    with progress_bar("checking meshes", len(found)) as advance:
        for mesh in found:
            results.append(import_mesh(mesh, options.scale))
            advance()
    usable = [result for result in results if isinstance(result, UsableMesh)]
    broken = [result for result in results if isinstance(result, BrokenMesh)]
    if usable:
        _print_usable(usable, show_scale=options.scale == "auto")
    if broken:
        print(f"{len(broken)} of {len(results)} meshes skipped:")
        for result in broken:
            print(f"  {result.found.name}: {result.reason}")
    check_any_usable(results)
    if options.out is not None:
        _write(usable if options.keep_all else [r for r in usable if r.not_graspable is None], options.out)


def _check_target(target: Path, source: Path) -> None:
    """Make sure, before any work is done, that old and new objects will not be mixed."""
    from ffhnet.errors import OptionError

    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise OptionError(f"{target}: wanted a new or empty folder for the objects")
    if target.resolve().is_relative_to(source.resolve()):
        raise OptionError(
            f"{target}: wanted a folder outside {source}, where its meshes would be found again"
        )


def _print_usable(usable: list[UsableMesh], show_scale: bool) -> None:
    columns = [*_COLUMNS, *(["scale"] if show_scale else []), "graspable"]
    rows = [
        [*_row(r.obj), *([f"{r.scale:g}"] if show_scale else []), r.not_graspable or "yes"] for r in usable
    ]
    graspable = sum(result.not_graspable is None for result in usable)
    print_table(f"{len(usable)} usable objects, {graspable} of them graspable", columns, rows)


def _write(results: list[UsableMesh], target: Path) -> None:
    from ffhnet.errors import ObjectError, OptionError
    from ffhnet.objects.importing import write_object

    if not results:
        raise ObjectError(
            "wanted at least one graspable object to write, found none; --keep-all writes the others"
        )
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OptionError(f"{target}: cannot make the folder: {error.strerror}") from error
    for result in results:
        write_object(result.obj, target)
    print(f"{len(results)} objects written to {target}")


def _row(obj: GraspObject) -> list[str]:
    return [
        obj.name,
        " × ".join(f"{1000 * side:.0f}" for side in obj.visual.extents),
        f"{1000 * obj.mass:.0f}",
        str(len(obj.pieces)),
        ", ".join(obj.pose_names),
    ]
