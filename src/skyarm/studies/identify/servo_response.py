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
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from skyarm.algebra import Mat3, Motion, Vec3
from skyarm.dynamics import inverse_dynamics, mass_matrix
from skyarm.dynamics.actuators.servo import PositionServo
from skyarm.vehicle.linkage import Joint
from skyarm.vehicle.vehicle_records import MountedDrive, Vehicle

Array: TypeAlias = npt.NDArray[np.float64]

STRETCH = 0.5
"""s, of the parts of a series that are simulated side by side, each from its measured state."""

FORGOTTEN = 4.0
"""Slowest time constants of a loop that are simulated before a part: of the state's error there, 2 % is left."""

LONGEST = 1.0
"""s, most that is simulated before a part."""

STEP = 0.1
"""Time steps times the loop's natural frequency; the trapezoidal rule then errs by 0.08 % of the frequency."""

LEAST = 3
"""Time steps within a sample at least: a dead time falls anywhere within it."""

UNKNOWN = 20.0
"""rad/s, natural frequency that a servo of an unknown make is thought to have, critically damped."""


def servo_of(vehicle: Vehicle, joint: int) -> PositionServo | None:
    """Position servo of a joint; None where the vehicle has another drive or none."""
    name = vehicle.links[joint].joint.name
    drives = [each.drive for each in vehicle.drives if each.name == name]
    return drives[0] if drives and isinstance(drives[0], PositionServo) else None


def with_servos(vehicle: Vehicle, servoed: Sequence[bool]) -> Vehicle:
    """Vehicle with a position servo of moderate gains on each joint that takes setpoints and has no drive.

    Args:
        vehicle: start.
        servoed: of each joint, whether its setpoints are positions.

    Raises:
        ValueError: one line: such a joint has a drive that takes no position.
    """
    made = list(vehicle.drives)
    for i, (link, moves) in enumerate(zip(vehicle.links, servoed, strict=True)):
        if not moves or servo_of(vehicle, i) is not None:
            continue
        name = link.joint.name
        if name in [each.name for each in vehicle.drives]:
            raise ValueError(f"drives.{name}: must be a position_servo, or none: joint_commands are its setpoints")
        inertia = float(mass_matrix(vehicle, Mat3.identity(), [0.0] * vehicle.n)[6 + i][6 + i])
        servo = PositionServo(inertia=inertia, stiffness=inertia * UNKNOWN**2, damping=2.0 * inertia * UNKNOWN)
        made.append(MountedDrive(name=name, drive=servo))
    return dataclasses.replace(vehicle, drives=tuple(made)) if len(made) > len(vehicle.drives) else vehicle


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
    q, qd, w = (tuple((0.5 * (each[1:] + each[:-1])).T) for each in (joints, rates, rate))
    given = np.gradient(rates, step, axis=0)
    given[:, rows] = 0.0
    base = Motion(Vec3(*(np.diff(rate, axis=0) / step).T), Vec3(*specific_force.T))
    _, efforts = inverse_dynamics(vehicle, q, Vec3(*w), qd, base, tuple((0.5 * (given[1:] + given[:-1])).T))
    M, zero = mass_matrix(vehicle, Mat3.identity(), q), np.zeros(size)
    block = [np.stack([np.asarray(zero + M[6 + i][6 + j]) for j in rows], axis=-1) for i in rows]
    return np.stack(block, axis=-2), np.stack([np.asarray(zero + efforts[i]) for i in rows], axis=-1)


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
    return (many, inner) if many > 1 else (1, finer * math.ceil(max(inner, LEAST) / finer))


