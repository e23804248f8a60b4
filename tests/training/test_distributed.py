"""One or two processes train a network, and go on to the same weights when one of them is killed."""

import json
import multiprocessing
import random
import socket
import time
from collections.abc import Callable
from multiprocessing.process import BaseProcess
from pathlib import Path

import numpy as np
import pytest
import torch
import worker
from safetensors.torch import load_file

from ffhnet.dataset.training_data import TrainingData
from ffhnet.errors import OptionError, WeightsError
from ffhnet.files import only_writer
from ffhnet.training import train_evaluator
from ffhnet.training.loop import seeded
from ffhnet.training.processes import Processes, joined

# Processes are forked from one that has imported torch already: starting them takes no time.
CONTEXT = multiprocessing.get_context("forkserver")
CONTEXT.set_forkserver_preload(["torch._dynamo", "ffhnet.training"])


def start(out: Path, count: int) -> list[BaseProcess]:
    """Processes that together train a network into `out`."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    processes = [CONTEXT.Process(target=worker.main, args=(rank, count, port, out)) for rank in range(count)]
    for process in processes:
        process.start()
    return processes


def statuses(processes: list[BaseProcess]) -> list[int | None]:
    for process in processes:
        process.join(timeout=300)
    return [process.exitcode for process in processes]


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("undisturbed")
    assert statuses(start(out, 2)) == [0, 0]
    return out


@pytest.fixture(scope="module")
def undisturbed_alone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("alone")
    assert statuses(start(out, 1)) == [0]
    return out


def test_both_processes_end_with_the_same_weights_and_the_first_writes(undisturbed: Path):
    one, other = (load_file(undisturbed / f"rank{rank}.safetensors") for rank in range(2))
    assert one.keys() == other.keys()
    assert all(torch.equal(one[name], other[name]) for name in one)
    written = {path.name for path in (undisturbed / "rank0").iterdir()}
    assert {"config.json", "evaluator.safetensors", "evaluator_log.jsonl"} <= written
    assert not (undisturbed / "rank1").exists()


def test_two_processes_learn(undisturbed: Path):
    rows = [json.loads(line) for line in (undisturbed / "rank0" / "evaluator_log.jsonl").open()]
    assert rows[-1]["step"] == worker.CONFIG.steps
    assert [row["step"] for row in rows if "auroc" in row] == [40, 80, 120]
    assert rows[11]["auroc"] > 0.7


@pytest.mark.parametrize(("count", "whole_run"), [(1, "undisturbed_alone"), (2, "undisturbed")])
def test_a_killed_process_ends_the_run_which_resumes_to_the_same_weights(
    count: int, whole_run: str, tmp_path: Path, request: pytest.FixtureRequest
):
    undisturbed = request.getfixturevalue(whole_run)
    chance = random.Random(time.time_ns())
    processes = start(tmp_path, count)
    state = tmp_path / "rank0" / "evaluator_state.safetensors"
    while not state.exists():
        assert all(process.is_alive() for process in processes)
        time.sleep(0.001)
    time.sleep(chance.uniform(0, 0.3))
    processes[chance.randrange(count)].kill()
    assert all(status != 0 for status in statuses(processes))
    assert not (tmp_path / "rank0.safetensors").exists()

    assert statuses(start(tmp_path, count)) == [0] * count
    whole, resumed = (load_file(out / "rank0.safetensors") for out in (undisturbed, tmp_path))
    assert all(torch.equal(whole[name], resumed[name]) for name in whole)
    for name in ("evaluator_log.jsonl", "config.json"):
        assert (tmp_path / "rank0" / name).read_text() == (undisturbed / "rank0" / name).read_text()


def test_a_second_run_is_kept_out(undisturbed: Path, make_world: Callable[..., TrainingData]):
    data, folder = make_world(0, objects=20), undisturbed / "rank0"
    with only_writer(folder, ".evaluator.lock"), pytest.raises(WeightsError, match="another process"):
        train_evaluator(data, data, worker.CONFIG, folder, worker.JOINT_LIMITS, progress=False)


def test_shares_add_up_and_are_even():
    for total in range(8, 30):
        shares = [Processes(rank, 8).share(total) for rank in range(8)]
        assert sum(shares) == total
        assert max(shares) - min(shares) <= 1
    with pytest.raises(OptionError, match="8 processes cannot share a batch of 7 views"):
        Processes(0, 8).share(7)


def test_each_process_draws_its_own_batch_and_noise():
    draws = []
    for rank in (0, 1, 1):
        with seeded(3, 5, rank) as rng:
            draws.append((rng.random(4), torch.rand(4).numpy()))
    for first, second, again in zip(*draws, strict=True):
        assert not np.isclose(first, second).any()
        assert np.array_equal(second, again)


def test_a_device_that_is_missing_is_an_error(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 0)
    with pytest.raises(OptionError, match="--device cpu"), joined("cuda"):
        pass
    with joined("auto") as alone:
        assert alone == Processes()
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 1)
    monkeypatch.setenv("LOCAL_RANK", "1")
    with pytest.raises(OptionError, match="1 CUDA devices cannot serve process 2"), joined("auto"):
        pass
