"""Inverse dynamics of a vehicle whose rotors push along body z only."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skyarm import dynamics
from skyarm.algebra import ZERO3, Force, Motion, Vec3
from skyarm.scalars import divide
from skyarm.vehicle.vehicle_records import Vehicle


def forces_under_thrust(
    vehicle: Vehicle,
    joints: Sequence[Any],
    rate: Vec3,
    joint_rates: Sequence[Any],
    *,
    applied: Vec3,
    angular: Vec3,
    joint_accelerations: Sequence[Any],
) -> tuple[Force, tuple[Any, ...], Vec3]:
    """Torque on the base and joint torques that give the wanted angular and joint accelerations under a given force.

    The translational block of the mass matrix is m 1: the proper acceleration that follows is (f - F0) / m, with F0
    the force that the wanted accelerations need while the base's origin does not accelerate.

    Args:
        vehicle: the model.
        joints: rad or m.
        rate: of the base, base axes, rad/s.
        joint_rates: rad/s or m/s.
        applied: force at the base origin that is really there, base axes, N: thrust, wind.
        angular: wanted angular acceleration, base axes, rad/s^2.
        joint_accelerations: wanted.

    Returns:
        Force on the base (its force equals ``applied``), joint torques, proper acceleration of the base origin (m/s^2).
    """
    held = Motion(angular, ZERO3)
    alone, _ = dynamics.inverse_dynamics(vehicle, joints, rate, joint_rates, held, joint_accelerations)
    follows = (applied - alone.force) * divide(1.0, vehicle.mass)
    base = Motion(angular, follows)
    force, torques = dynamics.inverse_dynamics(vehicle, joints, rate, joint_rates, base, joint_accelerations)
    return force, torques, follows
