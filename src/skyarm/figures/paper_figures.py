"""Figures 3-18 of the paper from the logs of its five experiments, both controllers overlaid."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from skyarm.figures import style
from skyarm.figures.figure_list import PAPER_CATALOGUE, Panel, PaperFigure
from skyarm.figures.quantities import Quantity, by_hold, end_time, gust_interval
from skyarm.simulate import Log, Window

Array = npt.NDArray[np.float64]

VISIBLE_RANGE = 0.01
"""Share of a curve's extent above which its range within a hold is drawn; less would hide behind the line."""
LARGEST_VALUE = {"m": 5.0, "rad": float(np.pi)}
"""Where an axis stops growing with a diverged episode."""


def paper_figures(logs: Mapping[str, Mapping[str, Log]], windows: Mapping[str, Window]) -> dict[int, Figure]:
    """Draw Figures 3-18.

    Args:
        logs: experiment ("case1", "case2", "case3", "case2_gust", "case3_wind") -> controller ("CT", "PD") -> log.
        windows: where each experiment is measured; shaded.

    Returns:
        The paper's number -> figure; figures whose experiment was not flown are left out.

    Source: Barakou et al. 2026, Figures 3-18.
    """
    return {
        number: draw(number, spec, logs[spec.case], windows.get(spec.case))
        for number, spec in PAPER_CATALOGUE.items()
        if logs.get(spec.case)
    }


def draw(number: int, spec: PaperFigure, logs: Mapping[str, Log], window: Window | None = None) -> Figure:
    """Draw one figure of the paper."""
    figure, axes = style.stacked(f"Figure {number}. {spec.title}", len(spec.panels))
    handles: dict[str, Any] = {}
    for ax, panel, ends in zip(axes, spec.panels, _limits(spec.panels, logs.values()), strict=True):
        style.name_panel(ax, panel.shows.label, panel.shows.unit, panel.letter)
        handles |= _draw_lines(ax, panel.shows, logs)
        ax.set_ylim(*ends)
    for ax in axes:
        handles |= _shade(ax, logs.values(), window)
    axes[-1].set_xlim(0.0, max(map(end_time, logs.values())) or 1.0)
    style.legend(figure, list(handles.values()), list(handles))
    return figure


def _draw_lines(ax: Axes, quantity: Quantity, logs: Mapping[str, Log]) -> dict[str, Any]:
    """Draw a line per controller (mean and range of each hold) and the longest log's reference; label -> line."""
    handles: dict[str, Any] = {}
    for i, (controller, log) in enumerate(logs.items()):
        label = controller if log.status == "completed" else f"{controller} ({log.status.replace('_', ' ')})"
        curve, look = by_hold(log, quantity.of(log)), style.look(controller, i)
        wide = (curve.high - curve.low) > VISIBLE_RANGE * (curve.high.max(initial=0.0) - curve.low.min(initial=0.0))
        band = {"where": wide, "color": look.tint, "linewidth": 0.0, "zorder": look.layer - 1.0}
        ax.fill_between(curve.time, curve.low, curve.high, **band)
        (handles[label],) = ax.plot(curve.time, curve.mean, label=label, **look.line)
    if quantity.desired and logs:
        longest = max(logs.values(), key=lambda log: log.time.size)
        curve = by_hold(longest, quantity.desired(longest))
        (handles["desired"],) = ax.plot(curve.time, curve.mean, label="desired", **style.look("reference").line)
    return handles


def _shade(ax: Axes, logs: Collection[Log], window: Window | None) -> dict[str, Any]:
    """Mark the window of the metrics and the gust; returns label -> patch."""
    handles: dict[str, Any] = {}
    if window:
        handles[f"window [{window.start:g}, {window.stop:g}) s"] = style.shade_window(ax, (window.start, window.stop))
    gust = next((found for found in map(gust_interval, logs) if found), None)
    if gust:
        handles["gust"] = style.shade_gust(ax, gust)
    return handles


def _limits(panels: tuple[Panel, ...], logs: Collection[Log]) -> list[tuple[float, float]]:
    """Limits of every panel; panels of one scale share theirs."""
    curves: dict[str, list[Array]] = {}
    keys = [panel.scale or f"panel {i}" for i, panel in enumerate(panels)]
    for key, panel in zip(keys, panels, strict=True):
        reads = [read for read in (panel.shows.of, panel.shows.desired) if read]
        curves.setdefault(key, []).extend(read(log) for log in logs for read in reads)
    return [
        style.limits(
            curves[key],
            floor=panel.shows.magnitude,
            span=style.SMALLEST_SPAN[panel.shows.unit],
            cap=LARGEST_VALUE[panel.shows.unit],
        )
        for key, panel in zip(keys, panels, strict=True)
    ]
