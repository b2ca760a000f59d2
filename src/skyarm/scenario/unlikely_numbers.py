"""Suspicious values: numbers of a vehicle or a scenario that are allowed and probably in other units.

They cause warnings, never errors. The bounds are generous: tens of times what flying robots have, and less than the
factors between units (57.3 degrees a radian, 9.55 rev/min a rad/s, 1000 grams a kilogram, 1000 millimetres a metre,
10 000 kg cm^2 a kg m^2).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any

from skyarm.control.catalogue import BEARS_UNDRIVEN
from skyarm.control.vectored_layer import pairs_model, turns_rotors
from skyarm.dynamics.actuators import AllocationError, make_mixer
from skyarm.dynamics.actuators.hover import highest_thrust
from skyarm.dynamics.actuators.servo import Servo
from skyarm.records.registry.shipped import SHIPPED
from skyarm.scenario.scenario_record import Scenario
from skyarm.scenario.scenario_tables import feasibility_of
from skyarm.vehicle.battery import Battery
from skyarm.vehicle.linkage import BASE, Body
from skyarm.vehicle.undriven import undriven_joints
from skyarm.vehicle.vehicle_records import Rotor, Vehicle
from skyarm.world import ForceWind, MovingAir
from skyarm.world.wind import all_gusts

TURN = 2.0 * math.pi * 1.001
"""rad: a turn, as files round it."""

FARTHEST = 10.0
"""m from one part to the next: an arm of 15 mm written in millimetres is longer."""

MARGINS = 0.05, 20.0
"""Highest thrust over weight: racing drones reach 15, and less than a twentieth is no vehicle that flies."""

EARTH = 9.81
"""m/s^2."""

OF_ROTORS = {
    # time constants are some hundredths of a second, drag torque over thrust a tenth of the rotor's radius
    "time_constant_up": (1.0, "s: is slow", "s, not ms?"),
    "time_constant_down": (1.0, "s: is slow", "s, not ms?"),
    "moment_coefficient": (0.5, "m: is drag torque over thrust, some centimetres", "m, not mm?"),
}
"""Number of a rotor -> largest, and words."""

GYRATION = 3.0
"""Radius of gyration over the vehicle's extent: a body within it has less than 1; in kg cm^2 it has 100 times more."""

OUTSIDE = 3.0
"""Distance of the base's centre of mass over that of its rotors: within an airframe it is less than 1."""

SMALLEST = 0.05
"""m: least extent that is taken for a vehicle's, so that a body without a described size is not suspected."""

FASTEST = {"revolute": 500.0, "prismatic": 50.0}
"""rad/s or m/s of a joint without load: servos turn at 2 to 15 rad/s, motors without a gear at some hundred."""

SLOWEST_GOAL = {"revolute": 0.05, "prismatic": 5e-4}
"""rad/s or m/s: slower ones take a minute for half a turn, or for 30 mm."""

FASTER = 2.0
"""Speed limit over the speed of the motor without load, which it cannot reach."""

MAINS = 1000.0
"""V: a supply of 12 V in millivolts has more."""

SHARE_OF_BASE = 0.5
"""Of the base's largest moment of inertia, of which that of a rotor is a part: propellers have a thousandth."""

DENSEST = 500.0
"""W h for each kg of the vehicle: lithium cells hold 100 to 270, and are a third of a vehicle at most."""

NOMINAL = 3.7
"""V of a lithium cell."""

FEWEST_C = 2.0
"""Current of a short circuit over the capacity, 1/h: packs for flight have some hundred."""

CELL_VOLTAGE = 0.5, 1.5
"""Reference voltage of a cell over its empty and its full open-circuit voltage."""

WORST = 20.0
"""Electrical power over the power of the drag torque: motors have 1.2 to 3."""

