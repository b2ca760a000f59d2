"""Response of position-controlled joints to their setpoints, simulated with the vehicle's own servo model.

M(t) q'' = effort(goal - q, q') - friction(q') - load(t). Loop, motor limits, dead time and rate limit are those of
:mod:`skyarm.dynamics.actuators.servo`; the joints' mass matrix M and their load (gravity and the motion of the base)
follow from the vehicle and the measured motion. A servo loop is stable and forgets, so that its
output error is fitted: encoder noise stays in the residual and biases no stiffness, as it would if measured angles
entered the loop of the prediction (Ljung, System Identification, 1999, 4.3 and 13.4).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from skyarm.algebra import Mat3, Motion, Vec3
from skyarm.dynamics import inverse_dynamics, mass_matrix
from skyarm.dynamics.actuators.servo import PositionServo
from skyarm.flight_data.series import middle
from skyarm.records.arrays import Array
from skyarm.studies.identify.sampled_series import vectors_of
from skyarm.studies.identify.unknowns import servo_of
from skyarm.vehicle.linkage import Joint
from skyarm.vehicle.vehicle_records import Vehicle

STRETCH = 0.5
"""s, of the parts of a series that are simulated side by side, each from its measured state."""

FORGOTTEN = 4.0
"""Slowest time constants of a loop that are simulated before a part: of the state's error there, 2 % is left."""

LONGEST = 1.0
"""s, most that is simulated before a part."""

STEP = 0.1
"""Time steps times the loop's natural frequency; the trapezoidal rule then errs by 0.08 % of the frequency."""

LEAST = 3
"""Time steps within a sample at least, if it is too long for one: a dead time falls anywhere within it."""


def joint_loads(
    vehicle: Vehicle,
    servoed: Sequence[int],
    rate: Array,
    specific_force: Array,
    joints: Array,
    step: float,
) -> tuple[Array, Array]:
    """Mass matrix of the servo joints, and the efforts that they require where they do not accelerate.

    Args:
        vehicle: rigid bodies.
        servoed: numbers of the servo joints.
        rate: (N + 1, 3) rad/s of the base, base axes.
        specific_force: (N, 3) m/s^2 at the base, base axes.
        joints: (N + 1, n) rad or m.
        step: s.

    Returns:
        Mass matrices (N, servo joints, servo joints), kg m^2 or kg, and loads (N, servo joints), N m or N.
    """
    size, rows = len(specific_force), list(servoed)
    rates = np.gradient(joints, step, axis=0)
    q, qd, w = (tuple(middle(each).T) for each in (joints, rates, rate))
    given = np.gradient(rates, step, axis=0)
    given[:, rows] = 0.0
    base = Motion(Vec3(*(np.diff(rate, axis=0) / step).T), Vec3(*specific_force.T))
    _, efforts = inverse_dynamics(vehicle, q, Vec3(*w), qd, base, tuple(middle(given).T))
    M = mass_matrix(vehicle, Mat3.identity(), q)
    block = [vectors_of([M[6 + i][6 + j] for j in rows], size) for i in rows]
    return np.stack(block, axis=-2), vectors_of([efforts[i] for i in rows], size)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Loops:
    """Position loops of some joints: servos, and joints with their friction and effort limits."""

    servos: tuple[PositionServo, ...]
    joints: tuple[Joint, ...]

    def row(self, record: str, name: str) -> Array:
        """One field of all servos or joints."""
        return np.array([float(getattr(each, name)) for each in getattr(self, record)])

    def frequency(self, inertia: Array) -> float:
        """Largest natural frequency of the loops, rad/s."""
        least = np.diagonal(inertia, axis1=1, axis2=2).min(axis=0)
        return float(np.sqrt(self.row("servos", "stiffness") / least).max())

    def memory(self, inertia: Array) -> float:
        """Time (s) after which the loops have forgotten a state."""
        K, D = self.row("servos", "stiffness"), self.row("servos", "damping") + self.row("joints", "damping")
        D, most = np.maximum(D, 1e-9), np.diagonal(inertia, axis1=1, axis2=2).max(axis=0)
        slow = self.row("servos", "integral") / K  # an integral's pole, 1/s
        times = 2.0 * most / D, D / K, np.where(slow > 0.0, 1.0 / np.maximum(slow, 1e-9), 0.0)
        return min(FORGOTTEN * float(np.max(times)), LONGEST)

    def bound(self, effort: Array, rate: Array) -> Array:
        """Efforts (..., joints) within what motor, supply and joint give."""
        found = np.empty_like(effort)
        for i, (servo, joint) in enumerate(zip(self.servos, self.joints, strict=True)):
            low, high = (np.asarray(each) for each in servo.bounds(rate[..., i]))
            limit = float(joint.effort_limit)
            found[..., i] = np.clip(effort[..., i], np.maximum(low, -limit), np.minimum(high, limit))
        return found

    def least_bound(self, rate: float) -> float:
        """Effort (N m or N) that every motor gives in both directions at joint rates up to a given one (rad/s)."""
        most = np.full((4, len(self.servos)), math.inf) * np.array([[-1.0], [-1.0], [1.0], [1.0]])
        fastest = np.full(most.shape, rate) * np.array([[-1.0], [1.0], [-1.0], [1.0]])
        return float(np.abs(self.bound(most, fastest)).min())


