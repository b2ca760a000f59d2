"""Paths of flights in the world about them, and the contacts on their way."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from skyarm.log.flight_log import Log
from skyarm.view.figures.flight_facts import (
    FlightFacts,
    Touching,
    end_time,
    ending_of,
    flight_facts,
    scenario_of,
    wanted_push,
)
from skyarm.view.figures.flight_panels import Panel
from skyarm.view.figures.projection import BEHIND, SIDE, TOP, View, hull, surface
from skyarm.view.figures.style import PAPER, Picture, PictureStyle
from skyarm.world.scene.shapes import Solid
from skyarm.world.scene.world_shapes import ground_height, logged_poses, world_shapes

Array = npt.NDArray[np.float64]

HEIGHTS = {"paper": 3.0, "talk": 6.2}
"""in."""

ROOM, LEAST = 0.3, 0.15
"""Room about the paths, as a share of how far they go, and m."""

TOUCH_WORDS = ("touch", "loss")
"""Words of the legend for a filled mark and an open one."""

TASK_SIZE = 3.6, 3.9
"""in: of the picture of a task."""

VIEWS = (BEHIND, SIDE, TOP)
"""View that leaves out x, y and z."""

TIP = "tip"

FACE_ON = 0.5
"""A plane that is seen from its front, by the cosine, is not drawn: it would cover all."""

FILLS = {False: {"surface": "#cfc9bd", "object": "#d9b48f"}, True: {"surface": "#4a4740", "object": "#7a5a3a"}}
"""Role of a shape -> fill, on light and on dark ground."""


def path_figure(
    named: Mapping[str, Log], facts: Mapping[str, FlightFacts], style: PictureStyle, span: tuple[float, float]
) -> Picture:
    """Draw the tips' paths over a stretch of time, from above and from the right.

    Args:
        named: words of the legend -> log.
        facts: the same flights.
        style: of the picture.
        span: first and last instant, s.

    Returns:
        a figure with the world of the first flight that has one: filled as it is at first, what moves also as a line
        where it is at last. A plane is drawn where it is seen from its edge.
    """
    figure = style.blank(style.wide, HEIGHTS[style.name])
    axes = figure.subplots(1, 2)
    handles: dict[str, Any] = {}
    world = world_of(named, span)
    for ax, view in zip(axes, (TOP, SIDE), strict=True):
        handles |= draw_view(ax, view, named, facts, style, span, world)
    last = [each for each in ("desired", *TOUCH_WORDS) if each in handles]
    style.legend(figure, {each: handles[each] for each in [*(each for each in handles if each not in last), *last]})
    return figure


SEEN = {TOP: ("from above", "x [m]", "y [m]"), SIDE: ("from the right", "x [m]", "z [m]"),
        BEHIND: ("from behind", "-y [m]", "z [m]")}  # fmt: skip
"""View -> where it is seen from, and words of its axes."""


def draw_view(
    ax: Axes, view: View, named: Mapping[str, Log], facts: Mapping[str, FlightFacts], style: PictureStyle,
    span: tuple[float, float], world: tuple[tuple[Solid, ...], float | None],
) -> dict[str, Any]:  # fmt: skip
    """Draw the tips' paths and the world in one view; returns what a legend has of it.

    Args:
        ax: empty.
        view: one of TOP, SIDE and BEHIND.
        named: words of the legend -> log.
        facts: the same flights.
        style: of the picture.
        span: first and last instant, s.
        world: as :func:`world_of` has it.
    """
    style.dress(ax)
    handles = _paths(ax, view, named, style, span)
    handles |= touch_places(ax, view, named, facts, style, span)
    _frame(ax)
    for solid in world[0]:
        _draw_solid(ax, view, solid, style)
    if world[1] is not None and view is not TOP:
        ax.axhspan(-1e3, world[1], facecolor=_fill(style, "surface"), edgecolor="none", zorder=0.5)
    title, right, up = SEEN[view]
    ax.set_xlabel(right, **style.words)
    ax.set_ylabel(up, **style.words)
    ax.set_title(title, **style.small_words)
    return handles


def _paths(
    ax: Axes, view: View, named: Mapping[str, Log], style: PictureStyle, span: tuple[float, float]
) -> dict[str, Any]:
    """Paths of tips and where they should be."""
    handles: dict[str, Any] = {}
    for i, (label, log) in enumerate(named.items()):
        inside = (log.time >= span[0]) & (log.time <= span[1])
        name = label + ending_of(log)
        (handles[name],) = ax.plot(*view.flat(log.tip[inside]).T, label=name, **style.look(i).line)
        desired = view.flat(log.tip_reference[inside]).T
        (handles["desired"],) = ax.plot(*desired, label="desired", **style.desired.line)
    return handles


def _frame(ax: Axes) -> None:
    """A square about the paths."""
    ends = np.array([ax.dataLim.min, ax.dataLim.max])
    ends[:, ~np.isfinite(ends).all(axis=0)] = [[-1.0], [1.0]]
    half = 0.5 * float(np.max(ends[1] - ends[0]))
    half = max(half * (1.0 + 2.0 * ROOM), half + LEAST)
    middle = 0.5 * (ends[0] + ends[1])
    ax.set_xlim(middle[0] - half, middle[0] + half)
    ax.set_ylim(middle[1] - half, middle[1] + half)
    ax.set_aspect("equal", adjustable="box")
    ax.set_autoscale_on(False)


def world_of(named: Mapping[str, Log], span: tuple[float, float]) -> tuple[tuple[Solid, ...], float | None]:
    """Surfaces and objects of the first flight that has any, at its first and last instant; height of its ground."""
    for log in named.values():
        scenario = scenario_of(log)
        contacts = () if scenario is None else scenario.worlds
        inside = np.flatnonzero((log.time >= span[0]) & (log.time <= span[1]))
        if not contacts or not inside.size:
            continue
        ends = inside[[0, -1]]
        moved = (log.object_position, log.object_quaternion, log.mechanism_position)
        carried = logged_poses(contacts, *(each[ends] if each.size else each for each in moved))
        around = np.mean(log.tip[inside], axis=0)
        level = any(each.shape == "plane" for contact in contacts for each in contact.surfaces)
        return (
            world_shapes(contacts, log.time[ends], tuple(around), carried=carried),
            ground_height(contacts) if level else None,
        )
    return (), None


def _draw_solid(ax: Axes, view: View, solid: Solid, style: PictureStyle) -> None:
    """Outline of a solid as it is at first, filled; where it is at last, as a line."""
    for k in (0, 1) if solid.moves else (0,):
        if solid.shape.kind == "patch" and abs(solid.rotation[k, :, 2] @ view.toward) > FACE_ON:
            continue
        points = surface(solid.shape) @ solid.rotation[k].T + solid.position[k]
        corners = hull(view.flat(points))
        drawn = Polygon(corners, closed=True, label=solid.shape.name, zorder=0.6 + 0.1 * k)
        fill = "none" if k else _fill(style, solid.shape.role)
        drawn.set(facecolor=fill, edgecolor=style.frame, linewidth=0.09 * style.small, linestyle="--" if k else "-")
        ax.add_patch(drawn)


def _fill(style: PictureStyle, role: str) -> str:
    return FILLS[style.dark][role]


def mark_touches(ax: Axes, panel: Panel, facts: Mapping[str, FlightFacts], style: PictureStyle) -> dict[str, Any]:
    """Marks on the time axis of a panel where points touch and let go; words of the legend -> artist."""
    handles: dict[str, Any] = {}
    for i, flight in enumerate(facts.values()):
        chosen = flight.touching
        if panel.touching is not None:
            chosen = tuple(each for each in chosen if (each.surface, each.point) in panel.touching)
        at: dict[str, Any] = {"transform": ax.get_xaxis_transform(), "clip_on": False, "zorder": 5.0}
        for word, times, look in _touch_marks(chosen, style, i):
            (mark,) = ax.plot(times, [0.0] * len(times), markeredgewidth=0.08 * style.small, **look, **at)
            handles.setdefault(word, mark)
    return handles


def touch_places(
    ax: Axes,
    view: View,
    named: Mapping[str, Log],
    facts: Mapping[str, FlightFacts],
    style: PictureStyle,
    span: tuple[float, float],
) -> dict[str, Any]:
    """Places on the tip's path where it touched and let go."""
    handles: dict[str, Any] = {}
    for i, (label, log) in enumerate(named.items()):
        for word, times, look in _touch_marks([e for e in facts[label].touching if e.at_tip], style, i):
            inside = [t for t in times if span[0] <= t <= span[1]]
            if inside:
                at = view.flat(log.tip[np.searchsorted(log.time, inside).clip(max=log.time.size - 1)]).T
                (handles[word],) = ax.plot(*at, zorder=4.5, **look)
    return handles


