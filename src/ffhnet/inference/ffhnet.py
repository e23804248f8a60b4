"""`FFHNet`: from an observation to ranked grasps."""

from __future__ import annotations

import weakref
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch
from jaxtyping import Float

from ffhnet.errors import HandError, OptionError, WeightsError
from ffhnet.geometry.transforms import invert
from ffhnet.grasps import Grasps
from ffhnet.hands import DEFAULT_HAND
from ffhnet.inference import hub
from ffhnet.inference.engine import Engine, SeenObject
from ffhnet.inference.novelty import novelty
from ffhnet.inference.precision import Precision
from ffhnet.inference.risk import RiskControl
from ffhnet.inference.weights_calibration import WeightsCalibration, load_calibration
from ffhnet.model.checkpoint import Checkpoint, CheckpointInfo, load_checkpoint
from ffhnet.model.config import check_temperature
from ffhnet.model.tensors import GraspTensors, ObjectTensors

if TYPE_CHECKING:
    from ffhnet.perception.observation import Observation

VIEW_FRAME = "view"

REALTIME = "realtime"
"""Name of shipped weights whose networks take a thirtieth of the multiplications (`ffhnet distil`)."""

_FARTHEST = 10.0
"""m: an observation of something farther off than this was made of stray points."""


class FFHNet:
    """FFHGenerator and FFHEvaluator of one hand (figure 1).

    `generator` and `evaluator` are the plain networks; grasps come from an `Engine` made of them.
    """

    def __init__(
        self,
        checkpoint: Checkpoint,
        device: torch.device | str = "cpu",
        calibration: WeightsCalibration | None = None,
        precision: Precision = "exact",
    ):
        self.calibration = calibration
        self.info: CheckpointInfo = checkpoint.info
        self.device = torch.device(device)
        self.generator = checkpoint.generator.to(self.device)
        self.evaluator = checkpoint.evaluator.to(self.device)
        self._engine = Engine(checkpoint, precision)
        self._looked: tuple[weakref.ref[Observation], SeenObject] | None = None
        self._joint_lower = np.array(self.info.joint_lower)
        self._joint_upper = np.array(self.info.joint_upper)

    @classmethod
    def from_pretrained(
        cls,
        path_or_name: str | Path | None = None,
        hand: str | None = None,
        device: torch.device | str | None = None,
        precision: Precision = "exact",
    ) -> FFHNet:
        """Load trained weights.

        Args:
            path_or_name: as in `find_weights`; None takes the package's own for the hand.
            hand: name of the hand that the weights must be for; None takes any.
            device: None takes CUDA where there is one, else the CPU.
            precision: "reduced" is faster where the processor has instructions for it (`precision.py`); the
                grasps are the same within a millimetre or so, and nearly always the same one is best.

        Raises:
            WeightsError: missing or damaged weights, or those of another hand.
            MissingExtraError: weights of a model hub without the extra `hub`.
        """
        if device is None:
            device = "cuda" if torch.cuda.is_available() else "cpu"
        folder = find_weights(path_or_name, hand)
        return cls(load_checkpoint(folder, hand=hand), device, load_calibration(folder), precision)

    def grasp(
        self,
        observation: Observation,
        num: int = 400,
        seed: int = 0,
        threshold: float = 0.0,
        temperature: float | None = None,
    ) -> Grasps:
        """Sample grasps, rate them, and rank them.

        Args:
            observation: what the camera sees of the object.
            num: grasps to sample.
            seed: of the latent samples; the same seed gives the same grasps.
            threshold: grasps below this success probability are left out, possibly all.
            temperature: standard deviation of the samples' noise. Above the weights' own, which None takes,
                they vary more, and fewer of them hold.

        Returns:
            Grasps in the observation's input frame, best first: by `robustness` where the evaluator predicts
            it, else by `probability`.
        """
        if not 0 <= threshold <= 1:
            raise OptionError(f"the threshold is a probability between 0 and 1, got {threshold}")
        if temperature is not None:
            check_temperature(temperature)
        seen, source = self._look(observation), torch.Generator().manual_seed(seed)
        rated = self._rate(seen, self._sample(seen, num, source, temperature))
        assert rated.probability is not None
        ranked = rated[rated.probability >= threshold].ranked()
        return ranked.to_frame(observation.T_input_view, observation.frame)

    def generate(self, observation: Observation, num: int, generator: torch.Generator) -> Grasps:
        """Raw samples of the FFHGenerator in the view frame, neither rated nor ranked.

        Args:
            observation: what the camera sees of the object.
            num: grasps to sample.
            generator: source of the latent samples z ~ N(0, I), on the CPU.
        """
        return self._sample(self._look(observation), num, generator)

    def evaluate(self, observation: Observation, grasps: Grasps) -> Grasps:
        """The same grasps, in the same order, with `probability` and, if it is predicted, `robustness`.

        Args:
            observation: what the camera sees of the object.
            grasps: in the observation's input frame.

        Raises:
            HandError: grasps of another hand or with other joints.
            OptionError: grasps in another frame.
        """
        if (grasps.hand, grasps.joint_names) != (self.info.hand, self.info.joint_names):
            raise HandError(f"these networks rate grasps of {self.info.hand}, got {grasps.hand}'s joints")
        if grasps.frame != observation.frame:
            raise OptionError(f"wanted grasps in frame {observation.frame!r}, got {grasps.frame!r}")
        in_view = grasps.to_frame(invert(observation.T_input_view), VIEW_FRAME)
        rated = self._rate(self._look(observation), in_view)
        return grasps.replace(probability=rated.probability, robustness=rated.robustness)

    def control_risk(self, max_failure: float, confidence: float = 0.95) -> RiskControl:
        """The threshold on the best grasp's score that keeps executed failures below a bound (`risk.py`).

        Args:
            max_failure: bound of P(failure | executed) with unknown mass, friction and a palm slightly off.
            confidence: probability that the bound holds.

        Raises:
            WeightsError: these weights were not calibrated.
        """
        if self.calibration is None:
            raise WeightsError("a risk can only be chosen with calibrated weights: run `ffhnet calibrate`")
        return self.calibration.risk.control(max_failure, confidence)

    def novelty(self, observation: Observation) -> float | None:
        """How unlike all that the networks were trained on an object looks: above 1 its grasps mean nothing.

        Returns:
            In units of the limit that few views of wanted objects pass (`novelty.py`); None where the weights
            were not calibrated for it.
        """
        limit = None if self.calibration is None else self.calibration.novelty
        distance = novelty(self.evaluator.condition, observation.bps)
        return None if limit is None or distance is None else distance / limit.limit

    def _sample(
        self, seen: SeenObject, num: int, source: torch.Generator, temperature: float | None = None
    ) -> Grasps:
        if num < 1:
            raise OptionError(f"the number of grasps must be at least 1, got {num}")
        raw = seen.sample(num, source, temperature)
        return Grasps(
            rotation=raw.rotation[0].double().cpu().numpy(),
            position=raw.position[0].double().cpu().numpy(),
            joints=np.clip(raw.joints[0].double().cpu().numpy(), self._joint_lower, self._joint_upper),
            joint_names=self.info.joint_names,
            hand=self.info.hand,
            frame=VIEW_FRAME,
        )

    def _rate(self, seen: SeenObject, in_view: Grasps) -> Grasps:
        def tensor(array: np.ndarray) -> torch.Tensor:
            return torch.as_tensor(array, dtype=torch.float32, device=self.device).unsqueeze(0)

        logits = seen.rate(
            GraspTensors(tensor(in_view.rotation), tensor(in_view.position), tensor(in_view.joints))
        )
        rated = in_view.replace(
            probability=_probability(logits.success),
            robustness=None if logits.robust is None else _probability(logits.robust),
        )
        return rated if self.calibration is None else self.calibration.apply(rated)

    def _look(self, observation: Observation) -> SeenObject:
        """The observation through the networks' eyes; the one looked at last is not looked at again."""
        if self._looked is not None and self._looked[0]() is observation:
            return self._looked[1]
        seen = self._look_anew(observation)
        self._looked = weakref.ref(observation), seen
        return seen

    def _look_anew(self, observation: Observation) -> SeenObject:
        wanted = self.info.model.bps_size
        if np.shape(observation.bps) != (wanted,):
            raise OptionError(f"these networks take {wanted} BPS values, got {np.shape(observation.bps)}")
        farthest = max(np.abs(observation.bps).max(), abs(observation.table_height))
        if not farthest <= _FARTHEST:
            raise OptionError(f"an object and its table lie within {_FARTHEST:g} m, got {farthest:g} m")
        bps = torch.as_tensor(observation.bps, dtype=torch.float32, device=self.device)
        height = torch.tensor([observation.table_height], dtype=torch.float32, device=self.device)
        return self._engine.look(ObjectTensors(bps.unsqueeze(0), height))


