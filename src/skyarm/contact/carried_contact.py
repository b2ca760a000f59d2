"""Where carriers meet the vehicle, the world and each other: pairs, touches, and what adds up on each carrier.

Three kinds of pairs stand one behind the other in the memory's bristles, after those of the world's surfaces and the
vehicle's points: the vehicle's points at what is carried, the carriers' spots at the world's surfaces, and their spots
at what other carriers carry. A surface and what touches it have one force, with opposite signs, at one place.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from skyarm.algebra import ZERO3, Vec3
from skyarm.contact.carrier import CarriedFrame, Carrier
from skyarm.contact.contact_point import ContactPoint
from skyarm.contact.material import LIGHTEST
from skyarm.contact.surface import Surface
from skyarm.contact.touch import Touch, touch_of
from skyarm.scalars import divide, neg

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
