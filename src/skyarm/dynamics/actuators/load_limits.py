"""Largest load at the tip of a vehicle, by its rotors and joints."""

from __future__ import annotations

from typing import Annotated

from skyarm.algebra import E_Z, ZERO3, Scalar
from skyarm.algebra.scalars import absolute, data, divide, maximum, minimum, where
from skyarm.dynamics.actuators.hover import highest_thrust
from skyarm.dynamics.point_motion import PointMotion
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit

SPENT = 0.85
"""Share of thrust and joint efforts that weights may take; the rest controls the
motion."""

LARGEST, LEVER = 1e4, 1e-3
"""Force (N) of a member without limits, and least lever (m) of a force about a
joint."""


@immutable
class LoadLimits:
    """Largest load at the tip of a vehicle in a pose."""

    weight: Annotated[
        Scalar, Unit("N", "largest weight at the tip that rotors and joints bear")
    ] = LARGEST
    moment: Annotated[
        Scalar,
        Unit(
            "N m", "largest moment at the tip, of any direction, that the joints bear"
        ),
    ] = LARGEST


def largest_load(motion: PointMotion) -> LoadLimits:
    """Largest load at the tip of a vehicle in its present pose; at least 0.

    Beside the weights of vehicle and arm, which the same rotors and joints bear. A
    moment may have any direction. Servos count as their joints.
    """
    vehicle, gravity = motion.vehicle, motion.gravity
    most = minimum(SPENT * highest_thrust(vehicle) - vehicle.mass * gravity, LARGEST)
    turning: Scalar = LARGEST
    own: list[Scalar] = [0.0] * vehicle.n
    for i, each in enumerate(vehicle.moving):
        _, efforts = motion.generalized_force(
            E_Z * (each.body.mass * gravity), ZERO3, each.body.com, i
        )
        own = [a + b for a, b in zip(own, efforts, strict=True)]
    # without joints only the rotors limit, and no joint bears a moment
    if not vehicle.n:
        return LoadLimits(weight=data(maximum(most, 0.0)))
    _, levers = motion.generalized_force(E_Z, ZERO3, *motion.frame())
    for link, weight, lever in zip(vehicle.links, own, levers, strict=True):
        limit = where(link.joint.effort_limit > 0.0, link.joint.effort_limit, LARGEST)
        # the arm's own weight is on the joint before any load is
        spare = maximum(SPENT * limit - absolute(weight), 0.0)
        # the line of the force may pass through the joint, which is then not loaded
        most = minimum(most, divide(spare, maximum(absolute(lever), LEVER)))
        turning = minimum(turning, spare) if link.joint.turns else turning
    return LoadLimits(weight=data(maximum(most, 0.0)), moment=data(turning))
