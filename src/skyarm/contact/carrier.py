"""Bodies of the world that move and carry surfaces: what a contact asks of them.

A carrier is a frozen record of numbers. What it remembers (:meth:`Carrier.start`) is a part of the contact's memory
and is integrated with the plant. The contact asks it for the motion of its frame (:meth:`Carrier.frame`), adds up what
touches it, and asks for the rate of its memory under that force and torque (:meth:`Carrier.slope`). A free object and
a mechanism with one degree of freedom are carriers; the vehicle's points, and the spots of other carriers, touch the
surfaces that they carry.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from skyarm.algebra import ZERO3, Mat3, Vec3
from skyarm.contact.contact_point import ContactPoint, Touch, touch_of
from skyarm.contact.material import LIGHTEST
from skyarm.contact.surface import Surface
from skyarm.environment.component import moved_by
from skyarm.scalars import divide, neg

Spot = tuple[Vec3, Any]
"""A ball of a carrier that touches surfaces: its middle (m, world axes) and its radius (m; an int of 0 is a point)."""


@dataclass(frozen=True, kw_only=True, slots=True)
class CarriedFrame:
    """Place and motion of a carrier's axes in the world.

    Attributes:
        position: of the origin, m. rotation: carrier's axes to world axes.
        velocity: of the origin, m/s, world axes. turning: angular velocity, rad/s, world axes.
    """

    position: Vec3
    rotation: Mat3
    velocity: Vec3
    turning: Vec3

    def velocity_at(self, place_W: Vec3) -> Vec3:
        """Velocity (m/s, world axes) of the carrier where it is at a place in the world (m)."""
        return self.velocity + self.turning.cross(place_W - self.position)

    def depth(self, surface: Surface, point_W: Vec3, radius: Any) -> tuple[Any, Vec3]:
        """:meth:`skyarm.contact.surface.Surface.depth` of a surface that is described in the carrier's axes."""
        depth, normal = surface.depth(self.rotation.apply_T(point_W - self.position), radius, 0.0)
        return depth, self.rotation.apply(normal)


class Carrier:
    """Base of what carries surfaces. A subclass is a frozen dataclass with a ``name``."""

    __slots__ = ()

    name: str

    @property
    def surfaces(self) -> tuple[Surface, ...]:
        """What it carries: places and angles in its own axes, without motions."""
        raise NotImplementedError(f"{type(self).__name__} must say its surfaces")

    @property
    def mobility(self) -> Any:
        """1/kg: the square of the largest angular frequency by the stiffness (N/m) of its contacts.

        Integration steps follow from it. A body that is pushed at one point has 1/m there, and more beside its centre.
        """
        raise NotImplementedError(f"{type(self).__name__} must say its mobility")

    @property
    def largest_step(self) -> Any:
        """Longest integration step (s) that its own springs and friction bear; None without any."""
        return None

    @property
    def largest_euler_step(self) -> Any:
        """The same of the semi-implicit Euler method."""
        return self.largest_step

    def mobility_at(self, reach: Any) -> Any:
        """1/kg, of a place in its axes that is at most so far (m) from its skin."""
        return self.mobility

    @property
    def gyration(self) -> Any:
        """m^2: square of the least radius of gyration, with which a gripper holds its attitude; 0 to leave it free."""
        return 0

    @property
    def step_share(self) -> float:
        """Share of a material's longest integration step that contact with it bears."""
        return 1.0

    def start(self) -> Any:
        """First memory, a record or tuple of floats."""
        raise NotImplementedError(f"{type(self).__name__} must say where it starts")

    def advance(self, memory: Any) -> Any:
        """The memory at a control instant, rounding taken out: an attitude in unit length."""
        return memory

    def frame(self, memory: Any) -> CarriedFrame:
        """Where its axes are, and how they move."""
        raise NotImplementedError(f"{type(self).__name__} must say where its axes are")

    def slope(self, memory: Any, force_W: Vec3, torque_W: Vec3, gravity: Any) -> Any:
        """Rate of each number of the memory, 1/s, as a record of its kind.

        Args:
            memory: now.
            force_W: sum of what touches it, N, world axes.
            torque_W: of that about the origin of its axes, N m, world axes.
            gravity: m/s^2, along -z.
        """
        raise NotImplementedError(f"{type(self).__name__} must say the slope of its memory")

    def before_euler_step(self, memory: Any, slope: Any, dt: Any) -> Any:
        """Memory with which a semi-implicit Euler step takes forces: bristles of its own have moved."""
        return memory

    def kick(self, memory: Any, slope: Any, dt: Any) -> Any:
        """Memory after a push: velocities change by their rates times dt (s)."""
        raise NotImplementedError(f"{type(self).__name__} must say its memory after a push")

    def drift(self, memory: Any, dt: Any) -> Any:
        """Memory after a time (s) in which velocities stay: places move by them."""
        raise NotImplementedError(f"{type(self).__name__} must say where its velocities take it")

    def pushed(self, memory: Any, force_W: Vec3, torque_W: Vec3, gravity: Any, dt: Any) -> Any:
        """Memory after force (N) and torque (N m) of a time (s); own torques are those of the velocities in its middle.

        By one iteration of the implicit midpoint rule, which is of second order.
        """
        slope = self.slope(memory, force_W, torque_W, gravity)
        middle = self.kick(memory, slope, 0.5 * dt)
        return self.kick(memory, self.slope(middle, force_W, torque_W, gravity), dt)

    def euler_step(self, memory: Any, slope: Any, dt: Any) -> Any:
        """Memory after a semi-implicit Euler step: velocities first, then places with the new velocities."""
        return self.drift(self.kick(memory, slope, dt), dt)

    @property
    def spot_count(self) -> int:
        """How many spots it touches other surfaces with."""
        return 0

    def spots(self, frame: CarriedFrame, toward: Callable[[Vec3], Vec3]) -> tuple[Spot, ...]:
        """Its points or balls that touch a surface; ``toward`` is that surface's outward normal at a place (m)."""
        return ()

    def logged(self, memory: Any) -> tuple[Any, ...]:
        """Numbers of the instant that a log keeps."""
        return ()


