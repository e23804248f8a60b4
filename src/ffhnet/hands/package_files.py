"""The model of a hand as it lies in an installed Python package, read without running any of its code.

MuJoCo gets only what says how the hand is built, as one text and the bytes of the meshes that it needs, all
read here, from the package's own folder. What a simulation adds (actuators, sensors, materials, settings that
newer versions of MuJoCo refuse) is left out.
"""

from __future__ import annotations

import importlib.util
import xml.etree.ElementTree as ET
from pathlib import Path

from ffhnet.errors import HandError
from ffhnet.hands.confinement import check_inside

_KEPT = ("compiler", "default", "asset", "worldbody")
"""Top-level elements that say where bodies, joints and shapes are."""

_LOOKS = ("material", "texture")

_MAX_INCLUDES = 20


def package_folder(package: str, install: str) -> Path:
    """Folder of an installed top-level package; raises HandError with how to install it."""
    found = importlib.util.find_spec(package) if package.isidentifier() else None
    if found is None or not found.submodule_search_locations:
        raise HandError(f"this hand comes with the Python package {package}: {install}")
    return Path(found.submodule_search_locations[0])


def read_self_contained(folder: Path, model: str) -> ET.Element:
    """An MJCF with its includes in place and without what is not kept.

    Args:
        folder: the package's folder; nothing outside it is read.
        model: path of the MJCF in it.

    Raises:
        HandError: a file lies elsewhere, is missing or is no MJCF.
    """
    path = folder / model
    top = _parse(folder, path)
    for _ in range(_MAX_INCLUDES):
        if not _replace_includes(top, folder, path.parent):
            break
    else:
        raise HandError(f"{path.name} includes more than {_MAX_INCLUDES} files in each other")
    for element in [child for child in top if child.tag not in _KEPT]:
        top.remove(element)
    for parent in top.iter():
        for child in [child for child in parent if child.tag in _LOOKS]:
            parent.remove(child)
        parent.attrib.pop("material", None)
        if parent.tag == "compiler":
            parent.attrib.pop("texturedir", None)
            parent.attrib.pop("coordinate", None)
    return top


def mesh_path(folder: Path, model: str, top: ET.Element, file: str) -> Path:
    """Where a mesh lies that an MJCF of the package names; raises HandError where that is elsewhere."""
    directory = ""
    for compiler in top.iter("compiler"):
        directory = compiler.get("meshdir", compiler.get("assetdir", directory))
    path = (folder / model).parent / directory / file
    check_inside(folder, path)
    return path


def _parse(folder: Path, path: Path) -> ET.Element:
    check_inside(folder, path)
    try:
        return ET.parse(path).getroot()
    except (OSError, ET.ParseError) as error:
        raise HandError(f"cannot read the hand model {path.name}: {error}") from error


def _replace_includes(top: ET.Element, folder: Path, beside: Path) -> bool:
    """Puts the content of every included file in its place; whether there was one."""
    found = False
    for parent in list(top.iter()):
        for index in reversed(range(len(parent))):
            if parent[index].tag == "include":
                found = True
                included = _parse(folder, beside / parent[index].get("file", ""))
                parent[index : index + 1] = list(included)
    return found
