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

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import Mat3, Vec3
from skyarm.control.blocks.select import data, vector_data
from skyarm.control.blocks.series_kinematics import Posture, derivative, moving, posture
from skyarm.control.controller import ControllerError
from skyarm.control.laws.centroidal.compliance_table import require_moderate
from skyarm.control.laws.centroidal.joint_room import Ends, towards
from skyarm.control.laws.centroidal.outside_force import Hearing, HearingMemory, TorqueHearing, hear_torque
from skyarm.control.laws.centroidal.tip_reference import turn_by_yaw
from skyarm.control.laws.centroidal.tip_tasks import Squares, orientation_error
from skyarm.control.laws.centroidal.virtual_body import (
    NOT_TURNED,
    RotationalCompliance,
    VirtualTurn,
    moved_turn,
    turned_by,
)
from skyarm.dynamics.kinematics import jacobian_columns
from skyarm.files import shown
from skyarm.records.units import Unit
from skyarm.scalars import Scalar, add, divide, maximum, minimum, mul, sub
from skyarm.scalars.taylor import Taylor
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
    """Memory: the offset of the joints."""

    joints: Annotated[tuple[Scalar, ...], Unit("rad or m", "offset of the joints from their reference")]
    joint_rates: Annotated[tuple[Scalar, ...], Unit("rad/s or m/s", "of the offset")]


@dataclass(frozen=True, kw_only=True, slots=True)
class TurnWeights:
    """Weights of the arm's motion; what they reach is in docs/giving_way.md, Measured.

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


@dataclass(frozen=True, kw_only=True, slots=True)
class RotationGains:
    """Constants of giving way to a torque; ``ends`` says which joints have limits."""

    body: RotationalCompliance
    threshold: Annotated[Scalar, Unit("N m", "about the tip, above which a torque is heard", low=0.0)]
    arm: TurnWeights = TurnWeights()
    ends: Ends = ()

    def __post_init__(self) -> None:
        require_moderate("controller.parts.admittance.rotation.body", "inertia", self.body)


@dataclass(frozen=True, kw_only=True, slots=True)
class RotationMemory:
    """Memory of giving way to a torque."""

    body: VirtualTurn
    arm: ArmTurn
    hearing: TorqueHearing
    torque: Annotated[Vec3, Unit("N m", "about the tip, believed, world axes")]
    felt: Annotated[Vec3 | tuple[()], Unit("N m", "by a sensor at the tip, filtered, axes of the tip")] = ()


def listen(
    gains: RotationGains,
    memory: RotationMemory,
    hearing: tuple[Hearing, HearingMemory],
    torque: Vec3,
    force: Vec3,
    felt: Vec3 | None,
    dt: Any,
) -> tuple[RotationMemory, Vec3]:
    """The memory with what is heard of a torque, and the torque from outside (N m, world axes).

    Args:
        gains: constants.
        memory: one period earlier.
        hearing: constants and memory, one period earlier, of the force.
        torque: that counts, N m, world axes.
        force: that counts, N, world axes.
        felt: N m, of a sensor, filtered, axes of the tip; None without one.
        dt: control period, s.
    """
    heard, outside = hear_torque(*hearing, memory.hearing, gains.threshold, torque, force, dt, felt)
    kept = memory.felt if felt is None else vector_data(felt)
    return dataclasses.replace(memory, hearing=heard, torque=vector_data(torque), felt=kept), outside


def turn(
    gains: RotationGains, memory: RotationMemory, vehicle: Vehicle, outside: Vec3, signals: Sequence[Taylor], dt: Any
) -> tuple[RotationMemory, list[Taylor]]:
    """The memory one period later, and the reference's signals with the tip turned.

    Args:
        gains: constants.
        memory: that has listened.
        vehicle: model.
        outside: torque about the tip, N m, world axes.
        signals: of the reference, series in time.
        dt: control period, s.
    """
    body, vector = moved_turn(gains.body, memory.body, outside, dt)
    arm, moved = turned_reference(vehicle, gains, memory.arm, turned_by(vector), signals, dt)
    return dataclasses.replace(memory, body=body, arm=arm), moved


PACE = 0.2
"""k dt: the share of an error that is made good in one period, well below where the sum of two steps would swing.

Without anything else one pole of the step is negative from k dt = 2 - sqrt(2) = 0.59 on, and below -1 from 1 on.
"""

ROOM = 0.8
"""Of the way from a joint's reference to its limit, that the tip's turning may take: docs/giving_way.md, Turning.

