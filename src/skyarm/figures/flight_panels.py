"""What a picture of flights can show: panels by kind, each with its unit, reference and limits."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.figures.contact_curves import contact_force, wanted_force
from skyarm.figures.flight_facts import FlightFacts
from skyarm.files import must_be_one_of, shown
from skyarm.log.flight_log import Log
from skyarm.log.log_columns import names_of

Array = npt.NDArray[np.float64]

AXES = "xyz"

MILLIMETRES = 1e3


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightPanel:
    """One panel.

    Attributes:
        label: words for the axis. unit: of all that it shows.
        of: log -> (N,); a log that has none of it is left out.
        desired: log -> (N,), the continuous reference, drawn dotted.
        limits: flight -> values that it must not pass, in the unit of the panel.
        magnitude: never negative, so the axis begins at zero.
        span: least extent of the axis, so that rounding noise does not fill a panel.
        touching: (surface, point) of the pairs whose touches and losses are marked below; empty for none, None for all.
    """

    label: str
    unit: str
    of: Callable[[Log], Array | None]
    desired: Callable[[Log], Array | None] | None = None
    limits: Callable[[FlightFacts], tuple[float, ...]] = lambda _facts: ()
    magnitude: bool = False
    span: float = 0.02
    touching: tuple[tuple[str, str], ...] | None = ()


def _column(name: str, i: int, scale: float = 1.0) -> Callable[[Log], Array | None]:
    """Column ``i`` of an array of the log; None of a log that has fewer."""

    def read(log: Log) -> Array | None:
        table: Array = getattr(log, name)
        return scale * table[:, i] if i < table.shape[1] else None

    return read


def _tracking(flight: FlightFacts) -> list[FlightPanel]:
    base = [
        FlightPanel(label=f"Base {axis}", unit="m", of=_column("position", i), desired=_column("position_reference", i))
        for i, axis in enumerate(AXES)
    ]
    return base + [
        FlightPanel(
            label=name,
            unit="rad" if turns else "m",
            of=_column("joints", i),
            desired=_column("joints_reference", i),
            limits=_finite("joint_limits", i),
        )
        for i, (name, turns) in enumerate(zip(flight.joints, flight.revolute, strict=True))
    ]


def _tip(_flight: FlightFacts) -> list[FlightPanel]:
    at = [
        FlightPanel(label=f"Tip {axis}", unit="m", of=_column("tip", i), desired=_column("tip_reference", i))
        for i, axis in enumerate(AXES)
    ]
    error = FlightPanel(
        label="Tip error",
        unit="mm",
        of=lambda log: MILLIMETRES * np.asarray(np.linalg.norm(log.tip - log.tip_reference, axis=1)),
        magnitude=True,
        span=1.0,
        touching=None,
    )
    return [*at, error]


def _contact(flight: FlightFacts) -> list[FlightPanel]:
    """Normal force of every pair of a surface and a point that touched in any flight."""
    return [
        FlightPanel(
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


def _attitude(_flight: FlightFacts) -> list[FlightPanel]:
    def angle(i: int) -> Callable[[Log], Array]:
        return lambda log: np.degrees(log.euler[:, i])

    return [
        FlightPanel(label="Roll", unit="deg", of=angle(0), span=1.0),
        FlightPanel(label="Pitch", unit="deg", of=angle(1), span=1.0),
        FlightPanel(label="Yaw", unit="deg", of=_yaw, desired=lambda log: np.degrees(log.yaw_reference), span=1.0),
    ]


def _yaw(log: Log) -> Array:
    """Yaw in degrees, in the turn in which its reference is: a turn that goes on has no jump at 180 degrees."""
    yaw = log.euler[:, 2]
    return np.degrees(yaw + math.tau * np.round((log.yaw_reference - yaw) / math.tau))


def _efforts(flight: FlightFacts) -> list[FlightPanel]:
    named = zip(flight.joints, flight.revolute, flight.setpoints, strict=True)
    return [_command(i, name, turns, told) for i, (name, turns, each) in enumerate(named) for told in each]


def _command(i: int, name: str, turns: bool, told: str | None) -> FlightPanel:
    """What joint ``i`` is told, of the flights in which that is a torque or a setpoint in this unit."""
    column = _column("efforts", i)

    def read(log: Log) -> Array | None:
        return column(log) if i < log.efforts.shape[1] and names_of(log).setpoints[i] == told else None

    if told is None:
        what, unit = ("torque", "N m") if turns else ("force", "N")
        return FlightPanel(label=f"{name} {what}", unit=unit, of=read, limits=_finite("effort_limits", i))
    limits = _finite("joint_limits", i) if told in ("rad", "m") else lambda _facts: ()
    return FlightPanel(label=f"{name} setpoint", unit=told, of=read, limits=limits)


def _rotors(flight: FlightFacts) -> list[FlightPanel]:
    return [
        FlightPanel(
            label=f"Rotor {name}",
            unit="rad/s",
            of=_column("rotor_speeds", i),
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


KINDS: Mapping[str, Callable[[FlightFacts], list[FlightPanel]]] = {
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


def panels_of(kind: str, flights: Sequence[FlightFacts]) -> list[FlightPanel]:
    """The panels of a kind, named after the flight with most joints and the one with most rotors.

    Raises:
        ValueError: one line: no such kind, or flights that have nothing of it.
    """
    if kind not in (*KINDS, ALL):
        raise ValueError(f"kind = {shown(kind)}: {must_be_one_of((*KINDS, ALL, PATH), kind)}")
    arm = max(flights, key=lambda flight: len(flight.joints))
    most = FlightFacts(
        joints=arm.joints,
        revolute=arm.revolute,
        setpoints=tuple(
            tuple(dict.fromkeys(unit for each in flights for units in each.setpoints[i : i + 1] for unit in units))
            for i in range(len(arm.joints))
        ),
        rotors=max((flight.rotors for flight in flights), key=len),
        tip=any(flight.tip for flight in flights),
        touching=tuple({(each.surface, each.point): each for flight in flights for each in flight.touching}.values()),
    )
    kinds = [name for name in KINDS if name != "tip" or most.tip] if kind == ALL else [kind]
    found = [panel for each in kinds for panel in KINDS[each](most)]
    if not found:
        missing = {"efforts": "joints", "contact": "contact"}.get(kind, "rotors")
        raise ValueError(f"kind = {shown(kind)}: must be another one, for the flights have no {missing}")
    return found
