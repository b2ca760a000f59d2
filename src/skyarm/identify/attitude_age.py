"""How much older the logged attitude is than the logged rates, as of motion capture beside a gyroscope."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from skyarm.identify.needed_forces import control_period
from skyarm.identify.whitened_fit import blocks_of, fit, hermite
from skyarm.log.flight_log import Log

Array = npt.NDArray[np.float64]

LONGEST = 0.1
"""s, age that is looked for, either way."""

STEP = 2.5e-4
"""s, of differences."""

WIDEST = 0.01
"""s, half of an interval beyond which nothing is known."""

STILL = 0.02
"""rad/s, root mean square of the rates below which nothing is asked."""


def attitude_age(log: Log) -> tuple[float, float]:
    """Age of the attitude beyond that of the rates, s, and half of its interval; NaN where the flight does not tell.

    Turns of the attitude from instant to instant are compared with the integral of the rates so much earlier.
    """
    period = control_period(log)
    turned, angle = turns(log.quaternion), np.zeros((len(log.time), 3))
    angle[1:] = np.cumsum(0.5 * (log.rate[1:] + log.rate[:-1]), axis=0) * period
    if float(np.sqrt(np.mean((log.rate - log.rate.mean(axis=0)) ** 2))) < STILL:
        return math.nan, math.nan
    # of the ends no rates are known that are so much older or newer
    edge = round(LONGEST / period) + 1
    inside = slice(edge, len(turned) - edge)
    aim, clock = np.cumsum(turned, axis=0)[inside], log.time[1:][inside]
    between = hermite(log.time, angle, log.rate)

    def left(candidates: Array) -> Array:
        return np.asarray(aim - between(clock - candidates))

    starts = np.arange(-0.9 * LONGEST, LONGEST, 0.01)[:, None]
    bounds = np.array([-LONGEST]), np.array([LONGEST])
    seconds = float(log.time[-1] - log.time[0])
    found = fit(left, aim, starts, bounds, np.array([STEP]), blocks_of(seconds), turned.std(axis=0) + 1e-12)
    half = found.half_width([1.0])
    at_end = abs(found.values[0]) > 0.98 * LONGEST
    return (math.nan, math.nan) if at_end or not half < WIDEST else (float(found.values[0]), half)


def turns(quaternion: Array) -> Array:
    """(N - 1, 3) rotation from each attitude (N, 4) to the next, base axes, rad; twice the vector part of q* q'."""
    unit = quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)
    (w, v), (after_w, after_v) = ((part[:, :1], part[:, 1:]) for part in (unit[:-1], unit[1:]))
    vector = w * after_v - after_w * v - np.cross(v, after_v)
    scalar = w * after_w + (v * after_v).sum(axis=1, keepdims=True)
    turned: Array = 2.0 * np.where(scalar < 0.0, -vector, vector)
    return turned
