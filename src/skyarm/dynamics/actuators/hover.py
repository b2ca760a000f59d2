"""Hover trim and highest thrust."""

from __future__ import annotations

from skyarm import dynamics
from skyarm.algebra import E_Z, ZERO3, Motion, Scalar, Scalars
from skyarm.algebra.scalars import absolute
from skyarm.dynamics.actuators.mixer import make_mixer, mix
from skyarm.dynamics.actuators.rotor import push, speed_of_push
from skyarm.records.immutable import positional
from skyarm.vehicle import Vehicle

ROUNDING = 1e-9
"""Magnitude of a negative squared speed, over the largest, up to which it is a rounded
zero."""


@positional
class HoverTrim:
    """Trim of a level hover: rotor speeds, thrust and holding joint torques.

    Attributes:
        speeds: rad/s, one per rotor. squared: squared speeds from the mixer; negative
            means no such hover, for it is the size of those of reversible rotors.
        thrust: N, the vehicle's weight. efforts: joint torques that hold the arm.
    """

    speeds: Scalars
    squared: Scalars
    thrust: Scalar
    efforts: Scalars

    @property
    def needs_no_pull(self) -> bool:
        """True if no rotor has to push downwards; a rotor that idles in hover has a
        squared speed of rounding only.
        """
        squared = [float(each) for each in self.squared]
        return all(each >= -ROUNDING * max(squared) for each in squared)


def hover_trim(vehicle: Vehicle, joints: Scalars, gravity: Scalar) -> HoverTrim:
    """Rotor speeds and joint torques of a level, motionless vehicle with its arm at
    ``joints``.
    """
    still = vehicle.zeros
    level = Motion(ZERO3, E_Z * gravity)
    force, efforts = dynamics.inverse_dynamics(
        vehicle, joints, ZERO3, still, level, still
    )
    speeds, squared = mix(make_mixer(vehicle), force.torque, force.force.z)
    # the mixer's root is the speed of a rotor with thrust k w^2 alone
    if any(rotor.table is not None or rotor.reversible for rotor in vehicle.rotors):
        rows = tuple(zip(vehicle.rotors, squared, strict=True))
        speeds = tuple(speed_of_push(rotor, value) for rotor, value in rows)
        squared = tuple(
            # a reversible rotor may push downwards, so a negative square is a hover,
            # too
            absolute(value) if rotor.reversible else value
            for rotor, value in rows
        )
    return HoverTrim(speeds, squared, force.force.z, efforts)


def highest_thrust(vehicle: Vehicle) -> Scalar:
    """Thrust along body z with every rotor at its highest speed, N."""
    # backwards a reversible rotor whose axis points down pushes up
    total: Scalar = sum(
        (absolute(r.axis.z) if r.reversible else r.axis.z)
        * r.thrust_coefficient
        * push(r, r.max_speed)
        for r in vehicle.rotors
    )
    return total
