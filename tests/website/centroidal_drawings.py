"""Drawings of the page on the idea of the centroidal law: what a tilt does to the tip,
and the steps of one period.

python tests/website/centroidal_drawings.py     writes docs/images/centroidal_tilt.svg
                                                and centroidal_steps.svg

Both are as wide as a telephone. Lines and letters take the colour of the page around
them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "images"
STYLE = (
    "<style>svg{color:#222}@media (prefers-color-scheme:dark){svg{color:#ddd}}</style>"
)
WIDTH = 370
MARKER = (
    '<defs><marker id="head" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7"'
    ' markerHeight="7" orient="auto"><path d="M0 0.5L8 4L0 7.5z" fill="currentColor"'
    ' stroke="none"/></marker></defs>'
)

Point = tuple[float, float]


def text(
    x: float,
    y: float,
    words: str,
    *,
    anchor: str = "middle",
    size: int = 13,
    bold: bool = False,
) -> str:
    weight = ' font-weight="bold"' if bold else ""
    words = words.replace("&", "&amp;").replace("<", "&lt;")
    return (
        f'<text x="{x:g}" y="{y:g}" text-anchor="{anchor}" font-size="{size}"{weight}'
        f' fill="currentColor" stroke="none">{words}</text>'
    )


def line(
    points: Sequence[Point], *, width: float = 1.3, dash: str = "", arrow: bool = False
) -> str:
    path = "M" + "L".join(f"{x:.4g} {y:.4g}" for x, y in points)
    more = f' stroke-dasharray="{dash}"' if dash else ""
    more += ' marker-end="url(#head)"' if arrow else ""
    return f'<path d="{path}" stroke-width="{width:g}"{more}/>'


def dot(at: Point, radius: float, *, filled: bool = True) -> str:
    fill = "currentColor" if filled else "none"
    return f'<circle cx="{at[0]:.4g}" cy="{at[1]:.4g}" r="{radius:g}" fill="{fill}"/>'


def turned(at: Point, by: Point, angle: float) -> Point:
    """A point at an offset from another one, the offset turned by an angle (rad,
    clockwise on the page).
    """
    c, s = math.cos(angle), math.sin(angle)
    return at[0] + c * by[0] - s * by[1], at[1] + s * by[0] + c * by[1]


def drawing(title: str, height: float, parts: Sequence[str]) -> str:
    """An SVG that is as wide as a telephone."""
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height:g}"'
        f' width="{WIDTH}" height="{height:g}" font-family="sans-serif" fill="none"'
        ' stroke="currentColor" stroke-width="1.3">'
    )
    return (
        "\n".join([head, STYLE, f"<title>{title}</title>", MARKER, *parts, "</svg>"])
        + "\n"
    )


ARM = (46.0, 34.0)  # px, upper and lower link
LEAN = math.radians(16.0)
GOAL = (0.0, 112.0)  # of the tip, from where the base should be


def vehicle(base: Point, tilt: float, joints: Point) -> list[str]:
    """A multirotor at a point, tilted, and its arm at two angles from straight down,
    both clockwise on the page.
    """
    left, right = turned(base, (-34.0, 0.0), tilt), turned(base, (34.0, 0.0), tilt)
    parts = [line([left, right], width=4.0)]
    for end in (left, right):
        hub = turned(end, (0.0, -9.0), tilt)
        parts += [line([end, hub], width=2.0)]
        parts += [
            line(
                [turned(hub, (-15.0, 0.0), tilt), turned(hub, (15.0, 0.0), tilt)],
                width=2.0,
            )
        ]
    elbow = turned(base, (0.0, ARM[0]), joints[0])
    tip = turned(elbow, (0.0, ARM[1] + 32.0), joints[1])
    parts += [
        line([base, elbow, tip], width=3.0),
        dot(base, 4.0),
        dot(elbow, 4.0),
        dot(tip, 4.5),
    ]
    thrust = turned(base, (0.0, -46.0), tilt)
    return [*parts, line([base, thrust], arrow=True)]


def tilt_drawing() -> str:
    """Three states: calm, wind with joints on their references, wind with the tip on
    its reference.
    """
    parts, places = [], (62.0, 185.0, 308.0)
    down = 84.0
    for x in places:
        goal = (x + GOAL[0], down + GOAL[1])
        parts += [
            dot(goal, 9.0, filled=False),
            line([(x - 20.0, goal[1]), (x + 20.0, goal[1])], dash="2 3"),
        ]
        parts += [
            line([(goal[0], goal[1] - 20.0), (goal[0], goal[1] + 20.0)], dash="2 3")
        ]
    a, b, c = ((x, down) for x in places)
    parts += vehicle(a, 0.0, (0.0, 0.0))
    parts += vehicle(b, -LEAN, (-LEAN, -LEAN))
    # the links stand as on a level base; what the arm's root moves by is made good by
    # the base
    parts += vehicle(c, -LEAN, (0.0, 0.0))
    for x in places[1:]:
        parts += [line([(x - 58.0, 30.0), (x - 30.0, 30.0)], width=2.0, arrow=True)]
        parts += [text(x - 44.0, 22.0, "wind", size=12)]
    words = (
        ("calm", "level", "tip on its goal"),
        ("joints held", "base and joints", "right, tip off"),
        ("tip held", "links turn back,", "tip on its goal"),
    )
    for x, (first, *rest) in zip(places, words, strict=True):
        parts += [
            text(x, 246.0, first, bold=True),
            *(text(x, 264.0 + 16.0 * k, each) for k, each in enumerate(rest)),
        ]
    return drawing(
        "A tilted base moves the tip unless the links turn back against the tilt",
        292.0,
        parts,
    )


STEPS = (
    ("measurement", "pose, velocities, joints, accelerometer", "told"),
    ("observer", "what pushes that the model does not have?", ""),
    ("prediction", "where will the vehicle be when commands act?", ""),
    ("reference and preview", "where must base and tip be, now and soon?", ""),
    ("force on the centre of mass", "which force moves it there?", ""),
    ("attitude", "which tilt points the thrust along the force?", ""),
    ("joints", "which joint motion keeps the tip in place?", ""),
    ("inverse dynamics", "which torques make all of this happen?", ""),
    ("mixer", "which rotor speeds give thrust and torques?", ""),
    ("command", "rotor speeds, joint torques", "told"),
)
TALL, DEEP = 44.0, 60.0  # px: a box, from box to box


def steps_drawing() -> str:
    """The steps of one period from top to bottom; the command goes back to the
    observer.
    """
    parts, left, wide = [], 34.0, WIDTH - 44.0
    for k, (name, question, kind) in enumerate(STEPS):
        y = 8.0 + DEEP * k
        dashed = ' stroke-dasharray="4 3"' if kind else ""
        parts += [
            f'<rect x="{left:g}" y="{y:g}" width="{wide:g}" height="{TALL:g}"'
            f' rx="5"{dashed}/>'
        ]
        parts += [
            text(left + wide / 2, y + 18.0, name, bold=True),
            text(left + wide / 2, y + 35.0, question),
        ]
        if k:
            middle = left + wide / 2
            parts += [line([(middle, y - DEEP + TALL), (middle, y)], arrow=True)]
    low, high = 8.0 + DEEP * (len(STEPS) - 1) + TALL / 2, 8.0 + DEEP + TALL / 2
    parts += [line([(left, low), (14.0, low), (14.0, high), (left, high)], arrow=True)]
    height = 8.0 + DEEP * (len(STEPS) - 1) + TALL + 8.0
    return drawing(
        "The steps of one control period of the centroidal law, from measurement to"
        " command",
        height,
        parts,
    )


DRAWINGS = {"centroidal_tilt.svg": tilt_drawing, "centroidal_steps.svg": steps_drawing}
"""File -> function that draws it."""


def main() -> None:
    """Write both drawings."""
    for name, draw in DRAWINGS.items():
        (FOLDER / name).write_text(draw(), "utf-8")
        print(FOLDER / name)


if __name__ == "__main__":
    main()
