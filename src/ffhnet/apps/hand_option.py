"""The option `--hand`, as several commands have it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from ffhnet.apps.console import absent

HandOption = Annotated[str | None, absent("HAND", "the one that weights or data are for")]
"""Name of a hand that comes with the package, or the TOML file of any other."""


def for_workers(hand: str) -> str:
    """The same hand for processes that have other working folders; raises HandError where there is none."""
    from ffhnet.hands import load_hand

    load_hand(hand)
    return str(Path(hand).absolute()) if Path(hand).suffix == ".toml" else hand
