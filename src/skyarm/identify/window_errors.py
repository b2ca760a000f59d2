"""Residuals of simulated flight windows, measured less simulated, and their normal
equations.

Of each window the first state is free, and so are a constant wrench that nothing
explains, the integrals of its servos and, of a joint whose effort is not logged, hat
functions of it. Slopes are differences between lanes: one for every number and free
number, of every window, all flown side by side.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from skyarm.algebra import Quaternion, Scalar, Vec3, sums
from skyarm.compile.llvm.shared_steps import cores
from skyarm.dynamics.actuators.drive import TORQUE_DRIVE, Drive
from skyarm.dynamics.state import State
from skyarm.identify.identified_parts import vehicle_with, with_changes
from skyarm.identify.unknowns import THRUST, Unknown, servo_of
from skyarm.identify.windows import ClockedWindows, Held, SensorSamples, join_arrays
from skyarm.records.arrays import Array, IntArray, Mask
from skyarm.records.immutable import positional
from skyarm.simulate.replay import CommandReplay, Numbers, ReplayedFlights
from skyarm.vehicle import Vehicle

FREE = {
    "position": 1e3,
    "quaternion": 1.0,
    "velocity": 3.0,
    "rate": 10.0,
    "joints": 1.0,
    "joint_rates": 30.0,
}
"""Prior standard deviations of a window's initial state in SI units: practically
uninformative."""

LOOSE, CARRIED = 0.3, 0.25
"""The same of servos' integrals (rad s), and of unlogged efforts as a fraction of the
weight, at the rotors' distance for revolute joints."""

HAT = 0.02
"""Spacing (s) of the hat functions of an unlogged effort, which thus follow one of up
to 25 Hz."""

OUTLIER = 3.0
"""Standard deviations above which an error counts linearly (Huber 1964)."""

SMALL = 1e-6
"""Finite difference for slopes, over the usual size of a parameter. A forward
difference leaves apparent information on sums of parameters that the data do not
contain: at 1e-3 more than the prior."""

SAME = 0.1
"""Change of a delay, in steps, below which the samples are not aligned anew; a slope
accounts for it."""

CHUNK = 24
"""Number of steps whose slopes are held in memory at once, summed by one product of
matrices; chosen: more take more memory, fewer more products."""

PUSH, TWIST = 1.0 / 15.0, 1.0 / 40.0
"""Prior size of the unexplained force and torque, over the weight and the weight times
the rotors' distance. A search begins with it, and estimates the spread from its second
turn on."""

BIAS = {"gyro": "gyro_bias.", "accelerometer": "offset."}
"""Sensor -> prefix of the parameters that are added to its readings."""

DELAY = {
    "position": "pose_delay",
    "quaternion": "pose_delay",
    "velocity": "pose_delay",
    "accelerometer": "accelerometer_delay",
}
"""Sensor -> parameter of its delay."""

TRIM = "torque."
"""Prefix of the constant torque; each window has an additional one."""

ANALYTIC = (*BIAS.values(), *DELAY.values(), TRIM)
"""Prefixes of parameters that act on readings alone, or as the wrench of a window does:
their slopes need no simulation."""

IN_INPUTS = (THRUST, "delay", "joint_delay", "drift", "sag", "setpoint_hold")
"""Prefixes of parameters that act in the inputs of the compiled plant."""

HEAVY = 1e6
"""Inertia (kg m^2 or kg) of drives that makes joints immovable, without effect on the
base."""

READ = {"gyro": "rate", "joint_positions": "joints"}
"""Sensor -> field of a state, where their names differ."""


def with_heavy_joints(vehicle: Vehicle) -> Vehicle:
    """Vehicle whose joints follow given accelerations regardless of loads, by a very
    large armature inertia.
    """
    free = {
        "armature": HEAVY,
        "effort_limit": math.inf,
        "damping": 0,
        "coulomb": 0,
        "stop_stiffness": 0,
    }
    links = [
        with_changes(each, joint=with_changes(each.joint, **free))
        for each in vehicle.links
    ]
    return vehicle.with_checked(links=tuple(links), drives=())


