"""The networks: FFHGenerator (cVAE) and FFHEvaluator of section III, FlowGenerator, losses, checkpoints."""

from ffhnet.model.checkpoint import Checkpoint, CheckpointInfo, load_checkpoint, save_checkpoint
from ffhnet.model.config import ModelConfig
from ffhnet.model.evaluator import FFHEvaluator
from ffhnet.model.flow import FlowGenerator
from ffhnet.model.generator import FFHGenerator
from ffhnet.model.tensors import GraspTensors, ObjectTensors

__all__ = [
    "Checkpoint",
    "CheckpointInfo",
    "FFHEvaluator",
    "FFHGenerator",
    "FlowGenerator",
    "GraspTensors",
    "ModelConfig",
    "ObjectTensors",
    "load_checkpoint",
    "save_checkpoint",
]
