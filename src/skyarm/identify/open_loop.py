"""Open-loop prediction of flights: simulation from measured states under the logged
commands.

From an instant on the base moves as the vehicle's model says, by the commands that were
flown; nothing that was measured later enters, but the motion of the joints, which is
given, and the next sample where an instant lies between two. Many begins are flown side
by side.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from skyarm.algebra import Quaternion, Vec3
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.flight_data.quantities import GRAVITY
from skyarm.flight_data.series import attitude_at, integral_of, measured_at, values_at
from skyarm.identify.identified_parts import IdentifiedSurroundings, numbers_around
from skyarm.identify.log_checks import COMMANDS
from skyarm.identify.measured_motion import measured_motion
from skyarm.identify.unknowns import THRUST, without_tilts
from skyarm.identify.window_errors import (
    WindowErrors,
    WindowLanes,
    WindowStates,
    with_heavy_joints,
)
from skyarm.identify.windows import (
    Clocked,
    ClockedWindows,
    clock_step,
    join_arrays,
    on_clock,
    run_in_of,
)
from skyarm.log.motion import PoseSeries, PredictedMotion, join_motions
from skyarm.log.periods import runs_of
from skyarm.records.arrays import Array, IntArray
from skyarm.records.files import one_line
from skyarm.records.immutable import positional
from skyarm.vehicle import Vehicle

SLOPE, FEWEST = 0.1, 5
"""Interval (s) and least number of samples over which a position is differentiated
where no velocity is measured."""

TURN, AVERAGED = 0.1, 0.005
"""Interval (s) of the parabolas through gyroscope samples for initial rates; averaging
time (s) at the ends of predictions."""

SWING = 0.1
"""Interval (s) of the fourth-degree polynomials through measured joint positions, for
rates and accelerations."""

FITS = 1.1
"""Largest residual of a polynomial fit over the white noise."""

FIELDS = ("position", "quaternion", "velocity", "rate")
"""Fields of the base's state."""

NONE = np.zeros(0)
"""Empty parameter vector of a prediction."""

NEEDED = ("position", "quaternion", "gyro")
"""Channels without which a model has no initial state."""


@positional(eq=False)
class BaseStates:
    """States of the base at K instants: position, attitude, velocity and rate.

    Attributes:
        position: m, world axes. quaternion: w x y z, base to world. velocity: m/s,
            world axes. rate: rad/s, base axes.
    """

    position: Array
    quaternion: Array
    velocity: Array
    rate: Array

    def at(self, rows: IntArray) -> BaseStates:
        """States of the base at selected instants."""
        return BaseStates(*(getattr(self, name)[rows] for name in FIELDS))

    def at_even_rates(self, seconds: float) -> BaseStates:
        """States of the base extrapolated by some time (s) with constant velocity and
        rate.
        """
        turn = Quaternion.of_rotation_vector(Vec3(*(self.rate.T * seconds)))
        turned = Quaternion(*self.quaternion.T) * turn
        place = self.position + self.velocity * seconds
        return BaseStates(
            place, np.stack(list(turned.normalized()), axis=1), self.velocity, self.rate
        )


def measured_states(
    flight: FlightData, clocked: Clocked, about: IdentifiedSurroundings, joints: int
) -> tuple[BaseStates, BaseStates, Array]:
    """Measured base states of a flight at even times; level and at rest where no pose
    is measured.

    Between samples they are interpolated. Without a velocity, that is the slope of the
    position over :data:`SLOPE` (local parabola: Savitzky and Golay 1964): around each
    sample, and for begins before it; without a position, that is the sum of the
    velocity.

    Args:
        flight: measured.
        clocked: the flight on its clock.
        about: delay of the pose and bias of the gyroscope.
        joints: number of the vehicle's joints.

    Returns:
        States (N + 1, ...); the same with velocities and rates from what is measured
        until each instant; and (3, N, n) positions and rates of the joints at the
        starts of the steps, and accelerations in them.

    Raises:
        ValueError: one line: the flight has too few samples.
    """
    time, count = clocked.edges, clocked.size + 1
    late = time + about.pose_delay
    position, velocity, before = (np.zeros((count, 3)) for _ in range(3))
    quaternion = np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))
    if not no_poses(flight):
        quaternion = attitude_at(flight["quaternion"], late)
        if "velocity" in flight:
            velocity = before = values_at(flight["velocity"], late)
        else:
            place = flight["position"]
            half = max(FEWEST, math.ceil(SLOPE * place.rate)) // 2
            around = ((half, half), (2 * half, 0))
            velocity, before = (
                values_at(slopes_of(place, *each, 2)[1], late) for each in around
            )
        has_position = "position" in flight
        position = (
            values_at(flight["position"], late)
            if has_position
            else integral_of(time, velocity)
        )
    gyro = flight["gyro"]
    bias = np.array(about.gyro_bias)
    rate = measured_at(gyro, time, max(clocked.step, AVERAGED)) - bias
    # a prediction begins with what was known then: the past alone
    rate_before = values_at(smooth_motion(gyro, TURN, 2, past=True)[0], time) - bias
    motion = np.zeros((3, clocked.size, 0))
    if joints:
        q, qd = (
            values_at(each, time)
            for each in smooth_motion(flight["joint_positions"], SWING, 4)
        )
        motion = np.stack([q[:-1], qd[:-1], np.diff(qd, axis=0) / clocked.step])
    states = BaseStates(position, quaternion, velocity, rate)
    return states, BaseStates(position, quaternion, before, rate_before), motion


