"""Movable bodies with contact surfaces: free objects and one-degree-of-freedom
mechanisms.

A carrier is a frozen record of numbers. Its memory (:meth:`Carrier.start`) is a part of
the contact's and is integrated with the plant: the contact takes the motion of its
frame (:meth:`Carrier.frame`), adds up the touches, and takes the rate of the memory
under that force and torque (:meth:`Carrier.slope`). The vehicle's points, and the spots
of other carriers, touch the surfaces that it carries.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic

from skyarm.algebra import ZERO3, Mat3, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import divide
from skyarm.records.immutable import immutable
from skyarm.world.component import Column, Memory, moved_by
from skyarm.world.contact.surface import Spot, Surface


@immutable
class CarriedFrame:
    """Position, rotation, velocity and angular velocity of a movable body (free object
    or mechanism) in the world.

    Attributes:
        position: origin of the carrier's axes, m. rotation: carrier's axes to world
            axes.
        velocity: velocity of the origin, m/s, world axes. turning: angular velocity,
            rad/s, world axes.
    """

    position: Vec3
    rotation: Mat3
    velocity: Vec3
    turning: Vec3

    def velocity_at(self, place_W: Vec3) -> Vec3:
        """Velocity (m/s, world axes) of the material point of the movable body at a
        world position (m).
        """
        return self.velocity + self.turning.cross(place_W - self.position)

    def depth(
        self, surface: Surface, point_W: Vec3, radius: Scalar
    ) -> tuple[Scalar, Vec3]:
        """Penetration depth (m) of a ball into a surface of the movable body, and the
        surface's outward normal.
        """
        depth, normal = surface.depth(
            self.rotation.apply_T(point_W - self.position), radius, 0.0
        )
        return depth, self.rotation.apply(normal)


class Carrier(Generic[Memory]):
    """Base class of movable bodies with contact surfaces: free objects and mechanisms
    such as doors.

    ``Carrier[M]`` has states of the type ``M``: a dataclass or tuple of scalars.
    """

    __slots__ = ()

    name: str

    @property
    def surfaces(self) -> tuple[Surface, ...]:
        """Contact surfaces of the movable body, with positions and angles in the body's
        axes.
        """
        raise NotImplementedError(f"{type(self).__name__} must define surfaces()")

    @property
    def mobility(self) -> Scalar:
        """Largest inverse effective mass (1/kg) of the movable body over its possible
        contact points.

        Integration steps follow from it. A body that is pushed at one point has 1/m
        there, and more beside its centre.
        """
        raise NotImplementedError(f"{type(self).__name__} must define mobility()")

    @property
    def largest_step(self) -> Scalar | None:
        """Longest stable integration step (s) of the movable body's springs and
        friction; None without any.
        """
        return None

    @property
    def largest_euler_step(self) -> Scalar | None:
        """Longest stable semi-implicit Euler step (s) of the body's springs and
        friction, or None.
        """
        return self.largest_step

    def mobility_at(self, reach: Scalar) -> Scalar:
        """Largest inverse effective mass (1/kg) at a point up to ``reach`` (m) from the
        movable body's surface.
        """
        return self.mobility

    def mobility_of(self, place: Vec3) -> Scalar:
        """Largest inverse effective mass (1/kg) of the movable body at a place in its
        axes (m).
        """
        return self.mobility

    def require_near(self, place: Vec3) -> None:
        """Refuse a place (m, its axes) that is too far from the movable body to be of a
        grasp.
        """

    @property
    def gyration(self) -> Scalar:
        """Smallest squared radius of gyration (m^2) of the movable body; 0 for a
        mechanism.
        """
        return 0

    @property
    def step_share(self) -> float:
        """Factor by which contact with this movable body shortens the longest stable
        integration step.
        """
        return 1.0

    def start(self) -> Memory:
        """Initial state of the movable body, a dataclass or tuple of floats."""
        raise NotImplementedError(f"{type(self).__name__} must define start()")

    def advance(self, memory: Memory) -> Memory:
        """State of the movable body at the start of a control period, with its attitude
        quaternion normalised.
        """
        return memory

    def frame(self, memory: Memory) -> CarriedFrame:
        """Pose and velocity of the movable body for a given state."""
        raise NotImplementedError(f"{type(self).__name__} must define frame()")

    def slope(
        self, memory: Memory, force_W: Vec3, torque_W: Vec3, gravity: Scalar
    ) -> Memory:
        """Time derivative of the movable body's state under an external force (N) and
        torque (N m).

        Args:
            memory: present state.
            force_W: sum of the contact forces, N, world axes.
            torque_W: torque of these about the origin of its axes, N m, world axes.
            gravity: m/s^2, along -z.
        """
        raise NotImplementedError(f"{type(self).__name__} must define slope()")

    def before_euler_step(self, memory: Memory, slope: Memory, dt: Scalar) -> Memory:
        """State of the movable body with friction bristles advanced, for the forces of
        a semi-implicit Euler step.
        """
        return memory

    def kick(self, memory: Memory, slope: Memory, dt: Scalar) -> Memory:
        """State of the movable body after an acceleration for ``dt`` (s): only
        velocities change.
        """
        raise NotImplementedError(f"{type(self).__name__} must define kick()")

    def drift(self, memory: Memory, dt: Scalar) -> Memory:
        """State of the movable body after ``dt`` (s) with constant velocities: only
        positions change.
        """
        raise NotImplementedError(f"{type(self).__name__} must define drift()")

    def after_push(
        self, memory: Memory, force_W: Vec3, torque_W: Vec3, gravity: Scalar, dt: Scalar
    ) -> Memory:
        """State of the movable body after a force (N) and torque (N m) acted for ``dt``
        (s): only velocities change.

        By one iteration of the implicit midpoint rule, which is of second order.
        """
        slope = self.slope(memory, force_W, torque_W, gravity)
        # gyroscopic moments depend on the velocity that the push itself changes
        middle = self.kick(memory, slope, 0.5 * dt)
        return self.kick(memory, self.slope(middle, force_W, torque_W, gravity), dt)

    def euler_step(self, memory: Memory, slope: Memory, dt: Scalar) -> Memory:
        """State of the movable body after a semi-implicit Euler step of ``dt`` (s)."""
        return self.drift(self.kick(memory, slope, dt), dt)

    @property
    def spot_count(self) -> int:
        """Number of points (corners, rim points) of the movable body that may touch
        other surfaces.
        """
        return 0

    def spots(
        self, frame: CarriedFrame, toward: Callable[[Vec3], Vec3]
    ) -> tuple[Spot, ...]:
        """Points or balls of the movable body that may touch another surface: centre
        (m) and radius (m).
        """
        return ()

    columns: tuple[Column, ...] = ()
    """Columns of a log, as in :attr:`skyarm.world.component.Component.columns`."""

    def logged(self, memory: Memory) -> Scalars:
        """Values of the movable body that the flight log records in every control
        period.
        """
        return ()


AnyCarrier = Carrier[Any]
"""Movable body with an internal state of any type."""


def untouched_after(
    carrier: Carrier[Memory], memory: Memory, dt: Scalar, rounds: int, gravity: Scalar
) -> Memory:
    """State of a movable body that nothing touches, after several Runge-Kutta steps of
    ``dt`` (s).
    """

    def slope(at: Memory) -> Memory:
        return carrier.slope(at, ZERO3, ZERO3, gravity)

    for _ in range(rounds):
        a = slope(memory)
        b = slope(moved_by(memory, a, 0.5 * dt))
        c = slope(moved_by(memory, b, 0.5 * dt))
        d = slope(moved_by(memory, c, dt))
        # Kutta's method: nothing touches the body, so its motion is smooth
        for rate, part in ((a, dt / 6.0), (b, dt / 3.0), (c, dt / 3.0), (d, dt / 6.0)):
            memory = moved_by(memory, rate, part)
    return memory


NOBODY = -1
"""Body index of surfaces that belong to the world, and of contact points that belong to
the vehicle."""


def reduced_mass(a: Scalar, b: Scalar) -> Scalar:
    """Reduced mass (kg) of two bodies in contact: 1 / (1 / a + 1 / b)."""
    return divide(1.0, divide(1.0, a) + divide(1.0, b))