NOISE = {
    "position": (1.0, "m", "mm"),
    "velocity": (5.0, "m/s", "mm/s"),
    "attitude": (0.5, "rad", "degrees"),
    "rate": (5.0, "rad/s", "degrees/s"),
    "specific_force": (50.0, "m/s^2", "milli-g"),
    "joints": (0.5, "rad or m", "degrees or mm"),
    "joint_rates": (5.0, "rad/s or m/s", "degrees/s or mm/s"),
    "rotor_speeds": (200.0, "rad/s", "rev/min"),
}
"""Sigma from which a sensor tells nothing, its unit, and what the number is perhaps in."""

MOST_WIND = 20.0
"""Force of the wind over the vehicle's weight."""

SPREAD = 1000.0
"""m: of a reference."""

LOADED = 10.0
"""Mass of the plant over that of the model, or the other way."""

SLACK = 1e-6
"""rad or m past a joint's limit that rounding leaves."""

LOOKS = 200
"""Instants at which a reference is looked at."""

Suspicion = tuple[str, Any, float, str]
"""Words before a number, the number or vector, its largest likely size, and words behind it."""


def _beyond(rows: Iterable[Suspicion]) -> Iterator[str]:
    """Lines about the finite numbers that are larger than is likely."""
    for before, value, most, behind in rows:
        size = float(value) if isinstance(value, (int, float)) else _norm(value)
        if most < abs(size) < math.inf:
            yield f"{before} {size:g} {behind}"


def _of_joint(name: str, value: Any, kind: str) -> Suspicion:
    """Suspicion of a joint's position."""
    if kind == "revolute":
        return name, value, TURN, "rad: is more than a turn; rad, not degrees?"
    return name, value, FARTHEST, "m: is far; m, not mm?"


def unlikely_numbers(scenario: Scenario) -> tuple[str, ...]:
    """Warnings about suspicious values of a scenario, which are allowed; empty if there are none."""
    vehicle = (f"plant: {line}" for line in unlikely_in_vehicle(scenario.plant.vehicle))
    return (*vehicle, *unlikely_units(scenario), *plan_warnings(scenario), *law_warnings(scenario))


def unlikely_units(scenario: Scenario) -> tuple[str, ...]:
    """Lines about numbers that are probably in other units, without those of the plant's vehicle."""
    return (
        *_model(scenario),
        *_beyond(_of_scenario(scenario)),
        *_wind_force(scenario),
        *_without_drag(scenario),
        *_start_beyond_limits(scenario),
    )


def plan_warnings(scenario: Scenario) -> tuple[str, ...]:
    """Lines about limits that the plan of a tip's reference does not keep."""
    found = feasibility_of(scenario)
    return tuple(found.warnings()) if found is not None else ()


def law_warnings(scenario: Scenario) -> tuple[str, ...]:
    """Lines about a law that the vehicle's joints or rotors do not suit."""
    return (*law_of_undriven(scenario), *law_without_priorities(scenario))


def unlikely_in_vehicle(vehicle: Vehicle) -> tuple[str, ...]:
    """Lines about numbers that are probably in other units; empty for a vehicle without any."""
    kinds = {link.joint.name: link.joint.kind for link in vehicle.links}
    servos = [(each.name, each.drive) for each in vehicle.drives if isinstance(each.drive, Servo)]
    return (
        *_beyond(_of_vehicle(vehicle)),
        *_inertias(vehicle),
        *(line for name, servo in servos for line in _servo(f"drives.{name}", servo, kinds[name])),
        *_rotors(vehicle),
        *unlikely_in_supply(vehicle),
    )


