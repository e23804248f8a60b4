"""Equations 3 to 5 against numbers worked out in plain numpy."""

import numpy as np
import torch

from ffhnet.model import GraspTensors
from ffhnet.model.evaluator import EvaluatorLogits
from ffhnet.model.generator import LatentGaussian
from ffhnet.model.losses import AUXILIARY_WEIGHT, evaluator_loss, generator_loss, kl_divergence

RNG = np.random.default_rng(0)


def tensors(shape: tuple[int, ...]) -> tuple[np.ndarray, torch.Tensor]:
    array = RNG.normal(size=shape)
    return array, torch.from_numpy(array)


def test_generator_loss_against_numpy():
    views, grasps = 3, 4
    values = {n: (tensors((views, grasps, *s)), tensors((views, grasps, *s))) for n, s in
              {"rotation": (3, 3), "position": (3,), "joints": (15,)}.items()}  # fmt: skip
    predicted = GraspTensors(**{n: v[0][1] for n, v in values.items()})
    wanted = GraspTensors(**{n: v[1][1] for n, v in values.items()})
    (mean, mean_t), (log_variance, log_variance_t) = tensors((views, grasps, 5)), tensors((views, grasps, 5))
    loss = generator_loss(predicted, wanted, LatentGaussian(mean_t, log_variance_t))

    square = {n: np.mean((v[0][0] - v[1][0]) ** 2) for n, v in values.items()}
    kl = 0.0
    for m, lv in zip(mean.reshape(-1, 5), log_variance.reshape(-1, 5), strict=True):
        kl += sum(0.5 * (m[i] ** 2 + np.exp(lv[i]) - 1 - lv[i]) for i in range(5)) / (views * grasps)
    total = 1 * square["rotation"] + 100 * square["position"] + 10 * square["joints"] + 5e-3 * kl
    np.testing.assert_allclose(loss.kl.item(), kl)
    np.testing.assert_allclose(loss.total(5e-3).item(), total)


def test_kl_matches_torch_distributions_and_vanishes_at_the_prior():
    _, mean = tensors((2, 3, 5))
    _, log_variance = tensors((2, 3, 5))
    normal = torch.distributions.Normal
    reference = torch.distributions.kl_divergence(normal(mean, (0.5 * log_variance).exp()), normal(0.0, 1.0))
    torch.testing.assert_close(kl_divergence(LatentGaussian(mean, log_variance)), reference.sum(-1).mean())
    zero = torch.zeros(2, 3, 5)
    assert kl_divergence(LatentGaussian(zero, zero)).item() == 0


def test_latent_sample_is_mean_plus_deviation_times_noise():
    latent = LatentGaussian(torch.full((1, 1, 5), 2.0), torch.full((1, 1, 5), np.log(9.0)))
    torch.testing.assert_close(latent.sample(torch.ones(1, 1, 5)), torch.full((1, 1, 5), 5.0))


def cross_entropy(logits, label):
    p = 1 / (1 + np.exp(-logits))
    return -np.mean(label * np.log(p) + (1 - label) * np.log(1 - p))


def test_evaluator_loss_with_soft_labels():
    logits, logits_t = tensors((3, 4))
    label = RNG.random((3, 4))
    unknown = torch.full((3, 4), torch.nan)
    loss = evaluator_loss(EvaluatorLogits(logits_t), torch.from_numpy(label), unknown, torch.zeros(3, 4))
    np.testing.assert_allclose(loss.item(), cross_entropy(logits, label))


def test_evaluator_loss_of_three_outputs_leaves_out_what_was_not_repeated():
    (success, success_t), (robust, robust_t), (collision, collision_t) = (tensors((3, 4)) for _ in range(3))
    label, held, collided = RNG.random((3, 4)), RNG.random((3, 4)), RNG.integers(2, size=(3, 4))
    held[:, 2] = np.nan
    loss = evaluator_loss(
        EvaluatorLogits(success_t, robust_t, collision_t),
        *(torch.from_numpy(array.astype(float)) for array in (label, held, collided)),
    )
    known = ~np.isnan(held)
    parts = ((success, label), (robust[known], held[known]), (collision, collided))
    wanted = [cross_entropy(*part) for part in parts]
    np.testing.assert_allclose(loss.item(), wanted[0] + AUXILIARY_WEIGHT * (wanted[1] + wanted[2]))
