"""Adaptive feed-forward of an unknown load at the tip and of the joints' friction.

A mass m at the tip pushes with -m Y on base and joints, Y that of 1 kg in the *planned* motion; damping b takes
b qd_d of a joint's torque. Both move along normalised gradients of the observer's effort at the joints, within bounds;
its constant part and that which goes with the joint's position are estimated the same way. Regressors are filtered by
the observer's two poles and the known delay; a joint that does not follow its plan counts less. The force on the base
is not used: wind and thrust errors look like mass there.
Sources: Sadegh, Horowitz 1990 (desired compensation); Ioannou, Sun 1996, 4.3, 4.4 (filtered regressors, projection).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Annotated

from skyarm.algebra import Mat3
from skyarm.algebra.scalars import Scalar, add, clip, data, divide, exp, mul, sub
from skyarm.control.blocks.attitude import derivative, posture
from skyarm.control.blocks.disturbance_observer import Observed
from skyarm.control.blocks.filters import low_pass_share
from skyarm.control.blocks.prediction import Disturbance, no_disturbance
from skyarm.control.blocks.select import vector_data
from skyarm.control.laws.centroidal.demands import Planned
from skyarm.control.laws.centroidal.parameters import CentroidalParameters
from skyarm.control.laws.centroidal.part import Part
from skyarm.dynamics import mass_matrix
from skyarm.dynamics.kinematics import jacobian_columns
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit
from skyarm.vehicle.vehicle_records import Vehicle

SMALL = 1e-3
"""Squared regressor of the load, (N m / kg)^2, below which the mass is adapted slowly."""

SLOW = {"revolute": (0.01, 0.1), "prismatic": (1e-4, 1e-3)}
"""Squared position and rate (rad, m) of a joint, by its kind, below which its friction is adapted slowly."""

FRICTION = 2.0
"""1/s, rate of the adapted damping of the joints: without, ten wrong plants err by 1.9 times as much."""

WEIGHT = 1.0
"""Adaptation rate, 1/s, of the constant part of the observer's efforts and of that proportional to the position."""

STICKIEST = 50.0
"""Largest adapted damping over the joint's inertia on a fixed base, 1/s."""

FOLLOWING = 2.0
"""Bandwidth, 1/s, of the mean squares of a joint's planned rate and of its rate error."""


def _towards(old: Scalar, new: Scalar, share: Scalar) -> Scalar:
    return add(old, mul(share, sub(new, old)))


@immutable
class Regressor:
    """Adaptation regressor of one joint: effort per kg at the tip, planned position and planned rate."""

    load: Annotated[Scalar, Unit("N m/kg or N/kg", "effort of 1 kg at the tip in the planned motion, late")]
    place: Annotated[Scalar, Unit("rad or m", "planned position, late")]
    rate: Annotated[Scalar, Unit("rad/s or m/s", "planned rate, late")]

    def towards(self, new: Regressor, share: Scalar) -> Regressor:
        """Regressor after one low-pass step towards a new regressor."""
        pairs = ((self.load, new.load), (self.place, new.place), (self.rate, new.rate))
        load, place, rate = (_towards(a, b, share) for a, b in pairs)
        return Regressor(load=load, place=place, rate=rate)


@immutable
class JointLearned:
    """Adaptation state of one joint: friction damping, effort offset and slope, and filtered signals.

    ``once`` and ``twice`` are the planned signals after one and two stages of the observer's lag.
    """

    damping: Annotated[Scalar, Unit("N m s/rad or N s/m", "adapted")]
    level: Annotated[Scalar, Unit("N m or N", "constant part of the observer's effort")]
    slope: Annotated[Scalar, Unit("", "per rad or m, part of the observer's effort that goes with the position")]
    once: Regressor
    twice: Regressor
    moving: Annotated[Scalar, Unit("(rad/s)^2 or (m/s)^2", "mean square of the planned rate")]
    off: Annotated[Scalar, Unit("(rad/s)^2 or (m/s)^2", "mean square of what the rate is off")]

    def filtered(self, regressor: Regressor, rate: Scalar, share: Scalar, dt: Scalar) -> JointLearned:
        """Joint state with filtered regressors and rate-tracking statistics, one period later."""
        once, slow = self.once.towards(regressor, share), low_pass_share(FOLLOWING, dt)
        off = sub(rate, regressor.rate)
        return dataclasses.replace(
            self,
            once=once,
            twice=self.twice.towards(once, share),
            moving=_towards(self.moving, mul(regressor.rate, regressor.rate), slow),
            off=_towards(self.off, mul(off, off), slow),
        )

    def trust(self, slow: Scalar) -> Scalar:
        """Adaptation weight of a joint, 0 to 1, from how well the joint tracks its planned rate."""
        # never 0: a load that nobody knows of is itself what takes a joint off its plan
        planned = add(self.moving, slow)
        share = divide(planned, add(planned, mul(2.0, self.off)))
        return mul(share, share)

    def learned(
        self,
        left: Scalar,
        weight: Scalar,
        least: tuple[Scalar, Scalar],
        limits: tuple[Scalar, Scalar],
        dt: Scalar,
    ) -> JointLearned:
        """Joint state after one gradient step of damping, effort offset and position slope."""
        (small, slow), (low, high), place, rate = least, limits, self.twice.place, self.twice.rate
        error = mul(weight, sub(sub(left, self.level), mul(self.slope, place)))
        step = divide(mul(error, rate), add(mul(rate, rate), slow))
        turn = divide(mul(error, place), add(mul(place, place), small))
        return dataclasses.replace(
            self,
            damping=clip(sub(self.damping, mul(FRICTION * dt, step)), low, high),
            level=add(self.level, mul(WEIGHT * dt, error)),
            slope=add(self.slope, mul(WEIGHT * dt, turn)),
        )


