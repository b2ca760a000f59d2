"""The tables of a scenario file, one reader each; the grammar is in :mod:`skyarm.scenario.scenario_file`."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from skyarm.actuation import AllocationError
from skyarm.algebra import Quaternion, Vec3
from skyarm.contact.contact import Contact
from skyarm.control.actuator_layer import plain_model
from skyarm.control.controller import Controller, ControllerError
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.environment import payload_from
from skyarm.files import Fields, number, shown
from skyarm.records.leaves import field_names
from skyarm.records.read_table import record_from
from skyarm.scenario.gains_file import controller_of_file, make_named_or_tuned
from skyarm.scenario.governor_limits import GovernorOptions
from skyarm.scenario.law_by_name import on_actuators
from skyarm.scenario.law_table import by_words
from skyarm.scenario.path_governor import options_from
from skyarm.scenario.scenario_checks import check_quaternion
from skyarm.scenario.scenario_record import Delays, Rates, Scenario, trimmed_state
from skyarm.scenario.standing_start import standing
from skyarm.scenario.world_meshes import with_meshes
from skyarm.sensors.measurement import SensorNoise
from skyarm.vehicle.linkage import JOINT_NUMBERS
from skyarm.vehicle.mounted_drives import mounted_drives
from skyarm.vehicle.vehicle_files import list_vehicles, load_vehicle
from skyarm.vehicle.vehicle_records import Vehicle


def text(fields: Fields, name: str, *default: str) -> str:
    """Text; not empty where there is no default."""
    value = fields.take(name, *default)
    if not isinstance(value, str) or (not value and not default):
        raise ValueError(f"{fields.at(name)} = {shown(value)}: must be text{'' if default else ' that is not empty'}")
    return value


def truth_value(fields: Fields, name: str, default: bool) -> bool:
    """True or false."""
    value = fields.take(name, default)
    if not isinstance(value, bool):
        raise ValueError(f"{fields.at(name)} = {shown(value)}: must be true or false")
    return value


def vehicle(fields: Fields, folder: Path) -> Vehicle:
    """The named vehicle, as its file describes it."""
    named = fields.take("vehicle")
    if not isinstance(named, str) or not named:
        raise ValueError(f"{fields.at('vehicle')} = {shown(named)}: must be a name of the library or a path")
    try:
        return load_vehicle(named if named in list_vehicles() else folder / named)
    except ValueError as error:
        raise ValueError(f"{fields.at('vehicle')} = {shown(named)}: {error}") from None


def truth(plant: Fields, folder: Path) -> Vehicle:
    """The table's vehicle with its payload and what it says of joints: the truth, or what is believed of it."""
    found = with_payload(vehicle(plant, folder), plant)
    if plant.where == "model":
        found = believed_drives(found, plant)
    rows = _joint_overrides(plant, found.n)
    if not any(rows):
        return found
    links = tuple(
        dataclasses.replace(link, joint=dataclasses.replace(link.joint, **row))
        for link, row in zip(found.links, rows, strict=True)
    )
    return dataclasses.replace(found, links=links)


def believed_drives(found: Vehicle, model: Fields) -> Vehicle:
    """The vehicle with the drives of [model.drives.JOINT] in place of those that it carries."""
    tables = model.take("drives", None)
    if tables is None:
        return found
    if not isinstance(tables, dict):
        raise ValueError(f"{model.at('drives')} = {shown(tables)}: must be a table of tables by name")
    return dataclasses.replace(found, drives=mounted_drives(tables, model.at("drives")))


def with_payload(carrier: Vehicle, fields: Fields) -> Vehicle:
    """The vehicle with the table's payload, if there is one."""
    payload = fields.take("payload", None)
    if payload is None:
        return carrier
    held = payload_from(payload, fields.at("payload"))
    try:
        return held.held_by(carrier)
    except ValueError as error:
        raise ValueError(f"{fields.at('payload')}: {error}") from None


def contact(top: Fields, folder: Path) -> Contact | None:
    """[world]: surfaces, and points of the vehicle that touch them; files of meshes stand below a folder."""
    table = top.take("world", None)
    return None if table is None else record_from(Contact, Fields(with_meshes(table, "world", folder), "world"))


