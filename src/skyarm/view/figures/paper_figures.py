"""Figures 3 to 18 of Barakou et al. 2026, drawn from logs, and an overview of the
experiments.

Errors are actual minus desired, against the published and held reference, as a recorded
bag would show them.

Source: Barakou, Tzafestas and Valavanis, Drones 2026, 10, 274, Figures 3-18.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes

from skyarm.log.flight_log import Log
from skyarm.records.arrays import Array
from skyarm.simulate import Window
from skyarm.view.figures.flight_facts import (
    Named,
    Span,
    end_time,
    ending_of,
    gust_interval,
)
from skyarm.view.figures.flight_panels import (
    MILLIMETRES,
    Panel,
    by_axis,
    column,
    distance,
)
from skyarm.view.figures.style import PAPER, CurveLook, Handles, Picture, Style, limits

LARGEST_VALUE = {"m": 5.0, "rad": float(np.pi)}
"""Value at which an axis stops growing with a diverged episode, by unit."""

WINDOW: Style = {"facecolor": "#f1f1f1", "edgecolor": "none", "zorder": 0.1}
"""Look of the interval over which the metrics are taken."""

GUST: Style = {
    "facecolor": "#dcdcdc",
    "edgecolor": "#9a9a9a",
    "hatch": "////",
    "linewidth": 0.0,
    "zorder": 0.2,
}
"""Look of the gust's interval, hatched, so that it differs from the window without
colour."""

PLACES = {"CT": 0, "PD": 1}
"""Law -> index of its look; other laws take the following ones."""

STYLE = replace(PAPER, panel=1.12)

ATTITUDE = [
    Panel(label=label, unit="rad", of=column("euler", i), scale="attitude")
    for i, label in enumerate(("Roll", "Pitch"))
]
"""Panels of the attitude on one scale, since the arm moves in the pitch plane and roll
should look as small as it is."""

POSITION_ERROR = Panel(
    label="Position error",
    unit="m",
    of=distance("position", "position_held"),
    magnitude=True,
)
TOOL_ERROR = Panel(
    label="Tip error", unit="m", of=distance("tool", "tool_held"), magnitude=True
)
POSITION_ERRORS = by_axis("Error", "position", error="position_held")
TOOL_ERRORS = by_axis("Tip error", "tool", error="tool_held")
TOOL_POSITIONS = by_axis("Tip", "tool", desired="tool_held")


def joint_error_size(i: int) -> Panel:
    """Make the panel of the absolute tracking error (rad) of joint ``i``."""

    def size(log: Log) -> Array:
        return np.abs(log.joints[:, i] - log.joints_held[:, i])

    return Panel(label=f"Joint {i + 1} abs. error", unit="rad", of=size, magnitude=True)


JOINT_ERRORS = [
    Panel(
        label=f"Joint {i + 1} error", unit="rad", of=column("joints", i, "joints_held")
    )
    for i in range(2)
]
JOINT_ANGLES = [
    Panel(
        label=f"Joint {i + 1}",
        unit="rad",
        of=column("joints", i),
        desired=column("joints_held", i),
    )
    for i in range(2)
]

CASES = {
    "case1": "Case 1",
    "case2": "Case 2",
    "case2_gust": "Case 2 with a gust",
    "case3": "Case 3",
    "case3_wind": "Case 3 in constant wind",
}


class PaperFigure:
    """One figure of Barakou et al. 2026: experiment, title, caption and panels.

    Args:
        case: experiment. subject: subject of its title. caption: text below it.
        parts: panels from top to bottom, lettered if there are several parts.
    """

    def __init__(
        self, case: str, subject: str, caption: str, *parts: Sequence[Panel]
    ) -> None:
        self.case, self.title, self.caption = case, f"{subject}, {CASES[case]}", caption
        letters = "abc" if len(parts) > 1 else [""]
        # a letter stands at the first panel of its part; a figure of one part has none
        self.panels = [
            replace(panel, letter="" if i else letter)
            for letter, part in zip(letters, parts, strict=False)
            for i, panel in enumerate(part)
        ]


PAPER_CATALOGUE: Mapping[int, PaperFigure] = {
    3: PaperFigure(
        "case1",
        "Roll and pitch",
        "Quadrotor roll and pitch while hovering with an arm ramp.",
        ATTITUDE,
    ),
    4: PaperFigure(
        "case1",
        "Arm ramp",
        "(a) Joint tracking error. (b) Joint angles, desired and actual, during the arm"
        " ramp.",
        JOINT_ERRORS,
        JOINT_ANGLES,
    ),
    5: PaperFigure(
        "case1",
        "Position error",
        "Norm of the quadrotor position error during the arm ramp.",
        (POSITION_ERROR,),
    ),
    6: PaperFigure(
        "case2",
        "Roll and pitch",
        "Quadrotor roll and pitch while hovering with 0.5 Hz sinusoids on both joints.",
        ATTITUDE,
    ),
    7: PaperFigure(
        "case2",
        "Position error",
        "(a) Norm of the quadrotor position error. (b) The same by world axis, during"
        " the arm sinusoids.",
        (POSITION_ERROR,),
        POSITION_ERRORS,
    ),
    8: PaperFigure(
        "case2",
        "Joint errors",
        "Joint tracking errors during the arm sinusoids.",
        JOINT_ERRORS,
    ),
    9: PaperFigure(
        "case2_gust",
        "Pitch",
        "Quadrotor pitch with a gust along x from 7.5 s to 10.5 s.",
        ATTITUDE[1:],
    ),
    10: PaperFigure(
        "case2_gust",
        "Position error",
        "Quadrotor position error by world axis with a gust along x.",
        POSITION_ERRORS,
    ),
    11: PaperFigure(
        "case2_gust",
        "Joint errors",
        "Joint tracking errors with a gust along x: joint 1 (top) and joint 2"
        " (bottom).",
        JOINT_ERRORS,
    ),
    12: PaperFigure(
        "case3",
        "Circle with arm motion",
        "(a) Norm of the quadrotor position error. (b) Roll and pitch, on the circle"
        " with a moving arm.",
        (POSITION_ERROR,),
        ATTITUDE,
    ),
    13: PaperFigure(
        "case3",
        "Tip position",
        "Tip position in the world, desired and actual.",
        TOOL_POSITIONS,
    ),
    14: PaperFigure(
        "case3",
        "Joint and tip errors",
        "(a) Absolute joint tracking errors. (b) Norm of the tip error in the world.",
        [joint_error_size(0), joint_error_size(1)],
        (TOOL_ERROR,),
    ),
    15: PaperFigure("case3", "Tip error", "Tip error by world axis.", TOOL_ERRORS),
    16: PaperFigure(
        "case3_wind",
        "Position error",
        "Norm of the quadrotor position error in a constant wind along x.",
        (POSITION_ERROR,),
    ),
    17: PaperFigure(
        "case3_wind",
        "Roll and pitch",
        "Quadrotor orientation in a constant wind along x.",
        ATTITUDE,
    ),
    18: PaperFigure(
        "case3_wind",
        "Tip error",
        "Norm of the tip error in a constant wind along x.",
        (TOOL_ERROR,),
    ),
}


def by_hold(log: Log, values: Array | None) -> tuple[Array, Array]:
    """Average a curve (N,) over each sample-and-hold interval of the reference; returns
    mid-times (s) and means.

    An error against held samples is a sawtooth at the control rate, too fast for a
    line.
    """
    curve = np.zeros(0) if values is None else values
    rates = log.info["rates_hz"]
    starts = np.arange(
        0, curve.size, max(1, round(rates["control"] / rates["reference"]))
    )
    if not starts.size:
        return curve, curve
    counts = np.diff(np.append(starts, curve.size))
    return (
        np.add.reduceat(log.time, starts) / counts,
        np.add.reduceat(curve, starts) / counts,
    )


def paper_figures(
    logs: Mapping[str, Named], windows: Mapping[str, Window]
) -> dict[int, Picture]:
    """Draw Figures 3 to 18 of Barakou et al. 2026 from logs; returns figures by their
    number.

    Args:
        logs: experiment ("case1", "case2", "case3", "case2_gust", "case3_wind") ->
            controller ("CT", "PD") -> log.
        windows: where each experiment is measured; shaded.

    Returns:
        The paper's number -> figure; figures whose experiment was not flown are left
        out.
    """
    return {
        number: _draw(number, spec, logs[spec.case], windows.get(spec.case))
        for number, spec in PAPER_CATALOGUE.items()
        if logs.get(spec.case)
    }


def _draw(
    number: int, spec: PaperFigure, logs: Named, window: Window | None
) -> Picture:
    """Draw one figure of Barakou et al. 2026: a curve per controller and the
    reference.
    """
    figure, axes = STYLE.stacked_panels(len(spec.panels))
    figure.suptitle(f"Figure {number}. {spec.title}", **STYLE.words)
    handles: Handles = {}
    drawn: dict[str, list[Array]] = {}
    longest = max(logs.values(), key=lambda log: log.time.size)
    gust = next(
        (interval for interval in map(gust_interval, logs.values()) if interval), None
    )
    for ax, panel in zip(axes, spec.panels, strict=True):
        STYLE.name_axis(ax, panel.label, panel.unit)
        if panel.letter:
            box = {
                "boxstyle": "square,pad=0.15",
                "facecolor": "white",
                "edgecolor": "none",
                "alpha": 0.85,
            }
            words = f"({panel.letter})"
            ax.text(
                0.012,
                0.95,
                words,
                transform=ax.transAxes,
                va="top",
                bbox=box,
                zorder=5,
                **STYLE.words,
            )
        seen = drawn.setdefault(panel.scale or panel.label, [])
        for i, (controller, log) in enumerate(logs.items()):
            curve = by_hold(log, panel.of(log))
            label = controller + ending_of(log)
            (handles[label],) = ax.plot(
                *curve, label=label, **_law_look(controller, i).line
            )
            seen.append(curve[1])
        if panel.desired:
            curve = by_hold(longest, panel.desired(longest))
            (handles["desired"],) = ax.plot(
                *curve, label="desired", **STYLE.desired.line
            )
            seen.append(curve[1])
        if window:
            span = window.start, window.stop
            handles[f"window [{window.start:g}, {window.stop:g}) s"] = ax.axvspan(
                *span, **WINDOW
            )
        if gust:
            handles["gust"] = ax.axvspan(*gust, **GUST)
    for ax, panel in zip(axes, spec.panels, strict=True):
        shown = drawn[panel.scale or panel.label]
        largest = LARGEST_VALUE[panel.unit]
        ax.set_ylim(*limits(shown, floor=panel.magnitude, span=panel.span, cap=largest))
    # logs without an instant have an axis of 1 s
    axes[-1].set_xlim(0.0, max(map(end_time, logs.values())) or 1.0)
    STYLE.legend(figure, handles)
    return figure


def _law_look(name: str, i: int) -> CurveLook:
    """Return the line style of a controller; CT and PD of Barakou et al. 2026 have
    fixed ones.
    """
    return PAPER.look(PLACES.get(name, 2 + i))


def overview_figure(logs: Mapping[str, Named], steady: Window) -> Picture:
    """Draw tip path and tip error of Case 3, and the base position in the gust of Case
    2, side by side.

    Args:
        logs: experiment ("case3", "case2_gust") -> controller -> log.
        steady: part of the flight whose path is drawn.
    """
    figure = PAPER.blank(9.0, 2.9)  # the width of a web page's column
    path, *others = map(PAPER.dress, figure.subplots(1, 3))
    handles: Handles = {}
    for i, (controller, log) in enumerate(logs["case3"].items()):
        at = steady.of(log)
        look = _law_look(controller, i).line
        (handles[controller],) = path.plot(
            *log.tool[at, :2].T, label=controller, **look
        )
        desired = log.tool_reference[at, :2]
    (handles["desired"],) = path.plot(*desired.T, label="desired", **PAPER.desired.line)
    path.set_aspect("equal", adjustable="datalim")
    path.set_ylabel("y [m]", **PAPER.words)
    # chosen: Case 3 from before its steady window, 10 to 20 s, and in Case 2 the gust,
    # 7.5 to 10.5 s, with what comes before and after
    _curves(others[0], logs["case3"], TOOL_ERROR, (7.5, 20.5))
    _curves(others[1], logs["case2_gust"], POSITION_ERRORS[0], (5.0, 17.0))
    gust = gust_interval(next(iter(logs["case2_gust"].values())))
    if gust:
        handles["gust"] = others[1].axvspan(*gust, **GUST)
    titles = (
        "Case 3: tip from above, 10 to 20 s",
        "Case 3: tip error [mm]",
        "Case 2, 2 N gust: base x error [mm]",
    )
    for ax, title in zip((path, *others), titles, strict=True):
        ax.set_title(title, **PAPER.words)
        ax.set_xlabel("x [m]" if ax is path else "Time [s]", **PAPER.words)
    PAPER.legend(figure, handles)
    return figure


def _curves(ax: Axes, logs: Named, panel: Panel, span: Span) -> None:
    """Draw a quantity of each controller in mm over a time interval (s)."""
    drawn = []
    for i, (controller, log) in enumerate(logs.items()):
        time, mean = by_hold(log, panel.of(log))
        ax.plot(time, MILLIMETRES * mean, **_law_look(controller, i).line)
        drawn.append(MILLIMETRES * mean[(time >= span[0]) & (time < span[1])])
    ax.set_xlim(*span)
    # axes of 20 mm at least and 2 m at most, chosen: neither rounding nor a lost flight
    # decides the scale
    ax.set_ylim(
        *limits(
            drawn, floor=bool(np.min(np.concatenate(drawn)) >= 0.0), span=20.0, cap=2e3
        )
    )
