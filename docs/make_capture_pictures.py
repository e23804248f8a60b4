"""Grasps for real depth captures, one picture each, in docs/images/captures.

Run it from the repository root: python docs/make_capture_pictures.py PATH_TO_CAPTURES

The captures are not part of the repository (licences). PATH_TO_CAPTURES holds `d415_objects` (object clouds
in camera axes with `T_cloud_mesh`, whose third column is up) and depth scenes with `meta.json`.
"""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro
from PIL import Image

from ffhnet.evaluation.picture import grasp_picture
from ffhnet.hands import load_hand
from ffhnet.inference import FFHNet
from ffhnet.perception.camera import Intrinsics
from ffhnet.perception.capture import read_cloud, read_depth
from ffhnet.perception.observation import Observation, observe_depth, observe_object

IMAGES = Path(__file__).parent / "images" / "captures"
OBJECTS = ("cheez_it", "mustard_bottle", "red_mug", "soft_scrub")
SCENES = (
    "realsense_single/mustard",
    "realsense_single/sugar",
    "realsense_single/red_mug",
    "kinect_osd/learn0",
)


@dataclass(frozen=True)
class Options:
    """What the pictures are made from."""

    captures: tyro.conf.Positional[Path]
    """Folder with the captures."""


def observe_cut_out(folder: Path) -> Observation:
    """An object cloud in camera axes, with up from its metadata."""
    up = np.array(json.loads((folder / "meta.json").read_text())["T_cloud_mesh"])[:3, 2]
    return observe_object(read_cloud(folder / "cloud.ply"), up, "camera")


def observe_table_scene(folder: Path) -> Observation:
    """The main object of a depth image; its mask is not used."""
    meta = json.loads((folder / "meta.json").read_text())
    depth = read_depth(folder / "depth.png", meta["depth_scale_m_per_unit"])
    K = np.array(meta["K"])
    intrinsics = Intrinsics(K[0, 0], K[1, 1], K[0, 2], K[1, 2], depth.shape[1], depth.shape[0])
    return observe_depth(depth, intrinsics, np.random.default_rng(0))


def shrink(path: Path) -> None:
    """Keeps 256 colours, a third of the bytes; nobody sees the difference in a shaded picture."""
    with Image.open(path) as picture:
        small = picture.quantize(256)
    small.save(path, optimize=True)


def main(options: Options) -> None:
    """Observe, grasp and draw each capture."""
    network, hand = FFHNet.from_pretrained(), load_hand()
    IMAGES.mkdir(parents=True, exist_ok=True)
    views = {name: observe_cut_out(options.captures / "d415_objects" / name) for name in OBJECTS}
    views |= {name.replace("/", "_"): observe_table_scene(options.captures / name) for name in SCENES}
    for name, observation in views.items():
        grasps = network.grasp(observation)
        assert grasps.probability is not None
        grasp_picture(observation, grasps, hand, IMAGES / f"{name}.png", title=name)
        shrink(IMAGES / f"{name}.png")
        print(f"{name}: {len(observation.cloud)} points, best {grasps.probability[0]:.3f}")


if __name__ == "__main__":
    main(tyro.cli(Options))
