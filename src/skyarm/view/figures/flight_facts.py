"""Facts of a flight for its plots: label, names, limits, events, contacts."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.log.flight_log import Log
from skyarm.log.flown_scenario import written_part
from skyarm.log.log_columns import names_of
from skyarm.log.periods import contact_pairs, contact_periods
from skyarm.records.leaves import parts
from skyarm.scenario.in_flight import Overrides, stretches
from skyarm.scenario.scenario_record import Change, Scenario
from skyarm.world import Gust

Array = npt.NDArray[np.float64]

APART = 0.04
"""s: a shorter gap between two touches of a pair is no loss of contact, as for a law that presses."""

SURROUNDINGS = "environment."
"""Beginning of the paths on which gusts and faults depend."""

MOST_PATHS = 3
"""Changed paths that the legend names; of more it says how many."""

LONGEST, LONGEST_VALUE = 40, 16
"""Characters of a label, and of a changed value in words."""


@dataclass(frozen=True, slots=True)
class Event:
    """An event of a flight: ``start`` to ``stop`` (s), the same where it happens at once."""

    label: str
    start: float
    stop: float


@dataclass(frozen=True, slots=True)
class Touching:
    """A pair of a surface and a point, and instants at which it touched and let go.

    Attributes:
        surface, point: names. at_tip: whether the point is the vehicle's tip.
        starts, ends: s; a touch that the flight ends with has no end.
    """

    surface: str
    point: str
    at_tip: bool
    starts: tuple[float, ...]
    ends: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightFacts:
    """Names and limits of a flight.

    Attributes:
        joints: names. revolute: joint by joint, whether it turns; else it slides.
        rotors: names. tip: the vehicle has one.
        joint_limits: (lower, upper), rad or m. effort_limits: (-limit, limit), N m or N.
        rotor_limits: (largest speed,), rad/s.
        setpoints: joint by joint, units of its setpoint where that is no torque, None where it is; several of several
            flights.
        events: gusts, faults, changes. touching: pairs of surfaces and points that touched, and when.
    """

    joints: tuple[str, ...] = ()
    revolute: tuple[bool, ...] = ()
    rotors: tuple[str, ...] = ()
    tip: bool = False
    joint_limits: tuple[tuple[float, float], ...] = ()
    effort_limits: tuple[tuple[float, float], ...] = ()
    rotor_limits: tuple[tuple[float], ...] = ()
    setpoints: tuple[tuple[str | None, ...], ...] = ()
    events: tuple[Event, ...] = ()
    touching: tuple[Touching, ...] = ()


def scenario_of(log: Log) -> Scenario | None:
    """The scenario stored in a log; None of a version that stored none, or of a plugin that is not loaded."""
    try:
        scenario: Scenario = log.scenario
    except ValueError:
        return None
    return scenario


def flight_facts(log: Log) -> FlightFacts:
    """Facts of a flight from its log's scenario; of a log without one, from its arrays alone."""
    scenario, setpoints = scenario_of(log), tuple((unit,) for unit in names_of(log).setpoints)
    if scenario is None:
        gust = gust_interval(log)
        return FlightFacts(
            joints=tuple(f"Joint {i + 1}" for i in range(log.joints.shape[1])),
            revolute=(True,) * log.joints.shape[1],
            rotors=tuple(str(i + 1) for i in range(log.rotor_speeds.shape[1])),
            setpoints=setpoints,
            tip=not np.array_equal(log.tip, log.position),
            events=() if gust is None else (Event("gust", *gust),),
            touching=touchings(log),
        )
    vehicle = scenario.plant.vehicle
    joints = [link.joint for link in vehicle.links]
    return FlightFacts(
        joints=tuple(joint.name[:1].upper() + joint.name[1:] for joint in joints),
        revolute=tuple(joint.kind == "revolute" for joint in joints),
        rotors=tuple(rotor.name for rotor in vehicle.rotors),
        tip=bool(vehicle.end_effector),
        joint_limits=tuple((float(joint.lower), float(joint.upper)) for joint in joints),
        effort_limits=tuple((-float(joint.effort_limit), float(joint.effort_limit)) for joint in joints),
        rotor_limits=tuple((float(rotor.max_speed),) for rotor in vehicle.rotors),
        setpoints=setpoints,
        events=events_in(scenario, end_time(log)),
        touching=touchings(log),
    )


def end_time(log: Log) -> float:
    """End of the last control period of a log, s."""
    return round(float(log.time[-1]) + 1.0 / float(log.info["rates_hz"]["control"]), 9) if log.time.size else 0.0


def gust_interval(log: Log) -> tuple[float, float] | None:
    """When a force of the wind blows during part of the episode, s; None for no wind or a constant one."""
    blowing = np.flatnonzero(np.linalg.norm(log.wind_force, axis=1) > 0.0)
    if not blowing.size or blowing.size == log.time.size:
        return None
    end = min(int(blowing[-1]) + 1, log.time.size - 1)
    return float(log.time[blowing[0]]), float(log.time[end])


def flights_by_label(flights: Log | Sequence[Log] | Mapping[str, Log]) -> dict[str, Log]:
    """Words of the legend -> log, in the order given."""
    if isinstance(flights, Log):
        flights = [flights]
    if isinstance(flights, Mapping):
        return {shorten_label(str(label)): log for label, log in flights.items()}
    return dict(zip(flight_labels(flights), flights, strict=True))


