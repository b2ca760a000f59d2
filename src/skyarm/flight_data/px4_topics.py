"""Meaning of PX4's topics in ULog files and bags: spans over which rates are averaged,
motors that turn both ways.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from skyarm.flight_data.raw_tables import RawTable
from skyarm.flight_data.series import columns_at, integral_of, rotations_between
from skyarm.records.arrays import Array

LATEST = 0.1
"""Largest time (s) between a PX4 message and the sample that it is of for which the
sample's own stamp counts; chosen: more is damage, or no reading."""

BOTH_WAYS = (
    "rotor_commands: are left out, as PX4's motors turn both ways (CA_R_REV); a"
    " columns.toml may map them."
)
"""Note of a log whose motors turn both ways, so that their signals have a sign."""


def is_reversible(motors: RawTable) -> bool:
    """True if PX4's ``actuator_motors`` mark a motor that turns both ways."""
    return bool(motors.columns.get("reversible_flags", np.zeros(1)).any())


def _span(columns: Mapping[str, Array], sensor: str) -> Array:
    """Span (us) of which a number of PX4's ``sensor_combined`` is the mean."""
    span = columns.get(f"{sensor}_integral_dt", 0.0)
    # up to PX4 1.10 in s
    return np.where(np.less(span, 1.0), np.multiply(span, 1e6), span)


def middle_of_mean(columns: Mapping[str, Array], sensor: str) -> Array:
    """Time (us) from the stamp of PX4's ``sensor_combined`` to the middle of the span
    that a sensor's mean is of.

    PX4's VehicleIMU publishes the integral over ``integral_dt`` divided by that span,
    at the stamp of its last sample.
    """
    after = columns.get(f"{sensor}_timestamp_relative", 0.0) - 0.5 * _span(
        columns, sensor
    )
    # a sensor without a reading has 2**31 - 1
    return np.where(np.abs(after) <= LATEST * 1e6, after, np.nan)


APART, CLEARLY = 0.02, 0.9
"""Least time (s) between compared attitudes; ratio of their errors below which the
smaller one is believed."""


def by_attitude(motion: RawTable, attitude: RawTable) -> RawTable:
    """PX4's ``sensor_combined`` at the middles of its spans, or at its stamps if its
    attitude turns by those.

    Simulators and other writers state a span, and give the sample at the stamp: between
    two attitudes the rates add up to the turn of the base either way, and one of both
    errs more.
    """
    names = [f"gyro_rad[{i}]" for i in range(3)], [f"q[{i}]" for i in range(4)]
    if not (motion.has(*names[0]) and attitude.has(*names[1])):
        return motion
    rates, q = (
        np.stack([table.numbers(each) for each in own], axis=1)
        for table, own in ((motion, names[0]), (attitude, names[1]))
    )
    # half of the span over which a rate is the mean, which PX4 states in us
    late = 0.5e-6 * _span(motion.columns, "gyro")
    good, there = np.isfinite(rates).all(axis=1), np.isfinite(q).all(axis=1)
    time, turned = motion.time[good], attitude.time[there]
    late = np.broadcast_to(late, good.shape)[good]
    if len(time) < 3 or not late.any() or (np.diff(time) <= 0.0).any():
        return motion
    angle = integral_of(time, rates[good])
    # 1e-6: attitudes may share a stamp
    step = (
        max(1, round(APART / max(float(np.median(np.diff(turned))), 1e-6)))
        if len(turned) > 1
        else 1
    )
    begin, end = turned[:-step], turned[step:]
    inside = (
        # pairs with a gap of attitudes between them say nothing of a span of 2 ms
        (begin > time[0]) & (end < time[-1] - late.max()) & (end - begin < 5.0 * APART)
    )
    # chosen: fewer pairs of attitudes tell no difference
    if inside.sum() < 10:
        return motion
    turn = rotations_between(q[there][:-step][inside], q[there][step:][inside])

    def error(moved: Array) -> float:
        """Standard deviation (rad) of the turns between attitudes that the rates do not
        explain.
        """
        stamps = time + moved
        last, first = (columns_at(each[inside], stamps, angle) for each in (end, begin))
        return float((turn - (last - first)).std())

    # the middles are PX4's own rule, so the stamps must be clearly better
    if error(late) > CLEARLY * error(np.zeros(len(time))):
        return motion
    columns = dict(motion.columns)
    if "accelerometer_time" in columns:
        columns["accelerometer_time"] = columns["accelerometer_time"] + 0.5e-6 * _span(
            columns, "accelerometer"
        )
    return replace(
        motion, columns=columns, time=motion.time + 0.5e-6 * _span(columns, "gyro")
    )
