"""The level hover in many arm poses at once: what rotors and joints must give, and where the mass is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from skyarm import dynamics
from skyarm.actuation.mixer import Mixer
from skyarm.algebra import E_Z, ZERO3, Motion
from skyarm.vehicle.vehicle_records import Vehicle

Array = npt.NDArray[np.float64]

WRENCH = 4
"""Rows of a wrench that the mixer reads: torque x, y, z (N m, about the base origin) and force along z (N)."""


def columns(joints: Array) -> tuple[Array, ...]:
    """Joint values (lanes, n) as one array a joint."""
    return tuple(joints[:, i] for i in range(joints.shape[1]))


def hover_efforts(vehicle: Vehicle, gravity: float, joints: Array, accelerations: Array | None = None) -> Array:
    """What a level vehicle at rest needs, (4 + n, lanes): torque and force on the base, then the joints' efforts.

    Args:
        vehicle: the rigid bodies.
        gravity: m/s^2.
        joints: (lanes, n), rad or m.
        accelerations: (n,) of the joints, rad/s^2 or m/s^2; at rest if left out.
    """
    still = (0.0,) * vehicle.n
    moving = still if accelerations is None else tuple(float(a) for a in accelerations)
    level = Motion(ZERO3, E_Z * gravity)
    force, efforts = dynamics.inverse_dynamics(vehicle, columns(joints), ZERO3, still, level, moving)
    rows = (*force.torque, force.force.z, *efforts)
    return np.stack([np.broadcast_to(np.asarray(row, dtype=float), len(joints)) for row in rows])


@dataclass(frozen=True, slots=True)
class Allocation:
    """The mixer as arrays.

    Attributes:
        inverse: (rotors, 4) squared speed per wrench. highest: (rotors,) largest squared speed, (rad/s)^2.
    """

    inverse: Array
    highest: Array

    @classmethod
    def of(cls, mixer: Mixer) -> Allocation:
        """From a mixer with concrete numbers."""
        return cls(np.array(mixer.inverse, dtype=float), np.array(mixer.highest, dtype=float))

    def squared(self, efforts: Array) -> Array:
        """Squared rotor speeds (rotors, lanes) of wrenches (4 ..., lanes), before any limit."""
        return np.asarray(self.inverse @ efforts[:WRENCH], dtype=float)

    def room(self, squared: Array, direction: Array) -> Array:
        """How far one may go from squared speeds (rotors, lanes) along a wrench (4,) within all limits, (lanes,).

        Negative where a rotor is outside its limits already and the direction takes it further out.
        """
        change = (self.inverse @ direction)[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            up, down = (self.highest[:, None] - squared) / change, -squared / change
        far = np.where(change > 0.0, up, np.where(change < 0.0, down, np.inf))
        return np.asarray(np.min(far, axis=0), dtype=float)


def center_of_mass(efforts: Array, mass: float, gravity: float) -> tuple[Array, Array]:
    """Horizontal place (x, y) of the centre of mass against the base origin, m: the moment of weight over weight."""
    weight = mass * gravity
    return -efforts[1] / weight, efforts[0] / weight
