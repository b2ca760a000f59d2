"""One visual style for every static figure, set on the objects themselves.

Matplotlib's rc parameters are global, and a context that changes them is seen by every thread; so fonts, widths and
colours are passed to each artist instead. Two controllers differ in colour, in lightness and in dash: any one suffices.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

Array = npt.NDArray[np.float64]

COLUMN_WIDTH = 3.5
"""in: one column of a two-column paper."""
PANEL_HEIGHT = 1.12
"""in: one panel of a stack."""
FURNITURE_HEIGHT = 0.58
"""in: title, time axis and legend together."""
FONT = ["STIXGeneral", "DejaVu Serif"]
TEXT_SIZE, SMALL_SIZE = 8.0, 7.0
"""pt."""
PAGE_FONT, PAGE_WIDTH, PAGE_SIZE = ["DejaVu Sans"], 11.0, 9.5
"""Of a figure as wide as a page: font like the page's, in, pt; 9.5 pt are about 14 px there."""
SMALLEST_SPAN = {"m": 0.02, "rad": 0.02}
"""Extent of a value axis below which differences mean nothing in the paper's figures."""
FRAME, GRID = "#333333", "#d9d9d9"
WINDOW_FILL, GUST_FILL, GUST_EDGE = "#f1f1f1", "#dcdcdc", "#9a9a9a"


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """How one line is drawn.

    Attributes:
        color: hex. tint: light form, for ranges. dash: on-off lengths in line widths, empty for solid. width: pt.
        layer: larger is nearer.
    """

    color: str
    tint: str = "#e0e0e0"
    dash: tuple[float, ...] = ()
    width: float = 1.0
    layer: float = 3.0

    @property
    def line(self) -> dict[str, Any]:
        """Keywords of a Matplotlib line."""
        style: Any = (0, self.dash) if self.dash else "-"
        return {"color": self.color, "linestyle": style, "linewidth": self.width, "zorder": self.layer}


# The lighter, dashed line lies over the dark, solid one: both stay visible where they agree.
LOOKS = {
    "CT": Look(color="#08306b", tint="#c3d2e6", width=1.15, layer=3.0),
    "PD": Look(color="#e6762b", tint="#f8dcc8", dash=(3.2, 1.3), layer=3.2),
    "reference": Look(color="#000000", dash=(1.0, 1.4), width=0.75, layer=3.4),
}
OTHER_LOOKS = (
    Look(color="#1b7837", dash=(6.0, 1.5, 1.0, 1.5)),
    Look(color="#762a83", dash=(6.0, 2.5)),
    Look(color="#6b6b6b", dash=(2.0, 2.0)),
)


def look(name: str, position: int = 0) -> Look:
    """The look of a controller; other controllers take the remaining looks by their position."""
    return LOOKS.get(name) or OTHER_LOOKS[position % len(OTHER_LOOKS)]


def stacked(title: str, panels: int) -> tuple[Figure, list[Axes]]:
    """A figure of one column with panels stacked over one time axis."""
    size = (COLUMN_WIDTH, FURNITURE_HEIGHT + PANEL_HEIGHT * panels)
    layout = ConstrainedLayoutEngine(w_pad=0.02, h_pad=0.02)
    figure = Figure(figsize=size, layout=layout, facecolor="white")
    FigureCanvasAgg(figure)
    grid = figure.subplots(panels, 1, sharex=True, squeeze=False)
    figure.suptitle(title, fontsize=TEXT_SIZE, family=FONT)
    axes = [dress(ax) for ax in grid[:, 0]]
    axes[-1].set_xlabel("Time [s]", fontsize=TEXT_SIZE, family=FONT)
    figure.align_ylabels(axes)
    return figure, axes


def dress(ax: Axes, *, size: float = SMALL_SIZE, family: str = FONT[0]) -> Axes:
    """Frame, grid and ticks of one panel; ticks of ``size`` pt."""
    ax.set_facecolor("white")
    ax.tick_params(labelsize=size, labelfontfamily=family, direction="in", width=0.5, length=2.5, color=FRAME)
    ax.grid(visible=True, color=GRID, linewidth=0.4)
    ax.set_axisbelow(True)
    ax.yaxis.set_major_locator(MaxNLocator(nbins=4, steps=[1, 2, 2.5, 5, 10]))
    for spine in ax.spines.values():
        spine.set_linewidth(0.5)
        spine.set_edgecolor(FRAME)
    return ax


def name_panel(ax: Axes, label: str, unit: str, letter: str) -> None:
    """Label the value axis with its SI unit; a letter names the part of the figure."""
    ax.set_ylabel(f"{label} [{unit}]", fontsize=SMALL_SIZE, family=FONT)
    if letter:
        box = {"boxstyle": "square,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}
        written = ax.text(0.012, 0.95, f"({letter})", transform=ax.transAxes, fontsize=TEXT_SIZE, family=FONT)
        written.set(verticalalignment="top", bbox=box, zorder=5)


def shade_window(ax: Axes, span: tuple[float, float]) -> Patch:
    """Mark the interval over which the metrics are taken."""
    return ax.axvspan(*span, facecolor=WINDOW_FILL, edgecolor="none", zorder=0.1)


def shade_gust(ax: Axes, span: tuple[float, float]) -> Patch:
    """Mark the interval in which the gust blows; hatched, so that it differs from the window without colour."""
    return ax.axvspan(*span, facecolor=GUST_FILL, edgecolor=GUST_EDGE, hatch="////", linewidth=0.0, zorder=0.2)


def limits(values: Iterable[Array], *, floor: bool, span: float, cap: float) -> tuple[float, float]:
    """Limits of a value axis.

    Args:
        values: what the panel shows; entries that are not finite are left out.
        floor: begin at zero (magnitudes).
        span: smallest extent, so that rounding noise does not fill a panel.
        cap: largest magnitude, so that one diverged episode does not flatten the others.

    Returns:
        (low, high).
    """
    found = np.concatenate([np.ravel(v) for v in values] or [np.zeros(1)])
    found = np.clip(found[np.isfinite(found)], -cap, cap)
    low, high = (float(found.min()), float(found.max())) if found.size else (0.0, 0.0)
    if floor:
        return 0.0, 1.07 * max(high, span / 1.07)
    missing = max(0.0, span - (high - low)) / 2
    low, high = low - missing, high + missing
    return low - 0.07 * (high - low), high + 0.07 * (high - low)


def logarithmic(axis: Axis) -> None:
    """A logarithmic axis with plain numbers at 1, 2 and 5 of each decade, which also short ranges have."""
    (axis.axes.set_xscale if axis is axis.axes.xaxis else axis.axes.set_yscale)("log")
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def legend(
    figure: Figure,
    handles: Sequence[Any],
    labels: Sequence[str],
    *,
    size: float = SMALL_SIZE,
    family: Sequence[str] = FONT,
) -> None:
    """One legend for the whole figure, below the time axis."""
    figure.legend(
        handles,
        labels,
        loc="outside lower center",
        ncols=min(len(labels), 5) or 1,
        frameon=False,
        prop={"size": size, "family": list(family)},
        handlelength=2.2,
        columnspacing=1.1,
        handletextpad=0.5,
        borderaxespad=0.1,
    )
