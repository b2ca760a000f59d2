"""Picture of a payload: a ball at its position, with its cord if it hangs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from skyarm.algebra import Vec3
from skyarm.world.scene.scene import Instants, Line, Scene
from skyarm.world.scene.shapes import Solid
from skyarm.world.scene.vehicle_shapes import payload_shape

HELD = 0.5
"""Fraction of the mass above which a payload counts as held, between two instants of a
log."""


def payload_scene(
    seen: Instants, *, name: str, mass: float, frame: str, com: Vec3, rigid: bool
) -> Scene:
    """Drawn ball and cord of a payload at some instants of a flight; empty if it is
    never held.

    Args:
        seen: the instants, with the logged numbers of the payload.
        name: payload's name; may be empty.
        mass: kg.
        frame: frame of the vehicle that holds it; empty for the tip.
        com: centre of mass, m, axes of the frame.
        rigid: True if it is fixed to the frame; else it hangs on a cord.
    """
    masses = seen.numbers["payload_mass"][:, 0]
    carried = masses > HELD * mass
    if not carried.any() or not (frame or seen.vehicle.end_effector):
        return Scene()
    (instants,) = np.nonzero(carried)
    # the last instant at which it was held, and before the first that one
    at = instants[
        np.maximum(
            np.searchsorted(instants, np.arange(len(carried)), side="right") - 1, 0
        )
    ]
    shape = payload_shape(seen.vehicle, mass, frame, com)
    ending = f"/{name}" if name else ""
    holder = seen.place(shape.position, shape.body)
    named = replace(shape, name=f"payload{ending}")
    rotation = seen.poses[shape.body][0]
    if rigid:
        return Scene(solids=(Solid(named, holder[at], rotation[at]),))
    places = seen.numbers["payload_position"]
    # NaN draws nothing where the load is not held
    cord = np.where(carried[:, None, None], np.stack([holder, places], axis=1), np.nan)
    return Scene(
        solids=(Solid(named, places[at], rotation[at]),),
        lines=(Line(f"cord{ending}", cord),),
    )
