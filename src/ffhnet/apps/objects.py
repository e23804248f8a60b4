"""`ffhnet objects`: what objects there are, and what they look like."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from ffhnet.apps.console import absent, busy, print_table


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
class ObjectsOptions:
    """List and show procedural or scanned objects."""

    command: (
        Annotated[ListOptions, tyro.conf.subcommand("list")]
        | Annotated[ShowOptions, tyro.conf.subcommand("show")]
    )


def run(options: ObjectsOptions) -> None:
    """List or show."""
    if isinstance(options.command, ListOptions):
        _list(options.command)
    else:
        _show(options.command)


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
    rows = [
        [
            obj.name,
            " × ".join(f"{1000 * side:.0f}" for side in obj.visual.extents),
            f"{1000 * obj.mass:.0f}",
            str(len(obj.pieces)),
            ", ".join(obj.pose_names),
        ]
        for obj in objects
    ]
    print_table(f"{len(objects)} objects", ["name", "size (mm)", "mass (g)", "pieces", "resting poses"], rows)
    if options.plot is not None:
        with busy("drawing"):
            from ffhnet.evaluation.sheets import objects_picture

            objects_picture(objects, options.plot)
        print(f"picture written to {options.plot}")
