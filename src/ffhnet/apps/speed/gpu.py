"""The engine on a GPU, measured by events."""

from __future__ import annotations

from pathlib import Path
from statistics import median
from typing import Any

import torch

from ffhnet.inference.engine import Engine
from ffhnet.model.checkpoint import load_checkpoint
from ffhnet.model.tensors import ObjectTensors


@torch.inference_mode()
def measure_gpu(weights: Path, objects: ObjectTensors, num: int, rounds: int) -> dict[str, Any]:
    """Milliseconds from a basis point set vector to rated grasps, or why there are none."""
    if not torch.cuda.is_available():
        return {"skipped": "torch sees no CUDA device"}
    device = torch.device("cuda")
    engine, objects = Engine(load_checkpoint(weights, device=device)), objects.to(device)
    times = []
    for _ in range(rounds + 5):
        start, end = (torch.cuda.Event(enable_timing=True) for _ in range(2))
        start.record()
        seen = engine.look(objects)
        seen.rate(seen.sample(num, torch.Generator().manual_seed(0)))
        end.record()
        end.synchronize()
        times.append(start.elapsed_time(end))
    return {"device": torch.cuda.get_device_name(device), "engine_ms": median(times[5:])}