@positional(eq=False)
class WindowStates:
    """Initial state, unexplained wrench and unlogged joint efforts of each of W
    windows.

    Attributes:
        parts: name -> (W, k), first states and integrals of servos in the order of the
            free numbers.
        beside: (W, k) force (N) and torque (N m) that nothing explains, and efforts at
            the hats: usually 0.
    """

    parts: Mapping[str, Array]
    beside: Array

    def moved_by(self, change: Array) -> WindowStates:
        """Initial states, wrenches and efforts of W windows after a change (W, x) of
        the x unknowns of each.
        """
        parts = dict[str, Array]()
        first = 0
        for name, rows in self.parts.items():
            size = 3 if name == "quaternion" else rows.shape[1]
            move = change[:, first : first + size]
            parts[name] = (
                turn_attitudes(rows, move) if name == "quaternion" else rows + move
            )
            first += size
        return WindowStates(parts, self.beside + change[:, first:])


def turn_attitudes(attitude: Array, turn: Array) -> Array:
    """Attitudes (..., 4), w x y z, turned by small rotation vectors (..., 3) about base
    axes.
    """
    # first order of the half angle, which normalising makes exact to the second
    half = Quaternion(1.0, *np.moveaxis(0.5 * turn, -1, 0))
    rows = Quaternion(*np.moveaxis(attitude, -1, 0)) * half
    return np.asarray(np.stack(list(rows.normalized()), axis=-1))


@positional(eq=False)
class NormalEquations:
    """Normal equations of a least-squares fit: x unknowns of each of W windows, and P
    vehicle parameters.

    Attributes:
        own: (W, x, x). mixed: (W, x, P). common: (W, P, P). pull, push: (W, x) and (W,
            P), products with the errors.
        of_rows: (rows, W, x, x) the part of each row in ``own``.
    """

    own: Array
    mixed: Array
    common: Array
    pull: Array
    push: Array
    of_rows: Array


Direction = tuple[int, float]
"""Index of the parameter in which a lane differs from the first, among the free and
then the other parameters, and the difference."""


