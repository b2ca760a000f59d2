"""Flights over time: one or several logs in one picture, with references, limits and events."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from skyarm.log.flight_log import Log
from skyarm.records.files import number
from skyarm.records.files.names import require_suffix
from skyarm.view.figures.flight_facts import Event, FlightFacts, end_time, ending_of, flight_facts, flights_by_label
from skyarm.view.figures.flight_panels import ALL, ESTIMATED, MEASURED, PATH, Panel, measured_flights, panels_of
from skyarm.view.figures.path_views import TOUCH_WORDS, mark_touches, path_figure
from skyarm.view.figures.style import Picture, PictureStyle, limits, picture_style, save_picture

Array = npt.NDArray[np.float64]

Flights = Log | Sequence[Log] | Mapping[str, Log]

MOST = 12
"""Flights of one picture: more cannot be told apart."""

NEAR = 0.35
"""A limit is drawn if a curve comes to this share of it; else the panel says where it is."""

OF_A_PAGE = {"paper": 9, "talk": 6}
"""Panels one above the other where every kind is drawn."""


def plot(
    flights: Flights,
    file: str | os.PathLike[str] | None = None,
    *,
    kind: str = ALL,
    style: str = "paper",
    dark: bool = False,
    window: tuple[float, float] | None = None,
) -> Picture:
    """Draw flights over time.

    Args:
        flights: one log, several, or several by the words that the legend has for them.
        file: written there too, as PNG, SVG or PDF by its suffix.
        kind: "tracking" (base and joints with their references), "attitude", "tip" (with its error), "contact" (forces
            with the wanted one), "efforts" and "rotors" with their limits, "all" of these; or "path" (of the tip, from
            above and from the right, with the world). Of one flight also what was measured and estimated of these.
        style: "paper" (a column, or two; readable in grey) or "talk" (a slide).
        dark: of a talk, light on dark.
        window: (start, stop), s; the whole of the longest flight if left out.

    Returns:
        a Matplotlib figure, which a notebook shows; ``figure.savefig`` writes other formats.

    Raises:
        ValueError: one line: an unknown kind, style or suffix, a window without a flight, too many flights.
        OSError: the file cannot be written.
    """
    chosen = picture_style(style, dark=dark)
    if file is not None:
        require_suffix(Path(file))
    named = flights_by_label(flights)
    if not 1 <= len(named) <= MOST:
        raise ValueError(f"flights = {len(named)}: must be 1 to {MOST} in one picture")
    facts = {label: flight_facts(log) for label, log in named.items()}
    span = _window(window, named)
    if kind == PATH:
        figure = path_figure(named, facts, chosen, span)
    else:
        figure = _panels_figure(panels_of(kind, list(facts.values())), named, facts, chosen, span, kind == ALL)
    if file is not None:
        save_picture(figure, Path(file), style)
    return figure


def _panels_figure(
    panels: Sequence[Panel],
    named: Mapping[str, Log],
    facts: Mapping[str, FlightFacts],
    style: PictureStyle,
    span: tuple[float, float],
    every: bool,
) -> Picture:
    """Panels over one time axis; ``every`` kind of them fills pages."""
    figure, axes = style.stacked_panels(len(panels), OF_A_PAGE[style.name] if every else None)
    handles: dict[str, Any] = {}
    for ax, panel in zip(axes, panels, strict=True):
        handles |= _draw(ax, panel, named, style, span) | _limits(ax, panel, facts, style)
        handles |= mark_touches(ax, panel, facts, style)
    shading: dict[str, Any] = {}
    for ax in axes:
        shading |= _shade(ax, facts, style, span)
    axes[0].set_xlim(*span)
    title = _title(named)
    if style.name == "talk" and title:
        figure.suptitle(title, **style.words)
    flown = [label + ending_of(log) for label, log in named.items()]
    order = (*flown, MEASURED, ESTIMATED, "desired", "limit", *TOUCH_WORDS)
    style.legend(figure, {label: handles[label] for label in order if label in handles} | shading)
    return figure


def _title(named: Mapping[str, Log]) -> str:
    """Title of the scenario, where all flights have one."""
    titles = {str(log.info.get("title") or log.info.get("scenario", "")) for log in named.values()}
    return titles.pop() if len(titles) == 1 else ""


def _window(window: tuple[float, float] | None, named: Mapping[str, Log]) -> tuple[float, float]:
    """The stretch of time that is drawn, s."""
    end = max(map(end_time, named.values()))
    if window is None:
        return 0.0, end or 1.0
    start, stop = (number(value, f"window[{i}]") for i, value in enumerate(window))
    if not start < stop:
        raise ValueError(f"window = [{start:g}, {stop:g}]: must start before it stops")
    if stop <= 0.0 or start >= end:
        raise ValueError(f"window = [{start:g}, {stop:g}]: must overlap the flights, which last {end:g} s")
    return start, stop


def _draw(
    ax: Axes, panel: Panel, named: Mapping[str, Log], style: PictureStyle, span: tuple[float, float]
) -> dict[str, Any]:
    """Curves and references of one panel; words of the legend -> line."""
    handles: dict[str, Any] = {}
    style.name_axis(ax, panel.label, panel.unit)
    for i, (label, log) in enumerate(named.items()):
        values = panel.of(log)
        if values is None:
            continue
        name = label + ending_of(log)
        look = style.look(i)
        alone: dict[str, Any] = {"marker": "o", "markersize": 0.6 * style.small} if log.time.size == 1 else {}
        (handles[name],) = ax.plot(log.time, values, label=name, **look.line, **alone)
        if log.status != "completed" and log.time.size:
            at: dict[str, Any] = {"marker": "X", "markersize": 0.8 * style.small, "markeredgecolor": style.face}
            ax.plot(log.time[-1:], values[-1:], color=look.color, zorder=4.0, label="_end", **at)
    for word, values, received in _beside_truth(panel, named, style):
        (handles[word],) = ax.plot(next(iter(named.values())).time, values, label=word, **received)
    for log in _of_different_references(panel, named):
        desired = panel.desired(log) if panel.desired else None
        if desired is not None:
            (handles["desired"],) = ax.plot(log.time, desired, label="desired", **style.desired.line)
    ax.set_ylim(*_ends(panel, named, style, span))
    return handles


def _beside_truth(
    panel: Panel, named: Mapping[str, Log], style: PictureStyle
) -> Iterator[tuple[str, Array, dict[str, Any]]]:
    """Label, curve and look of a panel's quantity as measured and as estimated, for a flight drawn alone."""
    if len(named) > 1:
        return
    (log,) = named.values()
    first = style.look(0)
    held: dict[str, Any] = {"color": first.tint, "linewidth": first.width, "zorder": 2.5, "drawstyle": "steps-post"}
    looks = {MEASURED: held, ESTIMATED: style.look(1).line}
    truth: Any = panel.of(log)
    for word, received in measured_flights(log):
        values = panel.of(received)
        if values is not None and not np.array_equal(values, truth, equal_nan=True):
            yield word, values, looks[word]


