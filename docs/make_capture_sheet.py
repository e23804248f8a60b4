"""The page docs/capture_sheet.md: every capture with its objects and grasps, or why there are none.

Run it from the repository root, after benchmarks/captures.py:

    python docs/make_capture_sheet.py PATH_TO_CAPTURES

Pictures are drawn from points, and only of captures whose licence allows to pass them on; the table has all.
"""

import json
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
import tyro
from PIL import Image, ImageDraw

from ffhnet.errors import CloudError, SceneError
from ffhnet.evaluation.captures import Capture, find_captures, read_capture
from ffhnet.feasibility.planner import Planner
from ffhnet.geometry.transforms import apply
from ffhnet.grasps import Grasps
from ffhnet.hands import load_hand
from ffhnet.inference import FFHNet
from ffhnet.perception.observation import Observation

DOCS = Path(__file__).parent
PAGE, PICTURE = DOCS / "capture_sheet.md", DOCS / "images" / "captures" / "sheet.png"

FREE = ("gpd_clouds", "kinect_osd", "pcl_scenes", "realsense_single", "xtion_ycb")
"""Groups of captures under BSD or MIT licences."""

COLOURS = np.array(
    [
        [214, 69, 65],
        [65, 155, 80],
        [62, 99, 200],
        [225, 170, 40],
        [150, 80, 180],
        [50, 170, 170],
        [140, 95, 60],
    ]
)
TABLE, REST = np.array([205, 218, 205]), np.array([165, 165, 165])
TILE, COLUMNS = (210, 180), 5
_ABOVE = 0.2

TITLE = """# Every capture

What becomes of each of the {captures} real captures, with the shipped weights and nothing tuned for
them: grasps are planned for every object that clustering finds in the depth alone. An object counts as
clearly graspable when the view does not cut it off, at least {min_points} points are seen of it, and
what is seen is at most {max_width:.0f} cm wide along the table and at least {min_height:.0f} cm high.
Of {clear_found} such objects {clear_found_with_grasp} have a grasp that can be done; {captures_good}
of {captures} captures have one for each, {captures_refused} refused. `docs/results/captures.json`
holds all of it, and the same for the objects of the masks, of which {clear_masked} are clearly
graspable and {clear_masked_with_grasp} have a grasp. Made by `benchmarks/captures.py` and
`docs/make_capture_sheet.py`.

![objects found in the captures, with the best grasp of each](images/captures/sheet.png)

Points of the captures under free licences, objects in colours, the table in green. A line goes from the
pre-grasp pose of the best feasible grasp to the palm (dot); objects without one are crossed out.

| capture | objects | clearly graspable | with a grasp | best probabilities | remarks |
|---|---|---|---|---|---|
"""

PHYSICS = """
## Real depth, physics

The best feasible grasp of each seed, planned from the real depth, executed on the true mesh where it was
registered ([how](captures.md)): {successes} of {trials} succeed.

| capture | object | success | failures | best probability | corrected by (mm) | mask needed |
|---|---|---|---|---|---|---|
"""


@dataclass(frozen=True)
class Options:
    """What the page is made from."""

    captures: tyro.conf.Positional[Path]
    """Folder with the captures."""
    results: Path = DOCS / "results" / "captures.json"
    """What benchmarks/captures.py measured."""