def untouched_after(carrier: Carrier, memory: Any, dt: Any, rounds: int, gravity: Any) -> Any:
    """Memory of a carrier that nothing touches after some steps (s) of the classical Runge-Kutta method."""

    def slope(at: Any) -> Any:
        return carrier.slope(at, ZERO3, ZERO3, gravity)

    for _ in range(rounds):
        a = slope(memory)
        b = slope(moved_by(memory, a, 0.5 * dt))
        c = slope(moved_by(memory, b, 0.5 * dt))
        d = slope(moved_by(memory, c, dt))
        for rate, part in ((a, dt / 6.0), (b, dt / 3.0), (c, dt / 3.0), (d, dt / 6.0)):
            memory = moved_by(memory, rate, part)
    return memory


NOBODY = -1
"""Number of a carrier that stands for the world, of a surface, or for the vehicle, of a point."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Meeting:
    """A surface and what touches it.

    Attributes:
        surface: name. of: number of the carrier of the surface, or ``NOBODY`` for the world.
        by: number of the carrier of the spot, or ``NOBODY`` for the vehicle. index: of its spot, or point.
        touch: what happens. place: where, m, world axes.
    """

    surface: str
    of: int
    by: int
    index: int
    touch: Touch
    place: Vec3


@dataclass(frozen=True, kw_only=True, slots=True)
class Carried:
    """Carriers among the world's surfaces and the vehicle's points.

    Attributes:
        carriers: all that move. surfaces: of the world. points: of the vehicle.
    """

    carriers: tuple[Carrier, ...]
    surfaces: tuple[Surface, ...]
    points: tuple[ContactPoint, ...]

    @property
    def count(self) -> int:
        """How many pairs there are."""
        spots = [each.spot_count for each in self.carriers]
        held = [len(each.surfaces) for each in self.carriers]
        own = sum(a * b for a, b in zip(spots, held, strict=True))
        return sum(held) * len(self.points) + sum(spots) * len(self.surfaces) + sum(spots) * sum(held) - own

    def steps(self) -> Iterator[tuple[str, Any]]:
        """What asks for a step, in words, and the longest integration step (s), of each kind of pair."""
        masses = [1.0 / each.mobility for each in self.carriers]
        for i, carrier in enumerate(self.carriers):
            others = [
                (masses[j], each.step_share) for j, each in enumerate(self.carriers) if j != i and each.spot_count
            ]
            what, share = f"the mass of {carrier.name!r}", carrier.step_share
            for surface in carrier.surfaces:
                if self.points:
                    yield what, share * surface.material.step_of(both(masses[i], LIGHTEST))
                for mass, other in others:
                    yield what, min(share, other) * surface.material.step_of(both(masses[i], mass))
            if carrier.spot_count:
                for surface in self.surfaces:
                    yield what, share * surface.material.step_of(masses[i])

    def meetings(
        self,
        memories: Sequence[Any],
        moving: Sequence[tuple[Vec3, Vec3, Vec3]],
        clock: Any,
        bristles: Sequence[Vec3],
        step: Any,
    ) -> list[Meeting]:
        """What happens at every pair.

        Args:
            memories: of the carriers.
            moving: position (m), velocity (m/s), angular velocity (rad/s) of the vehicle's points, world axes.
            clock: s, of the world's surfaces.
            bristles: of the pairs, m.
            step: longest integration step of the whole contact, s.
        """
        frames = [carrier.frame(memory) for carrier, memory in zip(self.carriers, memories, strict=True)]
        masses = [1.0 / carrier.mobility for carrier in self.carriers]
        held, found = iter(bristles), list[Meeting]()
        for of, (carrier, frame) in enumerate(zip(self.carriers, frames, strict=True)):
            for surface in carrier.surfaces:
                for index, (point, motion) in enumerate(zip(self.points, moving, strict=True)):
                    at = _Place(*motion, radius=point.radius, mass=LIGHTEST)
                    found.append(
                        _meet(surface, frame, masses[of], at, next(held), clock, step, (of, NOBODY, index))
                    )  # fmt: skip
        for by, carrier in enumerate(self.carriers):
            for of, under, surface in self._before(by, frames):

                def toward(place: Vec3, surface: Surface = surface, under: CarriedFrame | None = under) -> Vec3:
                    return _depth(surface, under, place, 0, clock)[1]

                own = frames[by]
                for index, (place, radius) in enumerate(carrier.spots(own, toward)):
                    at = _Place(place, own.velocity_at(place), own.turning, radius=radius, mass=masses[by])
                    mass = None if of == NOBODY else masses[of]
                    found.append(_meet(surface, under, mass, at, next(held), clock, step, (of, by, index)))
        return found

    def _before(self, by: int, frames: Sequence[CarriedFrame]) -> Iterator[tuple[int, CarriedFrame | None, Surface]]:
        """Surfaces that a carrier's spots may touch: number and frame of what carries them."""
        for surface in self.surfaces:
            yield NOBODY, None, surface
        for of, carrier in enumerate(self.carriers):
            if of != by:
                for surface in carrier.surfaces:
                    yield of, frames[of], surface

    def pushes(self, memories: Sequence[Any], meetings: Sequence[Meeting]) -> list[tuple[Vec3, Vec3]]:
        """Force (N) on each carrier and torque (N m) about the origin of its frame, world axes."""
        found = []
        for i, (carrier, memory) in enumerate(zip(self.carriers, memories, strict=True)):
            origin, force, torque = carrier.frame(memory).position, ZERO3, ZERO3
            for each in meetings:
                if i in (each.of, each.by):
                    push = each.touch.force if each.by == i else -each.touch.force
                    force, torque = force + push, torque + (each.place - origin).cross(push)
            found.append((force, torque))
        return found


