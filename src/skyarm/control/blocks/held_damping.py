"""Viscous joint friction over a control period, as an inertia that it adds to the
joints of a law's model.

With the effort u held for a period h a joint I q'' = u - d q' ends it with q'_1 =
e^(-x) q'_0 + (1 - e^(-x)) u / d, x = d h / I. One step q'_1 = q'_0 + h q'' gives the
same if the friction is taken at the time w h of the period,

    (I + w h d) q'' = u - d q'_0,    w = 1 / (1 - e^(-x)) - 1 / x:

the midpoint rule for slow friction, implicit Euler for quick one. With w h d as
armature the prediction is stable whatever the friction, and the inverse dynamics asks
for the effort that reaches the rate within the period. Without it a prediction diverges
above x = 2. I is the least that the joint moves, the others free.

Dry friction c tanh(q' / v) that stops a joint within a period acts on the model from
the rate c h / I on, where it would turn the joint round below: v is at least that.

Source: Hairer, Wanner 1996, Solving Ordinary Differential Equations II, IV.3
(exponential fitting).
"""

from __future__ import annotations

from dataclasses import replace

from skyarm.algebra import Scalar, Scalars
from skyarm.algebra.linear_solve import ldl_solve
from skyarm.algebra.scalars import (
    add,
    data,
    divide,
    exp,
    logical_and,
    maximum,
    mul,
    same,
    where,
)
from skyarm.control.model import Model
from skyarm.dynamics import mass_matrix_at_rest
from skyarm.records.coerce import concrete
from skyarm.vehicle import Joint, Vehicle

QUICK = 0.1
"""Decay x within a period from which a joint's friction is held: below, the explicit
step errs by half a percent, and a law whose model has friction that is not there is not
lost."""

SURE = 5.0
"""Decay x from which the whole of a model's friction is believed. Up to here friction
beyond ``QUICK`` may be false: at the planned rate it moves no pole, and costs 1 % of
the tip's error where it is true. At x = 10 that would be 46 %."""

SMALL = 1e-4
"""Least decay x of which w is computed: w of none is 8e-6 less, and rounding below
would be more."""


def joint_mobilities(vehicle: Vehicle, period: float) -> Scalars:
    """Acceleration of each joint per effort, the others free, at q = 0; 0 where
    friction is slow.

    Args:
        vehicle: the law's model.
        period: control period, s.

    Returns:
        (n,) 1/(kg m^2) or 1/kg.
    """
    joints = vehicle.joints
    if not any(map(_rubs, joints)):
        return (0,) * vehicle.n
    M = mass_matrix_at_rest(vehicle)
    # the diagonal of the inverse: outer and inner joints give way, so a joint is as
    # light as it gets
    units = ([float(row == 6 + i) for row in range(len(M))] for i in range(vehicle.n))
    mobilities = [ldl_solve(M, unit)[6 + i] for i, unit in enumerate(units)]
    return tuple(
        _if_quick(joint, m, period) for joint, m in zip(joints, mobilities, strict=True)
    )


def _rubs(joint: Joint) -> bool:
    return not concrete(joint.damping, joint.coulomb) or bool(
        joint.damping or joint.coulomb
    )


def _if_quick(joint: Joint, mobility: Scalar, period: float) -> Scalar:
    """Mobility of a joint whose friction is quick, else 0: an int where no number
    varies from flight to flight.
    """
    slope = joint.damping + divide(joint.coulomb, joint.coulomb_rate)
    if concrete(slope, mobility):
        return mobility if slope * mobility * period > QUICK else 0
    return where(slope * mobility * period > QUICK, mobility, 0.0)


def doubted_dampings(vehicle: Vehicle, mobilities: Scalars, period: float) -> Scalars:
    """Part of each joint's modelled damping (N m s/rad or N s/m) that acts at the
    planned rate, as it may be false.

    Args:
        vehicle: the law's model.
        mobilities: of :func:`joint_mobilities`.
        period: control period, s.
    """
    parts: list[Scalar] = []
    for joint, mobility in zip(vehicle.joints, mobilities, strict=True):
        damping, decay = joint.damping, joint.damping * mobility * period
        # a joint without quick friction has mobility 0, and is not doubted below
        beyond = damping - divide(QUICK, maximum(mobility * period, 1e-30))
        doubtful = logical_and(decay > QUICK, decay < SURE)
        parts.append(data(where(doubtful, beyond, 0.0)))
    return tuple(parts)


def with_held_damping(model: Model, mobilities: Scalars, dt: Scalar) -> Model:
    """Model whose joints have the armature that quick friction adds over a period
    ``dt`` (s), and calm dry friction.
    """
    if all(same(each, 0) for each in mobilities):
        return model
    links = []
    for link, mobility in zip(model.vehicle.links, mobilities, strict=True):
        joint = link.joint
        if not same(mobility, 0):
            held = where(mobility > 0.0, held_damping(joint.damping, mobility, dt), 0.0)
            armature = add(joint.armature, held)
            # no steeper than what stops the joint within the period
            rate = maximum(joint.coulomb_rate, mul(joint.coulomb, mobility * dt))
            joint = replace(joint, armature=armature, coulomb_rate=rate)
        links.append(replace(link, joint=joint))
    return replace(model, vehicle=replace(model.vehicle, links=tuple(links)))


def held_damping(damping: Scalar, mobility: Scalar, dt: Scalar) -> Scalar:
    """Armature (kg m^2 or kg) of a joint's damping, from its mobility: acceleration per
    effort.
    """
    x = mul(damping, mobility * dt)
    decay = maximum(x, SMALL)
    return mul(mul(damping, dt), divide(1.0, 1.0 - exp(-decay)) - divide(1.0, decay))
