"""Coordinate axes of the links in recursive dynamics, chosen to save rotations (working
axes).

A recursion may express a link in any axes at its origin. A hinge leaves its own axis
where it is, so the link can be held in the axes that it has at joint angle zero. Hinges
with one common direction then share their axes: nothing that passes between such links
is rotated, only their mass distributions are, by the sum of the angles. The last link
of an arm is held so, too: a rigid body is cheaper to turn than what the recursions
carry inwards. Every other link is held in its own axes.

Source: absolute angles of parallel hinges, as Craig 2005, section 3.6.
"""

from __future__ import annotations

from collections.abc import Sequence

from skyarm.algebra import Mat3, Scalar, SpatialInertia, axis_rotation
from skyarm.algebra.scalars import add
from skyarm.dynamics.kinematics import Pose, parallel
from skyarm.records.immutable import positional
from skyarm.vehicle import BASE, Body, Vehicle

_SAME = Mat3.identity()


@positional
class LinkInAxes:
    """Pose and inertia of a link in coordinate axes chosen to save rotations (working
    axes).

    Attributes:
        place: pose of the working axes at the link's origin, in the parent's working
            axes.
        inertia: spatial inertia of the body, about the link's origin.
    """

    place: Pose
    inertia: SpatialInertia


def spatial_inertia(body: Body) -> SpatialInertia:
    """Spatial inertia of a body about its link's origin, link axes."""
    return SpatialInertia.of_body(body.mass, body.com, body.inertia)


def members(vehicle: Vehicle, joints: Sequence[Scalar]) -> list[LinkInAxes]:
    """Pose and inertia of all links, in coordinate axes chosen to save rotations
    (working axes).
    """
    links = vehicle.links
    follows = [
        link.parent != BASE and parallel(links[link.parent].joint, link.joint)
        for link in links
    ]
    leads = {
        link.parent for link, follower in zip(links, follows, strict=True) if follower
    }
    inner = {link.parent for link in links}
    in_axes: list[LinkInAxes] = []
    angles: list[Scalar] = []
    # from a link's own axes to its working axes
    turns: list[Mat3] = []
    for i, (link, q) in enumerate(zip(links, joints, strict=True)):
        joint = link.joint
        before = _SAME if link.parent == BASE else turns[link.parent]
        point = joint.position
        angle = q
        R = before @ joint.rotation
        if follows[i]:
            angle = add(angles[link.parent], q)
            R = _SAME
        turn = _SAME
        if not joint.turns:
            point = point + joint.rotation.apply(joint.axis * q)
        elif i in leads or i not in inner:
            # turning a rigid body once is cheaper than turning what passes through the
            # joint
            turn = axis_rotation(joint.axis, angle)
        else:
            R = R @ axis_rotation(joint.axis, angle)
        in_axes.append(
            LinkInAxes(
                Pose(R, before.apply(point)), spatial_inertia(link.body).rotate(turn)
            )
        )
        angles.append(angle)
        turns.append(turn)
    return in_axes
