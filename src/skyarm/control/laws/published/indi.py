"""Incremental nonlinear dynamic inversion of base and joints, with its filters.

    f = F_f + m (a_c - a_f),   thrust = f . R e_z,   R_d from f
    [T, tau] = [T_f, tau_f] + M(q) [alpha_c - alpha_f, qdd_c - qdd_f]
        under the increment of the thrust

a_f is the low-pass of the accelerometer (world axes, less gravity), alpha_f and qdd_f
are differences of the low-passed gyroscope and joint rates, F_f and T_f are the
low-passed thrust vector and torque of the rotor speeds, tau_f that of the commanded
joint torques: every signal goes through the same second-order Butterworth filter, so
that all are late alike. What acts besides the rotors is inside a_f, alpha_f and qdd_f
and needs no model; M alone scales the increments.

Rotor speeds are measured, or modelled by the first-order lag from the commands
(``measured_speeds = False``). Joint torques are taken to act at once. Commands are
limited before they are remembered, so that nothing winds up.

Deviations: increments go through the coupled mass matrix of base and arm, and joints
are inverted by their rates; both publications fly a rigid vehicle.

Source: Smeur, Chu, de Croon, J. Guidance, Control, Dynamics 39, 2016; Tal, Karaman,
IEEE Trans. Control Systems Technology 29, 2021 (arXiv 1809.04048).
"""

from __future__ import annotations

from typing import Annotated

from skyarm.algebra import (
    E_Z,
    ZERO3,
    ZERO3_DATA,
    Mat3,
    Scalar,
    Scalars,
    Vec3,
    differences,
    sums,
)
from skyarm.algebra.scalars import divide, minimum, where
from skyarm.control.blocks.center_of_mass import forces_under_thrust
from skyarm.control.blocks.common import (
    Started,
    arm_alone,
    make_command,
    no_command,
    rotor_thrust,
    turn_towards,
    wanted_specific_force,
)
from skyarm.control.blocks.filters import (
    Taps,
    apply_butterworth,
    butterworth,
    settle,
)
from skyarm.control.blocks.select import choose_each
from skyarm.control.law_maker import law_maker
from skyarm.control.laws.paper import joint_accelerations
from skyarm.control.model import MeasurementAge, Parameters
from skyarm.dynamics.actuators import Command, speeds_after
from skyarm.records.immutable import immutable
from skyarm.records.leaves import blend
from skyarm.records.units import Unit, positive
from skyarm.reference import Reference
from skyarm.sensing.measurement import Measurement

NYQUIST_SHARE = 0.45
"""Largest product of cut-off frequency (Hz) and period (s): the bilinear transform
folds at one half."""


@immutable
class IndiParameters(Parameters):
    """Constants of the INDI law in addition to the gains.

    Attributes:
        cutoff: cut-off frequency of every filter, Hz. measured_speeds: False models the
            rotor speeds by the commands.
        delay_periods: known age of the measurement, in control periods, by which the
            commands are late that efforts and modelled rotor speeds follow from.
    """

    cutoff: Annotated[
        float,
        positive(
            "Hz",
            "cut-off frequency of every filter of the law",
            effect=(
                "lower values pass less noise, add lag and reject disturbances later"
            ),
        ),
    ] = 15.0
    measured_speeds: bool = True
    delay_periods: MeasurementAge = 0


@immutable
class IndiMemory:
    """Internal state of the INDI law: filter states, filtered rates, last commands and
    modelled rotor speeds.

    Attributes:
        started: 0 before the first measurement.
        taps: filter states of specific force and thrust vector (world), gyroscope,
            rotor torque, joint rates, efforts.
        rate, joint_rates: filtered, one period ago.
        sent: the commands of the periods before, oldest first.
        speeds: modelled rotor speeds one period ago, rad/s; none where they are
            measured.
    """

    started: Started
    taps: tuple[Taps, ...]
    rate: Annotated[Vec3, Unit("rad/s", "filtered angular velocity, base axes")]
    joint_rates: Annotated[Scalars, Unit("rad/s or m/s", "filtered joint rates")]
    sent: Annotated[
        tuple[Command, ...], Unit("", "commands of past periods, oldest first")
    ]
    speeds: Annotated[
        Scalars, Unit("rad/s", "speeds of the modelled rotors one period ago, unsigned")
    ]


