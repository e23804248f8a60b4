"""Reading files of others, writing files whole or not at all, and folders by one process at a time."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

from ffhnet.errors import FFHNetError, InputFileError, OptionError


@contextlib.contextmanager
def reading(path: Path, what: str) -> Iterator[None]:
    """Whatever trips over the content of a file inside becomes one line about the file.

    The readers of foreign formats raise what they like, a MemoryError or RecursionError among it.

    Raises:
        InputFileError: anything but an error of this package was raised.
    """
    try:
        yield
    except FFHNetError:
        raise
    except FileNotFoundError:
        raise InputFileError(f"{path}: no such file") from None
    except Exception as error:
        first_line = (str(error).splitlines() or [""])[0]
        raise InputFileError(
            f"{path}: not {what}, or damaged ({type(error).__name__}: {first_line})"
        ) from error


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
    """Write a file so that nobody ever sees half of it, not even after a power cut.

    It is written beside its place first, under a hidden name, and moved when it is on the disk.

    Raises:
        OptionError: the file cannot be written.
    """
    path = Path(path)
    try:
        descriptor, temporary = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
        try:
            with os.fdopen(descriptor, "wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
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


def remove_unfinished(folder: Path, suffix: str) -> None:
    """Removes what `write_atomically` left of files with this suffix when its process was killed.

    Nobody else may be writing there, see `only_writer`.
    """
    for file in folder.glob(f".*{suffix}.????????"):
        file.unlink(missing_ok=True)


@contextlib.contextmanager
def only_writer(folder: Path, lock: str = ".lock") -> Iterator[bool]:
    """Holds the lock of a folder, a file `lock` in it; gives whether it could be held.

    The operating system takes the lock back when the process ends, however it ends: it is never stale. Some
    systems (Windows) and file systems have no such locks.

    Raises:
        BlockingIOError: another process holds it.
    """
    with (folder / lock).open("w") as file:
        yield _lock(file)


def _lock(file: TextIO) -> bool:
    try:
        import fcntl
    except ImportError:
        return False
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise
    except OSError:
        return False
    return True
