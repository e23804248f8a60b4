"""What commands that look at a capture share: options of the input and the networks, and the look itself."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from ffhnet.apps.console import absent
from ffhnet.errors import OptionError

if TYPE_CHECKING:
    import numpy as np

    from ffhnet.hands import Hand
    from ffhnet.inference import FFHNet
    from ffhnet.perception.camera import Intrinsics
    from ffhnet.perception.observation import Observation

INPUT_HELP = (
    "Point cloud in metres (.pcd .ply .npy .npz), or depth image (.png .npy .npz) with its intrinsics. "
    "A depth image, or a cloud without --up and --world, shows a whole scene with a table in the camera's "
    "frame: x right, y down, z forward. With one of the two a cloud is a single object, already cut out."
)

Vector = Annotated[tuple[float, float, float] | None, absent("X Y Z")]
File = Annotated[Path | None, absent("FILE")]


@dataclass(frozen=True, kw_only=True)
class CaptureOptions:
    """What the file of a capture shows."""

    up: Vector = None
    """The cloud is an object already cut out; this is the direction against gravity in its frame."""
    world: bool = False
    """The cloud is an object already cut out, in a frame whose z axis points up."""
    camera: Vector = None
    """Where the camera stood in the frame of a cut-out cloud, metres."""
    intrinsics: Annotated[tuple[float, float, float, float] | None, absent("FX FY CX CY")] = None
    """Focal lengths and centre of a depth image, pixels."""
    depth_scale: Annotated[float | None, absent("S", "0.001 for integers, 1 for floats")] = None
    """Metres per unit of a depth image."""
    mask: File = None
    """PNG of the depth image's size; the object is where it is not 0."""
    object: int = 0
    """Which object of a scene, 0 = the main one."""


@dataclass(frozen=True, kw_only=True)
class NetworkOptions:
    """Which networks sample, and how."""

    num: int = 400
    """Grasps to sample."""
    threshold: float = 0.0
    """Leave out grasps below this probability."""
    seed: int = 0
    """Same seed, same grasps."""
    weights: Annotated[Path | None, absent("DIR", "those that come with the package")] = None
    """Folder of trained weights, or "realtime": small networks that come with the package, too."""
    hand: Annotated[str | None, absent("NAME", "the one that the weights are for")] = None
    """Name or TOML file of the hand."""
    precision: Literal["exact", "reduced"] = "exact"
    """Reduced is faster with large networks where the processor multiplies 16-bit numbers, else the same."""


def load_network(options: NetworkOptions) -> tuple[FFHNet, Hand]:
    """The networks and their hand; raises WeightsError and HandError."""
    from ffhnet.hands import load_hand
    from ffhnet.inference import FFHNet

    wanted = None if options.hand is None else load_hand(options.hand)
    network = FFHNet.from_pretrained(
        options.weights, hand=wanted.name if wanted else None, precision=options.precision
    )
    return network, wanted or load_hand(network.info.hand)


def check_capture(path: Path, options: CaptureOptions) -> None:
    """Raises OptionError where two options, or an option and the kind of input, do not go together."""
    cut_out = options.up is not None or options.world
    if options.up is not None and options.world:
        raise OptionError("give --up or --world, not both")
    if options.camera is not None and not cut_out:
        raise OptionError("--camera is for an object already cut out: give --up or --world with it")
    if _is_depth(path, options):
        if cut_out:
            raise OptionError("--up and --world are for point clouds; a depth image is a whole scene")
    elif options.mask is not None or options.depth_scale is not None:
        raise OptionError("--mask and --depth-scale are for depth images: give --intrinsics FX FY CX CY")
    if options.object != 0 and (cut_out or options.mask is not None):
        raise OptionError("--object chooses from a scene: not with --up, --world or --mask")


def observe_capture(path: Path, options: CaptureOptions, rng: np.random.Generator) -> Observation:
    """The observation of a depth image, a cut-out object or a scene.

    Args:
        path: the capture's file.
        options: what it shows; checked by `check_capture`.
        rng: source of randomness for finding the table.

    Raises:
        InputFileError, CloudError, SceneError, OptionError: the file cannot be used.
    """
    import numpy as np

    from ffhnet.perception.capture import read_cloud
    from ffhnet.perception.cloud import validate_object
    from ffhnet.perception.observation import observe_depth, observe_object, observe_scene

    if _is_depth(path, options):
        depth, intrinsics = _read_depth(path, options)
        mask = None if options.mask is None else _read_mask(options.mask)
        return observe_depth(depth, intrinsics, rng, mask=mask, object_index=options.object)
    cloud = read_cloud(path)
    if options.up is None and not options.world:
        return observe_scene(cloud, rng, object_index=options.object)
    cloud = validate_object(cloud)
    up = np.array([0.0, 0.0, 1.0]) if options.up is None else np.array(options.up)
    direction = None if options.camera is None else cloud.mean(axis=0) - np.array(options.camera)
    frame = "world" if options.world else "camera"
    return observe_object(cloud, up, frame, viewing_direction=direction)


def observe_all(path: Path, options: CaptureOptions, rng: np.random.Generator) -> list[Observation]:
    """All objects of a scene, the main one first; otherwise as `observe_capture`."""
    from ffhnet.perception.capture import read_cloud
    from ffhnet.perception.cloud import depth_to_cloud
    from ffhnet.perception.observation import observe_objects

    if options.up is not None or options.world or options.mask is not None or options.object != 0:
        raise OptionError("--all-objects is for a whole scene: not with --up, --world, --mask or --object")
    scene = depth_to_cloud(*_read_depth(path, options))[0] if _is_depth(path, options) else read_cloud(path)
    return observe_objects(scene, rng)


def _read_depth(path: Path, options: CaptureOptions) -> tuple[np.ndarray, Intrinsics]:
    """A depth image (m) and its camera."""
    from ffhnet.perception.camera import Intrinsics
    from ffhnet.perception.capture import read_depth

    depth = read_depth(path, options.depth_scale)
    if options.intrinsics is None:
        raise OptionError(f"{path}: a depth image needs --intrinsics FX FY CX CY")
    return depth, Intrinsics(*options.intrinsics, width=depth.shape[1], height=depth.shape[0])


def _is_depth(path: Path, options: CaptureOptions) -> bool:
    return options.intrinsics is not None or path.suffix.lower() == ".png"


def _read_mask(path: Path) -> np.ndarray:
    """H×W booleans of a mask image; raises InputFileError."""
    import numpy as np
    from PIL import Image

    from ffhnet.files import reading
    from ffhnet.perception.capture import check_pixels

    with reading(path, "a mask image"), Image.open(path) as image:
        check_pixels(path, image.width * image.height)
        pixels = np.asarray(image)
    return pixels != 0 if pixels.ndim == 2 else (pixels[..., :3] != 0).any(axis=-1)
