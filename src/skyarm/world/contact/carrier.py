"""Bodies of the world that move and carry surfaces: free objects and mechanisms with one degree of freedom.

A carrier is a frozen record of numbers. Its memory (:meth:`Carrier.start`) is a part of the contact's and is integrated
with the plant: the contact takes the motion of its frame (:meth:`Carrier.frame`), adds up the touches, and takes the
rate of the memory under that force and torque (:meth:`Carrier.slope`). The vehicle's points, and the spots of other
carriers, touch the surfaces that it carries.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from skyarm.algebra import ZERO3, Mat3, Vec3
from skyarm.algebra.scalars import Scalar, divide
from skyarm.world.component import Column, moved_by
from skyarm.world.contact.surface import Surface

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

    def depth(self, surface: Surface, point_W: Vec3, radius: Scalar) -> tuple[Any, Vec3]:
        """:meth:`skyarm.world.contact.surface.Surface.depth` of a surface that is described in the carrier's axes."""
        depth, normal = surface.depth(self.rotation.apply_T(point_W - self.position), radius, 0.0)
        return depth, self.rotation.apply(normal)


class Carrier:
    """Base of the bodies that carry surfaces. A subclass is a frozen dataclass with a ``name``."""

    __slots__ = ()

    name: str

    @property
    def surfaces(self) -> tuple[Surface, ...]:
        """Surfaces of the carrier: places and angles in its own axes, without motions."""
        raise NotImplementedError

    @property
    def mobility(self) -> Scalar:
        """1/kg: the square of the largest angular frequency by the stiffness (N/m) of its contacts.

        Integration steps follow from it. A body that is pushed at one point has 1/m there, and more beside its centre.
        """
        raise NotImplementedError

    @property
    def largest_step(self) -> Any:
        """Longest stable integration step (s) of its own springs and friction; None without any."""
        return None

    @property
    def largest_euler_step(self) -> Any:
        """The same of the semi-implicit Euler method."""
        return self.largest_step

    def mobility_at(self, reach: Scalar) -> Any:
        """1/kg, of a place in its axes that is at most so far (m) from its skin."""
        return self.mobility

    @property
    def gyration(self) -> Scalar:
        """m^2: square of the least radius of gyration, with which a gripper holds its attitude; 0 to leave it free."""
        return 0

    @property
    def step_share(self) -> float:
        """Share of a material's longest integration step in contact with this carrier."""
        return 1.0

    def start(self) -> Any:
        """First memory, a record or tuple of floats."""
        raise NotImplementedError

    def advance(self, memory: Any) -> Any:
        """The memory at a control instant, rounding taken out: an attitude in unit length."""
        return memory

    def frame(self, memory: Any) -> CarriedFrame:
        """Pose and motion of its axes."""
        raise NotImplementedError

    def slope(self, memory: Any, force_W: Vec3, torque_W: Vec3, gravity: Scalar) -> Any:
        """Rate of each number of the memory, 1/s, as a record of its kind.

        Args:
            memory: now.
            force_W: sum of what touches it, N, world axes.
            torque_W: of that about the origin of its axes, N m, world axes.
            gravity: m/s^2, along -z.
        """
        raise NotImplementedError

    def before_euler_step(self, memory: Any, slope: Any, dt: Scalar) -> Any:
        """Memory with which a semi-implicit Euler step takes forces: bristles of its own have moved."""
        return memory

    def kick(self, memory: Any, slope: Any, dt: Scalar) -> Any:
        """Memory after a push: velocities change by their rates times dt (s)."""
        raise NotImplementedError

    def drift(self, memory: Any, dt: Any) -> Any:
        """Memory after a time (s) in which velocities stay: places move by them."""
        raise NotImplementedError

    def after_push(self, memory: Any, force_W: Vec3, torque_W: Vec3, gravity: Scalar, dt: Scalar) -> Any:
        """Memory after force (N) and torque (N m) of a time (s); own torques are those of the velocities in its middle.

        By one iteration of the implicit midpoint rule, which is of second order.
        """
        slope = self.slope(memory, force_W, torque_W, gravity)
        middle = self.kick(memory, slope, 0.5 * dt)
        return self.kick(memory, self.slope(middle, force_W, torque_W, gravity), dt)

    def euler_step(self, memory: Any, slope: Any, dt: Scalar) -> Any:
        """Memory after a semi-implicit Euler step: velocities first, then places with the new velocities."""
        return self.drift(self.kick(memory, slope, dt), dt)

    @property
    def spot_count(self) -> int:
        """Number of its spots that may touch other surfaces."""
        return 0

    def spots(self, frame: CarriedFrame, toward: Callable[[Vec3], Vec3]) -> tuple[Spot, ...]:
        """Its points or balls that touch a surface; ``toward`` is that surface's outward normal at a place (m)."""
        return ()

    columns: tuple[Column, ...] = ()
    """As :attr:`skyarm.world.component.Component.columns`."""

    def logged(self, memory: Any) -> tuple[Any, ...]:
        """Numbers of the instant that a log keeps."""
        return ()


def untouched_after(carrier: Carrier, memory: Any, dt: Scalar, rounds: int, gravity: Scalar) -> Any:
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


def both(a: Any, b: Any) -> Any:
    """The mass (kg) of two that push each other."""
    return divide(1.0, divide(1.0, a) + divide(1.0, b))
