"""Units and scales of channels: sizes that no flight has, and gains between channels that should be one.

A gain is bounded from below by the regression on one signal and from above by that on the other, whichever of both
bears the noise (R. Frisch, Statistical Confluence Analysis, 1934). It is judged only where both bounds agree. Of an
accelerometer gravity itself is the measure: from hover to hover its mean in axes that do not turn has the size g.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeAlias

import numpy as np

from skyarm.algebra.frames import turn_vectors
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.flight_data.quantities import ONE_G
from skyarm.flight_data.series import common_span, means_of, middle, thin_samples, unit_rows, values_at
from skyarm.records.arrays import Array
from skyarm.studies.identify.data_compatibility import Law, slope_law, slopes_of
from skyarm.vehicle.vehicle_records import Vehicle

REFUSED, WARNED = "refused", "warned"
"""Severities: an identification from such a flight would give wrong numbers; it gives worse ones."""

Found: TypeAlias = tuple[str, str, str, str]
"""Severity, channel, finding, remedy."""

FORCES = {"g": 1.0 / ONE_G, "mg": 1e3 / ONE_G, "cm/s^2": 100.0, "mm/s^2": 1e3}
"""Unit of an accelerometer -> its number for 1 m/s^2."""

FULL = {"percent": 100.0, "a byte": 255.0, "a pulse width from 1000 to 2000 us": 2000.0, "a word of 16 bit": 65535.0}
"""Number of the full signal -> what it is."""

FASTEST = 100.0
"""m/s that no multirotor flies on the median."""

SPIKES = 0.01
"""Of the rows with numbers outside 0 to 1: fewer are spikes, more spoil the flight."""


def wrong_units(flight: FlightData, start: Vehicle) -> Iterator[Found]:
    """Yield the channels whose size no flight has."""
    if "accelerometer" in flight:
        size = float(np.median(np.linalg.norm(flight["accelerometer"].values, axis=1)))
        felt = flight.gravity
        if not 0.5 * felt < size < 2.0 * felt:
            finding = f"is {size:.3g} on the median, of which gravity alone is {felt:.3g} m/s^2"
            for unit, scale in FORCES.items():
                if 0.5 * felt * scale < size < 2.0 * felt * scale:
                    finding += f": it looks like {unit}"
            yield REFUSED, "accelerometer", finding, "state its unit in columns.toml"
    if "rotor_commands" in flight and "rotor_speed_commands" not in flight:
        yield from _wrong_shares(flight["rotor_commands"].values)
    if "voltage" in flight:
        volts = float(np.median(flight["voltage"].values))
        if not 1.0 < volts < 100.0:
            unit = ": it looks like mV" if 1e3 < volts < 1e5 else ""
            yield REFUSED, "voltage", f"is {volts:.4g} V on the median{unit}", "state its unit in columns.toml"
    if "velocity" in flight:
        speed = float(np.median(np.linalg.norm(flight["velocity"].values, axis=1)))
        if speed > FASTEST:
            finding = f"are {speed:.4g} m/s on the median: they look like mm/s"
            yield REFUSED, "velocity", finding, "state its unit in columns.toml"
    yield from _wrong_scales(flight)
    yield from _wrong_joints(flight, start)


def _wrong_shares(share: Array) -> Iterator[Found]:
    """Yield commands that are no shares of the full signal."""
    outside = ((share < -0.05) | (share > 1.05)).any(axis=1)
    low, usual, top = (float(each) for each in np.quantile(share, (0.005, 0.5, 0.995)))
    if not outside.any():
        return
    span = f"{100.0 * outside.mean():.2g} % of the rows are outside 0 to 1, from {share.min():.4g} to {share.max():.4g}"
    for name, full in FULL.items():
        if low > -0.05 * full and 0.05 < usual / full < 1.0 and top <= 1.05 * full and usual > 1.5:
            finding = f"are {usual:.4g} on the median, and a share of the full signal is 0 to 1: they look like {name}"
            yield REFUSED, "rotor_commands", finding, "state low and high in columns.toml"
            return
    severity = REFUSED if outside.mean() > SPIKES else WARNED
    yield severity, "rotor_commands", f"{span}: they are damaged", "cut the flight to sections without such rows"


DEGREES = 180.0 / np.pi


TURNS = 4.0 * np.pi
"""rad that an arm does not reach; one without stops may turn once."""


def _wrong_joints(flight: FlightData, start: Vehicle) -> Iterator[Found]:
    """Yield the joints' positions that no joint of the vehicle reaches."""
    turns = [link.joint.turns for link in start.links]
    for name in ("joint_positions", "joint_commands"):
        if name not in flight or flight[name].values.shape[1] != start.n or not any(turns):
            continue
        top = float(np.quantile(np.abs(flight[name].values[:, turns]), 0.95))
        if top > TURNS:
            finding = f"reach {top:.3g} rad, more than two turns: they look like degrees"
            yield REFUSED, name, finding, "state their unit in columns.toml"


PAIRS = (("velocity", "position"), ("joint_rates", "joint_positions"))
"""A channel, and the one that it is the derivative of."""

SCALES = {
    DEGREES: "deg/s",
    1e3: "mm/s",
    100.0: "cm/s",
    1.0 / DEGREES: "rad/s of deg",
    1e-3: "m/s of mm",
    1e-2: "m/s of cm",
}
"""Factor of a rate over the derivative of its position -> unit of both."""


