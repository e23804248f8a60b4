"""Asking for optional dependencies by the name of the extra that brings them."""

from __future__ import annotations

from importlib.util import find_spec

from ffhnet.errors import MissingExtraError


def require_sim(command: str) -> None:
    """Raises MissingExtraError where MuJoCo or pyarrow is not installed."""
    missing = [name for name in ("mujoco", "pyarrow") if find_spec(name) is None]
    if missing:
        raise MissingExtraError(
            f"`ffhnet {command}` needs {' and '.join(missing)}: pip install 'ffhnet[sim]'"
        )