def _of_different_references(panel: Panel, named: Mapping[str, Log]) -> list[Log]:
    """Flights whose references differ: one line for each, drawn once, the longest flight's first."""
    if panel.desired is None:
        return []
    found: list[Log] = []
    seen: list[Array] = []
    for log in sorted(named.values(), key=lambda log: -log.time.size):
        desired = panel.desired(log)
        if desired is None:
            continue
        if not any(np.array_equal(desired, other[: desired.size]) for other in seen):
            found.append(log)
            seen.append(desired)
    return found


def _ends(
    panel: Panel, named: Mapping[str, Log], style: PictureStyle, span: tuple[float, float]
) -> tuple[float, float]:
    """Ends of the value axis: of the flights that were completed, if there are any, and of their references.

    A flight that was lost adds at most as much again on each side, so that it does not flatten the others.
    """
    kept: list[Array] = []
    lost: list[Array] = []
    for log in named.values():
        inside = (log.time >= span[0]) & (log.time <= span[1])
        curves = [read(log) if read else None for read in (panel.of, panel.desired)]
        curves += [values for _, values, _ in _beside_truth(panel, named, style)]
        (kept if log.status == "completed" else lost).extend(each[inside] for each in curves if each is not None)
    both = limits(kept + lost, floor=panel.magnitude, span=panel.span)
    if not any(each.size for each in kept):
        return both
    ends = limits(kept, floor=panel.magnitude, span=panel.span)
    more = ends[1] - ends[0]
    return max(both[0], ends[0] - more), min(both[1], ends[1] + more)


