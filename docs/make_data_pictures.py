"""Pictures of a data set: varied successful grasps, and success by family and by object.

Run it from the repository root: python docs/make_data_pictures.py data/train
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro
from PIL import Image, ImageDraw, ImageFont

from ffhnet.dataset.columns import TrialColumns, read_trial_columns
from ffhnet.dataset.records import read_header
from ffhnet.dataset.statistics import Rate, success_rate
from ffhnet.evaluation.picture import save_png
from ffhnet.evaluation.render import Surface, camera_around, render, square_camera
from ffhnet.evaluation.shapes import PALM, hand_surfaces
from ffhnet.geometry.rotations import geodesic_angle, matrix_from_quaternion
from ffhnet.geometry.transforms import make_transform
from ffhnet.hands import Hand, load_hand
from ffhnet.objects.catalogue import resolve_objects
from ffhnet.perception.raycast import RayScene
from ffhnet.simulation.distinct import NEAR_ANGLE, NEAR_JOINTS, NEAR_POSITION
from ffhnet.simulation.grasp_types import grasp_types

IMAGES = Path(__file__).parent / "images"
COLUMNS = 6
PANEL = 200
FINE = 2
"""The plot is drawn so many times larger and then reduced: Pillow draws hard edges."""

CANDIDATES = 3000
STILL = 0.005
"""m: grasps are shown on the object where it stood, so only those that hardly moved it."""

PAPER, INK, FAINT, GRID = (255, 255, 255), (28, 34, 44), (96, 106, 120), (226, 230, 236)
OBJECT = np.array([0.93, 0.60, 0.24])
COLORS = {
    "heuristic": (120, 132, 150),
    "power": (226, 138, 38),
    "contact": (46, 150, 102),
    "perturb": (126, 92, 184),
    "learned": (206, 62, 74),
}


@dataclass(frozen=True)
class Options:
    """What the pictures are made from."""

    folders: tyro.conf.Positional[tuple[Path, ...]]
    """Data sets of procedural objects."""


def family_of(trials: TrialColumns) -> np.ndarray:
    """Family of each trial's object: its name without the seed."""
    names, number = np.unique(trials.object_name, return_inverse=True)
    return np.array([name.rpartition("_")[0] for name in names.tolist()])[number]


def varied(trials: TrialColumns, count: int) -> list[int]:
    """Trials far from each other by the measures of `ffhnet data diversity`, each of another family.

    Distances are in units of what `is_distinct` calls near; the first is the grasp nearest to the mean palm.
    """
    family, rotation = family_of(trials), matrix_from_quaternion(trials.quaternion_wxyz)
    chosen = [int(np.argmin(np.linalg.norm(trials.position - trials.position.mean(axis=0), axis=1)))]
    nearest = np.full(len(trials), np.inf)
    free = np.ones(len(trials), dtype=bool)
    while len(chosen) < count:
        last = chosen[-1]
        apart = np.stack(
            [
                np.linalg.norm(trials.position - trials.position[last], axis=1) / NEAR_POSITION,
                geodesic_angle(rotation, rotation[last]) / NEAR_ANGLE,
                np.sqrt(((trials.closed_joints - trials.closed_joints[last]) ** 2).mean(axis=1))
                / NEAR_JOINTS,
            ]
        )
        nearest = np.minimum(nearest, np.linalg.norm(apart, axis=0))
        free &= family != family[last]
        if not free.any():
            break
        chosen.append(int(np.argmax(np.where(free, nearest, -1))))
    return chosen


def clearest(surfaces: list[Surface], points: np.ndarray) -> float:
    """Azimuth in degrees from which much of the object (the first surface) and of the fingers is seen."""
    scene = RayScene([surface.mesh for surface in surfaces])
    fingers = [i for i, surface in enumerate(surfaces) if i > 0 and surface.color is not PALM]
    camera = square_camera(56)
    x, y = np.meshgrid(*camera.rays())
    directions = np.stack([x, y, np.ones_like(x)], axis=-1).reshape(-1, 3)

    def seen(azimuth: float) -> int:
        T_world_camera = camera_around(points, azimuth, 22.0, camera)
        hits = scene.cast(T_world_camera[None, :3, 3], directions @ T_world_camera[:3, :3].T)
        return int((1 + (hits.mesh == 0).sum()) * (1 + np.isin(hits.mesh, fingers).sum()))

    return max(np.arange(0.0, 360.0, 30.0).tolist(), key=seen)


