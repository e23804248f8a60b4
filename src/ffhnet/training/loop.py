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

from ffhnet.training.config import TrainingConfig
from ffhnet.training.state import JsonLog, load_state, save_state
from ffhnet.training.tasks import Task

LOG_EVERY = 10
"""Steps between rows of the log."""


@contextmanager
def seeded(*key: int) -> Iterator[np.random.Generator]:
    """A numpy generator for `key`, and torch's global generator seeded likewise inside the block.

    Each step draws from its own key, so that a resumed run needs no generator state to go on equally.
    """
    sequence = np.random.SeedSequence(key)
    with torch.random.fork_rng():
        torch.manual_seed(int(sequence.generate_state(1)[0]))
        yield np.random.default_rng(sequence)


def fit(task: Task, config: TrainingConfig, folder: Path, name: str, progress: bool) -> dict[str, float]:
    """Train a network in place; returns its last held-out metrics.

    Writes `NAME_log.jsonl` and `NAME_state.safetensors` into `folder`, and goes on from the latter
    where it exists.

    Args:
        task: network, batches, loss and metrics.
        config: the run.
        folder: made if missing.
        name: "generator" or "evaluator".
        progress: show a progress bar.

    Raises:
        WeightsError: the state in `folder` belongs to another run.
    """
    folder.mkdir(parents=True, exist_ok=True)
    module = task.module.train()
    kinds = {"adam": torch.optim.Adam, "adamw": torch.optim.AdamW}
    optimizer = kinds[config.optimizer](
        module.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay
    )
    state = folder / f"{name}_state.safetensors"
    identity = json.dumps(dataclasses.asdict(config), sort_keys=True)
    done = load_state(state, identity, module, optimizer)
    log = JsonLog(folder / f"{name}_log.jsonl", done)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, disable=not progress) as bar:
        shown = bar.add_task(name, total=config.steps, completed=done)
        for step in range(done, config.steps):
            rate = config.learning_rate_at(step)
            for group in optimizer.param_groups:
                group["lr"] = rate
            with seeded(config.seed, step) as rng:
                loss, parts = task.loss(step, rng)
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()

            done, last = step + 1, step + 1 == config.steps
            row = {"learning_rate": rate, **parts} if done % LOG_EVERY == 0 or last else {}
            if done % config.metrics_every == 0 and not last:
                row |= task.metrics()
            if row:
                log.write(done, row)
                bar.update(shown, description=f"{name} loss {parts['loss']:.3f}")
            if done % config.state_every == 0 or last:
                save_state(state, done, identity, module, optimizer)
            bar.advance(shown)
    metrics = task.metrics()
    module.eval()
    return metrics