def _wrong_scales(flight: FlightData) -> Iterator[Found]:
    """Yield rates that are a multiple of the derivative of their positions."""
    for rate, place in PAIRS:
        if rate not in flight or place not in flight:
            continue
        positions, rates = flight[place], flight[rate]
        if positions.values.shape[1] != rates.values.shape[1] or positions.time.size < 100:
            continue
        time, rows = thin_samples(positions, 0.1)
        pair = values_at(rates, middle(time)), slopes_of(time, rows)
        sizes = [float(np.median(np.abs(each - np.median(each, axis=0)))) for each in pair]
        if min(sizes) <= 0.0:
            continue
        factor = sizes[0] / sizes[1]
        for scale, unit in SCALES.items():
            if abs(np.log(factor / scale)) < np.log(2.0):
                finding = f"are {factor:.3g} times the slope of {place}: they look like {unit}"
                yield REFUSED, rate, finding, "state the units of both in columns.toml"
                break


OFF = 0.05
"""Relative error of a scale beyond which a flight is refused; sensors' own scales are within 3 %."""

FIRM = 0.97
"""Least multiple correlation of a row whose gain is judged: its bounds are within 6 % then."""

OFTEN = 40.0
"""Hz, least rate of channels whose gain is judged: below, a vehicle turns between samples."""

UNITS = (0.4, 2.5)
"""Scales of an accelerometer beyond which its size alone tells another unit."""

HOVERING = 2.0
"""m/s, by which the vertical velocity of a flight in the air may change where none is measured."""

PIECE, TURN_STEP = 8.0, 0.01
"""s, of a flight whose rates are summed up to a rotation, before the gyro drifts; and s, of one step of it."""


def firm_gain(law: Law) -> float:
    """Gain of the measured signal of a law over its inputs; 1 where none is firm, or where 1 is within its bounds."""
    firm = law.visible & (law.explained >= FIRM)
    if not firm.any():
        return 1.0
    low, high = (float(np.median(each[firm])) for each in (law.gains, law.ratios / law.explained))
    return low if low > 1.0 else high if high < 1.0 else 1.0


def is_off(scale: float, tolerance: float = OFF) -> bool:
    """True if a scale that should be 1 is farther off than the tolerance, in either direction."""
    return not 1.0 / (1.0 + tolerance) <= scale <= 1.0 + tolerance


RATE_UNITS = {"deg/s": 180.0 / np.pi, "mrad/s": 1e3, "rad/s read as deg/s": np.pi / 180.0, "rad/s read as mrad/s": 1e-3}
UNIT = "state its unit in columns.toml"
CLOCK = "check its unit and scale, and the unit of the times"


def scale_of_rates(flight: FlightData, rates: Law) -> Iterator[Found]:
    """Yield a gyro whose rates are a multiple of the attitude's: another unit, scale or time base."""
    seen = rates.visible
    if not seen.any():
        return
    scale = 1.0 / float(np.median(rates.gains[seen]))
    if 0.5 < scale < 2.0:
        often = min(flight["gyro"].rate, flight["quaternion"].rate) >= OFTEN
        scale = 1.0 / firm_gain(rates) if often else 1.0
        if not is_off(scale):
            return
    looks = next((f": it looks like {unit}" for unit, s in RATE_UNITS.items() if 0.5 < scale / s < 2.0), "")
    yield REFUSED, "gyro", f"is {scale:.4g} times the rate of the attitude{looks}", UNIT if looks else CLOCK


def scale_of_velocity(flight: FlightData) -> Iterator[Found]:
    """Yield a velocity that is a multiple of the slope of the position, by less than a unit."""
    if "velocity" not in flight or "position" not in flight:
        return
    if min(flight["velocity"].rate, flight["position"].rate) < OFTEN:
        return
    law = slope_law(flight["velocity"], flight["position"])
    scale = 1.0 if law is None else 1.0 / firm_gain(law)
    if is_off(scale) and 0.5 < scale < 2.0:
        yield REFUSED, "velocity", f"is {scale:.4g} times the slope of the position", CLOCK


def scale_of_forces(flight: FlightData) -> Iterator[Found]:
    """Yield an accelerometer whose mean is not gravity, of a flight in the air."""
    gyro, channel = flight["gyro"], flight["accelerometer"]
    if channel.duration < 10.0 * TURN_STEP or flight.gravity <= 0.0:
        return
    scale = _mean_of_pieces(gyro, channel) / flight.gravity
    if UNITS[0] < scale < UNITS[1] and is_off(scale, OFF + HOVERING / (flight.gravity * channel.duration)):
        finding = f"is {scale:.4g} times gravity on the mean in axes that the gyro turns back"
        yield REFUSED, "accelerometer", finding, "state its unit and scale in columns.toml"


def _mean_of_pieces(gyro: Channel, accelerometer: Channel) -> float:
    """Size of the mean specific force of pieces of a flight, each in the axes of its begin, by the sum of its rates."""
    begin, end = common_span(gyro, accelerometer)
    edges = np.arange(begin, end, TURN_STEP)
    pieces = max(1, int((end - begin) / PIECE))
    size = (len(edges) - 1) // pieces
    rates, forces = (
        means_of(each.time, each.values)(edges[:-1], edges[1:])[: pieces * size].reshape(pieces, size, 3)
        for each in (gyro, accelerometer)
    )
    turned, total = np.tile([1.0, 0.0, 0.0, 0.0], (pieces, 1)), np.zeros((pieces, 3))
    for rate, force in zip(rates.transpose(1, 0, 2), forces.transpose(1, 0, 2), strict=True):
        total += turn_vectors(turned, force)
        half = 0.5 * TURN_STEP * rate
        w, v = turned[:, :1], turned[:, 1:]
        moved = [w - (v * half).sum(axis=1, keepdims=True), v + w * half + np.cross(v, half)]
        turned = unit_rows(np.concatenate(moved, axis=1))
    return float(np.linalg.norm(total / size, axis=1).mean())