def gravity(fields: Fields) -> float:
    """Gravity, m/s^2."""
    return fields.number("gravity", 9.81, low=0.0)


def _joint_overrides(table_of: Fields, joints: int) -> list[dict[str, Any]]:
    """Fields of each joint: a number stands for every joint, a list has one for each."""
    table = Fields(table_of.take("joints", {}), table_of.at("joints"))
    found: list[dict[str, Any]] = [{} for _ in range(joints)]
    for name in JOINT_NUMBERS:
        strict = name == "coulomb_rate"
        value, at = table.take(name, None), table.at(name)
        if isinstance(value, list):
            if len(value) != joints:
                raise ValueError(f"{at} = {shown(value)}: must be a number, or {joints} numbers, one for each joint")
            values = [number(each, f"{at}[{i}]", low=0.0, strict=strict) for i, each in enumerate(value)]
        elif value is not None:
            values = [number(value, at, low=0.0, strict=strict)] * joints
        else:
            continue
        for row, each in zip(found, values, strict=True):
            # a stop of exactly no stiffness is none
            row[name] = 0 if name == "stop_stiffness" and each == 0.0 else each
    table.done()
    return found


def rates(top: Fields) -> Rates:
    """Clock rates."""
    table = Fields(top.take("rates", {}), "rates")
    defaults = Rates()
    hertz = {name: table.take(name, getattr(defaults, name)) for name in ("physics", "control", "reference")}
    table.done()
    return Rates(**hertz)


def controller(
    fields: Fields, model: Model, replaced: str | None, known: Mapping[str, Any], folder: Path = Path()
) -> Controller:
    """A preset or a law with its constants, with the safety layer if asked; on the servos that the belief has.

    ``replaced`` is a name of :mod:`skyarm.control.catalogue` in place of the table's law, or a file of gains
    (:mod:`skyarm.scenario.gains_file`); ``folder`` is where the table's own file of gains lies.

    ``known`` is what a law may know of its loop (:func:`skyarm.control.catalogue.preset`).
    """
    safety, servos = fields.take("safety", False), truth_value(fields, "servos", bool(model.vehicle.drives))
    plain = plain_model(model)
    try:
        if replaced is not None:
            found = make_named_or_tuned(replaced, plain, known)
        elif isinstance(fields.table.get("tuned"), str):
            _require_alone(fields)
            found = controller_of_file(fields.take("tuned"), folder, plain, known, fields.at("tuned"))
        else:
            found = by_words(fields, plain, known)
    except AllocationError as error:
        raise ValueError(f"model.vehicle = {model.vehicle.name!r}: {error}") from None
    found = _with_safety(found, safety)
    try:
        return on_actuators(found, model, known["control_period"], servos)
    except ControllerError as error:
        raise ValueError(f"controller.{error}") from None


def _require_alone(fields: Fields) -> None:
    """Refuse a law beside a file of gains, which names its own."""
    for word, value in fields.table.items():
        if word not in ("tuned", "safety", "servos"):
            allowed = "beside it only safety and servos are allowed"
            names = f"the file of {fields.at('tuned')} names the law"
            raise ValueError(f"{fields.at(word)} = {shown(value)}: must be left out: {names}; {allowed}")


def require_servos_said(fields: Fields, carrier: Vehicle, model: Model) -> None:
    """Refuse a belief without the servos of the true vehicle, unless the file says what the law's efforts are.

    Raises:
        ValueError: one line: torques would reach the servos as angles.
    """
    if carrier.drives and not model.vehicle.drives and "servos" not in fields.table:
        raise ValueError(
            f"{fields.at('servos')}: is missing; plant.vehicle = {carrier.name!r} has servos and model.vehicle = "
            f"{model.vehicle.name!r} none: give it [model.drives.JOINT], or say false for a law of setpoints"
        )


def _with_safety(found: Controller, safety: Any) -> Controller:
    """The controller with its safety layer: false, true, or a table of limits and the stowed pose."""
    if safety is False:
        return found
    from skyarm.control.safety import with_safety_layer

    if safety is True:
        return with_safety_layer(found)
    if not isinstance(safety, dict):
        raise ValueError(f"controller.safety = {shown(safety)}: must be true, false or a table of limits")
    table = Fields(safety, "controller.safety")
    stow = table.numbers("stow") if "stow" in safety else None
    try:
        return with_safety_layer(found, {name: value for name, value in safety.items() if name != "stow"}, stow=stow)
    except ControllerError as error:
        raise ValueError(f"controller.{error}") from None


