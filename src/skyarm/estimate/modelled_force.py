"""Specific force of the believed vehicle: what an accelerometer at the base origin would read if it were true."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skyarm import dynamics
from skyarm.actuation import joint_force, stop_force
from skyarm.actuation.rotor import rotor_force
from skyarm.algebra import ZERO3, Force, Vec3
from skyarm.environment import body_drag
from skyarm.scalars import add, data, sqrt
from skyarm.vehicle.vehicle_records import Vehicle


def modelled_force(
    vehicle: Vehicle,
    velocity_B: Vec3,
    rate: Vec3,
    joints: Sequence[Any],
    joint_rates: Sequence[Any],
    speeds: tuple[Sequence[Any], Sequence[Any]],
    efforts: Sequence[Any],
) -> Vec3:
    """Mean over a period, m/s^2, base axes, by the forward dynamics of the whole vehicle in still air.

    With rotors, drag of the airframe, joints with their friction and stops; without the torque of rotors that spin up.

    Args:
        vehicle: the believed one.
        velocity_B: m/s, base axes.
        rate: rad/s, base axes.
        joints: at the end of the period.
        joint_rates: at the end of the period.
        speeds: of the rotors at the beginning and at the end, rad/s; thrust goes with the mean of their squares.
        efforts: of the joints over the period, N m or N: setpoints of drives that give torques.
    """
    mean = [sqrt(0.5 * (a * a + b * b)) for a, b in zip(*speeds, strict=True)]
    # rotor by rotor: sums over alike rotors would round otherwise where their numbers are parameters
    applied = Force(ZERO3, body_drag(vehicle.drag, velocity_B))
    for rotor, speed in zip(vehicle.rotors, mean, strict=True):
        applied = applied + rotor_force(rotor, speed, velocity_B + rate.cross(rotor.position))
    torques = [
        add(joint_force(link.joint, effort, qd), stop_force(link.joint, q, qd))
        for link, effort, q, qd in zip(vehicle.links, efforts, joints, joint_rates, strict=True)
    ]
    base, _ = dynamics.forward_dynamics(vehicle, joints, rate, joint_rates, applied, torques)
    return Vec3(*(data(c) for c in base.linear))
