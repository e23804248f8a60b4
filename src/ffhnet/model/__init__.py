"""The networks of section III: FFHGenerator (cVAE), FFHEvaluator, their losses and checkpoints."""

from ffhnet.model.checkpoint import Checkpoint, CheckpointInfo, load_checkpoint, save_checkpoint
from ffhnet.model.config import ModelConfig
from ffhnet.model.evaluator import FFHEvaluator
from ffhnet.model.generator import FFHGenerator
from ffhnet.model.tensors import GraspTensors, ObjectTensors

__all__ = [
    "Checkpoint",
    "CheckpointInfo",
    "FFHEvaluator",
    "FFHGenerator",
    "GraspTensors",
    "ModelConfig",
    "ObjectTensors",
    "load_checkpoint",
    "save_checkpoint",
]
