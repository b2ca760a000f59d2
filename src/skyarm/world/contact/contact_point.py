"""Contact points of a vehicle: the tip, skids, feet, or any point of a link."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated

from skyarm.algebra import E_X, E_Y, E_Z, ZERO3, Mat3, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import maximum
from skyarm.dynamics.point_motion import PointMotion
from skyarm.records import coerce
from skyarm.records.coerce import RecordError, absent, concrete, fold_zeros
from skyarm.records.field_rules import accept_fields, checked
from skyarm.records.files import shown
from skyarm.records.immutable import field_if_any, immutable
from skyarm.records.units import Unit, nonnegative, positive
from skyarm.vehicle import BASE, Vehicle
from skyarm.vehicle.vehicle_records import body_index
from skyarm.world.component import Wrench
from skyarm.world.contact.material import Material

MOST = 64
"""Largest number of points of a ring; each costs as much as any other contact point."""


@immutable
@checked("ring")
class Ring:
    """Equally spaced contact points on a circle about the z axis, such as the rim of a
    peg.

    Attributes:
        count: number of places, the first on the x axis.
    """

    radius: Annotated[Scalar, positive("m", "radius of the circle of contact points")]
    count: Annotated[
        int, Unit("", "number of contact points on the circle", low=3, high=MOST)
    ]

    def offsets(self) -> list[Vec3]:
        """Positions of the ring's points relative to its centre, m."""
        angles = [2.0 * math.pi * i / self.count for i in range(self.count)]
        return [
            Vec3(self.radius * math.cos(angle), self.radius * math.sin(angle), 0)
            for angle in angles
        ]


@immutable
class ContactPoint:
    """Point or ball fixed to a body of the vehicle, at which surfaces exert contact
    forces.

    Attributes:
        name: name in logs and messages.
        frame: frame of the vehicle, in whose axes ``position`` is; empty where ``body``
            defines them.
        body: "base" or the name of a link.
        ring: points on a circle about the position, in its place; :meth:`each` makes
            them.
        agent: name of the vehicle; empty for the only one.
    """

    name: Annotated[
        str,
        Unit("", "name of the contact point, for logs and messages", rule=coerce.name),
    ]
    frame: str = ""
    body: str = ""
    position: Annotated[
        Vec3, Unit("m", "position of the contact point, axes of its frame or body")
    ] = ZERO3
    radius: Annotated[
        Scalar, nonnegative("m", "radius of the contact ball; 0 for a point")
    ] = 0
    ring: Ring | None = None
    agent: str = field_if_any(default="")

    def __post_init__(self) -> None:
        accept_fields(self, "point")
        fold_zeros(self, "radius")
        if self.frame and self.body:
            raise RecordError(
                f"point.frame = {shown(self.frame)}: must be left out beside body"
            )
        if not self.frame and not self.body:
            raise RecordError(
                "point.body: is missing; say a frame of the vehicle, or a body with a"
                " position"
            )

    def each(self) -> tuple[ContactPoint, ...]:
        """List the single contact points: the points of a ring, or the contact point
        itself without a ring.
        """
        if self.ring is None:
            return (self,)
        points = []
        for i, offset in enumerate(self.ring.offsets()):
            place = self.position + offset
            points.append(
                replace(self, name=f"{self.name}_{i + 1}", position=place, ring=None)
            )
        return tuple(points)

    def place(self, vehicle: Vehicle) -> tuple[Vec3, int]:
        """Position (m, body axes) of the contact point, and index of the vehicle's body
        that it is fixed to.

        Raises:
            ValueError: the vehicle has no such frame or body; names those it has.
        """
        if self.frame:
            frame = vehicle.frame(self.frame)
            # a product with a float 0.0 would stay in the program
            if concrete(*self.position) and not any(self.position):
                return frame.position, frame.link
            return frame.position + frame.rotation.apply(self.position), frame.link
        return self.position, body_index(vehicle, "body", self.body)


@immutable
class Touch:
    """Contact state of one point at one surface: penetration, slip velocity, normal
    force and friction.

    Attributes:
        depth: penetration, m; negative outside. slip: velocity of the point relative to
            the surface, m/s.
        normal: normal force, N, along ``axis``, the surface's outward normal.
        friction: friction force, N. bristle_rate: m/s. spot: place where it acts, seen
            from the point, m.
    """

    depth: Scalar
    slip: Vec3
    normal: Scalar
    axis: Vec3
    friction: Vec3
    bristle_rate: Vec3
    spot: Vec3

    @property
    def force(self) -> Vec3:
        """Total contact force: normal force and friction, N."""
        return self.axis * self.normal + self.friction

    @property
    def torque(self) -> Vec3:
        """Torque of the contact force about the centre of the contact ball, N m."""
        return self.spot.cross(self.force)

    @property
    def logged(self) -> Scalars:
        """Normal force (N), friction (N) and penetration (m, at least 0) of the
        contact, for the log.
        """
        return (
            self.normal,
            self.friction.norm(),
            maximum(self.depth, 0.0),
        )


