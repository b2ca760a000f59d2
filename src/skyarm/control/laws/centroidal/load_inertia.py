"""Estimate of a load's inertia about its own centre of mass while the reference rotates the hand.

A load tells of its inertia by torques only, and only where it is turned: the law's references say how. With w and alpha
of the tip in its own axes, and a load of moments I = diag(I_x, I_y, I_z) there, the hand has to give

    t = I alpha + w x I w = Y(w, alpha) (I_x, I_y, I_z),

so that moments beyond those of the model stand in the observed efforts of the joints as -J_w^T t. Y is that of the
reference, without noise, filtered as the observer filters (two poles, and the known delay); of both sides a slow mean
is taken off, which is what of weight and friction is wrong. The moments are then the least squares of all that was
observed since the load was taken, the older forgotten as fast as the hand is turned, beside what is believed:

    sum |e - phi . I|^2 / noise + sum_k |I_k - m size^2|^2 / (m spread^2)^2,       phi = -J_w^T Y

An axis about which the hand is not turned keeps the small moment of a load that is told nothing. Of diagonal moments
those that a body of positive density can have are the ones whose second moments of mass are positive,

    s_k = (I_x + I_y + I_z) / 2 - I_k >= m size^2 / 2,

which is the triangle inequality of the moments. The products of inertia in the tip's axes are not learned.
Sources: An, Atkeson, Hollerbach 1985, "Estimation of inertial parameters of rigid body links", CDC (regressors);
Wensing, Kim, Slotine 2018, IEEE Robotics and Automation Letters 3(1) (physical consistency, s_k).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import Mat3, Vec3, ldl_solve
from skyarm.algebra.scalars import Scalar, clip, divide, exp, maximum, where
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.blocks.attitude import posture
from skyarm.control.blocks.filters import low_pass_share
from skyarm.control.blocks.select import data, vector_data
from skyarm.control.laws.centroidal.tip_force import LeastSquares
from skyarm.control.laws.centroidal.tip_rotation import tip_rotation, turning, values_of
from skyarm.control.laws.centroidal.tip_tasks import turn_by_yaw
from skyarm.dynamics import mass_matrix
from skyarm.dynamics.kinematics import frame_pose, jacobian_columns
from skyarm.records.units import Unit
from skyarm.vehicle.vehicle_records import Vehicle

ORIGIN = Vec3(0.0, 0.0, 0.0)

TINY = 1e-9
"""kg m^2, of what is not surprising of a load without mass."""


@dataclass(frozen=True, kw_only=True, slots=True)
class InertiaGains:
    """Constants of the learned inertia of a load, chosen on other bars and seeds than docs/carrying.md reports.

    Attributes:
        spread: of what is believed of each moment beforehand, mass times its square.
        stout: of each axis of the tip, the inertia of the unloaded vehicle that its joints and its base feel there: the
            less it is, the sooner is a moment that is believed too large too stiff.
        noise, colour: of a joint's observed torque, and for how long it stays alike: so many seconds are one reading.
    """

    stout: Annotated[tuple[Scalar, ...], Unit("kg m^2", "of the vehicle about each axis of the tip", low=0.0)]
    spread: Annotated[Scalar, Unit("m", "radius of gyration that is not surprising", low=0.0, strict=True)] = 0.1
    furthest: Annotated[Scalar, Unit("m", "root of the largest second moment of mass per kg", low=0.0)] = 0.15
    noise: Annotated[Scalar, Unit("N m", "of a joint's observed torque", low=0.0, strict=True)] = 0.005
    colour: Annotated[Scalar, Unit("s", "for which that noise stays alike", low=0.0, strict=True)] = 0.1
    forgetting: Annotated[Scalar, Unit("1/s", "of what was observed, while the hand is turned", low=0.0)] = 0.5
    turned: Annotated[Scalar, Unit("rad/s^2", "angular acceleration below which little is told or forgotten")] = 2.0
    mean_rate: Annotated[Scalar, Unit("rad/s", "filter of means, which tell nothing", low=0.0)] = 1.0
    pace: Annotated[Scalar, Unit("rad/s", "with which the model follows what is found", low=0.0)] = 5.0


@dataclass(frozen=True, kw_only=True, slots=True)
class JointMeans:
    """Slow means of a joint's observed effort, and of the torques of 1 kg m^2 about each axis of the tip in it."""

    effort: Annotated[Scalar, Unit("N m or N", "mean")] = 0.0
    unit: Annotated[tuple[Scalar, ...], Unit("1/s^2", "means, of 1 kg m^2 about each axis of the tip")] = (0.0,) * 3