@dataclass(eq=False)
class WindowErrors:
    """Measured less simulated sensor readings of windows, for given vehicle parameters
    and initial states.

    Args:
        windows: windows of flights.
        start: vehicle before, with a servo on each servo joint.
        unknowns: P unknowns to search.
        known: numbers by name that are not.
        driven: whether the effort of each joint is logged. servoed: whether a position
            servo moves it.
        gravity: m/s^2.
        finer: least number of integration steps within a step.
        given: (3, steps, n) positions of the joints at the start of each step, rates
            there, and accelerations in it, where joints move as they are told and are
            no sensors of the windows; of a vehicle of :func:`with_heavy_joints`.

    Attributes:
        replay: simulated plant. names: names of the numbers. rows: (sensor, column) of
            each sensor axis.
        samples: samples of the sensors.
        taken: s, by which each was thought to be late when these were placed on the
            clock.
        free: (name, column) of each free number of a window. loose: their standard
            deviations before.
        wrench: columns of force and torque.
        averaged: (flights,) steps over which the accelerometer's samples are means.
    """

    windows: ClockedWindows
    start: Vehicle
    unknowns: Sequence[Unknown]
    known: Mapping[str, float]
    driven: Sequence[bool]
    servoed: Sequence[bool]
    gravity: float
    finer: int = 1
    given: Array | None = None

    def __post_init__(self) -> None:
        self.names = [each.name for each in self.unknowns]
        self._positive = np.array([each.positive for each in self.unknowns])
        self.replay = self._make_replay()
        self._take_windows()

    def _take_windows(self) -> None:
        """Set samples and unknown states of the windows to simulate."""
        start, driven, servoed = self.start, self.driven, self.servoed
        windows = self.windows
        self.samples = windows.samples({})
        self.taken = dict[str, float]()
        self._placed = 1
        n = start.n if self.given is None else 0
        servos = [servo_of(start, i) for i in range(start.n) if servoed[i]]
        self.rows = [
            (name, i)
            for name in self.samples
            for i in range(n if name.startswith("joint") else 3)
        ]
        self._first = {
            name: i for i, (name, column) in enumerate(self.rows) if not column
        }
        self.integrals = [
            j
            for j, each in enumerate(servos)
            if each is not None and float(each.integral) > 0.0
        ]
        self.unlogged = [i for i in range(n) if not driven[i] and not servoed[i]]
        self.hats = max(2, round(windows.length * windows.step / HAT))
        sizes = {name: n if name.startswith("joint") else 3 for name in FREE} | {
            "integrals": len(self.integrals),
            "wrench": 6,
            "hats": self.hats * len(self.unlogged),
        }
        self.free = [(name, i) for name, size in sizes.items() for i in range(size)]
        self.loose = np.array([FREE.get(name, LOOSE) for name, _ in self.free])
        self.wrench = np.array(
            [i for i, (name, _) in enumerate(self.free) if name == "wrench"]
        )
        felt = [each.channels.get("accelerometer") for each in windows.flights]
        periods = [
            0.0 if each is None else 1.0 / (each.rate * windows.step) for each in felt
        ]
        # an accelerometer that is slower than the clock gives means over its period
        self.averaged: IntArray = np.array([max(1, round(each)) for each in periods])
        weight = self.gravity * float(start.mass)
        arm = max(
            math.hypot(float(r.position.x), float(r.position.y)) for r in start.rotors
        )
        # a wrench scales with the vehicle: weight, and weight at the rotors' distance
        self.push = weight * np.array([PUSH] * 3 + [TWIST * arm] * 3)
        carried = [
            CARRIED * weight * (arm if joint.turns else 1.0) for joint in start.joints
        ]
        self.loose[[name == "hats" for name, _ in self.free]] = np.repeat(
            [carried[i] for i in self.unlogged], self.hats
        )

    def _make_replay(self) -> CommandReplay:
        """Make the compiled plant whose vehicle follows from the searched
        parameters.
        """
        start, servoed, gravity = self.start, self.servoed, self.gravity
        inside = {
            each.name: each.start
            for each in self.unknowns
            if not each.name.startswith((*ANALYTIC, *IN_INPUTS))
        }
        known, step = self.known, self.windows.step

        # unchecked, because a search passes through what no vehicle is
        def vehicle_of(given: Numbers) -> Vehicle:
            return vehicle_with(start, {**known, **given})

        def drives_of(vehicle: Vehicle) -> tuple[Drive, ...]:
            # a servo's setpoints are late before they reach it
            servos = [
                servo_of(vehicle, i) if turns else None
                for i, turns in enumerate(servoed)
            ]
            drives = (
                TORQUE_DRIVE if each is None else with_changes(each, latency=0.0)
                for each in servos
            )
            return tuple(drives) if any(servoed) else ()

        def felt(given: Numbers, before: State, after: State) -> Sequence[Scalar]:
            """Mean specific force of a step at the inertial unit, from the change of
            its velocity.
            """
            place = Vec3(
                *({**known, **given}.get(f"place.{axis}", 0.0) for axis in "xyz")
            )

            def velocity(at: State) -> Vec3:
                return at.velocity + at.quaternion.rotation().apply(
                    at.rate.cross(place)
                )

            middle = Quaternion(*sums([*before.quaternion], [*after.quaternion]))
            # the mean over the step, as a sensor averages; gravity is what the base
            # does not feel
            gained = (velocity(after) - velocity(before)) * (1.0 / step) + Vec3(
                0.0, 0.0, gravity
            )
            return tuple(middle.normalized().rotation().apply_T(gained))

        return CommandReplay(
            vehicle_of,
            inside,
            step,
            gravity,
            drives_of=drives_of,
            sensed=felt,
            finer=self.finer,
        )

    def first_states(self) -> WindowStates:
        """First estimates of the windows' initial states from sensor samples, without
        unexplained wrenches.
        """
        count = self.windows.count
        parts = self.windows.first_states(self.samples) | {
            "integrals": np.zeros((count, len(self.integrals)))
        }
        return WindowStates(
            parts, np.zeros((count, 6 + self.hats * len(self.unlogged)))
        )

    def values(self, searched: Array) -> Array:
        """Parameters (..., P) in their units from the scale of the search, which is
        logarithmic for positive ones.
        """
        # both branches are computed, and an exponential of the others might overflow
        return np.where(
            self._positive, np.exp(np.where(self._positive, searched, 0.0)), searched
        )

    def numbers(self, searched: Array) -> dict[str, float]:
        """Parameter values by name, searched and known ones."""
        return {
            **self.known,
            **dict(zip(self.names, self.values(searched).tolist(), strict=True)),
        }

    def take_samples(self, searched: Array) -> None:
        """Place the samples of delayed sensors on the clock again, for the estimated
        delays.
        """
        numbers = self.numbers(searched)
        delays = {
            name: numbers.get(DELAY[name], 0.0)
            for name in self.samples
            if name in DELAY
        }
        # to and fro over the edge of a step a search would not come to rest
        near = SAME * self._placed * self.windows.step
        if all(
            abs(s - self.taken.get(name, math.inf)) < near for name, s in delays.items()
        ):
            return
        self.taken, self._placed = delays, self._placed + 1
        # what is flown is the mean of a sample's period, what is read that in its
        # middle
        late: dict[str, float | Array] = {**delays}
        if "accelerometer" in delays:
            late["accelerometer"] = np.asarray(
                delays["accelerometer"] - 0.5 * self.windows.step * self.averaged
            )
        self.samples = self.windows.samples(late)

    def over(self, windows: ClockedWindows) -> WindowErrors:
        """Residuals of other windows with the same clock step, on the same compiled
        plant.
        """
        # the compiled plant is shared, as windows are no part of it
        errors = copy.copy(self)
        errors.windows = windows
        errors._take_windows()
        return errors

    def errors_at(self, searched: Array, states: WindowStates) -> tuple[Array, Mask]:
        """Residuals (steps, W, sensor axes) of W windows and their mask, for search
        variables of parameters (P,).
        """
        there = self.compared_samples()
        errors = np.zeros(there.shape)
        # what a search tries may fly to infinity
        with np.errstate(over="ignore", invalid="ignore"):
            for k, _, rows, error, *_ in self._readings(searched, states, []):
                errors[k, :, rows] = error[:, 0].T
        return errors, there

    def times(self) -> Array:
        """Times (steps, W, sensor axes) of the samples after the starts of their
        windows, s.
        """
        steps = np.arange(self.windows.length)[:, None]
        at = self.windows.begins + steps
        return np.stack(
            [
                (steps + self.samples[name].share[at]) * self.windows.step
                for name, _ in self.rows
            ],
            axis=2,
        )

    def shares_left(self, there: Mask, memory: Array) -> Array:
        """Correlation (steps, W, sensor axes) of each sample's residual with that of
        the sample before in its window.

        Args:
            there: (steps, W, sensor axes) which samples count.
            memory: (flights, sensor axes) s, in which errors fade to 1 / e; 0 of those
                that are independent.
        """
        time, last = self.times(), np.full(there.shape, -np.inf)
        last[1:] = np.maximum.accumulate(np.where(there, time, -np.inf), axis=0)[:-1]
        # a memory of 0 keeps nothing: the exponential of minus infinity
        with np.errstate(divide="ignore", invalid="ignore"):
            shares = np.exp((last - time) / memory[self.windows.owners])
        return np.where(np.isfinite(last) & there, np.nan_to_num(shares), 0.0)

    def innovations(self, found: Array, there: Mask, memory: Array | None) -> Array:
        """Whitened residuals (steps, W, sensor axes): less the part correlated with the
        previous (Prais, Winsten 1954).

        The arguments are those of :meth:`shares_left`; without a memory the errors
        themselves.
        """
        if memory is None:
            return found
        rows, last = np.zeros_like(found), np.zeros_like(found[0])
        with np.errstate(invalid="ignore"):  # as where they are read
            for k, share in enumerate(self.shares_left(there, memory)):
                rows[k] = (found[k] - share * last) / np.sqrt(1.0 - share**2)
                last = np.where(there[k], found[k], last)
        return rows

    def normal(
        self,
        searched: Array,
        states: WindowStates,
        noise: Array,
        outlier: float = OUTLIER,
        memory: Array | None = None,
    ) -> tuple[Array, Mask, NormalEquations]:
        """Residuals (steps, W, sensor axes), mask, and normal equations under sensor
        noise (flights, sensor axes).

        Beyond ``outlier`` standard deviations an error counts by its size only; with a
        memory (flights, sensor axes), s, so does what it is beyond that which it keeps
        of the one before.
        """
        windows = self.windows
        x = len(self.free)
        size = x + len(self.names) + 1
        directions = self._directions()
        columns = [place for place, _ in directions]
        steps = np.array([step for _, step in directions])[:, None]
        there = self.compared_samples()
        errors = np.zeros(there.shape)
        count = windows.count
        m = len(self.rows)
        sums, of_rows = np.zeros((count, size - x, size)), np.zeros((m, count, x, x))
        block = np.zeros((count, CHUNK, m, size))
        filled = 0
        scale = 1.0 / noise[windows.owners]
        last = -1
        before = np.zeros((count, m, size))
        shares = None if memory is None else self.shares_left(there, memory)

        def add() -> None:
            flat = block.reshape(count, CHUNK * m, size)
            sums[:] += np.matmul(flat[..., x:].transpose(0, 2, 1), flat)
            own = np.ascontiguousarray(block[..., :x].transpose(2, 0, 1, 3))
            of_rows[:] += np.matmul(own.transpose(0, 1, 3, 2), own)
            block[:] = 0.0

        for k, name, rows, error, slope, has in self._readings(
            searched, states, directions
        ):
            if k != last:
                last, filled = k, filled + 1
                if filled > CHUNK:
                    add()
                    filled = 1
            errors[k, :, rows] = error[:, 0].T
            part = block[:, filled - 1, rows]
            part[:, :, columns] = np.moveaxis(
                (error[:, 1:] - error[:, :1]) / steps, 2, 0
            )
            self._known_slopes(part, name, slope)
            part[:, :, -1] = error[:, 0].T
            if shares is not None:
                now = part.copy()
                share = shares[k, :, rows, None]
                part[:] = (now - share * before[:, rows]) / np.sqrt(1.0 - share**2)
                before[has, rows] = now[has]
            size_of = np.abs(part[:, :, -1]) * scale[:, rows]
            # the root of Huber's weight, since the equations are made of squares
            part *= (
                np.sqrt(np.minimum(1.0, outlier / np.maximum(size_of, 1e-300)))
                * scale[:, rows]
                * has[:, None]
            )[:, :, None]
        add()
        mixed, common, push = np.split(sums[:, :-1], [x, size - 1], axis=2)
        pull = sums[:, -1, :x]
        return (
            errors,
            there,
            NormalEquations(
                of_rows.sum(axis=0),
                mixed.transpose(0, 2, 1),
                common,
                pull,
                push[..., 0],
                of_rows,
            ),
        )

    def compared_samples(self) -> Mask:
        """Mask (steps, W, sensor axes) of the samples that are compared."""
        return np.stack([self._counts(name) for name, _ in self.rows], axis=2)

    def _counts(self, name: str) -> Mask:
        """Mask (steps, W) of the usable samples of a sensor in W windows."""
        steps = np.arange(self.windows.length)[:, None]
        samples = self.samples[name]
        at = self.windows.begins + steps
        there: Mask = samples.there[at]
        # a mean over a sample's period that begins before the window is not flown
        if name == "accelerometer":
            there = there & (
                steps + samples.share[at] > self.averaged[self.windows.owners] - 1e-9
            )
        return there

    def _directions(self) -> list[Direction]:
        """Unknowns whose derivatives need a simulation, with their finite differences;
        the others are analytic.
        """
        sizes = [
            SMALL * (self.push[column] if name == "wrench" else 1.0)
            for name, column in self.free
        ]
        # the motion does not depend on where it is: the slope of a position is known
        directions = [
            (i, size) for i, size in enumerate(sizes) if self.free[i][0] != "position"
        ]
        for j, each in enumerate(self.unknowns):
            if not each.name.startswith(ANALYTIC):
                directions.append(
                    (
                        len(self.free) + j,
                        SMALL if each.positive else SMALL * each.spread,
                    )
                )
        return directions

    def _known_slopes(self, part: Array, name: str, slope: Array) -> None:
        """Fill in the analytic derivatives (W, columns, unknowns) of a sensor's
        residuals.
        """
        x = len(self.free)
        # a shift of the start shifts all positions alike
        if name == "position":
            part[:, range(3), range(3)] = -1.0
        for j, number in enumerate(self.names, x):
            if number.startswith(BIAS.get(name, "none")):
                part[:, "xyz".index(number[-1]), j] = -1.0
            elif number == DELAY.get(name):
                part[:, :, j] = slope.T
            elif number.startswith(TRIM):
                # a constant torque acts as the window's own does
                part[:, :, j] = part[:, :, self.wrench[3 + "xyz".index(number[-1])]]

    def _readings(
        self, searched: Array, states: WindowStates, directions: Sequence[Direction]
    ) -> Iterator[tuple[int, str, slice, Array, Array, Mask]]:
        """Yield step, sensor, indices of its axes, residuals, rate of change and window
        mask, for every sensor sampled.

        Errors are (columns, 1 + directions, W), slopes (columns, W) per second.
        """
        lanes = WindowLanes(self, searched, states, directions)
        step = self.windows.step
        numbers = self.numbers(searched)
        late = {
            name: numbers.get(DELAY.get(name, ""), 0.0) - self.taken.get(name, 0.0)
            for name in self.samples
        }
        before, forces = lanes.read(self.samples), list[Array]()
        averaged = self.averaged[self.windows.owners]
        counts = np.unique(averaged).tolist() or [1]
        there = {name: self._counts(name) for name in self.samples}
        for k in range(self.windows.length):
            at = self.windows.begins + k
            lanes.advance(k)
            now = lanes.read(self.samples)
            forces = [*forces, lanes.force()][-int(self.averaged.max()) :]
            now["accelerometer"] = np.mean(forces[-counts[0] :], axis=0)
            for count in counts[1:]:
                own = averaged == count
                now["accelerometer"][..., own] = np.mean(
                    [each[..., own] for each in forces[-count:]], axis=0
                )
            # a mean force has no value before the first step, so nothing is
            # interpolated
            if not k:
                before["accelerometer"] = now["accelerometer"]
            for name, samples in self.samples.items():
                has = there[name][k]
                if not has.any():
                    continue
                error, slope = _error(
                    name, before[name], now[name], now["gyro"][:, 0], samples, at, step
                )
                if name in BIAS:
                    bias = np.array(
                        [numbers.get(f"{BIAS[name]}{axis}", 0.0) for axis in "xyz"]
                    )
                    error = error - bias[:, None, None]
                first = self._first[name]
                yield (
                    k,
                    name,
                    slice(first, first + len(error)),
                    error + late[name] * slope[:, None],
                    slope,
                    has,
                )
            before = now
        lanes.close()


