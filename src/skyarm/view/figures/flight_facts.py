"""Labels, end times, forces and events of a flight, as its figures and films show
them.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from skyarm.log.flight_log import Log
from skyarm.log.formats import as_log
from skyarm.log.log_columns import component_labels
from skyarm.log.metrics.score import wanted_push
from skyarm.records.arrays import Array, Mask, lengths
from skyarm.records.files import PathLike
from skyarm.records.immutable import positional
from skyarm.scenario.payload_tables import scheduled_changes
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.drawn_scenario import drawn_scenario
from skyarm.vehicle.vehicle_records import body_names

MOST_PATHS = 3
"""Number of changed paths that the legend names; for more it gives their number."""

LONGEST, LONGEST_VALUE = 40, 16
"""Largest number of characters of a label, and of a changed value."""


Named = Mapping[str, Log]
"""Text of the legend -> log."""

Span = tuple[float, float]
"""First and last instant (s) of an interval."""


@positional
class Event:
    """Event in a flight, such as a gust or fault: label, start and stop time (s), which
    are equal for an instant.
    """

    label: str
    start: float
    stop: float


def scenario_of(log: Log) -> Scenario | None:
    """Scenario stored in a log; None if there is none or it cannot be restored."""
    try:
        return drawn_scenario(log)
    except ValueError:
        return None


def end_time(log: Log) -> float:
    """End time (s) of a log's last control period."""
    return (
        # decimal: the end of a period must not be 19.999999999999996
        round(float(log.time[-1]) + 1.0 / float(log.info["rates_hz"]["control"]), 9)
        if log.time.size
        else 0.0
    )


def within(log: Log, span: Span) -> Mask:
    """Mask (N,) of the instants of a log within a time interval."""
    return (log.time >= span[0]) & (log.time <= span[1])


def gust_interval(log: Log) -> Span | None:
    """Time interval (s) from the first gust of air or force to the last; None without
    gusts within the flight.

    Of a log without a scenario it is where the wind's force is not zero, unless it is
    so throughout.
    """
    scenario = scenario_of(log)
    if scenario is not None and log.time.size:
        last = float(log.time[-1])
        gusts = [
            each[1:]
            for part in scenario.components
            for each in part.events
            if each[0] == "gust"
        ]
        gusts = [(start, stop) for start, stop in gusts if start <= last]
        return (
            (
                min(start for start, _ in gusts),
                min(last, max(stop for _, stop in gusts)),
            )
            if gusts
            else None
        )
    blowing = np.flatnonzero(lengths(log.wind_force) > 0.0)
    # a force that blows throughout is a wind and no gust
    if not blowing.size or blowing.size == log.time.size:
        return None
    # a force that is logged at an instant acts until the next one
    end = min(int(blowing[-1]) + 1, log.time.size - 1)
    return float(log.time[blowing[0]]), float(log.time[end])


Flight = Log | PathLike
"""Log, or the path of its file."""

Flights = Flight | Sequence[Flight] | Mapping[str, Flight]


def flights_by_label(flights: Flights) -> dict[str, Log]:
    """Return logs by their legend labels, in the order given."""
    if isinstance(flights, Mapping):
        return {
            shorten_label(str(label)): as_log(log) for label, log in flights.items()
        }
    given = (
        list(flights)
        if isinstance(flights, Sequence) and not isinstance(flights, str)
        else [flights]
    )
    logs = [as_log(each) for each in given]
    files = [os.fspath(each) for each in given if not isinstance(each, Log)]
    # files name flights only if all of them are files
    return dict(
        zip(
            flight_labels(logs, files if len(files) == len(logs) else ()),
            logs,
            strict=True,
        )
    )


def flight_labels(logs: Sequence[Log], files: Sequence[str] = ()) -> list[str]:
    """Make a unique legend label for each of several flights, from file names, laws,
    scenarios, plants or seeds.

    Args:
        logs: logs of the flights.
        files: their paths, where they come from files.

    Returns:
        names of the files, or of the laws, or law and scenario, law and plant, law and
        seed, whichever tells all flights apart; at last numbers. Empty for a single
        flight of several vehicles, which their names tell apart.
    """
    if len(logs) == 1 and len(logs[0].agents) > 1:
        return [""]
    every = [
        dict.fromkeys(
            str(own.info.get("controller", "")) for own in log.agents.values()
        )
        for log in logs
    ]
    laws = [" and ".join(each) for each in every]
    told_by = (
        [
            f"{law}, {log.info.get(field, '')}"
            for law, log in zip(laws, logs, strict=True)
        ]
        for field in ("scenario", "plant", "seed")
    )
    # file names first, as the user chose them; numbers tell apart what nothing else
    # does
    for labels in ([Path(file).stem for file in files], laws, *told_by, files):
        short = [shorten_label(label) for label in labels]
        if len(short) == len(logs) == len(set(short)):
            return short
    return [shorten_label(f"{i + 1}: {law}") for i, law in enumerate(laws)]


def vehicle_logs(label: str, log: Log) -> list[tuple[str, Log]]:
    """Log of each vehicle with its label: that of the flight, and the vehicle's name
    where there are several.
    """
    # a report of one vehicle has no use for its name
    if len(log.agents) == 1:
        return [(label, log)]
    return [
        (f"{label}, {name}" if label else name, own) for name, own in log.agents.items()
    ]


def vehicles_by_label(flights: Named) -> dict[str, Log]:
    """Return the log of each vehicle of several flights by its legend label."""
    return {
        shorten_label(name): own
        for label, log in flights.items()
        for name, own in vehicle_logs(label, log)
    }


