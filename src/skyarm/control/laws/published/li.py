"""Geometric control with variable inertia and feed-forward of the arm's reaction, in
the manner of Li et al. 2024.

    f = m (-a_d) + R F_arm,   thrust = f . R e_z,  R_d from f
    torque = J(q) alpha_d + T_arm + h(q) x R^T (-a_d)
    [T_arm, F_arm]: reaction of the arm's motion and the velocity products at the
    measured q, qd and the *reference's* joint accelerations (measured ones are noise)
    joints: servos, PD on acceleration through the arm's own inertia, and weight by the
    true attitude

J(q) and h(q) are the inertia and first moment of the whole vehicle with locked joints.
The base answers to the arm; the arm does not answer to the base, which distinguishes
this law from the paper's.

Assumed (the texts at hand are Barakou et al. 2026's summary of Li et al., and the
preprint of Zhang et al. 2019 on the same variable inertia model): the geometric base
controller; reference accelerations in the feed-forward; servo joints; no disturbance
observer beside it.

Source: Li, Li, Xu, Yu, Basin, IEEE Trans. Cybernetics 55, 2024; Zhang et al. 2019
(arXiv 2401.04316).
"""

from __future__ import annotations

from skyarm.algebra import Scalar
from skyarm.control.blocks.center_of_mass import arm_reaction, locked_inertia
from skyarm.control.blocks.common import (
    arm_alone,
    inverse_mass,
    make_command,
    turn_towards,
    wanted_specific_force,
)
from skyarm.control.controller import Memory
from skyarm.control.law_maker import law_maker
from skyarm.control.laws.paper import joint_accelerations
from skyarm.control.model import Parameters
from skyarm.dynamics.actuators import Command
from skyarm.reference import Reference
from skyarm.sensing.measurement import Measurement


def li_feedforward(
    memory: Memory,
    measurement: Measurement,
    reference: Reference,
    dt: Scalar,
    *,
    par: Parameters,
) -> tuple[Memory, Command]:
    """Geometric base control with feed-forward of the arm's reaction; the joints are
    controlled separately.
    """
    del dt
    vehicle, R, q = par.model.vehicle, measurement.rotation, measurement.joints
    reaction = arm_reaction(
        vehicle,
        q,
        measurement.rate,
        measurement.joint_rates,
        reference.joint_accelerations,
    )
    specific = wanted_specific_force(par, measurement, reference)
    up = specific + R.apply(reaction.force) * inverse_mass(vehicle)
    alpha = turn_towards(par, measurement, reference, R, up)
    whole = locked_inertia(vehicle, q)
    torque = (
        whole.inertia.apply(alpha)
        + reaction.torque
        + whole.moment.cross(R.apply_T(specific))
    )
    efforts = arm_alone(par, R, q, joint_accelerations(par, measurement, reference))
    thrust = vehicle.mass * up.dot(R.column(2))
    return memory, make_command(par, torque, thrust, efforts)


make_li = law_maker("li2024", li_feedforward)
"""Maker of the feed-forward law after Li et al. 2024, for any arm."""
