"""Sensor messages of PX4's simulator port: HIL_SENSOR and HIL_GPS from the readings of
our sensors.

Axes of the wire are forward, right, down and north, east, down; ours are forward, left,
up and north, west, up. Units of the wire: m/s^2, rad/s, gauss, hPa, m, degrees Celsius;
HIL_GPS has whole numbers of 1e-7 deg, mm and cm/s.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from skyarm.algebra.frames import to_our_axes
from skyarm.links.autopilots.autopilot import Numbers

SEMI_MAJOR_AXIS = 6378137.0
"""Equatorial radius (m) of the ellipsoid WGS 84."""

FLATTENING = 1.0 / 298.257223563
"""Flattening of the ellipsoid WGS 84, (a - b) / a."""

ECCENTRICITY_2 = FLATTENING * (2.0 - FLATTENING)
"""Square of the first eccentricity, (a^2 - b^2) / a^2."""

BOWRING_STEPS = 2
"""Steps of Bowring's formula: one errs by 1e-13 degrees at 1 km and 5e-8 at 1000 km,
two by rounding."""

Geodetic = tuple[float, float, float]
"""Latitude (degrees, north positive), longitude (degrees, east positive), height above
the ellipsoid (m)."""


def to_geodetic(north: float, east: float, up: float, origin: Geodetic) -> Geodetic:
    """Latitude, longitude (degrees) and height (m) of a point given in the local
    tangent plane of an origin.

    Args:
        north: m, coordinate of the point in the tangent plane at ``origin``.
        east: m, likewise.
        up: m, likewise, along the ellipsoid's normal.
        origin: latitude and longitude in degrees and height in m of the plane's origin.

    Returns:
        Latitude in -90 to 90 degrees, longitude in -180 to 180 degrees, height above
        the ellipsoid in m.

    Raises:
        ValueError: one line: a coordinate that is not finite.
    """
    if not all(map(math.isfinite, (north, east, up))):
        raise ValueError(
            f"position = [{north:g}, {east:g}, {up:g}]: must be finite numbers, m"
            " north, east and up"
        )
    latitude, longitude = math.radians(origin[0]), math.radians(origin[1])
    sin_lat, cos_lat = math.sin(latitude), math.cos(latitude)
    sin_lon, cos_lon = math.sin(longitude), math.cos(longitude)
    x, y, z = to_earth_fixed(origin)
    # from the Earth's axis, in the meridian of the origin
    outwards = cos_lat * up - sin_lat * north
    return from_earth_fixed(
        x + cos_lon * outwards - sin_lon * east,
        y + sin_lon * outwards + cos_lon * east,
        z + sin_lat * up + cos_lat * north,
    )


def to_earth_fixed(point: Geodetic) -> tuple[float, float, float]:
    """Earth-centred, Earth-fixed coordinates (m) of a point given by latitude,
    longitude (degrees) and height (m).
    """
    latitude, longitude = math.radians(point[0]), math.radians(point[1])
    sin_lat = math.sin(latitude)
    # radius across the meridian
    normal = SEMI_MAJOR_AXIS / math.sqrt(1.0 - ECCENTRICITY_2 * sin_lat * sin_lat)
    outwards = (normal + point[2]) * math.cos(latitude)
    height = (normal * (1.0 - ECCENTRICITY_2) + point[2]) * sin_lat
    return outwards * math.cos(longitude), outwards * math.sin(longitude), height


def from_earth_fixed(x: float, y: float, z: float) -> Geodetic:
    """Latitude, longitude (degrees) and height (m) of a point in Earth-centred,
    Earth-fixed axes (m).
    """
    outwards, short = math.hypot(x, y), 1.0 - FLATTENING
    # of the parametric latitude, as sine and cosine but for a factor
    tangent = (z, short * outwards)
    latitude = 0.0
    for _ in range(BOWRING_STEPS):
        size = math.hypot(*tangent)
        s, c = tangent[0] / size, tangent[1] / size
        sine = z + ECCENTRICITY_2 / short * SEMI_MAJOR_AXIS * s * s * s
        cosine = outwards - ECCENTRICITY_2 * SEMI_MAJOR_AXIS * c * c * c
        latitude = math.atan2(sine, cosine)
        tangent = (short * sine, cosine)
    sin_lat = math.sin(latitude)
    ellipsoid = SEMI_MAJOR_AXIS * math.sqrt(1.0 - ECCENTRICITY_2 * sin_lat * sin_lat)
    # not p / cos(latitude) - N, which is singular at the poles
    height = outwards * math.cos(latitude) + z * sin_lat - ellipsoid
    return math.degrees(latitude), math.degrees(math.atan2(y, x)), height


HOME: Geodetic = (47.397742, 8.545594, 488.0)
"""Latitude and longitude (deg) and altitude (m) of the world's origin: PX4's usual
place, near Zurich."""

INERTIAL, MAGNETIC, AIR = 0b111_111, 0b111_000_000, 0b1_101_000_000_000
"""Bits of ``fields_updated``: gyroscope and accelerometer; magnetometer; pressure, its
altitude and temperature."""

LONGEST_SHORT, LONGEST_INT = 32767, 2**31 - 1

Fields = dict[str, float]


def pressure_altitude(pressure: float) -> float:
    """Altitude (m) above mean sea level for a pressure (hPa) in the standard atmosphere
    (ICAO Doc 7488).
    """
    return float(44330.77 * (1.0 - (max(pressure, 0.0) / 1013.25) ** 0.1902632))


class SensorMessages:
    """Fields of PX4's sensor messages; each reading is sent once, when it is new.

    Attributes:
        fix: position of the last satellite reading, north west up, m.
    """

    def __init__(self) -> None:
        # nothing of the sensors' time is known at first, and time begins at 0
        self._last = {"magnetometer": -1.0, "barometer": -1.0, "gnss": -1.0}
        self.fix = (0.0, 0.0, 0.0)

    def inertial(self, readings: Mapping[str, Numbers]) -> Fields:
        """Fields of HIL_SENSOR: inertial reading, and magnetic field and pressure if
        they are new.
        """
        imu, updated = readings["imu"], INERTIAL
        # behind the time stand rate and specific force
        rate, force = to_our_axes(*imu[1:4]), to_our_axes(*imu[4:7])
        names = ("xgyro", "ygyro", "zgyro", "xacc", "yacc", "zacc")
        # 20 degrees Celsius, chosen, until a barometer tells
        fields = dict(zip(names, (*rate, *force), strict=True), temperature=20.0)
        read, *field = readings["magnetometer"]
        if self._is_new("magnetometer", read):
            updated |= MAGNETIC
            fields |= dict(
                zip(("xmag", "ymag", "zmag"), to_our_axes(*field), strict=True)
            )
        read, pressure, temperature = readings["barometer"]
        if self._is_new("barometer", read):
            updated |= AIR
            altitude = pressure_altitude(pressure)
            fields |= {
                "abs_pressure": pressure,
                "pressure_alt": altitude,
                "temperature": temperature,
            }
        return fields | {"fields_updated": updated}

    def satellite(self, readings: Mapping[str, Numbers]) -> Fields | None:
        """Fields of HIL_GPS, clipped to the ranges of the message; None without a new
        reading.

        Raises:
            ValueError: a position that is not finite.
        """
        read, x, y, z, vx, vy, vz = readings["gnss"]
        if not self._is_new("gnss", read):
            return None
        self.fix = (x, y, z)
        north, east, _ = to_our_axes(x, y, z)
        latitude, longitude, altitude = to_geodetic(north, east, z, HOME)
        vn, ve, vd = to_our_axes(vx, vy, vz)
        speed, course = math.hypot(vn, ve), math.degrees(math.atan2(ve, vn)) % 360.0
        return {
            # a position in three dimensions
            "fix_type": 3,
            "lat": round(latitude * 1e7),
            "lon": round(longitude * 1e7),
            "alt": _whole(altitude * 1e3, LONGEST_INT),
            # accuracies and number of satellites of a good receiver, chosen
            "eph": 2,
            "epv": 3,
            "vel": _whole(speed * 100, LONGEST_SHORT),
            "vn": _whole(vn * 100, LONGEST_SHORT),
            "ve": _whole(ve * 100, LONGEST_SHORT),
            "vd": _whole(vd * 100, LONGEST_SHORT),
            # a course of 359.999 degrees rounds to 360, which the message writes as 0
            "cog": round(course * 100) % 36000,
            "satellites_visible": 14,
        }

    def _is_new(self, name: str, read: float) -> bool:
        """True if a reading is later than the last one sent."""
        if read <= self._last[name]:
            return False
        self._last[name] = read
        return True


def _whole(value: float, most: int) -> int:
    """Round to a whole number, clipped to the largest that the message can carry."""
    return round(min(max(value, -most), most))
