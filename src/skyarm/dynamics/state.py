"""State of a vehicle, and accelerations with and without gravity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from skyarm.algebra import E_Z, Mat3, Motion, Quaternion, Vec3
from skyarm.scalars import Scalar


@dataclass(frozen=True, kw_only=True, slots=True)
class State:
    """Everything a plant integrates.

    Attributes:
        position: base origin in the world, m.
        quaternion: wxyz, base to world.
        velocity: of the base origin, world axes, m/s.
        rate: angular velocity, base axes, rad/s.
        joints, joint_rates: rad or m, and per second.
        rotor_speeds: rad/s, unsigned.
    """

    position: Vec3
    quaternion: Quaternion
    velocity: Vec3
    rate: Vec3
    joints: tuple[Scalar, ...] = ()
    joint_rates: tuple[Scalar, ...] = ()
    rotor_speeds: tuple[Scalar, ...] = ()


def proper_acceleration(R_WB: Mat3, linear_W: Vec3, angular_B: Vec3, gravity: Any) -> Motion:
    """Return the base acceleration as an accelerometer reads it: R^T (dv/dt + g e_z), base axes."""
    return Motion(angular_B, R_WB.apply_T(linear_W + E_Z * gravity))


def coordinate_acceleration(R_WB: Mat3, proper: Motion, gravity: Any) -> tuple[Vec3, Vec3]:
    """(dv_W/dt, dw_B/dt) from a proper acceleration."""
    return R_WB.apply(proper.linear) - E_Z * gravity, proper.angular
