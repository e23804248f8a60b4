"""Captures and weights to run commands on."""

import numpy as np
import pytest
import torch
from PIL import Image

from ffhnet.geometry.transforms import apply
from ffhnet.hands import load_hand
from ffhnet.model import CheckpointInfo, FFHEvaluator, FlowGenerator, ModelConfig, save_checkpoint
from ffhnet.objects.catalogue import resolve_objects
from ffhnet.perception.camera import REALSENSE_D415, look_at, render_depth
from ffhnet.perception.cloud import depth_to_cloud


@pytest.fixture(scope="session")
def depth():
    """A box on the table, noise-free."""
    box = resolve_objects("thin_box_2000008")[0].load()
    T_world_camera = look_at([-0.5, 0.1, 0.45], [0, 0, 0.06])
    mesh = box.visual.copy().apply_transform(box.resting_poses[0])
    return render_depth([mesh], T_world_camera, REALSENSE_D415)


@pytest.fixture(scope="session")
def depth_png(depth, tmp_path_factory):
    path = tmp_path_factory.mktemp("capture") / "depth.png"
    Image.fromarray(np.rint(1000 * depth).astype(np.uint16)).save(path)
    return path


@pytest.fixture(scope="session")
def object_cloud(depth):
    """The box alone, in the world frame."""
    cloud, _ = depth_to_cloud(depth, REALSENSE_D415)
    in_world = apply(look_at([-0.5, 0.1, 0.45], [0, 0, 0.06]), cloud)
    return in_world[in_world[:, 2] > 0.005]


@pytest.fixture(scope="session")
def cloud_npy(object_cloud, tmp_path_factory):
    path = tmp_path_factory.mktemp("capture") / "cloud.npy"
    np.save(path, object_cloud)
    return path


@pytest.fixture(scope="session")
def untrained_weights(tmp_path_factory):
    """Weights of the right form, drawn at random: what the commands do does not depend on their quality."""
    hand = load_hand()
    config = ModelConfig(num_joints=hand.num_joints, width=32, inner_width=16, flow_width=32)
    info = CheckpointInfo(hand.name, hand.joint_names, tuple(hand.lower), tuple(hand.upper), config)
    torch.manual_seed(0)
    folder = tmp_path_factory.mktemp("weights")
    save_checkpoint(folder, info, FlowGenerator(config), FFHEvaluator(config))
    return folder


@pytest.fixture
def ffhnet(capsys):
    """Run the command in this process: exit status, standard output, standard error."""
    from ffhnet.apps.cli import main

    def run(*arguments):
        status = 0
        try:
            main([str(argument) for argument in arguments])
        except SystemExit as stop:
            status = stop.code or 0
        captured = capsys.readouterr()
        return status, captured.out, captured.err

    return run