def _probability(logits: Float[torch.Tensor, "1 N"]) -> Float[np.ndarray, " N"]:
    return torch.sigmoid(logits[0].double()).cpu().numpy()


def shipped_weights() -> Path:
    """Folder of the weights that come with the package."""
    return Path(str(resources.files("ffhnet"))) / "weights"


def find_weights(path_or_name: str | Path | None, hand: str | None = None) -> Path:
    """The folder of weights that a user names.

    Args:
        path_or_name: a folder; else the name of weights that ship with the package; else a repository of a
            model hub, "org/name" or "org/name@revision" (`hub.py`). None takes the package's own.
        hand: name of the hand whose weights None stands for; the default one if not given.

    Raises:
        WeightsError: there is none.
        MissingExtraError: it can only be a repository, and the extra `hub` is not installed.
    """
    if path_or_name is None:
        if hand in (None, DEFAULT_HAND):
            return shipped_weights()
        folder = shipped_weights() / str(hand)
        if not folder.is_dir():
            raise WeightsError(
                f"no weights for the hand {hand!r} come with the package: name a folder of them"
            )
        return folder
    for folder in (Path(path_or_name), shipped_weights() / path_or_name):
        if folder.is_dir():
            return folder
    name = Path(path_or_name).as_posix()
    if hub.is_repository(name):
        return hub.download(name)
    raise WeightsError(f"no folder and no shipped weights of the name {name!r}")
