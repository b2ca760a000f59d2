"""Specific force, angular and joint accelerations of a vehicle predicted from its commands, period by period.

Rotor commands pass a dead time, the rotors' lag and their thrust curve; joint torques pass a dead time. The forward
dynamics of the articulated body, at measured rates and joint angles, gives the accelerations. No state is integrated:
errors do not grow, and nothing but accelerations and rates need be measured. The noise of what is differentiated stays
on the left side, so that no number is diluted by it (as those of a fit of inverse dynamics are).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np

from skyarm.algebra import ZERO3, Force, Mat3, Motion, Vec3
from skyarm.dynamics import forward_dynamics, inverse_dynamics, mass_matrix
from skyarm.dynamics.actuators.rotor import push, rotor_forces
from skyarm.flight_data.series import columns_at, middle
from skyarm.records.arrays import Array, IntArray, Mask
from skyarm.records.immutable import immutable
from skyarm.studies.identify.dry_friction import mean_bend
from skyarm.studies.identify.identified_parts import Surroundings
from skyarm.studies.identify.logged_commands import highest_speeds, time_constants
from skyarm.studies.identify.rotor_lag import commands_at_ends, delay_commands, integral_bends, lag_response
from skyarm.studies.identify.sampled_series import (
    delay_series,
    moving_mean,
    position_differences,
    smooth_rows,
    vectors_of,
)
from skyarm.studies.identify.servo_positions import ServoMemo
from skyarm.vehicle.vehicle_records import Vehicle

Rows: TypeAlias = slice | IntArray
Bodies: TypeAlias = tuple[Force, Sequence[Array], Array]


FLAT, PARABOLA = (0.2,) * 5, (-3 / 35, 12 / 35, 17 / 35, 12 / 35, -3 / 35)
"""Weights of five periods in the mean, and in the parabola's value in their middle."""


