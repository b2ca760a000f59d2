"""Block diagrams of the laws as SVG, drawn from a list of boxes and arrows.

    python tests/website/block_diagrams.py     writes docs/images/laws/NAME.svg of every
                                               law in law_diagrams.py

Boxes stand on a grid of columns and rows; what the law is told of the vehicle comes in
from below. Lines and letters take the colour of the page around them; where a drawing
is a picture of its own, that of the reader's system.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

WIDTH, HEIGHT = 138, 54  # of a box, px
ACROSS, DOWN = 176, 84  # from box to box
EDGE = 14  # around all
STYLE = (
    "<style>svg{color:#222}@media (prefers-color-scheme:dark){svg{color:#ddd}}</style>"
)


@dataclass(frozen=True)
class Box:
    """A box of a diagram.

    Attributes:
        column, row: its place. lines: its words. measured: what the vehicle tells
            enters it.
        kind: "law" (a step of the law), "told" (the reference), "vehicle".
    """

    column: float
    row: float
    lines: tuple[str, ...]
    measured: bool = False
    kind: str = "law"


@dataclass(frozen=True)
class Diagram:
    """Boxes by name, and arrows (from, to, words) between them."""

    title: str
    boxes: dict[str, Box]
    arrows: Sequence[tuple[str, str, str]]


def left(box: Box) -> float:
    return EDGE + box.column * ACROSS


def top(box: Box) -> float:
    return EDGE + box.row * DOWN


def middle(box: Box) -> float:
    return top(box) + HEIGHT / 2


def escaped(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def draw_box(box: Box) -> list[str]:
    """The rectangle of a box and its words."""
    x, y = left(box), top(box)
    dashed = {"told": ' stroke-dasharray="4 3"', "vehicle": ' stroke-width="2.4"'}.get(
        box.kind, ""
    )
    parts = [
        f'<rect x="{x:g}" y="{y:g}" width="{WIDTH}" height="{HEIGHT}" rx="5"{dashed}/>'
    ]
    first = middle(box) + 4 - 7.5 * (len(box.lines) - 1)
    for i, words in enumerate(box.lines):
        parts.append(
            f'<text x="{x + WIDTH / 2:g}"'
            f' y="{first + 15 * i:g}">{escaped(words)}</text>'
        )
    return parts


def draw_arrow(begin: Box, end: Box, words: str) -> list[str]:
    """An arrow to the right, or down or up within a column; with a corner between two
    rows.
    """
    if begin.column == end.column:
        x = left(begin) + WIDTH / 2
        down = begin.row < end.row
        y0, y1 = (
            (top(begin) + HEIGHT, top(end)) if down else (top(begin), top(end) + HEIGHT)
        )
        path, place = f"M{x:g} {y0:g}V{y1:g}", (x + 5, (y0 + y1) / 2 + 4, "start")
    else:
        x0, x1 = left(begin) + WIDTH, left(end)
        y0, y1 = middle(begin), middle(end)
        # down at once, up at the end: boxes between two rows are passed on the lower
        # one
        gap = (ACROSS - WIDTH) / 2
        turn = x0 + gap if y1 > y0 else x1 - gap
        path = (
            f"M{x0:g} {y0:g}H{x1:g}"
            if y0 == y1
            else f"M{x0:g} {y0:g}H{turn:g}V{y1:g}H{x1:g}"
        )
        place = ((x0 + min(turn, x1)) / 2, y0 - 5, "middle")
    parts = [f'<path d="{path}" marker-end="url(#tip)"/>']
    if words:
        parts.append(
            f'<text x="{place[0]:g}" y="{place[1]:g}" text-anchor="{place[2]}"'
            f' font-size="11">{escaped(words)}</text>'
        )
    return parts


def draw_measurement(boxes: Sequence[Box], y: float) -> list[str]:
    """The line from the vehicle back below all boxes, with a branch up into each box
    that it is told to.
    """
    vehicle = next(box for box in boxes if box.kind == "vehicle")
    x0, ends, parts = left(vehicle) + WIDTH / 2, [], []
    for box in (box for box in boxes if box.measured):
        if any(b.column == box.column and b.row > box.row for b in boxes):
            # past the box that stands below, on its left
            ends.append(left(box) - 12)
            path = f"M{ends[-1]:g} {y:g}V{middle(box) + 14:g}H{left(box):g}"
        else:
            ends.append(left(box) + WIDTH / 4)
            path = f"M{ends[-1]:g} {y:g}V{top(box) + HEIGHT:g}"
        parts.append(f'<path d="{path}" marker-end="url(#tip)"/>')
    parts.append(f'<path d="M{x0:g} {top(vehicle) + HEIGHT:g}V{y:g}H{min(ends):g}"/>')
    parts.append(
        f'<text x="{x0 - ACROSS:g}" y="{y - 5:g}" font-size="11">measurement</text>'
    )
    return parts


def svg(diagram: Diagram) -> str:
    """The drawing of a diagram."""
    boxes = list(diagram.boxes.values())
    right = max(left(box) for box in boxes) + WIDTH + EDGE
    low = max(top(box) for box in boxes) + HEIGHT
    line = low + 26
    parts = [
        piece
        for begin, end, words in diagram.arrows
        for piece in draw_arrow(diagram.boxes[begin], diagram.boxes[end], words)
    ]
    parts += draw_measurement(boxes, line)
    for box in boxes:
        parts += draw_box(box)
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {right:g}'
        f' {line + EDGE:g}" width="{right:g}" height="{line + EDGE:g}"'
        ' font-family="sans-serif" font-size="12" fill="none" stroke="currentColor"'
        ' stroke-width="1.3">'
    )
    marker = (
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="8"'
        ' markerHeight="8" orient="auto"><path d="M0 0.5L8 4L0 7.5z"'
        ' fill="currentColor" stroke="none"/></marker></defs>'
    )
    words = [
        part.replace(
            "<text ",
            '<text fill="currentColor" stroke="none" '
            + ("" if "text-anchor" in part else 'text-anchor="middle" '),
        )
        for part in parts
    ]
    return (
        "\n".join(
            [
                head,
                STYLE,
                f"<title>{escaped(diagram.title)}</title>",
                marker,
                *words,
                "</svg>",
            ]
        )
        + "\n"
    )


def main() -> None:
    """Write the drawing of every law."""
    from law_diagrams import DIAGRAMS

    folder = Path(__file__).resolve().parents[2] / "docs" / "images" / "laws"
    folder.mkdir(parents=True, exist_ok=True)
    for name, diagram in DIAGRAMS.items():
        (folder / f"{name}.svg").write_text(svg(diagram), "utf-8")
    print(f"{len(DIAGRAMS)} drawings in {folder}", file=sys.stdout)


if __name__ == "__main__":
    main()