def _limits(ax: Axes, panel: Panel, facts: Mapping[str, FlightFacts], style: PictureStyle) -> dict[str, Any]:
    """Lines of the limits that a curve comes near to; words about the others."""
    values = sorted({limit for each in facts.values() for limit in panel.limits(each)})
    low, high = ax.get_ylim()
    near = [each for each in values if _is_near(each, low, high)]
    handles: dict[str, Any] = {}
    for limit in near:
        handles["limit"] = ax.axhline(limit, label="limit", **style.limit.line)
    if near:
        low, high = min(low, *near), max(high, *near)
        room = 0.07 * (high - low)
        ax.set_ylim(low - room, high + room)
    # of a limit to both sides the one that is drawn says the other
    far = [each for each in values if each not in near and -each not in near]
    if far:
        low, high = ax.get_ylim()
        ax.set_ylim(low, high + 0.2 * (high - low))
        ax.text(0.99, 0.95, _words(far, panel.unit), transform=ax.transAxes, ha="right", va="top", **_note(style))
    return handles


def _is_near(limit: float, low: float, high: float) -> bool:
    """True if the curves between these ends come near a limit, relative to their distance from zero."""
    reached = high if limit > 0.0 else -low
    return low <= limit <= high or (limit != 0.0 and reached >= NEAR * abs(limit))


def _words(limits_: Sequence[float], unit: str) -> str:
    """Limits that lie outside the panel, in words."""
    if len(limits_) == 2 and limits_[0] == -limits_[1]:
        return f"limits \N{PLUS-MINUS SIGN}{limits_[1]:.3g} {unit}"
    word = "limit" if len(limits_) == 1 else "limits"
    return f"{word} {', '.join(f'{each:.3g}' for each in limits_)} {unit}".replace("-", "\N{MINUS SIGN}")


def _note(style: PictureStyle) -> dict[str, Any]:
    box = {"boxstyle": "square,pad=0.15", "facecolor": style.face, "edgecolor": "none", "alpha": 0.8}
    return {**style.small_words, "fontsize": 0.9 * style.small, "color": style.frame, "bbox": box, "zorder": 5}


def _shade(
    ax: Axes, facts: Mapping[str, FlightFacts], style: PictureStyle, span: tuple[float, float]
) -> dict[str, Any]:
    """Events of the flights: an interval as a shade, an instant as a line; words of the legend -> artist."""
    handles: dict[str, Any] = {}
    instants: dict[str, str] = {}
    for i, (event, label) in enumerate(events_of(facts).items()):
        if event.start > span[1] or event.stop < span[0]:
            continue
        if event.start == event.stop:
            instants.setdefault(label, ("-", "--", "-.", ":")[len(instants) % 4])
            line: dict[str, Any] = {"color": style.frame, "linewidth": 0.08 * style.text, "linestyle": instants[label]}
            handles[label] = ax.axvline(event.start, zorder=0.3, label=f"_{label}", **line)
            continue
        fill: dict[str, Any] = {
            "facecolor": style.shades[i % len(style.shades)],
            "edgecolor": style.grid,
            "linewidth": 0.0,
        }
        hatch = ("////", "", "\\\\\\\\", "....")[i % 4]
        handles[label] = ax.axvspan(event.start, min(event.stop, span[1]), hatch=hatch or None, zorder=0.2, **fill)
    return handles


def events_of(facts: Mapping[str, FlightFacts]) -> dict[Event, str]:
    """Every event once with its words, and the flights that it belongs to where these are not all."""
    found: dict[Event, list[str]] = {}
    for label, each in facts.items():
        for event in each.events:
            found.setdefault(event, []).append(label)
    return {
        event: event.label if len(whose) == len(facts) else f"{event.label} ({', '.join(whose)})"
        for event, whose in found.items()
    }
