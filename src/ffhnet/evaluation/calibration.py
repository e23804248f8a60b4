"""Does the predicted probability tell the truth: AUROC, calibration error and the reliability diagram."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from ffhnet.evaluation import bootstrap
from ffhnet.evaluation.cells import Drawn, Estimate
from ffhnet.metrics import ReliabilityBin, auroc, reliability

BINS = 10


@dataclass(frozen=True)
class Calibration:
    """The evaluator on the generator's own samples (the drawn ones), start collisions as failures.

    Attributes:
        auroc: of all samples.
        auroc_executed: without start collisions.
        auroc_within_view: mean over the views that have both successes and failures; what ranking the grasps
            of one view needs, which telling easy objects from hard ones does not help.
        ece: expected calibration error over `BINS` bins.
        bins: the reliability diagram.
    """

    auroc: Estimate
    auroc_executed: Estimate
    auroc_within_view: Estimate
    ece: Estimate
    bins: tuple[ReliabilityBin, ...]

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "auroc_all": self.auroc.to_json(),
            "auroc_executed": self.auroc_executed.to_json(),
            "auroc_within_view": self.auroc_within_view.to_json(),
            "ece": self.ece.to_json(),
            "reliability": [
                {
                    "low": b.low,
                    "high": b.high,
                    "count": b.count,
                    "predicted": b.predicted,
                    "observed": b.observed,
                }
                for b in self.bins
            ],
        }


def measure_calibration(views: Sequence[Sequence[Drawn]]) -> Calibration:
    """Of the drawn samples of each view of each object."""
    objects = [_joined(of_object) for of_object in views]
    label, probability, _ = (np.concatenate(column) for column in zip(*objects, strict=True))
    return Calibration(
        auroc=_auroc([(y, p) for y, p, _ in objects]),
        auroc_executed=_auroc([(y[e], p[e]) for y, p, e in objects]),
        auroc_within_view=_within_view(views),
        ece=_ece(objects),
        bins=reliability(label, probability, BINS),
    )


def _joined(drawn: Sequence[Drawn]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return (
        np.concatenate([d.tries.success for d in drawn]).astype(float),
        np.concatenate([d.probability for d in drawn]),
        np.concatenate([d.tries.executed for d in drawn]),
    )


def _auroc(objects: Sequence[tuple[np.ndarray, np.ndarray]]) -> Estimate:
    """Pooled AUROC; in a draw of objects, every pair counts as often as its two objects together."""
    wins, pairs = _pairs_between(objects)
    value = float(wins.sum() / pairs.sum()) if pairs.sum() else float("nan")
    draws = bootstrap.object_draws(len(objects)).astype(float)
    above, below = (np.einsum("di,ij,dj->d", draws, m, draws, optimize=True) for m in (wins, pairs))
    rates = np.divide(above, below, out=np.full(len(draws), np.nan), where=below > 0)
    return Estimate(value, bootstrap.interval(rates, len(objects)))


def _pairs_between(
    objects: Sequence[tuple[np.ndarray, np.ndarray]],
) -> tuple[Float[np.ndarray, "O O"], Float[np.ndarray, "O O"]]:
    """How often a success of object i is rated above a failure of object j (ties half), of how many pairs."""
    label = np.concatenate([y for y, _ in objects])
    owner = np.repeat(np.arange(len(objects)), [len(y) for y, _ in objects])
    values, place = np.unique(np.concatenate([p for _, p in objects]), return_inverse=True)
    successes, failures = np.zeros((2, len(objects), len(values)))
    np.add.at(successes, (owner, place), label)
    np.add.at(failures, (owner, place), 1 - label)
    below = np.cumsum(failures, axis=1) - failures / 2
    return successes @ below.T, np.outer(successes.sum(axis=1), failures.sum(axis=1))


def _within_view(views: Sequence[Sequence[Drawn]]) -> Estimate:
    each = [[auroc(d.tries.success.astype(float), d.probability) for d in of_object] for of_object in views]
    known = [np.array(values)[np.isfinite(values)] for values in each]
    sums, counts = np.array([v.sum() for v in known]), np.array([len(v) for v in known])
    value = float(sums.sum() / counts.sum()) if counts.sum() else float("nan")
    return Estimate(value, bootstrap.interval(bootstrap.ratio(sums, counts), len(views)))


def _ece(objects: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]]) -> Estimate:
    """Sum over bins of |sum of (predicted - observed)| by the number of samples."""
    gaps = np.array(
        [[b.count * (b.predicted - b.observed) for b in reliability(y, p, BINS)] for y, p, _ in objects]
    )
    gaps = np.nan_to_num(gaps)
    sizes = np.array([len(y) for y, _, _ in objects])
    draws = bootstrap.object_draws(len(objects))
    rates = np.abs(draws @ gaps).sum(axis=1) / (draws @ sizes)
    value = float(np.abs(gaps.sum(axis=0)).sum() / sizes.sum())
    return Estimate(value, bootstrap.interval(rates, len(objects)))
