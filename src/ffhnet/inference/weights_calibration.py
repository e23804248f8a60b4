"""What was measured about trained weights so that their probabilities tell the truth: `calibration.json`."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from ffhnet.errors import WeightsError
from ffhnet.files import write_atomically
from ffhnet.grasps import Grasps
from ffhnet.inference.calibration import Calibration
from ffhnet.inference.novelty import NoveltyLimit
from ffhnet.inference.risk import RiskTable
from ffhnet.model.checkpoint import weights_digest

CALIBRATION_FILE = "calibration.json"


@dataclass(frozen=True)
class WeightsCalibration:
    """Maps of probabilities, and the record of best grasps from which a risk can be chosen.

    Attributes:
        probability: map of the success probability in nominal physics.
        robustness: map of the probability of success under varied physics; None where it is not predicted.
        risk: score and success, under varied physics, of the best grasp of each view.
        source: the objects and the command that made it, for people.
        novelty: from where on a view is unlike what the networks know; None where it was not measured.
    """

    probability: Calibration
    robustness: Calibration | None
    risk: RiskTable
    source: str
    novelty: NoveltyLimit | None = None

    def apply(self, grasps: Grasps) -> Grasps:
        """The same grasps with calibrated probabilities; a ranking by either stays as it is."""
        robust = grasps.robustness
        if robust is not None and self.robustness is not None:
            robust = self.robustness.apply(robust)
        assert grasps.probability is not None
        return grasps.replace(probability=self.probability.apply(grasps.probability), robustness=robust)


def save_calibration(folder: Path, calibration: WeightsCalibration) -> None:
    """Write a calibration beside the weights that it was measured with."""
    content = {
        "source": calibration.source,
        "weights_sha256": weights_digest(folder),
        "probability": calibration.probability.to_json(),
        "robustness": None if calibration.robustness is None else calibration.robustness.to_json(),
        "risk": calibration.risk.to_json(),
        "novelty": None if calibration.novelty is None else calibration.novelty.to_json(),
    }
    write_atomically(folder / CALIBRATION_FILE, (json.dumps(content) + "\n").encode())


def load_calibration(folder: Path) -> WeightsCalibration | None:
    """The calibration of the weights in a folder, None if there is none.

    Raises:
        WeightsError: the file is damaged, or was made with other weights.
    """
    path = folder / CALIBRATION_FILE
    if not path.is_file():
        return None
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if content["weights_sha256"] != weights_digest(folder):
            raise WeightsError(f"{path} was made with other weights: remove it, or run `ffhnet calibrate`")
        robustness = content["robustness"]
        # Files of before this field existed do without.
        novelty = content.get("novelty")
        return WeightsCalibration(
            probability=Calibration.from_json(content["probability"]),
            robustness=None if robustness is None else Calibration.from_json(robustness),
            risk=RiskTable.from_json(content["risk"]),
            source=str(content["source"]),
            novelty=None if novelty is None else NoveltyLimit.from_json(novelty),
        )
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise WeightsError(f"{path} is not a calibration: {error}") from error
