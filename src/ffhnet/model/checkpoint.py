"""Trained networks on disk: a folder with `config.json`, `generator.safetensors`, `evaluator.safetensors`."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import safetensors
import safetensors.torch
import torch
from torch import nn

from ffhnet.errors import OptionError, WeightsError
from ffhnet.files import write_atomically
from ffhnet.model.config import ModelConfig
from ffhnet.model.evaluator import FFHEvaluator
from ffhnet.model.flow import FlowGenerator
from ffhnet.model.generator import FFHGenerator
from ffhnet.model.placed_links import POSTURES, PlacedLinks

Generator = FFHGenerator | FlowGenerator
"""What proposes grasps."""

FORMAT = 2
CONFIG_FILE = "config.json"
GENERATOR_FILE = "generator.safetensors"
EVALUATOR_FILE = "evaluator.safetensors"


@dataclass(frozen=True)
class CheckpointInfo:
    """What a checkpoint says about itself.

    Attributes:
        hand: name of the hand.
        joint_names: order of the joint angles.
        joint_lower: lower joint limits, radians.
        joint_upper: upper joint limits, radians.
        model: the architecture.
        frame: frame in which the networks see object and grasp.
        bps_radius: radius of the ball of basis points, metres.
        bps_seed: seed of the basis points.
        training: free summary of how each network was trained, by network name.
    """

    hand: str
    joint_names: tuple[str, ...]
    joint_lower: tuple[float, ...]
    joint_upper: tuple[float, ...]
    model: ModelConfig
    frame: str = "view"
    bps_radius: float = 0.2
    bps_seed: int = 13
    training: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        lengths = {len(self.joint_names), len(self.joint_lower), len(self.joint_upper), self.model.num_joints}
        if len(lengths) != 1:
            raise OptionError(
                f"the model has {self.model.num_joints} joints, got {len(self.joint_names)} names, "
                f"{len(self.joint_lower)} lower and {len(self.joint_upper)} upper limits"
            )


@dataclass(frozen=True)
class Checkpoint:
    """A loaded checkpoint, both networks in evaluation mode."""

    info: CheckpointInfo
    generator: Generator
    evaluator: FFHEvaluator


def save_checkpoint(
    folder: Path,
    info: CheckpointInfo,
    generator: Generator | None = None,
    evaluator: FFHEvaluator | None = None,
    half: bool = False,
) -> None:
    """Write the given networks; one that is not given stays as it is in the folder.

    Args:
        folder: made if missing.
        info: description of both networks; training summaries already in the folder are kept.
        generator: network to write.
        evaluator: network to write.
        half: store matrices as 16-bit floats, which halves the files.

    Raises:
        WeightsError: the folder already holds weights of another hand or architecture.
        OptionError: a file cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    digests: dict[str, str] = {}
    if (folder / CONFIG_FILE).exists():
        old, digests = _read_config(folder)
        if dataclasses.replace(old, training={}) != dataclasses.replace(info, training={}):
            raise WeightsError(f"{folder} holds weights of another hand or architecture: use another folder")
        info = dataclasses.replace(info, training={**old.training, **info.training})
    networks: dict[str, nn.Module | None] = {GENERATOR_FILE: generator, EVALUATOR_FILE: evaluator}
    for name, network in networks.items():
        if network is not None:
            data = safetensors.torch.save(_storable(network, half))
            write_atomically(folder / name, data)
            digests[name] = hashlib.sha256(data).hexdigest()
    content = {"format": FORMAT, **dataclasses.asdict(info), "sha256": digests}
    # Last: until it is written, the checksums in it tell that weights are not those that it describes.
    write_atomically(folder / CONFIG_FILE, (json.dumps(content, indent=1) + "\n").encode())


def load_checkpoint(folder: Path, hand: str | None = None, device: torch.device | str = "cpu") -> Checkpoint:
    """Both networks of a folder.

    Raises:
        WeightsError: something is missing or damaged, or `hand` is given and the weights are another hand's.
    """
    info, digests = _read_config(folder)
    if hand is not None and hand != info.hand:
        raise WeightsError(f"wanted weights for hand {hand!r}, {folder} holds weights for {info.hand!r}")
    generator, evaluator = _networks(info.model, folder)
    for name, network in ((GENERATOR_FILE, generator), (EVALUATOR_FILE, evaluator)):
        _load_weights(folder / name, digests.get(name), network)
        network.to(device).eval()
    return Checkpoint(info, generator, evaluator)


