"""A trained flow learns from the grasps that the evaluator believes in, among the data's and among its own.

A success in the data holds whatever the camera saw of the object; whether it can be told from a view that it
will hold is another matter. So a success counts in a view as much as the evaluator believes in it there, to
some power. And of the flow's own samples those are learned that the evaluator believes in: so the flow keeps
to what can be known, the views of one object teaching it different things. That needs no physics. Samples are
chosen, not moved by the evaluator's gradient, which would lead to where it errs (`flow_distillation.py`).
"""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from ffhnet.training.batches import BatchMaker
from ffhnet.training.judged_flow import JudgedFlow
from ffhnet.training.loop import seeded
from ffhnet.training.tasks import flow_times
from ffhnet.training.view_chunks import view_chunks

TEMPERATURE = 1.0
"""Of the flow's own samples: more varied than in use, so that there is something to choose from."""

OWN_SHARE = 0.6
"""Of a batch's grasps, the share of own samples; the others are successes of the data."""


class FlowRefinementTask(JudgedFlow):
    """Flow matching on the grasps of `JudgedFlow`'s views, those first that its evaluator believes in."""

    _batches: BatchMaker
    _samples: tuple[Float[np.ndarray, "V P S"], Float[np.ndarray, "V P"]]

    def loss(self, step: int, rng: np.random.Generator) -> tuple[Tensor, dict[str, float]]:
        """Flow matching loss of one batch, in which each view counts alike."""
        own = round(OWN_SHARE * self.config.grasps)
        batch = self._batches.draw(rng, self.config.views, self.config.grasps - own).to(self._device)
        with torch.no_grad():
            log_weight = -self.config.belief * self._doubt(batch.objects, batch.grasps)
        weight = log_weight.softmax(dim=1) * log_weight.shape[1]
        grasps = torch.cat([self.module.states(batch.grasps), self._own(rng, batch.views, own)], dim=1)
        weight = torch.cat([weight, torch.ones(len(weight), own, device=self._device)], dim=1)
        noise = torch.randn(grasps.shape).to(self._device)
        time = flow_times(len(grasps), self._device)
        total = self.module.loss(batch.objects, grasps, noise, time, weight)
        return total, {"loss": total.item()}

    def _own(self, rng: np.random.Generator, views: np.ndarray, count: int) -> Float[Tensor, "V G S"]:
        """Own samples of some views, drawn with a probability that rises with the evaluator's belief."""
        all_states, all_doubts = self._samples
        # The smallest of exponential times whose rates are the weights: a draw without the others.
        times = rng.exponential(size=(len(views), count, self.config.pairs))
        log_weight = -self.config.belief * all_doubts[views].astype(np.float64)
        pick = (np.log(times) - log_weight[:, None]).argmin(axis=2)
        chosen = np.take_along_axis(all_states[views], pick[:, :, None], axis=1)
        return torch.from_numpy(chosen).float().to(self._device)

    def prepare(self, progress: bool) -> None:
        """Batches of the data's successes; P samples of the teacher for each view, and the doubt in them."""
        self._batches = BatchMaker.for_generator(
            self._data, self.config.min_local_success, self.config.min_margin
        )
        count, pairs = self._data.num_views, self.config.pairs
        states = np.empty((count, pairs, self._teacher.state_width), np.float16)
        doubt = np.empty((count, pairs), np.float16)
        with torch.inference_mode(), seeded(self.config.seed):
            for views in view_chunks(count, "own samples", progress):
                objects = self._objects(self._data, views)
                *_, last = self._teacher.path(objects, self._noise(len(views), pairs, TEMPERATURE))
                states[views] = last.half().cpu().numpy()
                doubt[views] = self._doubt(objects, self._teacher.grasps(last)).half().cpu().numpy()
        self._samples = states, doubt
