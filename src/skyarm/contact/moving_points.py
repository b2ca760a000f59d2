"""Where points of a vehicle are, how they move, and what pushes on them together does to its bodies.

Points of the base, and several points of one link, share the motion of their body and push it with one wrench at its
origin; a point that is alone on its link is reached by its own Jacobian.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skyarm.algebra import E_X, E_Y, E_Z, ZERO3, Mat3, Vec3
from skyarm.contact.contact_point import ContactPoint
from skyarm.dynamics.point_motion import PointMotion
from skyarm.environment.component import Wrench
from skyarm.vehicle.linkage import BASE

Moving = tuple[Vec3, Vec3, Vec3]
"""Position (m), velocity (m/s) and angular velocity (rad/s; of a ball only) of a point, world axes."""


def moving_points(points: Sequence[ContactPoint], motion: PointMotion) -> list[Moving]:
    """Motion of every point."""
    places, shared = _places(points, motion)
    axes = {body: _axes(motion, body) for body in shared}
    found = list[Moving]()
    for point, (at, body) in zip(points, places, strict=True):
        ball = not (type(point.radius) is int and point.radius == 0)
        if body in shared:
            lever, turning = axes[body].apply(at), motion.turned(motion.angular_velocity(body), body)
            position, velocity = motion.position(ZERO3, body), motion.velocity(ZERO3, body)
            found.append((position + lever, velocity + turning.cross(lever), turning if ball else ZERO3))
        else:
            turning = motion.turned(motion.angular_velocity(body), body) if ball else ZERO3
            found.append((motion.position(at, body), motion.velocity(at, body), turning))
    return found


def wrenches_on(
    points: Sequence[ContactPoint], motion: PointMotion, pushes: Sequence[tuple[Vec3, Vec3]]
) -> list[Wrench]:
    """Wrenches on the bodies of a force (N) and a torque (N m) at every point, world axes."""
    places, shared = _places(points, motion)
    axes, whole, found = {body: _axes(motion, body) for body in shared}, dict[int, Wrench](), list[Wrench]()
    for (at, body), (force, torque) in zip(places, pushes, strict=True):
        if body in shared:
            sum_of = whole.get(body, Wrench(body=body))
            moment: Any = sum_of.torque_W + torque + axes[body].apply(at).cross(force)
            whole[body] = Wrench(force_W=sum_of.force_W + force, torque_W=moment, body=body)
        else:
            found.append(Wrench(force_W=force, torque_W=torque, point=at, body=body))
    return [*whole.values(), *found]


def _places(points: Sequence[ContactPoint], motion: PointMotion) -> tuple[list[tuple[Vec3, int]], list[int]]:
    """Place and body of every point, and the bodies whose points are taken together."""
    places = [point.place(motion.vehicle) for point in points]
    bodies = [body for _, body in places]
    return places, [body for body in dict.fromkeys(bodies) if body == BASE or bodies.count(body) > 1]


def _axes(motion: PointMotion, body: int) -> Mat3:
    """Axes of a body to world axes."""
    if body == BASE:
        return motion.rotation
    return Mat3.columns(*(motion.turned(axis, body) for axis in (E_X, E_Y, E_Z)))