@dataclass(frozen=True, kw_only=True, slots=True)
class InertiaMemory:
    """Memory of the learned inertia.

    Attributes:
        once, twice: torques of 1 kg m^2 about each axis of the tip, after one and two stages of the observer's lag.
        A, b: normal equations, lower triangle row by row. moments: about the centre of mass, axes of the tip.
    """

    once: Annotated[tuple[Vec3, ...], Unit("1/s^2", "world axes")] = (ORIGIN,) * 3
    twice: Annotated[tuple[Vec3, ...], Unit("1/s^2", "world axes")] = (ORIGIN,) * 3
    means: tuple[JointMeans, ...]
    A: Annotated[tuple[Scalar, ...], Unit("1/(kg m^2)^2", "information")] = (0.0,) * 6
    b: Annotated[tuple[Scalar, ...], Unit("1/(kg m^2)", "information times moments")] = (0.0,) * 3
    moments: Annotated[Vec3, Unit("kg m^2", "about the centre of mass, axes of the tip")] = ORIGIN


def unit_torques(vehicle: Vehicle, signals: Sequence[Taylor]) -> tuple[Vec3, Vec3, Vec3]:
    """Torque (N m, world axes) that turns a load of 1 kg m^2 about each axis of the tip, as the reference does.

    Args:
        vehicle: model.
        signals: x, y, z, yaw and the joints of a level base, series in time.
    """
    yaw = signals[3].truncate(2)
    R = tip_rotation(vehicle, posture(vehicle, [q.truncate(2) for q in signals[4:]], 2))
    world = Mat3.columns(*(turn_by_yaw(yaw, R.column(k)) for k in range(3)))
    rate, acceleration = turning(world)
    level = values_of(world)
    w, a = level.apply_T(rate), level.apply_T(acceleration)
    own = (
        Vec3(a.x, w.x * w.z, -(w.x * w.y)),
        Vec3(-(w.y * w.z), a.y, w.x * w.y),
        Vec3(w.y * w.z, -(w.x * w.z), a.z),
    )
    x, y, z = (level.apply(each) for each in own)
    return x, y, z


def learn_inertia(
    gains: InertiaGains,
    memory: InertiaMemory,
    mass: Any,
    size: Any,
    vehicle: Vehicle,
    R: Mat3,
    joints: Sequence[Any],
    unit: Sequence[Vec3],
    efforts: Sequence[Any],
    holds: Any,
    learns: Any,
    late: Any,
    dt: Any,
) -> InertiaMemory:
    """The moments one period later.

    Args:
        gains: constants.
        memory: one period earlier.
        mass: kg, of the load.
        size: m, its radius of gyration as far as nothing is known.
        vehicle: model, whose tip holds the load.
        R: R_WB at the measurement's time.
        joints: then, rad or m.
        unit: torques of 1 kg m^2 about each axis of the tip, now, world axes: :func:`unit_torques`.
        efforts: N m or N, that the observer holds.
        holds: whether something is held.
        learns: 1 where the efforts tell of the load, 0 elsewhere.
        late: s, of each of two stages that delay as observer and measurement do.
        dt: s.
    """
    share = 1.0 - exp(-divide(dt, late))
    once = tuple(vector_data(old + (new - old) * share) for old, new in zip(memory.once, unit, strict=True))
    twice = tuple(vector_data(old + (new - old) * share) for old, new in zip(memory.twice, once, strict=True))
    columns = [column.angular for column in jacobian_columns(vehicle, vehicle.frame(), joints)]
    torques = [R.apply_T(each) for each in twice]
    step = where(holds, low_pass_share(gains.mean_rate, dt), 0.0) * learns
    weight = divide(where(holds, dt, 0.0) * learns, gains.noise * gains.noise * gains.colour)
    squares, means, excited = LeastSquares(3), [], 0.0
    for column, effort, mean in zip(columns, efforts, memory.means, strict=True):
        phi = [-column.dot(torque) for torque in torques]
        rest = [p - m for p, m in zip(phi, mean.unit, strict=True)]
        total = effort - mean.effort
        for p, moment in zip(rest, memory.moments, strict=True):
            total = total + p * moment
            excited = excited + p * p
        squares.require(rest, total, weight)
        unit_means = (where(holds, m + step * (p - m), 0.0) for p, m in zip(phi, mean.unit, strict=True))
        effort_mean = where(holds, mean.effort + step * (effort - mean.effort), 0.0)
        means.append(JointMeans(effort=effort_mean, unit=tuple(unit_means)))
    # what was observed fades as fast as the hand is turned anew, and not at all while it rests
    new = divide(excited, excited + gains.turned * gains.turned)
    kept = where(holds, 1.0 - low_pass_share(gains.forgetting, dt) * learns * new, 0.0)
    A = [old * kept + each for old, each in zip(memory.A, (squares.A[i][j] for i, j in LOWER), strict=True)]
    b = [old * kept + each for old, each in zip(memory.b, squares.b, strict=True)]
    solved, known = _solve_moments(gains, mass, size, A, b)
    found = consistent(gains, mass, size, solved, known)
    pace = low_pass_share(gains.pace, dt)
    moments = consistent(gains, mass, size, memory.moments + (found - memory.moments) * pace, known)
    return InertiaMemory(
        once=once,
        twice=twice,
        means=tuple(means),
        A=tuple(data(each) for each in A),
        b=tuple(data(each) for each in b),
        moments=Vec3(*(where(holds, each, 0.0) for each in moments)),
    )


