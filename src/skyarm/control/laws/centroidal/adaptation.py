"""Slow estimates of an unknown load at the tip and of the joints' friction, and the feed-forward that they give.

The observer finds any disturbance, but late. Of two the course is known beforehand: a mass m at the tip pushes with
-m Y on base and joints, Y that of 1 kg in the *planned* motion, and damping b takes b qd_d of a joint's torque. With d
what the observer still finds at the joints, m and b move along their normalised gradients within their bounds:

    mdot = gamma_m (-Y.d) / (s_m + Y.Y),      bdot = -gamma_b (d - c - k q_d) qd_d / (s_b + qd_d^2)

c and k, learned the same way, are what of d is constant or goes with the joint's position, as an error of its weight or
inertia does: no friction, however slow the motion. What cannot be told from friction is a load that m does not stand
for, on joints that swing at one frequency out of phase. Regressors are filtered as the observer filters d, by its two
poles and the known delay; else fast motion would be learned in a wrong phase. A joint that does not follow its plan
is left out.

Regressors are those of the references (desired compensation): noise does not enter them, and what is learned is a
feed-forward, so that the loop keeps its gains. It meets measurements in the attitude of the plan, which the mean force
asks for. The force on the base is not used to learn the mass: it cannot be told from wind and thrust error there.
Sources: Sadegh, Horowitz 1990 (desired compensation); Ioannou, Sun 1996, 4.3, 4.4 (filtered regressors, normalised
gradient, projection).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

from skyarm.algebra import Vec3
from skyarm.control.blocks.disturbance import Disturbance
from skyarm.control.blocks.filters import low_pass_share
from skyarm.control.blocks.select import data, vector_data
from skyarm.control.blocks.series_kinematics import derivative, posture
from skyarm.control.laws.centroidal.demands import Planned
from skyarm.control.laws.centroidal.memory import JointLearned, Learned, Regressor
from skyarm.control.laws.centroidal.parameters import CentroidalParameters
from skyarm.dynamics.kinematics import jacobian_columns
from skyarm.scalars import add, clip, divide, exp, maximum, mul, sub
from skyarm.vehicle.vehicle_records import Vehicle

SMALL = 1e-3
"""(N m / kg)^2: a load's signal weaker than this teaches little."""

SLOW = {"revolute": (0.01, 0.1), "prismatic": (1e-4, 1e-3)}
"""rad^2 and (rad/s)^2, m^2 and (m/s)^2: a joint's motion smaller and slower than this teaches little."""

WEIGHT = 1.0
"""1/s, of what of the observer's efforts is constant and what goes with the position."""

STICKIEST = 50.0
"""1/s: the largest damping that is learned, over the inertia of the joint on a fixed base."""

FOLLOWING = 2.0
"""1/s, of the mean squares of a joint's planned rate and of what its own is off."""


def first_learned(joints: int) -> Learned:
    """Memory before the first measurement: nothing is known."""
    silent = Regressor(load=0.0, place=0.0, rate=0.0)
    joint = JointLearned(damping=0.0, level=0.0, slope=0.0, once=silent, twice=silent, moving=0.0, off=0.0)
    return Learned(tip_mass=0.0, joints=(joint,) * joints, feedforward=_nothing(joints))


def adapt(
    par: CentroidalParameters,
    learned: Learned,
    planned: Planned,
    rates: Sequence[Any],
    left: Sequence[Any],
    free: Sequence[Any],
    dt: Any,
) -> Learned:
    """Return the slow estimates one period later.

    Args:
        par: constants.
        learned: memory.
        planned: motion without errors.
        rates: of the joints now.
        left: joint torques or forces that the observer still finds.
        free: 1 or 0 for the base and each joint; 0 holds the estimates while an actuator is at its limit, or while the
            safety layer changes its command.
        dt: s.
    """
    places = [q.derivative(0) for q in planned.joints]
    wanted = [q.derivative(1) for q in planned.joints]
    unit = unit_load(par.model.vehicle, planned) if par.adapts_load else _nothing(len(places))
    share = _share(par, dt)
    seen = []
    for joint, load, place, rate, qd in zip(learned.joints, unit.efforts, places, wanted, rates, strict=True):
        seen.append(_update_joint(joint, Regressor(load=load, place=place, rate=rate), qd, share, dt))
    weights = [mul(f, _follows(joint, slow)) for f, joint, (_, slow) in zip(free[1:], seen, par.slow, strict=True)]
    mass = learned.tip_mass
    if par.adapts_load:
        mass = _mass(par, mass, [joint.twice.load for joint in seen], left, weights, dt)
    joints = [_joint(par, i, joint, d, t, dt) for i, (joint, d, t) in enumerate(zip(seen, left, weights, strict=True))]
    taken = [mul(joint.damping, rate) for joint, rate in zip(joints, wanted, strict=True)]
    feedforward = Disturbance(
        force=vector_data(unit.force * mass),
        torque=vector_data(unit.torque * mass),
        efforts=tuple(data(sub(mul(mass, y), t)) for y, t in zip(unit.efforts, taken, strict=True)),
    )
    return Learned(tip_mass=mass, joints=tuple(joints), feedforward=feedforward)


