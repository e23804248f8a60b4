"""Print the tables of docs/figures.md, "Grasps", from the JSON files that `ffhnet evaluate` wrote.

Usage: python docs/make_grasp_tables.py NAME=FILE.json ...
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

WORLDS = {
    "nominal": "nominal",
    "friction": "friction 0.5",
    "mass": "mass ×2",
    "pose": "palm 5 mm and 0.05 rad off",
    "all": "all three together",
    "strict, held": "strict protocol, held",
    "strict": "strict protocol, from before closing",
}


def cell(count: dict[str, Any]) -> str:
    """A rate with its counts and its interval over objects."""
    if not count["executed"]:
        return "–"
    low, high = (f"{100 * bound:.1f}" for bound in count["bootstrap95"])
    return f"{100 * count['rate']:.1f} % ({count['successes']}/{count['executed']}; {low} to {high})"


def summary(files: dict[str, dict[str, Any]]) -> str:
    """One column per evaluation and kind of pose."""
    columns = [
        (f"{name}, {part}", content[part])
        for name, content in files.items()
        for part in ("total", "standing", "other")
        if part in content
    ]
    rows: list[tuple[str, list[str]]] = [("views", [str(part["placements"]) for _, part in columns])]
    for label, key in (
        ("heuristic, executed", "heuristic"),
        ("generator, every sample", "thresholds/0.0"),
        ("best 28 % of all", "kept/0.28/global"),
        ("best 28 % of each object", "kept/0.28/own"),
        ("best 5 % of all", "kept/0.05/global"),
        ("top-5", "top5"),
        ("top-1", "top1"),
        ("blind, any yaw", "conditions/nominal/blind_random_yaw"),
        ("blind, short side", "conditions/nominal/blind_short_side"),
    ):
        cells = []
        for _, part in columns:
            for step in key.split("/"):
                part = part[step]
            cells.append(cell(part))
        rows.append((label, cells))
    return table(["", *(name for name, _ in columns)], [[label, *cells] for label, cells in rows])


def worlds(content: dict[str, Any]) -> str:
    """Top grasps and the better blind control in each world."""
    groups = ("top1", "top", "random", "blind_short_side")
    conditions = content["total"]["conditions"]
    return table(
        ["world", "top-1", "top-5 (strict: best 10 of 100)", "random", "blind, short side"],
        [
            [label, *(cell(conditions[world][group]) for group in groups)]
            for world, label in WORLDS.items()
            if world in conditions
        ],
    )


def objects(content: dict[str, Any]) -> str:
    """Table I with the counts of each object."""
    thresholds = ("0.0", "0.5", "0.7", "0.9", "0.95")

    def short(count: dict[str, Any]) -> str:
        tried = count["executed"]
        return f"{count['successes']}/{tried} {100 * count['successes'] / tried:.0f} %" if tried else "–"

    rows = [
        [
            name,
            *(short(part["thresholds"][t]) for t in thresholds),
            short(part["kept"]["0.28"]["own"]),
            short(part["top5"]),
            short(part["top1"]),
            short(part["heuristic"]),
        ]
        for name, part in [*content["objects"].items(), ("all", content["total"])]
    ]
    heads = ["object", *(f"Th {t}" for t in thresholds), "own best 28 %", "top-5", "top-1", "heuristic"]
    return table(heads, rows)


def table(heads: list[str], rows: list[list[str]]) -> str:
    """A Markdown table."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def main() -> None:
    """Print all tables."""
    files = {}
    for argument in sys.argv[1:]:
        name, _, path = argument.partition("=")
        files[name] = json.loads(Path(path).read_text(encoding="utf-8"))
    print(summary(files))
    for name, content in files.items():
        evaluator = content["evaluator"]
        print(f"\n{name}, other worlds:\n\n{worlds(content)}\n\n{name}, Table I:\n\n{objects(content)}\n")
        print(f"{name}: worst object {content['worst_object']['name']}", end="; ")
        for key in ("auroc_all", "auroc_executed", "auroc_within_view", "ece"):
            print(f"{key} {value(evaluator[key])}", end="; ")
        print(f"under 40 mm high {cell(content['small']['thresholds']['0.0'])}")
        for key, measure in (content["total"]["coverage"] or {"full_views": 0}).items():
            print(f"{key} {measure if key == 'full_views' else value(measure)}")


def value(measure: dict[str, Any]) -> str:
    """A number with its interval over objects."""
    low, high = measure["bootstrap95"]
    return f"{measure['value']:.3f} ({low:.3f} to {high:.3f})"


if __name__ == "__main__":
    main()
