"""Drawing of the laws that carry a bar together: error of position and of pull by law
and condition.

    python tests/website/carrying_drawing.py     writes docs/images/carrying_laws.svg

The numbers are those of the measured table ``summary-of-carrying``. It is as narrow as
a phone; lines and letters take the page's colour.
"""

from __future__ import annotations

import math
from pathlib import Path

from measured_numbers import blocks, tables

DOCS = Path(__file__).resolve().parents[2] / "docs"
DATA = DOCS / "data" / "results_teams.md"
DRAWING = DOCS / "images" / "carrying_laws.svg"
STYLE = (
    "<style>svg{color:#222}@media (prefers-color-scheme:dark){svg{color:#ddd}}</style>"
)
TITLE = "Mean error of position and RMS error of pull of four laws in four conditions"
WIDTH, LEFT, RIGHT, ROW = 380, 84, 366, 30
CONDITIONS = {
    "noise and 5 ms": "noise",
    "a grasp 2 cm off, 10000 N/m": "grasp off",
    "2 N of wind on each vehicle, within 0.5 s": "wind",
    "all at once, drawn": "all at once",
}
LAWS = {
    "own_paths": '<path d="M{x:.1f} {y:.1f}m-4 -4l8 8m0 -8l-8 8"/>',
    "leader_follower": '<rect x="{a:.1f}" y="{b:.1f}" width="8" height="8"/>',
    "decentralised": '<circle cx="{x:.1f}" cy="{y:.1f}" r="4.5"/>',
    "object_wrench": (
        '<circle cx="{x:.1f}" cy="{y:.1f}" r="5.5" fill="currentColor"/>'
    ),
}
PANELS = (
    (3, "mean error of position, mm", 1.0, 30.0, (1, 3, 10, 30)),
    (4, "RMS error of pull, N", 0.01, 3.0, (0.01, 0.1, 1)),
)
"""Column of the table, title, ends of the axis and its ticks."""


def measured() -> list[list[str]]:
    """Rows of the table: condition, law, placed, error of position (mm), of pull
    (N).
    """
    (rows,) = tables(blocks(DATA.read_text("utf-8"))["summary-of-carrying"])
    return [
        [cell.strip(" `") for cell in row.strip("|").split("|")] for row in rows[2:]
    ]


def across(value: float, low: float, high: float) -> float:
    """Place of a value on an axis of logarithms, px."""
    return LEFT + (RIGHT - LEFT) * math.log(value / low) / math.log(high / low)


def words(x: float, y: float, text: str, anchor: str = "middle") -> str:
    """A label."""
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{text}</text>'


def mark(law: str, x: float, y: float) -> str:
    """Mark of a law."""
    return LAWS[law].format(x=x, y=y, a=x - 4.0, b=y - 4.0)


def drawing() -> str:
    """The diagram as SVG."""
    lines, texts, top = list[str](), list[str](), 74.0
    for k, law in enumerate(LAWS):
        x, y = (14.0 if k % 2 == 0 else 196.0), 18.0 + 24.0 * (k // 2)
        lines.append(mark(law, x, y - 5.0))
        texts.append(words(x + 12.0, y, law, "start"))
    for column, title, low, high, ticks in PANELS:
        bottom = top + ROW * len(CONDITIONS)
        lines.append(f'<path d="M{LEFT} {top:.0f}V{bottom:.0f}H{RIGHT}"/>')
        for tick in ticks:
            x = across(tick, low, high)
            lines.append(f'<path d="M{x:.1f} {bottom:.0f}v5"/>')
            texts.append(words(x, bottom + 20, f"{tick:g}"))
        texts.append(words(0.5 * (LEFT + RIGHT), bottom + 40, title))
        for k, (condition, name) in enumerate(CONDITIONS.items()):
            y = top + ROW * (k + 0.5)
            texts.append(words(LEFT - 8, y + 5, name, "end"))
            lines.append(
                f'<path d="M{LEFT} {y:.1f}H{RIGHT}" stroke-width="0.5" opacity="0.4"/>'
            )
            lines += [
                mark(row[1], across(float(row[column]), low, high), y)
                for row in measured()
                if row[0] == condition
            ]
        top = bottom + 62.0
    height = round(top - 14.0)
    return "\n".join(
        [
            (
                '<svg xmlns="http://www.w3.org/2000/svg" class="narrow" viewBox="0 0'
                f' {WIDTH} {height}" width="{WIDTH}" font-family="sans-serif"'
                ' font-size="14">'
            ),
            f"<title>{TITLE}</title>",
            STYLE,
            '<g fill="none" stroke="currentColor" stroke-width="1.3">',
            *lines,
            '</g><g fill="currentColor">',
            *texts,
            "</g></svg>\n",
        ]
    )


if __name__ == "__main__":
    DRAWING.write_text(drawing(), "utf-8")
    print(DRAWING.name)