def indi(
    memory: IndiMemory,
    measurement: Measurement,
    reference: Reference,
    dt: Scalar,
    *,
    par: IndiParameters,
) -> tuple[IndiMemory, Command]:
    """Incremental nonlinear dynamic inversion: thrust vector, body torque and joint
    torques by increments.
    """
    vehicle, R, n = par.model.vehicle, measurement.rotation, par.model.vehicle.n
    first = memory.started < 0.5
    speeds = measurement.rotor_speeds
    if not par.measured_speeds:
        # modelled by the commands that are as late as the measurement
        late = memory.sent[0].rotor_speeds
        turned = speeds_after(vehicle.rotors, memory.speeds, late, dt)
        speeds = choose_each(first, speeds, turned)
    # before the first command the joints are taken to hold the arm
    hold = arm_alone(par, R, measurement.joints, (0,) * n)
    taps, signals = _filter_signals(
        memory, measurement, R, speeds, hold, dt, par, first
    )
    force, thrust, rate, torque = (Vec3(*signals[i : i + 3]) for i in range(0, 12, 3))
    joint_rates, efforts = signals[12 : 12 + n], signals[12 + n :]
    per_period = divide(1.0, dt)

    def slope(now: Scalar, past: Scalar) -> Scalar:
        return where(first, 0.0, (now - past) * per_period)

    alpha_f = Vec3(*(slope(a, b) for a, b in zip(rate, memory.rate, strict=True)))
    qdd_f = [slope(a, b) for a, b in zip(joint_rates, memory.joint_rates, strict=True)]
    desired = (
        thrust
        + (wanted_specific_force(par, measurement, reference) - force) * vehicle.mass
    )
    alpha = turn_towards(par, measurement, reference, R, desired)
    along = desired.dot(R.column(2))
    qdd = joint_accelerations(par, measurement, reference)
    # at zero rates: velocity products are in the measured accelerations already
    more, pull, _ = forces_under_thrust(
        vehicle,
        measurement.joints,
        ZERO3,
        (0,) * n,
        applied=E_Z * (along - thrust.dot(R.column(2))),
        angular=alpha - alpha_f,
        joint_accelerations=differences(qdd, qdd_f),
    )
    command = make_command(
        par,
        torque + more.torque,
        along,
        sums(efforts, pull),
    )
    # before the first command the actuators are taken to have held what they do
    held = Command(rotor_speeds=measurement.rotor_speeds, efforts=hold)
    following = IndiMemory(
        started=1.0,
        taps=taps,
        rate=rate,
        joint_rates=tuple(joint_rates),
        sent=(*(blend(first, held, old) for old in memory.sent[1:]), command),
        speeds=() if par.measured_speeds else speeds,
    )
    return following, command


def _filter_signals(
    memory: IndiMemory,
    measurement: Measurement,
    R: Mat3,
    speeds: Scalars,
    hold: Scalars,
    dt: Scalar,
    par: IndiParameters,
    first: Scalar,
) -> tuple[tuple[Taps, ...], list[Scalar]]:
    """Low-pass filter step of all signals, from steady state at the first call."""
    torque, force = rotor_thrust(par.model.vehicle, speeds)
    efforts = choose_each(first, hold, memory.sent[0].efforts)
    signals = [
        *R.apply(measurement.specific_force),
        *R.apply(force),
        *measurement.rate,
        *torque,
        *measurement.joint_rates,
        *efforts,
    ]
    # one filter for all signals, so that each is late by the same
    coefficients = butterworth(minimum(par.cutoff, divide(NYQUIST_SHARE, dt)), dt)
    pairs = [
        apply_butterworth(
            blend(first, settle(value, coefficients), old), value, coefficients
        )
        for value, old in zip(signals, memory.taps, strict=True)
    ]
    return tuple(following for following, _ in pairs), [out for _, out in pairs]


def first_memory(par: IndiParameters) -> IndiMemory:
    """Initial internal state of the INDI law, before the first measurement."""
    vehicle, n = par.model.vehicle, par.model.vehicle.n
    return IndiMemory(
        started=0.0,
        taps=(Taps(),) * (12 + 2 * n),
        rate=ZERO3_DATA,
        joint_rates=(0.0,) * n,
        sent=(no_command(vehicle),) * (par.delay_periods + 1),
        speeds=() if par.measured_speeds else (0.0,) * len(vehicle.rotors),
    )


make_indi = law_maker("indi", indi, IndiParameters, memory=first_memory)
"""Maker of the INDI law, for any arm."""
