"""What ``skyarm show --json`` says of a vehicle: the numbers of its sheet, with their units in the keys."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from skyarm.actuation.hover import highest_thrust, hover_trim
from skyarm.dynamics.array_front import center_of_mass
from skyarm.dynamics.workspace import reach, search_of, static_torques
from skyarm.records.leaves import field_names
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.tilt import Tilt
from skyarm.vehicle.vehicle_records import MountedDrive, Vehicle


def vehicle_facts(vehicle: Vehicle, gravity: float) -> dict[str, Any]:
    """Mass, centre of mass, hover, reach and static efforts, and the vehicle's record.

    Raises:
        AllocationError: the rotors cannot be mixed.
    """
    zero = tuple(0.0 for _ in vehicle.links)
    com = center_of_mass(vehicle, [0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], zero)
    found: dict[str, Any] = {
        "vehicle": vehicle.name,
        "gravity_m_s2": gravity,
        "mass_kg": float(vehicle.mass),
        "centre_of_mass_m": [float(each) for each in com],
        "flies": not vehicle.planar,
        "frames": [frame.name for frame in vehicle.frames],
        "tip": vehicle.end_effector or None,
        "rotors": [rotor.name for rotor in vehicle.rotors],
        "tilts": {rotor.name: _tilt(rotor.tilt) for rotor in vehicle.rotors if rotor.tilt is not None},
        "joints": [_joint(link.joint) for link in vehicle.links],
        "drives": [_drive(each) for each in vehicle.drives],
        "battery": None if vehicle.battery is None else record_facts(vehicle.battery),
        "bodies": [_body(name, body) for name, body in _bodies(vehicle)],
        "hover": _hover(vehicle, gravity) if vehicle.rotors else None,
        "reach_m": None,
        "static_efforts": {},
        "sources": dict(vehicle.sources),
        "notes": list(vehicle.notes),
    }
    if vehicle.links:
        names = [link.joint.name for link in vehicle.links]
        efforts = map(float, static_torques(vehicle, gravity))
        found["static_efforts"] = dict(zip(names, efforts, strict=True))
        found["static_efforts_over_all_joint_values"] = search_of(vehicle.n, vehicle.n).whole
        if vehicle.end_effector and vehicle.frame().link != BASE:
            found["reach_m"] = float(reach(vehicle))
    return found


def _bodies(vehicle: Vehicle) -> Iterable[tuple[str, Any]]:
    return zip(("base", *(link.name for link in vehicle.moving)), vehicle.bodies, strict=True)


def _body(name: str, body: Any) -> dict[str, Any]:
    inertia = {axes: float(getattr(body.inertia, axes)) for axes in ("xx", "yy", "zz", "xy", "xz", "yz")}
    com = [float(each) for each in body.com]
    return {"name": name, "mass_kg": float(body.mass), "centre_of_mass_m": com, "inertia_kg_m2": inertia}


def _joint(joint: Any) -> dict[str, Any]:
    """Limits and friction; rad and N m of a revolute joint, m and N of a prismatic one."""
    numbers = {name: float(getattr(joint, name)) for name in ("lower", "upper", "effort_limit", "damping", "coulomb")}
    return {"name": joint.name, "kind": joint.kind, "axis": [float(each) for each in joint.axis], **numbers}


def _drive(mounted: MountedDrive) -> dict[str, Any]:
    """Joint, class and numbers of a drive, SI units of its fields."""
    return {"joint": mounted.name, "drive": type(mounted.drive).__name__, **record_facts(mounted.drive)}


def _tilt(tilt: Tilt) -> dict[str, Any]:
    return {**record_facts(tilt), "axis": [float(each) for each in tilt.axis]}


def record_facts(record: Any) -> dict[str, Any]:
    """Fields of a record of numbers, tuples of numbers, words and such records."""
    found: dict[str, Any] = {}
    for name in field_names(record) or ():
        value = getattr(record, name)
        if isinstance(value, tuple):
            found[name] = [float(each) for each in value]
        elif field_names(value):
            found[name] = record_facts(value)
        else:
            found[name] = value if isinstance(value, str | int | float) else float(value)
    return found


def _hover(vehicle: Vehicle, gravity: float) -> dict[str, Any]:
    trim = hover_trim(vehicle, tuple(0.0 for _ in vehicle.links), gravity)
    level = all(float(square) >= 0.0 for square in trim.squared)
    return {
        "possible": level and all(w <= r.max_speed for w, r in zip(trim.speeds, vehicle.rotors, strict=True)),
        "rotor_speeds_rad_s": [float(speed) for speed in trim.speeds] if level else None,
        "thrust_N": float(trim.thrust),
        "highest_thrust_N": float(highest_thrust(vehicle)),
    }


def operations(vehicle: Vehicle) -> Mapping[str, int]:
    """Operations of a vehicle's equations and of a step of its plant."""
    from skyarm.bench.counts import counts

    return dict(counts(vehicle))