def unit_load(vehicle: Vehicle, planned: Planned) -> Disturbance:
    """What a mass of 1 kg at the tip does to base and joints in a planned motion: -Y, by d'Alembert."""
    tip = posture(vehicle, planned.joints, 2).tip
    r, rd, rdd = (derivative(tip, k) for k in range(3))
    w = planned.rate
    pull = -(planned.proper + planned.alpha.cross(r) + w.cross(w.cross(r)) + w.cross(rd) * 2.0 + rdd)
    columns = jacobian_columns(vehicle, vehicle.frame(), [q.derivative(0) for q in planned.joints])
    return Disturbance(
        force=planned.R.apply(pull),
        torque=r.cross(pull),
        efforts=tuple(column.linear.dot(pull) for column in columns),
    )


def _nothing(joints: int) -> Disturbance:
    zero = Vec3(0.0, 0.0, 0.0)
    return Disturbance(force=zero, torque=zero, efforts=(0.0,) * joints)


def _share(par: CentroidalParameters, dt: Any) -> Any:
    """Of a new value in each of two stages that delay as the joints' observer and the age of measurements do."""
    late = add(divide(1.0, par.observer.joints), 0.5 * par.delay_periods * dt)
    return 1.0 - exp(-divide(dt, late))


def _update_joint(joint: JointLearned, regressor: Regressor, rate: Any, share: Any, dt: Any) -> JointLearned:
    """Return the memory of a joint one period later: its filtered regressor, and how well it follows its plan."""
    once, slow = _filter(joint.once, regressor, share), low_pass_share(FOLLOWING, dt)
    off = sub(rate, regressor.rate)
    return dataclasses.replace(
        joint,
        once=once,
        twice=_filter(joint.twice, once, share),
        moving=_towards(joint.moving, mul(regressor.rate, regressor.rate), slow),
        off=_towards(joint.off, mul(off, off), slow),
    )


def _filter(old: Regressor, new: Regressor, share: Any) -> Regressor:
    return Regressor(
        load=_towards(old.load, new.load, share),
        place=_towards(old.place, new.place, share),
        rate=_towards(old.rate, new.rate, share),
    )


def _towards(old: Any, new: Any, share: Any) -> Any:
    return add(old, mul(share, sub(new, old)))


def _follows(joint: JointLearned, slow: Any) -> Any:
    """1 for a joint that keeps its planned rate, 0 for one that is off by 0.7 of it, in the mean square, and more."""
    return maximum(0.0, sub(1.0, divide(mul(2.0, joint.off), add(joint.moving, slow))))


def _mass(
    par: CentroidalParameters, mass: Any, unit: Sequence[Any], left: Sequence[Any], weights: Sequence[Any], dt: Any
) -> Any:
    match: Any = 0.0
    size: Any = SMALL
    for y, d, t in zip(unit, left, weights, strict=True):
        match, size = add(match, mul(t, mul(y, d))), add(size, mul(y, y))
    limit = par.tip_mass_limit
    return clip(add(mass, mul(par.adaptation * dt, divide(match, size))), -limit, limit)


def _joint(par: CentroidalParameters, i: int, joint: JointLearned, left: Any, weight: Any, dt: Any) -> JointLearned:
    """Damping, and what is none, of joint ``i``."""
    if not par.adapts_friction:
        return joint
    (small, slow), (low, high) = par.slow[i], par.damping_limits[i]
    place, rate = joint.twice.place, joint.twice.rate
    error = mul(weight, sub(sub(left, joint.level), mul(joint.slope, place)))
    step = divide(mul(error, rate), add(mul(rate, rate), slow))
    turn = divide(mul(error, place), add(mul(place, place), small))
    return dataclasses.replace(
        joint,
        damping=clip(sub(joint.damping, mul(par.friction_adaptation * dt, step)), low, high),
        level=add(joint.level, mul(WEIGHT * dt, error)),
        slope=add(joint.slope, mul(WEIGHT * dt, turn)),
    )
