"""Every kind of `skyarm plot` as a thumbnail, on one sheet.

python tests/website/plot_kinds.py     writes docs/images/plot_kinds.png
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

import skyarm
from skyarm.view.figures.flight_panels import KINDS, PATH

SHEET = Path(__file__).resolve().parents[2] / "docs" / "images" / "plot_kinds.png"
FLIGHTS = {
    "team": ("two_hold_a_bar", None),
    "contact": ("press_and_hold", None),
    "parts": ("press_and_hold", None),
    PATH: ("press_and_hold", None),
}
"""Kind -> shipped scenario and controller; the others draw a gust."""
GUST = ("case2_gust", "paper_ct")
WIDTH, HEIGHT, LABEL, COLUMNS = 340, 300, 30, 3  # px of a cell, cells in a row


def main() -> None:
    """Fly, draw and lay out."""
    kinds, logs = [*KINDS, PATH], {}
    rows = -(-len(kinds) // COLUMNS)
    sheet = Image.new("RGB", (COLUMNS * WIDTH, rows * (HEIGHT + LABEL)), "white")
    words = ImageDraw.Draw(sheet)
    font = ImageFont.load_default(18)
    with tempfile.TemporaryDirectory() as folder:
        for k, kind in enumerate(kinds):
            name, controller = flight = FLIGHTS.get(kind, GUST)
            if flight not in logs:
                logs[flight] = skyarm.run(
                    skyarm.load_scenario(name, controller=controller)
                )
            file = Path(folder) / f"{kind}.png"
            skyarm.plot(logs[flight], file, kind=kind)
            picture = Image.open(file).convert("RGB")
            picture.thumbnail((WIDTH - 16, HEIGHT - 8))
            x, y = k % COLUMNS * WIDTH, k // COLUMNS * (HEIGHT + LABEL)
            words.text((x + 8, y + 4), f"--kind {kind}", "black", font)
            sheet.paste(picture, (x + (WIDTH - picture.width) // 2, y + LABEL))
    sheet.quantize(64).save(SHEET, optimize=True)


if __name__ == "__main__":
    main()
