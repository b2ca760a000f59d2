"""L1 adaptive augmentation of the coupled geometric law: state predictor,
piecewise-constant adaptation, low-pass.

With z = [v (world), w (body), joint rates] and one Hurwitz rate -a per group:

    zhat+ = zhat + dt (zdd(z, u) + sigma - a ztilde),   ztilde = zhat - z
    sigma = -Phi^-1 mu = -(-a) e / (e - 1) ztilde,      e = exp(-a dt)
    [F, T, tau] = M(q) sigma,   u = u_b - C(s) [F . b_z, T, tau]

zdd is the model's forward dynamics with the command that was sent, as the actuators can
give it (limits included, which keeps the estimate from winding up); u_b is the
geometric law through the coupled inverse dynamics. C(s) is a first-order low-pass on
the thrust and two in series on the torques. The force across body z is unmatched: the
published law leaves it; with ``lateral`` its low-pass goes into the wanted
acceleration, which is no part of the publication.

Of a constant disturbance the adaptation finds the share e, one period's decay: 1 - e of
it stays, as published.

Deviations: the baseline models the arm; the predictor is the coupled model with joint
rates as further states; the compensation is cut at a limit.

Source: Wu, Cheng, Zhao, Gahlawat, Ackerman, Lakshmanan, Yang, Yu, Hovakimyan, L1Quad,
IEEE Trans. Control Systems Technology 33, 2025 (arXiv 2302.07208), section III;
parameter values start from the authors' Crazyflie firmware.

A prediction is computed one period later than published, at its own instant: only then
are the commands sent in between known.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import Annotated

from skyarm import dynamics
from skyarm.algebra import (
    ZERO3,
    ZERO3_DATA,
    Force,
    Mat3,
    Motion,
    Quaternion,
    Scalar,
    Scalars,
    Vec3,
    differences,
)
from skyarm.algebra.scalars import clip, divide, exp, minimum, where
from skyarm.control.blocks.common import (
    Started,
    coupled_forces,
    inverse_mass,
    make_command,
    no_command,
    rotor_thrust,
    turn_towards,
    wanted_specific_force,
)
from skyarm.control.blocks.filters import low_pass
from skyarm.control.law_maker import law_maker
from skyarm.control.laws.paper import joint_accelerations
from skyarm.control.model import Model, Parameters
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.state import coordinate_acceleration
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit, positive
from skyarm.reference import Reference
from skyarm.sensing.measurement import Measurement


def adaptation(error: Scalar, rate: Scalar, dt: Scalar) -> Scalar:
    """Piecewise-constant disturbance estimate of one velocity channel, from its
    prediction error; ``rate`` is its a, 1/s.

    The error that sigma makes in one period from ztilde = 0 is e^(a dt) times itself:
    the next sigma cancels it.
    """
    e = exp(-(rate * dt))
    return error * divide(rate * e, e - 1.0)


_FASTER = (
    "higher values reject disturbances faster, amplify noise and tolerate less delay"
)

_bandwidth = partial(positive, "rad/s")


@immutable
class L1Parameters(Parameters):
    """Constants of the L1 law in addition to the gains.

    Attributes:
        predictor: a of velocity, rate, joint rates, 1/s.
        thrust_filter, torque_filter, second_filter, joint_filter, lateral_filter:
            bandwidths of C(s), rad/s; torques go through ``torque_filter`` and
            ``second_filter``, joint efforts through ``joint_filter`` and
            ``second_filter``.
        force_limit: largest compensated force, N. torque_limit: largest torque, N m.
        lateral: compensate the unmatched force through the attitude.
    """

    predictor: Annotated[
        tuple[float, float, float],
        positive(
            "1/s",
            "error gain of the state predictor for velocity, body rate and joint rates",
            effect=(
                "higher values make the predictor follow the measurement more closely"
            ),
        ),
    ] = (5.0, 10.0, 10.0)
    thrust_filter: Annotated[
        float,
        _bandwidth("bandwidth of the filter of the compensated thrust", effect=_FASTER),
    ] = 5.0
    torque_filter: Annotated[
        float,
        _bandwidth(
            "bandwidth of the first filter of the compensated torque", effect=_FASTER
        ),
    ] = 10.0
    second_filter: Annotated[
        float,
        _bandwidth(
            "bandwidth of the second filter of torques and joint efforts",
            effect=_FASTER,
        ),
    ] = 20.0
    joint_filter: Annotated[
        float,
        _bandwidth(
            "bandwidth of the first filter of the compensated joint efforts",
            effect=_FASTER,
        ),
    ] = 10.0
    lateral_filter: Annotated[
        float,
        _bandwidth(
            "bandwidth of the filter of the lateral force compensated by tilting",
            effect=(
                "higher values reject lateral forces faster and need a faster attitude"
                " loop"
            ),
        ),
    ] = 2.0
    force_limit: Annotated[Scalar, Unit("N", "largest compensated force")]
    torque_limit: Annotated[Scalar, Unit("N m", "largest compensated torque")]
    lateral: bool = False


@immutable
class L1Memory:
    """Internal state of the L1 law: last measurement, prediction error, and filtered
    disturbance estimates.

    Attributes:
        started: 0 before the first measurement.
        quaternion, joints: attitude and joint positions, measured one period ago. sent:
            the command since then.
        measured, error, sigma: z, the error of its prediction and what disturbs it, one
            period ago.
        force: low-pass of the estimated force, world axes, N. thrust: along body z, N.
        torque, torque_twice: torque after one and two filters, N m. efforts,
            efforts_twice: the same of the joints.
    """

    started: Started
    quaternion: Annotated[
        Quaternion, Unit("", "attitude w x y z measured one period ago, base to world")
    ]
    joints: Annotated[
        Scalars, Unit("rad or m", "joint positions measured one period ago")
    ]
    measured: Annotated[
        Scalars,
        Unit(
            "m/s, rad/s", "velocity, body rate and joint rates measured one period ago"
        ),
    ]
    error: Annotated[
        Scalars,
        Unit(
            "m/s, rad/s",
            "prediction error one period ago: velocity, body rate, joint rates",
        ),
    ]
    sigma: Annotated[
        Scalars, Unit("m/s^2, rad/s^2", "estimated disturbance one period ago")
    ]
    sent: Command
    force: Annotated[Vec3, Unit("N", "filtered force estimate, world axes")]
    thrust: Annotated[Scalar, Unit("N", "filtered force estimate along body z")]
    torque: Annotated[Vec3, Unit("N m", "torque estimate, filtered once, base axes")]
    torque_twice: Annotated[
        Vec3, Unit("N m", "torque estimate, filtered twice, base axes")
    ]
    efforts: Annotated[
        Scalars, Unit("N m or N", "joint effort estimates, filtered once")
    ]
    efforts_twice: Annotated[
        Scalars, Unit("N m or N", "joint effort estimates, filtered twice")
    ]


def l1_adaptive(
    memory: L1Memory,
    measurement: Measurement,
    reference: Reference,
    dt: Scalar,
    *,
    par: L1Parameters,
) -> tuple[L1Memory, Command]:
    """L1 adaptive control: coupled geometric law minus the filtered estimate of the
    disturbance.
    """
    vehicle, R = par.model.vehicle, measurement.rotation
    measured = (*measurement.velocity, *measurement.rate, *measurement.joint_rates)
    begun = memory.started > 0.5
    pairs = zip(predict_velocities(par, memory, dt), measured, strict=True)
    # the first measurement has no prediction to miss
    error = tuple(where(begun, predicted - seen, 0.0) for predicted, seen in pairs)
    sigma = tuple(
        adaptation(e, a, dt) for e, a in zip(error, _predictor_rates(par), strict=True)
    )
    force, efforts = dynamics.inverse_dynamics(
        vehicle,
        measurement.joints,
        ZERO3,
        (0,) * vehicle.n,
        Motion(Vec3(*sigma[3:6]), R.apply_T(Vec3(*sigma[:3]))),
        sigma[6:],
    )
    filtered = _advance_filters(memory, R, force, efforts, dt, par)
    command = _command(filtered, measurement, reference, R, par)
    following = replace(
        filtered,
        quaternion=measurement.quaternion,
        joints=measurement.joints,
        measured=measured,
        error=error,
        sigma=sigma,
        sent=command,
    )
    return following, command


def _predictor_rates(par: L1Parameters) -> Scalars:
    """Decay rate a (1/s) of each velocity channel of the state predictor."""
    linear, angular, joints = par.predictor
    return (*(linear,) * 3, *(angular,) * 3, *(joints,) * par.model.vehicle.n)


def predict_velocities(par: L1Parameters, memory: L1Memory, dt: Scalar) -> Scalars:
    """State predictor: velocities one period after the last measurement, by an Euler
    step.
    """
    vehicle, was, sent = par.model.vehicle, memory.measured, memory.sent
    speeds = [
        minimum(speed, rotor.max_speed)
        for speed, rotor in zip(sent.rotor_speeds, vehicle.rotors, strict=True)
    ]
    applied = Force(*rotor_thrust(vehicle, speeds))
    proper, qdd = dynamics.forward_dynamics(
        vehicle, memory.joints, Vec3(*was[3:6]), was[6:], applied, sent.efforts
    )
    linear, angular = coordinate_acceleration(
        memory.quaternion.rotation(), proper, par.model.gravity
    )
    rows = zip(
        _predictor_rates(par),
        was,
        memory.error,
        (*linear, *angular, *qdd),
        memory.sigma,
        strict=True,
    )
    # z + error is the prediction before
    return tuple(
        z + error + dt * (zd + sigma - a * error) for a, z, error, zd, sigma in rows
    )


def _advance_filters(
    memory: L1Memory,
    R: Mat3,
    force: Force,
    efforts: Sequence[Scalar],
    dt: Scalar,
    par: L1Parameters,
) -> L1Memory:
    """L1 law's internal state with all low-pass filters advanced by one period and
    their outputs clipped.

    The limit comes after the filter: noise cut on one side only would leave a bias.
    """

    def filter_within(
        old: Iterable[Scalar],
        new: Iterable[Scalar],
        bandwidth: Scalar,
        limits: Iterable[Scalar],
    ) -> Scalars:
        rows = zip(old, new, limits, strict=True)
        return tuple(
            clip(low_pass(a, b, bandwidth, dt), -limit, limit) for a, b, limit in rows
        )

    force_limits, torque_limits = (par.force_limit,) * 3, (par.torque_limit,) * 3
    effort_limits = [joint.effort_limit for joint in par.model.vehicle.joints]
    torque = Vec3(
        *filter_within(memory.torque, force.torque, par.torque_filter, torque_limits)
    )
    once = filter_within(memory.efforts, efforts, par.joint_filter, effort_limits)
    return replace(
        memory,
        started=1.0,
        force=Vec3(
            *filter_within(
                memory.force, R.apply(force.force), par.lateral_filter, force_limits
            )
        ),
        thrust=filter_within(
            (memory.thrust,), (force.force.z,), par.thrust_filter, force_limits[:1]
        )[0],
        torque=torque,
        torque_twice=Vec3(
            *filter_within(
                memory.torque_twice, torque, par.second_filter, torque_limits
            )
        ),
        efforts=once,
        efforts_twice=filter_within(
            memory.efforts_twice, once, par.second_filter, effort_limits
        ),
    )


def _command(
    filtered: L1Memory,
    measurement: Measurement,
    reference: Reference,
    R: Mat3,
    par: L1Parameters,
) -> Command:
    """Command u_b + u_ad of the L1 law: baseline control plus adaptive compensation."""
    specific = up = wanted_specific_force(par, measurement, reference)
    b3 = R.column(2)
    if par.lateral:
        # only the attitude leans against it: the base accelerates as wanted, so this is
        # an input of the arm
        up = specific - (filtered.force - b3 * filtered.force.dot(b3)) * inverse_mass(
            par.model.vehicle
        )
    base = Motion(turn_towards(par, measurement, reference, R, up), R.apply_T(specific))
    force, efforts = coupled_forces(
        par, measurement, base, joint_accelerations(par, measurement, reference)
    )
    torques = differences(efforts, filtered.efforts_twice)
    return make_command(
        par,
        force.torque - filtered.torque_twice,
        force.force.z - filtered.thrust,
        torques,
    )


def limits(model: Model) -> dict[str, Scalar]:
    """Bounds of the compensation: half the weight, and a quarter of the weight at the
    rotor arm as torque.

    More cannot be compensated and flown at once.
    """
    weight = model.vehicle.mass * model.gravity
    reach = max(float(rotor.position.norm()) for rotor in model.vehicle.rotors)
    return {"force_limit": 0.5 * weight, "torque_limit": 0.25 * weight * reach}


def first_memory(par: L1Parameters) -> L1Memory:
    """Initial internal state of the L1 law: no prediction error and no disturbance."""
    arm = par.model.vehicle.zeros
    none = (0.0,) * (6 + len(arm))
    return L1Memory(
        started=0.0,
        quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
        joints=arm,
        measured=none,
        error=none,
        sigma=none,
        sent=no_command(par.model.vehicle),
        force=ZERO3_DATA,
        thrust=0.0,
        torque=ZERO3_DATA,
        torque_twice=ZERO3_DATA,
        efforts=arm,
        efforts_twice=arm,
    )


make_l1 = law_maker(
    "l1_adaptive", l1_adaptive, L1Parameters, constants=limits, memory=first_memory
)
"""Maker of the L1 adaptive law, for any arm."""
