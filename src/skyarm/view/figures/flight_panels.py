"""Panels of pictures of flights, by kind: each with its label, unit, curve, reference and limits."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.log.flight_log import Log
from skyarm.log.log_columns import names_of
from skyarm.records.files import must_be_one_of, shown
from skyarm.view.figures.flight_facts import FlightFacts, Touching, contact_force, wanted_force

Array = npt.NDArray[np.float64]

Read = Callable[[Log], Array | None]
"""Log -> curve (N,); None of a log that has none of it."""

AXES = "xyz"

MILLIMETRES = 1e3


@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """One panel.

    Attributes:
        label: words for the axis. unit: of all that it shows.
        of: curve. desired: its reference, drawn dotted.
        limits: flight -> values that it must not pass, in the unit of the panel.
        magnitude: never negative, so the axis begins at zero.
        span: least extent of the axis, so that rounding noise does not fill a panel.
        touching: (surface, point) of the pairs whose touches and losses are marked below; empty for none, None for all.
        letter: names the part of a figure that begins here, "" within a part.
        scale: panels with the same name share their limits, "" for its own.
    """

    label: str
    unit: str
    of: Read
    desired: Read | None = None
    limits: Callable[[FlightFacts], tuple[float, ...]] = lambda _facts: ()
    magnitude: bool = False
    span: float = 0.02
    touching: tuple[tuple[str, str], ...] | None = ()
    letter: str = ""
    scale: str = ""


def column(name: str, i: int, reference: str = "", factor: float = 1.0) -> Read:
    """Column ``i`` of an array of the log, or its difference from that of a reference."""

    def read(log: Log) -> Array | None:
        table: Array = getattr(log, name)
        if i >= table.shape[1]:
            return None
        off = getattr(log, reference)[:, i] if reference else 0.0
        return np.asarray(factor * (table[:, i] - off))

    return read


def distance(name: str, reference: str, factor: float = 1.0) -> Read:
    """Norm of an array's difference from a reference."""
    return lambda log: factor * np.asarray(np.linalg.norm(getattr(log, name) - getattr(log, reference), axis=1))


def peaks(time: Array, values: Array, every: int) -> tuple[Array, Array]:
    """Largest value of each stretch of so many samples, and when the stretches begin."""
    whole = len(values) // every * every
    return time[:whole:every], values[:whole].reshape(-1, every).max(axis=1)


def _tracking(flight: FlightFacts) -> list[Panel]:
    base = [
        Panel(label=f"Base {axis}", unit="m", of=column("position", i), desired=column("position_reference", i))
        for i, axis in enumerate(AXES)
    ]
    return base + [
        Panel(
            label=name,
            unit="rad" if turns else "m",
            of=column("joints", i),
            desired=column("joints_reference", i),
            limits=_finite("joint_limits", i),
        )
        for i, (name, turns) in enumerate(zip(flight.joints, flight.revolute, strict=True))
    ]


def _tip(_flight: FlightFacts) -> list[Panel]:
    at = [
        Panel(label=f"Tip {axis}", unit="m", of=column("tip", i), desired=column("tip_reference", i))
        for i, axis in enumerate(AXES)
    ]
    error = distance("tip", "tip_reference", MILLIMETRES)
    return [*at, Panel(label="Tip error", unit="mm", of=error, magnitude=True, span=1.0, touching=None)]


def _contact(flight: FlightFacts) -> list[Panel]:
    """Normal force of every pair of a surface and a point that touched in any flight."""
    return [
        Panel(
            label=f"{each.surface}, {each.point}",
            unit="N",
            of=contact_force(each.surface, each.point),
            desired=wanted_force(each.point),
            magnitude=True,
            span=0.1,
            touching=((each.surface, each.point),),
        )
        for each in flight.touching
    ]


def _attitude(_flight: FlightFacts) -> list[Panel]:
    angle, yaw = math.degrees(1.0), Panel(label="Yaw", unit="deg", of=_yaw, span=1.0)
    return [
        Panel(label="Roll", unit="deg", of=column("euler", 0, factor=angle), span=1.0),
        Panel(label="Pitch", unit="deg", of=column("euler", 1, factor=angle), span=1.0),
        replace(yaw, desired=lambda log: np.degrees(log.yaw_reference)),
    ]


def _yaw(log: Log) -> Array:
    """Yaw in degrees, unwrapped to the turn of its reference: no jump at 180 degrees."""
    yaw = log.euler[:, 2]
    return np.degrees(yaw + math.tau * np.round((log.yaw_reference - yaw) / math.tau))


