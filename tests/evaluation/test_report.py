"""The report: complete, self-contained, balanced, unmoved by empty cells; its charts against numbers."""

import base64
import dataclasses
import io
import re
from html.parser import HTMLParser
from xml.etree import ElementTree

import numpy as np
import pytest
from outcome_makers import condition, view
from PIL import Image

from ffhnet.evaluation.charts import Bar, Series, bar_chart, curve_chart, dot_chart, reliability_chart
from ffhnet.evaluation.figures import choose_views, draw_figures
from ffhnet.evaluation.html import document, element, table
from ffhnet.evaluation.outcomes import UnseenView
from ffhnet.evaluation.report import report
from ffhnet.evaluation.tables import make_table
from ffhnet.metrics import Interval, ReliabilityBin

VOID = {"meta", "img", "br", "hr", "link"}


class Reader(HTMLParser):
    """Checks that every element is closed where it must be; keeps tables as rows of text."""

    def __init__(self):
        super().__init__()
        self.open, self.rows, self.links, self.tags = [], [], [], set()

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        self.links += [value for name, value in attrs if name in ("src", "href", "xlink:href", "action")]
        if tag not in VOID:
            self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if {"td", "th"} & set(self.open):
            self.rows[-1][-1] += data


def read(text):
    reader = Reader()
    reader.feed(text)
    reader.close()
    assert reader.open == []
    return reader


def full_report(outcomes, unseen=(), figures=None, protocol=None):
    results = make_table(outcomes, list(unseen))
    return report(results, protocol or {"seed": 3}, {"cores": 2}, figures or {})


@pytest.fixture(scope="module")
def outcomes():
    stressed = (condition(), condition("friction", top=(0,)), condition("all", top=(1,)))
    can = view("can", [0.96, 0.8, 0.6, 0.1], [1, 1, 0, 0], [1, 1, 1, 0], conditions=stressed, distinct=7)
    strict = (condition("strict", top=(0, 0, 1)), condition("strict, held", top=(0, 1, 1)))
    can = dataclasses.replace(can, strict=strict)
    box = view("box", [0.4, 0.3], [0, 1], pose="lying_0", height=0.03, conditions=stressed)
    return [can, dataclasses.replace(box, strict=strict)]


def test_report_holds_the_counts(outcomes):
    reader = read(full_report(outcomes, [UnseenView("mug", "lying_1")]))
    rows = {row[0]: row[1:] for row in reader.rows if row}
    assert next(row for row in reader.rows if row[:2] == ["can", "1"])[2:4] == ["50 %2/4", "67 %2/3"]
    assert rows["FFHGenerator"][0].startswith("50.0 %3/6")
    assert rows["FFHGenerator"][1:] == ["60.0 %3/5", "61 %"]
    assert rows["strict, as the bench counts"][1].startswith("33.3 %2/6")
    assert rows["strict, from the first push"][1].startswith("66.7 %4/6")
    assert rows["friction 0.5"][0].startswith("0.0 %0/2")
    assert rows["paper, success"][1:] == ["61 %", "70 %", "75 %", "82 %", "91 %"]
    assert rows["small"][0] == "1"
    assert rows["seed"] == ["3"]
    assert rows["cores"] == ["2"]


def test_report_needs_nothing_else(outcomes):
    image = Image.new("RGB", (40, 30), (200, 30, 30))
    text = full_report(outcomes, figures={"5": image})
    reader = read(text)
    assert "script" not in reader.tags
    assert len(reader.links) == 1
    assert all(link.startswith("data:image/") for link in reader.links)
    assert not re.search(r"(https?:)?//[a-z]", re.sub(r"data:image/\S+", "", text))
    assert "url(" not in text
    assert "@import" not in text
    shown = Image.open(io.BytesIO(base64.b64decode(reader.links[0].partition(",")[2])))
    assert shown.size == image.size
    np.testing.assert_allclose(np.asarray(shown)[15, 20], (200, 30, 30), atol=4)


def test_report_of_next_to_nothing(outcomes):
    """One object, one outcome, no stress, no strict trials, no heuristic, nothing above a threshold."""
    text = full_report([view("can", [0.3, 0.2], [0, 0])])
    reader = read(text)
    assert "nan" not in re.sub(r"<style>.*</style>", "", text, flags=re.DOTALL).lower()
    assert not any(row and row[0].startswith("strict") for row in reader.rows)
    can = next(row for row in reader.rows if row[:2] == ["can", "1"])
    assert can[3:] == ["-", "-", "-", "-"]


