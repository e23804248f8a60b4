"""A flow of few steps learns to end where a larger one ends, and may then be guided by the evaluator.

The *student* starts from the same noise as its *teacher* and shall be where the teacher is at the student's
times (progressive distillation, Salimans and Ho 2022, with the student's own states as inputs). A path counts
as much as the evaluator believes in the grasp at its end: from noise that leads the teacher to a failure, the
student goes where its neighbours go. With guidance
the evaluator joins in: its gradient with respect to the grasp moves samples away from collisions and towards
grasps that hold, while the first loss keeps their variety. It also moves them to where the evaluator errs, so
that what it says of the samples is worth less.
"""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from ffhnet.training.judged_flow import JudgedFlow
from ffhnet.training.loop import seeded
from ffhnet.training.view_chunks import view_chunks


class FlowDistillationTask(JudgedFlow):
    """Learn a teacher's paths on the views of a data set, guided by an evaluator.

    The teacher's number of steps is a multiple of the student's; all processes of a run see all `pairs`; the
    trials of the data are not looked at.
    """

    _paths: tuple[Float[np.ndarray, "V K P S"], Float[np.ndarray, "V P"]]

    def loss(self, step: int, rng: np.random.Generator) -> tuple[Tensor, dict[str, float]]:
        """Distance to the teacher's states and, after the start, what the evaluator says of the grasps."""
        all_states, all_beliefs = self._paths
        views = rng.choice(self._data.num_views, self.config.views)
        pairs = rng.choice(self.config.pairs, min(self.config.grasps, self.config.pairs), replace=False)
        states = torch.from_numpy(all_states[views][:, :, pairs]).float().to(self._device)
        belief = torch.from_numpy(all_beliefs[views][:, pairs]).float().to(self._device)
        objects = self._objects(self._data, views)
        reached = torch.stack(list(self.module.path(objects, states[:, 0])), dim=1)
        off = (reached - states[:, 1:]).square().mean(dim=(1, 3))
        distance = (belief * off).sum() / belief.sum()
        if self.config.guidance == 0 or step < self.config.guidance_start * self.config.steps:
            return distance, {"loss": distance.item(), "distance": distance.item()}
        blame = self._doubt(objects, self.module.grasps(reached[:, -1])).mean()
        total = distance + self.config.guidance * blame
        return total, {"loss": total.item(), "distance": distance.item(), "blame": blame.item()}

    def prepare(self, progress: bool) -> None:
        """P paths for each view (noise, and the teacher at the student's times), and belief in their ends."""
        steps, pairs = self.module.config.flow_steps, self.config.pairs
        every = self._teacher.config.flow_steps // steps
        count = self._data.num_views
        states = np.empty((count, 1 + steps, pairs, self._teacher.state_width), np.float16)
        belief = np.empty((count, pairs), np.float16)
        with torch.inference_mode(), seeded(self.config.seed):
            for views in view_chunks(count, "paths of the teacher", progress):
                objects = self._objects(self._data, views)
                noise = self._noise(len(views), pairs, self.module.config.temperature)
                path = list(self._teacher.path(objects, noise))[every - 1 :: every]
                doubt = self._doubt(objects, self.module.grasps(path[-1]))
                states[views] = torch.stack([noise, *path], dim=1).half().cpu().numpy()
                belief[views] = torch.exp(-doubt).half().cpu().numpy()
        self._paths = states, belief
