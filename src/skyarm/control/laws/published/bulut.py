"""Pure computed torque with a simplified mass matrix, in the manner of Bulut, Turgut,
Arikan 2019.

    thrust = m (xdd* + g) . e_z / (cos phi cos theta)
    torque = M_rr(q) alpha* + M_rq(q) qdd* + products + weight,
    alpha* = Q Phidd* + Qdot Phid
    joints = M_qr(q) alpha* + M_qq(q) qdd* + products + weight
    (.)*   = (.)_dd,d + Kd (.)_d error + Kp (.) error

One computed torque on [p, Phi, q]; the blocks of M between translation and the rest are
zero. Lateral accelerations are reached by small angles: phi_d = (a_x sin psi - a_y cos
psi) / g, theta_d = (a_x cos psi + a_y sin psi) / g.

Assumed (the text at hand is the abstract, and Barakou et al. 2026's summary of it):
that "simplified" means the zero blocks above; the inversion for roll and pitch; no rate
feed-forward for them; weight and velocity products in full.

Source: Bulut, Turgut, Arikan, ICINCO 2019, as summarised in Barakou et al. 2026,
section 1.
"""

from __future__ import annotations

from skyarm.algebra import E_Z, Motion, Quaternion, Scalar, Vec3
from skyarm.algebra.quaternion import euler_angles
from skyarm.algebra.scalars import atan2, clip, cos, divide, maximum, sin
from skyarm.control.blocks.common import (
    coupled_forces,
    make_command,
    wanted_specific_force,
)
from skyarm.control.blocks.geometric import angular_acceleration
from skyarm.control.controller import Memory
from skyarm.control.law_maker import law_maker
from skyarm.control.laws.paper import SINGULAR_PITCH, euler_margin, joint_accelerations
from skyarm.control.model import Parameters
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.euler_coordinates import (
    rate_matrix,
    rate_matrix_inverse,
    rate_matrix_rate,
)
from skyarm.reference import Reference
from skyarm.sensing.measurement import Measurement

STEEPEST = 0.6
"""Largest roll and pitch (rad) of the small-angle inversion; 0.6 rad asks for 0.68 g
sideways."""

FLATTEST = 0.3
"""Least cosine of the tilt, a divisor of the thrust; chosen: that of 73 degrees."""


def bulut_computed_torque(
    memory: Memory,
    measurement: Measurement,
    reference: Reference,
    dt: Scalar,
    *,
    par: Parameters,
) -> tuple[Memory, Command]:
    """Computed torque on position, Euler angles and joints, translation decoupled."""
    del dt
    R = measurement.rotation
    specific = wanted_specific_force(par, measurement, reference)
    alpha = _angular(par, measurement, reference, specific)
    weight = R.apply_T(E_Z * par.model.gravity)
    wanted_joints = joint_accelerations(par, measurement, reference)
    force, torques = coupled_forces(
        par, measurement, Motion(alpha, weight), wanted_joints
    )
    upright = maximum(R.r2.z, FLATTEST)
    thrust = divide(par.model.vehicle.mass * specific.z, upright)
    return memory, make_command(par, force.torque, thrust, torques)


def _angular(
    par: Parameters, measurement: Measurement, reference: Reference, specific: Vec3
) -> Vec3:
    """Desired angular acceleration (rad/s^2, base axes) by computed torque on the Euler
    angles.
    """
    phi, theta, psi = euler_angles(measurement.rotation)
    c, s = cos(psi), sin(psi)
    per_gravity = divide(1.0, par.model.gravity)
    roll = clip((specific.x * s - specific.y * c) * per_gravity, -STEEPEST, STEEPEST)
    pitch = clip((specific.x * c + specific.y * s) * per_gravity, -STEEPEST, STEEPEST)
    turn = psi - reference.yaw
    # the heading takes the shorter way round; roll and pitch are far from half a turn
    error = Vec3(phi - roll, theta - pitch, atan2(sin(turn), cos(turn)))
    Q = rate_matrix(phi, theta)
    rates = rate_matrix_inverse(phi, theta).apply(measurement.rate)
    pull = angular_acceleration(
        par.gains,
        par.model.vehicle.base.inertia,
        error,
        rates - Vec3(0, 0, reference.yaw_rate),
    )
    second = pull + Vec3(0, 0, reference.yaw_acceleration)
    return Q.apply(second) + rate_matrix_rate(phi, theta, rates).apply(rates)


def _margin(quaternion: Quaternion) -> Scalar:
    # under the name that logs of flights hold
    return euler_margin(quaternion)


make_bulut = law_maker(
    "bulut2019",
    bulut_computed_torque,
    margin=_margin,
    limit=SINGULAR_PITCH,
)
"""Maker of the computed torque law after Bulut et al. 2019, for any arm. Gains of the
attitude act on the Euler angles, joint gains on acceleration."""