def _error(
    name: str,
    before: Array,
    now: Array,
    rate: Array,
    samples: SensorSamples,
    at: IntArray,
    step: float,
) -> tuple[Array, Array]:
    """Residuals (columns, simulations, W) of a sensor in a step, and rate of change
    (columns, W) of its reading.

    Args:
        name: name of the sensor.
        before: (columns, lanes, W) readings at the step's begin.
        now: likewise, at its end.
        rate: (3, W) rad/s, of the base.
        samples: samples of the sensor.
        at: (W,) numbers of the steps.
        step: s.
    """
    share, measured = samples.share[at], samples.values[at].T[:, None]
    # of samples at the ends of steps nothing is interpolated
    whole = (share[samples.there[at]] > 1.0 - 1e-9).all()
    flown = now if whole else before + share * (now - before)
    if name != "quaternion":
        return measured - flown, (now[:, 0] - before[:, 0]) / step
    w, *turn = Quaternion(*flown).conjugate() * Quaternion(*measured)
    size = np.sqrt(w**2 + turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2)
    # twice the sine of half the angle, smooth through 0, in its place: 0.2 % less at
    # 0.2 rad; over the size, as interpolation leaves no unit quaternion; the sign of w
    # takes the shorter way round
    return np.stack(turn) * (2.0 * np.sign(w) / size), rate


