"""The state of a run, written so that a killed run resumes to the same weights; and its log."""

from __future__ import annotations

import json
import os
from pathlib import Path

import safetensors
import safetensors.torch
import torch
from torch import Tensor, nn

from ffhnet.errors import WeightsError


def save_state(
    path: Path, step: int, identity: str, module: nn.Module, optimizer: torch.optim.Optimizer
) -> None:
    """Write weights and optimiser moments after `step` steps; a kill while writing leaves the old file.

    Args:
        path: file to replace.
        step: steps done.
        identity: text that must be the same when resuming, such as the training configuration.
        module: network in training.
        optimizer: its optimiser.
    """
    tensors = {f"module/{name}": tensor for name, tensor in module.state_dict().items()}
    for index, moments in optimizer.state_dict()["state"].items():
        tensors |= {f"optimizer/{index}/{name}": tensor for name, tensor in moments.items()}
    content = {name: tensor.detach().cpu().contiguous() for name, tensor in tensors.items()}
    fresh = path.with_name(path.name + ".new")
    safetensors.torch.save_file(content, fresh, metadata={"step": str(step), "identity": identity})
    os.replace(fresh, path)


def load_state(path: Path, identity: str, module: nn.Module, optimizer: torch.optim.Optimizer) -> int:
    """Take up weights and moments; returns the steps done, 0 where there is no file.

    Raises:
        WeightsError: the file is damaged or belongs to a run with another configuration.
    """
    if not path.exists():
        return 0
    try:
        with safetensors.safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    except safetensors.SafetensorError as error:
        raise WeightsError(f"{path} is damaged, remove it to start afresh: {error}") from error
    if metadata.get("identity") != identity:
        raise WeightsError(f"{path} belongs to a run with another configuration: use another folder")
    weights: dict[str, Tensor] = {}
    moments: dict[int, dict[str, Tensor]] = {}
    for name, tensor in tensors.items():
        kind, _, rest = name.partition("/")
        if kind == "module":
            weights[rest] = tensor
        else:
            index, _, moment = rest.partition("/")
            moments.setdefault(int(index), {})[moment] = tensor
    module.load_state_dict(weights)
    groups = optimizer.state_dict()["param_groups"]
    optimizer.load_state_dict({"state": moments, "param_groups": groups})
    return int(metadata["step"])


class JsonLog:
    """Appends one JSON object per line; rows beyond the step resumed from are dropped."""

    def __init__(self, path: Path, done: int):
        self._path = path
        kept = []
        if path.exists() and done:
            lines = path.read_text(encoding="utf-8").splitlines()
            kept = [line for line in lines if line.endswith("}") and json.loads(line)["step"] <= done]
        path.write_text("".join(line + "\n" for line in kept), encoding="utf-8")

    def write(self, step: int, values: dict[str, float]) -> None:
        """Add a row."""
        with self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps({"step": step, **values}) + "\n")
