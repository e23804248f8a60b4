"""Faults of disks, done to what `writers.py` writes; each says what came of it."""

from __future__ import annotations

import contextlib
import random
import resource
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from writers import Writer

from ffhnet.errors import FFHNetError


def contents(folder: Path) -> dict[str, bytes]:
    """All files, hidden ones too, but for locks."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not path.name.endswith("lock")
    }


def fill_disk(writer: Writer, folder: Path, share: float) -> str:
    """Write once more where no file can have more than this share of the largest one's size.

    Returns:
        "refused" for a typed error that left every file as it was; else what is wrong.
    """
    before = contents(folder)
    size = max(len(before[name]) for name in writer.files)
    try:
        with _file_size_limit(int(share * size)):
            writer.write(folder)
    except FFHNetError:
        return "refused" if contents(folder) == before else "files were changed"
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return "nothing was said"


@contextlib.contextmanager
def _file_size_limit(limit: int) -> Iterator[None]:
    """No file of this process can grow beyond so many bytes; Python ignores the signal, writing raises."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def flip_bit(writer: Writer, folder: Path, name: str, chance: random.Random) -> str:
    """Read with one bit of a file turned, and turn it back.

    Returns:
        "found" for a typed error that names the file, "harmless" where what is read is the same; else what is
        wrong.
    """
    path, wanted = folder / name, writer.read(folder)
    content = path.read_bytes()
    damaged = bytearray(content)
    damaged[chance.randrange(len(damaged))] ^= 1 << chance.randrange(8)
    path.write_bytes(damaged)
    try:
        came = writer.read(folder)
    except FFHNetError as error:
        return "found" if path.name in str(error) else f"not named: {error}"
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    finally:
        path.write_bytes(content)
    return "harmless" if _same(came, wanted) else "other values"


def _same(one: dict[str, object], other: dict[str, object]) -> bool:
    return one.keys() == other.keys() and all(_equal(one[name], other[name]) for name in one)


def _equal(one: object, other: object) -> bool:
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        # Bit for bit: NaN is NaN, and -0 is not 0.
        return one.dtype == other.dtype and one.shape == other.shape and one.tobytes() == other.tobytes()
    return one == other
