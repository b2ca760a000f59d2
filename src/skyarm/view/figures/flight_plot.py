"""Time plots of one or several flights, with references, limits and events."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from skyarm.log.flight_log import Log
from skyarm.records.arrays import Array, IntArray
from skyarm.records.files import PathLike, number
from skyarm.records.files.names import require_suffix
from skyarm.view.figures.depth_figure import depth_figure
from skyarm.view.figures.flight_facts import (
    Event,
    Flights,
    Named,
    Span,
    end_time,
    ending_of,
    flight_events,
    flights_by_label,
    scenario_of,
    vehicles_by_label,
    within,
)
from skyarm.view.figures.flight_panels import (
    ALL,
    DEPTH,
    ESTIMATED,
    MEASURED,
    PATH,
    Panel,
    measured_flights,
    panels_of,
)
from skyarm.view.figures.projection import SIDE, TOP, Projection, outline
from skyarm.view.figures.style import (
    PAPER,
    Handles,
    Picture,
    Style,
    limits,
    save_picture,
)
from skyarm.world.scene.component_scenes import scene_in_log
from skyarm.world.scene.scene import Instants, Line, Scene
from skyarm.world.scene.shapes import Solid

HEIGHT = 3.0
"""Height (in) of a panel."""

ROOM, LEAST = 0.3, 0.15
"""Room around the paths, as a fraction of their extent, and at least this much (m)."""

FACE_ON = 0.5
"""Cosine of the angle to the view above which a plane is not drawn, since it would
cover everything."""

FILLS = {"surface": "#cfc9bd", "object": "#d9b48f"}
"""Role of a shape -> fill colour; other roles have that of an object."""


def path_figure(flights: Named, span: Span) -> Picture:
    """Draw the tip paths over a time interval, from above and from the right.

    Args:
        flights: words of the legend -> log.
        span: first and last instant, s.

    Returns:
        a figure with the world of the first flight that has one: filled as it is at
        first, what moves also as a line where it is at last. A plane is drawn where it
        is seen from its edge.
    """
    figure = PAPER.blank(PAPER.wide, HEIGHT)
    axes = figure.subplots(1, 2)
    handles: Handles = {}
    named = vehicles_by_label(flights)
    world = world_of(flights, span)
    for ax, view in zip(axes, (TOP, SIDE), strict=True):
        handles |= draw_view(ax, view, named, span, world)
    # the desired path last, as False sorts before True
    PAPER.legend(
        figure, {each: handles[each] for each in sorted(handles, key="desired".__eq__)}
    )
    return figure


SEEN = {
    TOP: ("from above", "x [m]", "y [m]"),
    SIDE: ("from the right", "x [m]", "z [m]"),
}
"""View -> viewpoint in words, and labels of its axes."""


def draw_view(
    ax: Axes,
    view: Projection,
    named: Named,
    span: Span,
    world: Scene,
) -> Handles:
    """Draw tip paths and surroundings in one projection; returns the legend entries.

    Args:
        ax: empty.
        view: one of TOP, SIDE and BEHIND.
        named: words of the legend -> log.
        span: first and last instant, s.
        world: surroundings, as :func:`world_of` has them.
    """
    PAPER.dress(ax)
    handles = _paths(ax, view, named, span)
    for solid in world.solids:
        if solid.shape.role == "point":  # of a grasp, which is in view like the paths
            ax.update_datalim(view.flat(solid.position))
    _frame(ax)
    for solid in world.solids:
        _draw_solid(ax, view, solid)
    for line in world.lines:
        _draw_line(ax, view, line)
    if world.ground is not None and view is not TOP:
        # from far below what any picture shows
        ax.axhspan(
            -1e3, world.ground, facecolor=FILLS["surface"], edgecolor="none", zorder=0.5
        )
    title, right, up = SEEN[view]
    ax.set_xlabel(right, **PAPER.words)
    ax.set_ylabel(up, **PAPER.words)
    ax.set_title(title, **PAPER.small_words)
    return handles


def _paths(ax: Axes, view: Projection, named: Named, span: Span) -> Handles:
    """Draw the tip's path of each flight and its reference; returns the legend
    entries.
    """
    handles: Handles = {}
    for i, (label, log) in enumerate(named.items()):
        inside = within(log, span)
        name = label + ending_of(log)
        (handles[name],) = ax.plot(
            *view.flat(log.tip[inside]).T, label=name, **PAPER.look(i).line
        )
        desired = view.flat(log.tip_reference[inside]).T
        (handles["desired"],) = ax.plot(*desired, label="desired", **PAPER.desired.line)
    return handles


def _frame(ax: Axes) -> None:
    """Set axes limits to a square around the drawn paths."""
    ends = np.array([ax.dataLim.min, ax.dataLim.max])
    # without any finite point the picture shows a square of 2 m
    ends[:, ~np.isfinite(ends).all(axis=0)] = [[-1.0], [1.0]]
    half = 0.5 * float(np.max(ends[1] - ends[0]))
    half = max(half * (1.0 + 2.0 * ROOM), half + LEAST)
    middle = 0.5 * (ends[0] + ends[1])
    ax.set_xlim(middle[0] - half, middle[0] + half)
    ax.set_ylim(middle[1] - half, middle[1] + half)
    ax.set_aspect("equal", adjustable="box")
    ax.set_autoscale_on(False)


def world_of(named: Named, span: Span) -> Scene:
    """Surfaces and objects at the start and end of a time interval, from the first
    flight that has any.
    """
    for log in named.values():
        scenario = scenario_of(log)
        inside = np.flatnonzero(within(log, span))
        if scenario is None or not inside.size:
            continue
        ends = inside[[0, -1]]
        agents: dict[str, Instants] = {}
        team = [*log.agents.values()]
        around = np.mean(np.concatenate([own.tip[inside] for own in team]), axis=0)
        for own, (name, agent) in zip(team, scenario.agents.items(), strict=True):
            agents[name] = Instants(
                vehicle=agent.vehicle,
                times=log.time[ends],
                position=own.position[ends],
                quaternion=own.quaternion[ends],
                joints=own.joints[ends],
                around=around,
                name=name,
            )
        name = next(iter(agents))
        first = team[0]
        seen = replace(agents[name], agents=agents)

        # defaults, so that each flight has its own
        def states(name: str, first: Log = first, ends: IntArray = ends) -> Array:
            values: Array = first.component(name)[ends]
            return values

        scene = scene_in_log(scenario.of(name).components, seen, states)
        if scene.solids or scene.lines or scene.ground is not None:
            return scene
    return Scene()


def _draw_line(ax: Axes, view: Projection, line: Line) -> None:
    """Draw a line-shaped object, such as a cable: solid at its initial position, dashed
    at its final one.
    """
    for places, style in zip(line.places, ("-", "--"), strict=True):
        ax.plot(
            *view.flat(places).T,
            label=line.name,
            color=PAPER.frame,
            linestyle=style,
            linewidth=0.09 * PAPER.small,
        )


def _draw_solid(ax: Axes, view: Projection, solid: Solid) -> None:
    """Draw the outline of a solid: filled at its initial pose, as a line at its final
    pose.
    """
    for k in (0, 1) if solid.moves else (0,):
        if (
            # a plane seen face on would cover the paths
            solid.shape.kind == "patch"
            and abs(solid.rotation[k, :, 2] @ view.toward) > FACE_ON
        ):
            continue
        corners = outline(solid.shape, solid.rotation[k], solid.position[k], view)
        drawn = Polygon(
            corners, closed=True, label=solid.shape.name, zorder=0.6 + 0.1 * k
        )
        fill = "none" if k else FILLS.get(solid.shape.role, FILLS["object"])
        drawn.set(
            facecolor=fill,
            edgecolor=PAPER.frame,
            linewidth=0.09 * PAPER.small,
            linestyle="--" if k else "-",
        )
        ax.add_patch(drawn)


MOST = 12
"""Largest number of flights in a picture: each of six colours has two dashes, and more
are not distinguishable."""

NEAR = 0.35
"""Fraction of a limit that a curve must reach for the limit to be drawn; chosen: one
that is farther would flatten the curve."""

HATCHES = ("////", None, "\\\\\\\\", "....")
DASHES = ("-", "--", "-.", ":")
"""Dashes of intervals and of instants, in the order of the events."""

HELD = "#c3d2e6"
"""Colour of sensor readings: the first flight's colour, light."""

