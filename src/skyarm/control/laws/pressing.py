"""Hybrid force/motion control and admittance control, built on the laws of Barakou et
al. 2026.

Both share an observer whose estimates are not compensated, only read: the tip's force
along the surface's normal, its bias, touch and loss are those of the centroidal law
(:mod:`skyarm.control.laws.centroidal.contact.interaction`): only what is done with them
differs.

``hybrid_ct``, the paper's computed torque with a force along the nominal outward normal
n. Across n the law is the paper's. Along n, from the first touch on, the tip has no
position, only damping: of the joints' desired accelerations that part which moves the
tip along n is replaced by -d v_n, by the pseudo-inverse of the row n'J. The order

    o = g (f_d + i),   i' = k (f_d - f . n)

stands as a known force n o of the surface on the tip: its joint torques J^T n o, its
torque about the base and its force are taken off the inverse dynamics, and the attitude
turns for the rest. Touch, loss, ramp g, integral, damping and the shift of the
reference with which the base comes to the surface and follows it are the centroidal
law's.

``admittance_pd``, the paper's baseline on a reference that a virtual mass shifts by s
along n:

    M s'' + D s' = f . n - f_d,     D = f_d / v,     M = D / rate,

with f the observed force of the surface on the tip, f_d the desired one and v the speed
with which the tip comes: in free flight f_d drives the virtual mass towards the surface
at v, on it s rests where the desired force acts. Without contact s returns. The base's
soft position loop presses; the joints carry the desired force by J^T n f_d, ramped as
the centroidal law does, and keep the arm's posture by PD.

Source: Raibert, Craig 1981, "Hybrid position/force control of manipulators"; Khatib
1987 (force feed-forward J^T f); Hogan 1985; admittance around a position-controlled
aerial robot as in Augugliaro, D'Andrea 2013, "Admittance control for physical
human-quadrocopter interaction", ECC; the laws: Barakou et al. 2026, eq. (86)-(96).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from skyarm.algebra import (
    E_Z,
    Motion,
    Scalar,
    Scalars,
    Vec3,
    axis_rotation,
    differences,
)
from skyarm.algebra.scalars import add, clip, divide, maximum, minimum, mul, sub, where
from skyarm.control.blocks.actuators import limit_efforts
from skyarm.control.blocks.common import (
    Started,
    make_command,
    no_command,
    turn_towards,
    wanted_specific_force,
)
from skyarm.control.blocks.disturbance_observer import (
    Observed,
    ObserverGains,
    disturbance,
    first_observed,
    observe_uncompensated,
    observer_gains,
)
from skyarm.control.blocks.force_control import (
    InteractionGains,
    InteractionMemory,
    Pressing,
    first_interaction,
    interact,
    require_thresholds,
    wanted_of,
)
from skyarm.control.blocks.tip_force import TipLevers, levers
from skyarm.control.controller import ControllerError
from skyarm.control.law_maker import law_maker, option_numbers
from skyarm.control.laws.paper import (
    decoupled_pd,
    generalized_force,
    hybrid_computed_torque,
    joint_accelerations,
)
from skyarm.control.model import Model, Parameters
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.kinematics import frame_pose
from skyarm.records.immutable import immutable, positional
from skyarm.reference import Reference
from skyarm.sensing.measurement import Measurement
from skyarm.vehicle import Vehicle


@immutable
class PressingParameters(Parameters):
    """Constants of hybrid force control and admittance control: observer and contact
    force controller.
    """

    observer: ObserverGains
    interaction: InteractionGains


@immutable
class PressingMemory:
    """Internal state of hybrid force control and admittance control.

    Attributes:
        started: 0 before the first measurement. observed: state of the observer. sent:
            the last command.
        interaction: state of the contact force controller.
    """

    started: Started
    observed: Observed
    sent: Command
    interaction: InteractionMemory


@positional
class ObservedContact:
    """Contact in one control period: tip Jacobian, desired and observed force, and
    speeds of the tip.

    Attributes:
        at: measured levers of the tip. pressing: output of the contact force
            controller.
        force: desired force, N. along: observed force of the surface along its normal,
            N; 0 without contact.
        speed: desired speed of the approach, m/s. into: speed of the tip into the
            surface, m/s.
    """

    at: TipLevers
    pressing: Pressing
    force: Scalar
    along: Scalar
    speed: Scalar
    into: Scalar


def observe_contact(
    memory: PressingMemory,
    measurement: Measurement,
    reference: Reference,
    dt: Scalar,
    par: PressingParameters,
) -> tuple[PressingMemory, ObservedContact | None]:
    """Step of disturbance observer and contact detection; the contact is None unless
    the reference requests one.
    """
    vehicle = par.model.vehicle
    # the estimates are read and not compensated, so that nothing winds up at a limit
    free = (1.0,) * (1 + vehicle.n)
    observed = observe_uncompensated(
        par.model,
        par.observer,
        memory.observed,
        measurement,
        memory.sent,
        memory.started,
        free,
        dt,
    )
    # from the number itself, so that the 1 is of its kind: array, symbol or dual
    after = replace(memory, started=memory.started * 0.0 + 1.0, observed=observed)
    if not reference.push:
        return after, None
    at = levers(vehicle, measurement.rotation, measurement.joints)
    # neither law grips: force, speed and normal are all that they take
    desired = wanted_of(reference.push[:5])
    into = -desired.normal.dot(
        at.velocity(measurement.velocity, measurement.rate, measurement.joint_rates)
    )
    interaction, pressing = interact(
        par.interaction,
        memory.interaction,
        desired,
        disturbance(observed),
        at,
        into,
        # no load of actuators: neither law compensates friction that could be relieved
        0.0,
        dt,
    )
    along = where(interaction.touching > 0.5, desired.normal.dot(pressing.force), 0.0)
    touch = ObservedContact(
        at=at,
        pressing=pressing,
        force=desired.force,
        along=along,
        speed=desired.speed,
        into=into,
    )
    return replace(after, interaction=interaction), touch


def shift_base(
    reference: Reference, n: Vec3, shift: tuple[Scalar, Scalar, Scalar]
) -> Reference:
    """Reference with the base position, velocity and acceleration shifted along the
    surface normal.
    """
    s, rate, acceleration = shift
    return replace(
        reference,
        position=reference.position + n * s,
        velocity=reference.velocity + n * rate,
        acceleration=reference.acceleration + n * acceleration,
    )


def thresholds(model: Model, forces: Any) -> InteractionGains:
    """Contact detection constants from two normal forces (N), the thresholds of contact
    and of its loss.

    Raises:
        ControllerError: forces that are none, or a vehicle whose joints move no tip.
    """
    vehicle = model.vehicle
    if not vehicle.end_effector or not vehicle.n:
        raise ControllerError(
            f"model.vehicle = {vehicle.name!r}: must have joints that move an"
            " end_effector"
        )
    touch, lost = option_numbers("interaction", forces, 2)
    require_thresholds((touch, lost), leads=True, optional=False)
    return InteractionGains(touch=touch, lost=lost)


def first_memory(par: PressingParameters) -> PressingMemory:
    """Initial internal state of hybrid force control and admittance control, without
    contact.
    """
    vehicle = par.model.vehicle
    return PressingMemory(
        started=0.0,
        observed=first_observed(vehicle.n, (0.0,) * len(vehicle.rotors)),
        sent=no_command(vehicle),
        interaction=first_interaction(vehicle.n),
    )


READERS = {
    "observer": ((25.0, 30.0, 40.0), observer_gains),
    "interaction": ((0.3, 0.1), thresholds),
}

VAGUE = 0.01
"""Lever (m/rad) along the normal below which the damping leaves a joint unchanged;
chosen: a joint would have to turn by 100 rad for 1 m."""


def hybrid_ct(
    memory: PressingMemory,
    measurement: Measurement,
    reference: Reference,
    dt: Scalar,
    *,
    par: PressingParameters,
) -> tuple[PressingMemory, Command]:
    """Hybrid force/motion control: computed torque across the surface normal, force
    control along it.
    """
    after, touch = observe_contact(memory, measurement, reference, dt, par)
    if touch is None:
        _, command = hybrid_computed_torque((), measurement, reference, dt, par=par)
        return replace(after, sent=command), command
    reference = shift_base(reference, touch.pressing.n, touch.pressing.shift)
    # the reference's base carries the desired tip as if it were level (tip_motion)
    tip = level_tip(par.model.vehicle, reference)
    gap = touch.pressing.n.dot(
        measurement.position + touch.at.R.apply(touch.at.tip) - tip
    )
    command = pressing_command(par, measurement, reference, touch)
    interaction = replace(after.interaction, gap=gap)
    return replace(after, sent=command, interaction=interaction), command


def level_tip(vehicle: Vehicle, reference: Reference) -> Vec3:
    """Tip position (m, world axes) for a level base at its reference."""
    arm = axis_rotation(E_Z, reference.yaw).apply(
        frame_pose(vehicle, vehicle.frame(), reference.joints).p
    )
    return reference.position + arm


def pressing_command(
    par: PressingParameters,
    measurement: Measurement,
    reference: Reference,
    touch: ObservedContact,
) -> Command:
    """Computed torque command plus the contact force command along the surface
    normal.
    """
    vehicle, R = par.model.vehicle, measurement.rotation
    up = wanted_specific_force(par, measurement, reference)
    reaction = touch.at.disturbance(touch.pressing.n * touch.pressing.order)
    alpha = turn_towards(
        par, measurement, reference, R, up - reaction.force * divide(1.0, vehicle.mass)
    )
    qdd = release_normal(touch, joint_accelerations(par, measurement, reference))
    force, torques = generalized_force(
        par, R, measurement, Motion(alpha, R.apply_T(up)), qdd
    )
    efforts = differences(torques, reaction.efforts)
    thrust = force.force.z - R.apply_T(reaction.force).z
    return make_command(par, force.torque - reaction.torque, thrust, efforts)


def release_normal(touch: ObservedContact, wanted: Sequence[Scalar]) -> Scalars:
    """Joint accelerations whose part along the surface normal is replaced by damping
    while the tip presses.
    """
    own = touch.at.R.apply_T(touch.pressing.n)
    row = [own.dot(column) for column in touch.at.columns]
    # damps the pseudo-inverse where no joint has a lever along the normal
    length: Scalar = VAGUE * VAGUE
    along = touch.pressing.damping * -touch.into
    for each, acceleration in zip(row, wanted, strict=True):
        length = add(length, mul(each, each))
        along = add(along, mul(each, acceleration))
    step = mul(touch.pressing.share, divide(along, length))
    return tuple(
        sub(acceleration, mul(each, step))
        for each, acceleration in zip(row, wanted, strict=True)
    )


make_hybrid_ct = law_maker(
    "hybrid_ct", hybrid_ct, PressingParameters, readers=READERS, memory=first_memory
)
"""Maker of hybrid force control for any vehicle whose joints move a tip."""

RATE = 4.0
"""Ratio D / M (1/s) of virtual damping to mass: the approach speed is reached in a
quarter of a second."""

BACK = 4.0
"""Bandwidth (rad/s) of the critically damped return of the reference's shift;
chosen, as quick as ``RATE``."""

LEAST = 0.01
"""Least desired force (N) and speed (m/s) from which the virtual damping is
computed, a quotient of both; chosen."""


def admittance_pd(
    memory: PressingMemory,
    measurement: Measurement,
    reference: Reference,
    dt: Scalar,
    *,
    par: PressingParameters,
) -> tuple[PressingMemory, Command]:
    """Admittance control: decoupled PD control of a reference that a virtual mass
    shifts.
    """
    after, touch = observe_contact(memory, measurement, reference, dt, par)
    if touch is not None:
        shift = admittance_motion(par, memory, touch, dt)
        interaction = replace(after.interaction, shift=shift[0], shift_rate=shift[1])
        after = replace(after, interaction=interaction)
        reference = shift_base(reference, touch.pressing.n, shift)
    _, command = decoupled_pd((), measurement, reference, dt, par=par)
    if touch is not None:
        borne = touch.at.disturbance(
            touch.pressing.n * (touch.pressing.share * touch.force)
        ).efforts
        efforts = differences(command.efforts, borne)
        command = replace(command, efforts=limit_efforts(par, efforts))
    return replace(after, sent=command), command


def admittance_motion(
    par: PressingParameters, memory: PressingMemory, touch: ObservedContact, dt: Scalar
) -> tuple[Scalar, Scalar, Scalar]:
    """Position, velocity and acceleration of the virtual mass along the normal, one
    period later.
    """
    s, rate = memory.interaction.shift, memory.interaction.shift_rate
    damping = divide(maximum(touch.force, LEAST), maximum(touch.speed, LEAST))
    # m/s, at which it would settle
    driven = divide(touch.along - touch.force, damping)
    # a hard surface pushes no faster back than the tip came
    driven = minimum(driven, touch.speed)
    # implicit Euler, so that a virtual mass of any lag is stable at any period
    after = where(
        touch.pressing.asked, (rate + RATE * dt * driven) / (1.0 + RATE * dt), 0.0
    )
    back = (rate - BACK * BACK * dt * s) / (
        1.0 + 2.0 * BACK * dt + BACK * BACK * dt * dt
    )
    velocity = where(touch.pressing.asked, after, back)
    far = par.interaction.furthest
    place = clip(s + dt * velocity, -far, far)
    # none at the end of its way
    velocity = divide(place - s, dt)
    return place, velocity, divide(velocity - rate, dt)


make_admittance_pd = law_maker(
    "admittance_pd",
    admittance_pd,
    PressingParameters,
    readers=READERS,
    memory=first_memory,
    torque_gains=True,
)
"""Maker of admittance control for any vehicle whose joints move a tip."""
