"""Several processes, on one machine or many, that train one network: who is who, and what they average.

The launcher (torchrun) says through environment variables how many there are. Each computes the gradient of
its part of the batch; the average over all is what one process would compute from the whole batch. Only
batch norm differs: each process normalises by the statistics of its own part.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import torch
import torch.distributed as dist
from torch import nn
from torch.nn.modules.batchnorm import _BatchNorm

from ffhnet.errors import OptionError

DeviceName = Literal["auto", "cpu", "cuda"]


CPU = torch.device("cpu")


@dataclass(frozen=True)
class Processes:
    """The processes of a run, as one of them sees it.

    Attributes:
        rank: number of this process; 0 writes logs, states and weights.
        count: how many there are.
        device: where this one computes.
    """

    rank: int = 0
    count: int = 1
    device: torch.device = CPU

    @property
    def first(self) -> bool:
        """Whether this is the process that writes."""
        return self.rank == 0

    def share(self, total: int) -> int:
        """How many of `total` things fall to this process; counts differ by one at most.

        Raises:
            OptionError: there are fewer things than processes.
        """
        if total < self.count:
            raise OptionError(f"{self.count} processes cannot share a batch of {total} views")
        return total // self.count + (self.rank < total % self.count)

    def broadcast(self, content: bytes | None) -> bytes:
        """What process 0 passes as `content`, for all."""
        if self.count == 1:
            return content or b""
        size = torch.tensor([len(content or b"")], device=self.device)
        dist.broadcast(size, src=0)
        buffer = torch.empty(int(size), dtype=torch.uint8, device=self.device)
        if content is not None and self.first:
            buffer.copy_(torch.frombuffer(bytearray(content), dtype=torch.uint8))
        dist.broadcast(buffer, src=0)
        return buffer.cpu().numpy().tobytes()

    def average_gradients(self, module: nn.Module, share: float) -> None:
        """Replace each gradient by its mean over the processes, weighted by their shares of the batch.

        One message for all parameters: the networks are small, and so need no overlap of sending and
        computing. A parameter that took no part counts as zero, since it may have taken part elsewhere.
        """
        if self.count == 1:
            return
        parameters = [p for p in module.parameters() if p.requires_grad]
        gradients = [torch.zeros_like(p) if p.grad is None else p.grad for p in parameters]
        for parameter, mean in zip(parameters, self._mean(gradients, share), strict=True):
            parameter.grad = mean

    def average_statistics(self, module: nn.Module, share: float) -> None:
        """Replace the running statistics of batch norm by their mean over the processes.

        They are moving averages, hence linear: averaging them when they are needed gives the same as
        averaging them after each step. Training itself does not read them.
        """
        if self.count == 1:
            return
        norms = [m for m in module.modules() if isinstance(m, _BatchNorm) and m.running_mean is not None]
        running = [r for m in norms for r in (m.running_mean, m.running_var) if r is not None]
        for own, mean in zip(running, self._mean(running, share), strict=True):
            own.copy_(mean)

    def _mean(self, tensors: list[torch.Tensor], share: float) -> list[torch.Tensor]:
        """Sum over the processes of tensors times the process's share."""
        if not tensors:
            return []
        flat = torch.cat([t.detach().flatten() for t in tensors]) * share
        dist.all_reduce(flat)
        parts = flat.split([t.numel() for t in tensors])
        return [part.view_as(t) for part, t in zip(parts, tensors, strict=True)]


ALONE = Processes()
"""One process on the CPU."""


@contextlib.contextmanager
def joined(device: DeviceName = "auto") -> Iterator[Processes]:
    """This process among those that the launcher started; alone without a launcher.

    Args:
        device: "auto" takes CUDA where there is one. Each process of a machine takes a GPU of its own.

    Raises:
        OptionError: CUDA is wanted and missing, or has fewer devices than the machine has processes.
    """
    rank, count, local = (
        int(os.environ.get(name, default))
        for name, default in (("RANK", 0), ("WORLD_SIZE", 1), ("LOCAL_RANK", 0))
    )
    gpus = torch.cuda.device_count()
    if device == "cuda" and gpus == 0:
        raise OptionError("no CUDA device was found: use --device cpu")
    if device == "cpu" or gpus == 0:
        where = CPU
    elif local < gpus:
        where = torch.device("cuda", local)
        torch.cuda.set_device(where)
    else:
        raise OptionError(f"{gpus} CUDA devices cannot serve process {local + 1} of this machine")
    if count == 1:
        yield Processes(device=where)
        return
    dist.init_process_group("nccl" if where.type == "cuda" else "gloo")
    try:
        yield Processes(rank, count, where)
    finally:
        dist.destroy_process_group()
