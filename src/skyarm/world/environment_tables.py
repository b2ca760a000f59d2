"""Wind models from tables of a scenario file.

A wind has a mode::

    [environment.wind]
    mode = "force_wind"              # newtons and metres per second apart, as RotorS's plugin
    force = [2, 0, 0]                  # N, world axes (default 0)
    point = [0, 0, 0]                  # m, where it acts on the base (default: its origin)
    air_velocity = [2, 0, 0]           # m/s that the rotors feel (default 0)
    gust = { force = [2, 0, 0], start = 7.5, duration = 3 }   # or a list of gusts, which add up

    [environment.wind]
    mode = "moving_air"                  # air velocity; forces follow from drag
    velocity = [5, 0, 0]               # m/s, world axes (default 0)
    gust = { velocity = [0, 3, 0], start = 5, duration = 2, shape = "one_minus_cosine" }   # or "step", the default
    turbulence = { altitude = 6, wind_20ft = 7.7 }   # Dryden; minimum_airspeed (1 m/s)

    [environment.wind]
    mode = "none"

The turbulence's u axis lies along the horizontal mean wind (world x in calm air). A wrong table raises ValueError with
one line: field, value, what is allowed.
"""

from __future__ import annotations

import math
from typing import Any

from skyarm.algebra import E_X, Vec3
from skyarm.records.files import Fields
from skyarm.world.dryden import HIGHEST, LOWEST, Dryden, low_altitude
from skyarm.world.gust import SHAPES, Gust
from skyarm.world.wind import NO_WIND, ForceWind, MovingAir, Wind

_ZERO = (0.0, 0.0, 0.0)


def wind_from(table: dict[str, Any], where: str) -> Wind:
    """Wind model from the table ``[environment.wind]`` of a scenario file.

    Args:
        table: plain dict, as read from TOML.
        where: file and table, put before the field in messages: "case3_wind.toml: environment.wind".

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    fields = Fields(table, where)
    mode = fields.choice("mode", ("none", "force_wind", "moving_air"))
    wind = {"none": _none, "force_wind": _force_wind, "moving_air": _moving_air}[mode](fields)
    fields.done()
    return wind


def _none(_fields: Fields) -> Wind:
    return NO_WIND


def _force_wind(fields: Fields) -> Wind:
    return ForceWind(
        force_W=_vector(fields, "force", _ZERO),
        point_B=_vector(fields, "point", _ZERO),
        air_velocity_W=_vector(fields, "air_velocity", _ZERO),
        **_gusts(fields, "force", ("step",)),
    )


def _moving_air(fields: Fields) -> Wind:
    velocity = _vector(fields, "velocity", _ZERO)
    gusts = _gusts(fields, "velocity", SHAPES)
    return MovingAir(velocity_W=velocity, turbulence=_turbulence(fields, velocity), **gusts)


def _gusts(fields: Fields, quantity: str, shapes: tuple[str, ...]) -> dict[str, Any]:
    """Gusts from a wind table, which holds one gust or a list."""
    table = fields.take("gust", None)
    if table is None:
        return {}
    if isinstance(table, list):
        at = f"{fields.where}.gust"
        return {"gusts": tuple(_gust(each, f"{at}[{i}]", quantity, shapes) for i, each in enumerate(table))}
    return {"gust": _gust(table, f"{fields.where}.gust", quantity, shapes)}


def _gust(table: Any, where: str, quantity: str, shapes: tuple[str, ...]) -> Gust:
    inner = Fields(table, where)
    gust = Gust(
        peak=_vector(inner, quantity),
        start=inner.number("start"),
        duration=inner.number("duration", low=0.0, strict=True),
        shape=inner.choice("shape", shapes, "step"),
    )
    inner.done()
    return gust


def _turbulence(fields: Fields, velocity: Vec3) -> Dryden | None:
    table = fields.take("turbulence", None)
    if table is None:
        return None
    inner = Fields(table, f"{fields.where}.turbulence")
    altitude = inner.number("altitude", low=LOWEST)
    if altitude > HIGHEST:
        raise ValueError(f"{inner.where}.altitude = {altitude!r}: must be at most {HIGHEST:g} m (1000 ft)")
    wind_20ft = inner.number("wind_20ft", low=0.0)
    minimum = inner.number("minimum_airspeed", 1.0, low=0.0, strict=True)
    inner.done()
    x, y, z = velocity
    horizontal = math.hypot(x, y)
    direction = Vec3(x / horizontal, y / horizontal, 0) if horizontal > 0.0 else E_X
    return low_altitude(altitude, wind_20ft, math.hypot(x, y, z), direction, minimum)


def _vector(fields: Fields, name: str, *default: Any) -> Vec3:
    """Read a vector whose exact zeros become integers, which are constants of compiled code."""
    return Vec3(*(0 if value == 0.0 else value for value in fields.vector(name, *default)))
