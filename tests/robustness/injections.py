"""Faults of disks, done to what `writers.py` writes; each says what came of it."""

from __future__ import annotations

import contextlib
import os
import random
import resource
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
    child = os.fork()
    if child == 0:
        # Nothing of the parent may run in the child: it ends here, whatever happens.
        with contextlib.suppress(BaseException):
            resource.setrlimit(resource.RLIMIT_FSIZE, (int(share * size), resource.RLIM_INFINITY))
            try:
                writer.write(folder)
            except FFHNetError:
                os._exit(10)
            except Exception:
                os._exit(11)
        os._exit(12)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if status != 10:
        return {11: "another error", 12: "nothing was said"}.get(status, f"ended with {status}")
    return "refused" if contents(folder) == before else "files were changed"


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
