"""Adaptive feed-forward of an unknown load at the tip and of the joints' friction.

A mass m at the tip pushes with m Y on base and joints, Y that of 1 kg; damping b takes
b qd of a joint's effort. The mass is fed forward in the *planned* motion. Of the
damping as much is added to the model's joints as leaves their loop damped if it is
wrong; the rest acts at the planned rate, which moves no pole. Learned they are in the
measured motion: the observer's effort and what it was found beside, late by the same
two poles, are together the effort D that the vehicle's own model lacks, and

    m' = r sum_i y_i e_i / (s + sum_i y_i^2),
    b_i' = -r_b w_i e_i v_i / (s_i + v_i^2),   e_i = D_i - m y_i + b_i v_i,

y_i and v_i the effort of 1 kg and the rate of joint i, filtered by those poles, too:
normalised gradients of |e|^2, within bounds. The weight w_i of a joint falls with what
its rate is off its reference's: what a push moves is no friction. The force on the base
is not used: wind and thrust errors look like mass there.

What is learned in a period is taken from the observed disturbance at once, so that
their sum is the observer's alone: where the tip is held, the forces on it answer
whatever is commanded, and a second integral of them grows without end. The filters of
what acted beside have it two poles later, for which learning is slower by a tenth.

Sources: Sadegh, Horowitz 1990 (desired compensation); Ioannou, Sun 1996, 4.3, 4.4
(filtered regressors, projection).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated

import numpy as np

from skyarm.algebra import E_Z, ZERO3_DATA, Scalar, Scalars, Vec3, differences, sums
from skyarm.algebra.scalars import (
    add,
    clip,
    data,
    divide,
    maximum,
    minimum,
    mul,
    sub,
    where,
)
from skyarm.control.blocks.attitude import derivative, posture
from skyarm.control.blocks.filters import low_pass_share
from skyarm.control.blocks.prediction import Disturbance, no_disturbance
from skyarm.control.blocks.tip_force import TipLevers, levers
from skyarm.control.laws.centroidal.parameters import (
    CentroidalParameters,
    OptionalPart,
    Step,
    with_joint_damping,
)
from skyarm.control.laws.centroidal.step_records import Planned, ReferenceMotion
from skyarm.dynamics import mass_matrix_at_rest
from skyarm.dynamics.kinematics import jacobian_columns
from skyarm.records.immutable import immutable
from skyarm.records.leaves import as_data
from skyarm.records.units import Unit
from skyarm.reference import Reference
from skyarm.vehicle import Vehicle

SMALL = 1e-3
"""Squared joint effort under 1 kg at the tip ((N m)^2 or N^2) below which the mass is
adapted slowly; chosen: of one joint a lever of 3 mm."""

SLOW = {"revolute": 0.1, "prismatic": 1e-3}
"""Squared rate of a joint ((rad/s)^2 or (m/s)^2, by its kind) below which its friction
is adapted slowly; chosen: 0.3 rad/s and 3 cm/s."""

RESTING = 0.01
"""Mean square of the reference's rate, as a fraction of ``SLOW``, at which friction is
adapted at half its rate; chosen: 0.03 rad/s and 3 mm/s."""

FRICTION = 2.0
"""Adaptation rate (1/s) of the joints' damping. In Case 2 with a damping of 0.02 that
the model lacks 0.5 leaves 13 mrad at the joints, 2 leaves 2.3 and 8 leaves 1.7."""

STICKIEST = 50.0
"""Largest adapted damping of a joint over its inertia on a fixed base (1/s); chosen:
such a joint alone stops with a time constant of 20 ms."""

MODELLED = 5.0
"""Largest part of the adapted damping that the model's joints take, over the same
inertia (1/s); less where the arm's fastest mode would lose more damping by it than its
loop gives: what is learned may be false. With 20, slow swings under an unmodelled load
of 50 g are lost where no mass is adapted; with 0, joints that swing at 2 Hz carry the
tip off by 13 mm for 9."""

FOLLOWING = 2.0
"""Filter rate (1/s) of the mean squares of a joint's desired rate and of its rate
error; chosen, half a second."""


def towards(old: Scalar, new: Scalar, share: Scalar) -> Scalar:
    """Value after one low-pass step towards a new value."""
    return add(old, mul(share, sub(new, old)))


@immutable
class Efforts:
    """Signals of one joint from which load and friction are learned."""

    load: Annotated[
        Scalar,
        Unit("N m/kg or N/kg", "effort of 1 kg at the tip in the measured motion"),
    ]
    rate: Annotated[Scalar, Unit("rad/s or m/s", "measured joint rate")]
    given: Annotated[
        Scalar, Unit("N m or N", "effort at which the observer found its own estimate")
    ]

    def towards(self, new: Efforts, share: Scalar) -> Efforts:
        """Filtered signals of a joint after one low-pass step towards new ones."""
        # not leaf by leaf: an effort of a joint off the tip's chain is a structural 0
        pairs = ((self.load, new.load), (self.rate, new.rate), (self.given, new.given))
        load, rate, given = (towards(old, now, share) for old, now in pairs)
        return Efforts(load=load, rate=rate, given=given)


@immutable
class JointLearned:
    """Adaptation state of one joint: friction damping, filtered signals, and how well
    its rate tracks the reference.

    ``once`` and ``twice`` are the signals after one and two stages of the observer's
    lag.
    """

    damping: Annotated[
        Scalar, Unit("N m s/rad or N s/m", "adapted viscous damping of the joint")
    ]
    once: Efforts
    twice: Efforts
    moving: Annotated[
        Scalar,
        Unit("(rad/s)^2 or (m/s)^2", "mean square of the reference's joint rate"),
    ]
    off: Annotated[
        Scalar, Unit("(rad/s)^2 or (m/s)^2", "mean square of the joint rate error")
    ]

    def filtered(
        self, new: Efforts, desired: Scalar, share: Scalar, dt: Scalar
    ) -> JointLearned:
        """Adaptation state of a joint with signals and statistics filtered; ``desired``
        is the reference's rate.
        """
        once, slow = self.once.towards(new, share), low_pass_share(FOLLOWING, dt)
        off = sub(new.rate, desired)
        return replace(
            self,
            once=once,
            twice=self.twice.towards(once, share),
            moving=towards(self.moving, mul(desired, desired), slow),
            off=towards(self.off, mul(off, off), slow),
        )

    def trust(self, slow: Scalar) -> Scalar:
        """Weight (0 to 1) of a joint in the adaptation of friction, by how well its
        rate tracks the reference.

        None where the reference rests: a constant force and a slow drift are then no
        friction.
        """
        moving = add(self.moving, slow)
        share = divide(moving, add(moving, mul(2.0, self.off)))
        return mul(
            mul(share, share), divide(self.moving, add(self.moving, mul(RESTING, slow)))
        )

    def residual(self, observed: Scalar, mass: Scalar) -> Scalar:
        """Joint disturbance ``observed`` by the observer minus the part that adapted
        load and damping explain.
        """
        late = self.twice
        return add(
            sub(add(observed, late.given), mul(mass, late.load)),
            mul(self.damping, late.rate),
        )

    def learned(
        self, error: Scalar, slow: Scalar, limits: tuple[Scalar, Scalar], dt: Scalar
    ) -> JointLearned:
        """Adaptation state of a joint after one step of the damping down the gradient
        of the squared ``error``.
        """
        rate = self.twice.rate
        less = mul(
            self.trust(slow), divide(mul(error, rate), add(mul(rate, rate), slow))
        )
        return replace(
            self, damping=clip(sub(self.damping, mul(FRICTION * dt, less)), *limits)
        )


@immutable
class Learned:
    """Adapted tip mass and joint friction, and the resulting feed-forward of the next
    period.

    Attributes:
        earlier: feed-forwards of the periods before, with what was learned since, the
            last one first, as many as the known delay has.
    """

    tip_mass: Annotated[Scalar, Unit("kg", "adapted mass at the tip")]
    joints: tuple[JointLearned, ...]
    feedforward: Disturbance
    earlier: tuple[Disturbance, ...]
    tip_velocity: Annotated[
        Vec3, Unit("m/s", "tip velocity of the last measurement, world axes")
    ]

    def at_measurement(self) -> Disturbance:
        """Disturbance that the feed-forward compensated in the control period before
        the last measurement.
        """
        return self.earlier[-1] if self.earlier else self.feedforward


@immutable
class AdaptationGains(OptionalPart):
    """Rates and bounds of the tip-mass and friction adaptation; the mass is not adapted
    if its rate is None.

    Attributes:
        delay_periods: known delay of the measurements, structure.
        doubted: damping of the model that may be false: its joints lack it, and
            learning begins with it.
    """

    load: (
        Annotated[
            Scalar,
            Unit(
                "1/s",
                "rate of the adapted tip mass",
                bound=True,
                effect=(
                    "higher values find a load sooner and follow noise and wind more"
                ),
            ),
        ]
        | None
    )
    mass_limit: Annotated[Scalar, Unit("kg", "largest adapted tip mass")]
    damping_limits: Annotated[
        tuple[tuple[Scalar, Scalar], ...],
        Unit(
            "N m s/rad or N s/m",
            "least and largest adapted damping of each joint",
            bound=True,
        ),
    ]
    modelled: Annotated[
        Scalars,
        Unit(
            "N m s/rad or N s/m",
            "most of the adapted damping that the joints of the model receive",
            bound=True,
        ),
    ]
    slow: Annotated[
        Scalars,
        Unit(
            "(rad/s)^2 or (m/s)^2",
            "squared joint rate below which adaptation nearly stops",
            effect=(
                "higher values adapt only in fast motions, lower ones also from noise"
            ),
        ),
    ]
    delay_periods: int
    doubted: Annotated[
        Scalars,
        Unit("N m s/rad or N s/m", "modelled damping of each joint that may be false"),
    ] = ()

    def doubting(self, vehicle: Vehicle, doubted: Scalars) -> AdaptationGains:
        """Constants for other friction of the model (``vehicle``), of which the part
        ``doubted`` may be false.
        """
        # damping is learned back to none, and up to a share of the joint's inertia at
        # rest
        rows = zip(vehicle.links, doubted, self.damping_limits, strict=True)
        limits = tuple(
            (sub(d, link.joint.damping), maximum(most, d))
            for link, d, (_, most) in rows
        )
        return replace(self, damping_limits=limits, doubted=doubted)

    def adjust_gains(
        self, memory: Learned, par: CentroidalParameters, dt: Scalar
    ) -> CentroidalParameters:
        """Add the learned joint damping, up to a bound, to the joint damping of the
        law's model.
        """
        # the doubted part of the model's damping is in what is learned, which began
        # with it
        dampings = [joint.damping for joint in par.model.vehicle.joints]
        own = differences(dampings, self.doubted)
        return with_joint_damping(par, sums(own, self.split_damping(memory.joints)[0]))

    def split_damping(
        self, joints: Sequence[JointLearned]
    ) -> tuple[list[Scalar], Scalars]:
        """Split of each joint's adapted damping: the part added to the model, and the
        rest, for feed-forward.
        """
        whole = [joint.damping for joint in joints]
        rows = zip(whole, self.modelled, strict=True)
        inside = [minimum(damping, most) for damping, most in rows]
        return inside, differences(whole, inside)

    def start(self, joints: int) -> Learned:
        """Initial state of the tip-mass and friction adaptation: no load, and the
        damping that is doubted.
        """
        silent, none = Efforts(load=0.0, rate=0.0, given=0.0), no_disturbance(joints)
        first = JointLearned(
            damping=0.0, once=silent, twice=silent, moving=0.0, off=0.0
        )
        return Learned(
            tip_mass=0.0,
            joints=tuple(replace(first, damping=damping) for damping in self.doubted),
            feedforward=none,
            earlier=(none,) * self.delay_periods,
            tip_velocity=ZERO3_DATA,
        )

    def feedforward(
        self,
        memory: Learned,
        par: CentroidalParameters,
        reference: Reference,
        motion: ReferenceMotion,
    ) -> tuple[Disturbance, Disturbance]:
        """Feed-forward of the adapted load and friction, before the measurement and
        now.
        """
        return memory.at_measurement(), memory.feedforward


def adaptation_gains(
    vehicle: Vehicle,
    rate: float,
    limit: float,
    delay_periods: int,
    damping: float,
    doubted: Scalars,
) -> AdaptationGains | None:
    """Constants of load and friction adaptation, from rate (1/s) and bound (kg) of tip
    mass; None without joints.

    ``damping`` is that of the joints' loop, 1/s; ``doubted`` that of the model's joints
    that may be false.
    """
    if not vehicle.n:
        return None
    # bounds are numbers of the made law, so one pose stands for all
    M = np.array(mass_matrix_at_rest(vehicle), dtype=float)
    inertias = [float(M[6 + i][6 + i]) for i in range(vehicle.n)]
    # decay rate of the arm's fastest mode by that damping: that of a joint whose outer
    # joints give way, not locked
    root = np.sqrt(MODELLED * np.array(inertias))
    fastest = float(
        np.linalg.eigvalsh(root[:, None] * np.linalg.inv(M)[6:, 6:] * root[None, :])[-1]
    )
    modelled = MODELLED * min(1.0, damping / fastest)
    gains = AdaptationGains(
        # None and not 0, so that the program has no part of the mass at all
        load=(rate or None) if vehicle.end_effector else None,
        mass_limit=limit,
        damping_limits=tuple((0.0, STICKIEST * each) for each in inertias),
        modelled=tuple(modelled * each for each in inertias),
        slow=tuple(SLOW[joint.kind] for joint in vehicle.joints),
        delay_periods=delay_periods,
    )
    return gains.doubting(vehicle, doubted)


def adapt(
    gains: AdaptationGains,
    step: Step,
    learned: Learned,
    planned: Planned,
    free: Sequence[Scalar],
) -> tuple[Learned, Disturbance]:
    """Next adaptation state (tip mass, joint friction, feed-forward), and the
    disturbance newly compensated by it.

    ``free``: of each joint, 1 where it may be adapted; 0 leaves its damping and keeps
    it out of the mass.
    """
    dt, rates = step.dt, step.seen.observed.joint_rates
    heard, velocity = filter_signals(gains, step, learned)
    efforts = zip(heard, step.seen.observed.efforts, free, strict=True)
    errors = [
        mul(may, joint.residual(effort, learned.tip_mass))
        for joint, effort, may in efforts
    ]
    mass = (
        learned.tip_mass
        if gains.load is None
        else learn_mass(gains, learned.tip_mass, heard, errors, dt)
    )
    steps = zip(heard, errors, gains.slow, gains.damping_limits, strict=True)
    joints = [
        joint.learned(error, slow, limits, dt) for joint, error, slow, limits in steps
    ]
    unit = (
        no_disturbance(len(joints))
        if gains.load is None
        else unit_load(step.par.model.vehicle, planned)
    )
    turned = [q.derivative(1) for q in planned.joints]

    def feedforward(kg: Scalar, dampings: Sequence[Scalar]) -> Disturbance:
        """Disturbance that a tip mass and joint dampings cause in the planned
        motion.
        """
        rows = zip(unit.efforts, dampings, turned, strict=True)
        efforts = tuple(sub(mul(kg, effort), mul(b, rate)) for effort, b, rate in rows)
        return as_data(
            Disturbance(force=unit.force * kg, torque=unit.torque * kg, efforts=efforts)
        )

    inside, rest = gains.split_damping(joints)
    inside_before, rest_before = gains.split_damping(learned.joints)
    change = feedforward(sub(mass, learned.tip_mass), differences(rest, rest_before))
    # what the model's joints have of it acts at the observed rates
    shares = zip(change.efforts, inside, inside_before, rates, strict=True)
    taken = tuple(
        data(sub(effort, mul(sub(new, old), rate))) for effort, new, old, rate in shares
    )
    following = Learned(
        tip_mass=mass,
        joints=tuple(joints),
        feedforward=feedforward(mass, rest),
        earlier=tuple(
            each + change
            for each in (learned.feedforward, *learned.earlier)[: len(learned.earlier)]
        ),
        tip_velocity=velocity,
    )
    return following, replace(change, efforts=taken)


def filter_signals(
    gains: AdaptationGains, step: Step, learned: Learned
) -> tuple[list[JointLearned], Vec3]:
    """Filter states of the adaptation after one more sample, and the arm tip's measured
    velocity (m/s, world axes).
    """
    par, measurement, dt = step.par, step.measurement, step.dt
    vehicle, velocity = par.model.vehicle, learned.tip_velocity
    loads: Sequence[Scalar] = vehicle.zeros
    if gains.load is not None:
        at = levers(vehicle, measurement.rotation, measurement.joints)
        velocity = as_data(
            at.velocity(measurement.velocity, measurement.rate, measurement.joint_rates)
        )
        # the first measurement has none before it
        rate = where(step.memory.started > 0.5, divide(1.0, dt), 0.0)
        change = (velocity - learned.tip_velocity) * rate
        loads = felt_load(at, change + E_Z * par.model.gravity)
    share = low_pass_share(par.observer.joints, dt)
    acted = learned.at_measurement().efforts
    modelled = gains.split_damping(learned.joints)[0]
    observed = zip(acted, modelled, step.memory.observed.joint_rates, strict=True)
    given = [sub(effort, mul(b, rate)) for effort, b, rate in observed]
    references = [signal.derivative(1) for signal in step.motion.signals[4:]]
    rows = zip(
        learned.joints, loads, measurement.joint_rates, given, references, strict=True
    )
    heard = [
        joint.filtered(Efforts(load=y, rate=v, given=d), desired, share, dt)
        for joint, y, v, d, desired in rows
    ]
    return heard, velocity


def learn_mass(
    gains: AdaptationGains,
    mass: Scalar,
    joints: Sequence[JointLearned],
    errors: Sequence[Scalar],
    dt: Scalar,
) -> Scalar:
    """Tip mass (kg) after one step along the gradient of the squared residuals
    ``errors``.
    """
    match: Scalar = 0.0
    size: Scalar = SMALL
    for joint, error in zip(joints, errors, strict=True):
        load = joint.twice.load
        match, size = add(match, mul(load, error)), add(size, mul(load, load))
    return clip(
        add(mass, mul(gains.load * dt, divide(match, size))),
        -gains.mass_limit,
        gains.mass_limit,
    )


def felt_load(at: TipLevers, proper: Vec3) -> Scalars:
    """Joint efforts (N m or N) under 1 kg at the tip in the measured motion.

    ``proper`` is the measured acceleration of the tip plus g upwards, m/s^2, world
    axes.
    """
    # by d'Alembert a mass pushes against its acceleration
    pull = -at.R.apply_T(proper)
    return tuple(column.dot(pull) for column in at.columns)


def unit_load(vehicle: Vehicle, planned: Planned) -> Disturbance:
    """Wrench on base and joints of a 1 kg point mass at the tip in a planned motion, by
    d'Alembert.
    """
    tip = posture(vehicle, planned.joints, 2).tip
    r, rd, rdd = (derivative(tip, k) for k in range(3))
    w = planned.rate
    pull = -(
        planned.proper
        + planned.alpha.cross(r)
        + w.cross(w.cross(r))
        + w.cross(rd) * 2.0
        + rdd
    )
    columns = jacobian_columns(
        vehicle, vehicle.frame(), [q.derivative(0) for q in planned.joints], summed=True
    )
    return Disturbance(
        force=planned.R.apply(pull),
        torque=r.cross(pull),
        efforts=tuple(column.linear.dot(pull) for column in columns),
    )
