"""Figures of the pages of results, drawn from their measured tables.

    python tests/website/results_drawings.py     writes docs/images/results_*.svg

A figure has a row for each row of its table: a bar where zero has a place, dots on a
logarithmic scale. Lines and letters take the page's colour.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from measured_numbers import DOCS, blocks, entries, tables

IMAGES = DOCS / "images"
STYLE = (
    "<style>svg{color:#222}@media (prefers-color-scheme:dark){svg{color:#ddd}}</style>"
)
WIDTH, ROW, TOP, LETTER = 620, 21, 34, 7.7
"""px: of the figure, a row, the first row, and about a letter."""


@dataclass(frozen=True, kw_only=True)
class Figure:
    """What a figure shows.

    Attributes:
        title: of the figure, for those who cannot see it. unit: of the scale.
        rows: label, and one number for each of ``series``. series: names of the filled
            and of the open dots. log: dots on a logarithmic scale; else bars.
    """

    title: str
    unit: str
    rows: Callable[[], list[tuple[str, Sequence[float]]]]
    series: Sequence[str] = ()
    log: bool = False


def cells(block: str, at: int = 0) -> list[list[str]]:
    """Rows of a table of a measured block, heads first."""
    page = (DOCS / entries()[block].page).read_text("utf-8")
    lines = tables(blocks(page)[block])[at]
    return [
        [cell.strip().replace("`", "") for cell in line.strip("|").split(" | ")]
        for line in (lines[0], *lines[2:])
    ]


def column(block: str, *at: int) -> list[tuple[str, Sequence[float]]]:
    """First column and others of a block, but for rows without a number."""
    rows = [(row[0], [row[k] for k in at]) for row in cells(block)[1:]]
    return [
        (name, [float(each.replace(" ", "")) for each in values])
        for name, values in rows
        if all(re.fullmatch(r"[\d. e-]*\d", each) for each in values)
    ]


def sums(block: str) -> list[tuple[str, Sequence[float]]]:
    """Sum of each column of numbers of a block."""
    heads, *rows = cells(block)
    return [
        (name, [sum(float(row[k]) for row in rows)])
        for k, name in enumerate(heads)
        if k
    ]


def engines() -> list[tuple[str, Sequence[float]]]:
    """Speeds of the engines, each with its floats."""
    return [
        (f"{row[0].replace('machine code', 'skyarm')}, {row[1]}", [float(row[2])])
        for row in cells("two-joint-arm")[1:]
    ]


def last_row(block: str) -> list[tuple[str, Sequence[float]]]:
    """Last row of a block, a number for each head."""
    heads, *_, last = cells(block)
    return [
        (name, [float(each)]) for name, each in zip(heads[1:], last[1:], strict=True)
    ]


FIGURES = {
    "results_contact": Figure(
        title="Successes of five laws in 96 flights of six tasks that press",
        unit="successes of 96",
        rows=lambda: sums("contact-laws"),
    ),
    "results_laws": Figure(
        title="Mean tip error of every law in Case 3, calm and in 2 N of wind",
        unit="mean tip error, mm",
        rows=lambda: [
            (name, (*wind, *calm))
            for (name, wind), (_, calm) in zip(
                column("laws-case3-wind", 3), column("laws-case3", 3), strict=True
            )
        ],
        series=("in 2 N of wind", "calm"),
        log=True,
    ),
    "results_survive": Figure(
        title="Lost flights of seven laws in the survive suite",
        unit="lost flights",
        rows=lambda: last_row("survive"),
    ),
    "results_identification": Figure(
        title="Error of the predicted body rate after half a second, by flight",
        unit="error of the body rate after 0.5 s, rad/s",
        rows=lambda: column("real-flights", 6, 5),
        series=("identified vehicle", "rate held constant"),
        log=True,
    ),
    "results_planning": Figure(
        title="Share of flights in which the claw caught the ball, by law",
        unit="balls caught, %",
        rows=lambda: column("caught-balls", 3),
    ),
    "performance": Figure(
        title="Simulated seconds per second of each engine over those of MuJoCo",
        unit="times as fast as mujoco.rollout",
        rows=engines,
        log=True,
    ),
}
"""Name of a drawing -> its figure."""


def text(x: float, y: float, words: str, anchor: str = "start") -> str:
    """A label."""
    safe = words.replace("&", "&amp;").replace("<", "&lt;")
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{safe}</text>'


def dot(x: float, y: float, filled: bool) -> str:
    """A dot, filled or open."""
    paint = 'fill="currentColor" stroke="none"' if filled else 'fill="none"'
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" {paint}/>'


def ticks(most: float, least: float, log: bool) -> list[float]:
    """Numbers of a scale: powers of ten, or four steps from zero."""
    if log:
        first = math.floor(math.log10(least))
        return [10.0**k for k in range(first, math.ceil(math.log10(most)) + 1)]
    step = 10.0 ** math.floor(math.log10(most))
    step *= next(each for each in (0.2, 0.5, 1.0, 2.0) if most / (each * step) <= 6)
    return [step * k for k in range(math.ceil(most / step) + 1)]


def drawing(figure: Figure) -> str:
    """The figure as SVG."""
    rows = figure.rows()
    numbers = [each for _, values in rows for each in values]
    scale = ticks(max(numbers), min(numbers), figure.log)
    left = 16 + LETTER * max(len(name) for name, _ in rows)
    right, bottom = WIDTH - 50, TOP + ROW * len(rows)

    def place(value: float) -> float:
        if figure.log:
            value, first, last = map(math.log10, (value, scale[0], scale[-1]))
        else:
            first, last = 0.0, scale[-1]
        return left + (right - left) * (value - first) / (last - first)

    lines = [f'<path d="M{left:.1f} {TOP - 8}V{bottom}H{right}"/>']
    words = [text(0.5 * (left + right), bottom + 40, figure.unit, "middle")]
    for each in scale:
        x = place(each)
        lines.append(f'<path d="M{x:.1f} {bottom}v5"/>')
        words.append(text(x, bottom + 20, f"{each:g}", "middle"))
    x = left
    for name, filled in zip(figure.series, (True, False), strict=False):
        lines.append(dot(x + 4, TOP - 22, filled))
        words.append(text(x + 14, TOP - 17, name))
        x += 40 + LETTER * len(name)
    for k, (name, values) in enumerate(rows):
        y = TOP + ROW * (k + 0.5)
        words.append(text(left - 8, y + 4, name, "end"))
        ends = [place(each) for each in values]
        if not figure.log:
            lines.append(
                f'<path d="M{left:.1f} {y - 6:.1f}H{ends[0]:.1f}v12H{left:.1f}z"'
                ' fill="currentColor"/>'
            )
            words.append(text(ends[0] + 6, y + 4, f"{values[0]:g}"))
        elif len(ends) == 1:
            lines.append(dot(ends[0], y, filled=True))
            words.append(text(ends[0] + 8, y + 4, f"{values[0]:g}"))
        else:
            lines += [dot(ends[0], y, filled=True), dot(ends[1], y, filled=False)]
    height = bottom + 48
    return "\n".join(
        [
            (
                '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0'
                f' {WIDTH} {height}" width="{WIDTH}" font-family="sans-serif"'
                ' font-size="13">'
            ),
            f"<title>{figure.title}</title>",
            STYLE,
            '<g fill="none" stroke="currentColor" stroke-width="1.3">',
            *lines,
            '</g><g fill="currentColor">',
            *words,
            "</g></svg>\n",
        ]
    )


if __name__ == "__main__":
    for name, figure in FIGURES.items():
        (IMAGES / f"{name}.svg").write_text(drawing(figure), "utf-8")
        print(f"{name}.svg")
