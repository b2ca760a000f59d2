"""Scene around a vehicle: the shapes of the environment components at some instants.

Films, recordings, the studio, figures, environments and files for viewers draw it.
Every part of a scenario answers for itself
(:meth:`skyarm.world.component.Component.shapes`), from the numbers that it logs.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import field, replace
from functools import cached_property

import numpy as np

from skyarm.algebra import Scalar
from skyarm.dynamics.point_motion import PointMotion
from skyarm.records.arrays import Array, Mask, float_array
from skyarm.records.immutable import immutable, positional
from skyarm.vehicle import BASE, Vehicle
from skyarm.world.scene.shapes import RGBA, Shape, Solid
from skyarm.world.scene.vehicle_shapes import Poses, body_poses

PATCH = 1.0
"""Half the width (m) of the drawn patch of a plane."""

LINE: RGBA = (0.25, 0.25, 0.28, 1.0)

OBSTACLES = ("surface", "object")
"""Roles of drawn shapes that belong to the surroundings."""

WAY = np.linspace(0.03, 3.0, 100)
"""Distances (m) from a point towards the camera at which an obstacle may hide it."""


@positional
class Line:
    """Polyline in the world at N instants, such as a rope, a cable or a path.

    Attributes:
        name: unique name in the scene. places: (N, K, 3) m.
    """

    name: str
    places: Array
    rgba: RGBA = LINE


@positional
class Arrow:
    """Drawn arrow of a force on the vehicle at N instants.

    Attributes:
        name: unique name in the scene. spot: (N, 3) m, where it acts. force: (N, 3) N.
            World axes.
    """

    name: str
    spot: Array
    force: Array


@immutable
class Scene:
    """Drawn solids, lines and arrows of the environment models at N instants of a
    flight.

    Attributes:
        solids, lines, arrows: shapes in the world. attached: shapes on the vehicle's
            bodies.
        ground: height of the ground, m; None if unknown.
    """

    solids: tuple[Solid, ...] = ()
    lines: tuple[Line, ...] = ()
    arrows: tuple[Arrow, ...] = ()
    attached: tuple[Shape, ...] = ()
    ground: float | None = None

    @property
    def obstacles(self) -> tuple[Solid, ...]:
        """Drawn solids that may hide the vehicle from the camera."""
        return tuple(each for each in self.solids if each.shape.role in OBSTACLES)


@immutable(slots=False)
class Instants:
    """Instants of a flight to draw: times, the vehicle's states, and logged numbers of
    one environment model.

    Attributes:
        vehicle: vehicle of the plant, with concrete numbers.
        times: (N,) s.
        position, quaternion, joints: (N, 3) m, (N, 4) wxyz and (N, n) of the vehicle.
        name: name of the vehicle; empty if parts of all names are its own.
        agents: the same instants of all drawn vehicles by name, of this one, too.
        numbers: array -> (N, k), the columns that the asked part declares and logs.
        around: (3,) m, place of what happens. patch: half the width of what stands for
            a plane without an end, m.
    """

    vehicle: Vehicle
    times: Array
    position: Array
    quaternion: Array
    joints: Array
    name: str = ""
    agents: Mapping[str, Instants] = field(default_factory=dict)
    numbers: Mapping[str, Array] = field(default_factory=dict)
    around: Array = field(default_factory=lambda: np.zeros(3))
    patch: float = PATCH

    def of(self, agent: str) -> Instants:
        """Same instants of a vehicle by name; these for an empty name, or where
        vehicles have none.
        """
        return self.agents[agent] if agent and self.name else self

    def has(self, agent: str) -> bool:
        """True if the vehicle that a part is on, by its name, is drawn."""
        return not self.name or agent in ("", *self.agents)

    @cached_property
    def poses(self) -> Poses:
        """World rotations (N, 3, 3) and positions (N, 3) of all bodies of the vehicle,
        by body index.
        """
        return body_poses(self.vehicle, self.position, self.quaternion, self.joints)

    def place(
        self, point: Iterable[Scalar] = (0.0, 0.0, 0.0), body: int = BASE
    ) -> Array:
        """World positions (N, 3), in m, of a point that is fixed to a body of the
        vehicle.
        """
        R, p = self.poses[body]
        return p + R @ float_array(point)


def instant_of(motion: PointMotion, time: float, around: Array) -> Instants:
    """Single instant to draw, from the present motion of the vehicle and of those that
    fly with it.
    """
    agents = {
        name: _instant_of(each, time, around) for name, each in motion.agents.items()
    }
    return replace(agents[motion.name], agents=agents)


def _instant_of(motion: PointMotion, time: float, around: Array) -> Instants:
    """Single instant of one vehicle, without the others."""
    state = motion.state
    position, quaternion, joints = (
        np.array([[float(c) for c in each]])
        for each in (state.position, state.quaternion, state.joints)
    )
    return Instants(
        vehicle=motion.vehicle,
        times=np.array([time]),
        position=position,
        quaternion=quaternion,
        joints=joints,
        around=around,
        name=motion.name,
    )


def hidden_share(solids: Iterable[Solid], places: Array, towards: Array) -> float:
    """Fraction of the instants at which drawn solids hide a given point from the
    camera.

    Args:
        solids: solids at N instants.
        places: (N, 3) m, world axes.
        towards: (3,) unit vector from the place to the eye.
    """
    ways = places[:, None] + WAY[:, None] * towards
    behind = np.zeros(len(places), bool)
    for solid in solids:
        local = np.einsum(
            "kwi,kij->kwj", ways - solid.position[:, None], solid.rotation
        )
        behind |= inside(solid, local).any(axis=1)
    return float(behind.mean())


def inside(solid: Solid, places: Array) -> Mask:
    """True for points (..., 3) inside a drawn solid, given in its axes."""
    kind = solid.shape.kind
    size = np.array(solid.shape.size)
    height = places[..., 2]
    across = np.linalg.norm(places[..., :2], axis=-1)
    within: Mask
    if kind == "patch":
        within = (np.abs(places[..., :2]) < size).all(axis=-1) & (height < 0.0)
    elif kind == "box":
        within = np.all(np.abs(places) < size, axis=-1)
    elif kind == "hole":
        within = (across < size[3]) & (height < 0.0) & (height > -size[4])
    elif kind == "cylinder":
        within = (across < size[0]) & (np.abs(height) < 0.5 * size[1])
    else:
        within = np.linalg.norm(places, axis=-1) < size[0]
    return np.asarray(within)
