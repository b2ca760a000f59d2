"""Rotation of an admittance: the tip answers a torque as an inertia, a damper and a spring.

A virtual body (:mod:`skyarm.control.laws.centroidal.virtual_body`) that the torque about the tip turns gives the
rotation E(t) by which the tip is turned against its reference, about its own place; the joints do it, and the base
moves where they cannot keep the tip in its place meanwhile. An offset dq of the joints is integrated whose acceleration
is the least squares of

    |J_w qdd - (alpha* - J_w' qd + 2 k (w* - w) + k^2 e)|^2
    + (1 / length^2) |J_v qdd - (p*'' - J_v' qd + 2 k (p*' - p') + k^2 (p* - p))|^2
    + idle^2 |qdd - qdd_d + 2 k dq' + k^2 dq|^2,

q = q_d + dq, stars for the turned reference, e the small rotation that is left, k the fastest pace that a control
period lets. What the tip's place is then off goes to the base, exactly and with its derivatives: the tip stays where
its reference is, whatever the arm can.
Source: Siciliano 1990, "A closed-loop inverse kinematic scheme for on-line joint-based robot control", Robotica 8;
Wampler 1986 (damping).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import Mat3, Vec3
from skyarm.algebra.scalars import Scalar, divide, maximum, minimum, sub
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.blocks.attitude import Posture, derivative, moving, posture
from skyarm.control.blocks.select import data
from skyarm.control.controller import ControllerError
from skyarm.control.laws.centroidal.joint_room import Ends, towards
from skyarm.control.laws.centroidal.tip_force import LeastSquares
from skyarm.control.laws.centroidal.tip_tasks import orientation_error, turn_by_yaw
from skyarm.dynamics.kinematics import jacobian_columns
from skyarm.records.files import shown
from skyarm.records.units import Unit
from skyarm.vehicle.vehicle_records import Vehicle

BENT = 0.4
"""rad or m, and its multiples: a posture in which no two joint axes of an arm are parallel unless they always are.

Any angles will do that are no multiples of pi / 2; only the number of directions is taken from it.
"""

ALONG = 1e-2
"""1 and m: what is left of a column of the Jacobian, below which it says nothing new.

Far above rounding (1e-15), below the arms and sines of a vehicle whose joints do turn its tip.
"""


@dataclass(frozen=True, kw_only=True, slots=True)
class ArmTurn:
    """Memory of the turned arm: the offset of its joints."""

    joints: Annotated[tuple[Scalar, ...], Unit("rad or m", "offset of the joints from their reference")]
    joint_rates: Annotated[tuple[Scalar, ...], Unit("rad/s or m/s", "of the offset")]


@dataclass(frozen=True, kw_only=True, slots=True)
class TurnWeights:
    """Weights of the arm's motion; measured effects in docs/giving_way.md, Measured.

    Attributes:
        length: m, of the tip's motion that counts as 1 rad of its turning: long, so that turning comes first.
        idle: weight of joints that rest on their references: singular values of J_w below it turn the tip late.
    """

    length: Annotated[
        Scalar, Unit("m", "of the tip's motion that counts as 1 rad of its turning", low=1e-3, high=1e3)
    ] = 2.0
    idle: Annotated[
        Scalar, Unit("", "weight of joints on their references against 1 rad of turning", low=1e-4, high=1e3)
    ] = 0.02


PACE = 0.2
"""k dt: the share of an error that is made good in one period, well below where the sum of two steps would swing.

Without anything else one pole of the step is negative from k dt = 2 - sqrt(2) = 0.59 on, and below -1 from 1 on.
"""

ROOM = 0.8
"""Of the way from a joint's reference to its limit, that the tip's turning may take: docs/giving_way.md, Turning.

