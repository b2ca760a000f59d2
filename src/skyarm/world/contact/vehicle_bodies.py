"""Bodies of vehicles that touch with their shapes (``[[collisions]]`` of a vehicle
file).

They touch surfaces of the world, movable bodies, other vehicles, and each other on
request.

A pair of bodies is looked at in two steps: balls around both tell if they can touch at
all; only then the places at which their shapes touch are computed
(:mod:`skyarm.world.contact.shape_pairs`), by code that all alike pairs share.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from functools import reduce
from itertools import combinations

from skyarm.algebra import ZERO3, ZERO3_DATA, Mat3, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import (
    absolute,
    divide,
    logical_or,
    maximum,
    minimum,
    sqrt,
    where,
)
from skyarm.compile.tracing.lower import compiled_once
from skyarm.dynamics.kinematics import every_rate
from skyarm.dynamics.point_motion import PointMotion
from skyarm.records.immutable import UNWRITTEN, field_if_any, immutable, positional
from skyarm.records.leaves import as_data
from skyarm.vehicle import BASE, Joint, Vehicle
from skyarm.vehicle.description import rpy_of
from skyarm.vehicle.vehicle_records import Collision, body_names
from skyarm.world.contact.carrier import AnyCarrier, CarriedFrame
from skyarm.world.contact.contact_point import body_axes
from skyarm.world.contact.grasp import Grasp
from skyarm.world.contact.gripper import Gripper
from skyarm.world.contact.material import LIGHTEST, RECOVERY, Material
from skyarm.world.contact.shape_pairs import PlacedShape, places
from skyarm.world.contact.surface import Surface

_TINY = 1e-24
"""Square under a root whose derivative at rest is 0 instead of NaN; least force (N) in
a quotient."""


@immutable
class VehicleBody:
    """Body of a vehicle that has shapes.

    Attributes:
        agent: name of the vehicle; empty for the only one. body: BASE or index of a
            link.
        name: "base" or the link's name, behind the vehicle's name and a dot if there
            are several.
        parent: body that carries it; -2 of the base.
        shapes: indices of its shapes among the vehicle's.
        holds: names of movable bodies that grasps at its frames hold; an empty one if a
            gripper is there, which may take any.
        mass: for which steps of its contacts are chosen, kg (:func:`mass_of`).
    """

    agent: str
    body: int
    name: str
    parent: int
    shapes: tuple[int, ...]
    holds: tuple[str, ...] = field_if_any(default=())
    mass: Scalar = field(
        default=LIGHTEST, compare=False, metadata={UNWRITTEN: LIGHTEST}
    )

    def frame(self, motion: PointMotion) -> CarriedFrame:
        """Pose and velocity of the body's axes."""
        own = motion.of(self.agent)
        turning = own.angular_velocity(self.body)
        return CarriedFrame(
            position=own.position(ZERO3, self.body),
            rotation=body_axes(own, self.body),
            velocity=own.velocity(ZERO3, self.body),
            turning=own.to_world(turning, self.body),
        )

    def parts(self, motion: PointMotion, material: Material) -> tuple[Part, ...]:
        """Shapes of the body in its axes."""
        every = motion.of(self.agent).vehicle.shapes
        return tuple(part_of_vehicle(every[i], material) for i in self.shapes)


@positional
class Part:
    """Shape of a body, with its pose in the body's axes."""

    shape: Surface
    rotation: Mat3
    position: Vec3

    def in_world(self, frame: CarriedFrame) -> PlacedShape:
        """The shape where its body is."""
        return PlacedShape(
            self.shape,
            frame.rotation @ self.rotation,
            frame.position + frame.rotation.apply(self.position),
        )

    @property
    def reach(self) -> Scalar:
        """Largest distance (m) of the shape from the origin of its body."""
        return self.position.smooth_norm() + self.shape.farthest


@positional
class Side:
    """One of two bodies that may touch: motion of its axes, and its shapes."""

    frame: CarriedFrame
    parts: tuple[Part, ...]


