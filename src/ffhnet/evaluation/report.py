"""The report of an evaluation: one HTML file with tables, charts and pictures that needs nothing else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from PIL import Image

from ffhnet.evaluation.charts import Series, bar_chart, curve_chart, dot_chart, reliability_chart
from ffhnet.evaluation.figures import CAPTIONS
from ffhnet.evaluation.html import Element, document, element, picture, table
from ffhnet.evaluation.report_cells import (
    bar,
    executed_cell,
    full_cell,
    known,
    number_cell,
    percent,
    plain,
    points_cell,
    rate_cell,
    series,
    share_cell,
)
from ffhnet.evaluation.tables import SMALL, SURE, THRESHOLDS, WORST_SHARE, ConditionCells, Row, Table

PAPER_TABLE1 = ((0.61, 0.99), (0.70, 0.87), (0.75, 0.83), (0.82, 0.28), (0.91, 0.05))
"""Success and kept share of the paper's Table I at each of its thresholds (averages of 12 objects)."""

PAPER_HEURISTIC = 0.15

WORST_OBJECTS = 8
"""Objects in the list of the hardest."""

_STRICT = (
    "Friction 0.6 (torsional 0.02), every object 100 g. The hand closes on the object where it rests; then "
    "gravity and table are gone, and there are six pushes of 10 N per kg for up to 2 s along the axes of "
    "the world. A grasp fails where the object moves 5 cm or turns 15 degrees: from before the hand "
    "closed, as the public bench counts (where the object floats from the start), or from the first push, "
    "which leaves out how far closing drew it in. Best 10 of 100 samples of each view. The best open "
    "learner on the public bench reached 76 %, with another hand, other objects, complete clouds and "
    "grasps planned in contact."
)

_WORLDS = {
    "nominal": "nominal",
    "friction": "friction 0.5",
    "mass": "mass × 2",
    "pose": "pose off by 5 mm, 0.05 rad",
    "all": "all three together",
    "strict": "strict, as the bench counts",
    "strict, held": "strict, from the first push",
}


def report(
    results: Table,
    protocol: Mapping[str, Any],
    machine: Mapping[str, Any],
    figures: Mapping[str, Image.Image],
) -> str:
    """The HTML text.

    Args:
        results: the tables, those that are written as JSON.
        protocol: settings of the evaluation, name and value.
        machine: where it ran, name and value.
        figures: pictures by the paper's number of them, "5", "6" and "7", as far as there are any.
    """
    total = results.total
    samples = f"{total.raw.kept} grasps on {total.views} views of {total.objects} objects"
    title = "How often the grasps hold"
    return document(
        f"ffhnet: {title.lower()}",
        element("h1", title),
        _note(
            f"{samples}, each executed in physics. A start collision counts as a failure unless said "
            "otherwise. Intervals are 95 % by bootstrap over objects; Wilson's where all or none held, or "
            "where there is one object."
        ),
        *_headline(results),
        *_table1(results),
        *_table2(results),
        *_kept(results),
        *_calibration(results),
        *_worlds(results),
        *_sure(results),
        *_strict(results),
        *_poses(results),
        *_worst(results),
        *_figures(figures),
        *_facts("Protocol", protocol),
        *_facts("Machine", machine),
    )


def _headline(results: Table) -> list[Element]:
    total, blind = results.total, results.total.nominal
    bars = [
        bar("Heuristic of the paper", total.heuristic, PAPER_HEURISTIC),
        bar("Blind: above the centre, any yaw", blind.blind_random_yaw),
        bar("Blind: across the shorter side", blind.blind_short_side),
        bar("Generator, all samples", total.raw, PAPER_TABLE1[0][0]),
        bar("Best 28 %, of all samples", total.best(0.28).everywhere, PAPER_TABLE1[3][0]),
        bar("Best 28 %, each object's own", total.best(0.28).own),
        bar("Best 5 %, of all samples", total.best(0.05).everywhere, PAPER_TABLE1[4][0]),
        bar("Top-5 of each view", blind.top),
        bar("Top-1 of each view", blind.top1),
        bar(f"Worst object, own best {percent(WORST_SHARE)}", results.worst.best(WORST_SHARE).own),
    ]
    for condition in total.conditions:
        if condition.name == "all":
            bars.append(bar("Top-1 under stress, all three", condition.top1))
            bars.append(bar("Top-5 under stress, all three", condition.top))
    chart = bar_chart(bars, "the paper, on its own objects and simulator")
    return [element("figure", chart, element("figcaption", f"Worst object: {results.worst.name}."))]