def read_info(folder: Path) -> CheckpointInfo:
    """Description of the weights in a folder, whichever of the networks are there. Raises WeightsError."""
    return _read_config(folder)[0]


def weights_digest(folder: Path) -> dict[str, str]:
    """Checksum of each network's file in a folder of weights, by file name. Raises WeightsError."""
    return _read_config(folder)[1]


def _storable(network: nn.Module, half: bool) -> dict[str, torch.Tensor]:
    """Weights on the CPU; vectors stay 32-bit, since a running variance can be too small for 16 bits.

    So do stacks of matrices, which place the hand's links.
    """
    return {
        name: (tensor.half() if half and tensor.ndim == 2 else tensor).detach().cpu().contiguous()
        for name, tensor in network.state_dict().items()
    }


def _read_config(folder: Path) -> tuple[CheckpointInfo, dict[str, str]]:
    path = folder / CONFIG_FILE
    if not path.is_file():
        raise WeightsError(f"no weights in {folder}: {CONFIG_FILE} is missing")
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if content.pop("format") != FORMAT:
            raise WeightsError(f"{path} is of another format than {FORMAT}, which this version reads")
        digests = content.pop("sha256")
        content["model"] = ModelConfig(**content["model"])
        for name, kind in (("joint_names", str), ("joint_lower", float), ("joint_upper", float)):
            content[name] = tuple(kind(value) for value in content[name])
        return CheckpointInfo(**content), digests
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError, OptionError) as error:
        raise WeightsError(f"{path} is not a checkpoint description: {error}") from error


def _networks(config: ModelConfig, folder: Path) -> tuple[Generator, FFHEvaluator]:
    """Both networks, not trained. Raises WeightsError where the folder cannot hold weights of their size."""
    looked_at = 2 * config.palm_points + 3 * POSTURES * config.link_points
    described = (
        config.flow_width * max(config.flow_blocks * config.flow_width, 2 * config.palm_points)
        if config.generator == "flow"
        else 0,
        config.inner_width * config.width,
        config.inner_width * (config.local_width or looked_at),
        config.local_width * looked_at,
        3 * config.palm_points,
        16 * config.links,
        3 * config.link_points,
        config.bps_size * (config.pca_components or config.inner_width),
    )
    # A number takes two bytes or more. Larger networks would only fill the memory.
    stored = sum(_existing(folder / name).stat().st_size for name in (GENERATOR_FILE, EVALUATOR_FILE)) // 2
    if max(described) > stored:
        raise WeightsError(
            f"{folder / CONFIG_FILE} describes at least {max(described)} weights, there are at most {stored}"
        )
    try:
        generator = FlowGenerator(config) if config.generator == "flow" else FFHGenerator(config)
        return generator, FFHEvaluator(config)
    except (RuntimeError, TypeError, ValueError, OverflowError, MemoryError) as error:
        first_line = str(error).splitlines()[0]
        raise WeightsError(f"{folder / CONFIG_FILE} describes no network: {first_line}") from error


def _existing(path: Path) -> Path:
    if not path.is_file():
        raise WeightsError(f"{path.name} is missing in {path.parent}")
    return path


def _load_weights(path: Path, digest: str | None, network: nn.Module) -> None:
    data = path.read_bytes()
    if hashlib.sha256(data).hexdigest() != digest:
        raise WeightsError(f"{path} is damaged: its checksum is not the one in {CONFIG_FILE}")
    try:
        network.load_state_dict(safetensors.torch.load(data))
    except (safetensors.SafetensorError, RuntimeError) as error:
        first_line = str(error).splitlines()[0]
        raise WeightsError(f"{path} does not fit the architecture in {CONFIG_FILE}: {first_line}") from error
    if not all(part.is_sound() for part in network.modules() if isinstance(part, PlacedLinks)):
        raise WeightsError(f"{path} describes no hand: its links are not in the order of their parents")
