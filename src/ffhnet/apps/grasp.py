"""`ffhnet grasp`: a capture in, ranked grasps out."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from ffhnet.apps.console import absent, busy, print_table
from ffhnet.errors import OptionError

if TYPE_CHECKING:
    import numpy as np

    from ffhnet.grasps import Grasps
    from ffhnet.hands import Hand
    from ffhnet.perception.observation import Observation

_SHOWN = 10

_INPUT_HELP = (
    "Point cloud in metres (.pcd .ply .npy .npz), or depth image (.png .npy .npz) with its intrinsics. "
    "A depth image, or a cloud without --up and --world, shows a whole scene with a table in the camera's "
    "frame: x right, y down, z forward. With one of the two a cloud is a single object, already cut out."
)

_Vector = Annotated[tuple[float, float, float] | None, absent("X Y Z")]
_File = Annotated[Path | None, absent("FILE")]


@dataclass(frozen=True)
class GraspOptions:
    """Grasps for one object, ranked by the probability that they hold."""

    input: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(help=_INPUT_HELP)]
    up: _Vector = None
    """The cloud is an object already cut out; this is the direction against gravity in its frame."""
    world: bool = False
    """The cloud is an object already cut out, in a frame whose z axis points up."""
    camera: _Vector = None
    """Where the camera stood in the frame of a cut-out cloud, metres."""
    intrinsics: Annotated[tuple[float, float, float, float] | None, absent("FX FY CX CY")] = None
    """Focal lengths and centre of a depth image, pixels."""
    depth_scale: Annotated[float | None, absent("S", "0.001 for integers, 1 for floats")] = None
    """Metres per unit of a depth image."""
    mask: _File = None
    """PNG of the depth image's size; the object is where it is not 0."""
    object: int = 0
    """Which object of a scene, 0 = the main one."""
    num: int = 400
    """Grasps to sample."""
    threshold: float = 0.0
    """Leave out grasps below this probability."""
    max_failure: Annotated[float | None, absent("P")] = None
    """Abstain where the best grasp cannot be promised to fail at most this often, with 95 % confidence."""
    seed: int = 0
    """Same seed, same grasps."""
    weights: Annotated[Path | None, absent("DIR", "those that come with the package")] = None
    """Folder of trained weights."""
    hand: Annotated[str | None, absent("NAME", "the one that the weights are for")] = None
    """Name or TOML file of the hand."""
    out: _File = None
    """Write all grasps to this .json or .npz, best first, in the frame of the input."""
    plot: _File = None
    """Write a picture to this .png."""


def run(options: GraspOptions) -> None:
    """Observe, sample, rank; then show and write what was asked for."""
    from ffhnet.files import check_output
    from ffhnet.grasps_file import SUFFIXES, save_grasps

    _check_combination(options)
    if options.out is not None:
        check_output(options.out, SUFFIXES)
    if options.plot is not None:
        check_output(options.plot, (".png",))
    with busy("loading"):
        from ffhnet.hands import load_hand
        from ffhnet.inference import FFHNet

        wanted = None if options.hand is None else load_hand(options.hand)
        observation = _observe(options)
        network = FFHNet.from_pretrained(options.weights, hand=wanted.name if wanted else None)
        hand = wanted or load_hand(network.info.hand)
    with busy("sampling and ranking grasps"):
        grasps = network.grasp(observation, options.num, options.seed, options.threshold)
    refusal = None
    if options.max_failure is not None:
        refusal = network.control_risk(options.max_failure).refusal(grasps.score)
        grasps = grasps if refusal is None else grasps[:0]
    # Files before anything is printed: a reader that closes the pipe early must not cost them.
    if options.out is not None:
        save_grasps(grasps, options.out)
    if options.plot is not None:
        if len(grasps) == 0:
            raise OptionError(
                f"nothing to plot: {refusal or f'no grasp reaches the threshold {options.threshold:g}'}"
            )
        with busy("drawing"):
            from ffhnet.evaluation.picture import grasp_picture

            grasp_picture(observation, grasps, hand, options.plot, title=options.input.name)
    if refusal is None:
        _show(grasps, hand)
    else:
        print(refusal)
    if options.out is not None:
        print(f"{len(grasps)} grasps written to {options.out}")
    if options.plot is not None:
        print(f"picture written to {options.plot}")


