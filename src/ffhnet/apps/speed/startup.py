"""How long the package takes from a cold start, in processes of their own."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

import numpy as np

from ffhnet.apps.speed import scene


def measure_startup(rounds: int = 3) -> dict[str, dict[str, float]]:
    """Wall and processor time (s) of the help, of `import ffhnet`, and of grasps for a cloud."""
    with tempfile.TemporaryDirectory() as folder:
        cloud = Path(folder) / "cloud.npy"
        np.save(cloud, scene.visible_side(2000))
        commands = {
            "help": ["-m", "ffhnet", "--help"],
            "import": ["-c", "import ffhnet"],
            "grasp": ["-m", "ffhnet", "grasp", str(cloud), "--world"],
        }
        return {name: _measure(arguments, rounds) for name, arguments in commands.items()}


def _measure(arguments: list[str], rounds: int) -> dict[str, float]:
    wall, processor = [], []
    for _ in range(rounds):
        before, start = os.times(), time.perf_counter()
        subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL)
        wall.append(time.perf_counter() - start)
        after = os.times()
        spent = after.children_user + after.children_system
        processor.append(spent - before.children_user - before.children_system)
    return {"wall_s": median(wall), "processor_s": median(processor)}
