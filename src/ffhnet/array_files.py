"""NumPy archives of others: what they unpack to is known before anything is read."""

from __future__ import annotations

import math
import zipfile
from pathlib import Path
from typing import IO

import numpy as np

from ffhnet.errors import InputFileError

MAX_BYTES = 2**28
"""Of a file, and of what an archive unpacks to: eleven million points in 64-bit floats."""

_HEADERS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}


def check_size(path: Path) -> None:
    """Raises InputFileError where a file is too large to be what this package reads."""
    if path.stat().st_size > MAX_BYTES:
        raise InputFileError(
            f"{path}: wanted at most {MAX_BYTES >> 20} MiB, got {path.stat().st_size >> 20} MiB"
        )


def check_arrays(path: Path) -> None:
    """Make sure that an `.npz` unpacks to no more than its headers honestly say, and to at most `MAX_BYTES`.

    Raises:
        InputFileError: it unpacks to more, or an array's header promises another size than is there.
        OSError, ValueError, RuntimeError, zipfile.BadZipFile: it is no archive, or damaged.
    """
    with zipfile.ZipFile(path) as archive:
        members = archive.infolist()
        unpacked = sum(member.file_size for member in members)
        if unpacked > MAX_BYTES:
            raise InputFileError(
                f"{path}: wanted at most {MAX_BYTES >> 20} MiB unpacked, got {unpacked >> 20} MiB"
            )
        for member in members:
            with archive.open(member) as file:
                promised = _promised_bytes(file)
            if promised is not None and promised != member.file_size:
                raise InputFileError(
                    f"{path}: the header of {member.filename} promises {promised} bytes, "
                    f"there are {member.file_size}"
                )


def _promised_bytes(file: IO[bytes]) -> int | None:
    """Size of a `.npy` file by its header; None for objects, never unpickled, and for other versions."""
    read_header = _HEADERS.get(np.lib.format.read_magic(file))
    if read_header is None:
        return None
    shape, _, dtype = read_header(file)
    return None if dtype.hasobject else file.tell() + math.prod(shape) * dtype.itemsize