def both(a: Any, b: Any) -> Any:
    """The mass (kg) of two that push each other."""
    return divide(1.0, divide(1.0, a) + divide(1.0, b))


@dataclass(frozen=True, slots=True)
class _Place:
    """What meets a surface: a ball of the vehicle or of a carrier."""

    position: Vec3
    velocity: Vec3
    turning: Vec3
    radius: Any
    mass: Any


def _depth(surface: Surface, frame: CarriedFrame | None, place: Vec3, radius: Any, clock: Any) -> tuple[Any, Vec3]:
    """Depth (m) and outward normal, of a surface that a frame carries, or of the world."""
    return surface.depth(place, radius, clock) if frame is None else frame.depth(surface, place, radius)


def _meet(
    surface: Surface, frame: CarriedFrame | None, mass: Any, at: _Place, held: Vec3, clock: Any, step: Any,
    numbers: tuple[int, int, int],
) -> Meeting:  # fmt: skip
    """One pair; ``mass`` (kg) is that of the surface's carrier, None for the world."""
    depth, normal = _depth(surface, frame, at.position, at.radius, clock)
    spot = normal * neg(at.radius)
    place = at.position + spot
    under = surface.place(clock)[1] if frame is None else frame.velocity_at(place)
    slip = at.velocity + at.turning.cross(spot) - under
    moved = at.mass if mass is None else both(mass, at.mass)
    touch = touch_of(surface.material, depth, normal, spot, slip, held, step, moved, mean=step)
    of, by, index = numbers
    return Meeting(surface=surface.name, of=of, by=by, index=index, touch=touch, place=place)
