"""Drawing of identification by windows: measured samples, and the model flown anew in
each window.

python tests/website/identification_drawing.py     writes
                                                   docs/images/identification_windows.svg
"""

from __future__ import annotations

import math
from pathlib import Path

DRAWING = (
    Path(__file__).resolve().parents[2]
    / "docs"
    / "images"
    / "identification_windows.svg"
)
STYLE = (
    "<style>svg{color:#222}@media (prefers-color-scheme:dark){svg{color:#ddd}}</style>"
)
WIDTH, HEIGHT, LEFT, WINDOWS, LONG = 420, 316, 20, 4, 95
"""px, and how many windows of which length are drawn."""
MIDDLE, LEVEL = 118, 238
"""px from the top, of the measured rate and of the command."""
OFF = (5.0, -6.0, 4.0, -5.0)
"""px, by which the first state of each window lies off the motion before the search."""


def motion(x: float) -> float:
    """Measured rate, px from the top."""
    return MIDDLE - 34.0 * math.sin(x / 46.0) - 14.0 * math.sin(x / 17.0 + 1.0)


def words(x: float, y: float, text: str, anchor: str = "start") -> str:
    """A label."""
    return (
        f'<text x="{x:g}" y="{y:g}" text-anchor="{anchor}" fill="currentColor"'
        f' stroke="none">{text}</text>'
    )


def drawing() -> str:
    """The drawing as SVG."""
    parts = [
        words(LEFT, 22, "dots: gyroscope, with noise"),
        words(LEFT, 42, "lines: the model, flown anew in each window"),
    ]
    for k in range(WINDOWS + 1):
        x = LEFT + k * LONG
        parts.append(
            f'<path d="M{x} 58V{LEVEL + 30}" stroke-dasharray="4 4" stroke-width="1"/>'
        )
    for i in range(WINDOWS * LONG // 5):
        x = LEFT + 2.5 + 5 * i
        y = motion(x - LEFT) + 4.0 * math.sin(12.9898 * i * i + 78.2)
        parts.append(
            f'<circle cx="{x:g}" cy="{y:.1f}" r="1.7" fill="currentColor"'
            ' stroke="none"/>'
        )
    for k, off in enumerate(OFF):
        xs = [LEFT + k * LONG + LONG * j / 24 for j in range(25)]
        ys = [motion(x - LEFT) + off * (1.0 + 2.2 * j / 24) for j, x in enumerate(xs)]
        path = "L".join(f"{x:.1f} {y:.1f}" for x, y in zip(xs, ys, strict=True))
        parts += [
            f'<path d="M{path}" stroke-width="1.8"/>',
            f'<circle cx="{xs[0]:g}" cy="{ys[0]:.1f}" r="4"/>',
        ]
    levels = [LEVEL - 26.0 * math.sin(1.7 * i) for i in range(2 * WINDOWS)]
    half = LONG / 2
    steps = "".join(
        f"V{level:.1f}H{LEFT + half * (i + 1):g}" for i, level in enumerate(levels)
    )
    parts.append(f'<path d="M{LEFT} {levels[0]:.1f}{steps}" stroke-width="1.4"/>')
    parts.append(words(LEFT, 288, "steps: logged commands, the only input"))
    parts.append(words(LEFT, 308, "circles: first state of each window, free"))
    body = "\n".join(parts)
    title = (
        "Windows of a log: measured samples, and the model flown from a free first"
        " state in each window"
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}"'
        f' width="{WIDTH}" height="{HEIGHT}" font-family="sans-serif" font-size="14"'
        ' fill="none"'
        f' stroke="currentColor">\n{STYLE}\n<title>{title}</title>\n{body}\n</svg>\n'
    )


if __name__ == "__main__":
    DRAWING.write_text(drawing(), "utf-8")