Chosen, not measured: the rest is left for the errors of the loop that follows.
"""


def turned_reference(
    vehicle: Vehicle, weights: TurnWeights, ends: Ends, memory: ArmTurn, E: Mat3, signals: Sequence[Taylor], dt: Any
) -> tuple[ArmTurn, list[Taylor]]:
    """One period: the memory, and the reference's signals with joints and base moved.

    Args:
        vehicle: model.
        weights: of the arm's motion.
        ends: which limits the joints have.
        memory: one period earlier.
        E: by which the tip is turned against its reference, world axes, series to second derivative.
        signals: of the reference: x, y, z, yaw, joints.
        dt: control period, s.
    """
    yaw, planned = signals[3].truncate(2), [q.truncate(2) for q in signals[4:]]
    wanted = posture(vehicle, planned, 2)
    values = [q.derivative(0) + dq for q, dq in zip(planned, memory.joints, strict=True)]
    rates = [q.derivative(1) + dq for q, dq in zip(planned, memory.joint_rates, strict=True)]
    now = posture(vehicle, moving(values, rates, (0,) * vehicle.n), 2)
    k = divide(PACE, dt)
    asked = _accelerations(vehicle, weights, memory, _in_heading(E, yaw), wanted, now, planned, values, k)
    moved: list[tuple[Any, ...]] = []
    rows = zip(vehicle.links, ends, planned, values, rates, memory.joints, memory.joint_rates, asked, strict=True)
    for link, (low, high), q, value, rate, dq, slope, wanted_bend in rows:
        # towards a limit no further than a share of the way from the reference, which is followed where it is nearer
        bend, gone = wanted_bend, k * k * value + 2.0 * k * rate
        if high:
            upper = link.joint.upper
            bend = minimum(bend, maximum(towards(upper, q, ROOM, k), towards(upper, q, 0, k)) - gone)
        if low:
            lower = link.joint.lower
            bend = maximum(bend, minimum(towards(lower, q, ROOM, k), towards(lower, q, 0, k)) - gone)
        more = bend - q.derivative(2)
        moved.append((dq + dt * (slope + 0.5 * (dt * more)), slope + dt * more, more))
    joints = [signal + _series(row) for signal, row in zip(signals[4:], moved, strict=True)]
    there = posture(vehicle, [q.truncate(2) for q in joints], 2)
    offset = turn_by_yaw(yaw, wanted.tip - there.tip)
    base = [signal + _series([c.derivative(k) for k in range(3)]) for signal, c in zip(signals, offset, strict=False)]
    after = ArmTurn(joints=tuple(data(row[0]) for row in moved), joint_rates=tuple(data(row[1]) for row in moved))
    return after, [*base, signals[3], *joints]


def _accelerations(
    vehicle: Vehicle,
    weights: TurnWeights,
    memory: ArmTurn,
    E: Mat3,
    wanted: Posture,
    now: Posture,
    planned: Sequence[Taylor],
    values: Sequence[Any],
    k: Any,
) -> tuple[Any, ...]:
    """Joint accelerations that turn the tip by E (base axes of a level base) and keep it where it is."""
    kp, kd = k * k, 2.0 * k
    target, present = E @ tip_rotation(vehicle, wanted), tip_rotation(vehicle, now)
    w_d, alpha_d = turning(target)
    w, bias = turning(present)
    left = orientation_error(values_of(present), values_of(target))
    turn = alpha_d - bias + (w_d - w) * kd + left * kp
    gap = wanted.tip - now.tip
    shift = derivative(gap, 2) + derivative(gap, 1) * kd + derivative(gap, 0) * kp
    columns = jacobian_columns(vehicle, vehicle.frame(), values)
    problem = LeastSquares(vehicle.n)
    problem.require([each.angular for each in columns], turn, 1)
    problem.require([each.linear for each in columns], shift, divide(1.0, weights.length * weights.length))
    rest = [
        sub(q.derivative(2), kd * slope + kp * dq)
        for q, dq, slope in zip(planned, memory.joints, memory.joint_rates, strict=True)
    ]
    problem.prefer(rest, weights.idle * weights.idle)
    return problem.solve()


def _in_heading(E: Mat3, yaw: Taylor) -> Mat3:
    """A rotation of the world as one of axes that turn with the heading, series."""
    rows = [turn_by_yaw(-yaw, column) for column in (E.column(0), E.column(1), E.column(2))]
    turned = Mat3.columns(*rows)  # R_z^T E
    return Mat3(*(turn_by_yaw(-yaw, row) for row in turned.rows))


def tip_rotation(vehicle: Vehicle, at: Posture) -> Mat3:
    """Rotation of the tip's axes, base axes, series."""
    tip = vehicle.frame()
    R = at.links[tip.link].R
    held = tip.rotation
    return Mat3.columns(*(R.apply(Vec3(*(Taylor.constant(c, 2) for c in held.column(j)))) for j in range(3)))


def values_of(R: Mat3) -> Mat3:
    """The present of a rotation whose entries are series."""
    return Mat3(*(derivative(row, 0) for row in R.rows))


def turning(R: Mat3) -> tuple[Vec3, Vec3]:
    """Angular velocity and acceleration (rad/s, rad/s^2) of a rotation whose entries are series, axes of its rows.

    R' R^T = [w], and the antisymmetric part of R'' R^T = [alpha] + [w]^2 is [alpha].
    """
    value, first, second = (Mat3(*(derivative(row, k) for row in R.rows)) for k in range(3))
    back = value.T
    return (first @ back).vee_antisymmetric(), (second @ back).vee_antisymmetric()


def _series(derivatives: Sequence[Any]) -> Taylor:
    """A series of fourth order from its first derivatives."""
    return Taylor.of_derivatives((*derivatives, 0, 0))


def require_turning(vehicle: Vehicle, at: str, table: Any, sensor: bool) -> None:
    """Refuse an arm that does not turn its tip about every axis, or cannot distinguish a torque there from a force.

    Raises:
        ControllerError: one line with field, value and what is allowed.
    """
    bent = [BENT * (1.0 + 0.37 * i) for i in range(vehicle.n)]
    columns = jacobian_columns(vehicle, vehicle.frame(), bent)
    if _independent([[*each.angular] for each in columns]) < 3:
        allowed = f"must be left out: the joints of {vehicle.name!r} do not turn its tip about three axes"
        raise ControllerError(f"{at}.rotation = {shown(table)}: {allowed}")
    if not sensor and _independent([[*each.angular, *each.linear] for each in columns]) < 6:
        few = f"the joints of {vehicle.name!r} do not move its tip in six directions, so that they tell no torque there"
        raise ControllerError(f"{at}.rotation = {shown(table)}: must be left out without force_sensor: {few}")


def _independent(vectors: list[list[Any]]) -> int:
    """Number of linearly independent vectors, nearly parallel ones counted once: Gram, Schmidt."""
    found: list[list[float]] = []
    for vector in vectors:
        left = [float(c) for c in vector]
        for unit in found:
            along = sum(a * b for a, b in zip(left, unit, strict=True))
            left = [a - along * b for a, b in zip(left, unit, strict=True)]
        length = math.hypot(*left)
        if length > ALONG:
            found.append([c / length for c in left])
    return len(found)
