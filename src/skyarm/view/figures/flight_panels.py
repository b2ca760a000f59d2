"""Panels of a flight's time plots, by kind: axis label, unit, curve, reference and
limits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, SupportsFloat

import numpy as np

from skyarm.dynamics.actuators.rotor import push
from skyarm.log.flight_log import Log
from skyarm.log.log_columns import columns, component_labels, names_of, unit_of_kind
from skyarm.log.periods import contact_pairs, points_at_tip
from skyarm.log.sensor_data import COMPONENTS
from skyarm.records.arrays import Array, lengths
from skyarm.records.files import must_be_one_of, shown
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit
from skyarm.vehicle import Joint, Vehicle
from skyarm.view.figures.flight_facts import (
    desired_push,
    grasp_pulls,
    parts_of_others,
    scenario_of,
    touches_own_body,
)

Read = Callable[[Log], Array | None]
"""Function from a log to a curve (N,); None for a log without it."""

Logs = Sequence[Log]
"""Logs of the flights in one picture."""

AXES = "xyz"

MILLIMETRES = 1e3


@immutable
class Panel:
    """Panel of a time plot: one logged quantity with its unit, reference curve and
    limits.

    Attributes:
        label: words for the axis. unit: unit of all that it shows.
        of: curve. desired: its reference, drawn dotted.
        limits: values that it must not pass, in the unit of the panel.
        magnitude: never negative, so the axis begins at zero.
        span: least extent of the axis, so that rounding noise does not fill a panel.
        letter: names the part of a figure that begins here, "" within a part.
        scale: panels with the same name share their limits, "" for its own.
    """

    label: str
    unit: str
    of: Read
    desired: Read | None = None
    limits: tuple[float, ...] = ()
    magnitude: bool = False
    span: float = 0.02
    letter: str = ""
    scale: str = ""


Panels = list[Panel]
"""Panels of a picture from top to bottom."""


def column(name: str, i: int, reference: str = "", factor: float = 1.0) -> Read:
    """Make a function that reads column ``i`` of a logged array, or its difference from
    a reference array.
    """

    def read(log: Log) -> Array | None:
        table: Array = getattr(log, name)
        # another flight of the picture may have more joints or rotors
        if i >= table.shape[1]:
            return None
        off = getattr(log, reference)[:, i] if reference else 0.0
        return factor * (table[:, i] - off)

    return read


def distance(name: str, reference: str, factor: float = 1.0) -> Read:
    """Make a function that computes the norm over time of a logged array's difference
    from a reference array.
    """
    return lambda log: (
        factor * np.asarray(lengths(getattr(log, name) - getattr(log, reference)))
    )


def by_axis(label: str, array: str, desired: str = "", error: str = "") -> Panels:
    """Make a panel for each world axis that shows a logged position with its reference,
    or else its error.
    """
    return [
        Panel(
            label=f"{label} {axis}",
            unit="m",
            of=column(array, i, error),
            desired=column(desired, i) if desired else None,
        )
        for i, axis in enumerate(AXES)
    ]


def _joints(logs: Logs) -> Iterator[tuple[int, str, str, list[Joint]]]:
    """Yield (index, label, kind, joint records of all flights) for each joint of the
    arm with the most joints.
    """
    names = names_of(max(logs, key=lambda log: log.joints.shape[1]))
    for i, (name, kind) in enumerate(zip(names.joints, names.kinds, strict=True)):
        label = name[:1].upper() + name[1:] if kind else f"Joint {i + 1}"
        yield (
            i,
            label,
            kind,
            [each.links[i].joint for each in _vehicles(logs) if i < each.n],
        )


def _vehicles(logs: Logs) -> list[Vehicle]:
    """Vehicles of the flights whose logs hold their scenario."""
    return [
        scenario.agent.vehicle
        for log in logs
        if (scenario := scenario_of(log)) is not None
    ]


def _finite(values: Iterable[SupportsFloat]) -> tuple[float, ...]:
    return tuple(sorted({float(each) for each in values if math.isfinite(each)}))


def _tracking(logs: Logs) -> Panels:
    """Make panels of base position and joints, each with its reference and limits."""
    return by_axis("Base", "position", "position_reference") + [
        Panel(
            label=label,
            unit=unit_of_kind(Unit("rad or m"), kind or "revolute"),
            of=column("joints", i),
            desired=column("joints_reference", i),
            limits=_finite(end for joint in joints for end in joint.ends),
        )
        for i, label, kind, joints in _joints(logs)
    ]


TIP_ERROR = Panel(
    label="Tip error",
    unit="mm",
    of=distance("tip", "tip_reference", MILLIMETRES),
    magnitude=True,
    span=1.0,
)
"""Panel of the distance of the tip from its reference."""


def _tip(logs: Logs) -> Panels:
    return [*by_axis("Tip", "tip", "tip_reference"), TIP_ERROR]


def _team(logs: Logs) -> Panels:
    """Make panels that compare vehicles: tip error, forces on the bodies in their
    grasps, the team's, total thrust.
    """
    # spans: what a plot may magnify before it shows rounding; chosen by eye
    thrust = Panel(label="Thrust", unit="N", of=_thrust, magnitude=True, span=0.1)
    shared = (
        each for each in _parts(logs) if each.label.startswith(("team_", "load_share"))
    )
    carried = (
        replace(each, span=1e-3, label=each.label.replace("_", " ").capitalize())
        for each in shared
    )
    return [TIP_ERROR, *_grasps(logs), *carried, thrust]


def _thrust(log: Log) -> Array | None:
    """Sum of the nominal thrusts (N) of all rotors at their speeds; None without a
    scenario.
    """
    rotors = [rotor for vehicle in _vehicles([log]) for rotor in vehicle.rotors]
    pairs = zip(rotors, log.rotor_speeds.T, strict=False)
    forces = [
        float(rotor.thrust_coefficient) * np.asarray(push(rotor, speed))
        for rotor, speed in pairs
    ]
    return np.asarray(np.sum(forces, axis=0)) if forces else None


def _contact(logs: Logs) -> Panels:
    """Make panels of contact forces: one per pair of surface and point or of two bodies
    that touched, and per body in grasps.
    """
    pairs = dict.fromkeys(
        (array, *pair)
        for array in ("contact_force", "collision_force")
        for log in logs
        for pair, force in zip(
            contact_pairs(log, array), log.component(array).T, strict=False
        )
        if np.any(force > 0.0)
    )
    return [
        Panel(
            label=f"{surface}, {point}",
            unit="N",
            of=_pair_force(array, surface, point),
            # defaults: a closure would find the names of the last pair
            desired=lambda log, array=array, point=point: (
                desired_push(log)
                if array == "contact_force" and point in points_at_tip(log)
                else None
            ),  # type: ignore[misc]
            magnitude=True,
            span=0.1,
        )
        for array, surface, point in pairs
    ] + _grasps(logs)


def _grasps(logs: Logs) -> Panels:
    """Make a panel for each body in grasps, with the force of each vehicle on it."""
    bodies = dict.fromkeys(body for log in logs for body in grasp_pulls(log))
    return [
        Panel(
            label=f"Force on {body}", unit="N", of=_pull(body), magnitude=True, span=0.1
        )
        for body in bodies
    ]


def _pull(body: str) -> Read:
    """Make a function that computes the force (N) of a vehicle on a body that it holds
    by grasps.
    """

    def read(log: Log) -> Array | None:
        pull = grasp_pulls(log).get(body)
        return None if pull is None else np.asarray(lengths(pull))

    return read


def _pair_force(array: str, *pair: str) -> Read:
    """Make a function that reads the normal force (N) between a surface and a contact
    point, or of two bodies, from a log.
    """

    def read(log: Log) -> Array | None:
        pairs = contact_pairs(log, array)
        forces = log.component(array)
        owned = pair in pairs and (
            pair[1] not in parts_of_others(log)
            if array == "contact_force"
            else touches_own_body(log, pair)
        )
        return (
            forces[:, pairs.index(pair)]
            if owned and forces.shape[1] == len(pairs)
            else None
        )

    return read


def _attitude(logs: Logs) -> Panels:
    """Make panels of roll, pitch and yaw, deg; yaw with its reference."""
    angle = math.degrees(1.0)
    return [
        Panel(label="Roll", unit="deg", of=column("euler", 0, factor=angle), span=1.0),
        Panel(label="Pitch", unit="deg", of=column("euler", 1, factor=angle), span=1.0),
        Panel(
            label="Yaw",
            unit="deg",
            of=_yaw,
            desired=lambda log: np.degrees(log.yaw_reference),
            span=1.0,
        ),
    ]


def _yaw(log: Log) -> Array:
    """Yaw angle over time in degrees, without jumps of a full turn against its
    reference.
    """
    yaw = log.euler[:, 2]
    # as many turns as bring it nearest to its reference
    return np.degrees(yaw + math.tau * np.round((log.yaw_reference - yaw) / math.tau))


def _efforts(logs: Logs) -> Panels:
    """Make panels of the joint commands: torque or force, or the setpoint of a drive,
    with its unit.
    """
    panels = []
    for i, label, kind, joints in _joints(logs):
        # a command in newton metres and one in radians share no axis
        for setpoint in dict.fromkeys(
            names_of(log).setpoints[i] for log in logs if i < log.efforts.shape[1]
        ):
            words = f"{label} setpoint"
            unit = setpoint or ""
            limits = _finite(())
            if setpoint is None:
                words = f"{label} {'force' if kind == 'prismatic' else 'torque'}"
                unit = unit_of_kind(Unit("N m or N"), kind or "revolute")
                limits = _finite(
                    sign * joint.effort_limit
                    for joint in joints
                    for sign in (-1.0, 1.0)
                )
            elif setpoint in ("rad", "m"):
                limits = _finite(end for joint in joints for end in joint.ends)
            panels.append(
                Panel(label=words, unit=unit, of=_command(i, setpoint), limits=limits)
            )
    return panels


def _command(i: int, setpoint: str | None) -> Read:
    """Make a function that reads the command of joint ``i``; it returns None if the
    command has another unit.
    """
    efforts = column("efforts", i)
    return lambda log: (
        efforts(log)
        if i < log.efforts.shape[1] and names_of(log).setpoints[i] == setpoint
        else None
    )


def _rotors(logs: Logs) -> Panels:
    """Make a panel for each rotor's speed, with its largest one as limit."""
    # the vehicle with the most rotors has a name for every panel
    names = names_of(max(logs, key=lambda log: log.rotor_speeds.shape[1])).rotors
    turning = [vehicle.rotors for vehicle in _vehicles(logs)]
    return [
        Panel(
            label=f"Rotor {name}",
            unit="rad/s",
            of=column("rotor_speeds", i),
            limits=_finite(
                rotors[i].max_speed for rotors in turning if i < len(rotors)
            ),
            # rad/s, chosen by eye as the spans of _team
            span=5.0,
        )
        for i, name in enumerate(names)
    ]


