"""Plots of the tip's path from above and from the right, with surfaces and objects."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from skyarm.log.flight_log import Log
from skyarm.view.figures.flight_facts import ending_of, scenario_of
from skyarm.view.figures.projection import SIDE, TOP, View, outline
from skyarm.view.figures.style import PAPER, Picture
from skyarm.world.scene.scene import Instants, Line, Scene, scene_in_log
from skyarm.world.scene.shapes import Solid

HEIGHT = 3.0
"""in."""

ROOM, LEAST = 0.3, 0.15
"""Room about the paths, as a share of how far they go, and m."""

FACE_ON = 0.5
"""A plane that is seen from its front, by the cosine, is not drawn: it would cover all."""

FILLS = {"surface": "#cfc9bd", "object": "#d9b48f"}
"""Role of a shape -> fill; of others that of an object."""


def path_figure(named: Mapping[str, Log], span: tuple[float, float]) -> Picture:
    """Draw the tip paths over a time interval, from above and from the right.

    Args:
        named: words of the legend -> log.
        span: first and last instant, s.

    Returns:
        a figure with the world of the first flight that has one: filled as it is at first, what moves also as a line
        where it is at last. A plane is drawn where it is seen from its edge.
    """
    figure = PAPER.blank(PAPER.wide, HEIGHT)
    axes = figure.subplots(1, 2)
    handles: dict[str, Any] = {}
    world = world_of(named, span)
    for ax, view in zip(axes, (TOP, SIDE), strict=True):
        handles |= draw_view(ax, view, named, span, world)
    PAPER.legend(figure, {each: handles[each] for each in sorted(handles, key="desired".__eq__)})
    return figure


SEEN = {TOP: ("from above", "x [m]", "y [m]"), SIDE: ("from the right", "x [m]", "z [m]")}
"""View -> where it is seen from, and words of its axes."""


def draw_view(
    ax: Axes, view: View, named: Mapping[str, Log], span: tuple[float, float],
    world: Scene,
) -> dict[str, Any]:  # fmt: skip
    """Draw tip paths and surroundings in one projection; returns the legend entries.

    Args:
        ax: empty.
        view: one of TOP, SIDE and BEHIND.
        named: words of the legend -> log.
        span: first and last instant, s.
        world: as :func:`world_of` has it.
    """
    PAPER.dress(ax)
    handles = _paths(ax, view, named, span)
    _frame(ax)
    for solid in world.solids:
        _draw_solid(ax, view, solid)
    for line in world.lines:
        _draw_line(ax, view, line)
    if world.ground is not None and view is not TOP:
        ax.axhspan(-1e3, world.ground, facecolor=FILLS["surface"], edgecolor="none", zorder=0.5)
    title, right, up = SEEN[view]
    ax.set_xlabel(right, **PAPER.words)
    ax.set_ylabel(up, **PAPER.words)
    ax.set_title(title, **PAPER.small_words)
    return handles


def _paths(ax: Axes, view: View, named: Mapping[str, Log], span: tuple[float, float]) -> dict[str, Any]:
    """Draw the tip's path of each flight and its reference; returns the legend entries."""
    handles: dict[str, Any] = {}
    for i, (label, log) in enumerate(named.items()):
        inside = (log.time >= span[0]) & (log.time <= span[1])
        name = label + ending_of(log)
        (handles[name],) = ax.plot(*view.flat(log.tip[inside]).T, label=name, **PAPER.look(i).line)
        desired = view.flat(log.tip_reference[inside]).T
        (handles["desired"],) = ax.plot(*desired, label="desired", **PAPER.desired.line)
    return handles


def _frame(ax: Axes) -> None:
    """Set axes limits to a square around the drawn paths."""
    ends = np.array([ax.dataLim.min, ax.dataLim.max])
    ends[:, ~np.isfinite(ends).all(axis=0)] = [[-1.0], [1.0]]
    half = 0.5 * float(np.max(ends[1] - ends[0]))
    half = max(half * (1.0 + 2.0 * ROOM), half + LEAST)
    middle = 0.5 * (ends[0] + ends[1])
    ax.set_xlim(middle[0] - half, middle[0] + half)
    ax.set_ylim(middle[1] - half, middle[1] + half)
    ax.set_aspect("equal", adjustable="box")
    ax.set_autoscale_on(False)


def world_of(named: Mapping[str, Log], span: tuple[float, float]) -> Scene:
    """Surfaces and objects of the first flight that has any, at start and end of a time interval."""
    for log in named.values():
        scenario = scenario_of(log)
        inside = np.flatnonzero((log.time >= span[0]) & (log.time <= span[1]))
        if scenario is None or not inside.size:
            continue
        ends = inside[[0, -1]]
        seen = Instants(
            vehicle=scenario.plant.vehicle, times=log.time[ends], position=log.position[ends],
            quaternion=log.quaternion[ends], joints=log.joints[ends], around=np.mean(log.tip[inside], axis=0),
        )  # fmt: skip
        found = scene_in_log(scenario.components, seen, lambda name: log.component(name)[ends])  # noqa: B023
        if found.solids or found.lines or found.ground is not None:
            return found
    return Scene()


def _draw_line(ax: Axes, view: View, line: Line) -> None:
    """Draw a line of the surroundings at its initial position, and dashed at its final position."""
    for places, style in zip(line.places, ("-", "--"), strict=True):
        ax.plot(*view.flat(places).T, label=line.name, color=PAPER.frame, linestyle=style, linewidth=0.09 * PAPER.small)


def _draw_solid(ax: Axes, view: View, solid: Solid) -> None:
    """Draw the outline of a solid: filled at its initial pose, as a line at its final pose."""
    for k in (0, 1) if solid.moves else (0,):
        if solid.shape.kind == "patch" and abs(solid.rotation[k, :, 2] @ view.toward) > FACE_ON:
            continue
        corners = outline(solid.shape, solid.rotation[k], solid.position[k], view)
        drawn = Polygon(corners, closed=True, label=solid.shape.name, zorder=0.6 + 0.1 * k)
        fill = "none" if k else FILLS.get(solid.shape.role, FILLS["object"])
        drawn.set(facecolor=fill, edgecolor=PAPER.frame, linewidth=0.09 * PAPER.small, linestyle="--" if k else "-")
        ax.add_patch(drawn)
