"""Readers of the tables of a scenario file; the grammar is in :mod:`skyarm.scenario.scenario_file`."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, get_args, get_origin

from skyarm.algebra import Quaternion, Vec3
from skyarm.dynamics import State
from skyarm.dynamics.actuators.hover import highest_thrust
from skyarm.plant.interface import Truth
from skyarm.records.field_rules import rules
from skyarm.records.files import Fields, errors_as, number, shown
from skyarm.records.files.fields import list_of_tables
from skyarm.records.leaves import parts
from skyarm.records.read_table import record_from, registered_from
from skyarm.records.registry.plugins import known_names
from skyarm.records.registry.registrations import LOADED_BY
from skyarm.records.words import Slot, slots
from skyarm.reference.reference_tables import reference_from
from skyarm.reference.task_records import Setting
from skyarm.scenario.scenario_checks import check_quaternion
from skyarm.scenario.scenario_record import JointDrive, NamedSensor, Scenario, trimmed_state
from skyarm.sensing.measurement import SensorNoise
from skyarm.sensing.sensor import Sensor
from skyarm.vehicle.linkage import JOINT_NUMBERS
from skyarm.vehicle.vehicle_files import list_vehicles, load_vehicle
from skyarm.vehicle.vehicle_records import MountedDrive, Vehicle
from skyarm.vehicle.vehicle_tables import mounted_drives
from skyarm.world import Component, Payload

if TYPE_CHECKING:
    from skyarm.reference.feasibility import Feasibility
    from skyarm.world.contact.contact import Contact


@cache
def parts_by_path() -> dict[str, Slot]:
    """Words of a file that are read by themselves, and may be replaced by a scheduled change as a whole."""
    return {slot.path: slot for slot in slots(Scenario) if slot.word.whole and not slot.word.entries}


def slot_of(path: str) -> Slot:
    """Word of a scenario's file at a path."""
    return next(slot for slot in slots(Scenario) if slot.path == path)


def read_part(slot: Slot, entry: object) -> Any:
    """Value of a word's field, from what a file has in its place.

    A list of tables is read if the field is a tuple; a text alone names the kind of a single component.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    word, path = slot.word, slot.path
    if word.reader:
        return resolve_name(word.reader)(entry, path)
    if not word.kind:
        return Fields({path.rpartition(".")[2]: entry}, path.rpartition(".")[0]).flag(path.rpartition(".")[2])
    if get_origin(slot.type) is not tuple:
        named = {"kind": entry} if isinstance(entry, str) else entry
        return registered_from(word.kind, slot.type, named, path, word.usual)
    base, tables = get_args(slot.type)[0], list_of_tables(entry, path)
    return tuple(registered_from(word.kind, base, each.table, each.where, word.usual) for each in tables)


def parts_from(tables: Mapping[str, Fields]) -> dict[str, Any]:
    """Read the optional wind, faults, air, forces, ground, estimator and endings of a scenario file."""
    found = {}
    for path, slot in parts_by_path().items():
        within, _, name = path.rpartition(".")
        entry = tables[within].take(name, None)
        if name in tables[within].table:
            found[slot.place[-1]] = read_part(slot, entry)
    return found


def vehicle(fields: Fields, folder: Path) -> Vehicle:
    """Load the vehicle that [plant] or [model] names, without the table's payload and joint values."""
    named = fields.take("vehicle")
    if not isinstance(named, str) or not named:
        raise ValueError(f"{fields.at('vehicle')} = {shown(named)}: must be a name of the library or a path")
    try:
        return load_vehicle(named if named in list_vehicles() else folder / named)
    except ValueError as error:
        words = str(error).removeprefix(f"vehicle = {shown(named)}: ")
        raise ValueError(f"{fields.at('vehicle')} = {shown(named)}: {words}") from None


def truth(plant: Fields, folder: Path) -> Vehicle:
    """Vehicle of [plant] or [model] with the payload, drives and joint values that the table states."""
    found = vehicle(plant, folder)
    if "payload" in plant.table:
        try:
            found = record_from(Payload, plant.inner("payload")).held_by(found)
        except ValueError as error:
            words, at = str(error), plant.at("payload")
            raise ValueError(words if words.startswith(at) else f"{at}: {words}") from None
    if plant.where == "model" and "drives" in plant.table:
        found = dataclasses.replace(found, drives=_drives(plant))
    return _with_joint_numbers(found, plant.inner("joints"))


