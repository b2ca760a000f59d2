"""Summary of a flight (status, errors, thrust, contacts, events) as plain data and as
lines of text.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from skyarm.dynamics.actuators.rotor import push
from skyarm.log.flight_log import Log
from skyarm.log.flown_scenario import Info, restored_at, written_at
from skyarm.log.log_columns import columns, component_labels
from skyarm.log.metrics.metric_catalogue import TEAMS, metric_words
from skyarm.log.metrics.path_distance import path_distance
from skyarm.log.metrics.score import score
from skyarm.log.metrics.windows import Windows, windows_of
from skyarm.log.periods import ContactPeriod, contact_pairs, timed_out
from skyarm.log.sensor_data import COMPONENTS
from skyarm.records.arrays import Array, lengths
from skyarm.records.files import printable
from skyarm.records.text_tables import shown_number
from skyarm.view.pages import Facts, Line, heading, table_of

LABELS = {
    "tip": ("tip, mm", 1e3),
    "position": ("base, mm", 1e3),
    "joints": ("joints, rad or m", 1.0),
    "tip_to_path": ("tip to its path, mm", 1e3),
    "base_to_path": ("base to its path, mm", 1e3),
    "lag": ("governor's lag, s", 1.0),
}
"""Error -> its row in the table, in this order, and the factor of its unit."""

COMMANDS = ("rotor_jitter", "rotor_saturation")
"""Metrics of the rotor commands over the window of the errors."""

WORLD = ("contacts", "mechanisms", "grasps")
"""Facts of the world, which the logs of all vehicles have: a summary of several
vehicles says them once."""

DESCRIPTION = (
    "plant",
    "integrator",
    "seed",
    "duration",
    "end_time",
    "status",
    "cause",
)
"""Entries of a log's description in every summary, behind scenario and law."""

MOST_NAMED = 3
"""Number of parameters changed in flight that are named."""


def facts(log: Log) -> Facts:
    """Summary of a flight as plain data: status, errors, thrust, contacts, grasps and
    phases; of each vehicle.
    """
    info = log.info
    # a summary of one vehicle has its numbers at the top, of several below each name:
    # files have both forms
    if len(log.agents) > 1:
        forces = {
            name: _grasp_force(log, i)
            for i, name in enumerate(component_labels(log, "grasp_force"))
        }
        carried = _finite(score(log, [*TEAMS])) if "team_pull" in log.common else {}
        return (
            _description(info, "scenario")
            | {"agents": {name: facts(each) for name, each in log.agents.items()}}
            | _without_empty(grasp_forces=forces, carried=carried)
        )
    values = _description(info, "scenario", "controller")
    values["vehicle"] = info["plant_vehicle"]
    if "autopilot" in info:
        values["autopilot"] = info["autopilot"]
    # before take-off there is no reference, so errors would mean nothing
    if not log.time.size or not _took_off(values):
        return values
    steady = Windows().of_flight(float(info["duration"]), windows_of(log)).steady
    inside = steady.of(log)

    def summary(error: Array) -> dict[str, float | None]:
        # a flight that ended before the window has no mean
        mean, most = (
            (float(error[inside].mean()), float(error[inside].max()))
            if inside.any()
            else (None, None)
        )
        return {"mean": mean, "max": most, "max_whole_flight": float(error.max())}

    errors = {what: summary(error) for what, error in error_norms(log).items()}
    values |= {
        "steady_window_s": [steady.start, steady.stop],
        "errors_continuous": errors,
    }
    values |= (
        _finite(score(log, COMMANDS))
        | {"peak_thrust": _peak_thrust(log)}
        | asdict(log.shortfall)
    )
    # a law before or behind a change may estimate none
    found = log.lag_found
    found = found[np.isfinite(found).all(axis=1)]
    if found.size:
        values["lag_found_s"] = found[-1]
    values |= _without_empty(contacts=_contacts(log), mechanisms=_mechanisms(log))
    if log.component("gripper_taken").size:
        values["grasps"] = [asdict(each) for each in log.grasp_periods]
    if log.phase.size:
        late = timed_out(log)
        values["phase_ends"] = [
            {"phase": name, "end": end, "timeout": number in late}
            for number, (name, end) in enumerate(log.phase_ends)
        ]
    elif log.path_time.size:
        distances = {
            "lag": log.time - log.path_time,
            "base_to_path": path_distance(log.position, log.position_reference),
        }
        # without an arm the tip is the base, and its row would repeat that of the base
        if not np.array_equal(log.tool, log.position):
            distances["tip_to_path"] = path_distance(log.tool, log.tool_reference)
        values["governor"] = {
            what: summary(distance) for what, distance in distances.items()
        }
    return values


def _description(info: Info, *first: str) -> Facts:
    """First entries of a summary, from a log's description."""
    values = {name: info[name] for name in (*first, *DESCRIPTION)}
    return values | {"cause": info["cause"] or None}


def _without_empty(**facts: Any) -> Facts:
    """Facts by name, without those that are empty."""
    return {name: each for name, each in facts.items() if each}


