"""Small SVG charts of rates: bars, dots, curves and the reliability diagram, all with their intervals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ffhnet.evaluation.html import Element, element
from ffhnet.metrics import Interval, ReliabilityBin

COLORS = ("#2a5d8f", "#c8702a", "#4f8f5b", "#8a6bb1", "#7d8794")
_INK = "#1c222c"
_FAINT = "#5c6673"
_GRID = "#e3e7ec"
_PALE = "#c9d7e6"


@dataclass(frozen=True)
class Bar:
    """One line of a bar chart.

    Attributes:
        label: what it is.
        value: a rate in 0..1; NaN where there is none.
        interval: its 95 % interval.
        text: counts, written beside the bar.
        mark: another rate to compare with, or None.
    """

    label: str
    value: float
    interval: Interval | None = None
    text: str = ""
    mark: float | None = None


@dataclass(frozen=True)
class Series:
    """A named curve, or a named set of points.

    Attributes:
        name: for the legend.
        points: (x, y) in 0..1; points with NaN are left out.
        intervals: of each y, or None.
        line: whether the points are joined.
    """

    name: str
    points: Sequence[tuple[float, float]]
    intervals: Sequence[Interval | None] | None = None
    line: bool = True


def bar_chart(bars: Sequence[Bar], mark_name: str = "", width: int = 860) -> Element:
    """Horizontal bars from 0 to 100 % with whiskers; marks are small diamonds."""
    left, right, step, top = 250, 210, 26, 24
    height = top + step * len(bars) + 26
    frame = _Frame(left, top, width - left - right, step * len(bars))
    svg = _svg(width, height, "Rates with 95 % intervals")
    _vertical_grid(svg, frame)
    for i, bar in enumerate(bars):
        y = top + step * (i + 0.5)
        svg.append(_text(left - 10, y + 4, bar.label, anchor="end"))
        if not _known(bar.value):
            svg.append(_text(left + 4, y + 4, "none", faint=True))
            continue
        size = {"x": left, "y": y - 8, "width": _round(frame.x(bar.value) - left), "height": 16}
        svg.append(element("rect", fill=_PALE, **size))
        if bar.interval is not None:
            _whisker(svg, frame.x(bar.interval.low), frame.x(bar.interval.high), y, COLORS[0])
        svg.append(element("circle", cx=_round(frame.x(bar.value)), cy=y, r=3.5, fill=COLORS[0]))
        if bar.mark is not None and _known(bar.mark):
            x = frame.x(bar.mark)
            points = f"{x:.1f},{y - 6} {x + 6:.1f},{y} {x:.1f},{y + 6} {x - 6:.1f},{y}"
            svg.append(element("polygon", points=points, fill="#fff", stroke=COLORS[1], stroke_width=1.8))
        svg.append(_text(frame.right + 10, y + 4, f"{100 * bar.value:.1f} %"))
        svg.append(_text(frame.right + 66, y + 4, bar.text, faint=True))
    if mark_name:
        points = f"{left},{top - 18} {left + 6},{top - 12} {left},{top - 6} {left - 6},{top - 12}"
        svg.append(element("polygon", points=points, fill="#fff", stroke=COLORS[1], stroke_width=1.8))
        svg.append(_text(left + 12, top - 8, mark_name, faint=True))
    return svg


def dot_chart(
    labels: Sequence[str], series: Sequence[tuple[str, Sequence[Bar]]], width: int = 860
) -> Element:
    """One line of dots per label and one colour per series, with whiskers.

    Args:
        labels: of the groups.
        series: name and one bar per label.
        width: pixels.
    """
    left, right, lane, gap, top = 200, 30, 13, 12, 30
    group = lane * len(series) + gap
    frame = _Frame(left, top, width - left - right, group * len(labels))
    svg = _svg(width, top + group * len(labels) + 26, "Rates under each condition with 95 % intervals")
    _vertical_grid(svg, frame)
    _legend(svg, [name for name, _ in series], left, 12)
    for i, label in enumerate(labels):
        start = top + group * i + gap / 2
        svg.append(_text(left - 10, start + (group - gap) / 2 + 4, label, anchor="end"))
        if i:
            svg.append(_line(0, top + group * i, width - right, top + group * i, _GRID))
        for k, (_, bars) in enumerate(series):
            bar, y, color = bars[i], start + lane * (k + 0.5), COLORS[k % len(COLORS)]
            if not _known(bar.value):
                continue
            if bar.interval is not None:
                _whisker(svg, frame.x(bar.interval.low), frame.x(bar.interval.high), y, color)
            svg.append(element("circle", cx=_round(frame.x(bar.value)), cy=_round(y), r=4, fill=color))
    return svg


def curve_chart(
    series: Sequence[Series],
    x_label: str,
    y_label: str,
    y_low: float = 0.0,
    size: tuple[int, int] = (540, 380),
) -> Element:
    """Curves over 0..100 %, with bands for their intervals; series without a line are drawn as diamonds.

    Args:
        series: what is drawn.
        x_label: of the axis of shares.
        y_label: of the axis of rates.
        y_low: where the y axis begins; values below are drawn there.
        size: width and height, pixels.
    """
    width, height = size
    frame = _Frame(56, 30, width - 76, height - 84, y_low)
    svg = _svg(width, height, f"{y_label} against {x_label}")
    _vertical_grid(svg, frame)
    _horizontal_grid(svg, frame)
    _legend(svg, [one.name for one in series], 56, 12)
    for k, one in enumerate(series):
        color = COLORS[k % len(COLORS)]
        known = [i for i, (x, y) in enumerate(one.points) if _known(x) and _known(y)]
        at = [(frame.x(one.points[i][0]), frame.y(one.points[i][1])) for i in known]
        if one.intervals is not None:
            band = [(x, one.intervals[i]) for (x, _), i in zip(at, known, strict=True)]
            upper = [(x, frame.y(b.high)) for x, b in band if b is not None]
            lower = [(x, frame.y(b.low)) for x, b in band if b is not None]
            shape = _points([*upper, *reversed(lower)])
            svg.append(element("polygon", points=shape, fill=color, fill_opacity=0.14))
        if one.line:
            svg.append(element("polyline", points=_points(at), fill="none", stroke=color, stroke_width=2))
            continue
        for x, y in at:
            diamond = _points([(x, y - 6), (x + 6, y), (x, y + 6), (x - 6, y)])
            svg.append(element("polygon", points=diamond, fill="#fff", stroke=color, stroke_width=1.8))
    _axis_labels(svg, frame, x_label, y_label, height)
    return svg


def reliability_chart(bins: Sequence[ReliabilityBin], size: tuple[int, int] = (420, 380)) -> Element:
    """Observed against predicted rate; below, how many samples each bin has. The diagonal is the truth."""
    width, height = size
    frame = _Frame(56, 30, width - 76, height - 84)
    svg = _svg(width, height, "Observed against predicted success rate")
    _vertical_grid(svg, frame)
    _horizontal_grid(svg, frame)
    most = max((b.count for b in bins), default=0)
    for b in bins:
        if b.count and _known(b.predicted):
            tall = 0.25 * frame.height * b.count / most
            left, top = _round(frame.x(b.predicted) - 9), _round(frame.bottom - tall)
            hint = element("title", f"{b.count} samples")
            svg.append(element("rect", hint, x=left, y=top, width=18, height=_round(tall), fill=_PALE))
    svg.append(_line(frame.x(0), frame.y(0), frame.x(1), frame.y(1), _FAINT, dashed=True))
    at = [
        (frame.x(b.predicted), frame.y(b.observed))
        for b in bins
        if b.count and _known(b.predicted) and _known(b.observed)
    ]
    svg.append(element("polyline", points=_points(at), fill="none", stroke=COLORS[0], stroke_width=2))
    for x, y in at:
        svg.append(element("circle", cx=_round(x), cy=_round(y), r=4, fill=COLORS[0]))
    _axis_labels(svg, frame, "predicted probability", "share that held", height)
    return svg


@dataclass(frozen=True)
class _Frame:
    """Where a chart's rates lie in its picture."""

    left: float
    top: float
    width: float
    height: float
    y_low: float = 0.0

    @property
    def right(self) -> float:
        return self.left + self.width

    @property
    def bottom(self) -> float:
        return self.top + self.height

    def x(self, rate: float) -> float:
        return self.left + self.width * min(max(rate, 0.0), 1.0)

    def y(self, rate: float) -> float:
        share = (rate - self.y_low) / (1 - self.y_low)
        return self.bottom - self.height * min(max(share, 0.0), 1.0)


