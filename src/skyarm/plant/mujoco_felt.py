"""What the vehicle's points feel of MuJoCo's contacts."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from skyarm.contact.plant_contact import PlantContact
from skyarm.plant.mujoco_world import POINT, WorldPlaces

FELT = 9
"""Numbers of a pair: force and torque on the point, normal force, friction, depth."""


class FeltReader:
    """Reads the contacts of MuJoCo's last forward step.

    Args:
        model, data: MuJoCo's. contact: the world. places: where its shapes stand in the model.
    """

    def __init__(self, model: Any, data: Any, contact: PlantContact, places: WorldPlaces) -> None:
        self._model, self._data = model, data
        self._points = {geom: i for i, geom in enumerate(places.points)}
        self._surfaces = {geom: i for i, geom in enumerate(places.surfaces)}
        # a point is a tiny sphere whose skin touches before it
        self._early = [POINT if float(point.radius) < POINT else 0.0 for point in contact.points]
        self._rows = np.zeros((len(places.surfaces) * len(places.points), FELT))

    def read(self) -> Any:
        """Numbers of all pairs of a surface and a point, surface by surface; zeros of those that do not touch."""
        rows, data = self._rows, self._data
        rows[:] = 0.0
        push = np.zeros(6)
        for i in range(data.ncon):
            contact = data.contact[i]
            first, second = int(contact.geom1), int(contact.geom2)
            geom, other, sense = (first, second, -1.0) if first in self._points else (second, first, 1.0)
            if geom not in self._points or other not in self._surfaces:
                continue  # of two bodies of the world
            mujoco.mj_contactForce(self._model, data, i, push)
            point = self._points[geom]
            force = sense * contact.frame.reshape(3, 3).T @ push[:3]
            torque = np.cross(contact.pos - data.geom_xpos[geom], force)
            depth = max(-float(contact.dist) - self._early[point], 0.0)
            row = rows[self._surfaces[other] * len(self._points) + point]
            row[:] = (*force, *torque, push[0], np.hypot(push[1], push[2]), depth)
        return rows.ravel()
