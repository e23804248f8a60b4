"""The flow generator: its path, its frame, and that it learns a distribution it can be checked against."""

from dataclasses import replace

import numpy as np
import torch

from ffhnet.geometry.rotations import rotation_from_6d
from ffhnet.model import GraspTensors, ModelConfig, ObjectTensors
from ffhnet.model.flow import FlowGenerator

torch.set_num_threads(1)
SMALL = ModelConfig(
    num_joints=2, bps_size=64, pca_components=None, palm_points=5, flow_width=48, flow_blocks=2, flow_steps=6
)


def objects(views: int, seed: int = 0) -> ObjectTensors:
    g = torch.Generator().manual_seed(seed)
    return ObjectTensors(torch.rand(views, 64, generator=g) * 0.1, -torch.rand(views, generator=g) * 0.1)


def grasps(views: int, count: int, seed: int = 0) -> GraspTensors:
    g = torch.Generator().manual_seed(seed)
    return GraspTensors(
        rotation_from_6d(torch.randn(views, count, 6, generator=g)),
        0.1 * torch.randn(views, count, 3, generator=g),
        torch.rand(views, count, 2, generator=g),
    )


def source(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def test_samples_are_proper_poses_decided_by_the_seed():
    module = FlowGenerator(SMALL).eval()
    torch.nn.init.normal_(module.head.weight, std=0.1)
    with torch.inference_mode():
        one, same, other = (module.sample(objects(3), 40, source(seed)) for seed in (1, 1, 2))
    rotation = one.rotation.flatten(0, 1)
    torch.testing.assert_close(rotation @ rotation.mT, torch.eye(3).expand(120, 3, 3), atol=1e-4, rtol=0)
    torch.testing.assert_close(torch.linalg.det(rotation), torch.ones(120), atol=1e-4, rtol=0)
    assert torch.equal(one.position, same.position)
    assert not torch.equal(one.position, other.position)


def test_state_holds_a_grasp_without_loss():
    module, wanted = FlowGenerator(SMALL), grasps(3, 9)
    module.set_statistics(wanted)
    state = (module._raw(wanted) - module.mean) / module.deviation
    torch.testing.assert_close(state.flatten(0, 1).mean(0), torch.zeros(11), atol=1e-5, rtol=0)
    back = module.grasps(state)
    for name in ("rotation", "position", "joints"):
        torch.testing.assert_close(getattr(back, name), getattr(wanted, name), atol=1e-5, rtol=0)


def test_views_do_not_see_each_other():
    module = FlowGenerator(SMALL).eval()
    torch.nn.init.normal_(module.head.weight, std=0.1)
    module.geometry.set_points(np.random.default_rng(0).normal(size=(5, 3)) * 0.05)
    both, noise = objects(2), torch.randn(2, 8, 11)
    with torch.inference_mode():
        together = module._velocity(module._look(both), noise, torch.full((2,), 0.4))
        for view in range(2):
            alone = ObjectTensors(both.bps[view : view + 1], both.table_height[view : view + 1])
            single = module._velocity(module._look(alone), noise[view : view + 1], torch.full((1,), 0.4))
            torch.testing.assert_close(single[0], together[view], atol=1e-5, rtol=1e-4)


def test_untrained_flow_carries_noise_nowhere_and_the_loss_is_that_of_a_zero_velocity():
    module, wanted = FlowGenerator(SMALL), grasps(2, 500)
    module.set_statistics(wanted)
    noise, time = torch.randn(2, 500, 11, generator=source(3)), torch.rand(2, generator=source(4))
    torch.nn.init.zeros_(module.head.bias)
    loss = module.loss(objects(2), module.states(wanted), noise, time)
    state = module.states(wanted)
    torch.testing.assert_close(module.grasps(state).position, wanted.position)
    torch.testing.assert_close(loss, (state - noise).square().mean())
    weight = torch.tensor([2.0, 0.0]).expand(500, 2).T
    first = module.loss(objects(2), state, noise, time, weight)
    torch.testing.assert_close(first, (state - noise)[0].square().mean())


def test_flow_learns_two_grasps_per_object_and_not_their_mean():
    """Each object has two grasps on opposite sides, at a distance that its table height tells."""
    torch.manual_seed(0)
    module = FlowGenerator(replace(SMALL, palm_points=0, flow_steps=20))
    views = ObjectTensors(torch.zeros(16, 64), -torch.linspace(0.02, 0.1, 16))
    optimizer = torch.optim.Adam(module.parameters(), lr=3e-3)
    rotation = torch.eye(3).expand(16, 32, 3, 3)

    def batch() -> GraspTensors:
        side = torch.randint(0, 2, (16, 32)) * 2.0 - 1
        x = side * -views.table_height[:, None]
        return GraspTensors(rotation, torch.stack([x, 0 * x, 0 * x], -1), torch.zeros(16, 32, 2))

    module.set_statistics(batch())
    for _ in range(800):
        loss = module.loss(views, module.states(batch()), torch.randn(16, 32, 11), torch.rand(16))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    with torch.inference_mode():
        x = module.sample(views, 200, source()).position[..., 0]
    right_distance = (x.abs() + views.table_height[:, None]).abs() < 0.02
    assert right_distance.float().mean() > 0.7
    assert 0.35 < (x > 0).float().mean() < 0.65


def test_a_low_temperature_keeps_samples_together():
    spreads = []
    for temperature in (1.0, 0.5):
        torch.manual_seed(0)
        module = FlowGenerator(replace(SMALL, temperature=temperature)).eval()
        with torch.inference_mode():
            spreads.append(module.sample(objects(2), 300, source()).position.std(dim=1))
    torch.testing.assert_close(spreads[1], 0.5 * spreads[0])
