"""Contact of a vehicle with the surfaces of a scenario: a force whose bristles move with the plant.

Every point may touch every surface. What a pair remembers is its bristle; where a surface moves, there is a clock
beside them, since it goes on within a control period.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

from skyarm.algebra import ZERO3, Vec3
from skyarm.contact.contact_point import ContactPoint
from skyarm.contact.material import RECOVERY
from skyarm.contact.surface import Surface
from skyarm.dynamics.point_motion import PointMotion
from skyarm.dynamics.state import State
from skyarm.environment.component import Force, Wrench
from skyarm.files import shown
from skyarm.records.coerce import RecordError
from skyarm.records.field_rules import accept_fields
from skyarm.records.units import Unit
from skyarm.scalars import Scalar, data, exp, logical_and, maximum, minimum, neg, sqrt
from skyarm.vehicle.check import VehicleError
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Vehicle

NEAR = 0.005
"""m that a point stays away from a surface while longer steps are taken: what it goes astray in 5 ms at 400 m/s^2."""

TIP = "tip"
"""Name of the point that a vehicle with a tip has where nothing is said of its points."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ContactMemory:
    """Memory of a contact.

    Attributes:
        clock: s, of surfaces that move; empty where none does.
        bristles: deflection of each pair's bristle, m, world axes: the first surface's points, then the next one's.
    """

    clock: tuple[Any, ...]
    bristles: tuple[Vec3, ...]


@dataclass(frozen=True, kw_only=True, slots=True)
class Touch:
    """What a surface does to a point, world axes.

    Attributes:
        depth: penetration, m; negative outside. rising: m/s, at which it falls.
        normal: N, along ``axis``, the surface's outward normal.
        friction: N. bristle_rate: m/s. spot: where it acts, seen from the point, m.
    """

    depth: Any
    rising: Any
    normal: Any
    axis: Vec3
    friction: Vec3
    bristle_rate: Vec3
    spot: Vec3

    @property
    def force(self) -> Vec3:
        """Both forces, N."""
        total: Vec3 = self.axis * self.normal + self.friction
        return total