def shorten_label(text: str) -> str:
    """Shorten a label in its middle to the length of a legend entry."""
    half = (LONGEST - 1) // 2
    return (
        text
        if len(text) <= LONGEST
        else f"{text[:half]}\N{HORIZONTAL ELLIPSIS}{text[-half:]}"
    )


def ending_of(log: Log) -> str:
    """Text to add to the legend label of a flight that ended early, such as "
    (diverged)"; empty for others.
    """
    return "" if log.status == "completed" else f" ({log.status.replace('_', ' ')})"


def applied_force(log: Log) -> Array | None:
    """Contact force (N) on the vehicle over time: normal to surfaces, of the grip on a
    handle, of grasps; else None.
    """
    touches = own_forces(log, "contact_force")
    grips = own_forces(log, "gripper_force")
    pulls = grasp_pulls(log)
    if not touches.size:
        return np.linalg.norm([*pulls.values()], axis=2).sum(axis=0) if pulls else None
    normal, grip = np.asarray(touches.sum(axis=1)), np.asarray(grips.sum(axis=1))
    # grips count where nothing presses on a surface: a handle's is the task's force
    return grip if grips.size and not normal.any() else normal


def own_forces(log: Log, array: str) -> Array:
    """Logged forces (N, k) at the contact points or of the grippers of a log's vehicle,
    without those of others.
    """
    table = log.component(array)
    others = parts_of_others(log)
    if not others:
        return table
    own = [
        i
        for i, label in enumerate(component_labels(log, array))
        if others.isdisjoint(label.split("/"))
    ]
    return table[:, own]


def parts_of_others(log: Log) -> frozenset[str]:
    """Names of the vehicles that fly beside that of a log, and of their contact points,
    grippers and grasps.
    """
    scenario = scenario_of(log)
    if scenario is None or scenario.world is None:
        return frozenset()
    world = scenario.world
    own = ("", *scenario.agents)
    names = [each.name for each in world.points if each.agent not in own]
    names += [each.name for each in world.grippers if each.agent not in own]
    grasps = [each for each in world.grasps if each.agent not in own]
    return frozenset(
        [*names, *(each.label for each in grasps), *(each.agent for each in grasps)]
    )


def touches_own_body(log: Log, pair: Sequence[str]) -> bool:
    """Tell whether a pair of bodies that touched has one of a log's vehicle."""
    scenario = scenario_of(log)
    if scenario is None:
        return True
    # of several vehicles each body has the vehicle's name before its own
    return any(
        each.startswith(f"{name}.") for name in scenario.agents for each in pair
    ) or any(pair[0] in body_names(vehicle) for vehicle in scenario.vehicles.values())


def grasp_pulls(log: Log) -> dict[str, Array]:
    """Force (N, 3), world axes, of a log's vehicle on each body that it holds by
    grasps, by the body's name.
    """
    pulls = log.component("grasp_pull").reshape(log.time.size, -1, 3)
    forces: dict[str, Array] = {}
    scenario = scenario_of(log) if pulls.size else None
    if scenario is None or scenario.world is None:
        return {}
    for i, grasp in enumerate(scenario.world.grasps):
        if grasp.agent in ("", *scenario.agents):
            forces[grasp.body] = forces.get(grasp.body, 0.0) + pulls[:, i]
    return forces


def desired_push(log: Log) -> Array | None:
    """Desired contact force (N) of the tip over time; None if none is commanded."""
    push = wanted_push(log) if scenario_of(log) is not None else ()
    return push[0] if push else None


def flight_events(log: Log) -> tuple[Event, ...]:
    """List the gusts, faults, payloads and scheduled parameter changes of a flight,
    sorted by kind.

    An interval keeps its end behind that of the flight: flights that were lost at other
    times met the same gust.
    """
    scenario = scenario_of(log)
    end = end_time(log)
    if scenario is None:
        gust = gust_interval(log)
        return () if gust is None else (Event("gust", *gust),)
    events = [
        Event(*each) for component in scenario.components for each in component.events
    ]
    for fault in scenario.agent.faults:
        actuator = f"rotor {fault.rotor}" if fault.rotor else f"joint {fault.joint}"
        if fault.stuck or fault.signal is not None:
            events.append(
                Event(
                    f"{actuator} {'stuck' if fault.stuck else 'varies'}",
                    float(fault.start),
                    np.inf,
                )
            )
        elif float(fault.effectiveness) < 1.0:
            share = f"{actuator} at {100.0 * float(fault.effectiveness):.3g} %"
            events.append(Event(share, float(fault.start), np.inf))
    return (
        *(each for each in events if each.start < min(each.stop, end)),
        *_changes(scenario, end),
    )


def _changes(scenario: Scenario, end: float) -> Iterator[Event]:
    """List scheduled parameter changes of a scenario as events, labelled by parameter
    path and value.
    """
    changes = [
        change for change in scheduled_changes(scenario) if float(change.at) < end
    ]
    paths = [change.path for change in changes]
    for change in changes:
        alike = paths.count(change.path)
        value = change.value
        text = f"{value:.4g}" if isinstance(value, float) else str(value)
        label = f"{change.path} = {text}"
        if not isinstance(value, (float, str, bool)) or len(text) > LONGEST_VALUE:
            label = f"{change.path} replaced"
        if alike > 1:
            label = f"{change.path}, {alike} changes"
        if len(set(paths)) > MOST_PATHS:
            label = f"{len(changes)} changes of {len(set(paths))} numbers"
        yield Event(label, float(change.at), float(change.at))