def no_poses(flight: FlightData) -> str:
    """Reason why a flight has no measured poses; empty if it has them."""
    if "quaternion" in flight and ("position" in flight or "velocity" in flight):
        return ""
    missing = "quaternion" if "quaternion" not in flight else "position"
    return (
        f"no {missing} is measured: rate and specific force are predicted, and no pose"
    )


def slopes_of(
    measured: Channel, before: int, after: int, degree: int
) -> tuple[Channel, Channel]:
    """Value and slope of a channel by local polynomial fits around each sample.

    Args:
        measured: channel.
        before: number of samples before each one.
        after: number of samples after it.
        degree: degree of the polynomials.

    Raises:
        ValueError: one line: too few samples.
    """
    step = float(np.median(np.diff(measured.time)))
    time = np.arange(measured.time[0], measured.time[-1] + 0.5 * step, step)
    rows = values_at(measured, time)
    if len(rows) <= before + after:
        raise ValueError(
            f"{measured.source}: {len(rows)} samples: must be at least"
            f" {before + after + 1}"
        )
    powers = np.vander(
        np.arange(-before, after + 1, dtype=float), degree + 1, increasing=True
    )
    # odd reflection goes on with value and slope beyond both ends
    longer = np.pad(rows, ((before, after), (0, 0)), mode="reflect", reflect_type="odd")
    value, slope = (
        # the pseudo-inverse's first rows weigh the samples for value and slope at 0;
        # turned round, as np.convolve turns its second argument once more
        np.stack(
            [np.convolve(column, each[::-1], "valid") for column in longer.T], axis=1
        )
        for each in np.linalg.pinv(powers)[:2]
    )
    return replace(measured, time=time, values=value), replace(
        measured, time=time, values=slope / step
    )