def _parts(logs: Logs) -> Panels:
    """Make panels of all quantities logged by winds, forces, contacts, payloads and
    batteries.
    """
    every = {
        each.name: each
        for log in logs
        for each in columns(log)
        if each.array.startswith(f"{COMPONENTS}.")
    }
    return [
        Panel(label=name, unit=each.unit, of=_log_column(name))
        for name, each in every.items()
    ]


def _log_column(name: str) -> Read:
    """Make a function that reads a logged quantity of a wind, force, contact, payload
    or battery, by column name.
    """

    def read(log: Log) -> Array | None:
        each = next((each for each in columns(log) if each.name == name), None)
        if each is None:
            return None
        labels = component_labels(log, each.array.removeprefix(f"{COMPONENTS}."))
        of_other = each.index is not None and not parts_of_others(log).isdisjoint(
            labels[each.index].split("/")
        )
        return None if of_other else each.of(log)

    return read


KINDS: Mapping[str, Callable[[Logs], Panels]] = {
    "tracking": _tracking,
    "attitude": _attitude,
    "tip": _tip,
    "contact": _contact,
    "efforts": _efforts,
    "rotors": _rotors,
    "parts": _parts,
    "team": _team,
}

ALL, PATH, DEPTH = "all", "path", "depth"

MEASURED, ESTIMATED = "measured", "estimated"