def _drives(fields: Fields) -> tuple[MountedDrive, ...]:
    """Read [plant.drives.JOINT] or [model.drives.JOINT]: the drives of joints."""
    return mounted_drives(fields.inner("drives").table, fields.at("drives"))


def _with_joint_numbers(found: Vehicle, table: Fields) -> Vehicle:
    """Vehicle with joint values replaced, such as damping: one value for all joints, or a list with one for each."""
    rows: list[dict[str, Any]] = [{} for _ in found.links]
    for name in JOINT_NUMBERS:
        value, at = table.take(name, None), table.at(name)
        if isinstance(value, list) and len(value) != found.n:
            raise ValueError(f"{at} = {shown(value)}: must be a number, or {found.n} numbers, one for each joint")
        for i, row in enumerate(rows if value is not None else ()):
            given, where = (value[i], f"{at}[{i}]") if isinstance(value, list) else (value, at)
            row[name] = number(given, where, low=0.0, strict=name == "coulomb_rate")
            if name == "stop_stiffness" and row[name] == 0.0:
                row[name] = 0  # a stop of exactly no stiffness is none
    table.done()
    if not any(rows):
        return found
    links = (
        dataclasses.replace(link, joint=dataclasses.replace(link.joint, **row))
        for link, row in zip(found.links, rows, strict=True)
    )
    return dataclasses.replace(found, links=tuple(links))


def gravity(fields: Fields) -> float:
    """Read gravity from [plant] or [model], m/s^2; by default 9.81."""
    return fields.number("gravity", 9.81, low=0.0)


def contact(table: object, folder: Path) -> Contact | None:
    """Read the contact model [world]: surfaces and the vehicle's contact points; mesh paths start from a folder."""
    if table is None:
        return None
    found: Contact = registered_from("world", Component, with_files(table, "world", folder), "world", "contact")
    return found


def with_files(table: object, where: str, folder: Path) -> Any:
    """Tables of [reference] or [world] with paths of sample and mesh files made absolute.

    Args:
        table: plain, of a file.
        where: its place in the file.
        folder: of the file.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    if isinstance(table, list):
        return [with_files(each, f"{where}[{i}]", folder) for i, each in enumerate(table)]
    if not isinstance(table, dict):
        return table
    found = {name: with_files(each, f"{where}.{name}", folder) for name, each in table.items()}
    if found.get("kind") == "samples" and isinstance(found.get("file"), str):
        found["file"] = str(folder / found["file"])
    mesh = table.get("mesh")
    if isinstance(mesh, str) and mesh:
        from skyarm.records.files.stl_mesh import read_corners

        path = folder / mesh
        with errors_as(ValueError, f"{where}.mesh = {shown(mesh)}: "):
            read_corners(path)
        found["mesh"] = str(path.absolute())  # a log is drawn from any folder
    return found


def sensors(table: Mapping[str, Any]) -> tuple[SensorNoise, tuple[NamedSensor, ...]]:
    """Read [sensors]: noise of the full state, and named sensors in nested tables."""
    named = {name: value for name, value in table.items() if isinstance(value, dict)}
    noise = record_from(SensorNoise, Fields({name: table[name] for name in table if name not in named}, "sensors"))
    instruments = tuple(
        NamedSensor(name=name, sensor=registered_from("sensor", Sensor, value, f"sensors.{name}"))
        for name, value in named.items()
    )
    return SensorNoise(**{name: sigma or 0 for name, sigma in parts(noise).items()}), instruments


def drives(plant: Fields) -> tuple[JointDrive, ...]:
    """Read [plant.drives.JOINT]: the drives of joints."""
    return tuple(JointDrive(joint=each.name, drive=each.drive) for each in _drives(plant))


def setting_of(world: Truth, duration: float) -> Setting:
    """Setting of a flight for readers of a reference: vehicle, gravity, duration and thrust-to-weight ratio."""
    weight = float(world.vehicle.mass) * float(world.gravity)
    most = float(highest_thrust(world.vehicle)) / weight if weight > 0.0 else math.inf
    return Setting(vehicle=world.vehicle, gravity=float(world.gravity), duration=duration, thrust_to_weight=most)


def feasibility_of(scenario: Scenario) -> Feasibility | None:
    """Feasibility of the tip's reference against reach and limits; None where the tip has no reference."""
    from skyarm.reference.feasibility import feasibility

    return feasibility(scenario.reference, setting_of(scenario.plant, scenario.duration))