def _finite(scores: Mapping[str, float]) -> dict[str, float | None]:
    """Metrics by name, None for NaN."""
    return {
        name: value if math.isfinite(value) else None for name, value in scores.items()
    }


def _grasp_force(log: Log, index: int) -> dict[str, float]:
    """Mean and largest force (N) in a grasp, and the last one."""
    force = log.component("grasp_force")[:, index]
    return {
        "mean": float(force.mean()),
        "max": float(force.max()),
        "last": float(force[-1]),
    }


def _took_off(values: Facts) -> bool:
    """True unless the flight ended during an autopilot's take-off."""
    return "autopilot" not in values or values["autopilot"]["prepared_s"] > 0.0


def error_norms(log: Log) -> dict[str, Array]:
    """Norms (N,) of the errors in position, joints and tip against the continuous
    reference, by name.
    """
    arrays = {"position": "position"}
    if log.joints.shape[1]:
        arrays["joints"] = "joints"
    # without an end effector the tip is the base, whose error is there already
    if not np.array_equal(log.tool, log.position):
        arrays["tip"] = "tool"
    return {
        what: lengths(log[name] - log[f"{name}_reference"])
        for what, name in arrays.items()
    }


def _peak_thrust(log: Log) -> float | None:
    """Highest ratio of a rotor's thrust to its maximum; None if no rotor has a
    limit.
    """
    rotors = getattr(restored_at(log.info, "plant.vehicle"), "rotors", ())
    # not strict: a log of an older version may lack the vehicle
    pairs = zip(rotors, np.abs(log.rotor_speeds).max(axis=0), strict=False)
    return max(
        (
            float(push(r, w) / push(r, r.max_speed))
            for r, w in pairs
            if np.isfinite(r.max_speed)
        ),
        default=None,
    )


def _has_battery(log: Log) -> bool:
    """True if the logged vehicle has a battery, whose voltage then limits the
    rotors.
    """
    return getattr(restored_at(log.info, "plant.vehicle"), "battery", None) is not None


def _contacts(log: Log) -> list[Facts]:
    """List contacts by surface and contact point or by pair of bodies: first touch (s),
    losses of contact, largest force (N).
    """
    bodies = contact_pairs(log, "collision_force")
    pairs: dict[tuple[str, str], list[ContactPeriod]] = {}
    # by surface and point, in the order of the first touch
    for period in log.contact_periods:
        pairs.setdefault((period.surface, period.point), []).append(period)
    return [
        {
            **(
                {"pair": f"{point}/{surface}"}
                if (point, surface) in bodies
                else {"surface": surface, "point": point}
            ),
            "first_touch": periods[0].start,
            "losses": sum(each.end is not None for each in periods),
            "peak": max(each.peak for each in periods),
        }
        for (surface, point), periods in pairs.items()
    ]


def _mechanisms(log: Log) -> list[Facts]:
    """List the coordinate of each mechanism, such as a door: first, farthest and last
    value.
    """
    rows = [
        each
        for each in columns(log)
        if each.array == f"{COMPONENTS}.mechanism_position"
    ]
    moved = []
    for name, column in zip(
        component_labels(log, "mechanism_position"), rows, strict=True
    ):
        place = column.of(log)
        # the largest distance from the start, since a door may come back
        furthest = place[np.abs(place - place[0]).argmax()]
        moved.append(
            {
                "name": name,
                "first": place[0],
                "furthest": furthest,
                "last": place[-1],
                "unit": column.unit,
            }
        )
    return moved


def summary(log: Log, values: Facts) -> list[Line]:
    """Text of a flight's summary: status, table of tracking errors, thrust and events;
    of several vehicles of each.
    """
    if len(log.agents) > 1:
        first, *others = values["agents"].values()
        shared = {
            key: first[key]
            for key in WORLD
            if key in first and all(each.get(key) == first[key] for each in others)
        }
        lines: list[Line] = [heading(headline(log, values)), *sentences(shared)]
        for name, own in log.agents.items():
            rest = {
                key: value
                for key, value in values["agents"][name].items()
                if key not in shared
            }
            # the vehicle's name takes the place of its headline
            lines += [heading(name), *summary(own, rest)[1:]]
        rows = [
            (name, *(shown_number(each, 4) for each in force.values()))
            for name, force in values.get("grasp_forces", {}).items()
        ]
        if rows:
            head = ("force in a grasp, N", "mean", "max", "at the end")
            lines.append(table_of(head, rows))
        rows = [
            (
                ", ".join(filter(None, metric_words(name))),
                "-" if value is None else shown_number(value, 4),
            )
            for name, value in values.get("carried", {}).items()
        ]
        return [*lines, table_of(("carried body", "value"), rows)] if rows else lines
    if not _took_off(values):
        return [heading(headline(log, values))]
    lines = [heading(headline(log, values)), printable(_flight_words(log))]
    if "steady_window_s" not in values:
        return lines
    start, stop = values["steady_window_s"]
    errors = values["errors_continuous"] | values.get("governor", {})
    rows = [
        (
            label,
            *(
                "-" if value is None else shown_number(factor * value, 4)
                for value in errors[what].values()
            ),
        )
        for what, (label, factor) in LABELS.items()
        if what in errors
    ]
    lines.append(
        table_of(
            (f"error, {start:.4g} to {stop:.4g} s", "mean", "max", "max, whole flight"),
            rows,
        )
    )
    jitter, limited = (values[name] for name in COMMANDS)
    if jitter is not None:
        # a battery lowers the limits, so "at its limit" would be no number of the rotor
        words = (
            ""
            if limited is None or _has_battery(log)
            else f", a rotor at its limit in {100.0 * limited:.3g} % of the periods"
        )
        lines.append(
            f"rotor commands then: jitter {shown_number(jitter, 4)} rad/s a"
            f" period{words}"
        )
    if values["peak_thrust"] is not None:
        # rest is no cut command, and still the least speed of most rotors
        cut = values["saturation"] or _has_battery(log) or not log.rotor_commands.all()
        lines.append(
            f"peak thrust: {values['peak_thrust']:.0%} of a rotor's"
            f" highest{'' if cut else '; no command at a limit'}"
        )
    return [*lines, *log.shortfall.lines, *sentences(values)]