def servo_response(
    loops: Loops,
    setpoints: Array,
    inertia: Array,
    load: Array,
    joints: Array,
    rates: Array,
    step: float,
) -> Array:
    """Positions of joints at the end of each step, by their setpoints; parts of the series begin as measured.

    The trapezoidal rule with the secant of the dry friction: stable for any gains, exact at rest.

    Args:
        loops: of n joints.
        setpoints: (N, inner, n) rad or m after dead time, means over each of the time steps within a step.
        inertia: (N, n, n) mass matrices.
        load: (N, n) N m or N.
        joints: (N, n) measured at the begin of each step: initial states.
        rates: (N, n) likewise.
        step: s.

    Returns:
        (N, n) rad or m.
    """
    K, D, Ki, limits = (loops.row("servos", name) for name in ("stiffness", "damping", "integral", "speed_limit"))
    viscous, dry, bend = (loops.row("joints", name) for name in ("damping", "coulomb", "coulomb_rate"))
    size, before = max(1, round(STRETCH / step)), math.ceil(loops.memory(inertia) / step)
    count, inner = setpoints.shape[:2]
    dt = step / inner
    places = np.arange(0, count, size)[None, :] - before + np.arange(before + size)[:, None]
    first = np.clip(places[0], 0, count - 1)
    q, v = joints[first], rates[first]
    flat = setpoints.reshape(count * inner, -1)
    goals = np.stack([_follow(a, b) for a, b in zip(flat.T, limits * dt, strict=True)], axis=1).reshape(setpoints.shape)
    # a measured state does not show the integral: it is such that the joint moves evenly
    held = load[first] + D * v - K * (goals[first, 0] - q)
    total = np.where(Ki > 0.0, held / np.where(Ki > 0.0, Ki, 1.0), 0.0)
    # of a motor that is far from its limits they are not looked at
    safe = loops.least_bound(2.0 * float(np.abs(rates).max(initial=0.0)))
    found, mean, eye = np.empty((size, *q.shape)), v, np.eye(len(K))
    for k in range(before + size):
        at = np.clip(places[k], 0, count - 1)
        flown = (places[k] >= 0)[:, None]
        M, pull, begin = (2.0 / dt) * inertia[at], load[at], (q, v, total)
        for goal in goals[at].swapaxes(0, 1):
            carried = (M @ v[..., None])[..., 0] - pull
            spring, damped = K * (goal - q) + Ki * total, D + viscous + 0.5 * dt * K
            for _ in range(2 if dry.any() else 1):
                slope = _secant(dry, bend, mean)
                mean = _solve(M, eye, damped + slope, carried + spring)
            effort = spring - (D + 0.5 * dt * K) * mean
            grown = dt * (goal - q)
            if np.abs(effort).max() > safe:
                given = loops.bound(effort, mean)
                short = np.abs(given - effort) > 1e-12
                mean = _solve(
                    M, eye, np.where(short, viscous, damped) + slope, carried + np.where(short, given, spring)
                )
                grown = np.where(short, 0.0, grown)
            q, v, total = q + dt * mean, 2.0 * mean - v, total + grown
        q, v, total = (np.where(flown, new, old) for new, old in zip((q, v, total), begin, strict=True))
        if k >= before:
            found[k - before] = q
    series: Array = found.transpose(1, 0, 2).reshape(-1, len(K))[:count]
    return series


def _follow(setpoints: Array, most: float) -> Array:
    """Goal (N,) that follows a setpoint by at most so much a step."""
    if np.abs(np.diff(setpoints)).max(initial=0.0) <= most:
        return setpoints
    found = setpoints.tolist()
    for k in range(1, len(found)):
        found[k] = found[k - 1] + min(max(found[k] - found[k - 1], -most), most)
    return np.array(found)


def _solve(matrix: Array, eye: Array, diagonal: Array, right: Array) -> Array:
    """Solution (..., n) of matrices with more on their diagonals."""
    if len(eye) == 1:
        return np.asarray(right / (matrix[..., 0] + diagonal))
    return np.asarray(np.linalg.solve(matrix + diagonal[..., None] * eye, right[..., None])[..., 0])


def _secant(dry: Array, bend: Array, rate: Array) -> Array:
    """Dry friction c tanh(v / v0) over the rate v, N m s/rad; its slope at rest."""
    x = np.maximum(np.abs(rate / bend), 1e-9)
    return np.asarray(dry / bend * np.tanh(x) / x)
