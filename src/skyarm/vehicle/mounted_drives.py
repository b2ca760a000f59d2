"""The drives that a vehicle carries: tables [drives.JOINT] of its file, or [model.drives.JOINT] of a scenario."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import replace
from typing import Any

from skyarm.records.coerce import concrete
from skyarm.records.read_table import registered_from
from skyarm.vehicle.check import VehicleError
from skyarm.vehicle.linkage import Link
from skyarm.vehicle.vehicle_records import MountedDrive


def mounted_drives(tables: Mapping[str, Any], where: str) -> tuple[MountedDrive, ...]:
    """Drives of tables by the joint's name, each with the ``kind`` under which it is registered and its numbers.

    Raises:
        VehicleError: one line with field, value and what is allowed.
    """
    try:
        read = {joint: registered_from("drive", object, table, f"{where}.{joint}") for joint, table in tables.items()}
    except ValueError as error:
        raise VehicleError(str(error)) from None
    return tuple(MountedDrive(name=joint, drive=drive) for joint, drive in read.items())


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
