"""`GraspTracker`: one grasp to go for while clouds keep arriving, without jumping about."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ffhnet.errors import OptionError
from ffhnet.geometry.rotations import geodesic_angle
from ffhnet.grasps import Grasps
from ffhnet.inference.ffhnet import FFHNet

if TYPE_CHECKING:
    from ffhnet.perception.observation import Observation

NEAR_POSITION = 0.04
"""m between palms, up to which a grasp can stand in for another."""

NEAR_ANGLE = np.radians(30.0)
"""rad between palms, likewise."""


class GraspTracker:
    """Chooses a grasp on every observation of an object that may move, and changes its mind reluctantly.

    The grasp chosen before is carried along with the mean of the visible points and rated again on what is
    seen now. It stays as long as no sample is better by `margin`. When it goes, a near sample that is almost
    as good as the best takes its place, so that the hand follows an object that turns; only where there is
    none it jumps to the best.

    Args:
        network: proposes and rates.
        num: samples per observation.
        margin: of the score, between 0 and 1; 0 takes the best sample every time.
    """

    def __init__(self, network: FFHNet, num: int = 400, margin: float = 0.05):
        if not 0 <= margin <= 1:
            raise OptionError(f"the margin is a difference of probabilities between 0 and 1, got {margin}")
        self._network, self._num, self._margin = network, num, margin
        self._chosen: Grasps | None = None
        self._origin = np.zeros(3)

    def update(self, observation: Observation, seed: int = 0) -> Grasps:
        """The grasp to go for, and after it all samples, best first, in the observation's input frame.

        Args:
            observation: what the camera sees now; all observations must be in the same frame, at rest.
            seed: of the samples; another for each observation explores more.

        Raises:
            OptionError: the observation is in another frame than the ones before.
        """
        samples = self._network.grasp(observation, self._num, seed=seed)
        origin = observation.T_input_view[:3, 3]
        chosen = samples[0]
        if self._chosen is not None:
            carried = self._chosen.replace(position=self._chosen.position + origin - self._origin)
            chosen = self._choose(self._network.evaluate(observation, carried), samples)
        self._chosen, self._origin = chosen, origin.copy()
        return Grasps.concatenate([chosen, samples])

    def reset(self) -> None:
        """Forget the chosen grasp: the next observation is the first one."""
        self._chosen = None

    def _choose(self, carried: Grasps, samples: Grasps) -> Grasps:
        good = samples.score[0] - self._margin
        if carried.score[0] >= good:
            return carried
        distance = np.linalg.norm(samples.position - carried.position, axis=1)
        angle = geodesic_angle(samples.rotation, carried.rotation)
        near = np.flatnonzero((distance <= NEAR_POSITION) & (angle <= NEAR_ANGLE) & (samples.score >= good))
        return samples[int(near[0])] if len(near) else samples[0]