def _is_depth(options: GraspOptions) -> bool:
    return options.intrinsics is not None or options.input.suffix.lower() == ".png"


def _check_combination(options: GraspOptions) -> None:
    """Raises OptionError where two options, or an option and the kind of input, do not go together."""
    cut_out = options.up is not None or options.world
    if options.up is not None and options.world:
        raise OptionError("give --up or --world, not both")
    if options.camera is not None and not cut_out:
        raise OptionError("--camera is for an object already cut out: give --up or --world with it")
    if _is_depth(options):
        if cut_out:
            raise OptionError("--up and --world are for point clouds; a depth image is a whole scene")
    elif options.mask is not None or options.depth_scale is not None:
        raise OptionError("--mask and --depth-scale are for depth images: give --intrinsics FX FY CX CY")
    if options.object != 0 and (cut_out or options.mask is not None):
        raise OptionError("--object chooses from a scene: not with --up, --world or --mask")


def _observe(options: GraspOptions) -> Observation:
    """The observation of a depth image, a cut-out object or a scene."""
    import numpy as np

    from ffhnet.perception.capture import read_cloud, read_depth
    from ffhnet.perception.observation import observe_depth, observe_object, observe_scene

    rng = np.random.default_rng(options.seed)
    if _is_depth(options):
        from ffhnet.perception.camera import Intrinsics

        depth = read_depth(options.input, options.depth_scale)
        if options.intrinsics is None:
            raise OptionError(f"{options.input}: a depth image needs --intrinsics FX FY CX CY")
        intrinsics = Intrinsics(*options.intrinsics, width=depth.shape[1], height=depth.shape[0])
        mask = None if options.mask is None else _read_mask(options.mask)
        return observe_depth(depth, intrinsics, rng, mask=mask, object_index=options.object)
    cloud = read_cloud(options.input)
    if options.up is None and not options.world:
        return observe_scene(cloud, rng, object_index=options.object)
    up = np.array([0.0, 0.0, 1.0]) if options.up is None else np.array(options.up)
    direction = None if options.camera is None else cloud.mean(axis=0) - np.array(options.camera)
    frame = "world" if options.world else "camera"
    return observe_object(cloud, up, frame, viewing_direction=direction)


def _read_mask(path: Path) -> np.ndarray:
    """H×W booleans of a mask image; raises InputFileError."""
    import numpy as np
    from PIL import Image

    from ffhnet.errors import InputFileError

    try:
        with Image.open(path) as image:
            pixels = np.asarray(image)
    except FileNotFoundError:
        raise InputFileError(f"{path}: no such file") from None
    except (OSError, SyntaxError, ValueError) as error:
        raise InputFileError(f"{path}: not a mask image, or damaged ({error})") from error
    return pixels != 0 if pixels.ndim == 2 else (pixels[..., :3] != 0).any(axis=-1)


def _show(grasps: Grasps, hand: Hand) -> None:
    """The best grasps as a table."""
    import numpy as np

    if len(grasps) == 0 or grasps.probability is None:
        print("no grasp reaches the threshold")
        return
    flexion = np.degrees(grasps.joints[:, hand.closing.moves > 0].mean(axis=1))
    rows = [
        [
            str(i + 1),
            f"{grasps.probability[i]:.3f}",
            "-" if grasps.robustness is None else f"{grasps.robustness[i]:.3f}",
            " ".join(f"{value:+.3f}" for value in grasps.position[i]),
            " ".join(f"{value:+.2f}" for value in grasps.rotation[i, :, 0]),
            f"{flexion[i]:.0f}",
        ]
        for i in range(min(_SHOWN, len(grasps)))
    ]
    print_table(
        f"{len(grasps)} grasps of {grasps.hand}, the best {len(rows)}, in the {grasps.frame} frame",
        ["rank", "probability", "robust", "palm position (m)", "approach direction", "mean flexion (°)"],
        rows,
    )