def test_what_data_says_is_text_and_not_markup(outcomes):
    nasty = "<b>can & 'box'</b>"
    renamed = [dataclasses.replace(o, object_name=nasty) if o.object_name == "can" else o for o in outcomes]
    text = full_report(renamed, protocol={"weights": "</td><script>"})
    reader = read(text)
    assert not {"b", "script"} & reader.tags
    assert any(row and row[0] == nasty for row in reader.rows)


def test_elements_keep_order_and_escape():
    node = element("p", "a", element("b", "x < y"), "c", element("i"), "d", class_="note", data_x=1)
    text = ElementTree.tostring(node, encoding="unicode")
    assert text == '<p class="note" data-x="1">a<b>x &lt; y</b>c<i />d</p>'
    page = document("t & u", table("c", ("h",), [("v",), (element("td", "w"),)], ("", "total")))
    assert read(page).rows == [["h"], ["v"], ["w"]]
    assert page.startswith("<!doctype html>")


def shapes(svg, tag, **wanted):
    return [n for n in svg.iter(tag) if all(n.get(k.replace("_", "-")) == v for k, v in wanted.items())]


def test_bars_are_as_long_as_their_rates():
    bars = [
        Bar("half", 0.5, Interval(0.4, 0.7)),
        Bar("all", 1.0, None, "3/3", 0.25),
        Bar("none", float("nan")),
    ]
    svg = bar_chart(bars)
    half, whole = (float(rect.get("width")) for rect in svg.iter("rect"))
    assert half == pytest.approx(whole / 2, abs=0.2)
    assert len(shapes(svg, "circle")) == 2
    assert len(shapes(svg, "polygon")) == 1
    texts = [node.text for node in svg.iter("text")]
    assert {"half", "50.0 %", "100.0 %", "3/3", "none"} <= set(texts)


def test_dots_lie_at_their_rates_and_gaps_are_left_out():
    known, unknown = Bar("", 0.25, Interval(0.0, 0.5)), Bar("", float("nan"))
    svg = dot_chart(["a", "b"], [("one", [known, unknown]), ("two", [Bar("", 0.75), Bar("", 0.75)])])
    ends = sorted({float(line.get("x1")) for line in shapes(svg, "line", stroke="#e3e7ec")})
    left, right = ends[1], ends[-1]
    dots = [float(dot.get("cx")) for dot in svg.iter("circle")]
    assert [(x - left) / (right - left) for x in dots] == pytest.approx([0.25, 0.75, 0.75], abs=0.001)


def test_curves_leave_out_what_is_unknown():
    bands = [Interval(0.4, 0.6), None, Interval(0.9, 1.0)]
    svg = curve_chart([Series("s", [(0.0, 0.5), (0.5, float("nan")), (1.0, 1.0)], bands)], "x", "y")
    (line,) = svg.iter("polyline")
    (x0, y0), (x1, y1) = (map(float, point.split(",")) for point in line.get("points").split())
    assert x1 > x0
    assert y1 < y0
    (band,) = svg.iter("polygon")
    assert len(band.get("points").split()) == 4
    assert "nan" not in ElementTree.tostring(svg, encoding="unicode")


def test_reliability_bins_without_samples_are_not_drawn():
    nan = float("nan")
    svg = reliability_chart([ReliabilityBin(0, 0.5, 0, nan, nan), ReliabilityBin(0.5, 1, 4, 0.8, 0.75)])
    assert len(shapes(svg, "circle")) == 1
    assert len(shapes(svg, "rect")) == 1
    assert len(list(reliability_chart([]).iter("circle"))) == 0


def test_no_figures_without_full_views(outcomes):
    assert choose_views(outcomes, 3) == []
    hand = dataclasses.replace(outcomes[0].samples.grasps, hand="dlr_hit_ii")
    samples = dataclasses.replace(outcomes[0].samples, grasps=hand)
    assert draw_figures([dataclasses.replace(outcomes[0], samples=samples)], {}) == {}
