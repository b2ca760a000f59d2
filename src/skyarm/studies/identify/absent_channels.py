"""Cost of unlogged channels: by how much confidence intervals of parameters would be narrower with them.

A fit to windows gives the information of what was measured. That of a pose beside it follows from the slopes of the
flown windows and a usual noise; of joints' efforts that are known, their hat functions are no longer free.
"""

from __future__ import annotations

import copy
import dataclasses
import math

import numpy as np

from skyarm.flight_data.flight_data import Channel
from skyarm.records.arrays import Array
from skyarm.studies.identify.window_errors import WindowErrors
from skyarm.studies.identify.window_fit import WindowFit, loose_with, reduce, variances_of
from skyarm.studies.identify.windows import Clocked

NOISE, PERIOD = {"position": 0.001, "quaternion": 0.002}, 0.01
"""Noise (m, rad) and sampling time (s) assumed for a pose that is not measured: those of motion capture."""

KNOWN = 1e-3
"""Fraction of the prior information that an effort keeps if it is not logged: practically none."""


def costs_of_absent(errors: WindowErrors, fit: WindowFit, rows: Array) -> dict[str, Array]:
    """Ratios (K,) of confidence intervals without a channel to those with it, by the name of each unlogged channel.

    Args:
        errors: errors of all windows.
        fit: fit to them.
        rows: (K, P) slopes of the reported numbers in the searched ones.
    """
    prior = np.array([each.spread for each in errors.unknowns])
    loose = loose_with(errors, fit.spread)

    def widths(errors: WindowErrors, noise: Array, loose: Array) -> Array:
        _, _, normal = errors.normal(fit.values, fit.states, noise, outlier=math.inf)
        total = reduce(normal, fit.states.beside, loose, prior).total
        return np.sqrt(variances_of(rows, np.asarray(np.linalg.inv(total))))

    absent = [name for name in NOISE if not any(name in each.channels for each in errors.windows.flights)]
    if "quaternion" not in absent and any("velocity" in each.channels for each in errors.windows.flights):
        absent = []  # a position tells nothing beyond the velocity but where the flight was
    if not absent and not errors.unlogged:
        return {}
    costs, measured = dict[str, Array](), widths(errors, fit.noise, loose)
    if absent:
        windows = copy.copy(errors.windows)
        windows.flights = [_with_pose(each, absent) for each in windows.flights]
        more = errors.over(windows)
        more.take_samples(fit.values)
        usual = np.array([[NOISE.get(name, 1.0) for name, _ in more.rows]])
        noise = np.repeat(usual, len(fit.noise), axis=0)
        noise[:, [more.rows.index(row) for row in errors.rows]] = fit.noise
        costs["pose" if "quaternion" in absent else "position"] = measured / widths(more, noise, loose)
    if errors.unlogged:
        effort_knots = np.array([name == "hats" for name, _ in errors.free])
        costs["joint_efforts"] = measured / widths(errors, fit.noise, np.where(effort_knots, KNOWN * loose, loose))
    return costs


def _with_pose(flight: Clocked, absent: list[str]) -> Clocked:
    """Flight with placeholder samples of unlogged channels, of which only the presence matters."""
    time = np.arange(flight.begin, flight.edges[-1], PERIOD)
    rows = {"position": np.zeros((time.size, 3)), "quaternion": np.tile([1.0, 0.0, 0.0, 0.0], (time.size, 1))}
    more = {name: Channel(time=time, values=rows[name], source="absent") for name in absent}
    return dataclasses.replace(flight, channels={**flight.channels, **more})
