"""HTML and SVG as element trees, so that what is written is balanced and escaped whatever the data says."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from xml.etree import ElementTree

from PIL import Image

Element = ElementTree.Element

STYLE = """
:root { --ink: #1c222c; --faint: #5c6673; --line: #d9dee5; --wash: #f5f7f9; }
* { box-sizing: border-box; }
body { font: 15px/1.5 system-ui, -apple-system, "Segoe UI", "Helvetica Neue", Arial, sans-serif;
  color: var(--ink); background: #fff; margin: 0 auto; padding: 32px 24px 64px; max-width: 1180px; }
h1 { font-size: 26px; line-height: 1.25; margin: 0 0 4px; font-weight: 650; }
h2 { font-size: 18px; margin: 44px 0 6px; padding-top: 14px; border-top: 1px solid var(--line); }
h3 { font-size: 15px; margin: 22px 0 4px; }
p { margin: 6px 0 10px; max-width: 84ch; }
p.note, figcaption, caption { color: var(--faint); font-size: 13px; }
figure { margin: 14px 0; break-inside: avoid; }
figure img { max-width: 100%; height: auto; display: block; border-radius: 3px; }
svg { max-width: 100%; height: auto; display: block; }
svg text { font: 12px system-ui, -apple-system, "Segoe UI", Arial, sans-serif; fill: #1c222c; }
svg text.faint { fill: #5c6673; }
div.scroll { overflow-x: auto; }
table { border-collapse: collapse; margin: 10px 0 6px; font-size: 13px; font-variant-numeric: tabular-nums; }
caption { text-align: left; padding-bottom: 4px; }
th, td { padding: 4px 8px; text-align: right; white-space: nowrap; border-bottom: 1px solid var(--line); }
th { font-weight: 600; vertical-align: bottom; background: var(--wash); white-space: normal; }
th:first-child, td:first-child { text-align: left; }
td small { color: var(--faint); margin-left: 5px; }
td.tall small { display: block; margin: -3px 0 0; }
td.text { text-align: left; white-space: normal; max-width: 90ch; }
tr.total td { font-weight: 600; border-top: 2px solid var(--ink); }
tr.paper td { color: var(--faint); }
div.pair { display: flex; flex-wrap: wrap; gap: 28px; align-items: flex-start; }
@page { size: A4; margin: 14mm; }
@media print {
  body { max-width: none; padding: 0; font-size: 10pt; }
  h2 { margin-top: 20px; }
  h2, h3, p.note { break-after: avoid; }
  table, tr, figure { break-inside: avoid; }
  div.scroll { overflow: visible; }
  table { font-size: 7.5pt; }
  caption { font-size: 8pt; }
  th, td { padding: 2px 4px; }
}
"""


def element(tag: str, *children: Element | str, **attributes: object) -> Element:
    """An element with attributes, text and children in their order.

    Args:
        tag: its name.
        children: elements and pieces of text.
        attributes: values of any type; `class_` stands for class, and other underscores for hyphens.
    """
    node = ElementTree.Element(
        tag, {name.rstrip("_").replace("_", "-"): str(value) for name, value in attributes.items()}
    )
    last: Element | None = None
    for child in children:
        if not isinstance(child, str):
            node.append(child)
            last = child
        elif last is None:
            node.text = (node.text or "") + child
        else:
            last.tail = (last.tail or "") + child
    return node


def table(
    caption: str,
    columns: Sequence[str],
    rows: Sequence[Sequence[str | Element]],
    kinds: Sequence[str] | None = None,
) -> Element:
    """A table in a box that scrolls sideways.

    Args:
        caption: what it shows.
        columns: heads of the columns.
        rows: text, or `td` elements.
        kinds: class of each row, "" for none.
    """
    body = element("tbody")
    for row, kind in zip(rows, kinds or [""] * len(rows), strict=True):
        cells = [element("td", cell) if isinstance(cell, str) else cell for cell in row]
        body.append(element("tr", *cells, **({"class_": kind} if kind else {})))
    head = element("thead", element("tr", *(element("th", column) for column in columns)))
    return element("div", element("table", element("caption", caption), head, body), class_="scroll")


def picture(image: Image.Image, description: str) -> Element:
    """An image inside the document, with a text for those who cannot see it."""
    buffer = io.BytesIO()
    image.save(buffer, format="JPEG", quality=88, optimize=True)
    data = base64.b64encode(buffer.getvalue()).decode("ascii")
    return element(
        "img", src=f"data:image/jpeg;base64,{data}", alt=description, width=image.width, height=image.height
    )


def document(title: str, *body: Element) -> str:
    """A whole page that needs nothing else."""
    head = element(
        "head",
        element("meta", charset="utf-8"),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("title", title),
        element("style", STYLE),
    )
    tree = element("html", head, element("body", *body), lang="en")
    return "<!doctype html>\n" + ElementTree.tostring(tree, encoding="unicode", method="html") + "\n"
