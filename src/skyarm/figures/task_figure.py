"""One flight of a task in contact as a small picture: forces over time, and the way of the tip beside the world."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from skyarm.figures import picture_styles
from skyarm.figures.contact_curves import wanted_push
from skyarm.figures.flight_facts import flight_facts
from skyarm.figures.path_views import draw_view, world_of
from skyarm.figures.picture_styles import Picture, PictureStyle, picture_style
from skyarm.figures.projection import BEHIND, SIDE, TOP, View
from skyarm.figures.quantities import end_time
from skyarm.log.flight_log import Log

Array = npt.NDArray[np.float64]

WIDTH, HEIGHT = 3.6, 3.9
"""in."""

VIEWS = (BEHIND, SIDE, TOP)
"""View that leaves out x, y and z."""

TIP = "tip"


def task_figure(log: Log) -> Picture:
    """Draw the forces of a flight over time, and the path of its tip in the view in which that is widest.

    Args:
        log: of a flight with a world.

    Returns:
        a figure: normal force at all points of the vehicle, what was wanted of it, and the force of what is gripped.
    """
    style = picture_style("paper")
    figure = picture_styles.blank(style, WIDTH, HEIGHT)
    above, below = figure.subplots(2, 1, height_ratios=(1.0, 1.5))
    span = 0.0, end_time(log) or 1.0
    named, facts = {TIP: log}, {TIP: flight_facts(log)}
    handles = _forces(above, log, style)
    above.set_xlim(*span)
    seen = draw_view(below, _view(log), named, facts, style, span, world_of(named, span))
    handles |= {name: seen[name] for name in seen if name.startswith(TIP)}
    picture_styles.legend(figure, style, list(handles.values()), list(handles))
    return figure


def _view(log: Log) -> View:
    """The view along the axis of what is gripped, or along that in which the tip goes least; else from the right."""
    hinge = _hinge(log)
    if hinge is not None:
        return VIEWS[int(np.argmax(np.abs(hinge)))]
    wide = np.ptp(log.tip, axis=0) if log.time.size else np.zeros(3)
    wide[1] -= 1e-3  # m: noise
    return VIEWS[int(np.argmin(wide))]


def _hinge(log: Log) -> Array | None:
    """Axis of the first mechanism that turns, where something is gripped."""
    if not (log.gripper_force.size and log.gripper_force.any() and log.mechanism_position.size):
        return None
    found = log.scenario.contacts[0].mechanisms[0].hinge
    return np.array([float(c) for c in found[3:]]) if found else None


def _forces(ax: Axes, log: Log, style: PictureStyle) -> dict[str, Any]:
    """Curves of force, each in the look of its place; returns what a legend has of them."""
    picture_styles.dress(ax, style)
    touching = log.contact_force.sum(axis=1) if log.contact_force.size else np.zeros(log.time.size)
    curves: list[tuple[str, Array]] = []
    if touching.any() or not log.gripper_force.size:
        curves.append(("normal force", touching))
    if log.gripper_force.size and log.gripper_force.any():
        curves.append(("grip", np.asarray(log.gripper_force.sum(axis=1))))
    handles: dict[str, Any] = {}
    for i, (name, force) in enumerate(curves):
        (handles[name],) = ax.plot(log.time, force, **style.look(i).line)
    wanted = wanted_push(log)
    if wanted is not None and wanted.any():
        (handles["wanted force"],) = ax.plot(log.time, wanted, **style.desired.line)
    ax.set_ylim(bottom=0.0)
    ax.set_xlabel("time [s]", **style.words)
    ax.set_ylabel("force [N]", **style.words)
    return handles
