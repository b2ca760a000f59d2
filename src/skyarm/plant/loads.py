"""What pushes on the vehicle but gravity: rotors and their lag, wind, body drag, joint drives; for both plants."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skyarm.actuation import Command, joint_force, rotor_forces, speed_after
from skyarm.algebra import ZERO3, Force
from skyarm.dynamics.state import State
from skyarm.environment import Effectiveness, WindSample, body_drag
from skyarm.vehicle.records import Vehicle


def applied_force(
    vehicle: Vehicle, state: State, rotor_speeds: Sequence[Any], efforts: Sequence[Any], wind: WindSample
) -> tuple[Force, tuple[Any, ...]]:
    """Force on the base (torque about and force at its origin, base axes) and joint torques.

    Args:
        vehicle: the truth.
        state: of the vehicle; its own rotor speeds are not read.
        rotor_speeds: rad/s, now.
        efforts: commanded joint torques or forces.
        wind: force and air velocity, now, and what faults leave of the actuators.
    """
    R = state.quaternion.rotation()
    v_air = R.apply_T(state.velocity - wind.air_velocity_W)
    push = R.apply_T(wind.force_W)
    total = Force(wind.point_B.cross(push), push) + Force(ZERO3, body_drag(vehicle.drag, v_air))
    left = wind.effectiveness or Effectiveness((1,) * len(vehicle.rotors), (1,) * vehicle.n)
    total = total + rotor_forces(vehicle.rotors, rotor_speeds, v_air, state.rate, left.rotors)
    torques = tuple(
        joint_force(link.joint, effort, rate, share)
        for link, effort, rate, share in zip(vehicle.links, efforts, state.joint_rates, left.joints, strict=True)
    )
    return total, torques


def lagged(vehicle: Vehicle, state: State, command: Command, dt: Any) -> tuple[Any, ...]:
    """Rotor speeds after ``dt`` seconds of a held command."""
    return tuple(
        speed_after(rotor, speed, wanted, dt)
        for rotor, speed, wanted in zip(vehicle.rotors, state.rotor_speeds, command.rotor_speeds, strict=True)
    )
