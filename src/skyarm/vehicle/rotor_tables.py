"""Rotors and battery from the checked tables of a vehicle file."""

from __future__ import annotations

from typing import Any

from skyarm.algebra import Vec3
from skyarm.vehicle import description
from skyarm.vehicle.battery import Battery, CellCurve
from skyarm.vehicle.check import VehicleError, refuse
from skyarm.vehicle.schema_tables import BatteryTable, RotorDefaults, RotorTable, ThrustTableTable, TiltTable
from skyarm.vehicle.thrust_table import COLUMNS, ThrustTable
from skyarm.vehicle.tilt import Tilt, arm_direction
from skyarm.vehicle.vehicle_records import Rotor

DIRECTIONS = {"ccw": 1, "cw": -1}


def rotor_of(table: RotorTable, defaults: RotorDefaults) -> Rotor:
    """A rotor whose table leaves to the defaults what it does not state."""
    field = f"rotors[{table.name}]"
    values: dict[str, Any] = {}
    for name in RotorDefaults.model_fields:
        own, default = getattr(table, name), getattr(defaults, name)
        value = default if own is None else own
        if value is not None:
            values[name] = value
    if (columns := values.pop("thrust_table", None)) is not None:
        _take_table(field, columns, values)
    for name in ("thrust_coefficient", "moment_coefficient"):
        if name not in values:
            raise VehicleError(f"{field}.{name} = (missing): must stand here or in rotor_defaults")
    for name in ("moment_coefficient", "drag_coefficient", "rolling_moment_coefficient", "inertia"):
        if name in values:
            values[name] = description.zero_is_structure(values[name])
    values["axis"] = description.unit_axis(f"{field}.axis", values.get("axis", [0.0, 0.0, 1.0]))
    position: Vec3 = description.vector(table.position)
    if (tilt := values.pop("tilt", None)) is not None:
        values["tilt"] = _tilt_of(f"{field}.tilt", tilt, table.position, values["axis"])
    return Rotor(name=table.name, position=position, direction=DIRECTIONS[table.direction], **values)


def _tilt_of(field: str, table: TiltTable, position: list[float], thrust_axis: Vec3) -> Tilt:
    """A rotor's servo; its axis is the arm's direction where the table has none."""
    values = {name: value for name in TiltTable.model_fields if (value := getattr(table, name)) is not None}
    if table.axis is None:
        values["axis"] = arm_direction(field, position, thrust_axis)
    else:
        values["axis"] = description.unit_axis(f"{field}.axis", table.axis)
    return Tilt(**values)


def _require_speeds(throttle: bool, coefficient: bool) -> None:
    """A thrust table without speeds has a throttle, and a thrust coefficient of which its speeds follow.

    Raises:
        VehicleError: what is missing of these.
    """
    if not throttle:
        allowed = "must be a column, rad/s; without it throttle must be one, and the rotor have a thrust_coefficient"
        raise VehicleError(f"thrust_table.speed = (missing): {allowed}")
    if not coefficient:
        allowed = "must be a number, N s^2/rad^2, where thrust_table has no column speed: the speeds follow from it"
        raise VehicleError(f"thrust_coefficient = (missing): {allowed}")


def _take_table(field: str, columns: ThrustTableTable, values: dict[str, Any]) -> None:
    """Put a rotor's thrust table among its values, and the coefficients and the highest speed that follow from it."""
    held: dict[str, Any] = {name: tuple(getattr(columns, name) or ()) for name in COLUMNS}
    try:
        if columns.speed is None:
            _require_speeds(bool(columns.throttle), "thrust_coefficient" in values)
            # a sheet without speeds: those of k_f W^2
            held["speed"] = tuple((thrust / values["thrust_coefficient"]) ** 0.5 for thrust in held["thrust"])
        elif "thrust_coefficient" in values:
            refuse("thrust_coefficient", values["thrust_coefficient"], "must be left out: it follows from thrust_table")
        if held["torque"] and "moment_coefficient" in values:
            refuse("moment_coefficient", values["moment_coefficient"], "must be left out: it follows from thrust_table")
        table = ThrustTable(**held)
    except VehicleError as error:
        raise VehicleError(f"{field}.{error}") from None
    values["table"], values["thrust_coefficient"] = table, table.thrust_coefficient
    if held["torque"]:
        values["moment_coefficient"] = table.moment_coefficient
    values.setdefault("max_speed", table.speed[-1])


def battery_of(table: BatteryTable | None) -> Battery | None:
    """The battery of a file; None where it has none."""
    if table is None:
        return None
    values = {name: getattr(table, name) for name in BatteryTable.model_fields if name != "open_circuit"}
    columns = table.open_circuit
    return Battery(open_circuit=CellCurve(charge=tuple(columns.charge), voltage=tuple(columns.voltage)), **values)