def _of_scenario(scenario: Scenario) -> Iterator[Suspicion]:
    links, wind, start = scenario.plant.vehicle.links, scenario.wind, scenario.initial
    for name, gravity in (("plant", scenario.plant.gravity), ("model", scenario.controller.par.model.gravity)):
        yield f"{name}.gravity =", gravity, 25.0, "m/s^2: is more than Jupiter's; m/s^2?"
    if isinstance(wind, MovingAir):
        speeds = [("velocity", wind.velocity_W), *(("gust.velocity", gust.peak) for gust in all_gusts(wind))]
    else:
        speeds = [("air_velocity", wind.air_velocity_W)]
    for name, velocity in speeds:  # a hurricane of category 4
        yield f"environment.wind.{name} of", velocity, 60.0, "m/s: is a hurricane; m/s, not km/h?"
    for name, (bound, unit, other) in NOISE.items():
        words = f"{unit}: is that much noise at every sample; {unit}, not {other}?"
        yield f"sensors.{name} =", getattr(scenario.noise, name), bound, words
    for name in ("measurement", "command"):
        yield f"delays.{name} =", getattr(scenario.delays, name), 1.0, "s: is long; s, not ms?"
    looks = [scenario.reference.at(k / LOOKS * scenario.duration) for k in range(LOOKS + 1)]
    farthest = max((look.position for look in looks), key=_norm)
    yield "reference.base reaches", farthest, SPREAD, "m from the origin: m, not mm?"
    words = "rad at the start: is more than a turn; rad, not degrees?"
    yield "reference.yaw =", float(looks[0].yaw), TURN, words
    for i, link in enumerate(links):
        most = max((float(look.joints[i]) for look in looks), key=abs)
        yield _of_joint(f"reference.joints[{i}] reaches", most, link.joint.kind)
    if start is not None:
        for i, (q, link) in enumerate(zip(start.joints, links, strict=True)):
            yield _of_joint(f"initial.joints[{i}] =", float(q), link.joint.kind)
        yield "initial.rate of", start.rate, 50.0, "rad/s: is fast; rad/s, not degrees/s?"  # eight turns a second
        yield "initial.position of", start.position, SPREAD, "m: is far; m, not mm?"


def _of_vehicle(vehicle: Vehicle) -> Iterator[Suspicion]:
    # a quadrotor of 0.7 kg written in grams weighs more than 300 kg
    yield "mass =", float(vehicle.mass), 300.0, "kg: is that of a car; kg, not g?"
    for link in vehicle.links:
        joint, name = link.joint, f"joints[{link.joint.name}]"
        unit, other = ("N m", "N mm") if joint.kind == "revolute" else ("N", "mN")
        for end in ("lower", "upper"):
            yield _of_joint(f"{name}.{end} =", float(getattr(joint, end)), joint.kind)
        words = f"{unit}: is a crane's; {unit}, not {other}?"
        yield f"{name}.effort_limit =", float(joint.effort_limit), 10_000.0, words
    for name, where in _places(vehicle):
        yield f"{name} =", where, FARTHEST, "m away: is far; m, not mm?"


def _model(scenario: Scenario) -> Iterator[str]:
    truth, model = scenario.plant.vehicle, scenario.controller.par.model.vehicle
    if model != truth:
        known = set(unlikely_in_vehicle(truth))
        yield from (f"model: {line}" for line in unlikely_in_vehicle(model) if line not in known)
    ours, theirs = float(truth.mass), float(model.mass)
    if not ours < LOADED * theirs or not theirs < LOADED * ours:
        yield f"plant.vehicle of {ours:g} kg, model.vehicle of {theirs:g} kg: differ; kg, not g (payload)?"


def _wind_force(scenario: Scenario) -> Iterator[str]:
    wind, weight = scenario.wind, float(scenario.plant.vehicle.mass) * EARTH
    if isinstance(wind, ForceWind):
        for name, force in (("force", wind.force_W), *(("gust.force", gust.peak) for gust in all_gusts(wind))):
            if _norm(force) > MOST_WIND * weight:
                times = _norm(force) / weight
                yield f"environment.wind.{name} of {_norm(force):g} N: is {times:.3g} times the weight; N?"


