"""Architecture: parameter counts of the public code, and the grouped path against the plain one."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import nn
from torch.nn import functional

from ffhnet.errors import OptionError
from ffhnet.geometry.rotations import rotation_from_6d, rotation_to_6d
from ffhnet.model import FFHEvaluator, FFHGenerator, GraspTensors, ModelConfig, ObjectTensors
from ffhnet.model.pca import Projection
from ffhnet.model.resblock import ConditionedLinear, ResBlock

torch.set_num_threads(1)
SMALL = ModelConfig(
    num_joints=4, bps_size=24, pca_components=6, inner_width=16, width=20, dropout=0.0, palm_points=7
)
SMALL_PAPER = replace(
    SMALL,
    pca_components=None,
    use_table_height=False,
    input_batch_norm=True,
    palm_points=0,
    judge_robustness=False,
)


def count(module: nn.Module) -> int:
    return sum(p.numel() for p in module.parameters())


def random_rotations(*batch: int, seed: int = 0) -> torch.Tensor:
    return rotation_from_6d(torch.randn(*batch, 6, generator=torch.Generator().manual_seed(seed)))


def random_inputs(config: ModelConfig, views: int = 5, grasps: int = 7) -> tuple[ObjectTensors, GraspTensors]:
    g = torch.Generator().manual_seed(1)
    objects = ObjectTensors(
        torch.rand(views, config.bps_size, generator=g), -torch.rand(views, generator=g) * 0.1
    )
    return objects, GraspTensors(
        random_rotations(views, grasps),
        0.1 * torch.randn(views, grasps, 3, generator=g),
        torch.rand(views, grasps, config.num_joints, generator=g),
    )


def with_random_projection(module: FFHGenerator | FFHEvaluator) -> None:
    geometry = getattr(module, "geometry", None)
    if geometry is not None:
        geometry.set_points(np.random.default_rng(1).normal(size=(module.config.palm_points, 3)) * 0.05)
    if module.config.pca_components is not None:
        rng = np.random.default_rng(0)
        shape = (module.config.bps_size, module.config.pca_components)
        module.condition.set_projection(Projection(rng.random(shape[0]), rng.normal(size=shape)))


def test_parameter_counts_are_those_of_the_public_networks():
    paper = ModelConfig.paper()
    assert count(FFHGenerator(paper)) == 13_987_928
    assert count(FFHEvaluator(replace(paper, use_joints=False))) == 10_661_657


def test_paper_evaluator_takes_joints_and_skip_norm_adds_two_vectors_per_block():
    paper = ModelConfig.paper()
    with_joints, public = count(FFHEvaluator(paper)), count(FFHEvaluator(replace(paper, use_joints=False)))
    assert with_joints - public == 15 * (3 * (256 + 512) + 2)
    with_norm = count(FFHEvaluator(replace(paper, skip_batch_norm=True)))
    assert with_norm - with_joints == 3 * 2 * 512


def test_evaluator_ignores_joints_only_when_told_to():
    for use_joints in (True, False):
        config = replace(SMALL, use_joints=use_joints)
        module = FFHEvaluator(config).eval()
        objects, grasps = random_inputs(config)
        moved = replace(grasps, joints=grasps.joints + 0.3)
        same = torch.equal(module(objects, grasps).success, module(objects, moved).success)
        assert same is not use_joints


def test_table_height_matters_only_when_used():
    for used in (True, False):
        config = replace(SMALL, use_table_height=used)
        module = FFHEvaluator(config).eval()
        objects, grasps = random_inputs(config)
        moved = replace(objects, table_height=objects.table_height - 0.05)
        assert torch.equal(module(objects, grasps).success, module(moved, grasps).success) is not used


def test_conditioned_linear_is_a_linear_layer_on_the_concatenation():
    layer = ConditionedLinear(own=3, condition=5, out=4)
    x, condition = torch.randn(2, 6, 3), torch.randn(2, 5)
    joined = torch.cat([x, condition[:, None].expand(2, 6, 5)], dim=-1)
    wanted = functional.linear(joined, layer.linear.weight, layer.linear.bias)
    torch.testing.assert_close(layer(x, condition), wanted)


@pytest.mark.parametrize("skip_batch_norm", [True, False])
def test_resblock_against_a_plain_reading_of_the_paper(skip_batch_norm: bool):
    block = ResBlock(own=3, condition=5, inner=8, out=6, skip_batch_norm=skip_batch_norm)
    x, condition = torch.randn(4, 9, 3), torch.randn(4, 5)
    flat = torch.cat([x, condition[:, None].expand(4, 9, 5)], dim=-1).reshape(36, 8)

    def dense(layer: nn.Linear, value: torch.Tensor) -> torch.Tensor:
        return value @ layer.weight.T + layer.bias

    def norm(value: torch.Tensor) -> torch.Tensor:
        return (value - value.mean(0)) / torch.sqrt(value.var(0, unbiased=False) + 1e-5)

    def leaky(value: torch.Tensor) -> torch.Tensor:
        return torch.where(value > 0, value, 0.2 * value)

    main = norm(dense(block.second, leaky(norm(dense(block.first.linear, flat)))))
    skip = dense(block.skip.linear, flat)
    skip = leaky(norm(skip) if skip_batch_norm else skip)
    torch.testing.assert_close(block(x, condition).reshape(36, 6), leaky(main + skip), atol=1e-5, rtol=1e-4)


@pytest.mark.parametrize("config", [SMALL, SMALL_PAPER], ids=["default", "paper"])
def test_grouped_evaluator_equals_plain_one_with_gradients(config: ModelConfig):
    module = FFHEvaluator(config).train()
    with_random_projection(module)
    objects, grasps = random_inputs(config)
    outputs, gradients = [], []
    for o, g in ((objects, grasps), (objects.repeat(7), grasps.ungrouped())):
        module.zero_grad()
        logits = module(o, g).success
        logits.square().sum().backward()
        outputs.append(logits.flatten())
        gradients.append(torch.cat([p.grad.flatten() for p in module.parameters()]))
    torch.testing.assert_close(outputs[0], outputs[1], atol=1e-5, rtol=1e-4)
    torch.testing.assert_close(gradients[0], gradients[1], atol=1e-3, rtol=1e-3)


@pytest.mark.parametrize("config", [SMALL, SMALL_PAPER], ids=["default", "paper"])
def test_grouped_generator_equals_plain_one(config: ModelConfig):
    module = FFHGenerator(config).train()
    with_random_projection(module)
    objects, grasps = random_inputs(config)
    noise = torch.randn(5, 7, config.latent)
    predicted, latent = module(objects, grasps, noise)
    plain, plain_latent = module(objects.repeat(7), grasps.ungrouped(), noise.flatten(0, 1).unsqueeze(1))
    torch.testing.assert_close(latent.mean.flatten(0, 1), plain_latent.mean[:, 0], atol=1e-5, rtol=1e-4)
    torch.testing.assert_close(predicted.position.flatten(0, 1), plain.position[:, 0], atol=1e-5, rtol=1e-4)
    torch.testing.assert_close(predicted.rotation.flatten(0, 1), plain.rotation[:, 0], atol=1e-4, rtol=1e-4)


def test_generated_rotations_are_proper():
    module = FFHGenerator(SMALL).eval()
    objects, _ = random_inputs(SMALL)
    rotation = module.decode(objects, torch.randn(5, 50, 5)).rotation.flatten(0, 1)
    identity = torch.eye(3).expand(250, 3, 3)
    torch.testing.assert_close(rotation @ rotation.mT, identity, atol=1e-5, rtol=0)
    torch.testing.assert_close(torch.linalg.det(rotation), torch.ones(250), atol=1e-5, rtol=0)


@given(seed=st.integers(0, 10_000), scale=st.floats(0.01, 100))
@settings(max_examples=30, deadline=None)
def test_rotation_6d_round_trip(seed: int, scale: float):
    rotation = random_rotations(8, seed=seed).double()
    six = rotation_to_6d(rotation)
    torch.testing.assert_close(rotation_from_6d(scale * six), rotation, atol=1e-5, rtol=0)


def test_features_are_row_major_and_scaled():
    _, grasps = random_inputs(SMALL)
    features = grasps.features(SMALL, with_joints=True)[2, 3]
    np.testing.assert_array_equal(features[:9].numpy(), grasps.rotation[2, 3].numpy().ravel(order="C"))
    torch.testing.assert_close(features[9:12], grasps.position[2, 3] / 0.1)
    torch.testing.assert_close(features[12:], grasps.joints[2, 3] / 0.5)


def test_impossible_sizes_are_refused():
    with pytest.raises(OptionError, match="pca_components"):
        replace(SMALL, pca_components=25)
    with pytest.raises(OptionError, match="at least 1"):
        replace(SMALL, latent=0)
