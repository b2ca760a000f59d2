"""What happened to a flight and when: gusts, faults, payloads, and what was changed while it flew."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from skyarm.environment import Gust
from skyarm.records.leaves import parts
from skyarm.scenario.in_flight import Overrides, stretches
from skyarm.scenario.scenario_record import Change, Scenario

SURROUNDINGS = "environment."
"""Beginning of the paths on which gusts and faults depend."""

MOST_PATHS = 3
"""Changed paths that the legend names; of more it says how many."""

LONGEST_VALUE = 16
"""Characters of a changed value in words."""


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happens to a flight: ``start`` to ``stop`` (s), the same where it happens at once."""

    label: str
    start: float
    stop: float


def events_in(scenario: Scenario, end: float) -> tuple[Event, ...]:
    """Gusts, faults, payloads and changes that a flight met until ``end`` (s), each kind in its order.

    What goes on behind the end of a flight has its own: flights that were lost at other times met the same gust.
    """
    found: list[Event] = []
    for start, stop, now in _settings(scenario, end):
        for event in (*_gusts(now), *_faults(now), *_payloads(now)):
            cut = dataclasses.replace(event, start=max(event.start, start), stop=min(event.stop, stop))
            if cut.start < min(cut.stop, end):
                found.append(cut)
    return (*_joined(found), *_changes(scenario, end))


def _settings(scenario: Scenario, end: float) -> Iterator[tuple[float, float, Scenario]]:
    """(from, to, the scenario as it is then) between changes of the surroundings, s."""
    starts: list[tuple[float, Overrides]] = []
    for stretch in stretches(scenario):
        kept = Overrides(*(tuple(pair for pair in pairs if pair[0].startswith(SURROUNDINGS)) for pairs in (
            stretch.overrides.parts, stretch.overrides.numbers)))  # fmt: skip
        if not starts or kept != starts[-1][1]:
            starts.append((stretch.start / scenario.rates.control, kept))
    stops = [start for start, _ in starts[1:]] + [end]
    for (start, overrides), stop in zip(starts, stops, strict=True):
        yield start, stop if stop < end else float("inf"), overrides.of(scenario)


def _gusts(scenario: Scenario) -> Iterator[Event]:
    """Every gust of the wind and of what else surrounds the vehicle."""
    for around in (scenario.wind, *scenario.air, *scenario.forces):
        held = parts(around)
        for gust in (*held.values(), *held.get("gusts", ())):
            if isinstance(gust, Gust) and any(float(c) for c in gust.peak):
                yield Event("gust", float(gust.start), float(gust.start + gust.duration))


def _faults(scenario: Scenario) -> Iterator[Event]:
    for fault in scenario.faults:
        what = f"rotor {fault.rotor}" if fault.rotor else f"joint {fault.joint}"
        if fault.stuck or fault.signal is not None:
            yield Event(f"{what} {'stuck' if fault.stuck else 'varies'}", float(fault.start), float("inf"))
        elif float(fault.effectiveness) < 1.0:
            yield Event(f"{what} at {100.0 * float(fault.effectiveness):.3g} %", float(fault.start), float("inf"))


def _payloads(scenario: Scenario) -> Iterator[Event]:
    """While a payload is held whose instants are given; where a place decides, the log's ``payload_mass`` tells."""
    for payload in scenario.payloads:
        if payload.pick_place is None and payload.drop_place is None:
            yield Event(f"holds {float(payload.mass):.3g} kg", float(payload.pick), float(payload.drop))


def _joined(events: Iterable[Event]) -> list[Event]:
    """Events of which one goes on where another of its name ended are one."""
    found: list[Event] = []
    for event in events:
        before = next(
            (i for i, each in enumerate(found) if (each.label, each.stop) == (event.label, event.start)), None
        )
        if before is None:
            found.append(event)
        else:
            found[before] = dataclasses.replace(found[before], stop=event.stop)
    return found


def _changes(scenario: Scenario, end: float) -> Iterator[Event]:
    """An instant for each change, named by its path and value; by the path alone where that changes again."""
    changes = [change for change in scenario.changes if float(change.at) < end]
    paths = list(dict.fromkeys(change.path for change in changes))
    for change in changes:
        alike = sum(other.path == change.path for other in changes)
        label = f"{change.path}, {alike} changes" if alike > 1 else _words(change)
        if len(paths) > MOST_PATHS:
            label = f"{len(changes)} changes of {len(paths)} numbers"
        yield Event(label, float(change.at), float(change.at))


def _words(change: Change) -> str:
    """A change to a number or a name in full, of a whole part its path alone."""
    value: Any = change.value
    if not isinstance(value, (float, str, bool)):
        return f"{change.path} replaced"
    text = f"{value:.4g}" if isinstance(value, float) else str(value)
    return (
        f"{change.path} = {text}"
        if len(text) <= LONGEST_VALUE
        else f"{change.path} = {text[: LONGEST_VALUE - 1]}\N{HORIZONTAL ELLIPSIS}"
    )
