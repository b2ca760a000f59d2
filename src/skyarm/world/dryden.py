"""Dryden turbulence below 1000 ft, sampled exactly at any step size.

The filters are not discretised approximately: each component is the autoregressive
sequence whose autocovariance at whole steps *is* the continuous one,

    u: sigma^2 exp(-d|k|)                     (first order, H_u = sigma sqrt(2 T/pi) /
                                              (1 + T s))
    v, w: sigma^2 (1 - d|k|/2) exp(-d|k|)     (second order, H_v = sigma sqrt(T/pi) (1 +
                                              sqrt(3) T s) / (1 + T s)^2)

with T = L/V and d = dt/T, from one normal number per component and step. Variance and
correlation are therefore the same whatever dt is; between steps the velocity is held.
(Band-limited white noise through the held filters, the common way, has a variance that
depends on dt.)

Airspeed: the model is a frozen field carried past the vehicle with the airspeed V. A
hovering multirotor has almost no speed of its own, so V is the speed of the mean wind,
at least ``minimum_airspeed`` (1 m/s, an assumption: without it a calm day would freeze
one draw for the whole episode). V and the altitude are constant through an episode.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated

from skyarm.algebra import E_X, E_Z, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import divide, exp, log, maximum, sqrt, where
from skyarm.records.coerce import concrete, unit_vector
from skyarm.records.field_rules import accept_fields
from skyarm.records.immutable import immutable, positional
from skyarm.records.units import Unit, nonnegative, positive

METRES_PER_FOOT = 0.3048
LOWEST, HIGHEST = 10 * METRES_PER_FOOT, 1000 * METRES_PER_FOOT
"""Range of altitudes (m) of the low-altitude turbulence model."""


@immutable
class Dryden:
    """Parameters of Dryden turbulence: intensities, length scales, airspeed and
    direction.

    The components are u (along the mean wind), v (to its left) and w (up). Their scale
    lengths are those of MIL-F-8785C (MIL-HDBK-1797 halves L_v and L_w and doubles them
    again in its spectra: the same turbulence).
    """

    intensity: Annotated[
        Vec3,
        nonnegative(
            "m/s",
            "standard deviation of the air velocity u, v, w",
            effect="higher values make stronger turbulence",
        ),
    ]
    scale_length: Annotated[
        Vec3,
        positive(
            "m",
            "length scale of the turbulence u, v, w",
            effect="longer scales make slower gusts",
        ),
    ]
    airspeed: Annotated[
        Scalar,
        positive(
            "m/s",
            "speed at which the turbulence passes the vehicle",
            effect="higher speeds make faster gusts",
        ),
    ]
    direction_W: Annotated[
        Vec3,
        Unit("", "horizontal unit vector of the component u, world axes", folds=True),
    ] = E_X
    least_airspeed: Annotated[
        Scalar,
        nonnegative(
            "m/s",
            "least airspeed where airspeed and direction follow the mean wind; 0"
            " where not",
        ),
    ] = 0

    def __post_init__(self) -> None:
        accept_fields(self, "turbulence")
        along = unit_vector("turbulence.direction_W", self.direction_W)
        object.__setattr__(self, "direction_W", along)

    def in_wind(self, velocity_W: Vec3) -> Dryden:
        """Turbulence that passes at the speed of a mean wind (m/s, world axes), its
        component u along the wind.
        """
        x, y, z = velocity_W
        level = sqrt(x * x + y * y)
        # in calm air the direction is x, as in a file
        blows = level > 0.0
        length = where(level > 0.0, level, 1.0)
        along = Vec3(
            where(blows, divide(x, length), 1.0),
            where(blows, divide(y, length), 0.0),
            0,
        )
        speed = maximum(sqrt(x * x + y * y + z * z), self.least_airspeed)
        return replace(self, airspeed=speed, direction_W=along)


@positional
class DrydenMemory:
    """State of the turbulence filters, in standard deviations of the velocity
    components u, v and w.
    """

    u: Scalar
    v: Scalar
    w: Scalar
    v_inner: Scalar
    w_inner: Scalar


def low_altitude(
    altitude: Scalar,
    wind_20ft: Scalar,
    mean_wind: Scalar,
    direction_W: Vec3 = E_X,
    minimum_airspeed: Scalar = 1.0,
) -> Dryden:
    """Dryden turbulence parameters near the ground, from altitude and wind speed.

    Args:
        altitude: above ground, m, 3.048 to 304.8 (10 to 1000 ft); for lower flight take
            3.048.
        wind_20ft: W20, mean wind at 20 ft, m/s: 7.7 light, 15.4 moderate, 23.2 severe.
        mean_wind: speed of the mean wind at the vehicle, m/s.
        direction_W: horizontal unit vector of the mean wind.
        minimum_airspeed: smallest V, m/s.

    Raises:
        ValueError: a number outside its range.
    Source: MIL-F-8785C 1980, section 3.7.3.4, figures 10 and 11 (h in feet):
        L_w = h, L_u = L_v = h / (0.177 + 0.000823 h)^1.2, sigma_w = 0.1 W20,
        sigma_u = sigma_v = sigma_w / (0.177 + 0.000823 h)^0.4.
    """
    _within("altitude", altitude, LOWEST, HIGHEST, "m (10 to 1000 ft)")
    _within("wind_20ft", wind_20ft, 0.0, math.inf, "m/s")
    # time constants of the filters are lengths over airspeed
    _within("minimum_airspeed", minimum_airspeed, 1e-3, math.inf, "m/s")
    # powers by log and exp: scalars have no others
    shape = log(0.177 + 0.000823 * (altitude / METRES_PER_FOOT))
    horizontal_length = altitude * exp(-1.2 * shape)
    vertical = 0.1 * wind_20ft
    horizontal = vertical * exp(-0.4 * shape)
    return Dryden(
        intensity=Vec3(horizontal, horizontal, vertical),
        scale_length=Vec3(horizontal_length, horizontal_length, altitude),
        airspeed=maximum(mean_wind, minimum_airspeed),
        direction_W=direction_W,
        least_airspeed=minimum_airspeed,
    )


def start(first: Vec3, second: Vec3, dt: Scalar, *, par: Dryden) -> DrydenMemory:
    """Initial state of the turbulence filters, drawn from their stationary
    distribution.

    Args:
        first: standard normal numbers.
        second: further numbers, independent of the first (second.x is not used).
        dt: step of the sequence, s.
        par: the turbulence.
    """
    output = []
    for d, n, m in zip(
        _steps(par, dt)[1:], tuple(first)[1:], tuple(second)[1:], strict=True
    ):
        a, b, gain, h = _second_order(d)
        # that of output and inner state, the same a step later: r = a^2 r + a h + b
        # gain
        correlation = divide(a * h + b * gain, gain * gain)
        output.append(
            # rounding of a very short step may lift the correlation above 1
            correlation * n + sqrt(maximum(1.0 - correlation * correlation, 0.0)) * m
        )
    v, w = output
    return DrydenMemory(first.x, v, w, first.y, first.z)


def step(
    memory: DrydenMemory, noise: Vec3, dt: Scalar, *, par: Dryden
) -> tuple[DrydenMemory, Vec3]:
    """Advance the turbulence by one step; return the filter state and the velocity.

    Args:
        memory: from :func:`start` or the previous step.
        noise: independent standard normal numbers.
        dt: s, the same at every step.
        par: the turbulence.

    Returns:
        memory, and the turbulence velocity in world axes, m/s.
    Source: spectra of MIL-F-8785C 1980, section 3.7.1.2; sampled exactly by factoring
    the autocovariance.
    """
    d_u, d_v, d_w = _steps(par, dt)
    a = exp(-d_u)
    u = a * memory.u + sqrt(1.0 - a * a) * noise.x
    v, v_inner = _advance(memory.v, memory.v_inner, noise.y, d_v)
    w, w_inner = _advance(memory.w, memory.w_inner, noise.z, d_w)
    following = DrydenMemory(u, v, w, v_inner, w_inner)
    return following, velocity(following, par=par)


def velocity(memory: DrydenMemory, *, par: Dryden) -> Vec3:
    """Turbulence velocity (m/s, world axes) for a state of the turbulence filters."""
    sigma = par.intensity
    left = E_Z.cross(par.direction_W)
    along = par.direction_W * (sigma.x * memory.u)
    across = left * (sigma.y * memory.v)
    return along + across + E_Z * (sigma.z * memory.w)


def _steps(par: Dryden, dt: Scalar) -> Scalars:
    """Dimensionless step size d = dt V / L of each turbulence velocity component."""
    return tuple(divide(dt * par.airspeed, length) for length in par.scale_length)


def _advance(
    output: Scalar, inner: Scalar, noise: Scalar, d: Scalar
) -> tuple[Scalar, Scalar]:
    """One step of a second-order shaping filter with unit variance."""
    a, b, gain, h = _second_order(d)
    return a * output + b * noise + h * inner, a * inner + gain * noise


def _second_order(d: Scalar) -> tuple[Scalar, Scalar, Scalar, Scalar]:
    """Coefficients of the discrete filter whose autocovariance is (1 - d|k|/2)
    exp(-d|k|).

    The sequence is (1 - a z)^2 y = b (1 + c z) n with z one step back. Its numerator's
    autocovariance is g0 = 1 - a^4 + 2 a^2 d and g1 = -a ((1 - a^2) + (1 + a^2) d/2);
    both combinations factor,

    g0 + 2 g1 = (1 - a)^2 (1 - a^2 - a d) = b^2 (1 + c)^2,
    g0 - 2 g1 = (1 + a)^2 (1 - a^2 + a d) = b^2 (1 - c)^2,

    which gives b and c without cancellation. The inner state has unit variance.
    """
    a = exp(-d)
    rest = 1.0 - a * a
    small = sqrt(rest - a * d)
    b = 0.5 * ((1.0 - a) * small + (1.0 + a) * sqrt(rest + a * d))
    gain = sqrt(rest)
    return a, b, gain, divide((1.0 - a) * (small - b), gain)


def _within(name: str, value: Scalar, low: float, high: float, unit: str) -> None:
    if concrete(value) and not low <= value <= high:
        raise ValueError(f"{name} = {value!r}: must be from {low:g} to {high:g} {unit}")