def _without_drag(scenario: Scenario) -> Iterator[str]:
    """Air that moves about a vehicle on which it has no effect."""
    vehicle, wind = scenario.plant.vehicle, scenario.wind
    drags = [(rotor.drag_coefficient, rotor.rolling_moment_coefficient) for rotor in vehicle.rotors]
    if any(float(value) for pair in drags for value in pair):
        return
    if _norm(vehicle.drag.area) * float(vehicle.drag.air_density):
        return
    moving = [f"environment.air[{i}]" for i in range(len(scenario.air))]
    if isinstance(wind, MovingAir) and (_norm(wind.velocity_W) or all_gusts(wind) or wind.turbulence is not None):
        moving.insert(0, "environment.wind")
    if moving:
        yield (
            f"{', '.join(moving)}: moves the air about a vehicle without drag, on which it does not act; "
            f"rotors.drag_coefficient or drag.area of {vehicle.name!r}?"
        )


def _start_beyond_limits(scenario: Scenario) -> Iterator[str]:
    joints = () if scenario.initial is None else scenario.initial.joints
    for i, (q, link) in enumerate(zip(joints, scenario.plant.vehicle.links, strict=False)):
        low, high = float(link.joint.lower), float(link.joint.upper)
        if not low - SLACK <= float(q) <= high + SLACK:
            limits = f"{low:g} ... {high:g} of {link.joint.name!r}"
            yield f"initial.joints[{i}] = {float(q):g}: is beyond the limits {limits}; rad, not degrees?"


def _inertias(vehicle: Vehicle) -> Iterator[str]:
    extent = max([SMALLEST, *(_norm(where) for _, where in _places(vehicle))])
    extent = max(extent, sum(_norm(link.joint.position) for link in vehicle.links))
    for name, body in (("base", vehicle.base), *((f"links[{link.name}]", link.body) for link in vehicle.links)):
        radius = _gyration(body)
        if math.isinf(radius):
            yield f"{name}.mass = 0 kg: has an inertia of {_largest(body):g} kg m^2 without a mass; kg?"
        elif radius > GYRATION * extent:
            yield (
                f"{name}.inertia = {_largest(body):g} kg m^2: is that of its {float(body.mass):g} kg {radius:.3g} m "
                f"away, and the vehicle reaches {extent:.3g} m; kg m^2, not kg cm^2 or g mm^2?"
            )


def _rotors(vehicle: Vehicle) -> Iterator[str]:
    weight, top = float(vehicle.mass) * EARTH, float(highest_thrust(vehicle)) if vehicle.rotors else math.nan
    if vehicle.rotors and weight > 0.0 and top < math.inf:
        speeds = f"rotors: max_speed = {max(float(rotor.max_speed) for rotor in vehicle.rotors):g} rad/s"
        if top > MARGINS[1] * weight:
            hint = "rad/s, not rev/min? N s^2/rad^2 of thrust?"
            rows = [(rotor.name, rotor.table) for rotor in vehicle.rotors if rotor.table is not None]
            for name, table in rows[:1]:
                speeds = f"rotors[{name}].thrust_table.thrust = {table.thrust[-1]:g} N at {table.speed[-1]:g} rad/s"
                hint = "thrust in N, not g? speed in rad/s, not rev/min?"
            yield f"{speeds}: lifts {top / weight:.3g} times the weight; {hint}"
        elif 0.0 <= top < MARGINS[0] * weight:
            yield f"{speeds}: lifts {top / weight:.2g} of the weight; kg, not g? N s^2/rad^2, not N per (rev/min)^2?"
    for field, (most, slow, hint) in OF_ROTORS.items():
        beyond = [rotor for rotor in vehicle.rotors if float(getattr(rotor, field)) > most]
        if beyond:
            # one cause as a rule: once, with the largest
            worst = max(beyond, key=lambda rotor: float(getattr(rotor, field)))
            others = f" (and {len(beyond) - 1} more rotors)" if len(beyond) > 1 else ""
            yield f"rotors[{worst.name}].{field} = {float(getattr(worst, field)):g} {slow}{others}; {hint}"
    hubs, com = max((_norm(rotor.position) for rotor in vehicle.rotors), default=math.inf), _norm(vehicle.base.com)
    if OUTSIDE * max(hubs, SMALLEST) < com <= FARTHEST:
        yield f"base.com = {com:g} m away: is far from a base whose rotors reach {hubs:.3g} m; m, not mm?"


