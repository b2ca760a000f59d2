"""Drawings of one control period: the stages of the closed loop, what enters each, and
the way back to the first; and the functions of users' parts that each stage calls.

    python tests/website/flight_drawing.py     writes docs/images/one_period.svg
                                               and docs/images/hooks_of_a_period.svg

It is as narrow as a phone, so that its letters stay as large as the page's; lines and
letters take the page's colour.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

DRAWING = Path(__file__).resolve().parents[2] / "docs" / "images" / "one_period.svg"
HOOKS_DRAWING = DRAWING.with_name("hooks_of_a_period.svg")
STYLE = (
    "<style>svg{color:#222}@media (prefers-color-scheme:dark){svg{color:#ddd}}</style>"
)
TITLE = (
    "One control period: surround, sense, decide, send, drive, advance, and back to"
    " surround"
)
HOOKS_TITLE = "The stages of a control period and the functions of parts that they call"
WIDTH, EDGE = 372, 8
# of the column of stages: begin, width, height of a box, row to row, px
LEFT, STAGE, HIGH, DOWN = 28, 190, 50, 80
ASIDE, INPUT = 252, 112  # of the column of inputs: begin and width
LOW, FLAT = 34, 40  # height of an input's box, from one to the next of a stage
GAP = 24  # px between two stages with hooks


@dataclass(frozen=True)
class Stage:
    """Box of a stage.

    Attributes:
        name: of the function that computes it. words: what it does.
        inputs: what enters it from aside; a word that begins with ">" leaves it.
    """

    name: str
    words: str
    inputs: tuple[str, ...] = ()


STAGES = (
    Stage("surround", "wind, contact, loads", ("world, faults",)),
    Stage("sense", "sensors, estimator", ("noise, age",)),
    Stage("decide", "law, safety layer", ("held reference", "model")),
    Stage("send", "delay of the command", ("delays",)),
    Stage("drive", "joint drives"),
    Stage("advance", "rotors, rigid bodies", ("plant", ">log: one row")),
)
"""Stages of a period in their order."""

HOOKS = {
    "surround": (("advance", "Air, Force"), ("share", "Fault")),
    "sense": (("measure", "Sensor"), ("step", "Estimator")),
    "decide": (("derivatives", "Signal"), ("law", "Controller"), ("count", "Metric")),
    "send": (),
    "drive": (("advance", "Drive"),),
    "advance": (("velocity", "Air"), ("wrenches", "Force"), ("effort", "Drive")),
}
"""Stage -> functions with the classes of users' parts that have them."""
TEST = ("test", "is the flight over?", (("fine", "Ending"),))
"""What a period begins with, as a stage of the second drawing."""


def box(
    x: float,
    y: float,
    width: float,
    height: float,
    lines: tuple[str, ...],
    kind: str = "",
) -> list[str]:
    """Rectangle with its lines of text, the first in bold letters where there are
    two.
    """
    parts = [
        f'<rect x="{x:g}" y="{y:g}" width="{width:g}" height="{height:g}"'
        f' rx="5"{kind}/>'
    ]
    first = y + height / 2 + 5 - 9 * (len(lines) - 1)
    for i, words in enumerate(lines):
        name = ' font-weight="bold"' if i == 0 and len(lines) > 1 else ""
        parts.append(
            f'<text{name} x="{x + width / 2:g}" y="{first + 18 * i:g}">{words}</text>'
        )
    return parts


def arrow(path: str) -> str:
    """Line with a head at its end."""
    return f'<path d="{path}" marker-end="url(#head)"/>'


def draw_inputs(stage: Stage, top: float) -> list[str]:
    """Boxes of what enters and leaves a stage, one below the other around its
    middle.
    """
    parts = list[str]()
    for i, words in enumerate(stage.inputs):
        middle = top + HIGH / 2 + FLAT * (i - (len(stage.inputs) - 1) / 2)
        # an arrow ends within the height of the stage's box
        at = min(max(middle, top + 10), top + HIGH - 10)
        leaves = words.startswith(">")
        parts += box(
            ASIDE,
            middle - LOW / 2,
            INPUT,
            LOW,
            (words.lstrip(">"),),
            "" if leaves else ' stroke-dasharray="4 3"',
        )
        begin, end = (LEFT + STAGE, ASIDE) if leaves else (ASIDE, LEFT + STAGE)
        parts.append(arrow(f"M{begin:g} {at:g}H{end:g}"))
    return parts


