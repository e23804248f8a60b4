"""What a measured figure says about the computer that it was measured on."""

from __future__ import annotations

import os
import platform


def describe_machine() -> dict[str, str | int | None]:
    """Architecture, cores, and the versions of Python and MuJoCo (needs the sim extra)."""
    import mujoco

    return {
        "architecture": platform.machine(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "mujoco": mujoco.__version__,
    }
