"""The envelope in one picture: a panel for each axis, a line for each law, and where it is lost."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter

from skyarm.figures import style

ACROSS, PANEL, MARGIN = 3, 2.1, 0.6
"""Panels side by side; in: height of a panel, of the legend."""

LOW, HIGH, TOP = 0.1, 1500.0, 9000.0
"""mm: limits of errors, and of the band above them in which lost laws stand. Smaller errors move the first one down."""

LOWEST = 1e-3
"""mm, that is drawn at least."""

LINES = (
    ("#d55e00", "s", (3.2, 1.3)),
    ("#0072b2", "o", ()),
    ("#7b3294", "^", (6.0, 1.5, 1.0, 1.5)),
    ("#000000", "D", ()),
    ("#009e73", "v", (2.0, 1.2)),
    ("#a6761d", "P", (1.0, 1.2)),
    ("#666666", "X", (8.0, 2.0)),
)
"""Colour, marker and dashes of a law; any one of them suffices."""

KNOWN = ("paper_pd", "paper_ct", "l1_adaptive", "centroidal_tip", "nmpc")
"""Laws whose look is the same in every picture; others take what these leave, in order."""

TEXT: dict[str, Any] = {"fontsize": style.PAGE_SIZE, "family": style.PAGE_FONT}


def envelope_figure(axes: Mapping[str, Any], laws: Sequence[str]) -> Figure:
    """Draw the maps of an envelope.

    Args:
        axes: name -> values, unit, and of each law a point for every value (:mod:`skyarm.compare.envelope_record`).
        laws: in the order of the legend.
    """
    rows, looks, low = -(-len(axes) // ACROSS), _looks(laws), _low(axes)
    layout = ConstrainedLayoutEngine(w_pad=0.06, h_pad=0.05)
    figure = Figure(figsize=(style.PAGE_WIDTH, MARGIN + PANEL * rows), layout=layout, facecolor="white")
    FigureCanvasAgg(figure)
    panels = figure.subplots(rows, ACROSS, squeeze=False)
    for place, panel in enumerate(panels.flat):
        if place >= len(axes):
            panel.set_axis_off()
    for (name, axis), panel in zip(axes.items(), panels.flat, strict=False):
        _panel(panel, name, axis, looks, low)
        if panel in panels[:, 0]:
            panel.set_ylabel("error [mm]", **TEXT)
    style.legend(figure, _handles(looks), [*laws, "lost"], size=style.PAGE_SIZE, family=style.PAGE_FONT)
    return figure


def _low(axes: Mapping[str, Any]) -> float:
    """Lower end of the errors' scale, mm: a power of ten below all of them."""
    errors = [
        1e3 * point["judged"]
        for axis in axes.values()
        for points in axis["laws"].values()
        for point in points
        if not point["lost"] and point["judged"] > 0.0
    ]
    return min(LOW, max(LOWEST, 10.0 ** math.floor(math.log10(min(errors, default=LOW)))))


def _looks(laws: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Colour, marker and dashes of each law."""
    places = [KNOWN.index(law) for law in laws if law in KNOWN]
    free = iter([place for place in range(len(LINES) + len(laws)) if place not in places])
    return {law: _look(KNOWN.index(law) if law in KNOWN else next(free)) for law in laws}


def _handles(looks: Mapping[str, dict[str, Any]]) -> list[Line2D]:
    found = [Line2D([], [], markersize=5, **look) for look in looks.values()]
    return [*found, Line2D([], [], linestyle="none", marker="x", markersize=7, markeredgewidth=2, color=style.FRAME)]


def _look(place: int) -> dict[str, Any]:
    color, marker, dash = LINES[place % len(LINES)]
    return {"color": color, "marker": marker, "linestyle": (0, dash) if dash else "-", "linewidth": 1.3}


def _panel(panel: Axes, name: str, axis: Mapping[str, Any], looks: Mapping[str, dict[str, Any]], low: float) -> None:
    style.dress(panel, size=style.PAGE_SIZE - 1.0, family=style.PAGE_FONT[0])
    places = range(len(axis["values"]))
    panel.axhspan(HIGH, TOP, facecolor="#f6dcdc", edgecolor="none", zorder=0.2)
    for k, (law, look) in enumerate(looks.items()):
        if law in axis["laws"]:
            _law(panel, places, axis["laws"][law], look, k / len(looks), low)
    panel.set_yscale("log")
    panel.set_ylim(low, TOP)
    panel.yaxis.set_major_locator(LogLocator(numticks=9))
    panel.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}" if value <= HIGH else ""))
    panel.yaxis.set_minor_formatter(NullFormatter())
    panel.set_xlim(-0.35, len(axis["values"]) - 0.65)
    panel.xaxis.set_major_locator(FixedLocator(list(places)))
    panel.set_xticklabels([f"{value:g}" for value in axis["values"]])
    panel.set_title(f"{name.replace('_', ' ')} [{axis['unit']}]", loc="left", pad=4, **TEXT)


def _law(
    panel: Axes,
    places: Sequence[int],
    points: Sequence[Mapping[str, Any]],
    look: dict[str, Any],
    place: float,
    low: float,
) -> None:
    """Line of a law, broken where it is lost; there a cross in the band, at a share of its height from 0 to below 1."""
    error = [float("nan") if p["lost"] else min(max(1e3 * p["judged"], low), HIGH) for p in points]
    panel.plot(places, error, markersize=4, zorder=3 + place, **look)
    height = HIGH * (TOP / HIGH) ** (0.15 + 0.85 * place)
    gone = [place for place, point in zip(places, points, strict=True) if point["lost"]]
    mark: dict[str, Any] = {"linestyle": "none", "marker": "x", "markersize": 6, "markeredgewidth": 2.0}
    panel.plot(gone, [height] * len(gone), color=look["color"], zorder=4, **mark)
