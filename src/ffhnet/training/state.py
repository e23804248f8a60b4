"""The state of a run, from which a killed run resumes to the same weights; and its log."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import safetensors
import safetensors.torch
import torch
from torch import Tensor, nn

from ffhnet.errors import OptionError, WeightsError
from ffhnet.files import write_atomically

_DIGEST = "run/sha256"


def pack_state(step: int, identity: str, module: nn.Module, optimizer: torch.optim.Optimizer) -> bytes:
    """Weights and optimiser moments after `step` steps as the content of a safetensors file.

    Args:
        step: steps done.
        identity: text that must be the same when resuming, such as the training configuration.
        module: network in training.
        optimizer: its optimiser.
    """
    tensors = {f"module/{name}": tensor for name, tensor in module.state_dict().items()}
    for index, moments in optimizer.state_dict()["state"].items():
        tensors |= {f"optimizer/{index}/{name}": tensor for name, tensor in moments.items()}
    tensors["run/step"] = torch.tensor(step)
    # As a tensor, since safetensors gives metadata only of files, and this also goes between processes.
    tensors["run/identity"] = torch.frombuffer(bytearray(identity.encode()), dtype=torch.uint8)
    kept = {name: tensor.detach().cpu().contiguous() for name, tensor in tensors.items()}
    kept[_DIGEST] = torch.frombuffer(bytearray(_digest(kept)), dtype=torch.uint8)
    return safetensors.torch.save(kept)


def unpack_state(
    content: bytes, path: Path, identity: str, module: nn.Module, optimizer: torch.optim.Optimizer
) -> int:
    """Take up weights and moments; returns the steps done.

    Args:
        content: what `pack_state` made.
        path: where it came from, for errors.
        identity: as passed to `pack_state`.
        module: network to fill.
        optimizer: optimiser to fill.

    Raises:
        WeightsError: the content is damaged or belongs to a run with another configuration.
    """
    try:
        tensors = safetensors.torch.load(content)
        # States of before there were checksums have none.
        promised = tensors.pop(_DIGEST, None)
        if promised is not None and bytes(promised.numpy()) != _digest(tensors):
            raise WeightsError(f"{path} is damaged, its checksum differs: remove it to start afresh")
        step, came = int(tensors.pop("run/step")), tensors.pop("run/identity")
    except (safetensors.SafetensorError, KeyError) as error:
        raise WeightsError(f"{path} is damaged, remove it to start afresh: {error}") from error
    if bytes(came.numpy()) != identity.encode():
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
    return step


def _digest(tensors: dict[str, Tensor]) -> bytes:
    """SHA-256 of names, types, shapes and values."""
    digest = hashlib.sha256()
    for name, tensor in sorted(tensors.items()):
        digest.update(f"{name} {tensor.dtype} {tuple(tensor.shape)} ".encode())
        digest.update(tensor.flatten().view(torch.uint8).numpy().tobytes())
    return digest.digest()


class JsonLog:
    """Appends one JSON object per line; rows beyond the step resumed from are dropped."""

    def __init__(self, path: Path, done: int):
        self._path = path
        kept = []
        if path.exists() and done:
            lines = path.read_text(encoding="utf-8").splitlines()
            kept = [line for line in lines if line.endswith("}") and json.loads(line)["step"] <= done]
        write_atomically(path, "".join(line + "\n" for line in kept).encode())

    def write(self, step: int, values: dict[str, float]) -> None:
        """Add a row. Raises OptionError where it cannot be written, as on a full disk."""
        try:
            with self._path.open("a", encoding="utf-8") as file:
                file.write(json.dumps({"step": step, **values}) + "\n")
        except OSError as error:
            raise OptionError(f"{self._path}: cannot write: {error.strerror}") from error
