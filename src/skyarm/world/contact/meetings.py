"""Contact detection: penetration and contact force of points, corners and edges at
surfaces and objects.

Every point of the vehicle may meet every surface, and so may every spot of a movable
body that is not its own; corners of surfaces meet objects, whose own corners may be
beside them, and edges of boxes those of others (:mod:`skyarm.world.contact.box_edges`).
The order of the pairs is that of their bristles in a memory: points by surface, spots
by body and surface, corners and edges by body and surface.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import reduce
from typing import TypeVar

from skyarm.algebra import ZERO3, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import (
    divide,
    logical_not,
    logical_or,
    maximum,
    minimum,
    neg,
    sqrt,
    where,
)
from skyarm.compile.tracing.lower import compute_where
from skyarm.dynamics.point_motion import PointMotion
from skyarm.records.immutable import immutable, positional
from skyarm.records.leaves import Tree
from skyarm.world.component import Force
from skyarm.world.contact.box_edges import EDGE_PAIRS, edge_touches
from skyarm.world.contact.carrier import NOBODY, AnyCarrier, CarriedFrame, reduced_mass
from skyarm.world.contact.contact_memory import ContactMemory
from skyarm.world.contact.contact_point import (
    ContactPoint,
    Moving,
    Touch,
    moving_points,
    touch_of,
)
from skyarm.world.contact.free_object import FreeObject
from skyarm.world.contact.material import LIGHTEST, LONGEST, Material
from skyarm.world.contact.mechanism import Mechanism
from skyarm.world.contact.shape_pairs import (
    HOLLOW,
    opposite,
    places,
    round_count,
    spot_count,
    touching,
)
from skyarm.world.contact.surface import Surface
from skyarm.world.contact.vehicle_bodies import (
    BodyPair,
    BodyTouch,
    Record,
    Side,
    VehicleBody,
    fixed_side,
    gap_of_ball,
    pairs_of,
    part_of,
    touch_of_bodies,
    whole_ball,
)

NEAR, SWIFT = 0.005, 400.0
"""Least distance (m) between a point and a surface during longer steps, and largest
acceleration (m/s^2) of the point meanwhile; both give the same distance in 5 ms."""

DAMPED = 0.25
"""Largest product of damping and step over the mass for which steps are chosen, of a
body lighter than ``LIGHTEST``: half over the mass that it may have. With 2 half of a
push throws it back, and the whole push finds no force; shapes may touch at four places
at once."""

Result = TypeVar("Result")

EDGE = -1
"""Index of a meeting of two edges, or with a corner of a surface, in place of that of a
spot."""

OTHER = -2
"""Number that stands for no weight, in place of that of a body."""

LIGHT = 1e-12
"""Force (N) below which that between two bodies has no direction."""


@immutable
class Meeting:
    """Contact state of one surface with one point of the vehicle or of a movable body.

    Attributes:
        surface: name of the surface. of: number of the carrier of the surface, or
            ``NOBODY`` for the world.
        by: number of the carrier of the spot, or ``NOBODY`` for the vehicle.
        index: number of its spot, or point; ``EDGE`` of its edges.
        touch: contact force and bristle. place: place of the contact, m, world axes.
    """

    surface: str
    of: int
    by: int
    index: int
    touch: Touch
    place: Vec3


@positional
class _Place:
    """Point or ball that may touch a surface: centre, velocity, angular velocity,
    radius (m) and mass (kg).
    """

    position: Vec3
    velocity: Vec3
    turning: Vec3
    radius: Scalar
    mass: Scalar


def _depth(
    surface: Surface,
    frame: CarriedFrame | None,
    place: Vec3,
    radius: Scalar,
    clock: Scalar,
) -> tuple[Scalar, Vec3]:
    """Penetration depth (m) and outward normal of a ball at a surface of the world or
    of a movable body.
    """
    return (
        surface.depth(place, radius, clock)
        if frame is None
        else frame.depth(surface, place, radius)
    )


def meetings_of(
    contact: TouchingBodies,
    memories: Sequence[Tree],
    moving: Sequence[Moving],
    clock: Scalar,
    bristles: Sequence[Vec3],
    step: Scalar | None,
    mean: Scalar | None = None,
) -> list[Meeting]:
    """Contact state of every surface with every point of the vehicle and of other
    movable bodies.

    Args:
        contact: surfaces, points and movable bodies.
        memories: states of the movable bodies.
        moving: position (m), velocity (m/s), angular velocity (rad/s) of the vehicle's
            points, world axes.
        clock: time of the world's surfaces, s.
        bristles: deflections of the pairs' bristles, m.
        step: longest integration step of the whole contact, s; None where no pair may
            touch.
        mean: time (s) for the vehicle's points on the world's surfaces, as in
            :func:`touch_of`.
    """
    frames = [
        carrier.frame(memory)
        for carrier, memory in zip(contact.carriers, memories, strict=True)
    ]
    masses = [1.0 / carrier.mobility for carrier in contact.carriers]
    # where no pair may touch no force follows from it: any number will do
    longest = LONGEST if step is None else step
    deflections = iter(bristles)
    meetings = list[Meeting]()

    def meet(
        surface: Surface,
        of: int,
        by: int,
        index: int,
        at: _Place,
        depth: Scalar,
        normal: Vec3,
    ) -> None:
        frame = None if of == NOBODY else frames[of]
        # where it touches, seen from its middle
        spot = normal * neg(at.radius)
        place = at.position + spot
        under = surface.place(clock)[1] if frame is None else frame.velocity_at(place)
        slip = at.velocity + at.turning.cross(spot) - under
        mass = at.mass if frame is None else reduced_mass(masses[of], at.mass)
        over = mean if of == by == NOBODY else longest
        own = touch_of(
            surface.material,
            depth,
            normal,
            spot,
            slip,
            next(deflections),
            longest,
            mass,
            mean=over,
        )
        meetings.append(
            Meeting(
                surface=surface.name, of=of, by=by, index=index, touch=own, place=place
            )
        )

    def touch(surface: Surface, of: int, by: int, index: int, at: _Place) -> None:
        frame = None if of == NOBODY else frames[of]
        depth, normal = _depth(surface, frame, at.position, at.radius, clock)
        meet(surface, of, by, index, at, depth, normal)

    every = contact.every_surface
    points = [
        _Place(position, velocity, turning, point.radius, LIGHTEST)
        for point, (position, velocity, turning) in zip(
            contact.points, moving, strict=True
        )
    ]
    for of, surface in every:
        for index, at in enumerate(points):
            touch(surface, of, NOBODY, index, at)
    pairs = [*_pairs(every, contact.carriers)]
    for each in pairs:
        surface, of, own = each.surface, each.of, frames[each.by]

        def toward(
            place: Vec3,
            # bound as defaults, or the function would see the last turn of the loop
            surface: Surface = surface,
            under: CarriedFrame | None = None if of == NOBODY else frames[of],
        ) -> Vec3:
            return _depth(surface, under, place, 0, clock)[1]

        spots = contact.carriers[each.by].spots(own, toward) if each.spots else ()
        for index, (place, radius) in enumerate(spots):
            mass = masses[each.by]
            at = _Place(place, own.velocity_at(place), own.turning, radius, mass)
            touch(surface, of, each.by, index, at)
    for each in pairs:
        surface, own = each.surface, frames[each.by]
        side = fixed_side(surface, clock)
        if each.of != NOBODY:
            side = Side(frames[each.of], (part_of(surface),))
        other = side.parts[0].in_world(side.frame)
        it = part_of(contact.carriers[each.by].surfaces[0]).in_world(own)
        found = places(it, other) if each.whole else []
        if each.corners:
            found += opposite(touching(other, it))
        if each.edges:
            found += edge_touches(it.box, other.box)
        for place, depth, normal in found:
            speed, mass = own.velocity_at(place), masses[each.by]
            at = _Place(place, speed, own.turning, 0, mass)
            meet(surface, each.of, each.by, EDGE, at, depth, normal)
    return meetings


@positional
class _CandidatePair:
    """Object and surface that may touch, and the places at which they do.

    Attributes:
        by: number of the object. of: of the carrier of the surface, or ``NOBODY``.
        surface: the surface. spots: at spots of the object. corners: at those of the
            surface. edges: of two boxes. whole: wherever their shapes touch.
    """

    by: int
    of: int
    surface: Surface
    spots: bool
    corners: bool
    edges: bool
    whole: bool


def _pairs(
    every: Sequence[tuple[int, Surface]], carriers: Sequence[AnyCarrier]
) -> Iterator[_CandidatePair]:
    """Pairs of an object and a surface."""
    for by, carrier in enumerate(carriers):
        for of, surface in every:
            if of == by or not carrier.spot_count:
                continue
            shape = carrier.surfaces[0].shape
            solid = surface.shape not in HOLLOW
            # two objects come twice, once as each other's surface
            twice = of != NOBODY and carriers[of].spot_count > 0
            once = of < by or not twice
            # corners and balls of both would find the same place twice
            ball = "sphere" in (shape, surface.shape) and (twice or shape != "sphere")
            whole = solid and (ball or "capsule" in (shape, surface.shape))
            yield _CandidatePair(
                by,
                of,
                surface,
                spots=not whole,
                corners=solid and not (whole or twice or shape == "sphere"),
                edges=shape == surface.shape == "box" and once,
                whole=whole and once,
            )


def misses(touch: Touch, seconds: Scalar) -> Scalar:
    """True if a point is too far from a surface to reach it within ``seconds``, even
    under a large acceleration.
    """
    return too_far(touch.depth, touch.slip.norm(), seconds)


def too_far(depth: Scalar, speed: Scalar, seconds: Scalar) -> Scalar:
    """True if what is apart by minus a depth (m) and has a speed (m/s) does not touch
    within ``seconds``.
    """
    # the way that the largest acceleration makes in this time
    margin = maximum(NEAR, 0.5 * SWIFT * seconds * seconds)
    far: Scalar = depth + speed * seconds < -margin
    return far


class TouchingBodies(Force[ContactMemory]):
    """Base class of the contact model: surfaces, contact points and movable bodies, and
    how they touch each other.
    """

    __slots__ = ()

    surfaces: tuple[Surface, ...]
    points: tuple[ContactPoint, ...]
    objects: tuple[FreeObject, ...]
    mechanisms: tuple[Mechanism, ...]
    vehicle_bodies: tuple[VehicleBody, ...]
    self_collision: bool
    ignore: tuple[str, ...]
    vehicle_material: Material

    @property
    def carriers(self) -> tuple[AnyCarrier, ...]:
        """All movable bodies with contact surfaces: free objects, then mechanisms."""
        return (*self.objects, *self.mechanisms)

    @property
    def every_surface(self) -> tuple[tuple[int, Surface], ...]:
        """All contact surfaces, each with the index of its movable body, or ``NOBODY``
        for a surface of the world.
        """
        carried = (
            (of, each)
            for of, carrier in enumerate(self.carriers)
            for each in carrier.surfaces
        )
        return (*((NOBODY, each) for each in self.surfaces), *carried)

    @property
    def logged_pairs(self) -> int:
        """Number of surface-point pairs whose contact forces are logged."""
        return len(self.every_surface) * len(self.points)

    @property
    def meeting_count(self) -> int:
        """Number of all contact pairs of surfaces with points of the vehicle and of
        movable bodies.
        """
        count = self.logged_pairs
        for each in _pairs(self.every_surface, self.carriers):
            shape = self.carriers[each.by].surfaces[0].shape
            count += each.spots * self.carriers[each.by].spot_count
            count += each.corners * spot_count(each.surface)
            count += each.edges * EDGE_PAIRS
            count += each.whole * round_count(shape, each.surface.shape)
        return count

    @property
    def bristle_count(self) -> int:
        """Number of bristles: one of each contact pair, then of each pair of bodies."""
        return self.meeting_count + len(self.body_pairs)

    @property
    def still(self) -> tuple[Surface, ...]:
        """Surfaces of the world that do not move during the flight."""
        return tuple(surface for surface in self.surfaces if not surface.moves)

    def meetings(self, memory: ContactMemory, motion: PointMotion) -> list[Meeting]:
        """Contact state of every contact pair for the vehicle's current motion."""
        step = self.largest_step if motion.step is None else motion.step
        return meetings_of(
            self,
            memory.carried,
            moving_points(self.points, motion),
            memory.time,
            memory.bristles,
            step,
            motion.step,
        )

    def on_points(self, memory: ContactMemory, motion: PointMotion) -> Sequence[Touch]:
        """Contact states of all pairs of a surface and a contact point of the vehicle,
        ordered by surface.
        """
        return [
            each.touch for each in self.meetings(memory, motion)[: self.logged_pairs]
        ]

    @property
    def body_pairs(self) -> tuple[BodyPair, ...]:
        """Pairs of a vehicle's body that has shapes with what it may touch."""
        return pairs_of(
            self.vehicle_bodies,
            self.surfaces,
            self.carriers,
            self_collision=self.self_collision,
            ignore=self.ignore,
        )

    def _others(self, memory: ContactMemory) -> tuple[list[Side], list[Side]]:
        """Surfaces of the world, and movable bodies, as sides of a touch."""
        fixed = [fixed_side(each, memory.time) for each in self.surfaces]
        carried = [
            Side(each.frame(body), tuple(map(part_of, each.surfaces)))
            for each, body in zip(self.carriers, memory.carried, strict=True)
        ]
        return fixed, carried

    def body_records(
        self, memory: ContactMemory, motion: PointMotion
    ) -> list[tuple[BodyPair, Record]]:
        """Each pair of bodies with motions, shapes and bristle of both."""
        pairs = self.body_pairs
        if not pairs:
            return []
        longest = self.largest_step if motion.step is None else motion.step
        step = LONGEST if longest is None else longest
        sides = [
            Side(each.frame(motion), each.parts(motion, self.vehicle_material))
            for each in self.vehicle_bodies
        ]
        fixed, carried = self._others(memory)
        bristles = memory.bristles[self.meeting_count :]
        records = list[tuple[BodyPair, Record]]()
        for pair, bristle in zip(pairs, bristles, strict=True):
            mass = self.vehicle_bodies[pair.body].mass
            if pair.other == "body":
                beside = self.vehicle_bodies[pair.index].mass
                light = minimum(mass, beside) < LIGHTEST
                mass = where(light, reduced_mass(mass, beside), LIGHTEST)
            # 1e12 N s/m is no bound: the steps of other bodies bear their damping
            most = where(mass < LIGHTEST, divide(mass * DAMPED, step), 1e12)
            mean: Scalar = step
            if pair.other == "surface":
                other = fixed[pair.index]
                # as of a contact point (:func:`touch_of`)
                if motion.step is None:
                    mean = self.surfaces[pair.index].material.largest_step
            elif pair.other == "carrier":
                other = carried[pair.index]
                mass = reduced_mass(1.0 / self.carriers[pair.index].mobility, mass)
            else:
                other = sides[pair.index]
            record = sides[pair.body], other, bristle, step, (mean, most), mass
            records.append((pair, record))
        return records

    def places_at_rest(
        self, memory: ContactMemory, motion: PointMotion
    ) -> Iterator[Meeting]:
        """Contact state of each place at which shapes of vehicles at rest touch, of
        those that press on a surface.
        """
        for pair, record in self.body_records(memory, motion):
            # what is far away has no places to look for
            if pair.other != "surface" or not touch_of_bodies(record).normal > 0.0:
                continue
            a, b, _, step, (mean, _), mass = record
            surface = self.surfaces[pair.index]
            for one in a.parts:
                for place, depth, normal in places(
                    one.in_world(a.frame), b.parts[0].in_world(b.frame)
                ):
                    touch = touch_of(
                        surface.material,
                        depth,
                        normal,
                        ZERO3,
                        ZERO3,
                        ZERO3,
                        step,
                        mass,
                        mean=mean,
                    )
                    yield Meeting(
                        surface=surface.name,
                        of=NOBODY,
                        by=NOBODY,
                        index=pair.index,
                        touch=touch,
                        place=place,
                    )

    def bodies_at_rest(
        self, memory: ContactMemory, motion: PointMotion
    ) -> Iterator[Meeting]:
        """Contact state of each pair of bodies as one place, by the vehicle where the
        other is a surface.
        """
        for pair, record in self.body_records(memory, motion):
            touch = touch_of_bodies(record)
            size = sqrt(touch.force.dot(touch.force) + LIGHT * LIGHT)
            fixed = pair.other == "surface"
            yield Meeting(
                surface=self.surfaces[pair.index].name if fixed else pair.name,
                of=pair.index,
                by=NOBODY if fixed else OTHER,
                index=pair.body,
                touch=Touch(
                    depth=touch.depth,
                    slip=ZERO3,
                    normal=size,
                    axis=touch.force * divide(1.0, size),
                    friction=ZERO3,
                    bristle_rate=ZERO3,
                    spot=ZERO3,
                ),
                place=touch.place,
            )

    def with_touches(
        self,
        memory: ContactMemory,
        motion: PointMotion,
        use: Callable[[list[BodyTouch]], Result],
        other: Result,
        seconds: Scalar = 0.0,
    ) -> Result:
        """Compute something from the touches of all pairs of bodies, in their order.

        Args:
            memory: internal state.
            motion: of all vehicles.
            use: makes the result of the touches; few numbers, since these are moved in
                every period.
            other: result where no ball around a whole vehicle may meet anything within
                ``seconds``, and where there are no pairs.
            seconds: s.
        """
        if not self.body_pairs:
            return other
        near = self.bodies_near(memory, motion, seconds)
        places = [(m.state.position, m.state.joints) for m in motion.agents.values()]

        def touches(moved: Sequence[tuple[Vec3, Scalars]]) -> Result:
            there = motion.with_places(moved)
            records = self.body_records(memory, there)
            return use([touch_of_bodies(record) for _, record in records])

        return compute_where(near, touches, tuple(places), other)

    def bodies_near(
        self, memory: ContactMemory, motion: PointMotion, seconds: Scalar = 0.0
    ) -> Scalar:
        """True if the ball around a vehicle with shapes may meet anything within
        ``seconds``.
        """
        own = {each.agent for each in self.vehicle_bodies}
        # sorted: a set has no order, and programs must not differ by it
        balls = [whole_ball(motion.of(agent)) for agent in sorted(own)]
        fixed, carried = self._others(memory)
        # bodies of one vehicle are always near each other
        near: list[Scalar] = [self.self_collision and bool(own)]
        for i, (centre, reach, speed) in enumerate(balls):
            for side in (*fixed, *carried):
                gap, other = gap_of_ball(centre, reach, side)
                near.append(logical_not(too_far(-gap, speed + other, seconds)))
            for there, theirs, rate in balls[:i]:
                way = there - centre
                gap = way.norm() - reach - theirs
                near.append(logical_not(too_far(-gap, speed + rate, seconds)))
        return reduce(logical_or, near)
