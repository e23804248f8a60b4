"""Writing files whole or not at all."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from ffhnet.errors import OptionError


def check_output(path: Path, suffixes: tuple[str, ...]) -> None:
    """Make sure, before any work is done, that a file can be written there.

    Raises:
        OptionError: the suffix is not one of `suffixes`, or there is no such directory.
    """
    if path.suffix.lower() not in suffixes:
        raise OptionError(f"{path}: an output file must end in {' or '.join(suffixes)}, got '{path.suffix}'")
    if not path.parent.is_dir():
        raise OptionError(f"{path}: the directory {path.parent} does not exist")


def write_atomically(path: str | Path, data: bytes) -> None:
    """Write a file so that nobody ever sees half of it: beside its place first, then moved.

    Raises:
        OptionError: the file cannot be written.
    """
    path = Path(path)
    try:
        descriptor, temporary = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
        try:
            with os.fdopen(descriptor, "wb") as file:
                file.write(data)
            # mkstemp makes files private; a result should be as readable as any other new file.
            mask = os.umask(0)
            os.umask(mask)
            os.chmod(temporary, 0o666 & ~mask)
            os.replace(temporary, path)
        except BaseException:
            os.unlink(temporary)
            raise
    except OSError as error:
        raise OptionError(f"{path}: cannot write: {error.strerror}") from error