RECEIVED = ("position", "quaternion", "joints", "rotor_speeds")
"""Arrays of a log that panels show and that sensors measure or an estimator
estimates."""


def measured_flights(log: Log) -> Iterator[tuple[str, Log]]:
    """Yield copies of a log with measured, then estimated, quantities in place of the
    true ones.
    """
    full = {"position": log.measured_position, "joints": log.measured_joints}
    sources = [
        *((MEASURED, each) for each in (full, *log.readings.values())),
        (ESTIMATED, log.estimate),
    ]
    for word, fields in sources:
        fitting = (
            name
            for name in RECEIVED
            if name in fields and fields[name].shape == log[name].shape
        )
        received: dict[str, Any] = {name: fields[name] for name in fitting}
        if received:
            yield word, replace(log, **received)


def panels_of(kind: str, logs: Logs, *, together: bool = False) -> Panels:
    """Make the panels of one kind of time plot, for all joints and rotors of the given
    flights.

    Args:
        kind: one of KINDS, or ALL of them but "parts"; "team" only if vehicles fly
            together.
        logs: logs of single vehicles.
        together: whether some of them fly together.

    Raises:
        ValueError: one line: no such kind, or flights that have nothing of it.
    """
    if kind not in (*KINDS, ALL):
        raise ValueError(
            f"kind = {shown(kind)}: {must_be_one_of((*KINDS, ALL, PATH, DEPTH), kind)}"
        )
    has_tip = any(not np.array_equal(log.tip, log.position) for log in logs)
    left_out = {"parts", *([] if has_tip else ["tip"]), *([] if together else ["team"])}
    kinds = [name for name in KINDS if name not in left_out] if kind == ALL else [kind]
    # the same panel may belong to two kinds, such as the tip's error
    each_once = {
        (panel.label, panel.unit): panel
        for each in kinds
        for panel in KINDS[each](logs)
    }
    panels = [*each_once.values()]
    if not panels:
        missing = {
            "efforts": "joints",
            "contact": "contact",
            "parts": "parts that log",
        }.get(kind, "rotors")
        raise ValueError(
            f"kind = {shown(kind)}: must be another one, for the flights have no"
            f" {missing}"
        )
    return panels
