"""Geodetic coordinates of a point given in local north, east and up axes, on the ellipsoid WGS 84.

A simulated world is a plane with an origin; an autopilot's satellite receiver reports latitude, longitude and altitude.
The conversion goes through Earth-centred, Earth-fixed axes (x through longitude 0 on the equator, z through the north
pole) and has no approximation of a small or flat region.

Sources: NGA.STND.0036, 2014 (WGS 84: semi-major axis, flattening); Bowring 1976 (latitude from Cartesian coordinates by
the parametric latitude; its error near the Earth's surface falls below rounding after two steps).
"""

from __future__ import annotations

import math

SEMI_MAJOR_AXIS = 6378137.0
"""m, equatorial radius of the ellipsoid WGS 84."""

FLATTENING = 1.0 / 298.257223563
"""Flattening of the ellipsoid WGS 84, (a - b) / a."""

ECCENTRICITY_2 = FLATTENING * (2.0 - FLATTENING)
"""Square of the first eccentricity, (a^2 - b^2) / a^2."""

BOWRING_STEPS = 2
"""Steps of Bowring's formula: one errs by 1e-13 degrees at 1 km and 5e-8 at 1000 km, two by rounding."""

Geodetic = tuple[float, float, float]
"""Latitude (degrees, north positive), longitude (degrees, east positive), height above the ellipsoid (m)."""


def to_geodetic(north: float, east: float, up: float, origin: Geodetic) -> Geodetic:
    """Latitude, longitude (degrees) and height (m) of a point given in the local tangent plane of an origin.

    Args:
        north: m, coordinate of the point in the tangent plane at ``origin``.
        east: m, likewise.
        up: m, likewise, along the ellipsoid's normal.
        origin: latitude and longitude in degrees and height in m of the plane's origin.

    Returns:
        Latitude in -90 to 90 degrees, longitude in -180 to 180 degrees, height above the ellipsoid in m.

    Raises:
        ValueError: one line: a latitude beyond 90 degrees, or a number that is not finite.
    """
    require_geodetic(origin)
    if not all(map(math.isfinite, (north, east, up))):
        raise ValueError(f"position = [{north:g}, {east:g}, {up:g}]: must be finite numbers, m north, east and up")
    latitude, longitude = math.radians(origin[0]), math.radians(origin[1])
    sin_lat, cos_lat = math.sin(latitude), math.cos(latitude)
    sin_lon, cos_lon = math.sin(longitude), math.cos(longitude)
    x, y, z = to_earth_fixed(origin)
    outwards = cos_lat * up - sin_lat * north  # from the Earth's axis, in the meridian of the origin
    return from_earth_fixed(
        x + cos_lon * outwards - sin_lon * east,
        y + sin_lon * outwards + cos_lon * east,
        z + sin_lat * up + cos_lat * north,
    )


def to_earth_fixed(point: Geodetic) -> tuple[float, float, float]:
    """Earth-centred, Earth-fixed coordinates (m) of a point given by latitude, longitude (degrees) and height (m)."""
    latitude, longitude = math.radians(point[0]), math.radians(point[1])
    sin_lat = math.sin(latitude)
    normal = SEMI_MAJOR_AXIS / math.sqrt(1.0 - ECCENTRICITY_2 * sin_lat * sin_lat)  # radius across the meridian
    outwards = (normal + point[2]) * math.cos(latitude)
    height = (normal * (1.0 - ECCENTRICITY_2) + point[2]) * sin_lat
    return outwards * math.cos(longitude), outwards * math.sin(longitude), height


def from_earth_fixed(x: float, y: float, z: float) -> Geodetic:
    """Latitude, longitude (degrees) and height (m) of a point in Earth-centred, Earth-fixed axes (m)."""
    outwards, short = math.hypot(x, y), 1.0 - FLATTENING
    tangent = (z, short * outwards)  # of the parametric latitude, as sine and cosine but for a factor
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
    height = outwards * math.cos(latitude) + z * sin_lat - ellipsoid
    return math.degrees(latitude), math.degrees(math.atan2(y, x)), height


def require_geodetic(point: Geodetic) -> None:
    """Refuse a latitude beyond 90 degrees and numbers that are not finite.

    Raises:
        ValueError: one line with the value and what is allowed.
    """
    if not (all(map(math.isfinite, point)) and abs(point[0]) <= 90.0):
        given = ", ".join(f"{each:g}" for each in point)
        raise ValueError(
            f"origin = [{given}]: must be a latitude from -90 to 90 degrees, a longitude and a height in m"
        )