def grasp_panel(trials: TrialColumns, index: int, hand: Hand) -> Image.Image:
    """One grasp, closed, on its object at rest."""
    obj = resolve_objects(str(trials.object_name[index]))[0].load()
    mesh = obj.visual.copy().apply_transform(obj.resting_poses[trials.placement[index]])
    T_world_palm = make_transform(
        matrix_from_quaternion(trials.quaternion_wxyz[index]), trials.position[index]
    )
    parts = hand_surfaces(hand, trials.closed_joints[index], T_world_palm)
    surfaces = [Surface(mesh.smooth_shaded, OBJECT), *parts]
    points = np.concatenate([surface.mesh.vertices for surface in surfaces])
    camera = square_camera(PANEL)
    T_world_camera = camera_around(points, clearest(surfaces, points), 22.0, camera, margin=1.06)
    return Image.fromarray(render(surfaces, T_world_camera, camera, ground=0.0, supersampling=3))


def diversity_picture(trials: TrialColumns, hand: Hand, rng: np.random.Generator) -> Image.Image:
    """A row of varied successes for each proposer."""
    header, label, gap, caption = 58, 150, 6, 40
    row = PANEL + caption + gap
    proposers = trials.proposers
    canvas = Image.new("RGB", (label + COLUMNS * (PANEL + gap), header + len(proposers) * row), PAPER)
    draw = ImageDraw.Draw(canvas)
    draw.text((14, header / 2), "Successful grasps, chosen to differ", INK, font(26), anchor="lm")
    note = "farthest points in palm position, palm rotation and closed joints; each of another family"
    draw.text((canvas.width - 14, header / 2), note, FAINT, font(16), anchor="rm")
    for line, name in enumerate(proposers):
        top = header + line * row
        part = trials[trials.proposer == name]
        draw.rectangle((0, top, 6, top + PANEL), fill=COLORS.get(name, INK))
        draw.text((16, top + 4), name, INK, font(21))
        rate = success_rate(part)
        lines = f"{rate.value:.0%} of {rate.trials}\nexecuted trials\nsucceed"
        draw.multiline_text((16, top + 36), lines, FAINT, font(16), spacing=5)
        good = shown(part, rng)
        types = grasp_types(good.closed_joints, np.nan_to_num(good.contact_links), hand)
        for column, index in enumerate(varied(good, COLUMNS)):
            left = label + column * (PANEL + gap)
            canvas.paste(grasp_panel(good, index, hand), (left, top))
            family = str(family_of(good[[index]])[0]).replace("_", " ")
            draw.text((left + 2, top + PANEL + 3), family, INK, font(15))
            if not np.isnan(good.contact_links[index]):
                draw.text((left + 2, top + PANEL + 20), types.label(index), FAINT, font(14))
    return canvas


def shown(trials: TrialColumns, rng: np.random.Generator) -> TrialColumns:
    """Successes that can be shown: the object stayed where it was, and all repeats held."""
    good = trials[trials.success & (trials.pushed < STILL) & (trials.held == trials.repeats)]
    return good[np.sort(rng.permutation(len(good))[:CANDIDATES])]


def success_picture(trials: TrialColumns) -> Image.Image:
    """Bars by family with 95 % intervals, and a dot per object, for each proposer."""
    canvas = Image.new("RGB", (1400 * FINE, 900 * FINE), PAPER)
    draw = ImageDraw.Draw(canvas)
    draw.text((20 * FINE, 30 * FINE), "Success of executed trials", INK, font(26 * FINE), anchor="lm")
    left = 380.0 * FINE
    for name in trials.proposers:
        draw.rectangle((left, 22 * FINE, left + 16 * FINE, 38 * FINE), fill=COLORS.get(name, INK))
        draw.text((left + 24 * FINE, 30 * FINE), name, INK, font(18 * FINE), anchor="lm")
        left += 60 * FINE + draw.textlength(name, font(18 * FINE))
    draw_families(draw, trials, (150 * FINE, 96 * FINE, 760 * FINE, 850 * FINE))
    draw_objects(draw, trials, (850 * FINE, 96 * FINE, 1372 * FINE, 850 * FINE))
    return canvas.reduce(FINE)