def loops_of(vehicle: Vehicle, servoed: Sequence[int]) -> Loops:
    """Position loops of a vehicle's servo joints, by their numbers."""
    servos = (servo_of(vehicle, i) for i in servoed)
    return Loops(tuple(each for each in servos if each is not None), tuple(vehicle.links[i].joint for i in servoed))


def servo_steps(frequency: float, samples: int, finer: int, step: float) -> tuple[int, int]:
    """Samples (of some, s apart) that are taken together, and time steps within them, for loops of a frequency.

    Commands that come in some parts of a sample are not averaged over more than a time step.
    """
    most = max(1.0, STEP / (step * frequency))
    many = max(each for each in range(1, samples + 1) if samples % each == 0 and each <= most)
    inner = math.ceil(many * step * frequency / STEP)
    return (many, inner) if many > 1 or inner == 1 else (1, finer * math.ceil(max(inner, LEAST) / finer))


def servo_response(
    every: Sequence[Loops],
    setpoints: Array,
    inertia: Array,
    load: Array,
    joints: Array,
    rates: Array,
    step: float,
    before: int,
) -> Array:
    """Positions of joints at the end of each step, by their setpoints; parts of the series begin as measured.

    The trapezoidal rule with the secant of the dry friction: stable for any gains, exact at rest. All parts of all
    candidates are simulated side by side.

    Args:
        every: loops of n joints, of each of C candidates; what motors and joints give at most is that of the first.
        setpoints: (C, N, inner, n) rad or m after dead time, means over each of the time steps within a step.
        inertia: (C, N, n, n) mass matrices.
        load: (C, N, n) N m or N.
        joints: (N, n) measured at the begin of each step: initial states.
        rates: (N, n) likewise.
        step: s.
        before: steps that are simulated before each part.

    Returns:
        (C, N, n) rad or m.
    """
    K, D, Ki, limits = (_rows(every, "servos", name) for name in ("stiffness", "damping", "integral", "speed_limit"))
    viscous, dry, bend = (_rows(every, "joints", name) for name in ("damping", "coulomb", "coulomb_rate"))
    size = max(1, round(STRETCH / step))
    count, inner, n = setpoints.shape[1:]
    dt, parts = step / inner, -(-count // size)
    first = np.clip(np.arange(0, count, size) - before, 0, count - 1)
    q, v = (np.repeat(rows[first].T[:, None, :], len(every), axis=1) for rows in (joints, rates))
    flat = setpoints.reshape(len(every), count * inner, n)
    most = limits[..., 0].T * dt
    flat = np.stack(
        [[_follow(a, b) for a, b in zip(rows.T, row, strict=True)] for rows, row in zip(flat, most, strict=True)]
    )
    goals = _pad(flat.reshape(len(every), n, count, inner).transpose(1, 3, 0, 2), before, parts * size)
    M = _pad((2.0 / dt) * inertia.transpose(2, 3, 0, 1), before, parts * size)
    loads = _pad(load.transpose(2, 0, 1), before, parts * size)

    def at(series: Array, k: int) -> Array:
        return series[..., k : k + (parts - 1) * size + 1 : size]

    # a measured state does not show the integral: it is such that the joint moves evenly
    held = at(loads, 0) + D * v - K * (at(goals, 0)[:, 0] - q)
    total = np.where(Ki > 0.0, held / np.where(Ki > 0.0, Ki, 1.0), 0.0)
    # of a motor that is far from its limits they are not looked at
    safe = every[0].least_bound(2.0 * float(np.abs(rates).max(initial=0.0)))
    found, mean = np.empty((n, len(every), parts, size)), v
    for k in range(before + size):
        matrix, pull, begin = np.ascontiguousarray(at(M, k)), at(loads, k), (q, v, total)
        for goal in at(goals, k).swapaxes(0, 1):
            carried = (matrix * v).sum(axis=1) - pull
            spring, damped = K * (goal - q) + Ki * total, D + viscous + 0.5 * dt * K
            for _ in range(2 if dry.any() else 1):
                slope = _secant(dry, bend, mean)
                mean = _solve(matrix, damped + slope, carried + spring)
            effort = spring - (D + 0.5 * dt * K) * mean
            grown = dt * (goal - q)
            if np.abs(effort).max() > safe:
                given = np.moveaxis(every[0].bound(np.moveaxis(effort, 0, -1), np.moveaxis(mean, 0, -1)), -1, 0)
                short = np.abs(given - effort) > 1e-12
                mean = _solve(
                    matrix, np.where(short, viscous, damped) + slope, carried + np.where(short, given, spring)
                )
                grown = np.where(short, 0.0, grown)
            q, v, total = q + dt * mean, 2.0 * mean - v, total + grown
        if k < before:
            flown = np.arange(parts) * size >= before - k
            q, v, total = (np.where(flown, new, old) for new, old in zip((q, v, total), begin, strict=True))
        else:
            found[..., k - before] = q
    return found.reshape(n, len(every), -1)[..., :count].transpose(1, 2, 0)


def _rows(every: Sequence[Loops], record: str, name: str) -> Array:
    """One field of all servos or joints of all candidates, (n, C, 1)."""
    return np.stack([each.row(record, name) for each in every], axis=1)[..., None]


def _pad(rows: Array, before: int, size: int) -> Array:
    """Series (..., N) with its first row for some steps before, and up to some length with its last one."""
    return np.pad(rows, [*[(0, 0)] * (rows.ndim - 1), (before, size - rows.shape[-1])], mode="edge")


def _follow(setpoints: Array, most: float) -> Array:
    """Goal (N,) that follows a setpoint by at most so much a step."""
    if np.abs(np.diff(setpoints)).max(initial=0.0) <= most:
        return setpoints
    found = setpoints.tolist()
    for k in range(1, len(found)):
        found[k] = found[k - 1] + min(max(found[k] - found[k - 1], -most), most)
    return np.array(found)


def _solve(matrix: Array, diagonal: Array, right: Array) -> Array:
    """Solution (n, ...) of positive definite matrices (n, n, ...) with more on their diagonals."""
    size = len(matrix)
    left = [[matrix[i, j] + diagonal[i] if i == j else matrix[i, j] for j in range(size)] for i in range(size)]
    found = list(right)
    for i in range(size):
        for k in range(i + 1, size):
            share = left[k][i] / left[i][i]
            left[k][i + 1 :] = [a - share * b for a, b in zip(left[k][i + 1 :], left[i][i + 1 :], strict=True)]
            found[k] = found[k] - share * found[i]
    for i in reversed(range(size)):
        for k in range(i + 1, size):
            found[i] = found[i] - left[i][k] * found[k]
        found[i] = found[i] / left[i][i]
    return np.stack(found)


def _secant(dry: Array, bend: Array, rate: Array) -> Array:
    """Dry friction c tanh(v / v0) over the rate v, N m s/rad; its slope at rest."""
    x = np.maximum(np.abs(rate / bend), 1e-9)
    return dry / bend * np.tanh(x) / x
