"""Error of the tip over time, one line per law, on a logarithmic axis."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import FuncFormatter

from skyarm.figures import style
from skyarm.figures.style import Look
from skyarm.simulate import Log, Window

HEIGHT = 4.6
"""in."""

TEXT: dict[str, Any] = {"fontsize": style.PAGE_SIZE, "family": style.PAGE_FONT}

SMALLEST = 1e-3
"""mm: below it a crossing of zero says nothing and would stretch the axis."""

STEP = 0.05
"""s: each point is the largest error of so long a stretch, so that crossings of zero do not blacken the picture."""

LINES = (
    Look(color="#e6762b", dash=(3.2, 1.3), width=1.1),
    Look(color="#08306b", width=1.1),
    Look(color="#762a83", dash=(6.0, 1.5, 1.0, 1.5), width=1.1),
    Look(color="#1b7837", width=1.5),
)


def tip_figure(logs: Mapping[str, Log], window: Window, title: str) -> Figure:
    """Draw the errors against the continuous reference.

    Args:
        logs: name of the law -> its flight, in the order of the legend.
        window: of the metrics; shaded.
        title: of the figure.
    """
    layout = ConstrainedLayoutEngine(w_pad=0.06, h_pad=0.05)
    figure = Figure(figsize=(style.PAGE_WIDTH, HEIGHT), layout=layout, facecolor="white")
    FigureCanvasAgg(figure)
    ax = style.dress(figure.subplots(), size=style.PAGE_SIZE, family=style.PAGE_FONT[0])
    style.shade_window(ax, (window.start, window.stop))
    for (name, log), look in zip(logs.items(), LINES, strict=False):
        error = 1e3 * np.linalg.norm(log.tool - log.tool_reference, axis=1)
        every = max(1, round(STEP * float(log.info["rates_hz"]["control"])))
        whole = error.size // every * every
        highest = np.maximum(error[:whole].reshape(-1, every).max(axis=1), SMALLEST)
        label = name if log.status == "completed" else f"{name} ({log.status.replace('_', ' ')})"
        ax.plot(log.time[:whole:every], highest, label=label, **look.line)
    ax.set_yscale("log")
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.set_xlim(0.0, max((float(log.time[-1]) for log in logs.values() if log.time.size), default=1.0))
    ax.set_xlabel("Time [s]", **TEXT)
    ax.set_ylabel("Error of the tip [mm]", **TEXT)
    ax.set_title(title, **TEXT)
    handles, labels = ax.get_legend_handles_labels()
    style.legend(figure, handles, labels, size=style.PAGE_SIZE, family=style.PAGE_FONT)
    return figure
