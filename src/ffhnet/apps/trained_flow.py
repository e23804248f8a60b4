"""What commands share that teach a network, or go on from trained weights with a flow."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ffhnet.errors import OptionError, WeightsError

if TYPE_CHECKING:
    from ffhnet.model.checkpoint import Checkpoint
    from ffhnet.model.flow import FlowGenerator


def check_size(threads: int, steps: int | None) -> None:
    """Raises OptionError where there would be nothing to compute, or nothing to compute it."""
    if threads < 1 or (steps is not None and steps < 1):
        raise OptionError("--threads and --steps must be at least 1")


def load_flow(weights: Path) -> tuple[Checkpoint, FlowGenerator]:
    """Trained weights and their generator; raises WeightsError where that is no flow."""
    from ffhnet.model.checkpoint import load_checkpoint
    from ffhnet.model.flow import FlowGenerator

    trained = load_checkpoint(weights)
    if not isinstance(trained.generator, FlowGenerator):
        raise WeightsError(f"wanted weights with a flow, {weights} holds a {trained.info.model.generator}")
    return trained, trained.generator
