"""One picture of what the experiments show: the tool's path, its error, and the base in a gust."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from skyarm.figures import style
from skyarm.figures.quantities import TOOL_ERROR, by_hold, gust_interval, position_error
from skyarm.simulate import Log, Window

WIDTH, HEIGHT = 9.0, 2.9
"""in: the width of a web page's column."""

MILLIMETRES = 1e3


def overview_figure(logs: Mapping[str, Mapping[str, Log]], steady: Window) -> Figure:
    """Draw three panels: path of the tip from above and its error (Case 3), base along the gust (Case 2).

    Args:
        logs: experiment ("case3", "case2_gust") -> controller -> log.
        steady: part of the flight whose path is drawn.
    """
    figure = Figure(figsize=(WIDTH, HEIGHT), layout=ConstrainedLayoutEngine(w_pad=0.05, h_pad=0.03), facecolor="white")
    FigureCanvasAgg(figure)
    axes = [style.dress(ax) for ax in figure.subplots(1, 3)]
    handles = _path(axes[0], logs["case3"], steady)
    _curves(axes[1], logs["case3"], TOOL_ERROR.of, "Case 3: tip error [mm]", (7.5, 20.5))
    _curves(axes[2], logs["case2_gust"], position_error(0).of, "Case 2, 2 N gust: base x error [mm]", (5.0, 17.0))
    gust = gust_interval(next(iter(logs["case2_gust"].values())))
    if gust:
        handles["gust"] = style.shade_gust(axes[2], gust)
    style.legend(figure, list(handles.values()), list(handles))
    return figure


def _title(ax: Axes, text: str, across: str) -> None:
    ax.set_title(text, fontsize=style.TEXT_SIZE, family=style.FONT)
    ax.set_xlabel(across, fontsize=style.TEXT_SIZE, family=style.FONT)


def _path(ax: Axes, logs: Mapping[str, Log], steady: Window) -> dict[str, Any]:
    """Path of the tool over the steady window, seen from above; label -> line."""
    handles: dict[str, Any] = {}
    for i, (controller, log) in enumerate(logs.items()):
        at = steady.of(log)
        (handles[controller],) = ax.plot(*log.tool[at, :2].T, label=controller, **style.look(controller, i).line)
        desired = log.tool_reference[at, :2]
    (handles["desired"],) = ax.plot(*desired.T, label="desired", **style.look("reference").line)
    ax.set_aspect("equal", adjustable="datalim")
    _title(ax, "Case 3: tip from above, 10 to 20 s", "x [m]")
    ax.set_ylabel("y [m]", fontsize=style.TEXT_SIZE, family=style.FONT)
    return handles


def _curves(ax: Axes, logs: Mapping[str, Log], read: Any, title: str, span: tuple[float, float]) -> None:
    shown = []
    for i, (controller, log) in enumerate(logs.items()):
        curve = by_hold(log, read(log))
        ax.plot(curve.time, MILLIMETRES * curve.mean, **style.look(controller, i).line)
        shown.append(MILLIMETRES * curve.mean[(curve.time >= span[0]) & (curve.time < span[1])])
    ax.set_xlim(*span)
    ax.set_ylim(*style.limits(shown, floor=bool(np.min(np.concatenate(shown)) >= 0.0), span=20.0, cap=2e3))
    _title(ax, title, "Time [s]")
