"""D-optimal excitation: multisine segments within flight limits that identify a
vehicle's parameters best.

Segments from rest to rest are drawn within the limits without flying them: attitude,
rotor speeds and joint efforts follow from inverse dynamics. Windows of each that the
engine flies, under the noise of a simulated flight, give its information matrix, and
matrices add up. Those segments are taken whose sum, with what is known before, leaves
the least volume to the vehicle's numbers (D_s-optimality; Atkinson, Donev and Tobias
2007), by exchange (Fedorov 1972) with segments drawn near those that were taken.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Annotated

import numpy as np

from skyarm.flight_data.flight_data import FlightData
from skyarm.identify.identify_windows import WindowSearch, first_fits, search_of
from skyarm.identify.logged_commands import highest_speeds
from skyarm.identify.multisines import (
    BASE_AXES,
    Axes,
    Segment,
    draw_segment,
    mutate_segment,
)
from skyarm.identify.required_flight import (
    RequiredFlight,
    arm_clearance,
    required_flight,
)
from skyarm.identify.window_errors import WindowErrors
from skyarm.identify.window_fit import loose_with, reduce
from skyarm.identify.windows import on_clock
from skyarm.records.arrays import Array, Mask, float_array
from skyarm.records.immutable import immutable, positional
from skyarm.records.units import Unit
from skyarm.vehicle import Vehicle

SEGMENT = 10.0
"""Approximate duration (s) of a segment; its ends at rest show nothing, and few
segments leave no choice."""

SLOWEST, FASTEST = 0.4, 0.8
"""Range of a rotor's speed: fraction of its hover speed, and of its highest; reserve
for a fifth less thrust than modelled."""

EFFORT = 0.6
"""Largest effort of a joint, as a fraction of its limit."""

TRACKING = 0.85
"""Fraction of box and tilt that a design uses; the remainder is for overshoots of the
loop."""

PERIOD = 0.01
"""Time (s) between instants at which the flight of a segment is evaluated: forty in a
period of the fastest sine."""

SHRUNK, PATIENCE = 0.85, 20
"""Factor on the amplitudes that violate a limit, and number of rounds before all
amplitudes are reduced; 20 rounds leave 4 % of an amplitude."""


@immutable
class DesignLimits:
    """Limits of an excitation flight: space, tilt, clearance of the arm, and duration.

    Attributes:
        box: m, edge of the cube in which the base origin stays.
        tilt: rad, of the base's upright axis against the vertical.
        clear: m, of the arm from rotors, base origin and ground.
        seconds: duration of the flight, s.
    """

    box: Annotated[float, Unit("m", "edge of the cube in which the base stays")] = 1.5
    tilt: Annotated[float, Unit("rad", "largest tilt of the base")] = math.radians(25.0)
    clear: Annotated[
        float, Unit("m", "least distance of the arm from rotors, base and ground")
    ] = 0.1
    seconds: Annotated[float, Unit("s", "duration of the designed flight")] = 60.0

    def broken_by(self, vehicle: Vehicle, flight: RequiredFlight) -> Array:
        """Fractions (4 + n,), 0 to 1, of x, y, z, yaw and each joint in a designed
        flight's violation of its limits.
        """
        shares = np.zeros(BASE_AXES + vehicle.n)
        if flight.tilt.max() > TRACKING * self.tilt:
            # what tilts the base is its motion along x and y
            shares[:2] = 1.0
        for k in _overloading(vehicle, flight):
            *base, joints = _FAULT[k]
            shares = np.maximum(shares, [*base, *([joints] * vehicle.n)])
        limits = float_array(joint.effort_limit for joint in vehicle.joints)
        shares[BASE_AXES:][(np.abs(flight.efforts) > EFFORT * limits).any(axis=0)] = 1.0
        if arm_clearance(vehicle, flight.joints)[0].min() < self.clear:
            shares[BASE_AXES:] = 1.0
        return shares


_FAULT = (
    (1.0, 1.0, 1.0, 0.0, 0.0),
    (0.3, 0.3, 0.0, 0.3, 1.0),
    (0.3, 0.3, 0.0, 0.3, 1.0),
    (0.0, 0.0, 0.0, 1.0, 0.3),
)
"""Weights of x, y, z, heading and joints in the violation by the force along z, and by
the torques about x, y and z.

