"""Interactive figures: logs and tables in, plotly Figure out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from skyarm.figures.quantities import (
    PITCH,
    POSITION_ERROR,
    ROLL,
    TOOL_ERROR,
    Quantity,
    by_hold,
    gust_interval,
    joint_error,
    position_error,
)
from skyarm.figures.style import SMALLEST_SPAN, WINDOW_FILL
from skyarm.simulate import Log, Window

Array = npt.NDArray[np.float64]
Logs = Mapping[str, Mapping[str, Log]]
Number = float | int | None
Table = Mapping[str, Mapping[str, Mapping[str, Number]]]

DIGITS = 6
"""Decimals kept: 1 um, 1 urad, far below a pixel unless one magnifies a hundred times."""
PATH_STRIDE = 4
"""Control instants per point of a path."""
PANEL_PIXELS = 128
LINES = {
    ("rigid_body", "CT"): {"color": "#08306b", "dash": "solid", "width": 1.6},
    ("rigid_body", "PD"): {"color": "#e6762b", "dash": "dash", "width": 1.6},
    ("mujoco", "CT"): {"color": "#3a8fc4", "dash": "dot", "width": 1.6},
    ("mujoco", "PD"): {"color": "#8c3b00", "dash": "dashdot", "width": 1.6},
}
OTHER_LINE = {"color": "#6b6b6b", "dash": "longdash", "width": 1.4}
FONT = {"family": "system-ui, sans-serif", "size": 12, "color": "#222222"}


def experiment_figure(logs: Logs, window: Window | None = None) -> go.Figure:
    """Overlay controllers and plants of one experiment, a panel per quantity over one time axis.

    Args:
        logs: plant -> controller -> log. The first plant is drawn, the others wait in the legend.
        window: where the metrics are taken; shaded.

    Returns:
        A figure whose legend and buttons choose the curves.
    """
    flown = [log for by_controller in logs.values() for log in by_controller.values()]
    joints = min((log.joints.shape[1] for log in flown), default=0)
    panels = [POSITION_ERROR, replace(position_error(0), label="Position error x"), ROLL, PITCH]
    panels += [*map(joint_error, range(joints)), TOOL_ERROR]
    figure = make_subplots(rows=len(panels), cols=1, shared_xaxes=True, vertical_spacing=0.02)
    first = next(iter(logs), "")
    for plant, by_controller in logs.items():
        for controller, log in by_controller.items():
            for row, panel in enumerate(panels, start=1):
                figure.add_trace(_curve(log, panel, plant, controller, plant == first, row == 1), row=row, col=1)
    for row, panel in enumerate(panels, start=1):
        title, span = f"{panel.label}<br>[{panel.unit}]", SMALLEST_SPAN[panel.unit]
        shown = [0.0, span] if panel.magnitude else [-0.5 * span, 0.5 * span]
        figure.update_yaxes(title_text=title, autorangeoptions_include=shown, row=row, col=1)
    figure.update_xaxes(title_text="Time [s]", row=len(panels), col=1)
    figure.update_layout(**_layout(PANEL_PIXELS * len(panels) + 130), updatemenus=_plant_buttons(figure, list(logs)))
    _shade(figure, (window.start, window.stop) if window else None, "window", WINDOW_FILL)
    _shade(figure, next((found for found in map(gust_interval, flown) if found), None), "gust", "#d0d0d0")
    return _plain_axes(figure)


def tool_path_figure(logs: Logs, start: float = 7.5, stop: float = 21.0) -> go.Figure:
    """Show the path of the end effector in the world beside the desired one.

    Args:
        logs: plant -> controller -> log.
        start: beginning of what is shown, s.
        stop: its end, s.
    """
    figure = go.Figure()
    first = next(iter(logs), "")
    for plant, by_controller in logs.items():
        for controller, log in by_controller.items():
            first_row, last_row = (int(row) for row in np.searchsorted(log.time, [start, stop]))
            at = slice(first_row, last_row, PATH_STRIDE)
            if plant == first and not figure.data:
                figure.add_trace(_path(log.tool_held[at], "desired", {"color": "#000000", "dash": "dot", "width": 3}))
            style = {**LINES.get((plant, controller), OTHER_LINE), "width": 4}
            path = _path(log.tool[at], f"{controller}, {plant}", style)
            figure.add_trace(path.update(visible=True if plant == first else "legendonly"))
    axes = {f"{axis}axis": {"title": {"text": f"{axis} [m]"}, "gridcolor": "#cccccc"} for axis in "xyz"}
    shape = {"aspectmode": "manual", "aspectratio": {"x": 1.0, "y": 1.0, "z": 0.55}, "dragmode": "turntable"}
    camera = {"eye": {"x": 1.05, "y": 1.05, "z": 0.55}}
    figure.update_layout(**_layout(560), scene={**axes, **shape, "camera": camera})
    return figure


def damping_figure(
    damping: Mapping[str, Table],
    paper: Table,
    metrics: Sequence[tuple[str, str, str]],
) -> go.Figure:
    """Plot metrics over the assumed joint damping, with the paper's value as a level.

    Args:
        damping: damping in N m s/rad, as text -> experiment -> controller -> metric -> value.
        paper: experiment -> controller -> metric -> the paper's value.
        metrics: (experiment, metric, title) of each small panel.
    """
    values = sorted(damping, key=float)
    columns = min(3, len(metrics)) or 1
    titles = [title for _, _, title in metrics]
    rows = -(-len(metrics) // columns) or 1
    figure = make_subplots(rows=rows, cols=columns, subplot_titles=titles, vertical_spacing=0.36 / rows)
    for i, (case, metric, _) in enumerate(metrics):
        place = {"row": i // columns + 1, "col": i % columns + 1}
        for controller in ("CT", "PD"):
            line = LINES["rigid_body", controller]
            found = [_lookup(damping[value], case, controller, metric) for value in values]
            level = _lookup(paper, case, controller, metric)
            marks = {"mode": "lines+markers", "line": line, "marker": _marker(controller)}
            group = {"legendgroup": controller, "showlegend": i == 0}
            figure.add_trace(go.Scatter(x=values, y=found, name=controller, **marks, **group), **place)
            stated = {"mode": "lines", "line": {**line, "width": 0.9, "dash": "dot"}, "hoverinfo": "name+y"}
            group = {"legendgroup": f"{controller} paper", "showlegend": i == 0}
            levels = [level] * len(values)
            figure.add_trace(go.Scatter(x=values, y=levels, name=f"{controller}, paper", **stated, **group), **place)
    # text categories: the values span 0 to 0.05, which neither a linear nor a logarithmic axis spreads
    figure.update_xaxes(type="category", title_text="Joint damping [N m s/rad]", title_standoff=4)
    figure.update_yaxes(rangemode="tozero")
    figure.update_layout(**_layout(290 * rows + 100))
    figure.update_layout(legend={"x": 0.0, "xanchor": "left", "y": 1.0 + 0.12 / rows})
    figure.update_annotations(font_size=12)
    return _plain_axes(figure)


def _curve(log: Log, panel: Quantity, plant: str, controller: str, visible: bool, named: bool) -> go.Scatter:
    """One curve, a point per hold of the reference; the time axis is a start and a step, not a column."""
    curve = by_hold(log, panel.of(log))
    step = float(curve.time[1] - curve.time[0]) if curve.time.size > 1 else 1.0
    name = f"{controller}, {plant}"
    return go.Scatter(
        x0=round(float(curve.time[0]), 9) if curve.time.size else 0.0,
        dx=round(step, 9),
        y=_rounded(curve.mean),
        name=name,
        legendgroup=name,
        showlegend=named,
        visible=True if visible else "legendonly",
        mode="lines",
        line={**LINES.get((plant, controller), OTHER_LINE), "simplify": True},
        hovertemplate=f"%{{y:.4f}} {panel.unit}",
        meta=plant,
    )


def _path(points: Array, name: str, line: Mapping[str, Any]) -> go.Scatter3d:
    x, y, z = (_rounded(column) for column in points.T)
    return go.Scatter3d(x=x, y=y, z=z, name=name, mode="lines", line=dict(line))


def _rounded(values: Array) -> list[float | None]:
    """Short numbers; a gap for whatever is not finite."""
    return [round(float(v), DIGITS) if np.isfinite(v) else None for v in values]


def _lookup(table: Table, case: str, controller: str, metric: str) -> Number:
    return table.get(case, {}).get(controller, {}).get(metric)


def _marker(controller: str) -> dict[str, Any]:
    return {"symbol": "circle" if controller == "CT" else "square-open", "size": 7}


def _plant_buttons(figure: go.Figure, plants: Iterable[str]) -> list[dict[str, Any]]:
    """Buttons that show one plant or all."""
    names = list(plants)
    if len(names) < 2:
        return []
    owners = [trace.meta for trace in figure.data]
    choices = [(name, {name}) for name in names] + [("both" if len(names) == 2 else "all", set(names))]
    buttons = [
        {
            "label": label,
            "method": "restyle",
            "args": ["visible", [True if owner in chosen else "legendonly" for owner in owners]],
        }
        for label, chosen in choices
    ]
    place = {"x": 0.0, "xanchor": "left", "y": 1.0, "yanchor": "bottom", "pad": {"b": 8, "t": 0}}
    return [{"type": "buttons", "direction": "right", "buttons": buttons, "showactive": True, **place}]


def _shade(figure: go.Figure, span: tuple[float, float] | None, name: str, fill: str) -> None:
    if span:
        figure.add_vrect(
            x0=span[0], x1=span[1], fillcolor=fill, line_width=0, layer="below", row="all", col=1, name=name
        )


def _layout(height: float) -> dict[str, Any]:
    """Layout without a page's background, so that the page's own shows through."""
    return {
        "template": "none",
        "height": height,
        "font": FONT,
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "margin": {"l": 84, "r": 16, "t": 64, "b": 48},
        "legend": {"orientation": "h", "x": 1.0, "xanchor": "right", "y": 1.0, "yanchor": "bottom"},
        "hovermode": "x",
        "modebar": {"bgcolor": "rgba(0,0,0,0)", "color": "#8a939c", "activecolor": "#222222"},
    }


def _plain_axes(figure: go.Figure) -> go.Figure:
    lines = {"showline": True, "linecolor": "#555555", "linewidth": 1, "mirror": True, "ticks": "inside"}
    figure.update_xaxes(**lines, gridcolor="#d9d9d9", zeroline=False)
    figure.update_yaxes(**lines, gridcolor="#d9d9d9", zeroline=True, zerolinecolor="#bbbbbb", title_font_size=11)
    return figure