def touch_of(
    material: Material,
    depth: Scalar,
    axis: Vec3,
    spot: Vec3,
    slip: Vec3,
    deflection: Vec3,
    step: Scalar,
    mass: Scalar,
    *,
    mean: Scalar | None,
) -> Touch:
    """Contact state of one point at one surface, from penetration, slip velocity and
    bristle deflection.

    Args:
        material: material of the surface.
        depth: penetration, m.
        axis: the surface's outward normal, world axes.
        spot: place where they touch, seen from the point, m.
        slip: velocity of the point relative to the surface at the spot, m/s.
        deflection: deflection of the bristle as the memory has it, m.
        step: longest integration step of the whole contact, s.
        mass: mass (kg) that the pair moves at least.
        mean: time (s) in which a point makes the way that the depth is a mean over; the
            material's longest step of a contact with a vehicle if None.
    """
    # a round surface's normal turns
    bristle, along = _across(deflection, axis), _across(slip, axis)
    rate = material.bristle_rate(bristle, along, depth, step)
    normal = material.normal_force(depth, -slip.dot(axis), mean)
    friction = material.friction_force(
        bristle, material.bending_rate(bristle, along), normal, mass
    )
    return Touch(
        depth=depth,
        slip=slip,
        normal=normal,
        friction=friction,
        spot=spot,
        bristle_rate=rate,
        axis=axis,
    )


def _across(vector: Vec3, n: Vec3) -> Vec3:
    """Component of a vector perpendicular to a unit vector."""
    axis = n.coordinate_axis()
    if axis is None:
        across: Vec3 = vector - n * vector.dot(n)
        return across
    return Vec3(*(0 if i == axis else c for i, c in enumerate(vector)))


Moving = tuple[Vec3, Vec3, Vec3]
"""Position (m), velocity (m/s) and angular velocity (rad/s; of a ball only) of a point,
world axes."""


def moving_points(points: Sequence[ContactPoint], motion: PointMotion) -> list[Moving]:
    """Position, velocity and angular velocity of every contact point, world axes."""
    rows = list[Moving]()
    placed, axes = _places(points, motion)
    for point, (at, body) in zip(points, placed, strict=True):
        own = motion.of(point.agent)
        ball = not absent(point.radius)
        turning = ZERO3
        shared = axes.get((point.agent, body))
        if ball or shared is not None:
            turning = own.to_world(own.angular_velocity(body), body)
        if shared is None:
            rows.append((own.position(at, body), own.velocity(at, body), turning))
        else:
            lever = shared.apply(at)
            rows.append(
                (
                    own.position(ZERO3, body) + lever,
                    own.velocity(ZERO3, body) + turning.cross(lever),
                    turning if ball else ZERO3,
                )
            )
    return rows


def wrenches_on(
    points: Sequence[ContactPoint],
    motion: PointMotion,
    pushes: Sequence[tuple[Vec3, Vec3]],
) -> list[Wrench]:
    """Wrenches on the vehicles' bodies from a force (N) and a torque (N m) at every
    contact point.
    """
    placed, axes = _places(points, motion)
    whole = dict[tuple[str, int], Wrench]()
    single = list[Wrench]()
    for point, (at, body), (force, torque) in zip(points, placed, pushes, strict=True):
        key = point.agent, body
        wrench = Wrench(
            force_W=force, torque_W=torque, point=at, body=body, agent=point.agent
        )
        if key in axes:
            # points of one body share one transformation of their wrench
            before = whole.get(key, Wrench())
            moment = before.torque_W + torque + axes[key].apply(at).cross(force)
            whole[key] = replace(
                wrench,
                force_W=before.force_W + force,
                torque_W=moment,
                point=ZERO3,
            )
        else:
            single.append(wrench)
    return [*whole.values(), *single]


def _places(
    points: Sequence[ContactPoint], motion: PointMotion
) -> tuple[list[tuple[Vec3, int]], dict[tuple[str, int], Mat3]]:
    """Position (m, body axes) and body of each contact point, and axes of bodies on
    which forces are added up.

    These are rotations to world axes, by vehicle and body: of a base, and of a body
    that has several points.
    """
    placed = [point.place(motion.of(point.agent).vehicle) for point in points]
    bodies = [
        (point.agent, body) for point, (_, body) in zip(points, placed, strict=True)
    ]
    return placed, {
        (agent, body): body_axes(motion.of(agent), body)
        for agent, body in dict.fromkeys(bodies)
        # axes of a base are at hand; those of a link take work that two points share
        if body == BASE or bodies.count((agent, body)) > 1
    }


def body_axes(motion: PointMotion, body: int) -> Mat3:
    """Rotation matrix from the axes of a body to world axes."""
    if body == BASE:
        return motion.rotation
    return Mat3.columns(*(motion.to_world(axis, body) for axis in (E_X, E_Y, E_Z)))
