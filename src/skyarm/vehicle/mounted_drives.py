"""The drives that a vehicle carries: tables [drives.JOINT] of its file, or [model.drives.JOINT] of a scenario."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import replace
from typing import Any

from skyarm.files import Fields
from skyarm.records.coerce import concrete
from skyarm.records.read_table import record_from
from skyarm.registry import find
from skyarm.vehicle.check import VehicleError
from skyarm.vehicle.linkage import Link
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


def with_limits_of_drives(links: Sequence[Link], drives: Sequence[MountedDrive], stated: Container[str]) -> list[Link]:
    """Links whose joint has a drive and an effort limit of 0, as URDF files write it, limited by what the drive gives.

    Args:
        links: of a vehicle, with joints.
        drives: of the joints.
        stated: names of joints whose limit someone has stated: it stays.
    """
    given = {each.name: each.drive for each in drives if each.name not in stated}
    return [
        replace(link, joint=replace(link.joint, effort_limit=given[link.joint.name].largest_effort()))
        if link.joint.name in given and concrete(link.joint.effort_limit) and link.joint.effort_limit == 0
        else link
        for link in links
    ]


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