An arm that swings needs more of the torques about x and y than a base that tilts
slowly.
"""


def _overloading(vehicle: Vehicle, flight: RequiredFlight) -> list[int]:
    """Components of the wrench (force along z, torques about x, y, z) that drive rotors
    out of their range.
    """
    highest = highest_speeds(vehicle.rotors)
    rest = flight.speeds[:1]
    above, below = flight.speeds > FASTEST * highest, flight.speeds < SLOWEST * rest
    if not (above.any() or below.any()):
        return []
    off = (flight.shares - flight.shares[:, :1]) * np.where(
        above, 1.0, np.where(below, -1.0, 0.0)
    )
    worst = off.max(axis=(1, 2))
    # a component nearly as bad as the worst is reduced with it, or it would be the next
    return [k for k, each in enumerate(worst.tolist()) if each >= 0.7 * worst.max()]


@positional(eq=False)
class Candidate:
    """Candidate multisine segment and its Fisher information matrix (P, P) about the
    searched parameters.
    """

    segment: Segment
    information: Array


@immutable(eq=False)
class MeasuredNoise:
    """Sensors of a flight with their noise, for which excitation segments are
    evaluated.

    Attributes:
        flight: flight whose sensors and commands they are.
        search: search of the vehicle's parameters in it. plant: errors of its windows,
            with the plant in machine code.
        noise: (1, rows) standard deviations of the readings. loose: (x,) those of a
            window's free numbers.
    """

    flight: FlightData
    search: WindowSearch
    plant: WindowErrors
    noise: Array
    loose: Array

    @property
    def prior(self) -> Array:
        """Prior standard deviations (P,) of the searched parameters."""
        return np.array([each.spread for each in self.search.unknowns])

    @property
    def in_vehicle(self) -> Mask:
        """Flags (P,) of the searched parameters that belong to the vehicle, not to its
        sensors or surroundings.
        """
        return np.array([each.in_vehicle for each in self.search.unknowns])


def measured_noise(flight: FlightData, vehicle: Vehicle) -> MeasuredNoise:
    """Estimate the sensor noise in a flight of a vehicle whose parameters are nearly
    known.

    Raises:
        ValueError: one line: a flight that does not fit the vehicle, or SciPy is
            missing.
    """
    search = search_of([flight], vehicle)
    errors, fit = first_fits(search)
    return MeasuredNoise(
        flight=flight,
        search=search,
        plant=errors,
        noise=fit.noise,
        loose=loose_with(errors, fit.spread),
    )


def information_of(flight: FlightData, measured: MeasuredNoise) -> Array:
    """Fisher information matrix (P, P) of a flight about a vehicle's parameters, under
    given sensor noise.
    """
    search = measured.search
    clocked = on_clock(flight, search.start, search.flights[0].step)
    errors = dataclasses.replace(search, flights=[clocked]).errors(
        search.whole, before=measured.plant
    )
    # the readings are noise-free, so the first states need no fit
    states = errors.first_states()
    # what the required flight leaves out says nothing against its readings
    _, _, normal = errors.normal(search.begin, states, measured.noise, outlier=math.inf)
    return np.asarray(
        reduce(normal, states.beside, measured.loose, measured.prior).information.sum(
            axis=0
        )
    )


def fitted_segment(
    vehicle: Vehicle, segment: Segment, axes: Axes, limits: DesignLimits, period: float
) -> tuple[Segment, RequiredFlight] | None:
    """Multisine segment scaled down into the flight limits, and its flight; None if no
    scale is small enough.

    Args:
        vehicle: vehicle that flies it.
        segment: multisines.
        axes: rests and ranges.
        limits: limits of the flight.
        period: s, of the instants at which the limits are looked at.
    """
    times = period * np.arange(round(segment.duration / period) + 1, dtype=float)
    motion, factors = segment.motion(times), np.ones(len(axes.rest))
    for turn in range(2 * PATIENCE):
        moved = motion * factors[:, None]
        moved[0] += axes.rest[:, None]
        flight = required_flight(vehicle, moved, period)
        broken = limits.broken_by(vehicle, flight)
        if not broken.any():
            return segment.scale(factors), flight
        # an arm alone may tilt a light base
        factors *= SHRUNK ** np.maximum(broken, float(turn >= PATIENCE))
    return None


def volume_gain(information: Array, prior: Array, inside: Mask) -> float:
    """D_s-optimality criterion: log determinant of the information about chosen
    parameters, relative to the prior.

    Args:
        information: (P, P) of the data.
        prior: (P,) standard deviations of what is known before.
        inside: (P,) numbers that count; the others are estimated beside them.
    """
    # on the prior's scale, so that rounding does not depend on units
    whole = information * np.outer(prior, prior) + np.eye(len(prior))
    outside = whole[np.ix_(~inside, ~inside)]
    return float(np.linalg.slogdet(whole)[1] - np.linalg.slogdet(outside)[1])


def design_segments(
    vehicle: Vehicle,
    measured: MeasuredNoise,
    axes: Axes,
    limits: DesignLimits,
    *,
    candidates: int,
    seed: int = 0,
    progress: Callable[[int, str], None] = lambda done, words: None,
) -> list[Segment]:
    """Choose multisine segments, flown one after the other, that identify a vehicle's
    parameters best.

    Args:
        vehicle: nominal vehicle.
        measured: clock and noise.
        axes: rests and ranges.
        limits: limits of the flight.
        candidates: segments that are tried; a third of them is drawn freely, the others
            near those taken.
        seed: seed of the draws.
        progress: called with the number of candidates that are done, and words.

    Raises:
        ValueError: one line: no segment stays in the limits.
    """
    draw = np.random.default_rng(seed)
    count = max(1, round(limits.seconds / SEGMENT))
    duration = limits.seconds / count

    def candidate(segment: Segment) -> Candidate | None:
        fitted = fitted_segment(vehicle, segment, axes, limits, PERIOD)
        if fitted is None:
            return None
        scaled, flight = fitted
        return Candidate(
            scaled,
            information_of(flight.flight_data(vehicle, measured.flight), measured),
        )

    def gain(each: Sequence[Candidate]) -> float:
        whole = np.sum([one.information for one in each], axis=0)
        return volume_gain(whole, measured.prior, measured.in_vehicle)

    # more than are taken, so that there is a choice at all
    free = max(count + 2, candidates // 3)
    pool: list[Candidate] = []
    for i in range(free):
        progress(i, "segments drawn")
        trial = candidate(draw_segment(axes, duration, draw))
        pool += [trial] if trial is not None else []
    if not pool:
        raise ValueError(
            f"box = {limits.box:g} m, tilt = {math.degrees(limits.tilt):g} deg, clear ="
            f" {limits.clear:g} m: vehicle '{vehicle.name}' has no motion within these"
            " limits; widen one of them"
        )
    taken = list[Candidate]()
    # one by one, each with the largest gain beside those that are taken already
    for _ in range(count):
        taken.append(max(pool, key=lambda each: gain([*taken, each])))
    best = gain(taken)
    for i in range(free, candidates):
        progress(i, f"segments, {best:.1f} nats")
        trial = candidate(
            mutate_segment(taken[int(draw.integers(count))].segment, axes, draw)
        )
        if trial is None:
            continue
        # an exchange must gain, so the best of the replaced ones decides
        gains = [gain([*taken[:k], trial, *taken[k + 1 :]]) for k in range(count)]
        if max(gains) > best:
            best, k = max(gains), int(np.argmax(gains))
            taken[k] = trial
    return [each.segment for each in taken]