Record = tuple[Side, Side, Vec3, Scalar, Scalars, Scalar]
"""Two bodies, deflection of their bristle (m), longest step of the contact (s), time
(s) over whose way the penetration is a mean with largest damping (N s/m) of a place,
and least mass (kg) that they move."""


@positional
class BodyTouch:
    """Force and torque of two bodies on each other.

    Attributes:
        force: on the first, N, world axes. torque, back: torque of the force about the
            first body's origin, and of the opposite one about the other's, N m.
        normal: sum of normal forces, N. place: mean place of these, m, world axes.
        depth: largest penetration, m; apart at most minus the distance.
        speed: largest speed at which places move along each other, m/s.
        bristle_rate: of the deflection, m/s.
    """

    force: Vec3
    torque: Vec3
    back: Vec3
    normal: Scalar
    place: Vec3
    depth: Scalar
    speed: Scalar
    bristle_rate: Vec3


@positional
class BodyPair:
    """Two bodies that may touch: a body of a vehicle and a surface of the world, a
    movable body or another one.

    Attributes:
        name: names of both. body: number of the first among the bodies of vehicles.
        other: what the other is among: "surface", "carrier" or "body". index: its
            number.
    """

    name: str
    body: int
    other: str
    index: int


def bodies_of(
    vehicles: Mapping[str, Vehicle], holders: Sequence[Gripper | Grasp] = ()
) -> tuple[VehicleBody, ...]:
    """Bodies of vehicles that have shapes, by the vehicles' names, with what grippers
    and grasps may hold at them.
    """
    found = []
    for agent, vehicle in vehicles.items():
        names = body_names(vehicle)
        # -2: a base has no parent, and -1 is the base itself
        parents = [-2, *(link.parent for link in vehicle.moving)]
        links = {each.name: each.link for each in vehicle.frames}
        shapes = vehicle.shapes
        for body in range(BASE, len(vehicle.moving)):
            own = [i for i, e in enumerate(shapes) if e.link == body]
            if not own:
                continue
            several = f"{agent}." if len(vehicles) > 1 else ""
            found.append(
                VehicleBody(
                    agent=agent if len(vehicles) > 1 else "",
                    body=body,
                    name=several + names[body + 1],
                    parent=parents[body + 1],
                    shapes=tuple(own),
                    holds=tuple(
                        getattr(each, "body", "")
                        for each in holders
                        if each.agent in ("", agent)
                        and links.get(each.frame or vehicle.end_effector) == body
                    ),
                    # of a link as of a contact point on it: the lightest for which
                    # steps are chosen
                    mass=mass_of(vehicle) if body == BASE else LIGHTEST,
                )
            )
    return tuple(found)


HALF = 2.0
"""Mass for which steps are chosen over the least that they bear."""


def mass_of(vehicle: Vehicle) -> Scalar:
    """Mass (kg) for which steps of contacts of a base's shapes are chosen.

    It is twice the effective mass 1 / (1 / m + r^2 / I) of their farthest place, where
    I is the smaller moment of roll and pitch, and at most ``LIGHTEST``. Links only add
    to it.
    """
    base = vehicle.base
    shapes = [part_of_vehicle(e, Material()) for e in vehicle.shapes if e.link == BASE]
    reach = reduce(maximum, [each.reach for each in shapes])
    moment = minimum(base.inertia.xx, base.inertia.yy)
    mobility = divide(1.0, base.mass) + divide(reach * reach, moment)
    mass = minimum(divide(HALF, mobility), LIGHTEST)
    # what links add to a base without inertia is not known
    return where(mass > 0.0, mass, LIGHTEST)