@immutable(eq=False)
class Stretch:
    """Part of a flight without gaps, on an even clock: N periods between N + 1 instants.

    Attributes:
        name: of the flight.
        start: s, time of the first instant. since: s, of the first instant after the flight's take-off.
        period: s.
        samples: of the sensors per period.
        fine: commands per period, a multiple of the samples; they are held for a part of it each.
        commands: (N * fine, rotors) rad/s.
        rate: (N + 1, 3) rad/s, base axes.
        specific_force: (N, 3) m/s^2 at the inertial unit, base axes, mean of each period.
        joints, joint_rates: (N + 1, n).
        efforts: (N * fine, n) commanded joint torques, N m or N; of joints that are not driven by torque unused.
        setpoints: (N * fine, n) commanded joint positions, rad or m; of joints without position servos unused.
        velocity: (N, 3) m/s against the air, base axes; zero where it is not known.
        voltage: (N,) V over that of the rotors' data; 1 where it is not known.
        width: samples that each measurement is a moving mean of; commands are averaged likewise.
        used: (N,) rows that count; all by default.
        sampled_rate: (N * samples + 1, 3) rad/s as measured, for servo joints; by default between the instants.
        sampled_force: (N * samples, 3) m/s^2 likewise.
        sampled_joints: (N * samples + 1, n) likewise.
        rate_noise: (n,) standard deviation of the noise of a joint's mean rate of a period, smoothed; 0 by default.
        differenced: whether the joint rates are differences of positions (see :func:`position_differences`), which
            smooth them.
        logged: s, of the whole log; 0 where it is not known.
        slow: whether the commands are on straight lines between samples that set the period, and show no lags.
    """

    name: str
    start: float
    period: float
    samples: int = 1
    fine: int
    commands: Array
    rate: Array
    specific_force: Array
    joints: Array
    joint_rates: Array
    efforts: Array
    velocity: Array
    voltage: Array
    width: int = 1
    setpoints: Array = field(default_factory=lambda: np.zeros((0, 0)))
    used: Mask = field(default_factory=lambda: np.zeros(0, dtype=bool))
    sampled_rate: Array = field(default_factory=lambda: np.zeros((0, 3)))
    sampled_force: Array = field(default_factory=lambda: np.zeros((0, 3)))
    sampled_joints: Array = field(default_factory=lambda: np.zeros((0, 0)))
    rate_noise: Array = field(default_factory=lambda: np.zeros(0))
    since: float = 0.0
    differenced: bool = False
    logged: float = 0.0
    slow: bool = False

    def __post_init__(self) -> None:
        if not self.used.size:
            object.__setattr__(self, "used", np.ones(self.size, dtype=bool))
        if not self.setpoints.size:
            object.__setattr__(self, "setpoints", np.zeros_like(self.efforts))

    def means(self, rows: Array) -> Array:
        """Means over each period (N, ...) of what is held for a part of it (N * fine, ...), as the sensors average."""
        sampled = rows.reshape(self.size * self.samples, self.fine // self.samples, *rows.shape[1:]).mean(axis=1)
        found: Array = moving_mean(sampled, self.width).reshape(self.size, self.samples, *rows.shape[1:]).mean(axis=1)
        return found

    def means_for_joints(self, rows: Array, bends: Array | float = 0.0) -> Array:
        """Means over each period as the joints' rates average, which may be differences of their positions.

        Args:
            rows: (N * fine, ...) means over each part of a period.
            bends: what the mean of their integral over a part is above a straight line, over the part's length.
        """
        if not self.differenced:
            return self.means(rows)
        sums = np.concatenate([np.zeros((1, *rows.shape[1:])), np.cumsum(rows, axis=0)])
        return self.means(position_differences(middle(sums) + bends, self.fine // self.samples))

    def means_between_samples(self, ends: Array) -> Array:
        """Means over each period (N, ...) of lines between values at the ends of the samples (N * samples, ...)."""
        lines = middle(np.concatenate([ends[:1], ends]))
        return self.means(np.repeat(lines, self.fine // self.samples, axis=0))

    @property
    def dry_rates(self) -> tuple[Array, Array]:
        """Means (N, n) of the joint rates over each period, and standard deviations (N, n) about them: motion, noise.

        The mean of a dry friction over it, given the measured mean of the rate, is what acts on the mean acceleration.
        Means are those of a parabola over five periods, and accelerations those of a line, by least squares (Savitzky
        and Golay 1964): the noise of a difference of two instants would count as motion, and once more as noise.
        """
        turning = smooth_rows(np.diff(self.joint_rates, axis=0) / self.period, FLAT)
        mean = self.width * self.period / self.samples if self.width > 1 else 0.0
        noise = self.rate_noise if self.rate_noise.size else np.zeros(self.joints.shape[1])
        spread = np.hypot(turning * math.hypot(self.period, mean) / math.sqrt(12.0), noise)
        return smooth_rows(middle(self.joint_rates), PARABOLA), np.asarray(spread)

    def samples_of_motion(self) -> tuple[Array, Array, Array]:
        """Rate (N * samples + 1, 3), specific force (N * samples, 3) and joints (N * samples + 1, n) at each sample."""
        if self.sampled_rate.size:
            return self.sampled_rate, self.sampled_force, self.sampled_joints
        at, known = np.arange(self.size * self.samples + 1), np.arange(self.size + 1) * self.samples
        rate, joints = (columns_at(at, known, rows) for rows in (self.rate, self.joints))
        return rate, np.repeat(self.specific_force, self.samples, axis=0), joints

    def at_middles(self, rows: Array, place: Rows) -> Array:
        """Values in the middle of some periods, of what is measured at the instants (N + 1, ...) by moving means.

        The mean of a period's ends, and the moving means, are below a swing's peak by a share of its second derivative,
        which two more instants give. What is left out of a joint's rate is squared in the centrifugal torques, and so
        has a mean: an arm that swings with 2 Hz would seem to have another centre of mass.
        """
        index = np.arange(self.size)[place]
        bend = 1.0 / 16.0 + (self.width**2 - 1.0) / (48.0 * self.samples**2)
        inside = np.where((index > 0) & (index < self.size - 1), bend, 0.0).reshape(-1, *[1] * (rows.ndim - 1))
        near = rows[index] + rows[index + 1]
        far = rows[np.maximum(index - 1, 0)] + rows[np.minimum(index + 2, self.size)]
        return 0.5 * near + inside * (near - far)

    @property
    def size(self) -> int:
        """Number of periods."""
        return len(self.specific_force)

    @property
    def seconds(self) -> float:
        """Duration, s."""
        return self.size * self.period


@immutable(kw_only=False, eq=False)
class RotorSeries:
    """Rotors over the periods of a stretch, a list over the rotors.

    Attributes:
        speeds: rad/s, means.
        changes: rad/s^2, means.
        gains: mean thrusts over those of the mean speeds.
        sampled_gains: the same of thrusts at the instants of the samples, which an accelerometer meets.
        joint_gains: the same of thrusts as the joints' rates average them.
    """

    speeds: list[Array]
    changes: list[Array]
    gains: list[Array]
    sampled_gains: list[Array]
    joint_gains: list[Array]

    def at(self, place: Rows) -> RotorSeries:
        """Series of some periods."""
        every = (self.speeds, self.changes, self.gains, self.sampled_gains, self.joint_gains)
        return RotorSeries(*([each[place] for each in row] for row in every))


@dataclass(slots=True, eq=False)
class Memo:
    """Series of rotors and servos of one stretch that were computed last: most candidates of a search share them."""

    held: dict[tuple[object, ...], tuple[Array, Array, Array]] = field(default_factory=dict)
    series: dict[tuple[object, ...], RotorSeries] = field(default_factory=dict)
    bodies: dict[tuple[object, ...], Bodies] = field(default_factory=dict)
    servos: ServoMemo = field(default_factory=ServoMemo)
    efforts: dict[float, Array] = field(default_factory=dict)

    def rotors(self, vehicle: Vehicle, delay: float, stretch: Stretch) -> RotorSeries:
        """Rotor series of a vehicle after a dead time (s)."""
        key: tuple[object, ...] = (delay, *((r.time_constant_up, r.time_constant_down) for r in vehicle.rotors))
        if key not in self.held:
            _forget(self.held)
            self.held[key] = _speeds(vehicle, delay, stretch)
        curves = (
            key,
            *(None if r.table is None else (r.table.thrust, r.table.thrust_coefficient) for r in vehicle.rotors),
        )
        if curves not in self.series:
            _forget(self.series)
            self.series[curves] = _series(vehicle, *self.held[key], stretch)
        return self.series[curves]

    def late_efforts(self, delay: float, stretch: Stretch) -> Array:
        """Commanded joint torques (3, N, joints) after a dead time (s) as gyroscope, accelerometer, joints average."""
        if delay not in self.efforts:
            _forget(self.efforts)
            fine, finer = stretch.period / stretch.fine, stretch.fine // stretch.samples
            late, bends = (each(stretch.efforts, fine, delay) for each in (delay_commands, integral_bends))
            ends = commands_at_ends(stretch.efforts, fine, delay)[finer - 1 :: finer]
            self.efforts[delay] = np.stack(
                [stretch.means(late), stretch.means_between_samples(ends), stretch.means_for_joints(late, bends)]
            )
        return self.efforts[delay]


MEMORY = 6
"""Series that a memo keeps."""


def _forget(memo: dict[Any, Any]) -> None:
    if len(memo) >= MEMORY:
        memo.pop(next(iter(memo)))


def predict(
    vehicle: Vehicle, about: Surroundings, stretch: Stretch, driven: Sequence[bool], memo: Memo | None = None
) -> Array:
    """Mean specific force at the inertial unit and accelerations over each period, from the commands.

    Args:
        vehicle: rigid bodies and rotors.
        about: delays, places, offsets.
        stretch: commands and measured motion.
        driven: for each joint, whether its torque is commanded. The motion of the other joints is given.
        memo: of this stretch.

    Returns:
        (N, 6 + driven joints): specific force (m/s^2), angular acceleration (rad/s^2), base axes, and the accelerations
        of the driven joints.

    Raises:
        ValueError: one line: another number of joints.
    """
    if len(driven) != vehicle.n:
        raise ValueError(f"driven: {len(driven)} joints, vehicle '{vehicle.name}' has {vehicle.n}")
    memo = memo or Memo()
    turning = memo.rotors(vehicle, about.delay, stretch)
    w = Vec3(*stretch.at_middles(stretch.rate, slice(None)).T)
    accelerations = _acceleration_under(
        vehicle, about, stretch, turning, slice(None), w, Vec3(*stretch.velocity.T), driven, memo, memo.bodies
    )
    gains = zip(turning.gains, turning.sampled_gains, turning.joint_gains, strict=True)
    every = accelerations([np.stack(each) for each in gains])
    (_, angular, _), (linear, turned, _), (_, _, rows) = ([_row(each, i) for each in every] for i in range(3))
    place = Vec3(*about.place)
    felt = linear + turned.cross(place) + w.cross(w.cross(place)) + Vec3(*about.offset)
    found = vectors_of((*felt, *angular, *rows), stretch.size)
    if about.accelerometer_delay:
        found[:, :3] = delay_series(found[:, :3], about.accelerometer_delay / stretch.period)
    return found


def _row(found: Vec3 | Sequence[Array], i: int) -> Any:
    """Accelerations under the gains of one row."""
    rows = [each[i] if np.ndim(each) > 1 else each for each in found]
    return Vec3(*rows) if isinstance(found, Vec3) else rows


def base_acceleration(
    vehicle: Vehicle, about: Surroundings, stretch: Stretch, place: Rows, rate: Vec3, velocity: Vec3, memo: Memo
) -> tuple[Vec3, Vec3]:
    """Proper and angular acceleration of the base, base axes, in some periods at any rate and velocity.

    Args:
        vehicle: rigid bodies and rotors.
        about: delays and offsets.
        stretch: commands, and the joints' motion, which is given.
        place: (K,) numbers of the periods.
        rate: of the base, base axes, rad/s, each (K,).
        velocity: against the air, base axes, m/s, each (K,).
        memo: of this stretch.
    """
    turning = memo.rotors(vehicle, about.delay, stretch).at(place)
    driven = (False,) * vehicle.n
    parts = (vehicle, about, stretch, turning, place, rate, velocity, driven, memo)
    linear, angular, _ = _acceleration_under(*parts)(turning.gains)
    return linear, angular


def _acceleration_under(
    vehicle: Vehicle,
    about: Surroundings,
    stretch: Stretch,
    turning: RotorSeries,
    place: Rows,
    w: Vec3,
    velocity: Vec3,
    driven: Sequence[bool],
    memo: Memo,
    held: dict[tuple[object, ...], Bodies] | None = None,
) -> Callable[[Sequence[Array]], tuple[Vec3, Vec3, Sequence[Array]]]:
    """Function from the rotors' gains, (..., K) each, to the accelerations of base and driven joints in K periods."""
    q, qd = (tuple(stretch.at_middles(rows, place).T) for rows in (stretch.joints, stretch.joint_rates))
    since = stretch.since + stretch.period * np.arange(stretch.size)[place]
    scale = about.thrust * stretch.voltage[place] ** about.sag * (1.0 + about.drift * since)
    beside = Force(_spin_torque(vehicle, turning, w) + Vec3(*about.torque), _air_drag(vehicle, velocity))
    efforts = _joint_efforts(vehicle, about, stretch, place, qd, memo) if any(driven) else [0.0 * x for x in qd]
    given = (stretch.joint_rates[1:][place] - stretch.joint_rates[:-1][place]) / stretch.period
    bodies = None if all(driven) else _bodies(vehicle, q, w, qd, driven, given, {} if held is None else held)

    def accelerations(gains: Sequence[Array]) -> tuple[Vec3, Vec3, Sequence[Array]]:
        pushed = rotor_forces(vehicle.rotors, turning.speeds, velocity, w, [gain * scale for gain in gains])
        applied = Force(pushed.torque + beside.torque, pushed.force + beside.force)
        if bodies is not None:
            return _with_given_joints(bodies, applied, efforts, driven)
        base, moved = forward_dynamics(vehicle, q, w, qd, applied, efforts)
        return base.linear, base.angular, [np.asarray(each) for each in moved]

    return accelerations


def _joint_efforts(
    vehicle: Vehicle, about: Surroundings, stretch: Stretch, place: Rows, joint_rates: Sequence[Array], memo: Memo
) -> list[Array]:
    """Joint torques or forces after dead time and limit, less friction, in some periods.

    Returns:
        (3, K) of each joint: as gyroscope, accelerometer and joints average them.
    """
    late = memo.late_efforts(about.joint_delay, stretch)[:, place]
    dry, spread = (rows[place] for rows in stretch.dry_rates)
    return [
        np.clip(torque, -float(link.joint.effort_limit), float(link.joint.effort_limit))
        - link.joint.damping * x
        - link.joint.coulomb * mean_bend(mean, around, float(link.joint.coulomb_rate))
        for link, torque, x, mean, around in zip(
            vehicle.links, np.moveaxis(late, -1, 0), joint_rates, dry.T, spread.T, strict=True
        )
    ]


def prediction_errors(
    vehicle: Vehicle,
    about: Surroundings,
    stretch: Stretch,
    driven: Sequence[bool],
    memo: Memo | None = None,
    servoed: Sequence[bool] = (),
) -> Array:
    """Measured less predicted series: specific force, rates summed up from accelerations, positions of servo joints.

    Noise of a measured rate is white in the sums, and slow disturbances are slow. Sums and positions are without their
    means: an encoder's zero is not the servo's. Sums stand still where a period is not used: what acted there would
    stay in them.

    Returns:
        (N, 6 + driven joints + servo joints).
    """
    predicted = predict(vehicle, about, stretch, driven, memo)
    moving = [i for i, each in enumerate(driven) if each]
    rates = np.concatenate([stretch.rate, stretch.joint_rates[:, moving]], axis=1)
    gained = np.diff(rates, axis=0) - predicted[:, 3:] * stretch.period
    summed = np.cumsum(np.where(stretch.used[:, None], gained, 0.0), axis=0)
    columns = [stretch.specific_force - predicted[:, :3], summed - summed.mean(axis=0)]
    if any(servoed):
        turned = (memo or Memo()).servos.positions(vehicle, about, stretch, servoed)
        off = (stretch.joints[:, np.flatnonzero(servoed)] - turned)[1:]
        columns.append(off - off[stretch.used].mean(axis=0))
    return np.concatenate(columns, axis=1)


def _speeds(vehicle: Vehicle, delay: float, stretch: Stretch) -> tuple[Array, Array, Array]:
    """Rotor speeds (N * fine, rotors): means and mean squares over each fine period and values at its end."""
    held = np.minimum(stretch.commands, highest_speeds(vehicle.rotors))
    up, down = time_constants(vehicle.rotors).T
    return lag_response(held, stretch.period / stretch.fine, delay, up, down)


def _series(vehicle: Vehicle, means: Array, squares: Array, ends: Array, stretch: Stretch) -> RotorSeries:
    """Rotor series of the stretch's periods from those of its fine periods."""
    found, finer = RotorSeries([], [], [], [], []), stretch.fine // stretch.samples
    for i, rotor in enumerate(vehicle.rotors):
        mean = stretch.means(means[:, i])
        sampled = ends[finer - 1 :: finer, i]
        last = moving_mean(sampled, stretch.width)[stretch.samples - 1 :: stretch.samples]
        least = np.maximum(push(rotor, mean), 1e-12)
        found.speeds.append(mean)
        found.changes.append(np.diff(last, prepend=last[:1]) / stretch.period)
        thrusts = push(rotor, np.sqrt(np.maximum(squares[:, i], 0.0)))
        found.gains.append(stretch.means(thrusts) / least)
        found.joint_gains.append(stretch.means_for_joints(thrusts) / least)
        found.sampled_gains.append(stretch.means_between_samples(push(rotor, sampled)) / least)
    return found


def _spin_torque(vehicle: Vehicle, turning: RotorSeries, rate: Vec3) -> Vec3:
    """Reaction torque of rotors that speed up and are turned, N m (see ``spin_torque`` of the rotor's model)."""
    total = ZERO3
    for rotor, speed, change in zip(vehicle.rotors, turning.speeds, turning.changes, strict=True):
        spin = rotor.inertia * rotor.direction
        total = total - (rate.cross(rotor.axis) * speed + rotor.axis * change) * spin
    return total


def _air_drag(vehicle: Vehicle, velocity: Vec3) -> Vec3:
    """Quadratic drag of the airframe at the base origin, N, base axes."""
    speed = np.sqrt(velocity.dot(velocity))
    half = 0.5 * vehicle.drag.air_density
    return Vec3(*(-half * area * speed * v for area, v in zip(vehicle.drag.area, velocity, strict=True)))


def _bodies(
    vehicle: Vehicle,
    joints: Sequence[Array],
    rate: Vec3,
    joint_rates: Sequence[Array],
    driven: Sequence[bool],
    given: Array,
    held: dict[tuple[object, ...], Bodies],
) -> Bodies:
    """Bias wrench and efforts of the measured motion, and inverse mass matrix of base and driven joints.

    They depend on the bodies alone, which most candidates of a search share, and are kept by them.
    """
    key = (vehicle.base, vehicle.links)
    if key not in held:
        _forget(held)
        still = [np.where(moves, 0.0, 1.0) * column for moves, column in zip(driven, given.T, strict=True)]
        bias, holding = inverse_dynamics(vehicle, joints, rate, joint_rates, Motion(ZERO3, ZERO3), still)
        free = [*range(6), *(6 + i for i, moves in enumerate(driven) if moves)]
        M = mass_matrix(vehicle, Mat3.identity(), joints)
        left = np.stack([vectors_of([M[i][j] for j in free], len(given)) for i in free], axis=-2)
        held[key] = bias, holding, np.asarray(np.linalg.inv(left))
    return held[key]


def _with_given_joints(
    bodies: Bodies, applied: Force, efforts: Sequence[Array], driven: Sequence[bool]
) -> tuple[Vec3, Vec3, list[Array]]:
    """Accelerations of the base and the driven joints where the motion of the other joints is given."""
    bias, holding, inverse = bodies
    pushed = applied - bias
    pulled = [a - b for a, b, moves in zip(efforts, holding, driven, strict=True) if moves]
    right = np.stack(np.broadcast_arrays(*pushed.force, *pushed.torque, *pulled), axis=-1)
    rows = list(np.moveaxis((inverse @ right[..., None])[..., 0], -1, 0))
    return Vec3(*rows[:3]), Vec3(*rows[3:6]), rows[6:]
