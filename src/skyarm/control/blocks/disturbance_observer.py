"""Second-order extended state observer on world velocity, body rate and joint rates.

v_hat is predicted with the model, the modelled rotor speeds and the disturbance d_hat;
with e = v - v_hat, v_hat += L1 e, d_hat += M L2 e / dt, L1 = 1 - b^2, L2 = (1 - b)^2,
b = exp(-bandwidth dt): both poles at b.
Source: Gao 2003 (observer bandwidth), in discrete time. Inputs are those of the
measurement's own period.

An accelerometer measures the acceleration that the model lacks. With y the measured
specific force (base axes), f that of the model under its actuators and the estimated
disturbance, and b the accelerometer's bias, the base accelerates by r = y - b - f
beyond the model. The velocity is integrated with r, and the measured velocity corrects
it and the bias, both poles at beta = exp(-w dt):

    v_pred = v_hat + (a + R r) dt,    e = v_measured - v_pred,
    v_hat = v_pred + (1 - beta^2) e,    b -= (1 - beta)^2 R^T e / dt,

and the acceleration of the unknown force follows r within 1 / (bandwidth of the force).
A constant error of the accelerometer, or of the attitude, which turns the weight, goes
to b and is no force: below w force and velocity are those of the measured velocity,
above it the accelerometer's. Where noise of the two is white, they are equally good at
w = (noise of the specific force) / (noise of the velocity). An unknown effort of a
joint accelerates the base, too, and M sees that it is no force on it only by the
joint's acceleration at the same time: the force's row of M takes the measured change of
the joints' rates beyond the model, (e_k - (1 - L1) e_(k-1)) / dt, at the bandwidth of
the force. A blow is over before a rotor answers it: the force takes r up to ``MOST``,
the velocity all of it.

An accelerometer that is stuck, late, turned round or spiked parts from the measured
velocity: e is the leaky integral of their difference. Beyond ``agreement`` velocity and
force go over to those of the measured velocity alone, with (agreement / |e|)^4, and
return slowly.

With z the larger of |e| / ``JUMP`` of the velocity and |e| / ``LEAP`` of the body rate,
no disturbance makes z > 1: there all learn 1 / z^2 of what they would, but from the
accelerometer. It is a false reading, or a blow, which has passed: where z has been as
large before, velocity, rate and joint rates take e but for b^2 / z^2 of it. Of a
velocity that leaps for the first time 1 / z^2 is believed. The rate of a sliding joint
takes e but for b^2 / z^2 at once: its limit is less than two periods away, and its
sensor is another one than those that leap. A blow that is taken for a torque holds
rotors at their limits, and itself (below). Readings that repeat correct nothing
(:mod:`skyarm.control.blocks.stale_readings`): the model and the other sensors predict
over them. Joint sensors of 50 Hz leave the estimate of the joints a quarter of its
bandwidth. That is too slow for a sliding joint, on which a load acts in full, without a
lever: its next rate after n periods without has b / (1 + n^2) for b, and L2 / (1 + n):
of 36 wrong plants of an octocopter 1 is lost at 67 Hz and none at 100 and 50, without
it 27, 18 and 31. On turning joints that would be too quick: drawn vehicles that fly at
100 Hz are lost.

While an actuator is at its limit its disturbance is held: one that grows winds up. But
a false force may be what keeps the rotors there: it shrinks, F^T (change of F) < 0, at
a share of the observer's pace.
Sources: Brown, Hwang 2012, chapter 8 (complementary filters); Gao 2003 (both poles at
one place); Smeur, Chu, de Croon 2016 (the external force from the specific force);
Huber 1981 (bounded influence of a reading; 4.8, one that falls again); Astrom, Hagglund
2006, 3.5 (conditional integration).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any

from skyarm import dynamics
from skyarm.algebra import (
    E_Z,
    ZERO3,
    ZERO3_DATA,
    Mat3,
    Motion,
    Quaternion,
    Scalar,
    Scalars,
    Vec3,
)
from skyarm.algebra.scalars import (
    clip,
    data,
    divide,
    maximum,
    minimum,
    mul,
    sqrt,
    where,
)
from skyarm.control.blocks.filters import double_pole, low_pass_share
from skyarm.control.blocks.prediction import (
    Actuation,
    Disturbance,
    acceleration,
    actuation,
    rotor_wrench,
    with_side,
)
from skyarm.control.blocks.select import choose_each
from skyarm.control.blocks.stale_readings import Fresh, ReadingSums
from skyarm.control.law_maker import option_numbers
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.records.immutable import immutable
from skyarm.records.leaves import as_data, blend, parts
from skyarm.records.units import Unit, positive
from skyarm.sensing.measurement import Measurement
from skyarm.vehicle import Joint

AGREEMENT = 0.05
"""Accepted difference (m/s) of measured and integrated velocity: five deviations of the
noise for which the gains were chosen. With 0.035 healthy flights use the accelerometer
too little and err by 4 % more."""


@immutable
class AccelerometerGains:
    """Bandwidths (rad/s) of the disturbance observer's accelerometer correction, and
    the check of the accelerometer.

    Attributes:
        force: bandwidth at which the unknown force follows the accelerometer.
        velocity: bandwidth below which the measured velocity outweighs the
            accelerometer.
        agreement: difference of measured and integrated velocity up to which the
            accelerometer is used in full.
    """

    force: Annotated[
        Scalar,
        Unit(
            "rad/s",
            "bandwidth at which the estimated force follows the accelerometer",
            effect=(
                "higher values find a disturbance faster and pass more accelerometer"
                " noise to the rotors"
            ),
        ),
    ]
    velocity: Annotated[
        Scalar,
        Unit(
            "rad/s",
            "bandwidth below which the measured velocity outweighs the accelerometer",
            effect=(
                "higher values rely more on the measured velocity, lower ones more on"
                " the accelerometer"
            ),
        ),
    ]
    agreement: Annotated[
        Scalar,
        Unit(
            "m/s",
            "difference of measured and integrated velocity up to which the"
            " accelerometer is used in full",
        ),
    ] = AGREEMENT


MOST = 10.0
"""Largest acceleration (m/s^2) beyond the model that the force takes from one reading
of the accelerometer: more than wind and loads give, about what rotors can answer."""

RELEASE = 0.05
"""Share of its change by which a force shrinks while a rotor is at its limit. With 1
winds that hold rotors there for seconds carry a drawn vehicle 18 times as far off, with
0 a false force is held for good."""

YIELDING = 0.2
"""Share of its change that a joint's disturbance takes while the joint is at its limit.
With 0 what moves the joint against its drive goes into the force: 3 N at the tip for
good, more than the joints of the paper's vehicle hold, throw it down in 14 of 30
flights in mode "tip", with 0.2 in none; with 0.1 it still falls in mode "joint". With 1
it is lost in 5 of 96 plants of twice the spread, with 0 in 2, with 0.2 in 1."""

LARGEST_BIAS = 5.0
"""Largest estimated bias (m/s^2) of an accelerometer: that of a tilt of half a radian.
One that is mounted upside down has no bias, but is wrong."""

LEFT = 2.0
"""Largest difference of measured and integrated velocity that is left after a period,
over the accepted one: what a single false reading leaves must fade, what a wrong
accelerometer adds in each period must show."""

JUMP, LEAP, USUAL = 0.3, 1.0, 0.005
"""Largest innovations of velocity (m/s) and body rate (rad/s) that a disturbance makes
within a period of ``USUAL`` s: 6 g, and what all rotors of a small vehicle give. In a
longer one it makes more; in a shorter one noise is not less."""

SMALL = 1e-9
"""Added to the square of a speed, an acceleration or a force, as a divisor."""


@immutable
class TranslationEstimate:
    """Estimates of an observer after one period: base velocity, accelerometer bias,
    increment of the unknown force.

    Attributes:
        velocity: velocity of the base origin, world axes, m/s.
        bias: bias of the accelerometer, base axes, m/s^2; empty without one.
        change: acceleration by which the unknown force varies, world axes, m/s^2.
        heard: 1 where that change is the accelerometer's, 0 where it is that of the
            measured velocity.
        agreed: fraction (0 to 1) to which the accelerometer is used, by its agreement
            with the measured velocity.
        integrated: velocity by the accelerometer, corrected by the measured one, world
            axes, m/s; empty without one.
        beside: acceleration beyond the model by the accelerometer, world axes, m/s^2;
            empty without one.
    """

    velocity: Vec3
    bias: Any
    change: Vec3
    heard: Scalar = 0
    agreed: Scalar = 1.0
    integrated: Any = ()
    beside: Vec3 | tuple[()] = ()


def modelled_specific_force(model: Model, R: Mat3, linear: Vec3, rotors: Vec3) -> Vec3:
    """Specific force (m/s^2, base axes) that the model predicts for an accelerometer at
    the base origin.

    Args:
        model: the controller's model.
        R: R_WB amid the period.
        linear: acceleration of the base origin by the model, mean of the period, world
            axes.
        rotors: thrust at the end of the period, where it was measured, less that in
            ``linear``; N, base axes. The corresponding torque is left out: by way of
            the offset of the common centre of mass it accelerates the base origin too,
            for a part of a period.
    """
    return R.apply_T(linear + E_Z * model.gravity) + rotors * divide(
        1.0, model.vehicle.mass
    )


def measure_translation(
    gains: AccelerometerGains,
    seen: TranslationEstimate,
    measurement: Measurement,
    R: Mat3,
    linear: Vec3,
    modelled: Vec3,
    free: Sequence[Scalar],
    fresh: Fresh,
    dt: Scalar,
) -> TranslationEstimate:
    """Accelerometer-based estimate of the base's velocity and of the change of the
    external force in one period.

    An actuator at its limit shakes the base by what the model lacks, because its
    disturbance is held: the force is then estimated from the measured velocity alone.
    So it is where the specific force is three zeros: none was measured; where it stands
    still; and as far as the velocity that is integrated from it parts from the measured
    one.

    Args:
        gains: bandwidths.
        seen: estimate from the measured velocity alone; bias, agreement and integrated
            velocity of one period earlier.
        measurement: the new one.
        R: R_WB amid the period.
        linear: acceleration of the base origin by the model, mean of the period, world
            axes.
        modelled: specific force by the model (:func:`modelled_specific_force`).
        free: 1 for rotors and each joint that are not at their limit, else 0.
        fresh: which readings are new.
        dt: s.
    """
    felt = measurement.specific_force
    # three zeros stand for no accelerometer: in free fall a real one has noise
    there: Scalar = where(felt.dot(felt) > 0.0, 1.0, 0.0)
    new = there * fresh.specific_force
    beside = R.apply(felt - seen.bias - modelled)
    ahead = seen.integrated + (linear + beside * new) * dt
    e = (measurement.velocity - ahead) * fresh.velocity
    ratio = divide(gains.agreement, sqrt(e.dot(e) + SMALL))
    fast, slow = double_pole(gains.velocity, dt)
    integrated = ahead + e * (1.0 - (1.0 - fast) * minimum(1.0, LEFT * ratio))
    trust = minimum(1.0, ratio)
    square = trust * trust
    # used in full again after a second: with one false reading in a hundred it is left
    # out, as in a law without it
    agreed = minimum(square * square, seen.agreed + dt)
    used, share = there * agreed, new * agreed
    for each in free:
        share = mul(share, each)
    bias = seen.bias - R.apply_T(e) * mul(new * trust, divide(slow, dt))
    taken = beside * minimum(1.0, divide(MOST, sqrt(beside.dot(beside) + SMALL)))
    return TranslationEstimate(
        velocity=integrated * used + seen.velocity * (1.0 - used),
        bias=Vec3(*(data(clip(each, -LARGEST_BIAS, LARGEST_BIAS)) for each in bias)),
        change=taken * mul(share, low_pass_share(gains.force, dt))
        + seen.change * (1.0 - share),
        heard=share,
        agreed=data(agreed),
        integrated=as_data(integrated),
        beside=beside,
    )


def first_observed(
    joints: int, rotor_speeds: Sequence[Scalar], accelerometer: bool = False
) -> Observed:
    """Initial state of the disturbance observer, with an accelerometer bias if
    ``accelerometer`` is True.
    """
    still = (0.0,) * joints
    return Observed(
        position=ZERO3_DATA,
        quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
        joints=still,
        velocity=ZERO3_DATA,
        rate=ZERO3_DATA,
        joint_rates=still,
        force=ZERO3_DATA,
        torque=ZERO3_DATA,
        efforts=still,
        rotor_speeds=tuple(rotor_speeds),
        bias=ZERO3_DATA if accelerometer else (),
        integrated=ZERO3_DATA if accelerometer else (),
        joint_residuals=still if accelerometer else (),
        readings=ReadingSums(),
    )


def disturbance(observed: Observed) -> Disturbance:
    """Estimated disturbance (force, torque, joint efforts) from the observer's
    state.
    """
    return Disturbance(
        force=observed.force, torque=observed.torque, efforts=observed.efforts
    )


def observe(
    model: Model,
    gains: ObserverGains,
    memory: Observed,
    measurement: Measurement,
    acted: Actuation,
    unknown: Disturbance,
    started: Scalar,
    free: Sequence[Scalar],
    dt: Scalar,
) -> tuple[Observed, ObserverCorrections]:
    """Update of the disturbance observer by one measurement: next state, and
    corrections of the predicted motion.

    Args:
        model: the controller's model.
        gains: bandwidths.
        memory: one period earlier.
        measurement: the new one.
        acted: actuation in the period between them.
        unknown: disturbance over the period, as estimated before the new one.
        started: flag, below 0.5 at the first measurement, which is taken as it is.
        free: 1 or 0 for the base and each joint; 0 holds that disturbance because an
            actuator is at its limit, lets the force shrink slowly and the joints'
            follow slowly.
        dt: s.
    """
    fresh, readings = memory.readings.fresh(ReadingSums.of(measurement), dt)
    place = filter_pose(gains.pose, memory, measurement, fresh, started, dt)
    half, speeds, squares = acted.amid, acted.speeds, acted.squares
    # the sum of the quaternions before and after is along the attitude half-way
    R = memory.quaternion.plus(place.quaternion, 1).normalized().rotation()
    # the first measurement may be turns away from the memory
    pairs = zip(memory.joints, place.joints, strict=True)
    joints = tuple(where(started > 0.5, 0.5 * (a + b), b) for a, b in pairs)
    pushing = with_side(model, unknown, R, half, memory.velocity, memory.rate)
    amid = Amid(
        R=R,
        rate=memory.rate,
        joints=joints,
        joint_rates=memory.joint_rates,
        unknown=pushing,
    )
    linear, angular, qdd = amid.accelerations(model, squares, acted.efforts)
    v, w = memory.velocity + linear * dt, memory.rate + angular * dt
    rates = [r + a * dt for r, a in zip(memory.joint_rates, qdd, strict=True)]
    ev, ew = measurement.velocity - v, measurement.rate - w
    er = [
        (a - b) * fresh.joint_rates
        for a, b in zip(measurement.joint_rates, rates, strict=True)
    ]
    # what leaps twice was a blow: velocities take what it left, disturbances only what
    # is slight
    longer = maximum(1.0, dt * (1.0 / USUAL))
    per = divide(1.0, longer * longer)
    jump = ev.dot(ev) * divide(per, gains.jump * gains.jump)
    twist = ew.dot(ew) * (per * (1.0 / LEAP**2))
    leap = maximum(jump, twist)
    slight = divide(
        1.0, maximum(maximum(jump * fresh.velocity, twist * fresh.rate), 1.0)
    )
    known = minimum(1.0, (1.0 + memory.leap) * slight)
    blow = known - slight
    shares = [double_pole(bandwidth, dt) for bandwidth in (gains.force, gains.torque)]
    shares += [
        joint_gains(joint, gains, memory.readings.missed, dt)
        for joint in model.vehicle.joints
    ]
    slow = [L2 * slight / dt for _, L2 in shares]
    # a slide is at its limit before the second period
    believed = [
        blow,
        blow,
        *(blow if joint.turns else 1.0 - slight for joint in model.vehicle.joints),
    ]
    fast = [
        share + L1 * (1.0 - share)
        for share, (L1, _) in zip(believed, shares, strict=True)
    ]
    turning = ew * (slow[1] * fresh.rate)
    bending = [mul(e, L2) for e, L2 in zip(er, slow[2:], strict=True)]
    yielding = [maximum(each, YIELDING) for each in free[1:]]
    ev = ev * (fresh.velocity * known)
    base = TranslationEstimate(
        velocity=v + ev * fast[0],
        bias=memory.bias,
        change=ev * slow[0],
        agreed=memory.agreed,
        integrated=memory.integrated,
    )
    residuals, quick = memory.joint_residuals, bending
    if gains.accelerometer is not None:
        modelled = modelled_specific_force(
            model, R, linear, unmodelled_thrust(model, squares, half, speeds)
        )
        base = measure_translation(
            gains.accelerometer, base, measurement, R, linear, modelled, free, fresh, dt
        )
        pace = base.heard * (
            low_pass_share(gains.accelerometer.force, dt) * slight / dt
        )
        rest = 1.0 - base.heard
        quick = [
            (e - last) * pace + b * rest
            for e, last, b in zip(er, residuals, bending, strict=True)
        ]
        residuals = tuple(
            data(e * (1.0 - L1)) for e, L1 in zip(er, fast[2:], strict=True)
        )
    push, turn, pulls = inertia_times(model, R, joints, base.change, turning, bending)
    # the force of one time with the joints' acceleration of the same: what throws the
    # arm is no force on the base
    if gains.accelerometer is not None:
        push, *_ = inertia_times(model, R, joints, base.change, turning, quick)
    # up to where the force is least: beyond, or across, it would grow
    shrinking = divide(memory.force.dot(push), -SMALL - push.dot(push))
    learned = replace(
        place,
        velocity=base.velocity,
        rate=w + ew * (fast[1] * fresh.rate),
        joint_rates=tuple(
            r + mul(e, L1) for r, e, L1 in zip(rates, er, fast[2:], strict=True)
        ),
        force=memory.force + push * maximum(free[0], minimum(shrinking, RELEASE)),
        torque=memory.torque + turn * free[0],
        efforts=tuple(
            d + mul(p, f)
            for d, p, f in zip(memory.efforts, pulls, yielding, strict=True)
        ),
        rotor_speeds=as_data(speeds),
        bias=base.bias,
        joint_residuals=residuals,
        readings=readings,
        leap=data(leap),
        agreed=base.agreed,
        integrated=base.integrated,
    )
    begun = replace(
        place,
        velocity=as_data(measurement.velocity),
        rate=as_data(measurement.rate),
        joint_rates=as_data(measurement.joint_rates),
        readings=readings,
        integrated=as_data(measurement.velocity) if memory.integrated else (),
    )
    return blend(started > 0.5, learned, begun), ObserverCorrections(
        amid=amid,
        innovation=ev,
        known=known,
        beside=base.beside,
        angular_correction=turning * free[0],
        joint_corrections=tuple(
            mul(b, f) for b, f in zip(bending, yielding, strict=True)
        ),
    )


def joint_gains(
    joint: Joint, gains: ObserverGains, missed: Scalar, dt: Scalar
) -> tuple[Scalar, Scalar]:
    """Gains (L1, L2) of a joint's rate, ``missed`` periods after its last new
    reading.
    """
    if joint.turns:
        return double_pole(gains.joints, dt)
    L1, L2 = double_pole(gains.joints, dt, 1.0 + missed * missed)
    return L1, L2 / (1.0 + missed)


def observe_uncompensated(
    model: Model,
    gains: ObserverGains,
    memory: Observed,
    measurement: Measurement,
    acted: Command,
    started: Scalar,
    free: Sequence[Scalar],
    dt: Scalar,
) -> Observed:
    """Next state of the disturbance observer, whose last estimate is the only
    disturbance in its prediction.
    """
    speeds = choose_each(started > 0.5, memory.rotor_speeds, measurement.rotor_speeds)
    before = replace(memory, rotor_speeds=speeds)
    done = actuation(model, before.rotor_speeds, acted, dt)
    return observe(
        model, gains, before, measurement, done, disturbance(before), started, free, dt
    )[0]


def unmodelled_thrust(
    model: Model,
    squares: Sequence[Scalar],
    half: Sequence[Scalar],
    speeds: Sequence[Scalar],
) -> Vec3:
    """Rotor thrust at the end of a period minus its predicted mean over the period (N,
    base axes).

    Args:
        model: the controller's model.
        squares: means of the squared speeds, of the thrust along body z.
        half: speeds amid the period, of the thrust across it: see :func:`with_side`.
        speeds: speeds at its end.
    """
    along = rotor_wrench(
        model, [s * s - mean for s, mean in zip(speeds, squares, strict=True)]
    )
    across = rotor_wrench(
        model, [s * s - m * m for s, m in zip(speeds, half, strict=True)], sideways=True
    )
    return Vec3(across.force.x, across.force.y, along.force.z)


@immutable
class Amid:
    """Vehicle state in the middle of a control period, and the disturbance estimated at
    the beginning of the period.

    Attributes:
        R: R_WB. rate, joint_rates: estimates at the period's beginning. joints: rad or
            m.
        unknown: disturbance with the rotor forces that the mixer omits.
    """

    R: Mat3
    rate: Vec3
    joints: Scalars
    joint_rates: Scalars
    unknown: Disturbance

    def accelerations(
        self, model: Model, squares: Sequence[Scalar], efforts: Sequence[Scalar]
    ) -> tuple[Vec3, Vec3, Scalars]:
        """Modelled accelerations under squared rotor speeds and joint efforts: world,
        body, joints.
        """
        wrench = rotor_wrench(model, squares)
        return acceleration(
            model,
            self.R,
            self.rate,
            self.joints,
            self.joint_rates,
            wrench,
            efforts,
            self.unknown,
        )


@immutable
class ObserverCorrections:
    """Corrections of the observer's prediction by one measurement, and the vehicle
    state half a period earlier.

    Attributes:
        amid: state, and the disturbance estimated before the measurement.
        innovation: measured less modelled velocity, as far as it is believed, world
            axes, m/s.
        known: fraction (0 to 1) to which the measured velocity is believed.
        beside: acceleration beyond the model by the accelerometer, world axes, m/s^2;
            empty without one.
        angular_correction, joint_corrections: accelerations by which that disturbance
            varies with the measurement, less at limits.
    """

    amid: Amid
    innovation: Vec3
    known: Scalar
    beside: Vec3 | tuple[()]
    angular_correction: Vec3
    joint_corrections: Scalars


def filter_pose(
    bandwidth: Scalar,
    memory: Observed,
    measurement: Measurement,
    fresh: Fresh,
    started: Scalar,
    dt: Scalar,
) -> Observed:
    """Observer state with the base pose and joint positions of now, filtered.

    They are predicted from the estimated velocities and corrected by the measurement.
    """
    share = low_pass_share(bandwidth, dt)
    flags = (
        fresh.position,
        fresh.quaternion,
        fresh.joints,
    )
    # the first measurement is taken whole; a repeated reading corrects nothing
    moved, turned, bent = (where(started > 0.5, share * flag, 1.0) for flag in flags)
    position = memory.position + memory.velocity * dt
    quaternion = memory.quaternion * Quaternion.of_small_rotation(memory.rate * dt)
    joints = [
        q + qd * dt for q, qd in zip(memory.joints, memory.joint_rates, strict=True)
    ]
    # q and -q are one attitude: the nearer of them is averaged
    measured = nearer_sign(measurement.quaternion, quaternion)
    off = Quaternion(*(m - c for m, c in zip(measured, quaternion, strict=True)))
    return replace(
        memory,
        position=position + (measurement.position - position) * moved,
        quaternion=quaternion.plus(off, turned).normalized(),
        joints=tuple(
            q + bent * (m - q) for q, m in zip(joints, measurement.joints, strict=True)
        ),
    )


def nearer_sign(q: Quaternion, before: Quaternion) -> Quaternion:
    """Quaternion q or -q, which are one attitude, with the sign nearer to the
    quaternion ``before``.
    """
    near = q.w * before.w + q.x * before.x + q.y * before.y + q.z * before.z
    side = where(near < 0.0, -1.0, 1.0)
    return Quaternion(*(c * side for c in q))


def inertia_times(
    model: Model,
    R: Mat3,
    joints: Sequence[Scalar],
    linear_W: Vec3,
    angular_B: Vec3,
    joint: Sequence[Scalar],
) -> tuple[Vec3, Vec3, Scalars]:
    """Mass matrix times an acceleration: force (N, world axes), torque (N m, base axes)
    and joint torques.
    """
    still = (0,) * len(joints)
    # inverse dynamics at rest and without weight is M times the acceleration, and does
    # not form M
    base = Motion(angular_B, R.apply_T(linear_W))
    force, torques = dynamics.inverse_dynamics(
        model.vehicle, joints, ZERO3, still, base, joint
    )
    return as_data((R.apply(force.force), force.torque, torques))


@immutable
class Observed:
    """State of the disturbance observer at the last measurement: filtered pose,
    velocities and estimated disturbance.

    Attributes:
        position, quaternion, joints: filtered.
        velocity, rate, joint_rates: estimates.
        force: N, world axes, at the base origin. torque: N m, base axes. efforts: joint
            efforts, N m or N.
        rotor_speeds: speeds of the modelled motors, rad/s.
        bias: bias of the accelerometer, m/s^2, base axes. joint_residuals: joint rates
            beyond the model, for the force's row. integrated: velocity by the
            accelerometer. All three () without an accelerometer.
        readings: the last ones. leap: z^2 at the last measurement.
        agreed: fraction to which the accelerometer is used.
    """

    position: Annotated[
        Vec3, Unit("m", "filtered position of the base origin, world axes")
    ]
    quaternion: Annotated[
        Quaternion, Unit("", "filtered attitude w x y z, base to world")
    ]
    joints: Annotated[Scalars, Unit("rad or m", "filtered joint positions")]
    velocity: Annotated[
        Vec3, Unit("m/s", "estimated velocity of the base origin, world axes")
    ]
    rate: Annotated[Vec3, Unit("rad/s", "estimated angular velocity, base axes")]
    joint_rates: Annotated[Scalars, Unit("rad/s or m/s", "estimated joint rates")]
    force: Annotated[
        Vec3, Unit("N", "estimated disturbance force at the base origin, world axes")
    ]
    torque: Annotated[
        Vec3, Unit("N m", "estimated disturbance torque on the base, base axes")
    ]
    efforts: Annotated[
        Scalars, Unit("N m or N", "estimated disturbance efforts of the joints")
    ]
    rotor_speeds: Annotated[
        Scalars, Unit("rad/s", "speeds of the modelled motors, unsigned")
    ]
    bias: Annotated[
        Vec3 | tuple[()],
        Unit("m/s^2", "estimated bias of the accelerometer, base axes"),
    ] = ()
    joint_residuals: Annotated[
        Scalars, Unit("rad/s or m/s", "measured minus estimated joint rates")
    ] = ()
    readings: ReadingSums
    leap: Annotated[
        Scalar,
        Unit(
            "", "square of the last innovation of the base over that of a disturbance"
        ),
    ] = 0.0
    agreed: Annotated[
        Scalar,
        Unit("", "fraction to which the accelerometer is used, by its agreement"),
    ] = 1.0
    integrated: Annotated[
        Vec3 | tuple[()], Unit("m/s", "velocity by the accelerometer, world axes")
    ] = ()

    def state(self) -> State:
        """Vehicle state as estimated by the disturbance observer."""
        return State(
            position=self.position,
            quaternion=self.quaternion,
            velocity=self.velocity,
            rate=self.rate,
            joints=self.joints,
            joint_rates=self.joint_rates,
            rotor_speeds=self.rotor_speeds,
        )

    def without(self, known: Disturbance) -> Observed:
        """Observer state minus a part of the estimated disturbance that the
        feed-forward compensates from now on.
        """
        return replace(self, **parts(as_data(disturbance(self) - known)))


@immutable
class ObserverGains:
    """Bandwidths (rad/s) of the disturbance observer: force, torque, joint torques, and
    the pose filter.

    ``accelerometer`` is None where the measured velocity alone gives the force.
    """

    force: Annotated[
        Scalar,
        positive(
            "rad/s",
            "bandwidth of the force estimate",
            effect=(
                "higher values reject wind faster, amplify noise and tolerate less"
                " delay"
            ),
        ),
    ]
    torque: Annotated[
        Scalar,
        positive(
            "rad/s",
            "bandwidth of the torque estimate",
            effect=(
                "higher values reject torques on the base faster, amplify noise and"
                " tolerate less delay"
            ),
        ),
    ]
    joints: Annotated[
        Scalar,
        positive(
            "rad/s",
            "bandwidth of the joint effort estimates",
            effect=(
                "higher values reject joint friction and loads faster, amplify noise"
                " and tolerate less delay"
            ),
        ),
    ]
    pose: Annotated[
        Scalar,
        Unit(
            "rad/s",
            "bandwidth of the filter of position, attitude and joint positions",
            effect="lower values smooth a noisy pose and add lag",
        ),
    ]
    accelerometer: AccelerometerGains | None = None
    jump: Annotated[
        Scalar,
        Unit(
            "m/s",
            "innovation of the velocity within 5 ms up to which it may be a"
            " disturbance",
        ),
    ] = JUMP


# its share 1 - exp(-w dt) rounds to 1 for periods of 0.04 ms and more
UNFILTERED = 1e6
"""Bandwidth (rad/s) of a pose filter that passes the measured pose unchanged."""


def observer_gains(_model: Model, bandwidths: Any) -> ObserverGains:
    """Observer gains from bandwidths (rad/s) of force, torque and joint torques,
    without a pose filter.
    """
    force, torque, joints = option_numbers("observer", bandwidths, 3)
    return ObserverGains(force=force, torque=torque, joints=joints, pose=UNFILTERED)