def pairs_of(
    bodies: Sequence[VehicleBody],
    surfaces: Sequence[Surface],
    carriers: Sequence[AnyCarrier],
    *,
    self_collision: bool,
    ignore: Sequence[str],
) -> tuple[BodyPair, ...]:
    """Pairs of bodies that may touch.

    A body may touch each surface and movable body, the bodies of other vehicles, and
    those of its own vehicle that are no neighbours. One with the frame of a gripper
    does not touch what the gripper may take, nor one with that of a grasp the grasp's
    body: the grip's own forces act between them.
    """
    others = [("surface", i, each.name) for i, each in enumerate(surfaces)]
    others += [("carrier", i, each.name) for i, each in enumerate(carriers)]
    pairs = [
        BodyPair(f"{body.name}/{name}", i, kind, index)
        for kind, index, name in others
        for i, body in enumerate(bodies)
        if kind == "surface" or not {"", name} & {*body.holds}
    ]
    for (i, a), (j, b) in combinations(enumerate(bodies), 2):
        neighbours = a.body == b.parent or b.body == a.parent
        if a.agent != b.agent or (self_collision and not neighbours):
            pairs.append(BodyPair(f"{a.name}/{b.name}", i, "body", j))
    return tuple(each for each in pairs if each.name not in ignore)


def speed_of(frame: CarriedFrame, reach: Scalar) -> Scalar:
    """Largest speed (m/s) of any point within ``reach`` (m) of a body's origin."""
    turning = frame.turning.smooth_norm()
    return frame.velocity.smooth_norm() + turning * reach


def bare(shape: Surface | Collision, material: Material) -> Surface:
    """Shape in its own axes, under a name that all have: equal ones share code."""
    return Surface(
        name="shape",
        shape=shape.shape,
        size=shape.size,
        vertices=shape.vertices,
        heights=getattr(shape, "heights", ()),
        faces=shape.faces,
        material=material,
    )


def surface_of(each: Collision) -> Surface:
    """Shape of a vehicle as a surface in the axes of its body."""
    angles = Vec3(*rpy_of(each.rotation))
    return replace(bare(each, Material()), position=each.position, angles=angles)


def part_of_vehicle(each: Collision, material: Material) -> Part:
    """Shape of a vehicle as a part of its body, of a material."""
    return Part(bare(each, material), each.rotation, each.position)


def part_of(surface: Surface) -> Part:
    """Surface of a movable body as a part of it."""
    return Part(bare(surface, surface.material), surface.rotation, surface.position)


def fixed_side(surface: Surface, clock: Scalar) -> Side:
    """Surface of the world at a time (s) as a body."""
    place, velocity = surface.place(clock)
    return Side(
        CarriedFrame(
            position=place, rotation=surface.rotation, velocity=velocity, turning=ZERO3
        ),
        (Part(bare(surface, surface.material), Mat3.identity(), ZERO3),),
    )


def touch_of_bodies(record: Record) -> BodyTouch:
    """Touch of two bodies; the shapes of the second have the material.

    It is computed where balls around them meet.
    """
    a, b, bristle, step, mean, mass = record
    reach = reduce(maximum, [each.reach for each in a.parts])
    gap, speed = gap_of_ball(a.frame.position, reach, b)
    speed = speed_of(a.frame, reach) + speed
    # equal code for pairs of equal shapes: the record's structure tells them apart
    kinds = tuple(_kind(each) for side in record[:2] for each in side.parts)
    total = compiled_once(
        ("bodies", kinds, len(a.parts)),
        _press_of_shapes,
        (a, b, mean, speed * speed),
        only=(gap < 0.0, replace(NO_PRESS, depth=-gap, square=speed * speed)),
    )
    apart = no_touch(bristle, total.depth, sqrt(total.square + _TINY))
    material = b.parts[0].shape.material
    return compiled_once(
        "friction",
        _with_friction,
        (total, a.frame, b.frame, material, bristle, step, mass),
        any_numbers=True,
        only=(logical_or(total.depth > 0.0, total.force > 0.0), apart),
    )


def _kind(part: Part) -> tuple[object, ...]:
    """Key of code for a shape: its kind and the faces of a hull."""
    return part.shape.shape, part.shape.faces


def no_touch(bristle: Vec3, depth: Scalar, speed: Scalar) -> BodyTouch:
    """Touch of two bodies that are apart: their bristle stands up."""
    return BodyTouch(
        force=ZERO3_DATA,
        torque=ZERO3_DATA,
        back=ZERO3_DATA,
        normal=0.0,
        place=ZERO3_DATA,
        depth=depth,
        speed=speed,
        bristle_rate=bristle * -RECOVERY,
    )


