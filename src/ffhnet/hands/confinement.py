"""A hand's model reads nothing outside its folder. MuJoCo would follow any path that it names."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

from ffhnet.errors import HandError

_FOREIGN = ("include", "model")
"""Elements that bring in further models, which could name further files."""

_DIRECTORIES = ("assetdir", "meshdir", "texturedir")
"""Attributes of the compiler, under which the files of assets are looked for."""


def check_confined(root: ET.Element, path: Path) -> None:
    """Make sure that an MJCF is one file, whose assets lie in its folder or below.

    Args:
        root: the parsed file.
        path: where it lies.

    Raises:
        HandError: it includes other models, or names a file elsewhere.
    """
    directories = {name: element.get(name, "") for element in root.iter("compiler") for name in _DIRECTORIES}
    for element in root.iter():
        if element.tag in _FOREIGN:
            raise HandError(f"{path.name} must be one file, but has an element <{element.tag}>")
        for name, value in element.attrib.items():
            if name.startswith("file"):
                for directory in {"", *directories.values()}:
                    check_inside(path.parent, Path(directory) / value)


def check_inside(folder: Path, file: Path) -> None:
    """Raises HandError where a file, relative to a folder, is not in it or below."""
    if not (folder / file).resolve().is_relative_to(folder.resolve()):
        raise HandError(f"wanted the files of a hand in its folder {folder}, got {file}")