class WindowLanes:
    """Parallel simulations of all windows: at the estimate, then with each unknown
    changed by a small difference.

    Args:
        errors: errors of the windows.
        searched: (P,) numbers on the scale of the search.
        states: states of the windows.
        directions: directions in which the lanes behind the first differ.
    """

    def __init__(
        self,
        errors: WindowErrors,
        searched: Array,
        states: WindowStates,
        directions: Sequence[Direction] = (),
    ) -> None:
        self._errors, self._windows = errors, errors.windows
        count, every = errors.windows.count, len(directions) + 1
        changes = np.zeros((every, len(errors.free)))
        candidates = np.tile(searched, (every, 1))
        for lane, (place, size) in enumerate(directions, 1):
            if place < changes.shape[1]:
                changes[lane, place] = size
            else:
                candidates[lane, place - changes.shape[1]] += size
        # windows of one direction after the other
        moved = WindowStates(
            {name: np.tile(rows, (every, 1)) for name, rows in states.parts.items()},
            np.tile(states.beside, (every, 1)),
        ).moved_by(np.repeat(changes, count, axis=0))
        self._shape = (-1, every, count)
        self._numbers = errors.values(candidates)
        self.flights: ReplayedFlights = errors.replay.flights(every * count, cores())
        inside = [errors.names.index(name) for name in errors.replay.names]
        self.flights.inputs["numbers"][:] = np.repeat(
            self._numbers[:, inside], count, axis=0
        ).T
        for name, rows in moved.parts.items():
            if name != "integrals" and rows.size:
                self.flights.state[name][:] = rows.T
            elif errors.integrals:
                # a servo's memory is its goal, its integral and its rounding
                self.flights.memories[[3 * j + 1 for j in errors.integrals]] = rows.T
        trim = np.stack([self._number(f"{TRIM}{axis}") for axis in "xyz"])
        self.flights.inputs["force"][:] = moved.beside[:, :3].T
        self.flights.inputs["torque"][:] = moved.beside[:, 3:6].T + np.repeat(
            trim, count, axis=1
        )
        self._hats = moved.beside[:, 6:].reshape(
            every * count, len(errors.unlogged), errors.hats
        )
        self._take_commands()

    def _number(self, name: str, default: float = 0.0) -> Array:
        """Values (candidates,) of a parameter by name, searched or known."""
        if name in self._errors.names:
            return self._numbers[:, self._errors.names.index(name)]
        return np.full(len(self._numbers), self._errors.known.get(name, default))

    def _take_commands(self) -> None:
        """Prepare the commands of all candidates, and the states of rotors and servos
        at the starts of the windows.
        """
        windows = self._windows
        errors = self._errors
        start = self._errors.start
        delays = self._number("delay")
        # commands are put on the clock once for each delay, not for each lane
        keys, which = _distinct(delays)
        speeds = [windows.commands("speeds", *key) for key in keys]
        self._speeds = join_arrays(speeds, np.stack), which
        ways = ("rotors.time_constant_up", "rotors.time_constant_down")
        indices = np.arange(len(keys), dtype=float)[which]
        # below 0 where it is the start's: rows with NaN would all be distinct
        keys, which = _distinct(indices, *(self._number(way, -1.0) for way in ways))
        lags = [
            {
                way: value
                for way, value in zip(ways, key[1:], strict=True)
                if value >= 0.0
            }
            for key in keys
        ]
        rotors = [vehicle_with(start, lag).rotors for lag in lags]
        begun = windows.rotor_speeds(rotors, [speeds[int(key[0])] for key in keys])
        self.flights.state["rotor_speeds"][:] = (
            begun[which].reshape(-1, len(start.rotors)).T
        )
        shares = [self._number(f"{THRUST}{each.name}", 1.0) for each in windows.flights]
        keys, which = _distinct(self._number("sag"), self._number("drift"), *shares)
        self._thrust = np.stack([windows.thrusts(*key) for key in keys]), which
        self._joints = list[tuple[int, Held, IntArray]]()
        servos = 0
        for i, joint in enumerate(start.joints):
            late, hold, tau = (
                self._number(f"drives.{joint.name}.{each}")
                for each in ("latency", "hold", "time_constant")
            )
            if errors.driven[i]:
                name = "efforts"
                keys, which = _distinct(late + self._number("joint_delay"), hold, tau)
            elif errors.servoed[i]:
                name = "setpoints"
                keys, which = _distinct(
                    delays + late, self._number("setpoint_hold", 0.5)
                )
            else:
                continue
            every = [windows.commands(name, *key) for key in keys]
            commands = join_arrays(every, np.stack)
            self._joints.append((i, commands, which))
            if errors.servoed[i]:
                # of each servo the goal, the integral and the rounding
                self.flights.memories[3 * servos] = self._goals(
                    i, commands.after[:, :, i][which]
                )
                servos += 1

    def _goals(self, joint: int, setpoints: Array) -> Array:
        """Goals (simulations,) of a joint's servo at the starts of windows, from
        setpoints (candidates, steps).
        """
        windows = self._windows
        servo = servo_of(self._errors.start, joint)
        assert servo is not None
        name = f"drives.{self._errors.start.links[joint].joint.name}.speed_limit"
        most = self._number(name, float(servo.speed_limit)) * windows.step
        # without a limit the goal is the setpoint itself
        if not np.isfinite(most).any():
            return setpoints[:, windows.before(-1)].ravel()
        goals = np.empty_like(setpoints)
        goal = setpoints[:, 0]
        for k, setpoint in enumerate(setpoints.T):
            goals[:, k] = goal
            goal = (
                # each flight begins with its servos at their setpoints
                setpoint
                if k in windows.firsts
                else goal + np.clip(setpoint - goal, -most, most)
            )
        return goals[:, windows.begins].ravel()

    def advance(self, k: int) -> None:
        """Simulate step ``k`` of all windows (short sections of a flight) under their
        commands at that step.
        """
        at = self._windows.before(k)
        inputs = self.flights.inputs

        def lanes(table: Array, which: IntArray) -> Array:
            """Values (columns, simulations) of commands (sets, steps, columns) at the
            present step of each window.

            Of commands without columns they are (simulations,).
            """
            return table[:, at][which].reshape(-1, *table.shape[2:]).T

        commands, which = self._speeds
        inputs["speeds_before"][:] = lanes(commands.before, which)
        inputs["speeds_after"][:] = lanes(commands.after, which)
        inputs["late"][0] = lanes(commands.late, which)
        inputs["thrust"][0] = lanes(*self._thrust)
        joints = {
            i: (
                lanes(commands.before[:, :, i], which),
                lanes(commands.after[:, :, i], which),
                lanes(commands.late, which),
            )
            for i, commands, which in self._joints
        }
        first = next((late for *_, late in joints.values()), None)
        # the plant has one switch for all joints
        if any((late != first).any() for *_, late in joints.values()):
            joints = {
                i: in_halves(*rows, self._windows.step) for i, rows in joints.items()
            }
        for i, (before, after, late) in joints.items():
            inputs["setpoints_before"][i] = before
            inputs["setpoints_after"][i] = after
            inputs["late"][1] = late
        if self._errors.given is not None:
            joints, rates, accelerations = np.tile(
                np.moveaxis(self._errors.given[:, at], -1, 1), self._shape[1]
            )
            self.flights.state["joints"][:] = joints
            self.flights.state["joint_rates"][:] = rates
            inputs["setpoints_before"][:] = inputs["setpoints_after"][:] = (
                HEAVY * accelerations
            )
        if self._errors.unlogged:
            hats = self._errors.hats
            place = (k + 0.5) / self._windows.length * (hats - 1)
            efforts = self._hats @ np.maximum(
                0.0, 1.0 - np.abs(np.arange(hats) - place)
            )
            for i, effort in zip(self._errors.unlogged, efforts.T, strict=True):
                inputs["setpoints_before"][i] = inputs["setpoints_after"][i] = effort
        self.flights.step()

    def read(self, sensors: Mapping[str, SensorSamples]) -> dict[str, Array]:
        """Readings (columns, candidates, W) of all sensors but the accelerometer."""
        state, names = self.flights.state, {*sensors, "gyro"} - {"accelerometer"}
        return {
            name: state[READ.get(name, name)].reshape(self._shape).copy()
            for name in names
        }

    def force(self) -> Array:
        """Mean specific force (3, candidates, W) of the last step at the inertial unit,
        m/s^2.
        """
        return self.flights.logged.reshape(self._shape).copy()

    def close(self) -> None:
        """Shut down the threads of the parallel simulations."""
        self.flights.close()


def in_halves(
    before: Array, after: Array, late: Array, step: float
) -> tuple[Array, Array, Array]:
    """Convert commands to a switch at mid-step, with unchanged mean and first moment
    over the step.

    Args:
        before: until the switch.
        after: value from it on.
        late: s, within the step.
        step: s.
    """
    share = late / step
    mean = share * before + (1.0 - share) * after
    # halves m - h and m + h have, about the step's begin, the moment m / 2 + h / 4
    half = 2.0 * share * (1.0 - share) * (after - before)
    return mean - half, mean + half, np.full_like(late, 0.5 * step)


def _distinct(*columns: Array) -> tuple[list[list[float]], IntArray]:
    """Distinct parameter sets of the candidates, and the index of each candidate's
    set.
    """
    rows, which = np.unique(np.stack(columns, axis=1), axis=0, return_inverse=True)
    return rows.tolist(), np.asarray(which.ravel(), dtype=np.int64)