def smooth_motion(
    measured: Channel, seconds: float, degree: int, *, past: bool = False
) -> tuple[Channel, Channel]:
    """Value and slope of a channel by local polynomial fits over a width (s), halved
    until the residuals are noise.

    What they leave must be no more than the samples' white noise, as it shows in
    differences that leave none of them.

    Args:
        measured: channel.
        seconds: largest width, s.
        degree: degree of the polynomials.
        past: whether they are through the samples until each one.
    """
    least = degree if past else degree // 2
    size = max(least, round(seconds * measured.rate / (1 if past else 2)))
    bends = np.median(np.abs(np.diff(measured.values, degree + 1, axis=0)), axis=0)
    # of white noise the variance of a difference grows by the sum of squared binomial
    # coefficients
    noise = 1.4826 * bends / math.sqrt(math.comb(2 * degree + 2, degree + 1))
    while True:
        value, slope = slopes_of(measured, size, 0 if past else size, degree)
        left = np.sqrt(
            ((value.values - values_at(measured, value.time)) ** 2).mean(axis=0)
        )
        if size == least or (left <= FITS * noise).all():
            return value, slope
        size = max(least, size // 2)


class OpenLoopPredictor:
    """Open-loop predictor: simulates a vehicle from measured states of flights under
    their logged commands.

    Args:
        vehicle: vehicle whose model flies.
        about: delays and offsets.
        flights: measured.
        clocked: the same on their clock.
        gravity: m/s^2.
        thrusts: thrust of each flight, over that of the rotors' data; by default that
            of ``about``.

    Attributes:
        flights: on the clock.
        measured: states at the edges of the clocks, one flight after the other;
            ``known`` are those to begin with.
        averaged: steps over which the accelerometer's samples are means.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        about: IdentifiedSurroundings,
        flights: Sequence[FlightData],
        clocked: Sequence[Clocked],
        gravity: float,
        thrusts: Sequence[float] = (),
    ) -> None:
        self._vehicle = vehicle = without_tilts(vehicle)
        # numbers of flights are told by names, which two may share; joints that move as
        # they were measured leave nothing to compare
        self.flights = [
            replace(
                each,
                name=f"{i}: {each.name}",
                channels={
                    name: channel
                    for name, channel in each.channels.items()
                    if not name.startswith("joint")
                },
            )
            for i, each in enumerate(clocked)
        ]
        every = [
            measured_states(flight, clock, about, vehicle.n)
            for flight, clock in zip(flights, clocked, strict=True)
        ]
        self.measured = join_arrays([each[0] for each in every], np.concatenate)
        self.known = join_arrays([each[1] for each in every], np.concatenate)
        shares = thrusts or [about.thrust] * len(clocked)
        thrust = {
            f"{THRUST}{each.name}": share
            for each, share in zip(self.flights, shares, strict=True)
        }
        still, anywhere = [False] * vehicle.n, [np.zeros(0, int)] * len(flights)
        self._errors = WindowErrors(
            ClockedWindows(self.flights, vehicle, 0.0, places=anywhere),
            # joints move as they were measured, whatever pulls at them
            with_heavy_joints(vehicle),
            [],
            numbers_around(about) | thrust,
            still,
            still,
            gravity,
            given=np.concatenate([each[2] for each in every], axis=1),
        )
        self.averaged = int(self._errors.averaged.max())

    def windows(self, places: Sequence[IntArray], seconds: float = 0.0) -> WindowErrors:
        """Windows of a given length (s) with given start steps in each flight, and
        their residuals.
        """
        errors = self._errors.over(
            ClockedWindows(self.flights, self._vehicle, seconds, places=places)
        )
        errors.take_samples(NONE)
        return errors

    def left(self, windows: ClockedWindows) -> IntArray:
        """Numbers (W,) of consecutive usable steps from the starts of windows."""
        bad = np.concatenate([~each.usable for each in self.flights])
        # a window also ends with its flight
        ends = np.union1d(np.flatnonzero(bad), windows.firsts[1:])
        return np.asarray(ends[np.searchsorted(ends, windows.begins)] - windows.begins)

    def measured_at(self, windows: ClockedWindows, steps: int | IntArray) -> BaseStates:
        """Measured base states a number of steps after the starts of windows."""
        return self.measured.at(windows.begins + windows.owners + steps)

    def begins(self, windows: ClockedWindows) -> BaseStates:
        """Base states at the starts of windows, estimated from past measurements
        only.
        """
        return self.known.at(windows.begins + windows.owners)

    def ahead(
        self,
        errors: WindowErrors,
        begins: BaseStates,
        pushes: Callable[[float], Array] | None = None,
    ) -> Iterator[BaseStates]:
        """Yield the predicted base states 0, 1, ... steps after the starts of windows.

        Args:
            errors: errors of the windows.
            begins: states.
            pushes: s, after the begins -> (W, 6) force (N) and torque (N m) that the
                commands do not explain, base axes; none by default.
        """
        lanes = WindowLanes(errors, NONE, window_states(begins))
        step = errors.windows.step
        inputs = lanes.flights.inputs
        own_torque = inputs["torque"].copy()
        try:
            for k in itertools.count():
                yield BaseStates(
                    *(lanes.flights.state[name].T.copy() for name in FIELDS)
                )
                if pushes is not None:
                    # at the middle of the step, for all of it
                    force, torque = np.split(pushes((k + 0.5) * step).T, 2)
                    inputs["force"][:], inputs["torque"][:] = force, own_torque + torque
                lanes.advance(k)
        finally:
            # threads of the lanes end with whoever stops reading
            lanes.close()


def window_states(begins: BaseStates) -> WindowStates:
    """Initial states of windows from base states, without an unexplained wrench."""
    return WindowStates(
        {name: getattr(begins, name) for name in FIELDS},
        np.zeros((len(begins.rate), 6)),
    )


def places_of(
    flight: Clocked, vehicle: Vehicle, every: int, behind: float = 0.0
) -> IntArray:
    """Start steps of predictions, where the flight is usable and rotor speeds follow
    from past commands.

    Args:
        flight: on its clock.
        vehicle: vehicle whose rotors' lags count.
        every: steps from one to the next within each usable part.
        behind: s, of the usable part before the first one.
    """
    before, first = round(behind / flight.step), run_in_of(vehicle, flight.step)
    rows = [
        np.arange(max(a + before, first), b, every) for a, b in runs_of(flight.usable)
    ]
    # the empty array, as of no usable part there is nothing to join
    return np.concatenate([np.zeros(0, int), *rows])


class OpenLoopFlight:
    """Measured flight whose motion a vehicle's model predicts over horizons of any
    length.

    Args:
        flight: flight with position, quaternion, gyro and commands of the rotors; joint
            positions for a vehicle with joints.
        vehicle: vehicle whose model is used.
        about: delays and offsets.
        gravity: m/s^2.
        full_voltage: V, of the rotors' data; 0 leaves the battery's voltage out.

    Raises:
        ValueError: one line: a channel is missing or does not fit the vehicle, or the
            vehicle is nowhere in the air.
    """

    def __init__(
        self,
        flight: FlightData,
        vehicle: Vehicle,
        about: IdentifiedSurroundings | None = None,
        *,
        gravity: float = GRAVITY,
        full_voltage: float = 0.0,
    ) -> None:
        _require_channels(flight, vehicle)
        self.measured = measured_motion(flight, vehicle)
        if "accelerometer" not in flight:  # clocks have it, and no prediction uses it
            rate = flight["gyro"]
            flight = flight.with_channels(
                {"accelerometer": replace(rate, values=0.0 * rate.values)}
            )
        posed = flight.section(
            float(self.measured.time[0]), float(self.measured.time[-1])
        )
        if empty := [
            name
            for name, each in posed.channels.items()
            if name in (*NEEDED, *COMMANDS) and not each.time.size
        ]:
            raise ValueError(
                f"{flight.name}: {empty[0]}: must be measured at the same time as"
                " position and quaternion"
            )
        self._clocked = on_clock(
            posed, vehicle, clock_step([posed], vehicle), full_voltage=full_voltage
        )
        self._vehicle = vehicle
        if not places_of(self._clocked, vehicle, 1).size:
            raise ValueError(
                f"{flight.name}: no part in the air without a gap is long enough for a"
                " prediction"
            )
        self._joints = np.zeros((self._clocked.size + 1, 0))
        if vehicle.n:
            self._joints = values_at(flight["joint_positions"], self._clocked.edges)
        self._loop = OpenLoopPredictor(
            vehicle,
            about or IdentifiedSurroundings(),
            [flight],
            [self._clocked],
            gravity,
        )

    def over(self, horizon: float) -> PredictedMotion:
        """Motion predicted by the model and by constant velocity, reset to the measured
        state every horizon (s).
        """
        loop, step = self._loop, self._clocked.step
        steps = max(1, round(horizon / step))
        errors = loop.windows([places_of(self._clocked, self._vehicle, steps)])
        windows = errors.windows
        begins = loop.begins(errors.windows)
        flown = list(itertools.islice(loop.ahead(errors, begins), steps + 1))
        still = [begins.at_even_rates(k * step) for k in range(steps + 1)]
        # the last one ends with its part
        counts = np.minimum(loop.left(windows), steps) + 1
        model, hold = (
            join_motions(
                [
                    self._motion(states, i, first, first + counts[i])
                    for i, first in enumerate(windows.begins)
                ]
            )
            for states in (flown, still)
        )
        return PredictedMotion(
            model=model, held=hold, begins=self._clocked.edges[windows.begins]
        )

    def _motion(
        self, states: Sequence[BaseStates], i: int, first: int, end: int
    ) -> PoseSeries:
        """Predicted motion of a vehicle in one window, between two steps of the
        clock.
        """
        position, quaternion = (
            np.stack([getattr(each, name)[i] for each in states[: end - first]])
            for name in FIELDS[:2]
        )
        return PoseSeries(
            time=self._clocked.edges[first:end],
            position=position,
            quaternion=quaternion,
            joints=self._joints[first:end],
        )


def _require_channels(flight: FlightData, vehicle: Vehicle) -> None:
    """Raise an error that lists the channels that a flight lacks for a prediction."""
    lacking = [
        name
        for name in (*NEEDED, *(["joint_positions"] if vehicle.n else []))
        if name not in flight
    ]
    if not any(name in flight for name in COMMANDS):
        lacking.append(" or ".join(COMMANDS))
    if lacking:
        there = ", ".join(flight) or "no channel"
        raise ValueError(
            one_line(
                f"{flight.name}: must hold {' and '.join(lacking)}; there is {there}"
            )
        )