OF_A_PAGE = 9
"""Largest number of panels one above the other where every kind is drawn."""


def plot(
    flights: Flights,
    file: PathLike | None = None,
    *,
    kind: str = ALL,
    window: Span | None = None,
) -> Picture:
    """Plot one or several flights over time, with references, limits and events.

    Args:
        flights: a log or the path of its file, several, or several by the words that
            the legend has for them.
        file: written there too, as PNG, SVG or PDF by its suffix.
        kind: "tracking" (base and joints with their references), "attitude", "tip"
            (with its error), "contact" (forces with the wanted one, and of grasps),
            "efforts" and "rotors" with their limits, "all" of these; "team" (tip error,
            forces of grasps and thrust of each vehicle, numbers of a team); or "path"
            (of the tip, from above and from the right, with the world) or "depth" (some
            pictures of cameras and lidars). Of one flight also what was measured and
            estimated of these.
        window: (start, stop), s; the whole of the longest flight if left out.

    Returns:
        a Matplotlib figure, which a notebook shows; ``figure.savefig`` writes other
        formats.

    Raises:
        ValueError: one line: an unknown kind or suffix, a window without a flight, too
            many flights.
        OSError: the file cannot be written.
    """
    if file is not None:
        require_suffix(Path(file))
    whole = flights_by_label(flights)
    named = vehicles_by_label(whole)
    if not 1 <= len(named) <= MOST:
        raise ValueError(f"flights = {len(named)}: must be 1 to {MOST} in one picture")
    span = _window(window, named)
    if kind == PATH:
        figure = path_figure(whole, span)
    elif kind == DEPTH:
        figure = depth_figure(whole, span)
    else:
        panels = panels_of(kind, list(named.values()), together=len(named) > len(whole))
        figure = _panels_figure(panels, named, span, kind == ALL)
    if file is not None:
        save_picture(figure, Path(file))
    return figure


