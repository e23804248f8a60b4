"""How the report writes counts, rates, intervals and settings."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ffhnet.evaluation.cells import Cell, Estimate
from ffhnet.evaluation.charts import Bar, Series
from ffhnet.evaluation.html import Element, element
from ffhnet.metrics import Interval


def bar(label: str, cell: Cell, mark: float | None = None) -> Bar:
    """A line of a bar chart."""
    return Bar(label, cell.rate, shown_interval(cell), f"{cell.successes}/{cell.kept}", mark)


def series(name: str, shares: Sequence[float], cells: Sequence[Cell]) -> Series:
    """A curve of a kept-share chart."""
    points = [(share, cell.rate) for share, cell in zip(shares, cells, strict=True)]
    return Series(name, points, [cell.interval for cell in cells])


def shown_interval(cell: Cell) -> Interval | None:
    """By bootstrap; Wilson's where all or none held or there is one object, so that no certainty is shown."""
    if cell.kept == 0:
        return None
    settled = cell.interval is None or cell.successes in (0, cell.kept)
    return cell.wilson if settled else cell.interval


def rate_cell(cell: Cell) -> str | Element:
    """Rate and counts."""
    if cell.kept == 0:
        return "-"
    return element("td", percent(cell.rate), element("small", f"{cell.successes}/{cell.kept}"))


def share_cell(cell: Cell) -> str | Element:
    """Rate, counts, and which share of the views that is."""
    if cell.kept == 0:
        return "-"
    counts = f"{cell.successes}/{cell.kept}, {percent(cell.retained)} of the views"
    return element("td", percent(cell.rate), element("small", counts))


def full_cell(cell: Cell) -> str | Element:
    """Rate, counts and interval."""
    interval = shown_interval(cell)
    if interval is None:
        return "-"
    bounds = f"{100 * interval.low:.1f} to {100 * interval.high:.1f}"
    counts = element("small", f"{cell.successes}/{cell.kept}; {bounds}")
    return element("td", f"{100 * cell.rate:.1f} %", counts, class_="tall")


def executed_cell(cell: Cell) -> str | Element:
    """Rate and counts without start collisions, as the paper counts."""
    executed = cell.kept - cell.collisions
    if executed == 0:
        return "-"
    return element(
        "td", f"{100 * cell.rate_executed:.1f} %", element("small", f"{cell.successes}/{executed}")
    )


def number_cell(estimate: Estimate, form: str = ".3f", scale: float = 1.0) -> str | Element:
    """A figure and its interval, both times `scale`."""
    if math.isnan(estimate.value):
        return "-"
    text = format(scale * estimate.value, form)
    if estimate.interval is None:
        return text
    low, high = (format(scale * end, form) for end in (estimate.interval.low, estimate.interval.high))
    return element("td", text, element("small", f"{low} to {high}"), class_="tall")


def points_cell(lead: Estimate) -> str | Element:
    """A difference of rates in points, and its interval."""
    return number_cell(lead, "+.1f", 100.0)


def percent(rate: float) -> str:
    """A rate without decimals."""
    return "-" if math.isnan(rate) else f"{100 * rate:.0f} %"


def known(rates: Iterable[float]) -> list[float]:
    """Those that are numbers."""
    return [rate for rate in rates if not math.isnan(rate)]


def plain(value: Any) -> str:
    """A setting as text."""
    if isinstance(value, Mapping):
        return "; ".join(f"{name.replace('_', ' ')} {plain(item)}" for name, item in value.items())
    if isinstance(value, (list, tuple)):
        return ", ".join(plain(item) for item in value)
    if isinstance(value, bool) or value is None:
        return {True: "yes", False: "no", None: "-"}[value]
    return f"{value:g}" if isinstance(value, float) else str(value)
