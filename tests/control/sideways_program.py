"""The most of sideways force that all rotors together can give, by a linear program."""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.optimize import linprog

from skyarm.algebra import Vec3


def array(v):
    return np.array([float(c) for c in v])


def lopsided(vehicle):
    """The vehicle with two rotors moved: six in a ring reach alike for a centre of mass
    on either side.
    """
    first, second, *others = vehicle.rotors
    first = dataclasses.replace(first, position=Vec3(0.34, 0.02, 0.05))
    second = dataclasses.replace(
        second, position=Vec3(0.15, 0.28, 0.03), axis=Vec3(-0.48, 0.36, 0.8)
    )
    return dataclasses.replace(vehicle, rotors=(first, second, *others))


def largest(vehicle, direction, vertical, com):
    """N: the most of a force in that direction of body x, y, through ``com``, beside a
    vertical one (N) there.
    """
    columns, top = [], [float(r.max_speed) ** 2 for r in vehicle.rotors]
    for rotor in vehicle.rotors:
        push = array(rotor.axis) * float(rotor.thrust_coefficient)
        twist = (
            np.cross(array(rotor.position), push)
            - rotor.direction * float(rotor.moment_coefficient) * push
        )
        columns.append([*twist, *push])
    side, up = np.array([*direction, 0.0]), np.array([0.0, 0.0, vertical])
    found = linprog(
        [*np.zeros(len(top)), -1.0],
        A_eq=np.hstack(
            [np.array(columns).T * top, -np.array([[*np.cross(com, side), *side]]).T]
        ),
        b_eq=[*np.cross(com, up), *up],
        bounds=[*[(0.0, 1.0)] * len(top), (0.0, None)],
    )
    return found.x[-1]
