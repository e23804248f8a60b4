"""Every door through which the bytes of others come in: a small valid input, and what opens it."""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import random
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import torch
import trimesh
from mutations import mutate
from PIL import Image
from pypcd4 import PointCloud

from ffhnet.apps import hand as hand_command
from ffhnet.apps.capture_options import _read_mask as read_mask
from ffhnet.apps.ros2.from_messages import cloud_from_message, depth_from_message
from ffhnet.dataset import columns, exchange, records
from ffhnet.errors import MessageError
from ffhnet.geometry.rotations import matrix_from_rotation_vector
from ffhnet.grasps import Grasps
from ffhnet.grasps_file import load_grasps, save_grasps
from ffhnet.hands import load_hand
from ffhnet.inference import FFHNet
from ffhnet.inference.calibration import Calibration
from ffhnet.inference.novelty import NoveltyLimit
from ffhnet.inference.risk import RiskTable
from ffhnet.inference.weights_calibration import WeightsCalibration, save_calibration
from ffhnet.model import CheckpointInfo, FFHEvaluator, FlowGenerator, ModelConfig, save_checkpoint
from ffhnet.objects.catalogue import resolve_objects
from ffhnet.objects.scans import read_in_metres
from ffhnet.perception.capture import read_cloud, read_depth
from ffhnet.simulation.trial import TrialResults


@dataclass(frozen=True)
class Door:
    """A way in.

    Attributes:
        name: for people.
        file: the one that gets damaged, in a folder that `build` fills.
        build: writes a valid input into an empty folder.
        open: reads what is in the folder as a user would have it read.
    """

    name: str
    file: str
    build: Callable[[Path], None]
    open: Callable[[Path], object]

    def attempt(self, folder: Path, seed: int | random.Random) -> None:
        """Damage the file by chance and open the folder; raises what opening raises."""
        chance = seed if isinstance(seed, random.Random) else random.Random(f"{self.name} {seed}")
        valid = folder / f"{self.file}.valid"
        if not valid.exists():
            shutil.copy(folder / self.file, valid)
        (folder / self.file).write_bytes(mutate(valid.read_bytes(), chance))
        self.open(folder)


def _cloud() -> np.ndarray:
    return np.random.default_rng(0).uniform([-0.05, -0.05, 0.5], [0.05, 0.05, 0.6], (90, 3))


def _save_cloud(path: Path) -> None:
    cloud = _cloud()
    if path.suffix == ".ply":
        trimesh.PointCloud(cloud).export(path)
    elif path.suffix == ".pcd":
        PointCloud.from_xyz_points(cloud.astype(np.float32)).save(path)
    elif path.suffix == ".npy":
        np.save(path, cloud)
    else:
        np.savez_compressed(path, cloud=cloud)


def _save_depth(path: Path) -> None:
    depth = np.full((24, 32), 700, np.uint16)
    if path.suffix == ".png":
        Image.fromarray(depth).save(path)
    else:
        np.save(path, depth)


def _grasps() -> Grasps:
    hand, rng = load_hand(), np.random.default_rng(0)
    return Grasps(
        rotation=matrix_from_rotation_vector(rng.normal(size=(3, 3))),
        position=rng.normal(size=(3, 3)),
        joints=rng.uniform(hand.lower, hand.upper, (3, hand.num_joints)),
        joint_names=hand.joint_names,
        hand=hand.name,
        frame="camera",
        probability=np.array([0.9, 0.5, 0.1]),
    )


def _save_hand(folder: Path) -> None:
    for file in Path(load_hand().mjcf).parent.glob("hand.*"):
        shutil.copy(file, folder)


def _check_hand(folder: Path) -> None:
    load_hand.cache_clear()
    with contextlib.redirect_stdout(io.StringIO()):
        hand_command.run(hand_command.HandOptions("check", str(folder / "hand.toml")))


def _read_mesh(path: Path) -> object:
    return read_in_metres(path, 1.0)


def _save_mesh(path: Path) -> None:
    trimesh.creation.box((0.05, 0.06, 0.1)).export(path)


def _save_weights(folder: Path) -> None:
    hand = load_hand()
    config = ModelConfig(
        num_joints=hand.num_joints, bps_size=64, pca_components=8, width=8, inner_width=8, flow_width=8,
        flow_blocks=1, flow_steps=1, palm_points=4, flow_palm_points=4,
    )  # fmt: skip
    info = CheckpointInfo(hand.name, hand.joint_names, tuple(hand.lower), tuple(hand.upper), config)
    torch.manual_seed(0)
    save_checkpoint(folder, info, FlowGenerator(config), FFHEvaluator(config))


def _load_signed(folder: Path) -> object:
    """Whoever forges weights forges their checksums as well."""
    config = json.loads((folder / "config.json").read_text())
    for name in config["sha256"]:
        config["sha256"][name] = hashlib.sha256((folder / name).read_bytes()).hexdigest()
    (folder / "config.json").write_text(json.dumps(config))
    return FFHNet.from_pretrained(folder, device="cpu")


