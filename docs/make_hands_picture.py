"""Draw the hands of other packages with their palm frames: docs/images/hands.png (needs the extra `hands`).

Usage: python docs/make_hands_picture.py
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from PIL import Image

from ffhnet.evaluation.picture import save_png
from ffhnet.evaluation.sheets import hand_picture
from ffhnet.hands import load_hand

HANDS = ("shadow", "mpl")
IMAGES = Path(__file__).parent / "images"


def main() -> None:
    """The picture."""
    with tempfile.TemporaryDirectory() as folder:
        rows = []
        for name in HANDS:
            file = Path(folder) / f"{name}.png"
            hand_picture(load_hand(name), file, size=300)
            rows.append(Image.open(file).copy())
    sheet = Image.new("RGB", (rows[0].width, sum(row.height for row in rows)))
    for number, row in enumerate(rows):
        sheet.paste(row, (0, number * row.height))
    save_png(sheet, IMAGES / "hands.png")


if __name__ == "__main__":
    main()
