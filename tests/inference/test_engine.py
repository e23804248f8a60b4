"""The engine against the plain modules, with weights and statistics that are nowhere at their start."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import nn

from ffhnet.errors import OptionError
from ffhnet.geometry.basis import basis_points
from ffhnet.geometry.rotations import rotation_from_6d
from ffhnet.hands.link_points import LinkPoints
from ffhnet.inference import engine as engine_module
from ffhnet.inference.distance_grid import GridMaker, PalmReader
from ffhnet.inference.engine import Engine
from ffhnet.inference.ffhnet import REALTIME, find_weights
from ffhnet.inference.precision import product_dtype
from ffhnet.model import CheckpointInfo, FFHEvaluator, FFHGenerator, GraspTensors, ModelConfig, ObjectTensors
from ffhnet.model.checkpoint import Checkpoint, load_checkpoint
from ffhnet.model.flow import FlowGenerator
from ffhnet.model.local_geometry import LocalGeometry
from ffhnet.model.placed_links import PlacedLinks
from ffhnet.model.resblock import ConditionedLinear

torch.set_num_threads(1)

DEFAULT = ModelConfig(
    num_joints=4, bps_size=256, pca_components=20, inner_width=32, width=48, flow_width=40, palm_points=16
)
PAPER = replace(ModelConfig.paper(4), bps_size=256, inner_width=32, width=48)
CONFIGS = {
    "default": DEFAULT,
    "student": replace(DEFAULT, flow_width=24, flow_blocks=2, flow_steps=2, flow_palm_points=7),
    "other points": replace(DEFAULT, palm_points=13, flow_palm_points=3, flow_steps=3, temperature=0.5),
    "adams": replace(DEFAULT, flow_solver="adams"),
    "blind flow": replace(DEFAULT, palm_points=0, use_table_height=False, use_joints=False),
    "flow without points": replace(DEFAULT, flow_palm_points=0, judge_robustness=False),
    "links": replace(DEFAULT, links=6, link_points=9),
    "links summed up": replace(DEFAULT, links=6, link_points=9, local_width=12),
    "no table": replace(DEFAULT, use_table_height=False, flow_steps=1),
    "paper": PAPER,
    "public code": replace(PAPER, use_joints=False),
    "raw with table": replace(PAPER, use_table_height=True, skip_batch_norm=True, palm_points=9),
    "cvae on projection": replace(DEFAULT, generator="cvae", input_batch_norm=True, latent=3),
}
FULL = {
    "default": ModelConfig.default(),
    "student": ModelConfig.default().student(),
    "paper": ModelConfig.paper(),
}


def scramble(network: nn.Module, seed: int) -> None:
    """Give every weight and statistic a value of its own; what goes through layers keeps its size."""
    g = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for module in reversed(list(network.modules())):
            if isinstance(module, nn.Linear):
                module.weight.normal_(0, module.in_features**-0.5, generator=g)
                module.bias.normal_(0, 0.2, generator=g)
            if isinstance(module, ConditionedLinear):
                # The condition is much wider than the grasps' part and must not drown it.
                module.linear.weight[:, : module.own] *= (module.linear.in_features / module.own) ** 0.5
            if isinstance(module, nn.BatchNorm1d):
                module.running_mean.normal_(0, 0.3, generator=g)
                module.running_var.uniform_(0.3, 2, generator=g)
            if isinstance(module, (nn.BatchNorm1d, nn.LayerNorm)):
                module.weight.uniform_(-1.5, 1.5, generator=g)
                module.bias.normal_(0, 0.3, generator=g)
            if isinstance(module, LocalGeometry):
                module.points.uniform_(-0.08, 0.08, generator=g)
            if isinstance(module, PlacedLinks):
                module.take(random_links(module, g))
        config = network.config
        if config.pca_components is not None:
            network.condition.bps_mean.uniform_(0, 0.2, generator=g)
            network.condition.projection.normal_(0, 5 * config.bps_size**-0.5, generator=g)
        if isinstance(network, FlowGenerator):
            network.mean.normal_(0, 0.2, generator=g)
            network.mean[[0, 4]] += 2
            network.deviation.uniform_(0.1, 0.3, generator=g)
        # As of trained networks, the two columns of a rotation are seldom so short that rounding turns it.
        if isinstance(network, FFHGenerator):
            network.rotation_head.bias[[0, 4]] += 3


def random_links(module: PlacedLinks, g: torch.Generator) -> LinkPoints:
    """A hand of two fingers on a palm, with points, axes, couplings and opening of chance."""

    def random(*shape: int, size: float = 1.0) -> np.ndarray:
        return size * torch.randn(*shape, generator=g).numpy()

    links, points = len(module.parent), len(module.points)
    joints = len(module.opened)
    fixed = np.tile(np.eye(4), (links, 1, 1))
    fixed[:, :3, :3] = rotation_from_6d(torch.randn(links, 6, generator=g)).numpy()
    fixed[:, :3, 3] = random(links, 3, size=0.04)
    axis = random(links, 3)
    return LinkPoints(
        parent=np.maximum(np.arange(links) - 2, 0),
        fixed=fixed,
        axis=axis / np.linalg.norm(axis, axis=1, keepdims=True),
        leader=np.arange(links) % joints,
        powers=random(links, 5, size=0.5),
        opened=random(joints),
        closes=np.arange(joints) % 2 == 0,
        points=random(points, 3, size=0.02),
        link=np.arange(points) % links,
    )


def make_checkpoint(config: ModelConfig) -> Checkpoint:
    names = tuple(str(i) for i in range(config.num_joints))
    info = CheckpointInfo("some_hand", names, (-1.0,) * len(names), (1.0,) * len(names), config)
    generator = FlowGenerator(config) if config.generator == "flow" else FFHGenerator(config)
    evaluator = FFHEvaluator(config)
    scramble(generator, 1)
    scramble(evaluator, 2)
    return Checkpoint(info, generator.eval(), evaluator.eval())


def make_objects(config: ModelConfig, seed: int = 0, views: int = 1) -> ObjectTensors:
    """Distances to a few random points near the middle, and a table."""
    g = torch.Generator().manual_seed(seed)
    basis = torch.from_numpy(basis_points(config.bps_size).copy()).float()
    clouds = 0.05 * torch.randn(views, 30, 3, generator=g)
    return ObjectTensors(torch.cdist(basis, clouds).amin(dim=-1), -0.1 * torch.rand(views, generator=g))


def make_grasps(config: ModelConfig, num: int) -> GraspTensors:
    g = torch.Generator().manual_seed(5)
    return GraspTensors(
        rotation_from_6d(torch.randn(1, num, 6, generator=g)),
        0.1 * torch.randn(1, num, 3, generator=g),
        torch.rand(1, num, config.num_joints, generator=g),
    )


def assert_same_answers(
    checkpoint: Checkpoint, objects: ObjectTensors, num: int, spread: float = 0.01
) -> None:
    """Equal poses and probabilities; `spread` is how much the latter must at least vary."""
    seen = Engine(checkpoint).look(objects)
    with torch.inference_mode():
        plain = checkpoint.generator.sample(objects, num, torch.Generator().manual_seed(3))
    fast = seen.sample(num, torch.Generator().manual_seed(3))
    for name in ("rotation", "position", "joints"):
        torch.testing.assert_close(getattr(fast, name), getattr(plain, name), atol=1e-5, rtol=0)
    assert plain.position.std() > 0.01
    anywhere = make_grasps(checkpoint.info.model, num)
    pairs = zip(vars(plain).values(), vars(anywhere).values(), strict=True)
    grasps = GraspTensors(*(torch.cat(pair, dim=1) for pair in pairs))
    with torch.inference_mode():
        logits = checkpoint.evaluator(objects, grasps)
    rated = seen.rate(grasps)
    for name in ("success", "robust", "collision"):
        value, wanted = getattr(rated, name), getattr(logits, name)
        assert (value is None) is (wanted is None)
        if wanted is not None:
            torch.testing.assert_close(value.sigmoid(), wanted.sigmoid(), atol=1e-5, rtol=0)
            assert wanted.sigmoid().std() > spread


@pytest.mark.parametrize("name", CONFIGS)
def test_same_answers_as_the_plain_modules(name: str):
    checkpoint = make_checkpoint(CONFIGS[name])
    for seed in (0, 1):
        assert_same_answers(checkpoint, make_objects(CONFIGS[name], seed), num=70)


def cylinder() -> ObjectTensors:
    """A can that stands on the table."""
    angle, height = torch.linspace(-1.6, 1.6, 30), torch.linspace(-0.07, 0.07, 20)
    x, y = -0.035 * angle.cos(), 0.035 * angle.sin()
    cloud = torch.stack([x.repeat(20), y.repeat(20), height.repeat_interleave(30)], dim=-1)
    basis = torch.from_numpy(basis_points().copy()).float()
    return ObjectTensors(torch.cdist(basis, cloud).amin(dim=-1)[None], torch.tensor([-0.075]))


@pytest.mark.parametrize("weights", [None, REALTIME])
def test_same_answers_with_the_packages_weights(weights: str | None):
    checkpoint = load_checkpoint(find_weights(weights))
    # How much trained networks tell these grasps apart is not this test's matter.
    assert_same_answers(checkpoint, cylinder(), num=200, spread=0)


@pytest.mark.parametrize("name", FULL)
def test_same_answers_at_full_size(name: str):
    assert_same_answers(make_checkpoint(FULL[name]), make_objects(FULL[name]), num=50)


@pytest.mark.parametrize("dtype", [torch.bfloat16, torch.float16])
def test_reduced_precision_gives_nearly_the_same_grasps(dtype: torch.dtype, monkeypatch: pytest.MonkeyPatch):
    checkpoint, objects = load_checkpoint(find_weights(None)), cylinder()
    exact = Engine(checkpoint).look(objects)
    monkeypatch.setattr(engine_module, "product_dtype", lambda *_: dtype)
    reduced = Engine(checkpoint, "reduced").look(objects)
    wanted, got = (seen.sample(100, torch.Generator().manual_seed(0)) for seen in (exact, reduced))
    off = (got.position - wanted.position).norm(dim=-1)
    assert 0 < off.mean() < 5e-4
    assert torch.equal(exact.rate(wanted).robust.argsort()[0, -1:], exact.rate(got).robust.argsort()[0, -1:])


def test_precision_is_reduced_only_where_it_pays(monkeypatch: pytest.MonkeyPatch):
    cpu, gpu = torch.device("cpu"), torch.device("cuda")
    assert product_dtype("exact", 384, gpu) == product_dtype("reduced", 128, gpu) == torch.float32
    assert product_dtype("reduced", 384, gpu) == torch.float16
    for instructions, dtype in (({"avx512_bf16": True}, torch.bfloat16), ({"avx2": True}, torch.float32)):
        monkeypatch.setattr(torch.cpu, "get_capabilities", lambda found=instructions: found, raising=False)
        assert product_dtype("reduced", 384, cpu) == dtype
    with pytest.raises(OptionError, match="one of exact, reduced, got 'fp8'"):
        product_dtype("fp8", 384, cpu)


def test_chunks_join_to_the_same_grasps(monkeypatch: pytest.MonkeyPatch):
    checkpoint, objects = make_checkpoint(DEFAULT), make_objects(DEFAULT)
    seen = Engine(checkpoint).look(objects)
    whole = seen.sample(50, torch.Generator().manual_seed(0))
    rated = seen.rate(whole)
    monkeypatch.setattr(engine_module, "CHUNK", 16)
    parts = seen.sample(50, torch.Generator().manual_seed(0))
    torch.testing.assert_close(parts.position, whole.position, atol=1e-6, rtol=0)
    torch.testing.assert_close(seen.rate(whole).robust, rated.robust, atol=1e-5, rtol=0)
    assert seen.rate(GraspTensors(*(part[:, :0] for part in vars(whole).values()))).success.shape == (1, 0)


def test_threads_do_not_disturb_each_other():
    engine = Engine(make_checkpoint(DEFAULT))
    objects = [make_objects(DEFAULT, seed) for seed in range(4)]

    def answer(index: int) -> tuple[torch.Tensor, torch.Tensor]:
        seen = engine.look(objects[index % 4])
        grasps = seen.sample(300, torch.Generator().manual_seed(index % 4))
        return grasps.position, seen.rate(grasps).success

    alone = [answer(index) for index in range(4)]
    with ThreadPoolExecutor(4) as pool:
        for index, together in enumerate(pool.map(answer, range(24))):
            for value, wanted in zip(together, alone[index % 4], strict=True):
                torch.testing.assert_close(value, wanted, atol=0, rtol=0)


def test_looking_at_another_object_leaves_the_first_alone():
    engine = Engine(make_checkpoint(DEFAULT))
    seen = engine.look(make_objects(DEFAULT, 0))
    before = seen.sample(20, torch.Generator().manual_seed(0)).position
    engine.look(make_objects(DEFAULT, 1))
    assert torch.equal(before, seen.sample(20, torch.Generator().manual_seed(0)).position)


def test_grid_holds_the_plain_features_near_and_beyond_its_border():
    geometry = LocalGeometry(12, 256)
    geometry.points.copy_(0.08 * torch.randn(12, 3, generator=torch.Generator().manual_seed(0)))
    objects = make_objects(DEFAULT)
    grasps = make_grasps(DEFAULT, 300)
    plain = geometry(geometry.field(objects.bps), objects, grasps)[0]
    reader = PalmReader(geometry)
    raw = torch.full((300, geometry.width), torch.nan)
    grid = GridMaker(geometry.field)(objects.bps[0], objects.table_height[0])
    reader.write(grid, grasps.rotation[0], grasps.position[0], raw)
    torch.testing.assert_close(raw * reader.affine.scale + reader.affine.offset, plain, atol=1e-5, rtol=0)
    place = grasps.rotation[0] @ geometry.points.T + grasps.position[0].unsqueeze(-1)
    assert (place.abs() > 0.2).any()
    assert (place.abs() < 0.1).any()


def test_refusals():
    checkpoint = make_checkpoint(DEFAULT)
    with pytest.raises(OptionError, match="one object at a time, got 2"):
        Engine(checkpoint).look(make_objects(DEFAULT, views=2))
    checkpoint.evaluator.train()
    with pytest.raises(OptionError, match="evaluation mode"):
        Engine(checkpoint)