def _table1(results: Table) -> list[Element]:
    rows = [(row.name, str(row.views), *map(rate_cell, row.thresholds)) for row in results.rows]
    means = (percent(results.mean_rate(i)) for i in range(len(THRESHOLDS)))
    total = results.total
    rows += [
        ("mean of objects", "", *means),
        ("all samples", str(total.views), *map(rate_cell, total.thresholds)),
        ("kept", "", *(percent(cell.retained) for cell in total.thresholds)),
        ("paper, success", "36", *(percent(success) for success, _ in PAPER_TABLE1)),
        ("paper, kept", "", *(percent(share) for _, share in PAPER_TABLE1)),
    ]
    kinds = [""] * len(results.rows) + ["total", "", "", "paper", "paper"]
    columns = ("object", "views", *(f"Th = {t:g}" for t in THRESHOLDS))
    return [
        element("h2", "Table I: the evaluator's influence"),
        table("Success of the grasps that each threshold keeps: lifted of tried.", columns, rows, kinds),
    ]


def _table2(results: Table) -> list[Element]:
    total, blind = results.total, results.total.nominal
    methods = [
        ("Heuristic", total.heuristic, "15 %"),
        ("Blind: above the cloud's centre, any yaw", blind.blind_random_yaw, ""),
        ("Blind: the same, across its shorter side", blind.blind_short_side, ""),
        ("FFHGenerator", total.raw, "61 %"),
        ("FFHGenerator + FFHEvaluator, best 28 %", total.best(0.28).everywhere, "82 %"),
        ("FFHGenerator + FFHEvaluator, best 5 %", total.best(0.05).everywhere, "91 %"),
        ("FFHGenerator + FFHEvaluator, top-1", blind.top1, ""),
    ]
    rows: list[tuple[str | Element, ...]] = [
        (name, full_cell(cell), executed_cell(cell), paper) for name, cell, paper in methods
    ]
    rows.append(("Top-1 minus the better blind control, points", points_cell(blind.lead), "", ""))
    columns = ("method", "success", "start collisions left out", "paper")
    return [
        element("h2", "Table II: methods"),
        table("The paper leaves start collisions out; both denominators are given.", columns, rows),
    ]


def _kept(results: Table) -> list[Element]:
    total = results.total
    shares = [1.0, *(kept.share for kept in total.kept)]
    everywhere = [total.raw, *(kept.everywhere for kept in total.kept)]
    own = [total.raw, *(kept.own for kept in total.kept)]
    chart = curve_chart(
        [
            series("best of all samples", shares, everywhere),
            series("each object's own best", shares, own),
            Series("paper", [(share, success) for success, share in PAPER_TABLE1], line=False),
        ],
        "share of the samples that is kept",
        "success",
        y_low=0.5 if min(known(cell.rate for cell in (*everywhere, *own)), default=0) > 0.6 else 0.0,
    )
    rows = [
        (percent(share), full_cell(a), full_cell(b), executed_cell(b))
        for share, a, b in zip(shares, everywhere, own, strict=True)
    ]
    columns = ("kept", "best of all samples", "each object's own best", "own, collisions left out")
    return [
        element("h2", "Success against kept share"),
        _note(
            "Shares compare between evaluators, thresholds do not. The best of all samples come mostly from "
            "easy objects; each object's own best do not."
        ),
        element("figure", chart),
        table("", columns, rows),
    ]


def _calibration(results: Table) -> list[Element]:
    quality = results.calibration
    rows = [
        ("AUROC, all samples", number_cell(quality.auroc)),
        ("AUROC, start collisions left out", number_cell(quality.auroc_executed)),
        ("AUROC within a view, mean of views", number_cell(quality.auroc_within_view)),
        ("expected calibration error", number_cell(quality.ece)),
    ]
    return [
        element("h2", "Does the probability tell the truth?"),
        element(
            "div",
            element("figure", reliability_chart(quality.bins)),
            table("The evaluator on the generator's own samples.", ("", "value"), rows),
            class_="pair",
        ),
        _note("Dots: share that held against mean predicted probability. Bars: how many samples a bin has."),
    ]


def _worlds(results: Table) -> list[Element]:
    conditions = [c for c in results.total.conditions if not c.name.startswith("strict")]
    if len(conditions) < 2:
        return []
    return [
        element("h2", "In a world that is not as told"),
        _note(
            "The same grasps with less friction, twice the mass, a wrong palm pose, and all of it together."
        ),
        *_conditions(conditions, "best 5 of each view"),
    ]


