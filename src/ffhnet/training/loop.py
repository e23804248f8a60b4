"""The one training loop: a fixed number of steps, logged, measured on held-out data, resumable."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import torch
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from ffhnet.errors import WeightsError
from ffhnet.files import only_writer, write_atomically
from ffhnet.training.config import TrainingConfig
from ffhnet.training.processes import Processes
from ffhnet.training.state import JsonLog, pack_state, unpack_state
from ffhnet.training.tasks import Task

LOG_EVERY = 10
"""Steps between rows of the log."""


@contextmanager
def seeded(*key: int, device: torch.device | None = None) -> Iterator[np.random.Generator]:
    """A numpy generator for `key`, and torch's global generators seeded likewise inside the block.

    Each step draws from its own key, so that a resumed run needs no generator state to go on equally.
    The generators of the CPU and of `device` are afterwards as they were.
    """
    sequence = np.random.SeedSequence(key)
    with torch.random.fork_rng([device] if device is not None and device.type == "cuda" else []):
        torch.manual_seed(int(sequence.generate_state(1)[0]))
        yield np.random.default_rng(sequence)


def fit(
    task: Task, config: TrainingConfig, folder: Path, name: str, progress: bool, processes: Processes
) -> dict[str, float]:
    """Train a network in place; returns its last held-out metrics (process 0; none in the others).

    Process 0 writes `NAME_log.jsonl` and `NAME_state.safetensors` into `folder`, and goes on from the
    latter where it exists. The others get everything from process 0 and need not see the folder. A run
    that was killed ends in the same weights if it goes on with as many processes.

    Args:
        task: network, this process's part of the batches, loss and metrics.
        config: the run, with the size of the whole batch.
        folder: made if missing.
        name: "generator" or "evaluator".
        progress: show a progress bar.
        processes: those that train this network together.

    Raises:
        WeightsError: the state in `folder` belongs to another run, or another process is writing it.
    """
    if not processes.first:
        return _fit(task, config, folder, name, False, processes)
    folder.mkdir(parents=True, exist_ok=True)
    with _only_run(folder, name):
        return _fit(task, config, folder, name, progress, processes)


def _fit(
    task: Task, config: TrainingConfig, folder: Path, name: str, progress: bool, processes: Processes
) -> dict[str, float]:
    module = task.module.train()
    kinds = {"adam": torch.optim.Adam, "adamw": torch.optim.AdamW}
    optimizer = kinds[config.optimizer](
        module.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay, fused=True
    )
    state = folder / f"{name}_state.safetensors"
    identity = json.dumps(dataclasses.asdict(config), sort_keys=True)
    content = None
    if processes.first:
        content = state.read_bytes() if state.exists() else pack_state(0, identity, module, optimizer)
    done = unpack_state(processes.broadcast(content), state, identity, module, optimizer)
    log = JsonLog(folder / f"{name}_log.jsonl", done) if processes.first else None
    share = processes.share(config.views) / config.views
    if done < config.steps:
        task.prepare(progress)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, disable=not progress) as bar:
        shown = bar.add_task(name, total=config.steps, completed=done)
        for step in range(done, config.steps):
            rate = config.learning_rate_at(step)
            for group in optimizer.param_groups:
                group["lr"] = rate
            with seeded(config.seed, step, processes.rank, device=processes.device) as rng:
                loss, parts = task.loss(step, rng)
            optimizer.zero_grad()
            loss.backward()
            processes.average_gradients(module, share)
            optimizer.step()

            done, last = step + 1, step + 1 == config.steps
            measured, saved = done % config.metrics_every == 0, done % config.state_every == 0
            if measured or saved or last:
                processes.average_statistics(module, share)
            if log is not None:
                row = {"learning_rate": rate, **parts} if done % LOG_EVERY == 0 or last else {}
                if measured and not last:
                    row |= task.metrics()
                if row:
                    log.write(done, row)
                    bar.update(shown, description=f"{name} loss {parts['loss']:.3f}")
                if saved or last:
                    write_atomically(state, pack_state(done, identity, module, optimizer))
            bar.advance(shown)
    metrics = task.metrics() if processes.first else {}
    module.eval()
    return metrics


@contextmanager
def _only_run(folder: Path, name: str) -> Iterator[None]:
    """Keeps a second run of the same network out of the folder, such as what a killed launcher left."""
    try:
        with only_writer(folder, f".{name}.lock"):
            yield
    except BlockingIOError as error:
        raise WeightsError(f"another process is training the {name} in {folder}") from error
