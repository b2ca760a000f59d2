"""Interactive figures of the paper's report: logs and tables in, records for the page's script out."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from importlib import resources

import numpy as np
import numpy.typing as npt

from skyarm.log.flight_log import Log
from skyarm.simulate import Window
from skyarm.view.figures.flight_facts import gust_interval
from skyarm.view.figures.flight_panels import Panel as FlightPanel
from skyarm.view.figures.paper_figures import (
    PITCH,
    POSITION_ERROR,
    POSITION_ERRORS,
    ROLL,
    TOOL_ERROR,
    by_hold,
    joint_error,
)

Array = npt.NDArray[np.float64]
Logs = Mapping[str, Mapping[str, Log]]
Number = float | int | None
Table = Mapping[str, Mapping[str, Mapping[str, Number]]]

PATH_STRIDE = 4
"""Control instants per point of a path."""
PANEL_PIXELS, PATH_PIXELS, DAMPING_PIXELS = 132, 560, 230
LINES = {
    ("rigid_body", "CT"): "ct",
    ("rigid_body", "PD"): "pd",
    ("mujoco", "CT"): "ct-mujoco",
    ("mujoco", "PD"): "pd-mujoco",
}

DIGITS = 6
"""Decimals kept: 1 um, 1 urad, far below a pixel unless one magnifies a hundred times."""
STYLES = ("ct", "pd", "ct-mujoco", "pd-mujoco", "ct-paper", "pd-paper", "desired", "other")
"""How a line may look: classes of ``plot.css``, which knows light and dark pages."""

SCRIPTS = ("plot_parts.js", "plot_panels.js", "plot_pointer.js", "plot_path.js", "plot_page.js")


@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """One panel of values.

    Attributes:
        label: words for the axis of values. unit: SI, or "".
        span: (low, high) that is always in view, so that rounding noise does not fill the panel; None for none.
        from_zero: the axis begins at zero where no value is negative.
    """

    label: str
    unit: str = ""
    span: tuple[float, float] | None = None
    from_zero: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """One line of a panel.

    Attributes:
        panel: number of the panel. name: in the legend, which shows and hides all curves of a name at once.
        style: of :data:`STYLES`. shown: from the start.
        x0, dx: first place on the horizontal axis, and step. y: values, None for a gap. points: with dots.
    """

    panel: int
    name: str
    style: str
    shown: bool
    x0: float
    dx: float
    y: Sequence[float | None]
    points: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Path:
    """One path in space: points (x, y, z) in m, None for a gap; the rest as of a :class:`Curve`."""

    name: str
    style: str
    shown: bool
    x: Sequence[float | None]
    y: Sequence[float | None]
    z: Sequence[float | None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Shade:
    """An interval of the horizontal axis, shaded in all panels; ``name`` is "window" or "gust"."""

    name: str
    start: float
    stop: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """A button that shows the curves of these names and hides the others."""

    label: str
    names: Sequence[str]


@dataclass(frozen=True, slots=True, kw_only=True)
class PanelsFigure:
    """Curves over one horizontal axis, in panels.

    Attributes:
        axis: words for the horizontal axis, with its unit.
        height: of one panel, px. columns: of panels, where the page is wide enough.
        categories: names at 0, 1, 2 ... of the horizontal axis; empty for an axis of numbers.
    """

    axis: str
    height: int
    columns: int = 1
    categories: Sequence[str] = ()
    panels: Sequence[Panel]
    curves: Sequence[Curve]
    shades: Sequence[Shade] = ()
    choices: Sequence[Choice] = ()
    kind: str = "panels"


@dataclass(frozen=True, slots=True, kw_only=True)
class PathFigure:
    """Paths in space.

    Attributes:
        height: of the drawing, px. aspect: lengths of the box's sides x, y, z in the picture.
    """

    height: int
    aspect: tuple[float, float, float]
    curves: Sequence[Path]
    choices: Sequence[Choice] = ()
    kind: str = "path"


def figure_json(figure: PanelsFigure | PathFigure) -> str:
    """JSON of a figure; "<" is written as an escape, so that it is safe inside a script element."""
    return json.dumps(asdict(figure), allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


def rounded(values: npt.NDArray[np.float64] | Iterable[float]) -> list[float | None]:
    """Short numbers; a gap for whatever is not finite."""
    return [round(float(v), DIGITS) if np.isfinite(v) else None for v in values]


def experiment_figure(logs: Logs, window: Window | None = None) -> PanelsFigure:
    """Overlay controllers and plants of one experiment, a panel per quantity over one time axis.

    Args:
        logs: plant -> controller -> log. The first plant is drawn, the others wait in the legend.
        window: where the metrics are taken; shaded.

    Returns:
        A figure whose legend and buttons choose the curves.
    """
    flown = [log for by_controller in logs.values() for log in by_controller.values()]
    joints = min((log.joints.shape[1] for log in flown), default=0)
    quantities = [POSITION_ERROR, replace(POSITION_ERRORS[0], label="Position error x"), ROLL, PITCH]
    quantities += [*map(joint_error, range(joints)), TOOL_ERROR]
    first = next(iter(logs), "")
    curves = [
        _curve(log, quantity, i, plant, controller, plant == first)
        for plant, by_controller in logs.items()
        for controller, log in by_controller.items()
        for i, quantity in enumerate(quantities)
    ]
    shades = [Shade(name="window", start=window.start, stop=window.stop)] if window else []
    gust = next((found for found in map(gust_interval, flown) if found), None)
    shades += [Shade(name="gust", start=gust[0], stop=gust[1])] if gust else []
    return PanelsFigure(
        axis="Time [s]",
        height=PANEL_PIXELS,
        panels=list(map(_panel, quantities)),
        curves=curves,
        shades=shades,
        choices=_choices(logs),
    )


def tool_path_figure(logs: Logs, start: float = 7.5, stop: float = 21.0) -> PathFigure:
    """Show the path of the tip in the world beside the desired one.

    Args:
        logs: plant -> controller -> log.
        start: beginning of what is shown, s.
        stop: its end, s.
    """
    paths: list[Path] = []
    first = next(iter(logs), "")
    for plant, by_controller in logs.items():
        for controller, log in by_controller.items():
            first_row, last_row = (int(row) for row in np.searchsorted(log.time, [start, stop]))
            at = slice(first_row, last_row, PATH_STRIDE)
            if not paths:
                paths.append(_path(log.tool_held[at], "desired", "desired", shown=True))
            style = LINES.get((plant, controller), "other")
            paths.append(_path(log.tool[at], f"{controller}, {plant}", style, shown=plant == first))
    choices = [replace(each, names=["desired", *each.names]) for each in _choices(logs)]
    return PathFigure(height=PATH_PIXELS, aspect=(1.0, 1.0, 0.55), curves=paths, choices=choices)


def damping_figure(
    damping: Mapping[str, Table],
    paper: Table,
    metrics: Sequence[tuple[str, str, str]],
) -> PanelsFigure:
    """Plot metrics over the assumed joint damping, with the paper's value as a level.

    Args:
        damping: damping in N m s/rad, as text -> experiment -> controller -> metric -> value.
        paper: experiment -> controller -> metric -> the paper's value.
        metrics: (experiment, metric, title) of each small panel.
    """
    values = sorted(damping, key=float)
    curves = []
    for panel, (case, metric, _) in enumerate(metrics):
        for controller in ("CT", "PD"):
            style = LINES["rigid_body", controller]
            found = [_lookup(damping[value], case, controller, metric) for value in values]
            level = [_lookup(paper, case, controller, metric)] * len(values)
            lines = ((controller, style, found, True), (f"{controller}, paper", f"{style}-paper", level, False))
            curves += [
                Curve(panel=panel, name=name, style=look, shown=True, x0=0.0, dx=1.0, y=_finite(y), points=points)
                for name, look, y, points in lines
            ]
    # categories: the values span 0 to 0.05, which neither a linear nor a logarithmic axis spreads
    return PanelsFigure(
        axis="Joint damping [N m s/rad]",
        height=DAMPING_PIXELS,
        columns=3,
        categories=values,
        panels=[Panel(label=title, from_zero=True, span=(0.0, 0.0)) for _, _, title in metrics],
        curves=curves,
    )


def _panel(panel: FlightPanel) -> Panel:
    seen = (0.0, panel.span) if panel.magnitude else (-0.5 * panel.span, 0.5 * panel.span)
    return Panel(label=panel.label, unit=panel.unit, span=seen, from_zero=panel.magnitude)


def _curve(log: Log, quantity: FlightPanel, panel: int, plant: str, controller: str, shown: bool) -> Curve:
    """One curve, a point per hold of the reference; the time axis is a start and a step, not a column."""
    curve = by_hold(log, quantity.of(log))
    step = float(curve.time[1] - curve.time[0]) if curve.time.size > 1 else 1.0
    return Curve(
        panel=panel,
        name=f"{controller}, {plant}",
        style=LINES.get((plant, controller), "other"),
        shown=shown,
        x0=round(float(curve.time[0]), 9) if curve.time.size else 0.0,
        dx=round(step, 9),
        y=rounded(curve.mean),
    )


def _path(points: Array, name: str, style: str, *, shown: bool) -> Path:
    x, y, z = (rounded(column) for column in points.T)
    return Path(name=name, style=style, shown=shown, x=x, y=y, z=z)


def _lookup(table: Table, case: str, controller: str, metric: str) -> Number:
    return table.get(case, {}).get(controller, {}).get(metric)


def _finite(values: Sequence[Number]) -> list[float | None]:
    """The same numbers, unrounded: small metrics keep their digits; a gap for whatever is not finite."""
    return [float(value) if value is not None and np.isfinite(value) else None for value in values]


def _choices(logs: Logs) -> list[Choice]:
    """Buttons that show one plant or all."""
    names = {plant: [f"{controller}, {plant}" for controller in flown] for plant, flown in logs.items()}
    if len(names) < 2:
        return []
    whole = Choice(
        label="both" if len(names) == 2 else "all", names=[name for group in names.values() for name in group]
    )
    return [*(Choice(label=plant, names=group) for plant, group in names.items()), whole]


def plot_script() -> str:
    """The script that draws every interactive figure of a page, to be put into it once, at its end."""
    return "".join(_resource(name) for name in SCRIPTS)


def plot_style() -> str:
    """The styles of interactive figures, for light and dark pages."""
    return _resource("plot.css")


def _resource(name: str) -> str:
    return (resources.files(__package__) / name).read_text("utf-8")
