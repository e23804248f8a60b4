"""Asking for optional dependencies by the name of the extra that brings them."""

from __future__ import annotations

from importlib.util import find_spec

from ffhnet.errors import MissingExtraError


def require_sim(command: str) -> None:
    """Raises MissingExtraError where MuJoCo or pyarrow is not installed."""
    require(command, "sim", "mujoco", "pyarrow")


def require_arm(command: str) -> None:
    """Raises MissingExtraError where MuJoCo or frankik is not installed."""
    require(command, "arm", "mujoco", "frankik")


def require(command: str, extra: str, *modules: str) -> None:
    """Raises MissingExtraError where a module of this extra is not installed."""
    missing = [name for name in modules if find_spec(name) is None]
    if missing:
        raise MissingExtraError(
            f"`ffhnet {command}` needs {' and '.join(missing)}: pip install 'ffhnet[{extra}]'"
        )