def drawing() -> str:
    """The period as SVG."""
    parts, middle = list[str](), LEFT + STAGE / 2
    for i, stage in enumerate(STAGES):
        top = EDGE + DOWN * i
        parts += box(LEFT, top, STAGE, HIGH, (stage.name, stage.words))
        parts += draw_inputs(stage, top)
        if i:
            parts.append(arrow(f"M{middle:g} {top - DOWN + HIGH:g}V{top:g}"))
    last = EDGE + DOWN * (len(STAGES) - 1)
    low = last + HIGH + 22
    parts.append(
        arrow(
            f"M{middle:g} {last + HIGH:g}V{low:g}H{EDGE:g}V{EDGE + HIGH / 2:g}H{LEFT:g}"
        )
    )
    words = (
        f'<text x="{middle + 8:g}" y="{low + 5:g}" text-anchor="start">true state, next'
        " period</text>"
    )
    return as_svg([*parts, words], low + EDGE + 6, TITLE)


def as_svg(parts: list[str], height: float, title: str) -> str:
    """A drawing of shapes and, above them, of texts."""
    head = (
        '<marker id="head" markerWidth="8" markerHeight="8" refX="7" refY="4"'
        ' orient="auto">'
    )
    return "\n".join(
        [
            (
                '<svg xmlns="http://www.w3.org/2000/svg" class="narrow" viewBox="0 0'
                f' {WIDTH} {height:g}" width="{WIDTH}" font-family="sans-serif"'
                ' font-size="14" text-anchor="middle">'
            ),
            f"<title>{title}</title>",
            STYLE,
            (
                f'<defs>{head}<path d="M0 0.5L8 4L0 7.5z"'
                ' fill="currentColor"/></marker></defs>'
            ),
            '<g fill="none" stroke="currentColor" stroke-width="1.3">',
            *(part for part in parts if not part.startswith("<text")),
            '</g><g fill="currentColor">',
            *(part for part in parts if part.startswith("<text")),
            "</g></svg>\n",
        ]
    )


def hooks_drawing() -> str:
    """The period as SVG, with the functions of users' parts beside their stage."""
    rows = [TEST, *((stage.name, stage.words, HOOKS[stage.name]) for stage in STAGES)]
    parts, top, last = list[str](), EDGE, 0
    for name, words, hooks in rows:
        high = max(HIGH, FLAT * len(hooks))
        parts += box(LEFT, top, STAGE, high, (name, words))
        for i, (function, owner) in enumerate(hooks):
            middle = top + high / 2 + FLAT * (i - (len(hooks) - 1) / 2)
            parts += box(ASIDE, middle - LOW / 2, INPUT, LOW, ())
            parts += [
                f'<text font-size="{size}"{kind} x="{ASIDE + INPUT / 2:g}"'
                f' y="{middle + down:g}">{text}</text>'
                for text, size, kind, down in (
                    (function, 13, ' font-weight="bold"', -2),
                    (owner, 12, "", 12),
                )
            ]
            parts.append(arrow(f"M{ASIDE:g} {middle:g}H{LEFT + STAGE:g}"))
        if last:
            parts.append(arrow(f"M{LEFT + STAGE / 2:g} {last:g}V{top:g}"))
        last = top + high
        top = last + GAP
    low = last + 14
    parts.append(
        arrow(
            f"M{LEFT + STAGE / 2:g} {last:g}V{low:g}H{EDGE:g}"
            f"V{EDGE + HIGH / 2:g}H{LEFT:g}"
        )
    )
    return as_svg(parts, low + EDGE, HOOKS_TITLE)


if __name__ == "__main__":
    DRAWING.write_text(drawing(), "utf-8")
    HOOKS_DRAWING.write_text(hooks_drawing(), "utf-8")
    print(DRAWING.name, HOOKS_DRAWING.name)
