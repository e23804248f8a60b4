"""Everything that writes a file for keeps, as a function of a folder, for disks that are full or lie."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import doors
import numpy as np
import torch

from ffhnet.dataset.records import read_training_data
from ffhnet.feasibility.planner import plan_unchecked
from ffhnet.files import write_atomically
from ffhnet.grasps_file import load_grasps, load_plan, save_grasps, save_plan
from ffhnet.hands import load_hand
from ffhnet.model.checkpoint import load_checkpoint
from ffhnet.training.state import pack_state, unpack_state


@dataclass(frozen=True)
class Writer:
    """What is written and read again.

    Attributes:
        name: for people.
        files: what it leaves in its folder.
        write: writes them.
        read: reads what is there as a user would; raises where anything is wrong with it.
    """

    name: str
    files: tuple[str, ...]
    write: Callable[[Path], object]
    read: Callable[[Path], object]


def _network() -> tuple[torch.nn.Module, torch.optim.Optimizer]:
    torch.manual_seed(0)
    module = torch.nn.Linear(40, 30)
    optimizer = torch.optim.Adam(module.parameters())
    module(torch.ones(40)).sum().backward()
    optimizer.step()
    return module, optimizer


def _write_state(folder: Path) -> None:
    write_atomically(folder / "state.safetensors", pack_state(7, "same", *_network()))


def _read_state(folder: Path) -> dict[str, np.ndarray]:
    module, optimizer = _network()
    path = folder / "state.safetensors"
    step = unpack_state(path.read_bytes(), path, "same", module, optimizer)
    moments = {f"{k} {n}": m for k, s in optimizer.state_dict()["state"].items() for n, m in s.items()}
    tensors = {**module.state_dict(), **moments}
    return {name: tensor.detach().numpy() for name, tensor in tensors.items()} | {"step": np.array(step)}


def _read_data_set(folder: Path) -> dict[str, np.ndarray]:
    data = read_training_data([folder])
    return {name: value for name, value in vars(data).items() if isinstance(value, np.ndarray)}


def _read_weights(folder: Path) -> dict[str, np.ndarray]:
    loaded = load_checkpoint(folder)
    networks = {"generator": loaded.generator, "evaluator": loaded.evaluator}
    return {
        f"{kind} {name}": tensor.numpy()
        for kind, network in networks.items()
        for name, tensor in network.state_dict().items()
    }


def _write_plan(folder: Path) -> None:
    save_plan(plan_unchecked(doors._grasps(), load_hand()), folder / "p.json")


TRIALS, VIEWS = "trials/tube_000008.parquet", "views/tube_000008.parquet"
WRITERS = (
    Writer("grasps (JSON)", ("g.json",), lambda f: save_grasps(doors._grasps(), f / "g.json"),
           lambda f: vars(load_grasps(f / "g.json"))),
    Writer("grasps (NPZ)", ("g.npz",), lambda f: save_grasps(doors._grasps(), f / "g.npz"),
           lambda f: vars(load_grasps(f / "g.npz"))),
    Writer("plan (JSON)", ("p.json",), _write_plan,
           lambda f: vars(load_plan(f / "p.json").grasps)),
    Writer("weights", ("generator.safetensors", "evaluator.safetensors"), doors._save_weights, _read_weights),
    Writer("state of training", ("state.safetensors",), _write_state, _read_state),
    Writer("shards of a data set", (TRIALS, VIEWS), doors._save_data_set, _read_data_set),
)  # fmt: skip
CHECKED = tuple(writer for writer in WRITERS if "JSON" not in writer.name)
"""Those whose files hold checksums: a digit of a JSON file may become another one, and nobody can tell."""
