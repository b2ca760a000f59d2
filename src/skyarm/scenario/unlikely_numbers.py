"""Warnings about suspicious values: allowed numbers of a vehicle or scenario that are
probably in other units.

They cause warnings, never errors. A field declares its usual size
(:class:`skyarm.records.units.Unit`): tens of times what flying robots have, and less
than the factors between units. What depends on several numbers is looked at here.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from skyarm.algebra import E_Z, axis_rotation
from skyarm.control.catalogue import BEARS_UNDRIVEN
from skyarm.dynamics.actuators.hover import highest_thrust
from skyarm.dynamics.kinematics import frame_pose
from skyarm.records.files.user_code import require_result
from skyarm.records.leaves import named_leaves, parts
from skyarm.records.registry.shipped import SHIPPED
from skyarm.records.units import units
from skyarm.scenario.readers import feasibility_of
from skyarm.scenario.scenario_record import Scenario, first_state
from skyarm.scenario.without_effect import without_effect
from skyarm.vehicle import Body, Vehicle
from skyarm.vehicle.check import TURN
from skyarm.vehicle.vehicle_records import undriven_joints
from skyarm.world import HangingPayload

OTHER = {
    "m": "mm",
    "rad": "degrees",
    "s": "ms",
    "kg": "g",
    "N": "mN",
    "N m": "N mm",
    "m/s": "km/h",
    "rad/s": "degrees/s",
    "kg m^2": "kg cm^2 or g mm^2",
    "A h": "mA h",
    "ohm": "mohm",
    "A": "mA",
    "V": "mV",
}
"""Unit -> unit in which a suspiciously large number probably is."""

MARGINS = 0.05, 20.0
"""Usual range of the largest thrust over the weight; racing drones reach 15."""

EARTH = 9.81
"""Standard gravity (m/s^2), rounded."""

HEAVIEST = 300.0
"""Largest plausible mass (kg); a quadrotor of 0.7 kg written in grams exceeds it."""

GYRATION = 3.0
"""Largest plausible radius of gyration over the vehicle's extent; below 1 for a body
within it, 100 times more in kg cm^2."""

COMPACT = 0.02
"""Smallest plausible radius of gyration of a base over the distance of its furthest
rotor; shipped vehicles: 0.37 to 0.6."""

SMALLEST = 0.05
"""Smallest extent (m) assumed for a vehicle, so that a body without a described size is
not suspected."""

SPREAD = 1000.0
"""Largest plausible distance (m) of a reference."""

PHASE = 25.0
"""Largest plausible phase (rad) of a sine: four turns."""

LOADED = 10.0
"""Largest plausible ratio of the masses of plant and model."""

LOOKS = 200
"""Number of instants at which a reference is evaluated."""


def unlikely_numbers(scenario: Scenario) -> tuple[str, ...]:
    """Warnings about suspicious but allowed values of a scenario; empty if there are
    none.
    """
    # lines of the only vehicle have no name before them
    if scenario.is_team:
        return tuple(
            f"{name}: {line}"
            for name in scenario.agents
            for line in unlikely_numbers(scenario.of(name))
        )
    vehicle = (
        f"plant: {line}" for line in unlikely_in_vehicle(scenario.agent.plant.vehicle)
    )
    lines = (
        *unlikely_units(scenario),
        *plan_warnings(scenario),
        *law_warnings(scenario),
        *part_warnings(scenario),
    )
    return (*vehicle, *lines)


def part_warnings(scenario: Scenario) -> tuple[str, ...]:
    """Warnings from a scenario's environment models, about its loads and about models
    that cannot affect its flight.
    """
    vehicle, step = scenario.agent.plant.vehicle, 1.0 / scenario.rates.physics
    lines = list[str]()
    for where, part in scenario.placed_components:
        texts = part.warnings(vehicle, step)
        listed = isinstance(texts, Iterable) and not isinstance(texts, str)
        require_result(part.warnings, texts, listed, "a list of texts")
        lines += [f"{where}: {line}" for line in texts]
    return (*lines, *load_warnings(scenario), *without_effect(scenario))


def load_warnings(scenario: Scenario) -> Iterator[str]:
    """Warnings about loads on cords that would reach below the ground or a surface
    along the reference, when level.
    """
    vehicle = scenario.agent.plant.vehicle
    times = np.linspace(0.0, scenario.duration, LOOKS + 1)
    loads = (
        (i, each)
        for i, each in enumerate(scenario.agent.payloads)
        if isinstance(each, HangingPayload)
    )
    for i, payload in loads:
        looks = scenario.agent.reference.at(times)
        frame = vehicle.frame(payload.frame or None)
        top = looks.position + axis_rotation(E_Z, looks.yaw).apply(
            frame_pose(vehicle, frame, looks.joints).p
        )
        held = (times >= float(payload.pick)) & (times < float(payload.drop))
        for solid in scenario.environment.solids:
            below = top.z - float(payload.hangs)
            depths = np.asarray(payload.let_down(top, (solid,)).z - below)
            deepest = float(np.max(np.where(held, depths, 0.0)))
            if deepest > 0.0:
                yield (
                    f"payloads[{i}].cord: lets the load hang {deepest:.3g} m below"
                    f" surface {solid.name!r} along the reference; a shorter cord, or a"
                    " higher reference?"
                )


def unlikely_units(scenario: Scenario) -> tuple[str, ...]:
    """Warnings about scenario values that are probably in wrong units, without values
    of the plant's vehicle.
    """
    records = {
        "plant": scenario.agent.plant,
        "model": scenario.agent.controller.par.model,
        "world": scenario.world,
        **dict(scenario.environment.placed_models),
        "payloads": scenario.agent.payloads,
        "sensors": scenario.agent.noise,
        "delays": scenario.agent.delays,
        "initial": scenario.agent.initial,
        "estimator": scenario.agent.estimator,
        **{f"sensors.{each.name}": each.sensor for each in scenario.agent.sensors},
    }
    declared = (
        line for where, record in records.items() for line in _unusual(record, where)
    )
    return (*_model(scenario), *declared, *_reference(scenario))


def plan_warnings(scenario: Scenario) -> tuple[str, ...]:
    """Warnings about limits of the vehicle that the tip's reference exceeds."""
    feasibility = feasibility_of(scenario)
    return tuple(feasibility.warnings()) if feasibility is not None else ()