def flight_labels(logs: Sequence[Log], files: Sequence[str] = ()) -> list[str]:
    """A label for each flight, each another one.

    Args:
        logs: of the flights.
        files: their paths, where they come from files.

    Returns:
        names of the files, or of the laws, or law and scenario, law and plant, law and seed, whichever tells all
        flights apart; at last numbers.
    """
    laws = [str(log.info.get("controller", "")) for log in logs]
    choices = [[Path(file).stem for file in files], laws]
    choices += [
        [f"{law}, {log.info.get(field, '')}" for law, log in zip(laws, logs, strict=True)]
        for field in ("scenario", "plant", "seed")
    ]
    choices.append([str(file) for file in files])
    for labels in choices:
        short = [shorten_label(label) for label in labels]
        if len(short) == len(logs) == len(set(short)):
            return short
    return [shorten_label(f"{i + 1}: {law}") for i, law in enumerate(laws)]


def shorten_label(text: str) -> str:
    """Cut a label in its middle to the length of a legend's line."""
    half = (LONGEST - 1) // 2
    return text if len(text) <= LONGEST else f"{text[:half]}\N{HORIZONTAL ELLIPSIS}{text[-half:]}"


def ending_of(log: Log) -> str:
    """Suffix of the label of a flight that ended before its time."""
    return "" if log.status == "completed" else f" ({log.status.replace('_', ' ')})"


def touchings(log: Log) -> tuple[Touching, ...]:
    """Every pair that touched in a flight; periods with a gap below ``APART`` are one."""
    held: dict[tuple[str, str], list[tuple[float, float | None]]] = {}
    for period in contact_periods(log):
        found = held.setdefault((period.surface, period.point), [])
        if found and found[-1][1] is not None and period.start - found[-1][1] < APART:
            found[-1] = (found[-1][0], period.end)
        else:
            found.append((period.start, period.end))
    tips = _at_tip(log)
    return tuple(
        Touching(
            *pair,
            pair[1] in tips,
            tuple(start for start, _ in found),
            tuple(end for _, end in found if end is not None),
        )
        for pair, found in held.items()
    )


def _at_tip(log: Log) -> set[str]:
    """Names of the points at the vehicle's tip, as the log's record has them."""
    points = written_part(log.info, "environment", "world", "points") or ()
    tip = written_part(log.info, "agent", "plant", "vehicle", "end_effector")
    return {str(each.get("name")) for each in points if tip and each.get("frame") == tip}


def contact_force(surface: str, point: str) -> Callable[[Log], Array | None]:
    """Log -> normal force (N,) of a pair, N; None of a flight without it."""

    def read(log: Log) -> Array | None:
        pairs = contact_pairs(log)
        if (surface, point) not in pairs or log.contact_force.shape[1] != len(pairs):
            return None
        return np.asarray(log.contact_force[:, pairs.index((surface, point))])

    return read


def wanted_force(point: str) -> Callable[[Log], Array | None]:
    """Log -> desired contact force (N,) of the tip, N; None where ``point`` is another one or none is desired."""
    return lambda log: wanted_push(log) if point in _at_tip(log) else None


def wanted_push(log: Log) -> Array | None:
    """Desired contact force (N,) of the tip, N; None where none ever is."""
    scenario = scenario_of(log)
    push = None if scenario is None else getattr(scenario.reference, "push", None)
    if scenario is None or push is None:
        return None
    # of a task that waits, at the reference's own time
    times = log.path_time if log.path_time.size and scenario.reference.guards else log.time
    return np.array(np.broadcast_to(push.force.derivatives(times)[0], log.time.shape), float)


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
    return (*_merge(found), *_changes(scenario, end))


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
        actuator = f"rotor {fault.rotor}" if fault.rotor else f"joint {fault.joint}"
        if fault.stuck or fault.signal is not None:
            yield Event(f"{actuator} {'stuck' if fault.stuck else 'varies'}", float(fault.start), float("inf"))
        elif float(fault.effectiveness) < 1.0:
            share = f"{actuator} at {100.0 * float(fault.effectiveness):.3g} %"
            yield Event(share, float(fault.start), float("inf"))


def _payloads(scenario: Scenario) -> Iterator[Event]:
    """Intervals of payloads with given instants; for those picked up by place, see the log's ``payload_mass``."""
    for payload in scenario.payloads:
        if payload.pick_place is None and payload.drop_place is None:
            yield Event(f"holds {float(payload.mass):.3g} kg", float(payload.pick), float(payload.drop))


def _merge(events: Iterable[Event]) -> list[Event]:
    """Merge events of one name that follow each other without a gap."""
    found: dict[tuple[str, float], Event] = {}
    for event in events:
        before = found.pop((event.label, event.start), None)
        begin = event.start if before is None else before.start
        found[event.label, event.stop] = dataclasses.replace(event, start=begin)
    return list(found.values())


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
    cut = text if len(text) <= LONGEST_VALUE else f"{text[: LONGEST_VALUE - 1]}\N{HORIZONTAL ELLIPSIS}"
    return f"{change.path} = {cut}"