def _places(vehicle: Vehicle) -> list[tuple[str, Any]]:
    """Names and positions of all that has one, each in the frame that it is fixed to."""
    found = [(f"rotors[{rotor.name}].position", rotor.position) for rotor in vehicle.rotors]
    found += [(f"joints[{link.joint.name}].position", link.joint.position) for link in vehicle.moving]
    found += [(f"frames[{frame.name}].position", frame.position) for frame in vehicle.frames]
    names = {BASE: "base"} | {i: f"links[{link.name}]" for i, link in enumerate(vehicle.moving)}
    return found + [(f"{names[i - 1]}.com", body.com) for i, body in enumerate(vehicle.bodies)]


def _norm(vector: Any) -> float:
    return math.hypot(*(float(c) for c in vector))


def _largest(body: Body) -> float:
    """Largest moment on the diagonal, kg m^2."""
    return max(float(body.inertia.xx), float(body.inertia.yy), float(body.inertia.zz))


def _gyration(body: Body) -> float:
    """Radius at which the body's mass would have its largest moment of inertia, m."""
    mass, moment = float(body.mass), _largest(body)
    return math.sqrt(max(moment, 0.0) / mass) if mass > 0.0 else (math.inf if moment > 0.0 else 0.0)


def no_load_speed(servo: Servo) -> float:
    """Speed (rad/s or m/s) of a joint at which the motor's counter-voltage is the supply's; infinite without one."""
    return float(servo.voltage) / (float(servo.gear) * float(servo.torque_constant))


def _servo(name: str, servo: Servo, kind: str) -> Iterator[str]:
    unit = "rad/s" if kind == "revolute" else "m/s"
    top, limit = no_load_speed(servo), float(servo.speed_limit)
    if MAINS < float(servo.voltage) < math.inf:
        yield f"{name}.voltage = {float(servo.voltage):g} V: is that of the mains; V, not mV?"
    elif FASTEST[kind] < top < math.inf:
        torque = f"{float(servo.largest_effort()):.3g} {'N m' if kind == 'revolute' else 'N'}"
        yield (
            f"{name}.gear = {float(servo.gear):g}: without load {float(servo.voltage):g} V turn it at {top:.4g} {unit} "
            f"with {torque} at rest; a gear's ratio left out, or its inverse?"
        )
    elif FASTER * top < limit < math.inf:
        yield (
            f"{name}.torque_constant = {float(servo.torque_constant):g} N m/A: the motor turns no faster than "
            f"{top:.3g} {unit} behind a gear of {float(servo.gear):g}, and speed_limit is {limit:g}; N m/A?"
        )
    if limit < SLOWEST_GOAL[kind]:
        yield f"{name}.speed_limit = {limit:g} {unit}: a move by 1 takes {1.0 / max(limit, 1e-300):.3g} s; {unit}?"


def unlikely_in_supply(vehicle: Vehicle) -> Iterator[str]:
    """Lines about what turns in the rotors and about the battery."""
    i = vehicle.base.inertia
    own = max(float(i.xx), float(i.yy), float(i.zz))
    heavy = [rotor for rotor in vehicle.rotors if float(rotor.inertia) > SHARE_OF_BASE * own]
    if heavy:
        name, value = f"rotors[{heavy[0].name}].inertia", float(heavy[0].inertia)
        yield f"{name} = {value:g} kg m^2: is a part of the base's, which has {own:g}; kg m^2, not g cm^2?"
    if vehicle.battery is not None:
        yield from _battery(vehicle.battery, float(vehicle.mass))
        tables = [rotor for rotor in vehicle.rotors if rotor.table is not None and rotor.table.current]
        yield from _current(vehicle.battery, tables)