def unlikely_in_vehicle(vehicle: Vehicle) -> tuple[str, ...]:
    """Warnings about vehicle numbers that are probably in other units."""
    heavy = _too_large("mass =", float(vehicle.mass), HEAVIEST, "kg")
    declared = (
        line
        for where, record in parts(vehicle).items()
        for line in _unusual(record, where)
    )
    return (*heavy, *declared, *_inertias(vehicle), *_rotors(vehicle))


def _unusual(record: object, where: str) -> Iterator[str]:
    """Warnings about values beyond the usual range that their dataclass fields declare,
    one for each field.
    """
    by_field: dict[tuple[type, str], list[str]] = {}
    for key, line in _unusual_fields(record, where):
        by_field.setdefault(key, []).append(line)
    for lines in by_field.values():
        more = f" (and {len(lines) - 1} more)" if len(lines) > 1 else ""
        yield f"{lines[0]}{more}"


def _unusual_fields(
    record: object, where: str
) -> Iterator[tuple[tuple[type, str], str]]:
    said = units(type(record))
    kind = getattr(record, "kind", "")
    for name, value in parts(record).items():
        at = (
            f"{where}[{getattr(value, 'name', name)}]"
            if isinstance(record, tuple)
            else f"{where}.{name}"
        )
        if name not in said:
            # a vehicle has lines of its own
            if not isinstance(value, Vehicle):
                yield from _unusual_fields(value, at)
            continue
        unit, usual = said[name].unit, said[name].usual
        slides = kind == "prismatic"
        most = usual[slides] if isinstance(usual, tuple) else usual
        if kind in ("revolute", "prismatic") and " or " in unit:
            unit = unit.split(" or ")[slides]
        if unit == "rad" and most == math.inf:
            # no angle of a mount or a body is more than a turn
            most = TURN[0]
        if most != math.inf:
            for line in _too_large(f"{at} =", _size(value), most, unit):
                yield (type(record), name), line


