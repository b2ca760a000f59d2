"""Model prediction for control laws: rotor forces in still air, accelerations, and
integration over a known delay.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from skyarm import dynamics
from skyarm.algebra import (
    E_X,
    E_Y,
    E_Z,
    ZERO3,
    ZERO3_DATA,
    Force,
    Mat3,
    Quaternion,
    Scalar,
    Scalars,
    Vec3,
    differences,
    inner_product,
    sums,
)
from skyarm.algebra.scalars import add, mul, neg, sub
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.dynamics.actuators import (
    Command,
    friction,
    limited_effort,
    rotor_force,
    speeds_after,
)
from skyarm.dynamics.actuators.mixer import allocation_matrix
from skyarm.dynamics.state import coordinate_acceleration
from skyarm.records.immutable import immutable
from skyarm.records.leaves import as_data
from skyarm.records.units import Unit
from skyarm.vehicle import Vehicle


@immutable
class Disturbance:
    """Disturbance on the model: force (N, world axes) and torque (N m, base axes) on
    the base, and joint efforts.
    """

    force: Annotated[Vec3, Unit("N", "disturbance force fed forward, world axes")]
    torque: Annotated[Vec3, Unit("N m", "disturbance torque fed forward, base axes")]
    efforts: Annotated[
        Scalars, Unit("N m or N", "disturbance efforts of the joints fed forward")
    ]

    def __add__(self, other: Disturbance) -> Disturbance:
        return Disturbance(
            force=self.force + other.force,
            torque=self.torque + other.torque,
            efforts=sums(self.efforts, other.efforts),
        )

    def __sub__(self, other: Disturbance) -> Disturbance:
        return Disturbance(
            force=self.force - other.force,
            torque=self.torque - other.torque,
            efforts=differences(self.efforts, other.efforts),
        )

    def __mul__(self, share: Scalar) -> Disturbance:
        return Disturbance(
            force=self.force * share,
            torque=self.torque * share,
            efforts=tuple(mul(each, share) for each in self.efforts),
        )

    def blend_towards(
        self, new: Disturbance, share: Scalar, force_share: Scalar
    ) -> Disturbance:
        """Disturbance after one low-pass step towards a new one, with a separate filter
        gain for the force.
        """
        return as_data(
            Disturbance(
                force=self.force + (new.force - self.force) * force_share,
                torque=self.torque + (new.torque - self.torque) * share,
                efforts=tuple(
                    b + (e - b) * share
                    for b, e in zip(self.efforts, new.efforts, strict=True)
                ),
            )
        )


def no_disturbance(joints: int) -> Disturbance:
    """Disturbance of zero force, torque and joint efforts."""
    return Disturbance(force=ZERO3_DATA, torque=ZERO3_DATA, efforts=(0.0,) * joints)


def rotor_wrench(
    model: Model, squares: Sequence[Scalar], sideways: bool = False
) -> Force:
    """Force and torque of rotors at squared speeds in the mixer's model; ``sideways``
    adds thrust across body z.
    """
    rows = allocation_matrix(model.vehicle, sideways)
    x, y, z, thrust, *across = (inner_product(row, squares) for row in rows)
    return Force(Vec3(x, y, z), Vec3(*(*(across or (0, 0)), thrust)))


def drag_wrench(
    vehicle: Vehicle, speeds: Sequence[Scalar], velocity_B: Vec3, rate: Vec3
) -> Force:
    """Rotors' hub drag and rolling moment in still air: force and torque at the base
    origin, base axes.
    """
    # rotor by rotor: which of them are alike is not known of numbers that may change in
    # exported code
    force, torque = ZERO3, ZERO3
    for rotor, speed in zip(vehicle.rotors, speeds, strict=True):
        across = rotor.axis.cross(velocity_B + rate.cross(rotor.position)).cross(
            rotor.axis
        )
        drag = across * mul(neg(rotor.drag_coefficient), speed)
        force = force + drag
        torque = (
            torque
            + rotor.position.cross(drag)
            + across * mul(neg(rotor.rolling_moment), speed)
        )
    return Force(torque, force)


def omitted_thrust(model: Model, speeds: Sequence[Scalar], sideways: bool) -> Force:
    """Force and torque by which the rotors' thrust differs from the mixer's model; zero
    for plain upright rotors.
    """
    if all(
        rotor.table is None and rotor.axis.coordinate_axis() == 2
        for rotor in model.vehicle.rotors
    ):
        return Force(ZERO3, ZERO3)
    squares = [speed * speed for speed in speeds]
    return calm_wrench(model.vehicle, speeds) - rotor_wrench(model, squares, sideways)


def calm_wrench(vehicle: Vehicle, speeds: Sequence[Scalar]) -> Force:
    """Torque and force of rotors that do not move through the air, at the base origin,
    base axes.
    """
    total = Force(ZERO3, ZERO3)
    for rotor, speed in zip(vehicle.rotors, speeds, strict=True):
        total = total + rotor_force(rotor, speed, ZERO3)
    return total


def reference_drag(
    model: Model, state: State, base: Sequence[Vec3], *, sideways: bool, moving: bool
) -> list[Vec3]:
    """Rotor force except thrust along body z (N, world axes), for the reference's
    motion, with two derivatives.

    The present motion would feed noise and errors into the posture. Hub drag is linear
    in the velocity; the push of tilted rotors across body z is constant, and the
    derivatives leave it out.

    ``sideways``: the law itself commands thrust across body z; ``moving``: False takes
    the derivatives as zero.
    """
    # linear in the velocity: its matrix from three unit velocities
    R, speeds = state.rotation, state.rotor_speeds
    drag = Mat3.columns(
        *(
            drag_wrench(model.vehicle, speeds, axis, ZERO3).force
            for axis in (E_X, E_Y, E_Z)
        )
    )
    still = omitted_thrust(model, speeds, sideways).force
    value = R.apply(drag.apply(R.apply_T(base[1])) + still)
    if not moving:
        return [value, ZERO3, ZERO3]
    return [value, *(R.apply(drag.apply(R.apply_T(each))) for each in base[2:4])]


def with_side(
    model: Model,
    unknown: Disturbance,
    R: Mat3,
    speeds: Sequence[Scalar],
    velocity: Vec3,
    rate: Vec3,
    sideways: bool = False,
) -> Disturbance:
    """Disturbance plus the rotor force and torque that the mixer omits.

    These are hub drag in still air, the rolling moment, and thrust across body z.
    """
    drag = drag_wrench(model.vehicle, speeds, R.apply_T(velocity), rate)
    side = drag + omitted_thrust(model, speeds, sideways)
    return Disturbance(
        force=unknown.force + R.apply(side.force),
        torque=unknown.torque + side.torque,
        efforts=unknown.efforts,
    )


def acceleration(
    model: Model,
    R: Mat3,
    rate: Vec3,
    joints: Sequence[Scalar],
    joint_rates: Sequence[Scalar],
    applied: Force,
    efforts: Sequence[Scalar],
    unknown: Disturbance,
) -> tuple[Vec3, Vec3, Scalars]:
    """Modelled accelerations under an applied wrench, joint efforts and a disturbance:
    world, body, joints.
    """
    total = Force(
        applied.torque + unknown.torque, applied.force + R.apply_T(unknown.force)
    )
    given = [
        limited_effort(joint, effort)
        for joint, effort in zip(model.vehicle.joints, efforts, strict=True)
    ]
    return acceleration_under(
        model, R, rate, joints, joint_rates, total, given, unknown.efforts, joint_rates
    )


def acceleration_under(
    model: Model,
    R: Mat3,
    rate: Vec3,
    joints: Sequence[Scalar],
    joint_rates: Sequence[Scalar],
    total: Force,
    efforts: Sequence[Scalar],
    extra: Sequence[Scalar],
    dry_rates: Sequence[Scalar],
) -> tuple[Vec3, Vec3, Scalars]:
    """Modelled accelerations under the total wrench on the base, joint efforts and
    further joint forces.

    ``efforts`` are what drives give, within their limits; friction is taken from them,
    its dry part at ``dry_rates``; ``extra`` acts on the joints beside them.
    """
    rows = zip(model.vehicle.links, efforts, joint_rates, dry_rates, extra, strict=True)
    torques = [
        add(sub(effort, friction(link.joint, speed, dry)), push)
        for link, effort, speed, dry, push in rows
    ]
    base, qdd = dynamics.forward_dynamics(
        model.vehicle, joints, rate, joint_rates, total, torques
    )
    linear, angular = coordinate_acceleration(R, base, model.gravity)
    return linear, angular, qdd


def motor_speeds(
    model: Model, speeds: Sequence[Scalar], command: Command, dt: Scalar
) -> Scalars:
    """Modelled rotor speeds (rad/s) after ``dt`` seconds of a held command."""
    return speeds_after(model.vehicle.rotors, speeds, command.rotor_speeds, dt)


@immutable
class Actuation:
    """Modelled rotor speeds and joint efforts over a time interval.

    Attributes:
        squares: mean squared rotor speeds, (rad/s)^2. amid, speeds: rotor speeds amid
            that time and at its end, rad/s.
        efforts: mean joint efforts, N m or N.
    """

    squares: Sequence[Scalar]
    amid: Sequence[Scalar]
    speeds: Scalars
    efforts: Scalars


def actuation(
    model: Model, speeds: Sequence[Scalar], command: Command, dt: Scalar
) -> Actuation:
    """Modelled rotor speeds and joint efforts over one period of a constant command;
    mean squares by Simpson's rule.
    """
    # the speeds amid the period are needed for drag anyway, so Simpson's rule is at
    # hand
    half = motor_speeds(model, speeds, command, 0.5 * dt)
    after = motor_speeds(model, speeds, command, dt)
    squares = [
        (a * a + 4.0 * (m * m) + b * b) * (1.0 / 6.0)
        for a, m, b in zip(speeds, half, after, strict=True)
    ]
    return Actuation(squares=squares, amid=half, speeds=after, efforts=command.efforts)


def predict_across(
    model: Model,
    x: State,
    done: Actuation,
    unknown: Disturbance,
    h: Scalar,
    sideways: bool,
) -> State:
    """Vehicle state ``h`` seconds later by one midpoint step; ``h`` may be a symbolic
    value.
    """
    drift = 0.5 * h
    # forces are taken amid the step: of second order at the cost of one evaluation
    R = (x.quaternion * Quaternion.of_small_rotation(x.rate * drift)).rotation()
    joints = tuple(q + v * drift for q, v in zip(x.joints, x.joint_rates, strict=True))
    applied = rotor_wrench(model, done.squares, sideways)
    linear, angular, qdd = acceleration(
        model, R, x.rate, joints, x.joint_rates, applied, done.efforts, unknown
    )
    velocity, rate = x.velocity + linear * h, x.rate + angular * h
    rates = tuple(v + a * h for v, a in zip(x.joint_rates, qdd, strict=True))
    # positions by the mean velocity: exact for a constant acceleration
    turned = x.quaternion * Quaternion.of_small_rotation((x.rate + rate) * (0.5 * h))
    return State(
        position=x.position + (x.velocity + velocity) * (0.5 * h),
        # a small rotation leaves the length within its square of 1, which one Newton
        # step mends without a root
        quaternion=turned.renormalized(),
        velocity=velocity,
        rate=rate,
        joints=tuple(
            q + (a + b) * (0.5 * h)
            for q, a, b in zip(x.joints, x.joint_rates, rates, strict=True)
        ),
        joint_rates=as_data(rates),
        rotor_speeds=done.speeds,
    )