def _battery(battery: Battery, mass: float) -> Iterator[str]:
    capacity, resistance = float(battery.capacity), float(battery.resistance)
    energy = battery.cells * NOMINAL * capacity
    full = battery.cells * float(battery.open_circuit.voltage[-1])
    if energy > DENSEST * mass:
        yield (
            f"battery.capacity = {capacity:g} A h: is {energy:.3g} W h in {mass:.3g} kg of vehicle, and lithium cells "
            f"hold 270 a kg; A h, not mA h?"
        )
    elif resistance * FEWEST_C * capacity > full:
        yield (
            f"battery.resistance = {resistance:g} ohm: lets {full / resistance:.3g} A through in a short circuit; "
            f"ohm, not mohm?"
        )
    cell = float(battery.reference_voltage) / battery.cells
    low, high = float(battery.open_circuit.voltage[0]), float(battery.open_circuit.voltage[-1])
    if not CELL_VOLTAGE[0] * low <= cell <= CELL_VOLTAGE[1] * high:
        stated = f"reference_voltage = {float(battery.reference_voltage):g} V"
        yield (
            f"battery.cells = {battery.cells}: {stated} is {cell:.3g} V a cell, "
            f"and a cell has {low:g} to {high:g}; cells in series, volts of the whole pack?"
        )


def _current(battery: Battery, rotors: list[Rotor]) -> Iterator[str]:
    """The table's last row: electrical power against that of the drag torque."""
    for rotor in rotors:
        table = rotor.table
        assert table is not None
        torque = table.torque[-1] if table.torque else float(rotor.moment_coefficient) * table.thrust[-1]
        electrical, turning = table.current[-1] * float(battery.reference_voltage), torque * table.speed[-1]
        if electrical > WORST * turning > 0.0:
            yield (
                f"rotors[{rotor.name}].thrust_table.current = {table.current[-1]:g} A in its last row: is "
                f"{electrical:.3g} W for {turning:.3g} W of the drag torque; A, not mA?"
            )
            return


def law_without_priorities(scenario: Scenario) -> Iterator[str]:
    """A warning about a centroidal law whose rotor model allows no priorities, and why.

    Demands beyond a rotor's range are then cut rotor by rotor, and ``yaw_slack`` is not used.
    """
    controller = scenario.controller
    par: Any = controller.par  # layers share model and mixer, which stand with the outermost
    if not controller.name.removeprefix("guarded_").startswith("centroidal_") or par.mixer.policy != "clip":
        return
    model = pairs_model(par.model) if turns_rotors(controller) else par.model
    try:
        make_mixer(model.vehicle, "priority")
    except AllocationError as error:
        yield (
            f"controller.law = 'centroidal': cuts what is beyond a rotor's range rotor by rotor, and has no yaw_slack: "
            f"{error}; both are there where all rotors lift"
        )


def law_of_undriven(scenario: Scenario) -> Iterator[str]:
    """A warning about a shipped law that commands torques at the plant's passive joints.

    Such a law takes the reaction of those torques into the base's: a slung load falls within seconds.
    """
    free = undriven_joints(scenario.plant.vehicle, [each.joint for each in scenario.joint_drives])
    name = scenario.controller.name.removeprefix("guarded_")
    law = "centroidal" if name.startswith("centroidal_") else name
    if free and law in SHIPPED["law"] and law not in BEARS_UNDRIVEN:
        joints = f"joint{'s' if len(free) > 1 else ''} {', '.join(free)}"
        others = f"{', '.join(BEARS_UNDRIVEN[:-1])} or {BEARS_UNDRIVEN[-1]}"
        yield (
            f"controller.law = {law!r}: counts on the torque of {joints}, which no drive gives (effort_limit 0); "
            f"{others}, which leave passive joints alone?"
        )
