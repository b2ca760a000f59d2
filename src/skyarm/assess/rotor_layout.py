"""Whether the rotors turn the right way and their coefficients fit their size."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from skyarm.actuation import AllocationError, make_mixer
from skyarm.assess.finding import FAULT, OK, WARNING, Finding
from skyarm.assess.level_hover import Allocation, hover_efforts
from skyarm.assess.mass_balance import crowded, disc_radius
from skyarm.vehicle.vehicle_records import Rotor, Vehicle

AIR = 1.225
"""kg/m^3, ISA at sea level."""

THRUST_COEFFICIENTS = 0.003, 2.0
"""C_T on the largest disc that fits, thrust / (rho n^2 D^4): propellers have 0.05 to 0.15 on their own, and smaller
discs than fit have less."""

MOMENT_ARMS = 0.01, 0.6
"""Drag torque over thrust, in disc radii: propellers have 0.1 to 0.3."""

UNEVEN = 0.2
"""Spread of the rotors' hover thrusts over their mean from which a flipped rotor is looked for."""

EVENER = 0.25
"""Share of the spread that is left where turning one rotor round explains it."""


def rotor_layout(vehicle: Vehicle, gravity: float) -> list[Finding]:
    """Rank of the allocation, senses of rotation, thrust and moment coefficients."""
    found = [*_axes(vehicle), *_places(vehicle), *_coefficients(vehicle)]
    try:
        make_mixer(vehicle)
    except AllocationError as error:
        remedy = "rotors must give torque about x, y, z and thrust: check positions, axes, directions"
        text = str(error).partition(": ")[2]
        found.append(Finding(question="rotors", level=FAULT, text=text, field="rotors", remedy=remedy))
    found.append(_directions(vehicle, gravity))
    return found


def _axes(vehicle: Vehicle) -> list[Finding]:
    """Rotors whose thrust pulls down: the laws turn every rotor one way, and want its thrust up."""
    found = []
    for rotor in vehicle.rotors:
        up, name = float(rotor.axis.z), f"rotors[{rotor.name}].axis"
        if up < 0.0:
            text = f"the thrust of {rotor.name} points down (z of its axis: {up:.3g})"
            remedy = f"turn {name} round: it is that of positive thrust"
            found.append(
                Finding(
                    question="axes of the rotors",
                    level=FAULT,
                    text=text,
                    field=name,
                    value=up,
                    limit=0.0,
                    remedy=remedy,
                )
            )
    return found


def _places(vehicle: Vehicle) -> list[Finding]:
    """Two rotors that stand in each other's disc while the others keep their distance."""
    pair = crowded(vehicle)
    if pair is None:
        return []
    a, b = (vehicle.rotors[i] for i in pair)
    apart, usual = (
        math.hypot(*(float(p - q) for p, q in zip(a.position, b.position, strict=True))),
        disc_radius(vehicle),
    )
    field = f"rotors[{a.name}].position, rotors[{b.name}].position"
    return [
        Finding(
            question="places of the rotors",
            level=FAULT,
            text=f"{a.name} and {b.name} are {1e3 * apart:.3g} mm apart, all others {2e3 * usual:.3g} mm or more",
            field=field,
            value=apart,
            limit=2.0 * usual,
            unit="m",
            remedy=f"check {field}: one stands where the other is",
        )
    ]


