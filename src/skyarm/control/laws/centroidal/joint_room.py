"""Joints kept within their limits: bounds of the acceleration that tip and links ask for.

The tip mode takes joints off their references, and a task that the arm cannot do takes them far: to lift a tip that a
gust tilted away a short slide runs to its end. A joint may go a share of the way from its reference to a limit; the
rest is for forces that nobody foresaw, more of it where no stop holds the joint and passing the limit ends a flight.
With d the way that is left and k the pole of the joints' own loop, half of its damping (the root of its stiffness where
that is more),

    d'' + 2 k d' + k^2 d >= 0

bounds the acceleration towards the limit, so that a joint comes to rest there no faster than the loop brings it to a
reference. The place where it may go moves with the reference, and d with it; the limit itself, at rest, bounds as well.
A reference that brakes before the limit as slowly as that is followed as it is. What is left out is the tip's loss, not
the base's: the inverse dynamics gets the bounded acceleration.

Two more things count near a limit. A force that the observer has found may let go at once, and the drive's answer to it
then pushes the joint the other way, by up to d / (M k^2) where only the loop holds it (M the joint's inertia). Where no
stop holds the joint, that much more of the way stays free, but the joint is not moved off its reference for it. And the
joint that brakes is the measured one, not the observer's, which follows a sudden force, or a tip much heavier than
believed, late: :func:`as_sensed`.
Source: Ames et al. 2019, "Control barrier functions: theory and applications", exponential barrier of degree two.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

from skyarm.control.blocks.disturbance_observer import Observed, Told
from skyarm.control.model import JointGains
from skyarm.dynamics import State
from skyarm.scalars import add, divide, exp, maximum, minimum, mul, sqrt, sub
from skyarm.scalars.taylor import Taylor
from skyarm.sensors.measurement import Measurement
from skyarm.vehicle.vehicle_records import Vehicle

SHARE, WITH_STOP = 0.5, 0.75
"""Of the way from a joint's reference to its limit that tip and links may take, without and with a hard stop there."""

LEAST = 1e-9
"""Of 1 - b of an observer that does not learn."""

Ends = tuple[tuple[bool, bool], ...]
"""Whether each joint has a lower and an upper limit: structure."""


def ends_of(vehicle: Vehicle) -> Ends:
    """Which limits the joints of a vehicle have."""
    joints = (link.joint for link in vehicle.links)
    return tuple((math.isfinite(float(joint.lower)), math.isfinite(float(joint.upper))) for joint in joints)


def as_sensed(
    bandwidth: Any,
    state: State,
    observed: Observed,
    told: Told,
    measurement: Measurement,
    started: Any,
    periods: int,
    dt: Any,
) -> State:
    """The state now, with joints as they were measured and as what the observer has not found yet moves them on.

    A constant acceleration a beyond what the observer believes keeps the predicted rate off by e = a dt / L1; from such
    an e the observer takes L2 e / dt a period into its disturbance, so that a = (L1 / L2) of that, and with both poles
    at b L1 / L2 = (1 + b) / (1 - b) (:mod:`skyarm.control.blocks.disturbance_observer`). It goes on until amid the period
    in which the command acts.

    Args:
        bandwidth: of the joints' observer, rad/s.
        state: the observer's, carried across the delay.
        observed: of the observer, at the measurement's time. told: by it. measurement: the last one.
        started: 0 before the first measurement, then 1.
        periods: age of the measurement. dt: control period, s.
    """
    b = exp(-(bandwidth * dt))
    until = mul(started, (periods + 0.5) * dt)
    late = divide(mul(until, add(1.0, b)), maximum(sub(1.0, b), LEAST))
    places = zip(state.joints, measurement.joints, observed.joints, strict=True)
    rates = zip(state.joint_rates, measurement.joint_rates, observed.joint_rates, told.joint_corrections, strict=True)
    return dataclasses.replace(
        state,
        joints=tuple(add(now, sub(q, then)) for now, q, then in places),
        joint_rates=tuple(add(now, add(sub(qd, then), mul(late, more))) for now, qd, then, more in rates),
    )


def within_limits(
    vehicle: Vehicle,
    ends: Ends,
    gains: JointGains,
    state: State,
    references: Sequence[Taylor],
    accelerations: Sequence[Any],
    efforts: Sequence[Any],
    inertias: Sequence[Any],
) -> tuple[Any, ...]:
    """Joint accelerations (rad/s^2 or m/s^2) that run into no limit.

    Args:
        vehicle: model.
        ends: of its joints.
        gains: of the joints' own loop.
        state: now.
        references: of the joints, as they were given.
        accelerations: wanted.
        efforts: that push the joints beside the drives, as observed, N m or N.
        inertias: of the joints, kg m^2 or kg.
    """
    found = []
    for i, (wanted, (low, high)) in enumerate(zip(accelerations, ends, strict=True)):
        joint, told = vehicle.links[i].joint, references[i].derivative(0)
        share = WITH_STOP if joint.has_stops else SHARE
        pole = maximum(mul(0.5, gains.damping[i]), sqrt(gains.stiffness[i]))
        square, twice = mul(pole, pole), mul(2.0, pole)
        gone = add(mul(square, state.joints[i]), mul(twice, state.joint_rates[i]))
        # of the place where it may go, that moves with the reference, and of the limit, which does not
        path = add(references[i].derivative(2), mul(twice, references[i].derivative(1)))
        moved = mul(1.0 - share, path)
        kept = wanted
        if high:
            end = add(mul(square, add(told, mul(share, sub(joint.upper, told)))), moved)
            if not joint.has_stops:
                short = sub(mul(square, joint.upper), divide(maximum(mul(-1.0, efforts[i]), 0.0), inertias[i]))
                end = minimum(end, maximum(short, add(mul(square, told), path)))
            kept = minimum(kept, sub(minimum(end, mul(square, joint.upper)), gone))
        if low:
            end = add(mul(square, add(told, mul(share, sub(joint.lower, told)))), moved)
            if not joint.has_stops:
                short = add(mul(square, joint.lower), divide(maximum(efforts[i], 0.0), inertias[i]))
                end = maximum(end, minimum(short, add(mul(square, told), path)))
            kept = maximum(kept, sub(maximum(end, mul(square, joint.lower)), gone))
        found.append(kept)
    return tuple(found)