def _as_commanded(scenario: Scenario) -> Scenario:
    """Return a scenario unchanged, in place of a path governor."""
    return scenario


def reference(
    table: object, world: Truth, setting: Setting, folder: Path = Path()
) -> tuple[dict[str, Any], Callable[[Scenario], Scenario]]:
    """Read [reference]: trajectory, start of tracking, and the function that adds the path governor to a scenario."""
    planned: Callable[[Scenario], Scenario] = _as_commanded
    rest, start = table, 0
    if isinstance(table, Mapping):
        rest = {name: value for name, value in table.items() if name not in ("governor", "tracking_start")}
        if "tracking_start" in table:  # s; left out, a structural 0: the law follows at once
            start = number(table["tracking_start"], "reference.tracking_start", low=0.0)  # type: ignore[assignment]
        if table.get("governor", False) is not False:
            from skyarm.scenario.path_governor import planner_from

            planned = planner_from(table["governor"], setting)
    trajectory = reference_from(with_files(rest, "reference", folder), world.vehicle.n, "reference", setting)
    return {"reference": trajectory, "tracking_start": start}, planned


def initial(fields: Fields, scenario: Scenario) -> State:
    """Read [initial]: hover trim with given fields replaced, or a vehicle standing on a surface with rotors off."""
    stands = fields.flag("standing", False)
    start = scenario.reference.at(0.0)
    joints = rules(State)["joints"]("initial.joints", fields.numbers("joints", [float(q) for q in start.joints]))
    n = scenario.plant.vehicle.n
    if len(joints) != n:
        raise ValueError(f"initial.joints: {len(joints)} values, must be {n}, one for each joint")
    trim = trimmed_state(scenario.plant, start.position, float(start.yaw), joints)
    if stands:
        _require_standing(fields, scenario)
        trim = dataclasses.replace(trim, rotor_speeds=(0.0,) * len(trim.rotor_speeds))
    quaternion = fields.numbers("quaternion_wxyz", list(trim.quaternion))
    check_quaternion(quaternion)
    length = math.sqrt(sum(c * c for c in quaternion))
    vectors = {
        name: Vec3(*fields.vector(name, tuple(getattr(trim, name)))) for name in ("position", "velocity", "rate")
    }
    state = State(
        quaternion=Quaternion(*(c / length for c in quaternion)),
        joints=joints,
        joint_rates=fields.numbers("joint_rates", trim.joint_rates),
        rotor_speeds=fields.numbers("rotor_speeds", trim.rotor_speeds, low=0.0),
        tilts=fields.numbers("tilts", trim.tilts),
        **vectors,
    )
    fields.done()
    if not stands:
        return state
    from skyarm.world.contact.static_equilibrium import stand_vehicle

    return stand_vehicle(scenario.plant.vehicle, float(scenario.plant.gravity), scenario.worlds[0], state)


def _require_standing(fields: Fields, scenario: Scenario) -> None:
    """Raise an error for a start standing on a surface if there are no surfaces, or with an initial motion."""
    if not scenario.worlds:
        raise ValueError(f"{fields.at('standing')} = true: must be false without a [world] to stand on")
    for name in ("quaternion_wxyz", "velocity", "rate", "joint_rates", "rotor_speeds"):
        if name in fields.table:
            raise ValueError(f"{fields.at(name)}: must be left out of a start that is standing: it is at rest")


def require_plugins(top: Fields) -> None:
    """Raise an error if a plugin that a file requires by [plugins] need = [...] is not loaded.

    Raises:
        ValueError: one is not loaded, with how to load it.
    """
    table = top.inner("plugins")
    needed = table.take("need", [])
    table.done()
    if not isinstance(needed, list) or not all(isinstance(name, str) for name in needed):
        raise ValueError(f"plugins.need = {shown(needed)}: must be a list of names")
    for name in needed:
        if name not in known_names():
            how = LOADED_BY.format(name) if name.endswith(".py") else f"pip install {name}"
            raise ValueError(f"plugins.need = {name!r}: is not loaded; {how}. A file that is read runs no code")
