"""Grasps for real depth captures, one picture each, in docs/images/captures.

Run it from the repository root: python docs/make_capture_pictures.py PATH_TO_CAPTURES

The captures are not part of the repository (licences); `ffhnet.evaluation.captures` says how they are kept.
"""

from dataclasses import dataclass
from pathlib import Path

import tyro
from PIL import Image

from ffhnet.evaluation.captures import read_capture
from ffhnet.evaluation.picture import grasp_picture
from ffhnet.hands import load_hand
from ffhnet.inference import FFHNet

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


def shrink(path: Path) -> None:
    """Keeps 256 colours, a third of the bytes; nobody sees the difference in a shaded picture."""
    with Image.open(path) as picture:
        small = picture.quantize(256)
    small.save(path, optimize=True)


def main(options: Options) -> None:
    """Observe, grasp and draw each capture."""
    network, hand = FFHNet.from_pretrained(), load_hand()
    IMAGES.mkdir(parents=True, exist_ok=True)
    folders = {name: f"d415_objects/{name}" for name in OBJECTS}
    folders |= {name.replace("/", "_"): name for name in SCENES}
    for name, folder in folders.items():
        observation = read_capture(options.captures / folder).observe()[0]
        grasps = network.grasp(observation)
        assert grasps.probability is not None
        grasp_picture(observation, grasps, hand, IMAGES / f"{name}.png", title=name)
        shrink(IMAGES / f"{name}.png")
        print(f"{name}: {len(observation.cloud)} points, best {grasps.probability[0]:.3f}")


if __name__ == "__main__":
    main(tyro.cli(Options))