def gap_of_ball(centre: Vec3, reach: Scalar, side: Side) -> tuple[Scalar, Scalar]:
    """Distance (m) of a ball from a body, or from the ball around that one, and the
    largest speed (m/s) of the body's points.
    """
    shapes = [each.shape.shape for each in side.parts]
    theirs: Scalar = 0.0
    if shapes[0] != "plane":
        theirs = reduce(maximum, [each.reach for each in side.parts])
    speed = speed_of(side.frame, theirs)
    if len(shapes) == 1 and shapes[0] != "hull":
        return -side.parts[0].in_world(side.frame).skin(centre, reach)[0], speed
    way = side.frame.position - centre
    return way.smooth_norm() - reach - theirs, speed


def whole_ball(motion: PointMotion) -> tuple[Vec3, Scalar, Scalar]:
    """Ball around the shapes of a vehicle in any pose of its joints.

    Returns:
        Centre (m, world axes), radius (m), and largest speed (m/s) of a point in it.
    """
    vehicle, state = motion.vehicle, motion.state
    far = dict[int, Scalar]({BASE: 0.0})
    slides = [_farthest(link.joint) for link in vehicle.links]
    # a follower has no limits of its own: it goes where its leader takes it
    slides += [
        absolute(each.ratio) * _farthest(vehicle.links[each.leader].joint)
        + absolute(each.offset)
        for each in vehicle.followers
    ]
    for i, (link, slide) in enumerate(zip(vehicle.moving, slides, strict=True)):
        joint = link.joint
        far[i] = far[link.parent] + joint.position.smooth_norm()
        if joint.kind == "prismatic":
            far[i] = far[i] + slide
    reach: Scalar = 0.0
    for each in vehicle.shapes:
        part = part_of_vehicle(each, Material())
        reach = maximum(reach, far[each.link] + part.reach)
    speed = state.velocity.smooth_norm()
    speed = speed + reach * state.rate.smooth_norm()
    rates = every_rate(vehicle, state.joint_rates)
    for link, rate in zip(vehicle.moving, rates, strict=True):
        lever = 1.0 if link.joint.kind == "prismatic" else reach
        speed = speed + absolute(rate) * lever
    return state.position, reach, speed


INTO_STOP = 0.02
"""Way (m) that a joint may go beyond its limit: twice that of a strong drive on a light
link (docs/vehicle_files.md)."""


def _farthest(joint: Joint) -> Scalar:
    """Largest position (rad or m) of a joint either way from zero."""
    return maximum(absolute(joint.lower), absolute(joint.upper)) + INTO_STOP


@positional
class Press:
    """Normal forces between two bodies, summed over the places at which they touch.

    Attributes:
        force: sum, N. moment: sum of force times place, N m; second: of force times
            squared distance from the first body's origin, N m^2.
        push: sum of the force vectors on the first, N, world axes. torque: about the
            first body's origin, N m.
        depth: largest penetration, m. square: of the largest speed of the places
            against each other, and of any points where shapes do not touch, m^2/s^2.
    """

    force: Scalar
    moment: Vec3
    second: Scalar
    push: Vec3
    torque: Vec3
    depth: Scalar
    square: Scalar


NO_PRESS = Press(0.0, ZERO3_DATA, 0.0, ZERO3_DATA, ZERO3_DATA, -1e9, 0.0)
"""No forces of shapes far away."""

Shapes = tuple[Press, Part, Part, CarriedFrame, CarriedFrame, Scalars, Scalar]
"""Sum over the shapes before, two shapes, motions of their bodies, time (s) over whose
way the penetration is a mean with largest damping (N s/m) of a place, and square
(m^2/s^2) of the bodies' largest speed."""