LOWER = [(i, j) for i in range(3) for j in range(i + 1)]
"""Rows and columns of the lower triangle, row by row."""


def _solve_moments(
    gains: InertiaGains, mass: Any, size: Any, A: Sequence[Any], b: Sequence[Any]
) -> tuple[Vec3, tuple[Any, ...]]:
    """The moments of the least squares, kg m^2, and the information of each."""
    spread = maximum(mass * (gains.spread * gains.spread), TINY)
    prior = divide(1.0, spread * spread)
    squares = LeastSquares(3)
    for (i, j), each in zip(LOWER, A, strict=True):
        squares.A[i][j] = each
    squares.b = list(b)
    squares.prefer((mass * (size * size),) * 3, prior)
    known = tuple(squares.A[i][i] for i in range(3))
    return Vec3(*squares.solve()), known


def consistent(gains: InertiaGains, mass: Any, size: Any, moments: Vec3, known: Sequence[Any] = (1, 1, 1)) -> Vec3:
    """Moments (kg m^2) that a body of this mass can have, near to others.

    Of a moment that is more than both others together the difference goes to these: to that more which is less known
    and about whose axis the vehicle itself is stouter, since a light axis with too large a moment is too stiff a joint.

    Args:
        gains: constants.
        mass: kg.
        size: m, the least radius of gyration.
        moments: kg m^2, of any value.
        known: information of each.
    """
    least, most = mass * (size * size), 2.0 * (mass * (gains.furthest * gains.furthest))
    held = [clip(each, least, most) for each in moments]
    free = [divide(axis, info) for axis, info in zip(gains.stout, known, strict=True)]
    found = list(held)
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        # s_k is to be half of the least moment at least; of three moments above 0 one at most lacks it
        lacks = maximum(held[k] + least - (held[i] + held[j]), 0.0)
        part = divide(free[i], free[i] + free[j])
        found[i], found[j] = found[i] + lacks * part, found[j] + lacks * (1.0 - part)
    return Vec3(*found)


def stout(vehicle: Vehicle) -> tuple[float, ...]:
    """1 / (J M^-1 J^T)_kk about each axis of the tip, kg m^2, joints at zero, J the tip's Jacobian with the base."""
    joints, tip = (0.0,) * vehicle.n, vehicle.frame()
    M, R = mass_matrix(vehicle, Mat3.identity(), joints), frame_pose(vehicle, tip, joints).R
    columns = [Vec3(0, 0, 0)] * 3 + [Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)]
    columns += [column.angular for column in jacobian_columns(vehicle, tip, joints)]
    rows = [[float(R.column(k).dot(column)) for column in columns] for k in range(3)]
    solved = [ldl_solve([list(map(float, line)) for line in M], list(row)) for row in rows]
    return tuple(1.0 / sum(a * b for a, b in zip(x, row, strict=True)) for x, row in zip(solved, rows, strict=True))


def first_inertia(joints: int) -> InertiaMemory:
    """Nothing is known of the moments."""
    return InertiaMemory(means=(JointMeans(),) * joints)
