"""What a log's commands to the joints are: torques and forces, or setpoints of drives that take something else."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from skyarm.actuation.drive import TorqueDrive
from skyarm.records.restore import restore


def setpoints_of(info: Mapping[str, Any]) -> dict[str, str]:
    """Unit of the setpoint of each joint that takes no torque, by the joint's name.

    Args:
        info: of a log, which keeps the scenario that was flown.

    Returns:
        units as ``rad or m``, of a revolute and of a prismatic joint; empty where a drive of someone's own states none,
        or its plugin is not loaded.
    """
    record = _table(info.get("scenario_record"))
    carried = _rows(_table(_table(record.get("world")).get("vehicle")).get("drives"))
    # the scenario's own drive of a joint wins over the vehicle's
    given = {each.get("name"): each.get("drive") for each in carried}
    given |= {each.get("joint"): each.get("drive") for each in _rows(record.get("drives"))}
    found = {}
    for joint, drive in given.items():
        try:
            made = restore(drive, info.get("plugins"))
        except (ValueError, TypeError, KeyError, AttributeError):
            made = None
        if isinstance(joint, str) and not isinstance(made, TorqueDrive):
            takes = getattr(made, "takes", "")
            found[joint] = takes if isinstance(takes, str) else ""
    return found


def _rows(data: Any) -> list[Mapping[str, Any]]:
    return [_table(each) for each in data] if isinstance(data, list) else []


def _table(data: Any) -> Mapping[str, Any]:
    return data if isinstance(data, dict) else {}