def _panels_figure(
    panels: Sequence[Panel], named: Named, span: Span, every: bool
) -> Picture:
    """Draw panels over a common time axis, with shaded events and one legend."""
    figure, axes = PAPER.stacked_panels(len(panels), OF_A_PAGE if every else None)
    handles: Handles = {}
    events = _events_by_label(named)
    for ax, panel in zip(axes, panels, strict=True):
        handles |= _draw(ax, panel, named, span)
    for ax in axes:
        shading = _mark_events(ax, events, span)
    axes[0].set_xlim(*span)
    order = (
        *(label + ending_of(log) for label, log in named.items()),
        MEASURED,
        ESTIMATED,
        "desired",
        "limit",
    )
    PAPER.legend(
        figure, {label: handles[label] for label in order if label in handles} | shading
    )
    return figure


def _window(window: Span | None, named: Named) -> Span:
    """Time interval to draw (s): the requested one after checks, else the whole
    flights.
    """
    end = max(map(end_time, named.values()))
    if window is None:
        # one window for a flight without an instant, as an axis needs two ends
        return 0.0, end or 1.0
    start, stop = (number(value, f"window[{i}]") for i, value in enumerate(window))
    if not start < stop:
        raise ValueError(f"window = [{start:g}, {stop:g}]: must start before it stops")
    if stop <= 0.0 or start >= end:
        raise ValueError(
            f"window = [{start:g}, {stop:g}]: must overlap the flights, which last"
            f" {end:g} s"
        )
    return start, stop


def _draw(ax: Axes, panel: Panel, named: Named, span: Span) -> Handles:
    """Draw curves, references and limits of one panel; returns the drawn lines by
    legend label.
    """
    handles: Handles = {}
    # what fits the value axis: flights that were completed, and those that were lost
    completed: list[Array] = []
    lost: list[Array] = []
    PAPER.name_axis(ax, panel.label, panel.unit)
    for i, (label, log) in enumerate(named.items()):
        values, desired = panel.of(log), panel.desired(log) if panel.desired else None
        inside = within(log, span)
        curves = [(label + ending_of(log), values, PAPER.look(i).line)]
        if len(named) == 1 and values is not None:
            curves += _received_curves(panel, log, values)
        for name, curve, look in curves:
            if curve is not None:
                # a curve of one instant has no line: it is a dot
                alone: Style = (
                    {"marker": "o", "markersize": 0.6 * PAPER.small}
                    if log.time.size == 1
                    else {}
                )
                (handles[name],) = ax.plot(log.time, curve, label=name, **look, **alone)
        if values is not None and log.status != "completed" and log.time.size:
            ax.plot(
                log.time[-1:],
                values[-1:],
                marker="X",
                markersize=0.8 * PAPER.small,
                markeredgecolor=PAPER.face,
                color=PAPER.look(i).color,
                zorder=4.0,
                label="_end",
            )
        group = completed if log.status == "completed" else lost
        group += [
            each[inside]
            for each in (*(curve for _, curve, _ in curves), desired)
            if each is not None
        ]
    for time, desired in _different_references(panel, named):
        (handles["desired"],) = ax.plot(
            time, desired, label="desired", **PAPER.desired.line
        )
    low, high = _axis_limits(panel, completed, lost)
    for limit in panel.limits:
        # relative to the distance from zero
        if low <= limit <= high or (
            limit and (high if limit > 0.0 else -low) >= NEAR * abs(limit)
        ):
            handles["limit"] = ax.axhline(limit, label="limit", **PAPER.limit.line)
            # 7 % of the axis, chosen, so that the line of the limit is not its edge
            room = 0.07 * (max(high, limit) - min(low, limit))
            low, high = min(low, limit - room), max(high, limit + room)
    ax.set_ylim(low, high)
    return handles