Chosen, not measured: the rest is left for the errors of the loop that follows.
"""


def turned_reference(
    vehicle: Vehicle, gains: RotationGains, memory: ArmTurn, E: Mat3, signals: Sequence[Taylor], dt: Any
) -> tuple[ArmTurn, list[Taylor]]:
    """One period: the memory, and the reference's signals with joints and base moved.

    Args:
        vehicle: model.
        gains: constants.
        memory: one period earlier.
        E: by which the tip is turned against its reference, world axes, series to second derivative.
        signals: of the reference: x, y, z, yaw, joints.
        dt: control period, s.
    """
    yaw, told = signals[3].truncated(2), [q.truncated(2) for q in signals[4:]]
    wanted = posture(vehicle, told, 2)
    values = [add(q.derivative(0), dq) for q, dq in zip(told, memory.joints, strict=True)]
    rates = [add(q.derivative(1), dq) for q, dq in zip(told, memory.joint_rates, strict=True)]
    now = posture(vehicle, moving(values, rates, (0,) * vehicle.n), 2)
    asked = _accelerations(vehicle, gains.arm, memory, _in_heading(E, yaw), wanted, now, told, values, dt)
    accelerations = _within(vehicle, gains.ends, told, values, rates, asked, dt)
    moved: list[tuple[Any, ...]] = []
    for q, dq, slope, bend in zip(told, memory.joints, memory.joint_rates, accelerations, strict=True):
        more = sub(bend, q.derivative(2))
        moved.append((add(dq, mul(dt, add(slope, mul(0.5, mul(dt, more))))), add(slope, mul(dt, more)), more))
    joints = [signal + _series(row) for signal, row in zip(signals[4:], moved, strict=True)]
    there = posture(vehicle, [q.truncated(2) for q in joints], 2)
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
    told: Sequence[Taylor],
    values: Sequence[Any],
    dt: Any,
) -> tuple[Any, ...]:
    """Joint accelerations that turn the tip by E (base axes of a level base) and keep it where it is."""
    k = divide(PACE, dt)
    kp, kd = mul(k, k), mul(2.0, k)
    target, present = E @ tip_rotation(vehicle, wanted), tip_rotation(vehicle, now)
    w_d, alpha_d = turning(target)
    w, bias = turning(present)
    left = orientation_error(values_of(present), values_of(target))
    turn = alpha_d - bias + (w_d - w) * kd + left * kp
    gap = wanted.tip - now.tip
    shift = derivative(gap, 2) + derivative(gap, 1) * kd + derivative(gap, 0) * kp
    columns = jacobian_columns(vehicle, vehicle.frame(), values)
    problem = Squares(vehicle.n)
    problem.require([each.angular for each in columns], turn, 1)
    problem.require([each.linear for each in columns], shift, divide(1.0, mul(weights.length, weights.length)))
    rest = [
        sub(q.derivative(2), add(mul(kd, slope), mul(kp, dq)))
        for q, dq, slope in zip(told, memory.joints, memory.joint_rates, strict=True)
    ]
    problem.prefer(rest, mul(weights.idle, weights.idle))
    return problem.solve()


def _within(
    vehicle: Vehicle,
    ends: Ends,
    told: Sequence[Taylor],
    values: Sequence[Any],
    rates: Sequence[Any],
    accelerations: Sequence[Any],
    dt: Any,
) -> list[Any]:
    """Joint accelerations that bring no joint further than a share of the way from its reference to a limit.

    The bound of :mod:`skyarm.control.laws.centroidal.joint_room`. A reference that comes nearer to a limit, or nears it
    faster, is followed as it is: what the law does with it is the same as without turning.
    """
    k, found = divide(PACE, dt), []
    for link, (low, high), q, value, rate, wanted in zip(
        vehicle.links, ends, told, values, rates, accelerations, strict=True
    ):
        kept, (lower, upper) = wanted, (link.joint.lower, link.joint.upper)
        gone = add(mul(mul(k, k), value), mul(mul(2.0, k), rate))
        if high:
            kept = minimum(kept, sub(maximum(towards(upper, q, ROOM, k), towards(upper, q, 0, k)), gone))
        if low:
            kept = maximum(kept, sub(minimum(towards(lower, q, ROOM, k), towards(lower, q, 0, k)), gone))
        found.append(kept)
    return found


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


def first_rotation(joints: int, sensor: bool) -> RotationMemory:
    """At rest on the reference, nothing known."""
    zero, still = Vec3(0.0, 0.0, 0.0), (0.0,) * joints
    felt: Vec3 | tuple[()] = zero if sensor else ()
    return RotationMemory(
        body=NOT_TURNED,
        arm=ArmTurn(joints=still, joint_rates=still),
        hearing=TorqueHearing(heard=0.0, quiet=0.0, felt=felt),
        torque=zero,
        felt=felt,
    )


def require_turning(vehicle: Vehicle, at: str, table: Any, sensor: bool) -> None:
    """Refuse an arm that does not turn its tip about every axis, or that cannot tell a torque there from a force.

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
    """How many of some vectors point where those before do not: Gram, Schmidt."""
    found: list[list[float]] = []
    for vector in vectors:
        left = [float(c) for c in vector]
        for unit in found:
            along = sum(a * b for a, b in zip(left, unit, strict=True))
            left = [a - along * b for a, b in zip(left, unit, strict=True)]
        length = math.sqrt(sum(c * c for c in left))
        if length > ALONG:
            found.append([c / length for c in left])
    return len(found)
