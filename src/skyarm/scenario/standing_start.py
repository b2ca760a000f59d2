"""A vehicle that stands on a surface of its world at rest: how deep, and how tilted, its weight presses it.

It is set down from 5 cm above its position: level until the surfaces carry its weight, then tilted until they carry
its moment, too. A flight that begins so does not jump.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.algebra import Quaternion, Vec3
from skyarm.contact.contact import Contact
from skyarm.dynamics.energy import center_of_mass
from skyarm.dynamics.point_motion import PointMotion
from skyarm.dynamics.state import State
from skyarm.files import shown
from skyarm.plant.interface import Truth

Array = npt.NDArray[np.float64]

STEP, LOWEST, LIFT = 0.002, 3.0, 0.05
"""m, by which a vehicle is lowered until it stands, how far at most, and how far above its position it begins: a
reference that presses it to the ground lies a little below where it stands."""

ROUNDS, SMALL = 30, 1e-12
"""Newton steps at most, and the residual force by the weight at which they end."""

NEAR = (1e-7, 1e-7, 1e-7)
"""Differences by which the stiffness is found, m and rad."""


def standing(world: Truth, contact: Contact, state: State) -> State:
    """The state in which the vehicle rests on what is below it.

    Args:
        world: true vehicle and gravity.
        contact: surfaces and points.
        state: at rest, level but for its yaw, above the place.

    Raises:
        ValueError: one line: nothing carries it there, or it tips over.
    """
    rest = _Rest(world, contact, state)
    lowered = -LIFT
    if not rest.weight > 0.0:
        raise ValueError("initial.standing = true: must be false where plant.gravity leaves no weight to stand with")
    if rest.residual(np.array([LIFT, 0.0, 0.0]))[0] > -1.0:
        raise ValueError("initial.standing = true: must begin above what it is set down on; it touches at 5 cm above")
    while rest.residual(np.array([-lowered, 0.0, 0.0]))[0] < 0.0:
        lowered += STEP
        if lowered > LOWEST:
            place = shown([float(c) for c in state.position])
            below = f"nothing carries it within {LOWEST:g} m below {place} m"
            raise ValueError(f"initial.standing = true: must be above a surface; {below}")
    found = _balanced(rest, np.array([-lowered, 0.0, 0.0]))
    if found is not None:
        return found
    raise ValueError("initial.standing = true: must stand on three points around its centre of mass; it tips over")


def _balanced(rest: _Rest, x: Array) -> State | None:
    """The state at which forces and moments vanish, by Newton's method; None where there is none nearby."""
    with np.errstate(all="ignore"):  # of numbers beyond measure
        for _ in range(ROUNDS):
            found = rest.residual(x)
            if np.abs(found).max() < SMALL:
                return rest.at(x)
            columns = [(rest.residual(x + step) - found) / size for size, step in zip(NEAR, np.diag(NEAR), strict=True)]
            try:
                x = x - np.linalg.solve(np.stack(columns, axis=1), found)
            except np.linalg.LinAlgError:
                return None
    return None


class _Rest:
    """What a vehicle's supports leave uncarried, by its height and two small angles."""

    def __init__(self, world: Truth, contact: Contact, state: State) -> None:
        self._vehicle, self._contact, self._state = world.vehicle, contact, state
        self._memory = contact.start(1.0, ())
        self.weight = float(world.vehicle.mass) * float(world.gravity)

    def at(self, x: Array) -> State:
        """The state at a height (m), turned about the level axes x and y (rad)."""
        moved, about_x, about_y = (float(each) for each in x)
        tilt = Quaternion.of_rotation_vector(Vec3(about_x, about_y, 0.0))
        position = self._state.position + Vec3(0.0, 0.0, moved)
        return dataclasses.replace(self._state, position=position, quaternion=tilt * self._state.quaternion)

    def residual(self, x: Array) -> Array:
        """Vertical force less the weight, and both level moments about the centre of mass over 1 m, by the weight."""
        state = self.at(x)
        motion, middle = PointMotion(self._vehicle, state), center_of_mass(self._vehicle, state)
        force, moment = Vec3(0.0, 0.0, 0.0), Vec3(0.0, 0.0, 0.0)
        for wrench in self._contact.wrenches(self._memory, 0.0, motion, ()):
            arm = motion.position(wrench.point, wrench.body) - middle
            force, moment = force + wrench.force_W, moment + arm.cross(wrench.force_W) + wrench.torque_W
        values: Any = (force.z - self.weight, moment.x, moment.y)
        return np.array([float(each) for each in values]) / self.weight
