"""Which readings the error-state filter finds among those that arrive, and the sensors that must be there for it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from skyarm.sensors.sensor import Sensor
from skyarm.sensors.sensor_kinds import Encoders, Heading, Imu, Pose, Position

NEEDED: Mapping[str, tuple[type, ...]] = {
    "pose": (Pose,),
    "position": (Position,),
    "position_heading": (Position, Heading),
}
"""Sensors of each word of the filter's ``aiding``."""

KINDS: Mapping[type, str] = {Imu: "imu", Pose: "pose", Position: "position", Heading: "heading", Encoders: "encoders"}
"""Names of the sensors in files."""


def only(kind: type, readings: Mapping[str, Any]) -> Any:
    """The first reading of a kind; None where there is none."""
    return next((each for each in readings.values() if isinstance(each, kind)), None)


def require_filter_sensors(sensors: Mapping[str, Sensor], aiding: str, lag: float, joints: int) -> None:
    """Refuse a scenario whose sensors the filter cannot use.

    Args:
        sensors: beside the full state, by name.
        aiding: of the filter.
        lag: s, by which it lags the present.
        joints: of the vehicle.

    Raises:
        ValueError: one line: a kind of sensor that is missing or there twice, or readings that come too late, or whose
            instant has passed before the inertial unit's reading of it comes.
    """
    found = dict[type, str]()
    needed = (Imu, *NEEDED[aiding], *((Encoders,) if joints else ()))
    for kind in needed:
        names = [name for name, sensor in sensors.items() if isinstance(sensor, kind)]
        if len(names) != 1:
            there = f"{len(names)} of kind {KINDS[kind]!r}"
            raise ValueError(
                f"estimator: needs one sensor of kind {KINDS[kind]!r} ([sensors.NAME] with kind = {KINDS[kind]!r}); "
                f"there {'are' if len(names) != 1 else 'is'} {there}"
            )
        found[kind], sensor = names[0], sensors[names[0]]
        if kind in NEEDED[aiding] and sensor.latency > lag + 1e-9:
            raise ValueError(
                f"estimator.delay_periods: lags {lag:g} s, must be at least sensors.{names[0]}.latency = "
                f"{sensor.latency:g} s, or those readings are never used"
            )
        if kind in NEEDED[aiding] and sensor.latency < sensors[found[Imu]].latency - 1e-9:
            raise ValueError(
                f"sensors.{found[Imu]}.latency = {sensors[found[Imu]].latency:g} s: must be at most sensors."
                f"{names[0]}.latency = {sensor.latency:g} s, or the filter never uses those readings"
            )
