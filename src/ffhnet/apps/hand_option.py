"""The option `--hand`, as several commands have it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from ffhnet.apps.console import absent
from ffhnet.errors import OptionError

HandOption = Annotated[str | None, absent("HAND", "the one that data or weights are for")]
"""Name of a hand that comes with the package, or the TOML file of any other."""


def for_workers(hand: str, wanted: str | None = None) -> str:
    """A hand by its name or TOML file, as processes with other working folders find it.

    Args:
        hand: name or TOML file.
        wanted: name that it must have, as data or weights say.

    Raises:
        HandError: there is no such hand, or it cannot be used.
        OptionError: it is another hand than wanted.
    """
    from ffhnet.hands import load_hand

    name = load_hand(hand).name
    if wanted is not None and name != wanted:
        raise OptionError(f"--hand is {name!r}, data or weights are for {wanted!r}")
    return str(Path(hand).absolute()) if Path(hand).suffix == ".toml" else hand


def weights_for(weights: Path | None, hand: str | None) -> str | None:
    """The folder of weights that two options name, of that hand; None for the shipped ones of the default."""
    from ffhnet.hands import load_hand
    from ffhnet.inference.ffhnet import find_weights
    from ffhnet.model.checkpoint import load_checkpoint

    if hand is None:
        return None if weights is None else str(weights)
    name = load_hand(hand).name
    folder = find_weights(weights, name)
    load_checkpoint(folder, hand=name)
    return str(folder)
