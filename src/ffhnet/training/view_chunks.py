"""All views of a data set, some at a time, for what is computed once before the first step."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from jaxtyping import Int
from rich.progress import track

CHUNK = 64
"""Views at once."""


def view_chunks(count: int, text: str, progress: bool) -> Iterator[Int[np.ndarray, " K"]]:
    """The numbers of `count` views in order, at most `CHUNK` at a time, with a progress bar if asked for."""
    for first in track(range(0, count, CHUNK), text, disable=not progress):
        yield np.arange(first, min(first + CHUNK, count))