def sensors(table: Fields) -> SensorNoise:
    """Standard deviations; a perfect sensor is structure. Tables in it are sensors of their own."""
    for name, value in table.table.items():
        if isinstance(value, dict):
            table.take(name)
    names = field_names(SensorNoise) or ()
    sigmas: dict[str, Any] = {name: table.number(name, 0.0, low=0.0) for name in names}
    table.done()
    return SensorNoise(**{name: sigma if sigma > 0.0 else 0 for name, sigma in sigmas.items()})


def delays(top: Fields) -> Delays:
    """Dead times."""
    table = Fields(top.take("delays", {}), "delays")
    seconds = {name: table.number(name, 0.0, low=0.0) for name in ("measurement", "command")}
    apart: dict[str, Any] = {name: table.number(name, low=0.0) for name in ("rotors", "joints") if name in table.table}
    longest = table.take("longest_command", None)
    table.done()
    return Delays(**seconds, **apart, longest_command=longest)


def governor(reference: Any) -> tuple[Any, GovernorOptions | None]:
    """The table of the reference without ``governor``, and its options; None where there is none."""
    if not isinstance(reference, Mapping) or "governor" not in reference:
        return reference, None
    rest = {name: value for name, value in reference.items() if name != "governor"}
    said = reference["governor"]
    if isinstance(said, bool):
        return rest, GovernorOptions() if said else None
    if not isinstance(said, Mapping):
        raise ValueError(f"reference.governor = {shown(said)}: must be true, false or a table of limits")
    return rest, options_from(said)


def joined(reference: Mapping[str, Any]) -> tuple[dict[str, Any], Any]:
    """The table of the reference without ``joined``, and that: s, or a structural 0 where the law follows at once."""
    if not isinstance(reference, Mapping) or "joined" not in reference:
        return reference, 0  # type: ignore[return-value]
    rest = {name: value for name, value in reference.items() if name != "joined"}
    return rest, number(reference["joined"], "reference.joined", low=0.0)


def initial(fields: Fields, scenario: Scenario) -> State:
    """Hover trim at the reference with the given fields replaced; ``standing`` sets it down below, rotors at rest."""
    stands = truth_value(fields, "standing", False)
    start = scenario.trajectory.at(0.0)
    joints = fields.numbers("joints", [float(q) for q in start.joints])
    n = scenario.world.vehicle.n
    if len(joints) != n:
        raise ValueError(f"initial.joints: {len(joints)} values, must be {n}, one for each joint")
    trim = trimmed_state(scenario.world, start.position, float(start.yaw), joints)
    if stands:
        _require_standing(fields, scenario)
        trim = dataclasses.replace(trim, rotor_speeds=(0.0,) * len(trim.rotor_speeds))
    quaternion = fields.numbers("quaternion_wxyz", list(trim.quaternion))
    check_quaternion(quaternion)
    length = math.sqrt(sum(c * c for c in quaternion))
    state = State(
        position=Vec3(*fields.vector("position", tuple(trim.position))),
        quaternion=Quaternion.of([c / length for c in quaternion]),
        velocity=Vec3(*fields.vector("velocity", tuple(trim.velocity))),
        rate=Vec3(*fields.vector("rate", tuple(trim.rate))),
        joints=joints,
        joint_rates=fields.numbers("joint_rates", trim.joint_rates),
        rotor_speeds=fields.numbers("rotor_speeds", trim.rotor_speeds, low=0.0),
        tilts=fields.numbers("tilts", trim.tilts),
    )
    fields.done()
    return standing(scenario.world, scenario.contacts[0], state) if stands else state


def _require_standing(fields: Fields, scenario: Scenario) -> None:
    """Refuse a start at rest on nothing, or with a motion."""
    if not scenario.contacts:
        raise ValueError(f"{fields.at('standing')} = true: must be false without a [world] to stand on")
    for name in ("quaternion_wxyz", "velocity", "rate", "joint_rates", "rotor_speeds"):
        if name in fields.table:
            raise ValueError(f"{fields.at(name)}: must be left out of a start that is standing: it is at rest")
