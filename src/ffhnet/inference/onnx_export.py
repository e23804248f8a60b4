"""Writing both networks as ONNX, and beside them what a program needs to use them (the extra `onnx`)."""

from __future__ import annotations

import json
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from ffhnet.errors import OptionError
from ffhnet.files import write_atomically
from ffhnet.geometry.basis import BASIS_RADIUS, BASIS_SEED
from ffhnet.inference.onnx_networks import OnnxEvaluator, OnnxGenerator
from ffhnet.inference.weights_calibration import load_calibration
from ffhnet.model.checkpoint import CheckpointInfo, load_checkpoint

OPSET = 20
"""The first in which a grid with three axes can be sampled."""

GENERATOR_FILE, EVALUATOR_FILE, DESCRIPTION_FILE = "generator.onnx", "evaluator.onnx", "description.json"

TRACED = 3
"""Grasps that go through a network while it is recorded; the file takes any number."""

MEANINGS = {
    "bps": "distance in m from each basis point to the nearest visible point of the object",
    "table_height": "z of the table in the view frame in m, negative",
    "noise": "standard normal numbers; the weights' temperature is in the graph",
    "rotation": "palm axes as columns, view frame",
    "position": "palm origin in m, view frame",
    "joints": "joint angles in rad, in the order of joint_names",
    "probability": "of success in nominal physics, calibrated if the weights are",
    "robustness": "the same with unknown mass, friction and a palm slightly off; what to rank by, if there",
}


@dataclass(frozen=True)
class Exported:
    """The files of an export."""

    generator: Path
    evaluator: Path
    description: Path


def export_onnx(weights: Path, out: Path) -> Exported:
    """Write `generator.onnx`, `evaluator.onnx` and `description.json`.

    Args:
        weights: folder of trained weights.
        out: folder for the files; it is made if there is none.

    Raises:
        WeightsError: the weights are missing or damaged.
        OptionError: the folder cannot be made.
    """
    checkpoint, calibration = load_checkpoint(weights), load_calibration(weights)
    info = checkpoint.info
    generator = OnnxGenerator(checkpoint.generator, info)
    evaluator = OnnxEvaluator(
        checkpoint.evaluator,
        None if calibration is None else calibration.probability,
        None if calibration is None else calibration.robustness,
    )
    look = torch.full((info.model.bps_size,), 0.1), torch.full((1,), -0.1)
    noise = torch.zeros(TRACED, generator.noise_width)
    palms = torch.eye(3).repeat(TRACED, 1, 1), torch.zeros(TRACED, 3)
    joints = torch.zeros(TRACED, len(info.joint_names))
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OptionError(f"{out}: cannot make the folder: {error.strerror}") from error
    files = Exported(out / GENERATOR_FILE, out / EVALUATOR_FILE, out / DESCRIPTION_FILE)
    _write(generator, (*look, noise), generator.INPUTS, generator.OUTPUTS, files.generator)
    _write(evaluator, (*look, *palms, joints), evaluator.INPUTS, evaluator.outputs, files.evaluator)
    text = json.dumps(_description(info, generator.noise_width, files), indent=1) + "\n"
    write_atomically(files.description, text.encode())
    return files


def _write(
    network: nn.Module, example: tuple[Tensor, ...], inputs: Sequence[str], outputs: Sequence[str], path: Path
) -> None:
    """One network as a file, checked."""
    import onnx  # here, so that the extra is needed by nobody else

    per_grasp = [name for name in (*inputs, *outputs) if name not in ("bps", "table_height")]
    # Torch's newer exporter takes a minute for the same graph, and needs one more package.
    with warnings.catch_warnings(), torch.inference_mode():
        warnings.filterwarnings("ignore", category=DeprecationWarning)
        warnings.filterwarnings("ignore", category=torch.jit.TracerWarning)
        torch.onnx.export(
            network.eval(),
            example,
            path,
            input_names=list(inputs),
            output_names=list(outputs),
            dynamic_axes={name: {0: "grasps"} for name in per_grasp},
            opset_version=OPSET,
            dynamo=False,
        )
    onnx.checker.check_model(path)


def _description(info: CheckpointInfo, noise_width: int, files: Exported) -> dict[str, Any]:
    """What goes in, what comes out, in which frame, and how the basis is made."""
    import onnx

    joints = len(info.joint_names)
    shapes: dict[str, list[int | str]] = {
        "bps": [info.model.bps_size],
        "table_height": [1],
        "noise": ["grasps", noise_width],
        "rotation": ["grasps", 3, 3],
        "position": ["grasps", 3],
        "joints": ["grasps", joints],
        "probability": ["grasps"],
        "robustness": ["grasps"],
    }

    def table(file: Path) -> dict[str, Any]:
        # Without table heights the networks have one input less.
        graph = onnx.load(file).graph
        return {
            kind: {
                entry.name: {"shape": shapes[entry.name], "meaning": MEANINGS[entry.name]}
                for entry in entries
            }
            for kind, entries in (("inputs", graph.input), ("outputs", graph.output))
        }

    return {
        "hand": info.hand,
        "joint_names": info.joint_names,
        "joint_lower": info.joint_lower,
        "joint_upper": info.joint_upper,
        "view_frame": "origin: mean of the object's visible points; z: against gravity; "
        "x: the camera's viewing direction, projected on the table",
        "basis": {
            "size": info.model.bps_size,
            "radius": BASIS_RADIUS,
            "recipe": f"r = numpy.random.RandomState({BASIS_SEED}); d = r.normal(size=(size, 3)); "
            "d /= norm of each row; points = d * r.uniform(size=(size, 1)) ** (1 / 3) * radius",
        },
        **{file.name: table(file) for file in (files.generator, files.evaluator)},
    }
