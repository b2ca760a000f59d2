"""Common parts of the published laws: desired specific force, attitude control, inverse
dynamics and mixing.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from skyarm import dynamics
from skyarm.algebra import E_Z, ZERO3, Force, Mat3, Motion, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import add, divide, minimum, mul
from skyarm.control.blocks.actuators import limit_efforts
from skyarm.control.blocks.geometric import (
    angular_acceleration,
    attitude_error,
    desired_attitude,
    downward_acceleration,
    rate_error,
)
from skyarm.control.model import JointGains, Model, Parameters
from skyarm.dynamics.actuators import Command, mix
from skyarm.dynamics.actuators.hover import hover_trim
from skyarm.records.units import Unit
from skyarm.reference import Reference
from skyarm.sensing.measurement import Measurement
from skyarm.vehicle import Vehicle

Started = Annotated[Scalar, Unit("", "0 before the first measurement, then 1")]
"""Flag of a flight that has begun, as memories of several laws declare it."""


def wanted_specific_force(
    par: Parameters, measurement: Measurement, reference: Reference
) -> Vec3:
    """Desired specific force (m/s^2, world axes): position PD plus reference
    acceleration plus gravity.
    """
    down = downward_acceleration(
        par.gains,
        par.model.vehicle.mass,
        par.model.gravity,
        position_error=measurement.position - reference.position,
        velocity_error=measurement.velocity - reference.velocity,
        acceleration=reference.acceleration,
    )
    return -down


def turn_towards(
    par: Parameters, measurement: Measurement, reference: Reference, R: Mat3, up: Vec3
) -> Vec3:
    """Angular acceleration (rad/s^2, base axes) that turns body z towards ``up`` and
    the nose to the desired yaw.

    Source: eq. (83) to (85) of Barakou et al. 2026.
    """
    R_d = desired_attitude(-up, reference.yaw, R)
    e_w = rate_error(measurement.rate, R, R_d, reference.yaw_rate, par.rate_error)
    # gains of the attitude are on the base's own inertia
    J = par.model.vehicle.base.inertia
    return angular_acceleration(par.gains, J, attitude_error(R, R_d), e_w)


def arm_alone(
    par: Parameters,
    R: Mat3,
    joints: Sequence[Scalar],
    joint_accelerations: Sequence[Scalar],
) -> Scalars:
    """Joint torques for desired joint accelerations, gravity included, on a motionless
    base at attitude R.
    """
    vehicle = par.model.vehicle
    weight = Motion(ZERO3, R.apply_T(E_Z * par.model.gravity))
    return dynamics.inverse_dynamics(
        vehicle, joints, ZERO3, (0,) * vehicle.n, weight, joint_accelerations
    )[1]


def make_command(
    par: Parameters, torque: Vec3, thrust: Scalar, efforts: Sequence[Scalar]
) -> Command:
    """Limited command for body torque, thrust and joint torques."""
    speeds, _ = mix(par.mixer, torque, thrust)
    return Command(rotor_speeds=speeds, efforts=limit_efforts(par, efforts))


def no_command(vehicle: Vehicle) -> Command:
    """Command of zeros, in place of the previous command at the first control step."""
    return Command(rotor_speeds=(0.0,) * len(vehicle.rotors), efforts=vehicle.zeros)


def standing_command(model: Model) -> Command:
    """Command of the model in level hover with all joints at zero."""
    vehicle = model.vehicle
    trim = hover_trim(vehicle, vehicle.zeros, model.gravity)
    speeds = tuple(
        # a vehicle that is too heavy to hover begins with its rotors at their limits
        minimum(w, rotor.max_speed)
        for w, rotor in zip(trim.speeds, vehicle.rotors, strict=True)
    )
    return Command(rotor_speeds=speeds, efforts=tuple(trim.efforts)).dense()


def coupled_forces(
    par: Parameters,
    measurement: Measurement,
    base: Motion,
    joint_accelerations: Sequence[Scalar],
) -> tuple[Force, Scalars]:
    """Inverse dynamics of base and arm at the measured state: force on the base and
    joint torques.
    """
    return dynamics.inverse_dynamics(
        par.model.vehicle,
        measurement.joints,
        measurement.rate,
        measurement.joint_rates,
        base,
        joint_accelerations,
    )


def rotor_thrust(vehicle: Vehicle, speeds: Sequence[Scalar]) -> tuple[Vec3, Vec3]:
    """Torque about and force at the base origin of rotors at given speeds in calm air,
    base axes.

    Of thrusts k_f W^2, as mixers have them;
    :func:`skyarm.control.blocks.prediction.calm_wrench` has thrust tables, too.
    """
    torque, force = ZERO3, ZERO3
    for rotor, speed in zip(vehicle.rotors, speeds, strict=True):
        thrust = rotor.axis * (rotor.thrust_coefficient * (speed * speed))
        drag = thrust * (rotor.moment_coefficient * -rotor.direction)
        torque, force = torque + rotor.position.cross(thrust) + drag, force + thrust
    return torque, force


def inverse_mass(vehicle: Vehicle) -> Scalar:
    """Reciprocal of the vehicle's mass, 1/kg."""
    return divide(1.0, vehicle.mass)


def joint_pd(
    gains: JointGains, measurement: Measurement, reference: Reference
) -> Scalars:
    """PD feedback kp (q_d - q) + kd (qd_d - qd) of each joint: torque or acceleration,
    by the gains.

    The difference of angles is not wrapped: encoders count turns, and a joint wound
    once past its reference is brought back the way it came, so that cables unwind.
    Wrapping is the reference's choice, not the law's.
    """
    return tuple(
        add(mul(kp, q_d - q), mul(kd, qd_d - qd))
        for kp, kd, q_d, q, qd_d, qd in zip(
            gains.stiffness,
            gains.damping,
            reference.joints,
            measurement.joints,
            reference.joint_rates,
            measurement.joint_rates,
            strict=True,
        )
    )
