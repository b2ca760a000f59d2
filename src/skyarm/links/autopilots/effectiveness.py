"""Control effectiveness of the rotors about the centre of mass, and moments of inertia,
with the joints at zero.

Parameters of autopilots follow from it: places and shares of the rotors, hover thrust,
gains of the rate loop.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from skyarm.dynamics.actuators.rotor import push
from skyarm.dynamics.array_front import center_of_mass, mass_matrix
from skyarm.records.arrays import Array, float_array
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.vehicle import Rotor, Vehicle

_LEVEL = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
"""Position and attitude of a level vehicle at the origin."""


def centre_of_mass(vehicle: Vehicle) -> Array:
    """Centre of mass (m) of a vehicle with its joints at zero, base axes."""
    return center_of_mass(vehicle, *_LEVEL, vehicle.zeros)


def unit_wrenches(vehicle: Vehicle) -> Array:
    """Torque about the centre of mass, and force, per unit thrust of each rotor (6,
    rotors), base axes.
    """
    com = centre_of_mass(vehicle)
    columns = []
    for rotor in vehicle.rotors:
        axis = float_array(rotor.axis)
        arm = float_array(rotor.position) - com
        torque = (
            np.cross(arm, axis)
            # the air's reaction turns against the rotor
            - float(rotor.direction) * float(rotor.moment_coefficient) * axis
        )
        columns.append(np.concatenate([torque, axis]))
    return np.array(columns).T


def highest_thrust(vehicle: Vehicle) -> list[float]:
    """Maximum thrust (N) of each rotor."""
    return [
        float(rotor.thrust_coefficient * push(rotor, rotor.max_speed))
        for rotor in vehicle.rotors
    ]


def hover_share(vehicle: Vehicle, gravity: float, title: str, most: float) -> float:
    """Hover thrust of a vehicle as a fraction of its maximum thrust.

    Args:
        vehicle: vehicle to hover.
        gravity: m/s^2.
        title: name of the autopilot, for the message.
        most: share that is too much.

    Raises:
        ScenarioError: rotors that cannot lift the vehicle.
    """
    rows = zip(vehicle.rotors, highest_thrust(vehicle), strict=True)
    lift = sum(thrust * float(rotor.axis[2]) for rotor, thrust in rows)
    # no lift at all divides by zero: an infinite share is refused below with words
    share = float(vehicle.mass) * gravity / lift if lift > 0.0 else math.inf
    if not share < most:
        raise ScenarioError(
            f"plant.vehicle: rotors that lift {lift:.3g} N at most: must lift more than"
            f" {1.0 / most:.3g} times the weight for {title}"
        )
    return share


def square_share(rotor: Rotor, signals: Sequence[float]) -> float:
    """Least-squares weight a of the square in the thrust curve a s^2 + (1 - a) s of a
    signal s.
    """
    s = np.asarray(signals)
    full = float(push(rotor, rotor.max_speed))
    thrust = (
        float_array(push(rotor, each * float(rotor.max_speed)) for each in signals)
        / full
    )
    # one unknown, which the thrust is linear in: thrust - s = a (s^2 - s)
    bend = s * s - s
    return float(bend @ (thrust - s) / (bend @ bend))


def inertias(vehicle: Vehicle) -> tuple[Array, Array]:
    """Effective base inertia (kg m^2) about x, y, z, with limp and with locked joints,
    at joint angles of zero.

    They are Schur complements of the mass matrix: everything but the base's rotation,
    or but that and the joints, is free to move.
    """
    mass = mass_matrix(vehicle, *_LEVEL, vehicle.zeros)
    limp, locked = np.linalg.inv(mass)[3:6, 3:6], np.linalg.inv(mass[:6, :6])[3:6, 3:6]
    return 1.0 / np.diag(limp), 1.0 / np.diag(locked)


def turning_inertia(vehicle: Vehicle) -> tuple[float, float, float]:
    """Inertia (kg m^2) about each base axis: the geometric mean of those with limp and
    with locked joints.

    With joints that do not yield the arm turns with the base; with limp ones part of it
    stays. A joint's own control lies between, and so does the mean.
    """
    limp, locked = inertias(vehicle)
    x, y, z = np.sqrt(limp * locked).tolist()
    return x, y, z


def proportional_gains(
    vehicle: Vehicle, torques: Sequence[float], bandwidths: Sequence[float]
) -> tuple[float, float, float]:
    """Proportional gains of a rate loop, signal per rad/s: bandwidth (rad/s) J / torque
    of a full signal (N m).
    """
    rows = zip(turning_inertia(vehicle), torques, bandwidths, strict=True)
    x, y, z = (bandwidth * inertia / torque for inertia, torque, bandwidth in rows)
    return x, y, z
