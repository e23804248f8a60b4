"""One of the processes that `test_distributed` starts: checks the averages, then trains a network."""

import os
from pathlib import Path

import safetensors.torch
import torch
from torch import nn
from training_world import JOINT_LIMITS, MODEL, point_world

from ffhnet.training import TrainingConfig, train_evaluator
from ffhnet.training.processes import Processes, joined

CONFIG = TrainingConfig(model=MODEL, steps=160, views=15, grasps=16, metrics_every=40, state_every=11)


def check_averages(processes: Processes) -> None:
    x, y = torch.randn(2, 7, 3, generator=torch.Generator().manual_seed(0))
    whole, own = nn.Linear(3, 3), nn.Linear(3, 3)
    own.load_state_dict(whole.state_dict())
    (own.weight + own.bias).sum().backward()  # old gradients must not leak in
    own.zero_grad()
    whole.load_state_dict(
        safetensors.torch.load(processes.broadcast(safetensors.torch.save(own.state_dict())))
    )
    own.load_state_dict(whole.state_dict())
    part = slice(0, 4) if processes.rank == 0 else slice(4, 7)
    assert processes.share(7) == len(x[part])
    nn.functional.mse_loss(whole(x), y).backward()
    nn.functional.mse_loss(own(x[part]), y[part]).backward()
    processes.average_gradients(own, len(x[part]) / 7)
    for mean, wanted in zip(own.parameters(), whole.parameters(), strict=True):
        torch.testing.assert_close(mean.grad, wanted.grad)

    idle = nn.Linear(2, 2)
    if processes.rank == 1:
        idle(torch.ones(1, 2)).sum().backward()
    processes.average_gradients(idle, 0.5)
    torch.testing.assert_close(idle.bias.grad, torch.full((2,), 0.5))

    processes.average_statistics(idle, 0.5)  # a network without batch norm

    norm = nn.BatchNorm1d(2)
    norm.running_mean.fill_(processes.rank)
    processes.average_statistics(norm, 0.5)
    assert norm.running_mean.tolist() == [0.5, 0.5]
    assert norm.running_var.tolist() == [1.0, 1.0]


def main(rank: int, count: int, port: int, out: Path) -> None:
    torch.set_num_threads(1)
    group = {"MASTER_ADDR": "127.0.0.1", "MASTER_PORT": port, "WORLD_SIZE": count, "RANK": rank}
    os.environ |= {name: str(value) for name, value in group.items()}
    with joined("cpu") as processes:
        if count == 2:
            check_averages(processes)
        data = point_world(0)
        # Process 1 gets a folder of its own, in which nothing may appear.
        folder = out / f"rank{rank}"
        module = train_evaluator(
            data, data, CONFIG, folder, JOINT_LIMITS, progress=False, processes=processes
        )
        safetensors.torch.save_file(module.state_dict(), out / f"rank{rank}.safetensors")