def _received_curves(
    panel: Panel, log: Log, truth: Array
) -> Iterator[tuple[str, Array | None, Style]]:
    """Yield (label, curve, line style) of the measured and of the estimated values of a
    panel's quantity.
    """
    first = PAPER.look(0)
    steps: Style = {
        "color": HELD,
        "linewidth": first.width,
        # behind limits (2.6) and true curves (3 and more), which noise would cover
        "zorder": 2.5,
        "drawstyle": "steps-post",
    }
    looks = {MEASURED: steps, ESTIMATED: PAPER.look(1).line}
    for word, received in measured_flights(log):
        values = panel.of(received)
        if values is not None and not np.array_equal(values, truth, equal_nan=True):
            yield word, values, looks[word]


def _different_references(panel: Panel, named: Named) -> list[tuple[Array, Array]]:
    """List the times and values of each distinct reference curve of several flights,
    longest flight first.
    """
    references: list[tuple[Array, Array]] = []
    for log in sorted(named.values(), key=lambda log: -log.time.size):
        desired = panel.desired(log) if panel.desired else None
        if desired is not None and not any(
            # a reference that only ends earlier is the same one
            np.array_equal(desired, other[: desired.size])
            for _, other in references
        ):
            references.append((log.time, desired))
    return references


def _axis_limits(
    panel: Panel, completed: Sequence[Array], lost: Sequence[Array]
) -> tuple[float, float]:
    """Limits of a panel's value axis, from references and completed flights if there
    are any.

    A flight that was lost adds at most as much again on each side, so that it does not
    flatten the others.
    """
    both = limits([*completed, *lost], floor=panel.magnitude, span=panel.span)
    if not any(each.size for each in completed):
        return both
    low, high = limits(completed, floor=panel.magnitude, span=panel.span)
    return max(both[0], 2.0 * low - high), min(both[1], 2.0 * high - low)


def _mark_events(ax: Axes, events: Mapping[Event, str], span: Span) -> Handles:
    """Draw events in a panel (shading for an interval, a line for an instant); returns
    artists by legend label.
    """
    handles: Handles = {}
    instants: dict[str, str] = {}
    # looks go by the number of the event, also of one out of the window: it looks alike
    # in every panel and window of a flight
    for i, (event, label) in enumerate(events.items()):
        if event.start > span[1] or event.stop < span[0]:
            continue
        if event.start == event.stop:
            dash = instants.setdefault(label, DASHES[len(instants) % 4])
            handles[label] = ax.axvline(
                event.start,
                zorder=0.3,
                label=f"_{label}",
                color=PAPER.frame,
                linewidth=0.08 * PAPER.text,
                linestyle=dash,
            )
        else:
            handles[label] = ax.axvspan(
                event.start,
                min(event.stop, span[1]),
                hatch=HATCHES[i % 4],
                linewidth=0.0,
                zorder=0.2,
                facecolor=PAPER.shades[i % len(PAPER.shades)],
                edgecolor=PAPER.grid,
            )
    return handles


def _events_by_label(named: Named) -> dict[Event, str]:
    """Return a legend label for each event; it names the flights unless all flights
    have the event.
    """
    flights: dict[Event, list[str]] = {}
    for label, log in named.items():
        for event in flight_events(log):
            flights.setdefault(event, []).append(label)
    return {
        event: (
            event.label
            if len(labels) >= len(named)
            else f"{event.label} ({', '.join(labels)})"
        )
        for event, labels in flights.items()
    }