def _too_large(
    before: str, size: float, most: float, unit: str, behind: str = ""
) -> Iterator[str]:
    """Warning about a finite number that is larger than usual."""
    if most < abs(size) < math.inf:
        other = f", not {OTHER[unit]}" if unit in OTHER else ""
        yield f"{before} {size:g} {unit}{behind}: is more than {most:g}; {unit}{other}?"


def _size(value: Any) -> float:
    """Absolute value of a number, length of a vector, or largest entry of a list; 0 of
    a signal or None.
    """
    if value is None or (parts(value) and not isinstance(value, Iterable)):
        return 0.0
    if isinstance(value, tuple):
        return max(map(abs, map(float, value)), default=0.0)
    return _norm(value) if parts(value) else float(value)


def _reference(scenario: Scenario) -> Iterator[str]:
    links = scenario.agent.plant.vehicle.links
    # a start at the reference has its joints, which are looked at already
    start = scenario.agent.initial and first_state(scenario)
    times = np.linspace(0.0, scenario.duration, LOOKS + 1)
    looks = scenario.agent.reference.at(times)
    farthest = float(np.max(np.sqrt(sum(np.square(c) for c in looks.position))))
    yield from _too_large(
        "reference.base reaches", farthest, SPREAD, "m", " from the origin"
    )
    yield from _too_large(
        "reference.yaw =",
        float(np.asarray(looks.yaw).flat[0]),
        TURN[0],
        "rad",
        " at the start",
    )
    for where, value in named_leaves(scenario.agent.reference, "reference"):
        if where.endswith(".phase"):
            yield from _too_large(f"{where} =", float(value), PHASE, "rad")
    for i, link in enumerate(links):
        slides = not link.joint.turns
        values = {
            f"reference.joints[{i}] reaches": max(
                np.asarray(looks.joints[i]).flat, key=abs
            )
        }
        if start is not None:
            values[f"initial.joints[{i}] ="] = float(start.joints[i])
        for before, value in values.items():
            yield from _too_large(before, value, TURN[slides], ("rad", "m")[slides])


def _model(scenario: Scenario) -> Iterator[str]:
    truth = scenario.agent.plant.vehicle
    model = scenario.agent.controller.par.model.vehicle
    if model != truth:
        truth_lines = set(unlikely_in_vehicle(truth))
        yield from (
            f"model: {line}"
            for line in unlikely_in_vehicle(model)
            if line not in truth_lines
        )
    ours, theirs = float(truth.mass), float(model.mass)
    # "not", so that NaN is warned of, too
    if not ours < LOADED * theirs or not theirs < LOADED * ours:
        yield (
            f"plant.vehicle of {ours:g} kg, model.vehicle of {theirs:g} kg: differ; kg,"
            " not g (payload)?"
        )


def _inertias(vehicle: Vehicle) -> Iterator[str]:
    """Warnings about inertias too large, or of a base too small, for the vehicle's
    dimensions.
    """
    placed = [each.position for each in vehicle.rotors] + [
        each.position for each in vehicle.frames
    ]
    placed += [link.joint.position for link in vehicle.moving] + [
        body.com for body in vehicle.bodies
    ]
    extent = max(SMALLEST, *map(_norm, placed))
    # a stretched arm reaches as far as its joints' offsets together
    extent = max(extent, sum(_norm(link.joint.position) for link in vehicle.links))
    arm = max((_norm(each.position) for each in vehicle.rotors), default=0.0)
    least = vehicle.base.inertia
    moment = min(float(least.xx), float(least.yy), float(least.zz))
    small = _gyration(vehicle.base, moment) < COMPACT * min(arm, 1.0)
    if float(vehicle.base.mass) > 0.0 and small:
        yield (
            f"base.inertia: has {moment:g} kg m^2 about an axis, and rotors {arm:.3g} m"
            " away; kg m^2?"
        )
    for name, body in (
        ("base", vehicle.base),
        *((f"links[{link.name}]", link.body) for link in vehicle.links),
    ):
        moment = max(
            float(body.inertia.xx), float(body.inertia.yy), float(body.inertia.zz)
        )
        radius = _gyration(body, moment)
        if math.isinf(radius):
            yield (
                f"{name}.mass = 0 kg: has an inertia of {moment:g} kg m^2 without a"
                " mass; kg?"
            )
        elif radius > GYRATION * extent:
            yield (
                f"{name}.inertia = {moment:g} kg m^2: is that of its"
                f" {float(body.mass):g} kg {radius:.3g} m away, and the vehicle reaches"
                f" {extent:.3g} m; kg m^2, not kg cm^2 or g mm^2?"
            )


