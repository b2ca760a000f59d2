"""Tables of a scenario file that name something registered: air, forces, sensors, an estimator, drives, endings."""

from __future__ import annotations

from typing import Any

from skyarm.actuation.drive import Drive
from skyarm.environment import Component
from skyarm.estimate.estimator import PASS_THROUGH, Estimator
from skyarm.files import Fields, shown
from skyarm.records.read_table import record_from
from skyarm.registry import find
from skyarm.registry.registrations import LOADED_BY
from skyarm.scenario.endings import Ending
from skyarm.scenario.scenario_record import JointDrive, NamedSensor
from skyarm.sensors.sensor import Sensor
from skyarm.vehicle.mounted_drives import require_stated


def registered(kind: str, base: type, table: Any, where: str) -> Any:
    """The record of a table ``{ kind = NAME, numbers ... }``.

    Args:
        kind: of the registry.
        base: class that the registered one must have.
        table: as read.
        where: of it, for messages.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    fields = Fields(table, where)
    name = fields.take("kind")
    found = find(kind, name, fields.at("kind"))
    if not isinstance(found, type) or not issubclass(found, base):
        raise ValueError(f"{fields.at('kind')} = {name!r}: must be registered as a subclass of {base.__name__}")
    record = record_from(found, fields)
    require_stated(found, table, where)
    return record


def _list(fields: Fields, name: str, kind: str, base: type) -> tuple[Any, ...]:
    """Records of a list of tables."""
    tables = fields.take(name, [])
    if not isinstance(tables, list):
        raise ValueError(f"{fields.at(name)} = {shown(tables)}: must be a list of tables")
    return tuple(registered(kind, base, table, f"{fields.at(name)}[{i}]") for i, table in enumerate(tables))


def _named(table: Any, where: str) -> dict[str, Any]:
    if not isinstance(table, dict):
        raise ValueError(f"{where} = {shown(table)}: must be a table of tables by name")
    return table


def components(environment: Fields, name: str, kind: str) -> tuple[Component, ...]:
    """[[environment.air]] or [[environment.forces]]; ``kind`` is the registry's."""
    return _list(environment, name, kind, Component)


def instruments(sensors: dict[str, Any]) -> tuple[NamedSensor, ...]:
    """Those of [sensors] that are tables: sensors by name."""
    return tuple(
        NamedSensor(name=name, sensor=registered("sensor", Sensor, table, f"sensors.{name}"))
        for name, table in sensors.items()
        if isinstance(table, dict)
    )


def estimator(top: Fields) -> Estimator:
    """[estimator], or its kind alone; without it the law is told the full state as it was read."""
    table = top.take("estimator", None)
    table = {"kind": table} if isinstance(table, str) else table
    found: Estimator = PASS_THROUGH if table is None else registered("estimator", Estimator, table, "estimator")
    return found


def drives(plant: Fields) -> tuple[JointDrive, ...]:
    """[plant.drives.JOINT]."""
    tables = _named(plant.take("drives", {}), "plant.drives")
    return tuple(
        JointDrive(joint=joint, drive=registered("drive", Drive, table, f"plant.drives.{joint}"))
        for joint, table in tables.items()
    )


def endings(top: Fields) -> tuple[Ending, ...]:
    """[[endings]]."""
    return _list(top, "endings", "ending", Ending)


def require_plugins(top: Fields) -> None:
    """[plugins] need = [...] of a scenario or study: plugins that must be loaded; a file loads none itself.

    Raises:
        ValueError: one is not loaded, with how to load it.
    """
    from skyarm.registry.plugins import known_names

    table = Fields(top.take("plugins", {}), "plugins")
    needed = table.take("need", [])
    table.done()
    if not isinstance(needed, list) or not all(isinstance(name, str) for name in needed):
        raise ValueError(f"plugins.need = {shown(needed)}: must be a list of names")
    for name in needed:
        if name not in known_names():
            how = LOADED_BY.format(name) if name.endswith(".py") else f"pip install {name}"
            raise ValueError(f"plugins.need = {name!r}: is not loaded; {how}. A file that is read runs no code")
