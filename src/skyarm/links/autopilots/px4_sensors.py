"""Sensor messages of PX4's simulator port: HIL_SENSOR and HIL_GPS from the readings of our sensors.

Axes of the wire are forward, right, down and north, east, down; ours are forward, left, up and north, west, up.
Units of the wire: m/s^2, rad/s, gauss, hPa, m, degrees Celsius; HIL_GPS has whole numbers of 1e-7 deg, mm and cm/s.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from skyarm.links.autopilots.autopilot import Numbers
from skyarm.links.geodesy import Geodetic, to_geodetic

HOME: Geodetic = (47.397742, 8.545594, 488.0)
"""Latitude and longitude (deg) and altitude (m) of the world's origin: PX4's usual place, near Zurich."""

INERTIAL, MAGNETIC, AIR = 0b111_111, 0b111_000_000, 0b1_101_000_000_000
"""Bits of ``fields_updated``: gyroscope and accelerometer; magnetometer; pressure, its altitude and temperature."""

LONGEST_SHORT, LONGEST_INT = 32767, 2**31 - 1

Fields = dict[str, float]


def pressure_altitude(pressure: float) -> float:
    """Altitude above mean sea level of a pressure (hPa) in the standard atmosphere's troposphere, m (ICAO Doc 7488)."""
    return float(44330.77 * (1.0 - (max(pressure, 0.0) / 1013.25) ** 0.1902632))


class SensorMessages:
    """Fields of the sensor messages: each reading is sent once, when it is new.

    Attributes:
        fix: position of the last satellite reading, north west up, m.
    """

    def __init__(self) -> None:
        self._last = {"magnetometer": -1.0, "barometer": -1.0, "gnss": -1.0}
        self.fix = (0.0, 0.0, 0.0)

    def inertial(self, readings: Mapping[str, Numbers]) -> Fields:
        """Fields of HIL_SENSOR: the inertial reading, and the magnetic field and pressure where they are new."""
        _, p, q, r, fx, fy, fz = readings["imu"]
        updated = INERTIAL
        fields = {
            "xgyro": p, "ygyro": -q, "zgyro": -r, "xacc": fx, "yacc": -fy, "zacc": -fz, "temperature": 20.0,
        }  # fmt: skip
        read, mx, my, mz = readings["magnetometer"]
        if self._is_new("magnetometer", read):
            updated |= MAGNETIC
            fields |= {"xmag": mx, "ymag": -my, "zmag": -mz}
        read, pressure, temperature = readings["barometer"]
        if self._is_new("barometer", read):
            updated |= AIR
            altitude = pressure_altitude(pressure)
            fields |= {"abs_pressure": pressure, "pressure_alt": altitude, "temperature": temperature}
        return fields | {"fields_updated": updated}

    def satellite(self, readings: Mapping[str, Numbers]) -> Fields | None:
        """Fields of HIL_GPS; None without a new reading. Values that the wire cannot carry are cut off.

        Raises:
            ValueError: a position that is not finite.
        """
        read, x, y, z, vx, vy, vz = readings["gnss"]
        if not self._is_new("gnss", read):
            return None
        self.fix = (x, y, z)
        latitude, longitude, altitude = to_geodetic(x, -y, z, HOME)
        speed, course = math.hypot(vx, vy), math.degrees(math.atan2(-vy, vx)) % 360.0
        return {
            "fix_type": 3,
            "lat": round(latitude * 1e7),
            "lon": round(longitude * 1e7),
            "alt": _whole(altitude * 1e3, LONGEST_INT),
            "eph": 2,
            "epv": 3,
            "vel": _whole(speed * 100, LONGEST_SHORT),
            "vn": _whole(vx * 100, LONGEST_SHORT),
            "ve": _whole(-vy * 100, LONGEST_SHORT),
            "vd": _whole(-vz * 100, LONGEST_SHORT),
            "cog": round(course * 100) % 36000,
            "satellites_visible": 14,
        }

    def _is_new(self, name: str, read: float) -> bool:
        """True where a reading is later than the last one that was sent."""
        if read <= self._last[name]:
            return False
        self._last[name] = read
        return True


def _whole(value: float, most: int) -> int:
    """Nearest whole number, cut off at the largest that the wire carries."""
    return round(min(max(value, -most), most))