@immutable
class Learned:
    """Adapted tip mass and joint friction, and the resulting feed-forward of the next period."""

    tip_mass: Annotated[Scalar, Unit("kg", "adapted")]
    joints: tuple[JointLearned, ...]
    feedforward: Disturbance


@immutable
class AdaptationGains(Part):
    """Rates and bounds of the tip-mass and friction adaptation; a rate of None leaves the mass out.

    Where ``friction`` is left out nothing is learned of the joints.
    """

    load: Annotated[Scalar, Unit("1/s", "rate of the adapted tip mass")] | None
    mass_limit: Annotated[Scalar, Unit("kg", "largest adapted tip mass")]
    friction: bool
    damping_limits: Annotated[
        tuple[tuple[Scalar, Scalar], ...], Unit("N m s/rad or N s/m", "least and largest adapted damping of each joint")
    ]
    slow: Annotated[
        tuple[tuple[Scalar, Scalar], ...], Unit("", "squares of position and rate below which a joint teaches little")
    ]

    def start(self, joints: int) -> Learned:
        """Initial state of the tip-mass and friction adaptation: all estimates zero."""
        silent = Regressor(load=0.0, place=0.0, rate=0.0)
        joint = JointLearned(damping=0.0, level=0.0, slope=0.0, once=silent, twice=silent, moving=0.0, off=0.0)
        return Learned(tip_mass=0.0, joints=(joint,) * joints, feedforward=no_disturbance(joints))


def adaptation_gains(vehicle: Vehicle, rate: float, limit: float) -> AdaptationGains | None:
    """Constants for a rate (1/s) and a largest mass (kg) at the tip; None if neither mass nor friction is adapted."""
    load = rate if vehicle.n and vehicle.end_effector else 0.0
    friction = vehicle.n > 0
    if not load and not friction:
        return None
    # damping is learned back to none, and up to a share of the joint's inertia at rest
    M = mass_matrix(vehicle, Mat3.identity(), (0.0,) * vehicle.n)
    joints = [link.joint for link in vehicle.links]
    return AdaptationGains(
        load=load or None,
        mass_limit=limit,
        friction=friction,
        damping_limits=tuple((-float(q.damping), STICKIEST * float(M[6 + i][6 + i])) for i, q in enumerate(joints)),
        slow=tuple(SLOW[q.kind] for q in joints),
    )


def adapt(
    gains: AdaptationGains,
    par: CentroidalParameters,
    learned: Learned,
    planned: Planned,
    observed: Observed,
    free: Sequence[Scalar],
    dt: Scalar,
) -> Learned:
    """Adapted tip mass, joint friction and feed-forward one period later.

    ``free``: 1 or 0 for the base and each joint, 0 holds its estimates.
    """
    rates, left = observed.joint_rates, observed.efforts
    wanted = [q.derivative(1) for q in planned.joints]
    unit = unit_load(par.model.vehicle, planned) if gains.load is not None else no_disturbance(len(wanted))
    # two stages with the delay of the joints' observer and of the measurements' age
    late = add(divide(1.0, par.observer.joints), 0.5 * par.delay_periods * dt)
    share = 1.0 - exp(-divide(dt, late))
    joints, weights = [], []
    for joint, q, load, rate, (_, slow), f in zip(
        learned.joints, planned.joints, unit.efforts, rates, gains.slow, free[1:], strict=True
    ):
        regressor = Regressor(load=load, place=q.derivative(0), rate=q.derivative(1))
        joints.append(joint.filtered(regressor, rate, share, dt))
        weights.append(mul(f, joints[-1].trust(slow)))
    mass = learned.tip_mass
    if gains.load is not None:
        match: Scalar = 0.0
        size: Scalar = SMALL
        for joint, d, weight in zip(joints, left, weights, strict=True):
            y = joint.twice.load
            match, size = add(match, mul(weight, mul(y, d))), add(size, mul(y, y))
        mass = clip(add(mass, mul(gains.load * dt, divide(match, size))), -gains.mass_limit, gains.mass_limit)
    if gains.friction:
        rows = zip(joints, left, weights, gains.slow, gains.damping_limits, strict=True)
        joints = [joint.learned(*row, dt) for joint, *row in rows]
    taken = [mul(joint.damping, rate) for joint, rate in zip(joints, wanted, strict=True)]
    feedforward = Disturbance(
        force=vector_data(unit.force * mass),
        torque=vector_data(unit.torque * mass),
        efforts=tuple(data(sub(mul(mass, y), t)) for y, t in zip(unit.efforts, taken, strict=True)),
    )
    return Learned(tip_mass=mass, joints=tuple(joints), feedforward=feedforward)


def unit_load(vehicle: Vehicle, planned: Planned) -> Disturbance:
    """Wrench on base and joints of a 1 kg point mass at the tip in a planned motion, by d'Alembert."""
    tip = posture(vehicle, planned.joints, 2).tip
    r, rd, rdd = (derivative(tip, k) for k in range(3))
    w = planned.rate
    pull = -(planned.proper + planned.alpha.cross(r) + w.cross(w.cross(r)) + w.cross(rd) * 2.0 + rdd)
    columns = jacobian_columns(vehicle, vehicle.frame(), [q.derivative(0) for q in planned.joints], summed=True)
    return Disturbance(
        force=planned.R.apply(pull),
        torque=r.cross(pull),
        efforts=tuple(column.linear.dot(pull) for column in columns),
    )