def _efforts(flight: FlightFacts) -> list[Panel]:
    named = zip(flight.joints, flight.revolute, flight.setpoints, strict=True)
    return [_command(i, name, turns, unit) for i, (name, turns, each) in enumerate(named) for unit in each]


def _command(i: int, name: str, turns: bool, setpoint: str | None) -> Panel:
    """Command of joint ``i``, of the flights in which that is a torque or a setpoint in this unit."""
    efforts = column("efforts", i)

    def read(log: Log) -> Array | None:
        return efforts(log) if i < log.efforts.shape[1] and names_of(log).setpoints[i] == setpoint else None

    if setpoint is None:
        word, unit = ("torque", "N m") if turns else ("force", "N")
        return Panel(label=f"{name} {word}", unit=unit, of=read, limits=_finite("effort_limits", i))
    limits = _finite("joint_limits", i) if setpoint in ("rad", "m") else lambda _facts: ()
    return Panel(label=f"{name} setpoint", unit=setpoint, of=read, limits=limits)


def _rotors(flight: FlightFacts) -> list[Panel]:
    return [
        Panel(
            label=f"Rotor {name}",
            unit="rad/s",
            of=column("rotor_speeds", i),
            limits=_finite("rotor_limits", i),
            span=5.0,
        )
        for i, name in enumerate(flight.rotors)
    ]


def _finite(field: str, i: int) -> Callable[[FlightFacts], tuple[float, ...]]:
    """Limits of joint or rotor ``i`` that are numbers."""

    def read(flight: FlightFacts) -> tuple[float, ...]:
        table: Sequence[tuple[float, ...]] = getattr(flight, field)
        return tuple(limit for limit in table[i] if math.isfinite(limit)) if i < len(table) else ()

    return read


KINDS: Mapping[str, Callable[[FlightFacts], list[Panel]]] = {
    "tracking": _tracking,
    "attitude": _attitude,
    "tip": _tip,
    "contact": _contact,
    "efforts": _efforts,
    "rotors": _rotors,
}

ALL, PATH = "all", "path"

MEASURED, ESTIMATED = "measured", "estimated"

RECEIVED = ("position", "quaternion", "joints", "rotor_speeds")
"""Arrays of a log that panels show and that sensors read or an estimator estimates."""


def measured_flights(log: Log) -> Iterator[tuple[str, Log]]:
    """The flight as each sensor measured it and as it was estimated; other quantities are the truth."""
    full = {"position": log.measured_position, "joints": log.measured_joints}
    sources = [*((MEASURED, each) for each in (full, *log.readings.values())), (ESTIMATED, log.estimate)]
    for word, fields in sources:
        fitting = (name for name in RECEIVED if name in fields and fields[name].shape == log[name].shape)
        shown: dict[str, Any] = {name: fields[name] for name in fitting}
        if shown:
            yield word, replace(log, **shown)


def panels_of(kind: str, flights: Sequence[FlightFacts]) -> list[Panel]:
    """The panels of a kind, named after the flight with most joints and the one with most rotors.

    Raises:
        ValueError: one line: no such kind, or flights that have nothing of it.
    """
    if kind not in (*KINDS, ALL):
        raise ValueError(f"kind = {shown(kind)}: {must_be_one_of((*KINDS, ALL, PATH), kind)}")
    arm = max(flights, key=lambda flight: len(flight.joints))
    touching: dict[tuple[str, str], Touching] = {}
    for each in (each for flight in flights for each in flight.touching):
        touching[each.surface, each.point] = each
    most = FlightFacts(
        joints=arm.joints,
        revolute=arm.revolute,
        setpoints=tuple(
            tuple(dict.fromkeys(unit for each in flights for units in each.setpoints[i : i + 1] for unit in units))
            for i in range(len(arm.joints))
        ),
        rotors=max((flight.rotors for flight in flights), key=len),
        tip=any(flight.tip for flight in flights),
        touching=tuple(touching.values()),
    )
    kinds = [name for name in KINDS if name != "tip" or most.tip] if kind == ALL else [kind]
    found = [panel for each in kinds for panel in KINDS[each](most)]
    if not found:
        missing = {"efforts": "joints", "contact": "contact"}.get(kind, "rotors")
        raise ValueError(f"kind = {shown(kind)}: must be another one, for the flights have no {missing}")
    return found