def _sure(results: Table) -> list[Element]:
    rows = [
        (
            _WORLDS.get(condition.name, condition.name),
            full_cell(condition.top1),
            *map(share_cell, condition.sure),
        )
        for condition in results.total.conditions
        if condition.sure
    ]
    columns = ("world", "always", *(f"score of {score:g} or more" for score in SURE))
    return [
        element("h2", "If the hand stays where it is unless the score is high"),
        table("The best grasp of each view: held of executed.", columns, rows),
    ]


def _strict(results: Table) -> list[Element]:
    conditions = [c for c in results.total.conditions if c.name.startswith("strict")]
    if not conditions:
        return []
    return [
        element("h2", "Strict protocol"),
        _note(_STRICT),
        *_conditions(conditions, "best 10 of 100"),
    ]


def _conditions(conditions: Sequence[ConditionCells], top: str) -> list[Element]:
    groups = (
        ("top-1", "top1"),
        (top, "top"),
        ("random samples", "random"),
        ("blind, any yaw", "blind_random_yaw"),
        ("blind, short side", "blind_short_side"),
    )
    names = [_WORLDS.get(condition.name, condition.name) for condition in conditions]
    dots = [(head, [bar("", getattr(c, group)) for c in conditions]) for head, group in groups]
    rows = [
        (name, *(full_cell(getattr(c, group)) for _, group in groups), points_cell(c.lead))
        for name, c in zip(names, conditions, strict=True)
    ]
    columns = ("world", *(head for head, _ in groups), "top-1 minus better blind")
    return [element("figure", dot_chart(names, dots)), table("", columns, rows)]


def _poses(results: Table) -> list[Element]:
    rows = [_part(row) for row in results.parts]
    columns = (
        "views",
        "number",
        "generator",
        "own best 28 %",
        "top-5",
        "top-1",
        "blind, any yaw",
        "blind, short side",
        "distinct stable",
        "types, bit",
    )
    small = f"Small: lower than {1000 * SMALL:.0f} mm as they lie."
    return [
        element("h2", "Standing, other poses, small objects"),
        table(
            f"Distinct stable grasps and grasp types: means over objects of full views. {small}",
            columns,
            rows,
        ),
    ]


def _part(row: Row) -> tuple[str | Element, ...]:
    nominal, coverage = row.nominal, row.coverage
    cells = (row.raw, row.best(WORST_SHARE).own, nominal.top, nominal.top1)
    blind = (nominal.blind_random_yaw, nominal.blind_short_side)
    distinct = number_cell(coverage.distinct, ".0f") if coverage else "-"
    entropy = number_cell(coverage.type_entropy, ".2f") if coverage else "-"
    return (row.name, str(row.views), *(full_cell(cell) for cell in (*cells, *blind)), distinct, entropy)


def _worst(results: Table) -> list[Element]:
    tried = [row for row in results.rows if row.best(WORST_SHARE).own.kept]
    hardest = sorted(tried, key=lambda row: (row.best(WORST_SHARE).own.rate, row.raw.rate))[:WORST_OBJECTS]
    rows = [
        (
            row.name,
            rate_cell(row.best(WORST_SHARE).own),
            rate_cell(row.raw),
            rate_cell(row.nominal.top),
            rate_cell(row.nominal.top1),
        )
        for row in hardest
    ]
    columns = ("object", f"own best {percent(WORST_SHARE)}", "generator", "top-5", "top-1")
    parts = [element("h2", "Hardest objects"), table("", columns, rows)]
    if results.unseen:
        names = ", ".join(f"{view.object_name} ({view.pose_name})" for view in results.unseen)
        parts.append(_note(f"Views that were not segmented, and so not counted: {names}."))
    return parts


def _figures(figures: Mapping[str, Image.Image]) -> list[Element]:
    if not figures:
        return []
    shown = [
        element(
            "figure",
            picture(image, CAPTIONS[number]),
            element("figcaption", f"Figure {number}. {CAPTIONS[number]}"),
        )
        for number, image in figures.items()
    ]
    return [element("h2", "The paper's figures, from these data"), *shown]


def _facts(title: str, facts: Mapping[str, Any]) -> list[Element]:
    rows = [
        (name.replace("_", " "), element("td", plain(value), class_="text")) for name, value in facts.items()
    ]
    return [element("h2", title), table("", ("setting", ""), rows)]


def _note(text: str) -> Element:
    return element("p", text, class_="note")
