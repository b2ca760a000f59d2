"""Drawing of Tognon's theorem: roll of a bar on two cables over time, for three
internal forces.

    python tests/website/beam_drawing.py     flies the bar, writes
                                             docs/images/beam_on_cables.svg

Lines are the closed form, dots the flights. It is as narrow as a phone; lines and
letters take the page's colour.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from pathlib import Path

# the tests' own modules, when this is run as a program
sys.path.append(str(Path(__file__).parents[1]))

import skyarm
from support.cables import beam, rate_of_beam, roll

DRAWING = Path(__file__).resolve().parents[2] / "docs" / "images" / "beam_on_cables.svg"
STYLE = (
    "<style>svg{color:#222}@media (prefers-color-scheme:dark){svg{color:#ddd}}</style>"
)
TITLE = (
    "Roll of a bar on two cables: it falls with tension, grows with compression, and"
    " stays without internal force"
)
WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 380, 290, 44, 292, 34, 244
SECONDS, DEGREES = 6.0, 40.0
START, GAIN = 0.15, 0.5  # rad and m/(N s)
PULLS = {-0.1: "compression", 0.0: "none", 0.1: "tension"}


def place(time: float, degrees: float) -> tuple[float, float]:
    """Place of a point of the diagram, px."""
    return (
        LEFT + (RIGHT - LEFT) * time / SECONDS,
        BOTTOM - (BOTTOM - TOP) * degrees / DEGREES,
    )


def closed_form(pull: float, time: float) -> float:
    """Roll (degrees) of the bar after a time (s), by the closed form."""
    return math.degrees(
        2.0
        * math.atan(math.tan(0.5 * START) * math.exp(rate_of_beam(pull, GAIN) * time))
    )


def flown(pull: float) -> list[tuple[float, float]]:
    """Times (s) and roll (degrees, to a tenth) of the bar in a flight, each half
    second.
    """
    log = skyarm.run(skyarm.scenario_from(beam(pull, GAIN, START, duration=SECONDS)))
    rows = [*zip(log.time.tolist(), roll(log).tolist(), strict=True)][::100]
    return [(time, round(math.degrees(angle), 1)) for time, angle in rows]


def words(x: float, y: float, text: str, anchor: str = "middle") -> str:
    """A label."""
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{text}</text>'


def curve(pull: float, dots: Sequence[tuple[float, float]]) -> list[str]:
    """Line and dots of an internal force."""
    points = [
        place(0.1 * k, closed_form(pull, 0.1 * k))
        for k in range(round(10 * SECONDS) + 1)
    ]
    line = "L".join(f"{x:.1f} {y:.1f}" for x, y in points)
    shown = ((x, y) for x, y in (place(*dot) for dot in dots) if y >= TOP)
    return [
        f'<path d="M{line}"/>',
        *(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.6"/>' for x, y in shown),
    ]


def drawing() -> str:
    """The diagram as SVG."""
    lines = [f'<path d="M{LEFT} {TOP}V{BOTTOM}H{RIGHT}"/>']
    texts = [
        words(LEFT, TOP - 14, "roll of the bar, degrees", "start"),
        words(LEFT + 124, HEIGHT - 8, "time, s"),
    ]
    for time in range(0, 7, 2):
        x, _ = place(time, 0.0)
        lines.append(f'<path d="M{x:.1f} {BOTTOM}v5"/>')
        texts.append(words(x, BOTTOM + 20, str(time)))
    for degrees in range(0, 41, 10):
        _, y = place(0.0, degrees)
        lines.append(f'<path d="M{LEFT} {y:.1f}h-5"/>')
        texts.append(words(LEFT - 9, y + 5, str(degrees), "end"))
    for pull, name in PULLS.items():
        lines += curve(pull, flown(pull))
        x, y = place(SECONDS, closed_form(pull, SECONDS))
        texts += [
            words(x + 8, y + 1, f"{pull:g} N".replace("-", "\u2212"), "start"),
            words(x + 8, y + 17, name, "start"),
        ]
    return "\n".join(
        [
            (
                '<svg xmlns="http://www.w3.org/2000/svg" class="narrow" viewBox="0 0'
                f' {WIDTH} {HEIGHT}" width="{WIDTH}" font-family="sans-serif"'
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
