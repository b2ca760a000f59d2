"""Geometric control of the centre of inertia on SE(3), in the manner of Guo, Xu, Deng,
Liu, Ding 2023.

The vehicle is seen as one body of varying shape: its centre of mass p_C = p + R c(q)
translates, its locked inertia J_C(q) about that point rotates; what the arm's motion
adds is avoided by this choice of coordinates, not compensated.

    f = m (g e_z + pdd_C,d) - Kp (p_C - p_C,d) - Kv (v_C - v_C,d),
    thrust = f . R e_z,  R_d from f
    torque about C = J_C alpha_d + w x J_C w;  about the base origin: + c x (thrust e_z)
    p_C,d = p_d + R_z(psi_d) c(q_d), with its first and second derivative
    joints: PD on acceleration through the arm's own inertia, and weight by the true
    attitude

Assumed (the text at hand is Barakou et al. 2026's summary): the geometric controller of
Lee et al. 2010 in these coordinates; the reference of the centre by the level pose;
joints controlled apart, as servos with weight compensation.

Source: Guo et al., Nonlinear Dynamics 111, 2023, as summarised in Barakou et al. 2026,
section 1.
"""

from __future__ import annotations

from skyarm.algebra import E_Z, ZERO3, Scalar, Vec3, axis_rotation
from skyarm.control.blocks.center_of_mass import (
    arm_reaction,
    center_velocity,
    central_inertia,
    locked_inertia,
)
from skyarm.control.blocks.common import (
    arm_alone,
    inverse_mass,
    make_command,
    turn_towards,
)
from skyarm.control.controller import Memory
from skyarm.control.law_maker import law_maker
from skyarm.control.laws.paper import joint_accelerations
from skyarm.control.model import Parameters
from skyarm.dynamics.actuators import Command
from skyarm.reference import Reference
from skyarm.sensing.measurement import Measurement
from skyarm.vehicle import Vehicle


def center_reference(vehicle: Vehicle, reference: Reference) -> tuple[Vec3, Vec3, Vec3]:
    """Desired position, velocity and acceleration of the centre of mass, world axes,
    with the base level.
    """
    q, qd, qdd = reference.joints, reference.joint_rates, reference.joint_accelerations
    R = axis_rotation(E_Z, reference.yaw)
    c, _ = central_inertia(locked_inertia(vehicle, q))
    cd = center_velocity(vehicle, q, qd)
    cdd = arm_reaction(vehicle, q, ZERO3, qd, qdd).force * inverse_mass(vehicle)
    w, a = E_Z * reference.yaw_rate, E_Z * reference.yaw_acceleration
    velocity = R.apply(cd + w.cross(c))
    acceleration = R.apply(cdd + w.cross(cd) * 2.0 + w.cross(w.cross(c)) + a.cross(c))
    return (
        reference.position + R.apply(c),
        reference.velocity + velocity,
        reference.acceleration + acceleration,
    )


def guo_center_of_inertia(
    memory: Memory,
    measurement: Measurement,
    reference: Reference,
    dt: Scalar,
    *,
    par: Parameters,
) -> tuple[Memory, Command]:
    """SE(3) tracking of the centre of mass with the locked inertia; the joints are
    controlled separately.
    """
    del dt
    vehicle, R, w = par.model.vehicle, measurement.rotation, measurement.rate
    c, J = central_inertia(locked_inertia(vehicle, measurement.joints))
    cd = center_velocity(vehicle, measurement.joints, measurement.joint_rates)
    position, velocity, acceleration = center_reference(vehicle, reference)
    off = measurement.position + R.apply(c) - position
    drift = measurement.velocity + R.apply(cd + w.cross(c)) - velocity
    pull = par.gains.position.hadamard(off) + par.gains.velocity.hadamard(drift)
    up = acceleration + E_Z * par.model.gravity - pull * inverse_mass(vehicle)
    thrust = vehicle.mass * up.dot(R.column(2))
    alpha = turn_towards(par, measurement, reference, R, up)
    # about the base origin, where the mixer takes it
    torque = J.apply(alpha) + w.cross(J.apply(w)) + c.cross(E_Z * thrust)
    efforts = arm_alone(
        par, R, measurement.joints, joint_accelerations(par, measurement, reference)
    )
    return memory, make_command(par, torque, thrust, efforts)


make_guo = law_maker("guo2023", guo_center_of_inertia)
"""Maker of the centre-of-inertia law after Guo et al. 2023, for any arm. Gains of the
centre of mass, of the attitude on the base's own inertia."""