def draw_families(draw: ImageDraw.ImageDraw, trials: TrialColumns, box: tuple[int, ...]) -> None:
    """A group of bars for each family, best family first, and one for all."""
    left, top, right, bottom = box
    family = family_of(trials)
    names = sorted(set(family.tolist()), key=lambda name: -success_rate(trials[family == name]).value)
    draw.text(
        (left, top - 24 * FINE),
        "by family of objects (lines: 95 % Wilson intervals)",
        FAINT,
        font(16 * FINE),
        anchor="lm",
    )
    for share in np.linspace(0, 1, 6):
        x = left + share * (right - left)
        draw.line((x, top, x, bottom), fill=GRID, width=FINE)
        draw.text((x, bottom + 6 * FINE), f"{share:.0%}", FAINT, font(14 * FINE), anchor="ma")
    pitch = (bottom - top) / (len(names) + 1)
    height = min(0.8 * pitch / len(trials.proposers), 12 * FINE)
    for line, name in enumerate(["all", *names]):
        part = trials if name == "all" else trials[family == name]
        middle = top + (line + 0.5) * pitch
        text = f"{name.replace('_', ' ')}"
        draw.text((left - 10 * FINE, middle), text, INK, font(16 * FINE), anchor="rm")
        for k, proposer in enumerate(trials.proposers):
            rate = success_rate(part[part.proposer == proposer])
            y = middle + (k - len(trials.proposers) / 2) * height
            draw_bar(draw, rate, (left, right), (y, y + height - FINE), COLORS.get(proposer, INK))


def draw_bar(
    draw: ImageDraw.ImageDraw,
    rate: Rate,
    across: tuple[float, float],
    rows: tuple[float, float],
    color: tuple[int, int, int],
) -> None:
    """A bar from zero to a rate and the line of its interval; nothing without trials."""
    if rate.trials == 0:
        return
    left, right = across
    low, high = (left + end * (right - left) for end in rate.interval)
    draw.rectangle((left, rows[0], left + rate.value * (right - left), rows[1]), fill=color)
    middle = (rows[0] + rows[1]) / 2
    draw.line((low, middle, high, middle), fill=INK, width=FINE)


def draw_objects(draw: ImageDraw.ImageDraw, trials: TrialColumns, box: tuple[int, ...]) -> None:
    """One dot per object and proposer, each proposer's objects sorted by success."""
    left, top, right, bottom = box
    draw.text(
        (left, top - 24 * FINE),
        "by object: one dot each, sorted for each proposer",
        FAINT,
        font(16 * FINE),
        anchor="lm",
    )
    for share in np.linspace(0, 1, 6):
        y = bottom - share * (bottom - top)
        draw.line((left, y, right, y), fill=GRID, width=FINE)
        draw.text((left - 8 * FINE, y), f"{share:.0%}", FAINT, font(14 * FINE), anchor="rm")
        x = left + share * (right - left)
        draw.text((x, bottom + 6 * FINE), f"{share:.0%}", FAINT, font(14 * FINE), anchor="ma")
    draw.text(
        ((left + right) / 2, bottom + 26 * FINE), "share of objects", FAINT, font(14 * FINE), anchor="ma"
    )
    radius = 2.5 * FINE
    for proposer in trials.proposers:
        part = trials[(trials.proposer == proposer) & trials.executed]
        _, number = np.unique(part.object_name, return_inverse=True)
        rates = np.sort(np.bincount(number, weights=part.success) / np.bincount(number))
        for rank, rate in enumerate(rates):
            x = left + (rank + 0.5) / len(rates) * (right - left)
            y = bottom - rate * (bottom - top)
            draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=COLORS.get(proposer, INK))


def save(picture: Image.Image, name: str) -> None:
    """Keeps 160 colours, a quarter of the bytes; nobody sees the difference."""
    save_png(picture.quantize(160), IMAGES / name)
    print(f"{name}: {(IMAGES / name).stat().st_size / 1000:.0f} kB")


def font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """Pillow's own font."""
    return ImageFont.load_default(size=size)


def main(options: Options) -> None:
    """Draw both pictures."""
    trials = read_trial_columns(options.folders)
    hand = load_hand(read_header(options.folders[0])["hand"])
    save(success_picture(trials), "success_by_object.png")
    save(diversity_picture(trials, hand, np.random.default_rng(0)), "grasp_diversity.png")


if __name__ == "__main__":
    main(tyro.cli(Options))
