"""Topics of PX4's uXRCE-DDS client for an external control law: message types and
their fields.

Facts of PX4 v1.17 and v1.18: its client publishes below ``/fmu/out`` and reads below
``/fmu/in``, each topic at 100 Hz at most, with times in microseconds of its own clock,
or of the agent's where it synchronises them (``UXRCE_DDS_SYNCT``).
"""

from __future__ import annotations

from collections.abc import Mapping

from skyarm.records.files import shipped_tables

_TABLES = shipped_tables(__file__)

DEFINITIONS: Mapping[str, str] = _TABLES["fields"]
"""Message type -> the fields that are read or sent."""

TYPES: Mapping[str, str] = {
    **DEFINITIONS,
    **{
        kind: f"{DEFINITIONS[kind]}\n{more}"
        for kind, more in _TABLES["further_fields"].items()
    },
}
"""Message type -> its fields in v1.17, by which DDS matches it."""

OUT: Mapping[str, str] = _TABLES["out"]
"""Topic that PX4 publishes -> its type."""

IN: Mapping[str, str] = _TABLES["in"]
"""Topic that PX4 reads -> its type."""

ODOMETRY = "/fmu/out/vehicle_odometry"

COMMAND, ALIVE, MOTORS = (
    "/fmu/in/vehicle_command",
    "/fmu/in/offboard_control_mode",
    "/fmu/in/actuator_motors",
)

MOST_MOTORS = 12
"""Number of motors in a set point."""