def _gyration(body: Body, moment: float) -> float:
    """Radius of gyration (m) of a body, from its mass and moment of inertia."""
    mass = float(body.mass)
    if mass > 0.0:
        return math.sqrt(max(moment, 0.0) / mass)
    return math.inf if moment > 0.0 else 0.0


SPINNING = 0.1
"""Largest plausible share of what the rotors turn in the base's inertia about their
axes; multirotors: below 0.02."""


def _rotors(vehicle: Vehicle) -> Iterator[str]:
    """Warnings about spin inertias, and about a total thrust at full speed that is far
    from the vehicle's weight.
    """
    spins = [(float(each.inertia), each) for each in vehicle.rotors]
    # one line, on the largest of them, tells of all
    for most, rotor in sorted(spins, key=lambda spin: -spin[0])[:1]:
        whole = float(rotor.axis.dot(vehicle.base.inertia.apply(rotor.axis)))
        # beyond, its size tells of it
        if most <= 1.0 and sum(spin for spin, _ in spins) > SPINNING * whole:
            yield (
                f"rotors[{rotor.name}].inertia = {most:g} kg m^2: with {len(spins)}"
                f" rotors is more than {SPINNING:.0%} "
                f"of the base's {whole:.3g}, as a link that only stands in for a"
                " propeller has; motor and propeller "
                f'alone, or none: [[rotors]] name = "{rotor.name}", inertia = 0, and so'
                " for each?"
            )
    weight = float(vehicle.mass) * EARTH
    # without rotors there is nothing to compare: NaN is within no bounds below
    top = float(highest_thrust(vehicle)) if vehicle.rotors else math.nan
    if not 0.0 <= top < math.inf or MARGINS[0] * weight <= top <= MARGINS[1] * weight:
        return
    if top < weight and any(
        float(rotor.axis.z) < 0.0 for rotor in vehicle.rotors if not rotor.reversible
    ):
        yield (
            f"rotors.axis: thrusts that point down leave {top / weight:.3g} times the"
            " weight; upwards?"
        )
        return
    table = next(
        (
            f"rotors[{rotor.name}].thrust_table"
            for rotor in vehicle.rotors
            if rotor.table is not None
        ),
        "",
    )
    fastest = max(float(rotor.max_speed) for rotor in vehicle.rotors)
    speeds = table or f"rotors: max_speed = {fastest:g} rad/s"
    hint = (
        "rad/s, not rev/min? N, not g?"
        if table
        else "rad/s, not rev/min? N s^2/rad^2 of thrust? kg, not g?"
    )
    # a vehicle of no weight is told of by its own line, not by a division by 0
    yield f"{speeds}: lifts {top / max(weight, 1e-300):.3g} times the weight; {hint}"


def _norm(vector: Iterable[float]) -> float:
    return math.hypot(*(float(c) for c in vector))


def law_warnings(scenario: Scenario) -> Iterator[str]:
    """Warning if a shipped control law commands torques at passive joints of the plant.

    Such a law takes the reaction of those torques into the base's: a slung load falls
    within seconds.
    """
    free = undriven_joints(
        scenario.agent.plant.vehicle,
        [each.joint for each in scenario.agent.joint_drives],
    )
    # a law in a safety layer counts as the law, and so does each variant of the
    # centroidal one
    name = scenario.agent.controller.name.removeprefix("guarded_")
    law = "centroidal" if name.startswith("centroidal_") else name
    if free and law in SHIPPED["law"] and law not in BEARS_UNDRIVEN:
        joints = f"joint{'s' if len(free) > 1 else ''} {', '.join(free)}"
        others = f"{', '.join(BEARS_UNDRIVEN[:-1])} or {BEARS_UNDRIVEN[-1]}"
        yield (
            f"controller.law = {law!r}: counts on the torque of {joints}, which no"
            f" drive gives (effort_limit 0); {others}, which leave passive joints"
            " alone?"
        )