def _save_calibrated_weights(folder: Path) -> None:
    _save_weights(folder)
    maps = Calibration(2.0, 2.0, -1.0)
    table = RiskTable(np.arange(20) // 2, np.full(20, 0.9), np.ones(20))
    limit = NoveltyLimit(2.0, 0.01, 500)
    save_calibration(folder, WeightsCalibration(maps, maps, table, "made up", limit))


def _save_data_set(folder: Path) -> None:
    hand, grasps = load_hand(), _grasps()
    n = len(grasps)
    results = TrialResults(
        outcome=np.arange(n), margin=np.ones(n), closed_joints=grasps.joints, contact_links=np.full(n, 3),
        pushed=np.zeros(n), rise=np.zeros(n), hold_slip=np.zeros(n),
    )  # fmt: skip
    trials = records.TrialBlock(0, "power", grasps, results, np.zeros(n, int), np.zeros(n, int))
    view = records.ViewRow(np.full(4096, 0.1), -0.05, np.eye(4))
    records.write_table(
        records.trials_table("tube_000008", [trials]), folder / "trials" / "tube_000008.parquet"
    )
    records.write_table(
        records.views_table("tube_000008", [records.ViewBlock(0, [view])]),
        folder / "views" / "tube_000008.parquet",
    )
    closes = [bool(moves) for moves in hand.closing.moves]
    records.write_header(folder, {"hand": hand.name, "joint_names": list(hand.joint_names), "closes": closes})


def _read_data_set(folder: Path) -> object:
    return columns.read_trial_columns([folder]), records.read_training_data([folder])


def _save_exchange(folder: Path) -> None:
    obj = resolve_objects("tube_000008")[0].load()
    _save_data_set(folder)
    trials = columns.read_trial_columns([folder])
    exchange.write_grasps(exchange.object_grasps(trials, obj, load_hand()), folder / "grasps.json")


def _save_cloud_message(folder: Path) -> None:
    fields = [{"name": name, "offset": 4 * i, "datatype": 7, "count": 1} for i, name in enumerate("xyz")]
    message = {
        "height": 4, "width": 5, "fields": fields, "is_bigendian": 0, "point_step": 12, "row_step": 60,
        "data": _cloud()[:20].astype("<f4").tobytes().hex(),
    }  # fmt: skip
    (folder / "cloud.message").write_text(json.dumps(message))


def _save_image_message(folder: Path) -> None:
    message = {
        "height": 4, "width": 5, "is_bigendian": 0, "point_step": 2, "row_step": 10, "encoding": "16UC1",
        "data": np.full(20, 700, "<u2").tobytes().hex(),
    }  # fmt: skip
    (folder / "image.message").write_text(json.dumps(message))


def _message(path: Path) -> SimpleNamespace:
    """What the middleware makes of bytes: a message with all fields, of the right types, or none."""
    try:
        fields = json.loads(path.read_bytes())
        points = [SimpleNamespace(**field) for field in fields.get("fields", [])]
        sizes = [fields[name] for name in ("height", "width", "is_bigendian", "point_step", "row_step")]
        sizes += [number for point in points for number in (point.offset, point.datatype, point.count)]
        if not all(isinstance(number, int) and 0 <= number < 2**32 for number in sizes):
            raise ValueError("a size is no uint32")
        data = bytes.fromhex(fields["data"])
        own = {"step": fields["row_step"], "fields": points, "data": data}
        return SimpleNamespace(**{"encoding": "", **fields, **own})
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise MessageError(f"not even a message: {error}") from error


def _read_one(read: Callable[[Path], object], file: str) -> Callable[[Path], object]:
    return lambda folder: read(folder / file)


def _save_one(save: Callable[[Path], object], file: str) -> Callable[[Path], None]:
    return lambda folder: save(folder / file)


def _files(kind: str, files: tuple[str, ...], save: Callable, read: Callable) -> list[Door]:
    return [Door(f"{kind} {file}", file, _save_one(save, file), _read_one(read, file)) for file in files]


DOORS = (
    *_files("cloud", ("cloud.ply", "cloud.pcd", "cloud.npy", "cloud.npz"), _save_cloud, read_cloud),
    *_files("depth", ("depth.png", "depth.npy"), _save_depth, read_depth),
    *_files("mask", ("mask.png",), _save_depth, read_mask),
    *_files(
        "grasps", ("grasps.json", "grasps.npz"), lambda path: save_grasps(_grasps(), path), load_grasps
    ),
    *_files("mesh", ("mesh.obj", "mesh.ply", "mesh.stl", "mesh.glb"), _save_mesh, _read_mesh),
    Door("hand hand.toml", "hand.toml", _save_hand, _check_hand),
    Door("hand hand.xml", "hand.xml", _save_hand, _check_hand),
    Door("weights config.json", "config.json", _save_weights, FFHNet.from_pretrained),
    Door("weights generator", "generator.safetensors", _save_weights, _load_signed),
    Door("weights evaluator", "evaluator.safetensors", _save_weights, _load_signed),
    Door("weights calibration", "calibration.json", _save_calibrated_weights, FFHNet.from_pretrained),
    Door("data set header", "dataset.json", _save_data_set, _read_data_set),
    Door("data set trials", "trials/tube_000008.parquet", _save_data_set, _read_data_set),
    Door("data set views", "views/tube_000008.parquet", _save_data_set, _read_data_set),
    Door("data set exchange", "grasps.json", _save_exchange, _read_one(exchange.read_grasps, "grasps.json")),
    Door("message cloud", "cloud.message", _save_cloud_message,
         lambda folder: cloud_from_message(_message(folder / "cloud.message"))),
    Door("message image", "image.message", _save_image_message,
         lambda folder: depth_from_message(_message(folder / "image.message"))),
)  # fmt: skip
