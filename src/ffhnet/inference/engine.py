"""`Engine`: the answers of the plain networks, for one object at a time and many grasps, but faster.

The object is one vector that hundreds of grasps share, and a norm at inference is affine. So the object's
part of every layer is computed once, norms and fixed scales are folded into weights, and only the grasps'
part is computed for every grasp, in chunks. The modules of `ffhnet.model` stay the reference.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from ffhnet.errors import OptionError
from ffhnet.inference.block_engine import DecoderEngine, EvaluatorEngine
from ffhnet.inference.distance_grid import GridMaker
from ffhnet.inference.flow_engine import FlowEngine
from ffhnet.inference.precision import Precision, product_dtype
from ffhnet.model.checkpoint import Checkpoint
from ffhnet.model.evaluator import EvaluatorLogits
from ffhnet.model.flow import FlowGenerator
from ffhnet.model.tensors import GraspTensors, ObjectTensors

CHUNK = 512
"""Grasps that go through a network together: more would only take more memory."""


class Engine:
    """Both networks of a checkpoint, as they are now: training them further does not reach the engine.

    One engine may be used by several threads.

    Args:
        checkpoint: the networks.
        precision: of the products in the flow; all else is exact.
    """

    def __init__(self, checkpoint: Checkpoint, precision: Precision = "exact"):
        generator, evaluator = checkpoint.generator, checkpoint.evaluator
        if generator.training or evaluator.training:
            raise OptionError("an engine wants networks in evaluation mode: call .eval() first")
        self._conditions = generator.condition, evaluator.condition
        self._temperature = checkpoint.info.model.temperature
        geometry = evaluator.geometry
        with torch.inference_mode():
            self._generator: FlowEngine | DecoderEngine
            if isinstance(generator, FlowGenerator):
                device = generator.frequency.device
                dtype = product_dtype(precision, generator.config.flow_width, device)
                self._generator = FlowEngine(generator, dtype)
            else:
                self._generator = DecoderEngine(generator)
            self._evaluator = EvaluatorEngine(evaluator)
            self._grid = None if geometry is None else GridMaker(geometry.field)
        buffers = [list(condition.buffers()) for condition in self._conditions]
        self._same_condition = all(torch.equal(*pair) for pair in zip(*buffers, strict=True))

    @torch.inference_mode()
    def look(self, objects: ObjectTensors) -> SeenObject:
        """All that the networks make of an object before they see a grasp.

        Args:
            objects: a single view.
        """
        if len(objects.bps) != 1:
            raise OptionError(f"the engine looks at one object at a time, got {len(objects.bps)}")
        grid = None if self._grid is None else self._grid(objects.bps[0], objects.table_height[0])
        of_generator, of_evaluator = self._conditions
        first = of_generator(objects)[0]
        second = first if self._same_condition else of_evaluator(objects)[0]
        generate, rate = self._generator.look(first, grid), self._evaluator.look(second, grid)
        return SeenObject(generate, rate, self._generator.noise_width, self._temperature, first.device)


@dataclass(frozen=True)
class SeenObject:
    """One object through the eyes of the networks. Results have the leading axis of a single view.

    Attributes:
        generate: grasps from noise.
        evaluate: what `EvaluatorLogits` holds, for each of grasps.
        noise_width: numbers of noise in a grasp.
        temperature: standard deviation of the noise.
        device: of the networks.
    """

    generate: Callable[[Float[Tensor, "G S"]], GraspTensors]
    evaluate: Callable[[GraspTensors], tuple[Float[Tensor, "1 G"], ...]]
    noise_width: int
    temperature: float
    device: torch.device

    @torch.inference_mode()
    def sample(self, num: int, source: torch.Generator, temperature: float | None = None) -> GraspTensors:
        """What the generator's own `sample` gives for the same `source` (on the CPU), up to rounding.

        With another temperature than the weights' own, samples vary more or less.
        """
        noise = torch.randn(1, num, self.noise_width, generator=source)[0]
        noise = (self.temperature if temperature is None else temperature) * noise.to(self.device)
        return GraspTensors.joined([self.generate(rows) for rows in noise.split(CHUNK)])

    @torch.inference_mode()
    def rate(self, grasps: GraspTensors) -> EvaluatorLogits:
        """What the evaluator says of the grasps (of one view, on the networks' device), up to rounding."""
        split = zip(
            *(part.split(CHUNK, dim=1) for part in (grasps.rotation, grasps.position, grasps.joints)),
            strict=True,
        )
        parts = [self.evaluate(GraspTensors(*chunk)) for chunk in split]
        return EvaluatorLogits(*(torch.cat(logits, dim=1) for logits in zip(*parts, strict=True)))
