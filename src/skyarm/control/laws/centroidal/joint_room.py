"""Joints kept within their limits: bounds of the acceleration requested by tip and links.

A joint may go a share of the way from its reference to a limit; the rest is for unforeseen forces, and is larger where
no stop holds the joint. With d the way that is left and k the pole of the joint's own loop, half of its damping (the
root of its stiffness where that is more),

    d'' + 2 k d' + k^2 d >= 0

bounds the acceleration towards the limit. The allowed position moves with the reference, and d with it; the limit
itself, at rest, bounds as well. The inverse dynamics receives the bounded acceleration, so that only the tip is off.
Source: Ames et al. 2019, "Control barrier functions: theory and applications", exponential barrier of degree two.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from skyarm.algebra.scalars import Scalar, add, maximum, minimum, mul, sqrt, sub
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.model import JointGains
from skyarm.dynamics import State
from skyarm.vehicle.vehicle_records import Vehicle

SHARE, WITH_STOP = 0.5, 0.75
"""Of the way from a joint's reference to its limit that tip and links may take, without and with a hard stop there."""

Ends = tuple[tuple[bool, bool], ...]
"""Whether each joint has a lower and an upper limit: structure."""


def ends_of(vehicle: Vehicle) -> Ends:
    """Which limits the joints of a vehicle have."""
    joints = (link.joint for link in vehicle.links)
    return tuple((math.isfinite(float(joint.lower)), math.isfinite(float(joint.upper))) for joint in joints)


def within_limits(
    vehicle: Vehicle,
    ends: Ends,
    gains: JointGains,
    state: State,
    references: Sequence[Taylor],
    accelerations: Sequence[Scalar],
) -> tuple[Scalar, ...]:
    """Joint accelerations (rad/s^2 or m/s^2) that run into no limit.

    Args:
        vehicle: model.
        ends: of its joints.
        gains: of the joints' own loop.
        state: now.
        references: of the joints.
        accelerations: desired.
    """
    found = []
    for i, (wanted, (low, high)) in enumerate(zip(accelerations, ends, strict=True)):
        joint = vehicle.links[i].joint
        share = WITH_STOP if joint.has_stops else SHARE
        pole = maximum(0.5 * gains.damping[i], sqrt(gains.stiffness[i]))
        square = pole * pole
        gone = square * state.joints[i] + 2.0 * pole * state.joint_rates[i]
        kept = wanted
        if high:
            end = towards(joint.upper, references[i], share, pole)
            kept = minimum(kept, minimum(end, square * joint.upper) - gone)
        if low:
            end = towards(joint.lower, references[i], share, pole)
            kept = maximum(kept, maximum(end, square * joint.lower) - gone)
        found.append(kept)
    return tuple(found)


def towards(limit: Scalar, reference: Taylor, share: Scalar, pole: Scalar) -> Any:
    """q'' + 2 k q' + k^2 q (rad/s^2 or m/s^2) of a joint at rest in its allowed position.

    Args:
        limit: of the joint, rad or m.
        reference: of the joint, to its second derivative at least.
        share: of the way from the reference to the limit; a structural 0 for the reference itself.
        pole: k, rad/s.
    """
    told, square, twice = reference.derivative(0), mul(pole, pole), mul(2.0, pole)
    # the place where it may go moves with the reference, the limit does not
    moved = mul(sub(1.0, share), add(reference.derivative(2), mul(twice, reference.derivative(1))))
    return add(mul(square, add(told, mul(share, sub(limit, told)))), moved)