def _press(record: Shapes) -> Press:
    """Normal forces between two shapes, added to those before."""
    total, one, other, a, b, mean, fastest = record
    force, second = total.force, total.second
    moment, push, torque = total.moment, total.push, total.torque
    depth: Scalar = -math.inf
    square: Scalar = 0.0
    for place, deep, normal in places(one.in_world(a), other.in_world(b)):
        slip = a.velocity_at(place) - b.velocity_at(place)
        pressing = other.shape.material.normal_force(deep, -slip.dot(normal), *mean)
        lever = place - a.position
        vector = normal * pressing
        force, push = force + pressing, push + vector
        torque = torque + lever.cross(vector)
        moment = moment + place * pressing
        second = second + lever.dot(lever) * pressing
        depth = maximum(depth, deep)
        square = maximum(square, slip.dot(slip))
    # a body that turns may arrive with another place than the nearest
    square = where(depth > 0.0, square, fastest)
    depth, square = maximum(depth, total.depth), maximum(square, total.square)
    return Press(force, moment, second, push, torque, depth, square)


def _press_of_shapes(record: tuple[Side, Side, Scalars, Scalar]) -> Press:
    """Normal forces of all shapes of two bodies.

    Of shapes whose balls are apart only the distance of these counts. With the bodies
    come the time (s) over whose way the penetration is a mean, the largest damping
    (N s/m) of a place, and the square (m^2/s^2) of their largest speed.
    """
    a, b, mean, fastest = record
    total = NO_PRESS
    # zeros of a rotation save work, those of a place would only make more code
    other = replace(b.frame, position=as_data(b.frame.position))
    for one in a.parts:
        centre = a.frame.position + a.frame.rotation.apply(one.position)
        for part in b.parts:
            gap, _ = gap_of_ball(centre, one.shape.farthest, Side(b.frame, (part,)))
            apart = replace(
                total,
                depth=maximum(total.depth, -gap),
                square=maximum(total.square, fastest),
            )
            total = compiled_once(
                ("shapes", _kind(one), _kind(part)),
                _press,
                (
                    total,
                    replace(one, position=as_data(one.position)),
                    part,
                    a.frame,
                    other,
                    mean,
                    fastest,
                ),
                any_numbers=True,
                only=(gap < 0.0, apart),
            )
    return total


Pressed = tuple[Press, CarriedFrame, CarriedFrame, Material, Vec3, Scalar, Scalar]
"""Normal forces of two bodies, their motions, material, deflection of their bristle
(m), longest step of the contact (s), and least mass (kg) that they move."""


def _with_friction(record: Pressed) -> BodyTouch:
    """Touch of two bodies by the normal forces of their shapes.

    Friction is that of the whole patch: one bristle bends along the mean plane by the
    slip at the mean place, and along its normal by the spin times the root mean square
    distance R of the places from there, so that one cone holds force and moment: an
    ellipsoid as limit surface.

    Source: Howe, Cutkosky 1996, Practical force-motion models for sliding
    manipulation, eqs. (7) to (9).
    """
    total, a, b, material, bristle, step, mass = record
    normal = total.force
    push = total.push
    share = divide(1.0, normal + _TINY)
    middle = total.moment * share
    lever = middle - a.position
    spread = total.second * share - lever.dot(lever)
    radius = sqrt(maximum(spread, 0.0) + _TINY)
    axis = push * divide(1.0, push.smooth_norm())
    slip = a.velocity_at(middle) - b.velocity_at(middle)
    spin = (a.turning - b.turning).dot(axis)
    sliding = slip + axis * (spin * radius - axis.dot(slip))
    friction = material.friction_force(
        bristle, material.bending_rate(bristle, sliding), normal, mass
    )
    twisting = axis.dot(friction)
    drag = friction - axis * twisting
    force = push + drag
    torque = total.torque + lever.cross(drag) + axis * (twisting * radius)
    return as_data(
        BodyTouch(
            force=force,
            torque=torque,
            back=-torque - (a.position - b.position).cross(force),
            normal=normal,
            place=middle,
            depth=total.depth,
            speed=sqrt(total.square + _TINY),
            bristle_rate=material.bristle_rate(bristle, sliding, total.depth, step),
        )
    )