def _touch_marks(
    touching: Sequence[Touching], style: PictureStyle, i: int
) -> Iterator[tuple[str, list[float], dict[str, Any]]]:
    """Word, instants and look of touches, then of losses, in the colour of the i-th flight."""
    color = style.look(i).color
    for word, marker, face, times in (
        (TOUCH_WORDS[0], "^", color, [t for each in touching for t in each.starts]),
        (TOUCH_WORDS[1], "v", style.face, [t for each in touching for t in each.ends]),
    ):
        look = {"color": color, "markerfacecolor": face, "markersize": 0.6 * style.small, "marker": marker}
        if times:
            yield word, times, {**look, "linestyle": "none", "label": f"_{word}"}


def task_figure(log: Log) -> Picture:
    """Draw the forces of a flight over time, and the path of its tip in the view in which that is widest.

    Args:
        log: of a flight with a world.

    Returns:
        a figure: normal force at all points of the vehicle, what was wanted of it, and the force of what is gripped.
    """
    style = PAPER
    figure = style.blank(*TASK_SIZE)
    above, below = figure.subplots(2, 1, height_ratios=(1.0, 1.5))
    span = 0.0, end_time(log) or 1.0
    named, facts = {TIP: log}, {TIP: flight_facts(log)}
    handles = _forces(above, log, style)
    above.set_xlim(*span)
    seen = draw_view(below, _view(log), named, facts, style, span, world_of(named, span))
    handles |= {name: seen[name] for name in seen if name.startswith(TIP)}
    style.legend(figure, handles)
    return figure


def _view(log: Log) -> View:
    """The view along the axis of a hinge that is gripped, or along which the tip goes least; else from the right."""
    if log.gripper_force.size and log.gripper_force.any() and log.mechanism_position.size:
        hinge = log.scenario.worlds[0].mechanisms[0].hinge
        if hinge:
            return VIEWS[int(np.argmax(np.abs([float(c) for c in hinge[3:]])))]
    wide = np.ptp(log.tip, axis=0) if log.time.size else np.zeros(3)
    wide[1] -= 1e-3  # m: noise
    return VIEWS[int(np.argmin(wide))]


def _forces(ax: Axes, log: Log, style: PictureStyle) -> dict[str, Any]:
    """Curves of force, each in the look of its place; returns what a legend has of them."""
    style.dress(ax)
    grip, touching = (each.sum(axis=1) if each.size else None for each in (log.gripper_force, log.contact_force))
    curves: list[tuple[str, Array]] = []
    if grip is None or (touching is not None and touching.any()):
        curves.append(("normal force", np.zeros(log.time.size) if touching is None else touching))
    if grip is not None and grip.any():
        curves.append(("grip", grip))
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
