"""The plot of a front: error over jitter, as SVG of a page."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from html import escape

from skyarm.tune.front import Point

WIDTH, HEIGHT, EDGE = 640.0, 300.0, 56.0
"""Of the plot, and its margin: units of the SVG."""


def short_words(point: Point) -> str:
    """A point in a few words."""
    return escape(f"tip {1e3 * point.tip:.3g} mm, jitter {point.jitter:.3g} rad/s")


def front_plot(before: Point, front: Sequence[Point]) -> str:
    """Error over jitter, both on logarithmic axes; each point of the front has a class of its number."""
    points = (before, *front)
    across = [math.log10(max(point.jitter, 1e-6)) for point in points]
    up = [math.log10(max(1e3 * point.error, 1e-6)) for point in points]
    x, y = _axis(across, EDGE, WIDTH - 16.0), _axis(up, HEIGHT - 40.0, 16.0)
    dots = [(x(a), y(b)) for a, b in zip(across, up, strict=True)]
    line = " ".join(f"{a:.1f},{b:.1f}" for a, b in dots[1:])
    circles = "".join(
        f'<circle class="point{i}" cx="{a:.1f}" cy="{b:.1f}" r="5"><title>{short_words(front[i])}</title></circle>'
        for i, (a, b) in enumerate(dots[1:])
    )
    a, b = dots[0]
    ends = "".join(
        f'<text x="{x(value):.1f}" y="{HEIGHT - 22:.1f}" text-anchor="{anchor}">{10**value:.2g}</text>'
        for value, anchor in ((min(across), "start"), (max(across), "end"))
    ) + "".join(
        f'<text x="{EDGE - 6:.1f}" y="{y(value) + 4:.1f}" text-anchor="end">{10**value:.3g}</text>'
        for value in (min(up), max(up))
    )
    return (
        f'<figure class="wide"><svg viewBox="0 0 {WIDTH:.0f} {HEIGHT:.0f}" role="img" aria-label="error over jitter">'
        f'<line class="axis" x1="{EDGE}" y1="{HEIGHT - 40}" x2="{WIDTH - 16}" y2="{HEIGHT - 40}"/>'
        f'<line class="axis" x1="{EDGE}" y1="16" x2="{EDGE}" y2="{HEIGHT - 40}"/>{ends}'
        f'<text x="{WIDTH / 2:.0f}" y="{HEIGHT - 4:.0f}" text-anchor="middle">rotor jitter, rad/s per period</text>'
        f'<text x="{EDGE + 6:.0f}" y="14">error, mm</text><polyline points="{line}"/>{circles}'
        f'<circle class="before" cx="{a:.1f}" cy="{b:.1f}" r="6">'
        f"<title>before: {short_words(before)}</title></circle>"
        f"</svg><figcaption>Both axes are logarithmic; the ring is the law as it was before.</figcaption></figure>"
    )


def _axis(values: list[float], low: float, high: float) -> Callable[[float], float]:
    """From a value to its place, with some room at both ends."""
    first, last = min(values), max(values)
    width = max(last - first, 1e-6)
    return lambda value: low + (high - low) * (0.04 + 0.92 * (value - first) / width)