def headline(log: Log, values: Facts) -> str:
    """First line of a flight's summary: scenario, status, duration and cause of the
    end.
    """
    end, duration = (f"{values[name]:g} s" for name in ("end_time", "duration"))
    if len(log.agents) > 1 or _took_off(values):
        title = f"{values['scenario']}: {log.status}, {end}" + (
            f" of {duration}" if end != duration else ""
        )
    else:
        title = f"{values['scenario']}: {log.status}, no take-off in {end}"
    return title + (f": {values['cause']}" if values["cause"] else "")


LEAST_LAG = 0.05
"""Least lag (ms) that the summary names: smaller ones would read 0.0."""


def sentences(values: Facts) -> list[str]:
    """List sentences on estimated lags, contacts, mechanisms, grasps and phases of a
    flight.
    """
    lines = []
    if "autopilot" in values:
        said = values["autopilot"]
        counts = (
            f"; {said['answered']} of {said['steps']} messages answered"
            if "answered" in said
            else ""
        )
        lines.append(
            f"autopilot {said['name']}: hovered {said['prepared_s']:.3g} s after"
            f" power-on{counts}"
        )
    if "lag_found_s" in values:
        rotors, joints = 1e3 * values["lag_found_s"]
        found = [
            f"{what} {lag:.1f} ms"
            for what, lag in (("rotors", rotors), ("joints", joints))
            if lag >= LEAST_LAG
        ]
        lines += (
            [f"lag found at the end, beyond the law's nominal: {', '.join(found)}"]
            if found
            else []
        )
    for each in values.get("contacts", ()):
        if "pair" in each:
            first, _, second = each["pair"].partition("/")
        else:
            first, second = each["surface"], each["point"]
        touch = f"{first} touched {second} at {each['first_touch']:g} s"
        times = "once" if each["losses"] == 1 else f"{each['losses']} times"
        lines.append(f"{touch}: lost {times}, largest force {each['peak']:.3g} N")
    for each in values.get("mechanisms", ()):
        first, furthest, last = (
            shown_number(each[name]) for name in ("first", "furthest", "last")
        )
        lines.append(
            f"{each['name']} moved from {first} to {furthest} {each['unit']}, at the"
            f" end {last} {each['unit']}"
        )
    for each in values.get("grasps", ()):
        ended = (
            f"{'gave way' if each['gave_way'] else 'let go'} at {each['end']:g} s"
            if each["end"]
            else ""
        )
        grasp = (
            f"{each['gripper']} took {each['held']} at {each['start']:g} s:"
            f" {ended or 'holds it to the end'}"
        )
        lines.append(f"{grasp}, largest force {each['peak']:.3g} N")
    ends = [
        f"{each['phase']}"
        f" {'-' if each['end'] is None else '{:g} s'.format(each['end'])}"
        + (" (timeout)" if each["timeout"] else "")
        for each in values.get("phase_ends", ())
    ]
    lines += [f"phases done: {', '.join(ends)}"] if ends else []
    return lines


def _flight_words(log: Log) -> str:
    """Line with law, vehicle, plant, integrator, seed, scheduled changes and plugins of
    a flight.
    """
    info = log.info
    plant = f"{info['plant_vehicle']}, plant {info['plant']} ({info['integrator']})"
    line = f"law {info['controller']} on {plant}, seed {info['seed']}"
    changes = written_at(info, "changes") or ()
    paths = dict.fromkeys(str(each["path"]) for each in changes if "path" in each)
    if changes:
        named = f" (of {', '.join(paths)})" if 0 < len(paths) <= MOST_NAMED else ""
        line += (
            f", {len(changes)} change{'s' if len(changes) > 1 else ''} in flight{named}"
        )
    plugins = info.get("plugins") or {}
    return line + (f", plugins {', '.join(sorted(plugins))}" if plugins else "")
