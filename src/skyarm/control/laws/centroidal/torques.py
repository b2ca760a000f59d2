"""From thrust and accelerations to rotor and joint commands: inverse dynamics of an
underactuated base.
"""

from __future__ import annotations

from skyarm.algebra import E_Z, Scalar, Scalars, Vec3, differences
from skyarm.algebra.scalars import (
    absolute,
    add,
    clip,
    data,
    logical_and,
    maximum,
    sqrt,
    sub,
    where,
)
from skyarm.control.blocks.actuators import (
    command_for,
    compensate_motor_lag,
    limit_efforts,
)
from skyarm.control.blocks.center_of_mass import forces_under_thrust, reaction
from skyarm.control.blocks.prediction import Disturbance, motor_speeds
from skyarm.control.laws.centroidal.parameters import Step
from skyarm.control.laws.centroidal.step_records import AccelerationDemand
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command, friction, mix
from skyarm.records.immutable import immutable

LAG_INVERSION = 0.1
"""Fraction of the motors' lag that commands invert: none leaves two vehicles of seven
lost, all of it shakes the rotors nearly four times as much, for 7 % of the error."""

TRIM_RATE = 3.0
"""Correction rate (1/s) of the rotors' mean squared speeds."""

TRIM = 0.1
"""Bound of the rotor trim as a fraction of a rotor's largest squared speed: more than
the motor lag takes."""


def needed(
    model: Model, state: State, demand: AccelerationDemand, unknown: Disturbance
) -> tuple[Vec3, Scalars]:
    """Body torque (N m, base axes) and joint torques for the desired accelerations
    under the desired thrust.

    The disturbance is subtracted; friction of the model is added, its dry part at the
    references' rates.
    """
    vehicle, qd = model.vehicle, state.joint_rates
    dry_rates = [q.derivative(1) for q in demand.planned.joints]
    force, efforts, _ = forces_under_thrust(
        vehicle,
        state.joints,
        state.rate,
        qd,
        applied=E_Z * demand.thrust
        + demand.across
        + state.rotation.apply_T(unknown.force),
        angular=demand.alpha,
        joint_accelerations=demand.joints,
    )
    return force.torque - unknown.torque, tuple(
        add(sub(effort, extra), friction(link.joint, rate, dry))
        for effort, extra, link, rate, dry in zip(
            efforts, unknown.efforts, vehicle.links, qd, dry_rates, strict=True
        )
    )


@immutable
class ActuatorOutput:
    """Result of one control step: command, flags of unsaturated actuators, and rotor
    trim.

    Attributes:
        free: 1 for the base and each joint whose actuators are not at their limit, else
            0.
        trim: trim of the squared rotor speeds, one period later, (rad/s)^2.
    """

    command: Command
    free: Scalars
    trim: Scalars


def actuate(
    step: Step, unknown: Disturbance, demand: AccelerationDemand
) -> ActuatorOutput:
    """Rotor and joint commands for the demanded thrust and accelerations.

    Motors that slow down later than they speed up lose thrust under noise: the trim
    integrates, within bounds, what the modelled mean squared speeds miss, but not while
    others change the rotors' commands. Joints whose torques are cut push the base less:
    that part of the body torque falls away, so that the base's angular acceleration
    stays as desired.
    """
    par, state, dt, trim = step.par, step.state, step.dt, step.memory.trim
    model = par.model
    torque, efforts = needed(model, state, demand, unknown)
    limited = limit_efforts(par, tuple(map(data, efforts)))
    missing = differences(efforts, limited)
    arm = reaction(model.vehicle, state.joints)
    late = arm.accelerations(missing)
    torque = torque - arm.torque(late)
    desired, squares = mix(par.mixer, torque, demand.thrust, demand.across)
    # at a limit rotors give another wrench: trim and observer must not learn it
    inside: Scalar = demand.thrust > 0.0
    for square, highest in zip(squares, par.mixer.highest, strict=True):
        inside = logical_and(inside, logical_and(square > 0.0, square < highest))
    ahead = compensate_motor_lag(
        model.vehicle.rotors, par.mixer, demand.force_rate, trim, dt, LAG_INVERSION
    )
    targets = [
        sqrt(maximum(w * w + t, 0.0)) for w, t in zip(desired, ahead, strict=True)
    ]
    speeds = tuple(
        command_for(rotor, speed, target, dt, LAG_INVERSION)
        for rotor, speed, target in zip(
            model.vehicle.rotors, state.rotor_speeds, targets, strict=True
        )
    )
    command = Command(rotor_speeds=speeds, efforts=limited)
    reached = motor_speeds(model, state.rotor_speeds, command, dt)
    rate = where(logical_and(inside, step.memory.applied[0] > 0.5), TRIM_RATE * dt, 0.0)
    return ActuatorOutput(
        command=command,
        free=(
            where(inside, 1.0, 0.0),
            *(
                where(absolute(e) < joint.effort_limit, 1.0, 0.0)
                for e, joint in zip(efforts, model.vehicle.joints, strict=True)
            ),
        ),
        trim=tuple(
            clip(t + rate * (w * w - r * r), -TRIM * highest, TRIM * highest)
            for t, w, r, highest in zip(
                trim, desired, reached, par.mixer.highest, strict=True
            )
        ),
    )
