"""Interactive figures of a page: curves over one axis as data, which uPlot (vendored, MIT) draws."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from importlib import resources

import numpy as np

from skyarm.log.flight_log import Log
from skyarm.simulate import Window
from skyarm.view.figures.flight_facts import gust_interval
from skyarm.view.figures.flight_panels import Panel
from skyarm.view.figures.paper_figures import (
    PITCH,
    POSITION_ERROR,
    POSITION_ERRORS,
    ROLL,
    TOOL_ERROR,
    by_hold,
    joint_error,
)

Logs = Mapping[str, Mapping[str, Log]]
Number = float | int | None
Table = Mapping[str, Mapping[str, Mapping[str, Number]]]

STYLES = {
    ("rigid_body", "CT"): "ct",
    ("rigid_body", "PD"): "pd",
    ("mujoco", "CT"): "ct-mujoco",
    ("mujoco", "PD"): "pd-mujoco",
}
"""Plant and law -> look of a curve (``plot_page.js``, ``plot.css``); of others "other"."""

DIGITS = 6
"""Decimals kept: 1 um, 1 urad, far below a pixel unless one magnifies a hundred times."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """One curve.

    Attributes:
        panel: its number. name: in the legend, which shows and hides all curves of a name at once.
        style: its look. shown: from the start.
        x0, dx: first place on the horizontal axis, and step. y: values, None for a gap. points: with dots.
    """

    panel: int
    name: str
    style: str
    shown: bool = True
    x0: float = 0.0
    dx: float = 1.0
    y: Sequence[float | None]
    points: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class PanelsFigure:
    """Curves over one horizontal axis, in panels.

    Attributes:
        axis: words for the horizontal axis, with its unit.
        panels: label, unit, span that is always in view, whether the axis begins at zero where no value is negative.
        curves: of all panels. shades: name ("window" or "gust"), start and stop of what is shaded in all panels.
        choices: label and names of the curves of a button that shows these alone.
        height: of one panel, px. columns: of panels, where the page is wide enough.
        categories: names at 0, 1, 2 ... of the horizontal axis; empty for an axis of numbers.
    """

    axis: str
    panels: Sequence[Mapping[str, object]]
    curves: Sequence[Curve]
    shades: Sequence[Mapping[str, object]] = ()
    choices: Sequence[Mapping[str, object]] = ()
    height: int = 150
    columns: int = 1
    categories: Sequence[str] = ()


def figure_json(figure: PanelsFigure) -> str:
    """JSON of a figure; "<" is written as an escape, so that it is safe inside a script element."""
    return json.dumps(asdict(figure), allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


def experiment_figure(logs: Logs, window: Window | None = None) -> PanelsFigure:
    """Overlay controllers and plants of one experiment, a panel per quantity over one time axis.

    Args:
        logs: plant -> controller -> log. The first plant is drawn, the others wait in the legend.
        window: where the metrics are taken; shaded.
    """
    flown = [log for by_controller in logs.values() for log in by_controller.values()]
    joints = min((log.joints.shape[1] for log in flown), default=0)
    quantities = [POSITION_ERROR, replace(POSITION_ERRORS[0], label="Position error x"), ROLL, PITCH]
    quantities += [*map(joint_error, range(joints)), TOOL_ERROR]
    names = {plant: [f"{controller}, {plant}" for controller in laws] for plant, laws in logs.items()}
    gust = next((found for found in map(gust_interval, flown) if found), None)
    spans = {"window": (window.start, window.stop) if window else None, "gust": gust}
    groups = {**names, "both" if len(names) == 2 else "all": [name for group in names.values() for name in group]}
    return PanelsFigure(
        axis="Time [s]",
        panels=list(map(_panel, quantities)),
        curves=[
            _curve(log, quantity, i, plant, controller, plant == next(iter(logs)))
            for plant, laws in logs.items()
            for controller, log in laws.items()
            for i, quantity in enumerate(quantities)
        ],
        shades=[{"name": name, "start": span[0], "stop": span[1]} for name, span in spans.items() if span],
        choices=[{"label": label, "names": group} for label, group in groups.items()] if len(names) > 1 else [],
    )


def _panel(panel: Panel) -> dict[str, object]:
    seen = (0.0, panel.span) if panel.magnitude else (-0.5 * panel.span, 0.5 * panel.span)
    return {"label": panel.label, "unit": panel.unit, "span": seen, "from_zero": panel.magnitude}


def _curve(log: Log, quantity: Panel, panel: int, plant: str, controller: str, shown: bool) -> Curve:
    """One curve, a point per hold of the reference; the time axis is a start and a step, not a column."""
    curve = by_hold(log, quantity.of(log))
    return Curve(
        panel=panel,
        name=f"{controller}, {plant}",
        style=STYLES.get((plant, controller), "other"),
        shown=shown,
        x0=round(float(curve.time[0]), 9) if curve.time.size else 0.0,
        dx=round(float(curve.time[1] - curve.time[0]), 9) if curve.time.size > 1 else 1.0,
        y=[round(float(v), DIGITS) if np.isfinite(v) else None for v in curve.mean],
    )


def plot_script() -> str:
    """The script that draws every interactive figure of a page, to be put into it once, at its end."""
    return _resource("uplot.js") + _resource("plot_page.js")


def plot_style() -> str:
    """The styles of interactive figures, for light and dark pages."""
    return _resource("uplot.css") + _resource("plot.css")


def _resource(name: str) -> str:
    return (resources.files(__package__) / name).read_text("utf-8")