def _coefficients(vehicle: Vehicle) -> list[Finding]:
    radius = disc_radius(vehicle)
    found = []
    for field, values, allowed in (
        ("thrust_coefficient", [thrust_number(rotor, radius) for rotor in vehicle.rotors], THRUST_COEFFICIENTS),
        ("moment_coefficient", [float(r.moment_coefficient) / radius for r in vehicle.rotors], MOMENT_ARMS),
    ):
        at = max(
            range(len(values)), key=lambda i: abs(math.log(max(values[i], 1e-300) / math.sqrt(math.prod(allowed))))
        )
        value = values[at]
        level = OK if allowed[0] <= value <= allowed[1] else WARNING if value < allowed[0] and value > 0 else FAULT
        level = FAULT if field == "thrust_coefficient" and level != OK else level
        name = f"rotors[{vehicle.rotors[at].name}].{field}"
        what = "C_T on the largest disc that fits" if field == "thrust_coefficient" else "torque over thrust, in radii"
        table = f"rotors[{vehicle.rotors[at].name}].thrust_table"
        unit = "N s^2/rad^2, not N per (rev/min)^2?" if field == "thrust_coefficient" else "m; torque over thrust"
        remedy = f"check {name} ({unit}) and rotors.position"
        if vehicle.rotors[at].table is not None:
            remedy = f"check {table} (N, not g; N m; rad/s, not rev/min) and rotors.position"
        found.append(
            Finding(
                question=field.replace("_", " "),
                level=level,
                text=f"{what}: {value:.3g} ({float(getattr(vehicle.rotors[at], field)):g} in {name})",
                field=name if vehicle.rotors[at].table is None else table,
                value=value,
                limit=allowed[0] if value < allowed[0] else allowed[1],
                remedy="" if level == OK else remedy,
            )
        )
    return found


def thrust_number(rotor: Rotor, radius: float) -> float:
    """C_T = thrust / (rho n^2 D^4), n in turns a second, of a rotor on a disc of this radius."""
    turns = 4.0 * math.pi**2
    return float(rotor.thrust_coefficient) * turns / (AIR * (2.0 * radius) ** 4)


def _directions(vehicle: Vehicle, gravity: float) -> Finding:
    """Whether the hover would be more even with one rotor turning the other way."""
    own = _spread(vehicle, gravity)
    question = "senses of rotation"
    tried = []
    if not own < UNEVEN:
        tried = [(_spread(_flipped(vehicle, i), gravity), rotor.name) for i, rotor in enumerate(vehicle.rotors)]
    best = min(tried, default=(math.inf, ""))
    if best[0] < EVENER * own or (math.isinf(own) and best[0] < UNEVEN):
        # those that explain it as well are as likely
        names = [name for spread, name in tried if spread <= best[0] + 0.01]
        fields = ", ".join(f"rotors[{name}].direction" for name in names)
        return Finding(
            question=question,
            level=FAULT,
            text=f"hover is uneven (spread {own:.2g} of the mean) and would be even with another sense of one rotor",
            field=fields,
            value=own,
            limit=UNEVEN,
            remedy=f"turn round one of {fields}" if len(names) > 1 else f"turn round {fields}",
        )
    turning = sum(rotor.direction for rotor in vehicle.rotors)
    uneven = abs(turning) > 1
    text = f"rotors share hover evenly (spread {own:.2g} of the mean)" if own < UNEVEN else f"spread of hover {own:.2g}"
    return Finding(
        question=question,
        level=WARNING if uneven else OK,
        text=text + (f"; {abs(turning)} more turn one way than the other" if uneven else ""),
        field="rotors.direction",
        value=own,
        limit=UNEVEN,
        remedy="check rotors.direction" if uneven else "",
    )


def _flipped(vehicle: Vehicle, at: int) -> Vehicle:
    rotors = list(vehicle.rotors)
    rotors[at] = dataclasses.replace(rotors[at], direction=-rotors[at].direction)
    return dataclasses.replace(vehicle, rotors=tuple(rotors))


def _spread(vehicle: Vehicle, gravity: float) -> float:
    """Standard deviation of the rotors' hover thrusts over their mean, centre of mass and arm aside."""
    try:
        allocation = Allocation.of(make_mixer(vehicle))
    except AllocationError:
        return math.inf
    efforts = hover_efforts(vehicle, gravity, np.zeros((1, vehicle.n)))
    efforts[:3] = 0.0
    thrusts = allocation.squared(efforts)[:, 0] * [float(rotor.thrust_coefficient) for rotor in vehicle.rotors]
    return float(np.std(thrusts) / abs(np.mean(thrusts)))
