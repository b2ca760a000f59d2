"""Rotors that servos turn: how each one's disc is turned at many instants, from the servos' angles."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from skyarm.algebra.matrix import axis_rotation
from skyarm.drawing.moving_poses import stack
from skyarm.drawing.shapes import Shape
from skyarm.vehicle.vehicle_records import Vehicle

Array = npt.NDArray[np.float64]


def rotor_turns(vehicle: Vehicle, tilts: Array) -> dict[str, Array]:
    """Turn of every rotor that tilts, about its hub, by the name of its disc's shape.

    Args:
        vehicle: with concrete numbers.
        tilts: (N, tilting rotors) rad; of a log without angles (N, 0), and then there are none.

    Returns:
        name of the shape -> R_BB (N, 3, 3): from the base's axes as the disc is at rest to those as it is turned.
    """
    if tilts.shape[1] != len(vehicle.tilts):
        return {}
    turning = [rotor for rotor in vehicle.rotors if rotor.tilt is not None]
    found = {}
    for rotor, angle in zip(turning, tilts.T, strict=True):
        if rotor.tilt is not None:
            rows = axis_rotation(rotor.tilt.axis, angle).rows
            found[disc_name(rotor.name)] = stack([list(row) for row in rows], len(angle))
    return found


def disc_name(rotor: str) -> str:
    """Name of the shape of a rotor's disc."""
    return f"rotor/{rotor}"


def turned_shape(shape: Shape, turns: dict[str, Array]) -> Array:
    """R_BS of a shape: (N, 3, 3) of a disc that is turned, (3, 3) of any other."""
    still = np.array(shape.rotation)
    return turns[shape.name] @ still if shape.name in turns else still