@dataclass(frozen=True, kw_only=True, slots=True)
class Contact(Force):
    """Surfaces of the world and the points of the vehicle that they push back.

    Attributes:
        points: left out for the vehicle's tip.
    """

    surfaces: tuple[Surface, ...]
    points: tuple[ContactPoint, ...] = ()
    rotor_radius: Annotated[Scalar, Unit("m", "of the rotors' discs, which may touch nothing; 0: hubs", low=0.0)] = 0

    def __post_init__(self) -> None:
        accept_fields(self, "world")
        if type(self.rotor_radius) is float and self.rotor_radius == 0.0:
            object.__setattr__(self, "rotor_radius", 0)
        for what, records in (("surfaces", self.surfaces), ("points", self.points)):
            names = [record.name for record in records]
            for name in names:
                if names.count(name) > 1:
                    raise RecordError(f"world.{what}: name = {shown(name)}: must be of one only")

    @property
    def coupled(self) -> bool:  # type: ignore[override]
        """Bristles and clock go on within a control period."""
        return True

    @property
    def largest_step(self) -> Any:  # type: ignore[override]
        """Longest integration step (s) that every material bears; None without surfaces."""
        steps = [surface.material.largest_step for surface in self.surfaces]
        least = steps[0] if steps else None
        for each in steps[1:]:
            least = minimum(least, each)
        return least

    def on(self, vehicle: Vehicle) -> Contact:
        """The contact with the vehicle's tip as its point where none is named."""
        if self.points or not vehicle.end_effector:
            return self
        return replace(self, points=(ContactPoint(name=TIP, frame=vehicle.end_effector),))

    @property
    def pairs(self) -> tuple[tuple[Surface, ContactPoint], ...]:
        """Every surface with every point, in the order of the bristles."""
        return tuple((surface, point) for surface in self.surfaces for point in self.points)

    @property
    def still(self) -> tuple[Surface, ...]:
        """Surfaces that do not move."""
        return tuple(surface for surface in self.surfaces if not surface.moves)

    def check(self, vehicle: Vehicle) -> None:
        """Raise ValueError with one line unless the vehicle has the points."""
        if not self.surfaces:
            raise RecordError("world.surfaces: is missing; a world has at least one surface")
        if not self.points:
            raise RecordError(f"world.points: is missing; vehicle {vehicle.name!r} has no tip")
        for i, point in enumerate(self.points):
            try:
                point.place(vehicle)
            except VehicleError as error:
                raise RecordError(f"world.points[{i}].frame = {shown(point.frame)}: {error}") from None
            except ValueError as error:
                raise RecordError(f"world.points[{i}].{error}") from None

    def start(self, period: float, draws: Sequence[Any]) -> ContactMemory:
        """Upright bristles at t = 0."""
        clock = (0.0,) if any(surface.moves for surface in self.surfaces) else ()
        return ContactMemory(clock=clock, bristles=tuple(Vec3(0.0, 0.0, 0.0) for _ in self.pairs))

    def advance(self, memory: Any, t: Any, dt: float, state: State, draws: Sequence[Any]) -> Any:
        """The clock set anew, so that steps leave no rounding in it."""
        return replace(memory, clock=(t,)) if memory.clock else memory

    def touches(self, memory: Any, motion: PointMotion) -> list[Touch]:
        """What happens at every pair now."""
        found, moving = [], [_moving(point, motion) for point in self.points]
        bristles, clock, step = iter(memory.bristles), (*memory.clock, 0.0)[0], self.largest_step
        for surface in self.surfaces:
            material, surface_velocity = surface.material, surface.place(clock)[1]
            for point, (position, velocity, turning) in zip(self.points, moving, strict=True):
                depth, n = surface.depth(position, point.radius, clock)
                spot = n * neg(point.radius)  # where it touches, seen from its middle
                slip = velocity + turning.cross(spot) - surface_velocity
                rising = slip.dot(n)
                bristle = _across(next(bristles), n)  # a round surface's normal turns
                rate = material.bristle_rate(bristle, _across(slip, n), depth, material.bristle_length / step)
                normal = material.normal_force(depth, -rising)
                friction = material.friction_force(bristle, rate, normal)
                found.append(
                    Touch(
                        depth=depth, rising=rising, normal=normal, friction=friction, spot=spot, bristle_rate=rate,
                        axis=n,
                    )
                )  # fmt: skip
        return found

    def slope(self, memory: Any, t: Any, motion: PointMotion, rotor_speeds: Sequence[Any]) -> ContactMemory:
        """Rate of the memory."""
        rates = tuple(Vec3(*(data(c) for c in touch.bristle_rate)) for touch in self.touches(memory, motion))
        return ContactMemory(clock=tuple(1.0 for _ in memory.clock), bristles=rates)

    def wrenches(self, memory: Any, t: Any, motion: PointMotion, rotor_speeds: Sequence[Any]) -> Sequence[Wrench]:
        """A force at every point, and the torque about it of a ball that touches beside its middle.

        Points of the base act together, at its origin.
        """
        touches, found, whole = self.touches(memory, motion), list[Wrench](), Wrench()
        for i, point in enumerate(self.points):
            force = torque = ZERO3
            for touch in touches[i :: len(self.points)]:
                force, torque = force + touch.force, torque + touch.spot.cross(touch.force)
            at, body = point.place(motion.vehicle)
            if body == BASE:
                torque = torque + motion.turned(at).cross(force)
                whole = Wrench(force_W=whole.force_W + force, torque_W=whole.torque_W + torque)
            else:
                found.append(Wrench(force_W=force, torque_W=torque, point=at, body=body))
        return [whole, *found] if len(found) < len(self.points) else found

    def far(self, memory: Any, motion: PointMotion, seconds: Any) -> Any:
        """Whether no point comes as near to a surface as ``NEAR``, if it goes on with its velocity."""
        found: Any = True
        for touch in self.touches(memory, motion):
            away = touch.depth - touch.rising * seconds < -NEAR
            found = away if found is True else logical_and(found, away)
        return found

    def alone(self, memory: Any, seconds: Any) -> ContactMemory:
        """The clock goes on, bristles stand up."""
        left = exp(-RECOVERY * seconds)
        clock = tuple(t + seconds for t in memory.clock)
        return ContactMemory(clock=clock, bristles=tuple(bristle * left for bristle in memory.bristles))

    def logged(self, memory: Any, motion: PointMotion) -> tuple[Any, ...]:
        """Normal force (N), friction (N) and penetration (m) of each pair, one after the other; zeros outside."""
        numbers: list[Any] = []
        for touch in self.touches(memory, motion):
            friction = touch.friction
            numbers += [touch.normal, sqrt(friction.dot(friction)), maximum(touch.depth, 0.0)]
        return tuple(numbers)


def _across(vector: Vec3, n: Vec3) -> Vec3:
    """The part of a vector across a unit vector; across an axis of the world it is of two numbers by structure."""
    axis = n.coordinate_axis()
    if axis is None:
        across: Vec3 = vector - n * vector.dot(n)
        return across
    return Vec3(*(0 if i == axis else c for i, c in enumerate(vector)))


def _moving(point: ContactPoint, motion: PointMotion) -> tuple[Vec3, Vec3, Vec3]:
    """Position (m), velocity (m/s) and angular velocity (rad/s) of a point, world axes; the last of a ball only."""
    at, body = point.place(motion.vehicle)
    ball = not (type(point.radius) is int and point.radius == 0)
    if body == BASE:  # the lever turned once serves place, velocity and torque
        lever, turning = motion.turned(at), motion.turned(motion.state.rate)
        state = motion.state
        return state.position + lever, state.velocity + turning.cross(lever), turning if ball else ZERO3
    turning = motion.turned(motion.angular_velocity(body), body) if ball else ZERO3
    return motion.position(at, body), motion.velocity(at, body), turning