def main(options: Options) -> None:
    """Draw the picture and write the page."""
    torch.set_num_threads(1)
    results = json.loads(options.results.read_text())
    network = FFHNet.from_pretrained()
    planner = Planner(network, load_hand(network.info.hand))
    captures = [read_capture(f) for f in find_captures(options.captures) if f.parent.name in FREE]
    tiles = [draw(capture, planner) for capture in captures]
    rows = -(-len(tiles) // COLUMNS)
    sheet = Image.new("RGB", (TILE[0] * COLUMNS, (TILE[1] + 14) * rows), "white")
    for i, tile in enumerate(tiles):
        sheet.paste(tile, (TILE[0] * (i % COLUMNS), (TILE[1] + 14) * (i // COLUMNS)))
    sheet.quantize(64).save(PICTURE, optimize=True)
    rule = results["protocol"]["clearly_graspable"]
    head = TITLE.format(
        **results["summary"],
        min_points=rule["min_points"],
        max_width=100 * rule["max_width"],
        min_height=100 * rule["min_height"],
    )
    lines = [head, *(row(name, seen) for name, seen in results["survey"].items())]
    lines.append(PHYSICS.format(**results["summary"]))
    for name, objects in results["trials"].items():
        lines += [trial_row(name, target, runs) for target, runs in objects.items()]
    PAGE.write_text("".join(lines))


def trial_row(name: str, target: str, runs: list[dict]) -> str:
    """One line of the table of trials."""
    lost = Counter(run["outcome"] for run in runs if not run["success"])
    causes = ", ".join(f"{count} {outcome}" for outcome, count in lost.most_common())
    predicted = [run["probability"] for run in runs if run["probability"] is not None]
    probability = f"{np.median(predicted):.2f}" if predicted else "-"
    moved = f"{1000 * np.median([run['moved'] for run in runs]):.0f}"
    masked = "yes" if runs[0]["masked"] else "no"
    won = f"{len(runs) - sum(lost.values())}/{len(runs)}"
    return f"| {name} | {target} | {won} | {causes} | {probability} | {moved} | {masked} |\n"


def row(name: str, seen: dict) -> str:
    """One line of the table."""
    if seen["refusal"] is not None:
        return f"| {name} | - | - | - | - | refused: {seen['refusal']} |\n"
    found = seen["found"]
    clear = [one for one in found if one["obstacle"] is None]
    best = ", ".join("-" if one["feasible"] == 0 else f"{one['probability']:.2f}" for one in clear)
    others = Counter(one["obstacle"] for one in found if one["obstacle"] is not None)
    remarks = [f"{count} {obstacle}" for obstacle, count in others.items()]
    for one in clear:
        if one["feasible"] == 0:
            cause, count = next(iter(one["dropped"].items()))
            remarks.append(f"none feasible: {count} of {one['sampled']} against the {cause}")
    graspable = sum(one["feasible"] > 0 for one in clear)
    return f"| {name} | {len(found)} | {len(clear)} | {graspable} | {best} | {'; '.join(remarks)} |\n"


def draw(capture: Capture, planner: Planner) -> Image.Image:
    """The points of a capture as its camera saw them, with objects and grasps."""
    canvas = Canvas.around(capture.cloud)
    try:
        found = capture.observe()
    except (CloudError, SceneError):
        canvas.points(capture.cloud, REST)
        return canvas.labelled(f"{capture.name}: refused")
    plane = found[0].plane
    assert plane is not None
    on_table = np.abs(plane.height(capture.cloud)) < 0.008
    canvas.points(capture.cloud[~on_table], REST)
    canvas.points(capture.cloud[on_table], TABLE)
    for i, seen in enumerate(found):
        canvas.points(seen.cloud, COLOURS[i % len(COLOURS)])
    for seen in found:
        canvas.grasp(planner.plan(seen).grasps, seen)
    return canvas.labelled(capture.name)


class Canvas:
    """A picture of points in camera axes, at whichever end of z they lie."""

    def __init__(self, T_optical_input: np.ndarray, low: np.ndarray, scale: float) -> None:
        self._T, self._low, self._scale = T_optical_input, low, scale
        self._pixels = np.full((TILE[1], TILE[0], 3), 255, dtype=np.uint8)
        self._lines: list[tuple[list[tuple[float, float]], int]] = []

    @classmethod
    def around(cls, cloud: np.ndarray) -> "Canvas":
        """A canvas on which nearly all of the points fit."""
        sign = 1.0 if np.median(cloud[:, 2]) > 0 else -1.0
        T = np.diag([1.0, sign, sign, 1.0])
        ahead = apply(T, cloud)
        ahead = ahead[ahead[:, 2] > 0]
        low, high = np.percentile(ahead[:, :2] / ahead[:, 2:], [0.5, 99.5], axis=0)
        # Hands come from above, where a view may end.
        low[1] -= _ABOVE * (high[1] - low[1])
        return cls(T, low, float((np.array(TILE) / (high - low)).min()))

    def place(self, points: np.ndarray) -> np.ndarray:
        """Pixels of points, N x 2."""
        seen = apply(self._T, points)
        return (seen[:, :2] / np.maximum(seen[:, 2:], 1e-3) - self._low) * self._scale

    def points(self, points: np.ndarray, colour: np.ndarray) -> None:
        """Paints points."""
        u, v = self.place(points).astype(int).T
        inside = (u >= 0) & (u < TILE[0]) & (v >= 0) & (v < TILE[1])
        self._pixels[v[inside], u[inside]] = colour

    def grasp(self, grasps: Grasps, seen: Observation) -> None:
        """The way of the best grasp, or a cross through an object that has none."""
        if len(grasps):
            palm = grasps.position[0]
            ends = self.place(np.stack([palm - 0.1 * grasps.rotation[0, :, 0], palm]))
            self._lines.append(([tuple(end) for end in ends], 2))
            return
        low, high = np.percentile(self.place(seen.cloud), [5, 95], axis=0)
        self._lines += [([tuple(low), tuple(high)], 0), ([(low[0], high[1]), (high[0], low[1])], 0)]

    def labelled(self, text: str) -> Image.Image:
        """The picture with a line of text above."""
        tile = Image.new("RGB", (TILE[0], TILE[1] + 14), "white")
        inner = Image.fromarray(self._pixels)
        drawn = ImageDraw.Draw(inner)
        for ends, radius in self._lines:
            drawn.line(ends, fill=0, width=1)
            x, y = ends[-1]
            if radius:
                drawn.ellipse((x - radius, y - radius, x + radius, y + radius), fill=0)
        tile.paste(inner, (0, 14))
        ImageDraw.Draw(tile).text((2, 1), text, fill=0)
        return tile


if __name__ == "__main__":
    main(tyro.cli(Options))
