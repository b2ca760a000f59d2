"""Ablation ladder: computed torque of Barakou et al. 2026, extended in steps towards
the centroidal law.

    a* = pdd_d + g e_z - (Kp e_p + Kv e_v) / m                   (82), upwards
    f  = m a* [+ R F_arm(q, qd, qdd*)] [- d_f]                   thrust = f . R e_z
    alpha* = -I_b^-1 (KR e_R + Kw e_w) [+ R^T R_d wd_d - w x R^T R_d w_d]    (85)
    a  = a*  or  [(f_real - F_0) / m]
    [T, tau] = M [a; alpha*; qdd*] + products  [- d]

f is the direction of the thrust, and w_d and wd_d follow from f, f' and f''; a is the
base's acceleration in the inverse dynamics.

Terms in brackets are the steps. The base's angular acceleration stays out of the thrust
direction: with it the attitude would chase its own control torque.

Source: Barakou et al. 2026, eq. (82)-(96); the parts cite their own.
"""

from __future__ import annotations

from typing import Annotated

from skyarm.algebra import (
    E_Z,
    ZERO3,
    Mat3,
    Motion,
    Scalar,
    Scalars,
    Vec3,
    differences,
)
from skyarm.algebra.scalars import add, divide, minimum, where
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.blocks.actuators import (
    command_for,
    joints_follow,
    limit_efforts,
    rotors_follow,
)
from skyarm.control.blocks.attitude import attitude, reachable, vector_series
from skyarm.control.blocks.center_of_mass import arm_reaction, forces_under_thrust
from skyarm.control.blocks.common import (
    Started,
    coupled_forces,
    standing_command,
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
from skyarm.control.blocks.extrapolation import Channel, extrapolate
from skyarm.control.blocks.geometric import angular_acceleration, attitude_error
from skyarm.control.blocks.prediction import Disturbance, with_side
from skyarm.control.law_maker import law_maker
from skyarm.control.laws.paper import joint_accelerations
from skyarm.control.model import MeasurementAge, Parameters
from skyarm.dynamics.actuators import Command, friction, mix
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit, nonnegative, positive
from skyarm.reference import Reference
from skyarm.reference.preview import samples
from skyarm.sensing.measurement import Measurement

COUPLED_THRUST, CONSISTENT, OBSERVER, FEEDFORWARD, EXTRAPOLATION, LAG_INVERSION = range(
    1, 7
)
"""Indices of the extensions of the law of Barakou et al. 2026; each includes those
before it.

1. The thrust points along the force that the coupled dynamics need, with the arm's
  reaction.
2. The inverse dynamics takes the base's acceleration that the real thrust gives, not
  the desired one.
3. Force, torque and joint torques that the model lacks are estimated and compensated.
4. Desired body rate and angular acceleration follow from the derivatives of the desired
  force.
5. Held reference samples are continued to the present.
6. Rotor commands undo the motors' lag.
"""


@immutable
class StepParameters(Parameters):
    """Constants of the ablation ladder, beyond those of the computed torque law of
    Barakou et al. 2026.

    Attributes:
        steps: number of extensions taken, 1 to 6.
        observer: bandwidths, rad/s. reference_period: time between published samples,
            s.
        lag_share: share of the motors' lag that rotor commands undo; above 1 counts as
            1.
        delay_periods: age of the measurement in control periods, for the observer's
            inputs.
    """

    observer: ObserverGains
    steps: Annotated[
        int,
        Unit("", "number of extensions of the ablation ladder in use", low=1, high=6),
    ] = LAG_INVERSION
    reference_period: Annotated[
        float, positive("s", "time between published reference samples")
    ] = 0.02
    lag_share: Annotated[
        float,
        nonnegative(
            "",
            "fraction of the motor lag that rotor commands invert; above 1 counts as 1",
            effect="higher values answer faster and amplify noise",
        ),
    ] = 1.0
    delay_periods: MeasurementAge = 0


@immutable
class StepMemory:
    """Internal state of the ablation ladder (computed torque with added steps); fields
    of unused steps are empty.

    Attributes:
        started: 0 before the first measurement.
        observed: state of the observer, or none. sent: the last commands, oldest first.
        free: 1 while no actuator was at its limit, for the base and each joint.
        age, channels: age of the held reference sample, and states of its
            extrapolation.
    """

    started: Started
    observed: Observed | tuple[()]
    sent: tuple[Command, ...]
    free: Annotated[
        Scalars, Unit("", "1 while no actuator is at its limit: base, then joints")
    ]
    age: Annotated[Scalar, Unit("s", "since the held reference sample appeared")]
    channels: tuple[Channel, ...]


TILT, FLOOR = 1.2, 0.15
"""Largest tangent of the tilt, and smallest vertical force over the weight, where the
force is differentiated: those that the centroidal law has by default."""


def stepped_computed_torque(
    memory: StepMemory,
    measurement: Measurement,
    reference: Reference,
    dt: Scalar,
    *,
    par: StepParameters,
) -> tuple[StepMemory, Command]:
    """One control step of the computed torque law with the first ``par.steps``
    extensions.
    """
    steps, R = par.steps, measurement.rotation
    goal, channels, age = _present(memory, reference, dt, par)
    observed, unknown = _estimate_disturbance(memory, measurement, dt, par)
    qdd = joint_accelerations(par, measurement, goal)
    specific = wanted_specific_force(par, measurement, goal)
    force = _force(specific, measurement, R, qdd, unknown, par)
    alpha = _turn(force, measurement, goal, R, unknown, par)
    torque, thrust, efforts = _forces(
        specific, force, alpha, measurement, goal, R, qdd, unknown, par
    )
    speeds, squares = mix(par.mixer, torque, thrust)
    if steps >= LAG_INVERSION:
        # the observer models the motors: its speeds have no noise to be led
        turning = observed.rotor_speeds if observed else measurement.rotor_speeds
        speeds = tuple(
            # a share above 1 would carry the speed past its target within the period
            command_for(rotor, now, target, dt, minimum(par.lag_share, 1.0))
            for rotor, now, target in zip(
                par.model.vehicle.rotors, turning, speeds, strict=True
            )
        )
    command = Command(rotor_speeds=speeds, efforts=limit_efforts(par, efforts))
    inside = [
        rotors_follow(par.mixer, squares),
        *joints_follow(par.model.vehicle, efforts),
    ]
    # the oldest command sent is the one that the next measurement answers
    following = StepMemory(
        started=1.0,
        observed=observed,
        sent=(*memory.sent[1:], command) if steps >= OBSERVER else (),
        free=(
            tuple(where(each, 1.0, 0.0) for each in inside) if steps >= OBSERVER else ()
        ),
        age=age,
        channels=channels,
    )
    return following, command


def _present(
    memory: StepMemory, reference: Reference, dt: Scalar, par: StepParameters
) -> tuple[Reference, tuple[Channel, ...], Scalar]:
    """Reference extrapolated to the present, extrapolator states, and age (s) of the
    last reference sample.
    """
    if par.steps < EXTRAPOLATION:
        return reference, (), memory.age
    series, channels, age = extrapolate(
        memory.channels,
        memory.age,
        samples(reference),
        memory.started,
        dt,
        par.reference_period,
    )

    def of(k: int) -> Scalars:
        return tuple(signal.derivative(k) for signal in series)

    p, v, a, j, s = map(of, range(5))
    now = Reference(
        position=Vec3(*p[:3]),
        velocity=Vec3(*v[:3]),
        acceleration=Vec3(*a[:3]),
        jerk=Vec3(*j[:3]),
        snap=Vec3(*s[:3]),
        yaw=p[3],
        yaw_rate=v[3],
        yaw_acceleration=a[3],
        joints=p[4:],
        joint_rates=v[4:],
        joint_accelerations=a[4:],
    )
    return now, channels, age


def _estimate_disturbance(
    memory: StepMemory, measurement: Measurement, dt: Scalar, par: StepParameters
) -> tuple[Observed | tuple[()], Disturbance]:
    """Next state of the disturbance observer and disturbance estimate; empty and zero
    without an observer.
    """
    # int zeros: without an observer the program has no terms of it
    if not memory.observed:
        return (), Disturbance(
            force=ZERO3, torque=ZERO3, efforts=(0,) * par.model.vehicle.n
        )
    observed = observe_uncompensated(
        par.model,
        par.observer,
        memory.observed,
        measurement,
        memory.sent[0],
        memory.started,
        memory.free,
        dt,
    )
    # the observer's model has the rotors' drag in still air: the force on the base is
    # that and the estimated rest
    R = observed.quaternion.rotation()
    felt = with_side(
        par.model,
        disturbance(observed),
        R,
        observed.rotor_speeds,
        observed.velocity,
        observed.rate,
    )
    return observed, felt


def _force(
    specific: Vec3,
    measurement: Measurement,
    R: Mat3,
    qdd: Scalars,
    unknown: Disturbance,
    par: StepParameters,
) -> Vec3:
    """Desired rotor force (N, world axes), whose direction is the desired thrust
    axis.
    """
    vehicle = par.model.vehicle
    force = specific * vehicle.mass - unknown.force
    if par.steps < COUPLED_THRUST:
        return force
    arm = arm_reaction(
        vehicle, measurement.joints, measurement.rate, measurement.joint_rates, qdd
    )
    return force + R.apply(arm.force)


def _turn(
    force: Vec3,
    measurement: Measurement,
    goal: Reference,
    R: Mat3,
    unknown: Disturbance,
    par: StepParameters,
) -> Vec3:
    """Angular acceleration (rad/s^2, base axes) that turns the thrust towards a
    force.
    """
    if par.steps < FEEDFORWARD:
        return turn_towards(par, measurement, goal, R, force)
    model = par.model
    moving = _force_series(force, measurement, goal, R, unknown, par)
    # near no force its direction turns without bound
    moving = reachable(moving, TILT, FLOOR * model.vehicle.mass * model.gravity)
    yaw = Taylor.of_derivatives((goal.yaw, goal.yaw_rate, goal.yaw_acceleration))
    desired = attitude(moving, yaw)
    relative = R.T @ desired.R
    w_d = relative.apply(desired.rate)
    pull = angular_acceleration(
        par.gains,
        par.model.vehicle.base.inertia,
        attitude_error(R, desired.R),
        measurement.rate - w_d,
    )
    return pull + relative.apply(desired.acceleration) - measurement.rate.cross(w_d)


def _force_series(
    force: Vec3,
    measurement: Measurement,
    goal: Reference,
    R: Mat3,
    unknown: Disturbance,
    par: StepParameters,
) -> Vec3:
    """Desired force with two time derivatives, from reference, tracking errors and
    present thrust.
    """
    mass = par.model.vehicle.mass
    b3 = R.column(2)
    # the derivatives take the present thrust along body z, not the desired one: this is
    # what accelerates the base
    per_mass = divide(1.0, mass)
    b3d = R.apply(measurement.rate.cross(E_Z))
    along = force.dot(b3)
    drift = measurement.velocity - goal.velocity
    pull = (
        (b3 * along + unknown.force) * per_mass
        - E_Z * par.model.gravity
        - goal.acceleration
    )
    first = (
        goal.jerk * mass
        - par.gains.position.hadamard(drift)
        - par.gains.velocity.hadamard(pull)
    )
    change = (
        b3 * first.dot(b3) + b3 * force.dot(b3d) + b3d * along
    ) * per_mass - goal.jerk
    second = (
        goal.snap * mass
        - par.gains.position.hadamard(pull)
        - par.gains.velocity.hadamard(change)
    )
    return vector_series((force, first, second))


def _forces(
    specific: Vec3,
    force: Vec3,
    alpha: Vec3,
    measurement: Measurement,
    goal: Reference,
    R: Mat3,
    qdd: Scalars,
    unknown: Disturbance,
    par: StepParameters,
) -> tuple[Vec3, Scalar, list[Scalar]]:
    """Body torque, thrust and joint efforts by inverse dynamics, with the disturbance
    compensated.
    """
    vehicle, rates = par.model.vehicle, measurement.joint_rates
    weight = R.apply_T(unknown.force)
    if par.steps >= CONSISTENT:
        thrust = force.dot(R.column(2))
        needed, efforts, _ = forces_under_thrust(
            vehicle,
            measurement.joints,
            measurement.rate,
            rates,
            applied=E_Z * thrust + weight,
            angular=alpha,
            joint_accelerations=qdd,
        )
    else:
        base = Motion(alpha, R.apply_T(specific))
        needed, efforts = coupled_forces(par, measurement, base, qdd)
        thrust = needed.force.z - weight.z
    torques = [*differences(efforts, unknown.efforts)]
    if par.steps >= OBSERVER:
        # the observer's model has the friction, so that no disturbance stands for it
        given = zip(torques, vehicle.links, rates, goal.joint_rates, strict=True)
        torques = [
            add(effort, friction(link.joint, qd, qd_d))
            for effort, link, qd, qd_d in given
        ]
    return needed.torque - unknown.torque, thrust, torques


def first_memory(par: StepParameters) -> StepMemory:
    """Initial internal state of the ablation ladder's law: level hover with the joints
    at zero.
    """
    vehicle, steps = par.model.vehicle, par.steps
    standing = standing_command(par.model)
    return StepMemory(
        started=0.0,
        observed=(
            first_observed(vehicle.n, standing.rotor_speeds)
            if steps >= OBSERVER
            else ()
        ),
        sent=(standing,) * (par.delay_periods + 1) if steps >= OBSERVER else (),
        free=(1.0,) * (1 + vehicle.n) if steps >= OBSERVER else (),
        age=0.0,
        channels=(Channel(),) * (4 + vehicle.n) if steps >= EXTRAPOLATION else (),
    )


make_stepped = law_maker(
    "ct_ladder",
    stepped_computed_torque,
    StepParameters,
    readers={"observer": ((25.0, 30.0, 40.0), observer_gains)},
    memory=first_memory,
)
"""Maker of the ablation ladder's controllers; ``observer``: bandwidths of force, torque
and joint torques (rad/s), as in the predictive law; chosen."""
