"""The drives that a vehicle carries: tables [drives.JOINT] of its file, or [model.drives.JOINT] of a scenario."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from skyarm.files import Fields
from skyarm.records.read_table import record_from
from skyarm.registry import find
from skyarm.vehicle.check import VehicleError
from skyarm.vehicle.vehicle_records import MountedDrive


def mounted_drives(tables: Mapping[str, Any], where: str) -> tuple[MountedDrive, ...]:
    """Drives of tables by the joint's name, each with the ``kind`` under which it is registered and its numbers.

    Raises:
        VehicleError: one line with field, value and what is allowed.
    """
    try:
        return tuple(_mounted(joint, table, f"{where}.{joint}") for joint, table in tables.items())
    except VehicleError:
        raise
    except ValueError as error:
        raise VehicleError(str(error)) from None


def _mounted(joint: str, table: Any, where: str) -> MountedDrive:
    fields = Fields(table, where)
    kind = find("drive", fields.take("kind"), fields.at("kind"))
    drive = record_from(kind, fields)
    require_stated(kind, table, where)
    return MountedDrive(name=joint, drive=drive)


def require_stated(kind: Any, table: Mapping[str, Any], where: str) -> None:
    """Refuse a drive's table that leaves out what others of its numbers need.

    Raises:
        ValueError: one line with the field.
    """
    check = getattr(kind, "require_stated", None)
    try:
        if check is not None:
            check(table.keys())
    except ValueError as error:
        raise ValueError(f"{where}.{error}") from None
