"""Tip control: tip and link references of a level base, base offset, and joint
accelerations.

What the arm cannot reach goes to a slow shift of the base, and base errors beyond the
arm's reach go to the tip's reference.

Task 1 is the tip's position, task 2 the link orientations; joint accelerations solve
the weighted least squares |J qdd - b_1|^2 + damping^2 sum |A_i qdd - b_i|^2 + posture^2
|qdd - qdd_d|^2, so that task 2 rules the directions in which J is singular; sliding
joints are held by (damping / reach)^2 |qdd_i - qdd_d,i|^2. J is the tip's Jacobian
against the centre of mass, whose acceleration follows from the thrust; joints off the
tip's chain are left out.
Source: Wampler 1986, Nakamura, Hanafusa 1986 (damped least squares); Umetani, Yoshida
1989 (generalized Jacobian).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from skyarm.algebra import ZERO3, Mat3, Scalar, Scalars, Vec3
from skyarm.algebra.matrix import orientation_error
from skyarm.algebra.scalars import add, cos, divide, mul, sin, total
from skyarm.algebra.scalars.taylor import Taylor, as_series
from skyarm.control.blocks.attitude import (
    DesiredAttitude,
    Posture,
    derivative,
    vector_series,
)
from skyarm.control.blocks.center_of_mass import axes, com_columns
from skyarm.control.blocks.force_control import Pressing
from skyarm.control.blocks.tip_force import LeastSquares
from skyarm.control.laws.centroidal.parameters import TipGains
from skyarm.dynamics.kinematics import Pose, chain, jacobian_columns, link_poses
from skyarm.records.immutable import immutable
from skyarm.vehicle import BASE, Vehicle


@immutable(kw_only=False)
class TipGoal:
    """Tip and link references for a level base, world axes, with first and second
    derivatives.

    Attributes:
        tip: position (m), velocity, acceleration.
        links: R_WL of every link. rates, accelerations: angular, of every link.
    """

    tip: tuple[Vec3, Vec3, Vec3]
    links: tuple[Mat3, ...]
    rates: tuple[Vec3, ...]
    accelerations: tuple[Vec3, ...]


def turn_by_yaw(yaw: Taylor, v: Vec3) -> Vec3:
    """Vector R_z(yaw) v as a Taylor series."""
    c, s = cos(yaw), sin(yaw)
    x, y = (as_series(k, len(yaw.c) - 1) for k in (v.x, v.y))
    return Vec3(c * x - s * y, s * x + c * y, v.z)


def goal(
    vehicle: Vehicle,
    base: list[Vec3],
    yaw: Taylor,
    joints: Sequence[Taylor],
    level: Posture,
) -> TipGoal:
    """Tip and link references for a level base that is exactly at the base
    reference.
    """
    yaw = yaw.truncate(2)
    arm = turn_by_yaw(yaw, level.tip)
    p, v, a = (base[k] + derivative(arm, k) for k in range(3))
    spin = Vec3(0, 0, yaw.derivative_series())
    rates: list[Vec3] = []
    links = []
    for link, pose, q in zip(vehicle.links, level.links, joints, strict=True):
        columns = [turn_by_yaw(yaw, pose.R.column(k)) for k in range(3)]
        links.append(Mat3.columns(*(derivative(column, 0) for column in columns)))
        rate = spin if link.parent == BASE else rates[link.parent]
        if link.joint.turns:
            axis = Vec3(*(Taylor.constant(c, 1) for c in link.joint.axis))
            along = Vec3(*(row.dot(axis) for row in Mat3.columns(*columns).rows))
            slope = q.derivative_series().truncate(1)
            rate = Vec3(*(add(a, b * slope) for a, b in zip(rate, along, strict=True)))
        rates.append(rate)
    return TipGoal(
        (p, v, a),
        tuple(links),
        tuple(derivative(rate, 0) for rate in rates),
        tuple(derivative(rate, 1) for rate in rates),
    )


def move_goal(goal: TipGoal, error: Sequence[Vec3], reach: Scalar) -> TipGoal:
    """Tip reference that moves along with base errors larger than ``reach``; smaller
    errors hardly move it.

    The tip takes over e |e|^4 / (|e|^4 + reach^4): nothing of small errors, all of
    large ones.
    """
    series = vector_series(error)
    square = series.dot(series)
    fourth = square * square * divide(1.0, reach * reach * reach * reach)
    moved = series * (fourth / (fourth + 1.0))
    p, v, a = (old + derivative(moved, k) for k, old in enumerate(goal.tip))
    return replace(goal, tip=(p, v, a))


def release_normal(
    pressing: Pressing,
    goal: TipGoal,
    tip: Vec3,
    tip_velocity: Vec3,
    velocity_gain: Scalar,
) -> TipGoal:
    """Tip reference without position control along the surface normal, along which only
    damping remains.
    """
    p, v, a = goal.tip
    n, slower = pressing.n, 1.0 - pressing.damping / velocity_gain
    return replace(
        goal,
        tip=(
            p + n * (n.dot(tip - p) * pressing.share),
            v + n * (n.dot(tip_velocity * slower - v) * pressing.share),
            a - n * (n.dot(a) * pressing.share),
        ),
    )


def needed_shift(
    level: Vec3, yaw: Taylor, turned: Vec3, still: DesiredAttitude
) -> list[Vec3]:
    """Base offset, with two derivatives, that keeps a point of a tilted vehicle at its
    place on a level vehicle.

    ``level`` is the point of the references, ``turned`` that of an arm whose links turn
    as those of a level base.
    """
    R, w, alpha = still.R, still.rate, still.acceleration
    r, rd, rdd = (derivative(turned, k) for k in range(3))
    arm = turn_by_yaw(yaw.truncate(2), level)
    return [
        derivative(arm, 0) - R.apply(r),
        derivative(arm, 1) - R.apply(w.cross(r) + rd),
        derivative(arm, 2)
        - R.apply(alpha.cross(r) + w.cross(w.cross(r)) + w.cross(rd) * 2.0 + rdd),
    ]


def orientation_rows(vehicle: Vehicle, axes_B: Sequence[Vec3], i: int) -> list[Vec3]:
    """Jacobian columns of the angular velocity of link ``i`` by the joint rates, base
    axes.
    """
    carriers = chain(vehicle, i)
    return [
        axes_B[j] if j in carriers and vehicle.links[j].joint.turns else ZERO3
        for j in range(vehicle.n)
    ]


def joints_of_turns(
    vehicle: Vehicle,
    gains: TipGains,
    directions: Sequence[Vec3],
    turns: Sequence[Vec3],
    preferred: Sequence[Scalar],
) -> Scalars:
    """Joint motion that gives each link a desired rotation (base axes), by regularised
    least squares.

    ``directions`` are the joint axes, ``turns`` the rotations of the links, their rates
    or accelerations, and ``preferred`` those of the joints for the rest.
    """
    problem = LeastSquares(vehicle.n)
    for i, turn in enumerate(turns):
        problem.require(
            orientation_rows(vehicle, directions, i),
            turn,
            gains.damping * gains.damping,
        )
    problem.prefer(preferred, gains.posture * gains.posture)
    return problem.solve()


def link_turning(
    vehicle: Vehicle,
    directions: Sequence[Vec3],
    joint_rates: Sequence[Scalar],
    rate: Vec3,
    acceleration: Vec3,
) -> list[tuple[Vec3, Vec3]]:
    """Angular velocity of each link, and its angular acceleration at zero joint
    accelerations, base axes.
    """
    motions: list[tuple[Vec3, Vec3]] = []
    for i, link in enumerate(vehicle.links):
        turn, bias = (
            (rate, acceleration) if link.parent == BASE else motions[link.parent]
        )
        if link.joint.turns:
            slide = directions[i] * joint_rates[i]
            turn, bias = turn + slide, bias + turn.cross(slide)
        motions.append((turn, bias))
    return motions


def tip_columns(
    vehicle: Vehicle, joints: Sequence[Scalar], poses: Sequence[Pose]
) -> list[Vec3]:
    """Jacobian of the tip against the centre of mass, one column per joint, base axes;
    ``poses`` are of the links.
    """
    columns = jacobian_columns(vehicle, vehicle.frame(), joints, summed=True)
    share = divide(1.0, vehicle.mass)
    return [
        a.linear - b * share
        for a, b in zip(columns, com_columns(vehicle, poses), strict=True)
    ]


def level_joints(
    vehicle: Vehicle, gains: TipGains, wanted: TipGoal, R: Mat3, poses: Sequence[Pose]
) -> Scalars:
    """Joint correction, by one Newton step, that orients the links on a tilted base as
    planned for a level base.
    """
    pairs = zip(poses[: vehicle.n], wanted.links, strict=True)
    errors = [orientation_error(pose.R, R.T @ link) for pose, link in pairs]
    return joints_of_turns(vehicle, gains, axes(vehicle, poses), errors, vehicle.zeros)


def level_motion(
    vehicle: Vehicle,
    gains: TipGains,
    wanted: TipGoal,
    still: DesiredAttitude,
    poses: Sequence[Pose],
    references: Sequence[Sequence[Scalar]],
) -> tuple[Scalars, Scalars]:
    """Joint rates and accelerations that keep the links moving as on a level base while
    the base turns.

    ``poses`` are of the links turned so; ``references`` are rates and
    accelerations of the joints' references, for the rest.
    """
    directions = axes(vehicle, poses)
    R = still.R
    w = still.rate
    turns = [R.apply_T(each) - w for each in wanted.rates]
    rates = joints_of_turns(vehicle, gains, directions, turns, references[0])
    links = link_turning(vehicle, directions, rates, w, still.acceleration)
    bends = [
        R.apply_T(each) - bias
        for each, (_, bias) in zip(wanted.accelerations, links, strict=True)
    ]
    return rates, joints_of_turns(vehicle, gains, directions, bends, references[1])


def turned_joints(
    vehicle: Vehicle,
    gains: TipGains,
    goal: TipGoal,
    still: DesiredAttitude,
    joints: Sequence[Taylor],
    level: Posture,
    moving: bool,
) -> tuple[Taylor, ...]:
    """Joint signals that give the links on a tilted base the orientations planned for a
    level base.
    """
    poses = [
        Pose(Mat3(*(derivative(row, 0) for row in pose.R.rows)), ZERO3)
        for pose in level.links
    ]
    # one Newton step from the level pose: tilts are small, and nothing iterates in
    # flight
    change = level_joints(vehicle, gains, goal, still.R, poses)
    if not moving:
        return tuple(q + c for q, c in zip(joints, change, strict=True))
    values = tuple(add(q.derivative(0), c) for q, c in zip(joints, change, strict=True))
    derivatives = [[q.derivative(k) for q in joints] for k in (1, 2)]
    motion = level_motion(
        vehicle,
        gains,
        goal,
        still,
        link_poses(vehicle, values, summed=True),
        derivatives,
    )
    rows = zip(joints, values, *motion, strict=True)
    return tuple(
        Taylor((value, rate, mul(0.5, turning), *q.c[3:]))
        for q, value, rate, turning in rows
    )


OFF = 0.07
"""Root mean square (rad) of the links' orientation errors about their joints above
which they get more weight."""

MORE = 2.0
"""What the factor 1 on the weight of the link orientations grows by at most. Of 144
drawn plants 131 then keep a swing of 0.8 rad within 20 mm, without it 121."""


def plan_weight(
    vehicle: Vehicle, directions: Sequence[Vec3], errors: Sequence[Vec3]
) -> Scalar:
    """Factor on the nominal weight of the link orientations, larger for large errors of
    the links about their joints.

    Where the tip has no lever along the stretched arm a late elbow bends to the other
    side of it. The tip is then in place and holds the arm there: its Jacobian points
    the other way. Links far off their plan turn back first.
    """
    turning = [
        a.dot(e)
        for link, a, e in zip(vehicle.links, directions, errors, strict=True)
        if link.joint.turns
    ]
    if not turning:
        return 1
    # 1 + m o / (m + o), o the mean square over OFF squared, with both sides of the
    # fraction times `unit`
    unit = len(turning) * OFF * OFF
    return (
        1.0
        + MORE
        - divide(
            MORE * MORE * unit, MORE * unit + total(mul(each, each) for each in turning)
        )
    )


@immutable
class PresentMotion:
    """Present motion of the vehicle: attitude, body rate, joints, posture and tip.

    Attributes:
        R: R_WB. rate, alpha: body rate and the angular acceleration to come, body axes.
        joints, joint_rates: rad or m, and per second.
        posture: series in time of the present motion, joint accelerations left out.
        tip, tip_velocity: world axes. com_acceleration: m/s^2, world axes, that the
            thrust gives.
    """

    R: Mat3
    rate: Vec3
    alpha: Vec3
    joints: Scalars
    joint_rates: Scalars
    posture: Posture
    tip: Vec3
    tip_velocity: Vec3
    com_acceleration: Vec3


def joint_accelerations(
    vehicle: Vehicle,
    gains: TipGains,
    wanted: TipGoal,
    now: PresentMotion,
    preferred: Sequence[Scalar],
    links: Sequence[Scalar] = (),
) -> Scalars:
    """Joint accelerations for the tip and link tasks, regularised to those of the joint
    references.

    ``links`` are the bandwidths of the links' orientations over the tip's; () for 1.
    """
    R, w = now.R, now.rate
    poses = link_poses(vehicle, now.joints, summed=True)
    problem = LeastSquares(vehicle.n)
    pull = (wanted.tip[1] - now.tip_velocity) * gains.velocity + (
        wanted.tip[0] - now.tip
    ) * gains.position
    arm = now.posture.tip - now.posture.com
    rho, rho_d, rho_dd = (derivative(arm, k) for k in range(3))
    carried = (
        now.alpha.cross(rho) + w.cross(w.cross(rho)) + w.cross(rho_d) * 2.0 + rho_dd
    )
    against = tip_columns(vehicle, now.joints, poses)
    asked = R.apply_T(wanted.tip[2] + pull - now.com_acceleration) - carried
    # another arm moves the tip through the centre of mass alone: no lever to steer it
    # by
    carriers = chain(vehicle, vehicle.frame().link)
    for i in (i for i in range(vehicle.n) if i not in carriers):
        asked, against[i] = asked - against[i] * preferred[i], ZERO3
    # the unit of the weights: what the tip needs comes first
    problem.require(against, asked, 1)
    directions = axes(vehicle, poses)
    errors = [
        orientation_error(pose.R, R.T @ link)
        for pose, link in zip(poses[: vehicle.n], wanted.links, strict=True)
    ]
    weight = gains.damping * gains.damping * plan_weight(vehicle, directions, errors)
    for i, (rate, bias) in enumerate(
        link_turning(vehicle, directions, now.joint_rates, w, now.alpha)
    ):
        error = errors[i]
        calm = links[i] if links else 1
        velocity = mul(gains.velocity, calm)
        position = mul(gains.position, mul(calm, calm))
        turn = (
            R.apply_T(wanted.accelerations[i] + wanted.rates[i] * velocity)
            + error * position
        )
        needed = turn - rate * velocity - bias
        problem.require(orientation_rows(vehicle, directions, i), needed, weight)
    problem.prefer(preferred, gains.posture * gains.posture)
    slides = divide(gains.damping, gains.reach)
    for i, link in enumerate(vehicle.links):
        if not link.joint.turns:
            # turns no link, so that task 2 does not damp it
            problem.prefer([preferred[i]], slides * slides, i)
    return problem.solve()