def _svg(width: float, height: float, description: str) -> Element:
    box = f"0 0 {width} {height}"
    return element("svg", element("title", description), width=width, height=height, viewBox=box, role="img")


def _vertical_grid(svg: Element, frame: _Frame) -> None:
    for tick in range(0, 101, 20):
        x = frame.x(tick / 100)
        svg.append(_line(x, frame.top, x, frame.bottom, _GRID))
        svg.append(_text(x, frame.bottom + 16, f"{tick} %", anchor="middle", faint=True))


def _horizontal_grid(svg: Element, frame: _Frame) -> None:
    first = math.ceil(frame.y_low * 10) * 10
    for tick in range(first, 101, 20 if frame.y_low < 0.4 else 10):
        y = frame.y(tick / 100)
        svg.append(_line(frame.left, y, frame.right, y, _GRID))
        svg.append(_text(frame.left - 6, y + 4, f"{tick} %", anchor="end", faint=True))


def _axis_labels(svg: Element, frame: _Frame, x_label: str, y_label: str, height: float) -> None:
    svg.append(_text(frame.left + frame.width / 2, height - 12, x_label, anchor="middle"))
    y = frame.top + frame.height / 2
    label = _text(12, y, y_label, anchor="middle")
    label.set("transform", f"rotate(-90 12 {y:.1f})")
    svg.append(label)


def _legend(svg: Element, names: Sequence[str], left: float, y: float) -> None:
    x = left
    for k, name in enumerate(names):
        svg.append(element("rect", x=x, y=y - 5, width=10, height=10, fill=COLORS[k % len(COLORS)]))
        svg.append(_text(x + 15, y + 4, name))
        x += 34 + 7 * len(name)


def _whisker(svg: Element, low: float, high: float, y: float, color: str) -> None:
    svg.append(_line(low, y, high, y, color, thick=1.6))
    for end in (low, high):
        svg.append(_line(end, y - 4, end, y + 4, color, thick=1.6))


def _line(
    x1: float, y1: float, x2: float, y2: float, color: str, thick: float = 1.0, dashed: bool = False
) -> Element:
    ends = {"x1": _round(x1), "y1": _round(y1), "x2": _round(x2), "y2": _round(y2)}
    line = element("line", stroke=color, stroke_width=thick, **ends)
    if dashed:
        line.set("stroke-dasharray", "4 4")
    return line


def _text(x: float, y: float, text: str, anchor: str = "start", faint: bool = False) -> Element:
    node = element("text", text, x=_round(x), y=_round(y), text_anchor=anchor)
    if faint:
        node.set("class", "faint")
    return node


def _points(at: Sequence[tuple[float, float]]) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in at)


def _round(value: float) -> str:
    return f"{value:.1f}"


def _known(value: float) -> bool:
    return math.isfinite(value)
