"""Hanging payload: a point mass on a cord below the frame that holds it.

The cord pulls and never pushes: its tension is k (r - L) + c dr/dt where it is longer
than L, and at least zero. In each control period the load is moved in ``SUBSTEPS``
semi-implicit Euler steps while the frame goes on with the velocity that it had at the
beginning; the mean tension of these steps pulls the frame throughout the period. The
vehicle gets exactly the momentum that the load loses, and the coupling is of first
order in the period. It holds while the cord's own swing sqrt(k / m) is slow against the
control rate (``FASTEST``): a cord is not stiffer than that here.

On the ground and on the surfaces of a world that stand still the load lies down: it
does not bounce, and slides with the friction of the surface.

Source: spherical pendulum on an elastic cord; staggered coupling as in Felippa, Park,
Farhat 2001.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

from skyarm.algebra import E_Z, ZERO3_DATA, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import (
    divide,
    logical_and,
    maximum,
    minimum,
    mul,
    sqrt,
    where,
)
from skyarm.algebra.vector import select
from skyarm.compile.tracing.lower import repeat
from skyarm.dynamics.point_motion import PointMotion
from skyarm.records.coerce import concrete
from skyarm.records.files import shown
from skyarm.records.immutable import immutable
from skyarm.records.leaves import blend, parts
from skyarm.records.units import nonnegative, positive
from skyarm.vehicle import Vehicle
from skyarm.world.component import Column, Wrench, require_frame
from skyarm.world.timed_payload import PayloadMemory, TimedPayload

SUBSTEPS = 20
"""Number of integration steps of the load per control period. At ``FASTEST`` the
load then swings on its cord 3e-5 too quickly: (w h)^2 / 24 of semi-implicit Euler."""

STEPS, TOUCHES = 8, 1e-3
"""Number of steps in which a load is let down onto a surface; distance (m) from it, and
slope, at which it lies."""

FASTEST = 0.5
"""Largest product of the loaded cord's angular frequency and the control period."""


@immutable
class Swing:
    """Substep state of a hanging payload: load position and velocity, frame position,
    and sum of cord forces.
    """

    position: Vec3
    velocity: Vec3
    holder: Vec3
    pull: Vec3


@immutable
class HangingMemory(PayloadMemory):
    """Internal state of a hanging payload: grasp status, load position and velocity,
    mean cord force.

    Attributes:
        begun: position of the load at the beginning of the period, m, world axes.
        position, velocity: position and velocity of the load at its end, m and m/s,
            world axes.
        pull: mean force of the cord on the frame, N.
    """

    begun: Vec3
    position: Vec3
    velocity: Vec3
    pull: Vec3


@immutable
class HangingPayload(TimedPayload):
    """Point mass that hangs on a cord from the vehicle between a pick-up and a
    set-down.

    It is picked up at rest, straight below the frame, with the cord as long as its
    weight makes it.

    Attributes:
        stretch: extension of the cord under the load's weight, by its length: it
            determines the cord's stiffness.
    """

    cord: Annotated[Scalar, positive("m", "length of the unloaded cord")] = 0.5
    stretch: Annotated[
        Scalar,
        positive(
            "",
            "relative stretch of the cord by the weight of the load",
            high=1.0,
            effect=(
                "lower values make a stiffer cord, which needs a higher control rate"
            ),
        ),
    ] = 0.02
    damping_ratio: Annotated[
        Scalar, nonnegative("", "damping ratio of the cord's own stretching", high=10.0)
    ] = 0.2

    def __post_init__(self) -> None:
        # not super(): a dataclass with slots is another class than the one that is
        # being made here
        TimedPayload.__post_init__(self)
        for name in ("inertia", "com"):
            given = tuple(getattr(self, name))
            if any(not concrete(each) or each != 0 for each in given):
                raise ValueError(
                    f"{name} = {shown(given)}: must be left out of a hanging payload, a"
                    " point mass"
                )

    @property
    def rigid(self) -> bool:  # type: ignore[override]
        """Always false: the hanging payload moves relative to the vehicle."""
        return False

    def require_vehicle(self, vehicle: Vehicle, period: float, gravity: Scalar) -> None:
        """Refuse a vehicle without the frame, and a cord that is too stiff for the
        control period.
        """
        require_frame(vehicle, self.frame)
        if not concrete(self.cord, self.stretch, gravity):
            return
        # stretched by m g / k = stretch L, the cord swings with sqrt(g / (stretch L))
        least = gravity * (period / FASTEST) ** 2 / self.cord
        if self.stretch < least:
            raise ValueError(
                f"stretch = {self.stretch!r}: must be at least {least:.3g} at this"
                " control rate"
            )

    @property
    def hangs(self) -> Scalar:  # type: ignore[override]
        """Length (m) of the cord at rest under the load's weight."""
        return self.cord * (1.0 + self.stretch)

    def start(self, period: float, draws: Sequence[Scalar]) -> HangingMemory:
        """Initial internal state of the hanging payload, which is not held yet."""
        rest = TimedPayload.start(self, period, draws)
        begun = rest.place
        still = ZERO3_DATA
        return HangingMemory(
            **parts(rest), begun=begun, position=begun, velocity=still, pull=still
        )

    def act(  # type: ignore[override]
        self, memory: HangingMemory, t: Scalar, dt: float, motion: PointMotion
    ) -> HangingMemory:
        """Internal state of the hanging payload for a control period, with the mean
        cord force on the vehicle.
        """
        at = motion.frame(self.frame or None)
        holder, speed = motion.position(*at), motion.velocity(*at)
        status = self.next_status(memory, t, holder)
        grasped = status.held > 0.5
        caught = status.caught > 0.5
        nothing = ZERO3_DATA
        # at the instant of the grasp it begins at rest below the frame
        first = select(caught, self.let_down(holder, motion.solids), memory.position)
        still = select(caught, nothing, memory.velocity)
        swing = Swing(position=first, velocity=still, holder=holder, pull=nothing)
        swing = repeat(
            SUBSTEPS,
            lambda now: self._advance_swing(now, speed, motion, dt / SUBSTEPS),
            swing,
        )
        return HangingMemory(
            **parts(status),
            begun=first,
            position=select(grasped, swing.position, memory.position),
            velocity=select(grasped, swing.velocity, memory.velocity),
            pull=select(grasped, swing.pull * (1.0 / SUBSTEPS), nothing),
        )

    @property
    def columns(self) -> tuple[Column, ...]:  # type: ignore[override]
        """Log columns of the held mass and the load's position."""
        begin = f"{self.name}_" if self.name else ""
        axes = (
            Column("payload_position", f"{begin}{axis}", "m", "on its cord, world axes")
            for axis in "xyz"
        )
        return (*TimedPayload.columns.fget(self), *axes)  # type: ignore[attr-defined]

    def logged(  # type: ignore[override]
        self, memory: HangingMemory, motion: PointMotion
    ) -> Scalars:
        """Held mass (kg) and load position (m) for the log."""
        return (*TimedPayload.logged(self, memory, motion), *memory.begun)

    def let_down(self, holder: Vec3, solids: Sequence[Any]) -> Vec3:
        """Place (m) of the load when it is let down from its holder: straight below, or
        where it comes to lie before.

        Each step is as long as a surface is far. A wall beside the load stops nothing.
        Source: Hart 1996, Sphere tracing.
        """
        below = holder - E_Z * self.hangs
        # the highest place at which anything stops it
        for solid in solids:
            place = holder
            for _ in range(STEPS):
                place = place - E_Z * maximum(-solid.depth(place, 0, 0.0)[0], 0.0)
            depth, normal = solid.depth(place, 0, 0.0)
            lies = logical_and(
                logical_and(depth > -TOUCHES, normal.z > TOUCHES), place.z > below.z
            )
            below = select(lies, place + normal * depth, below)
        return below

    def _advance_swing(
        self, now: Swing, speed: Vec3, motion: PointMotion, dt: Scalar
    ) -> Swing:
        """Advance the load by one substep under cord tension and gravity, independent
        of its mass.

        On a surface it comes to rest, and friction takes its coefficient times what the
        load loses of its fall.
        Source: Moreau 1988, Unilateral contact and dry friction in finite freedom
        dynamics (impulses of a time step).
        """
        to_tip = now.holder - now.position
        # at the frame itself the cord has no direction: zero, not NaN
        length = to_tip.smooth_norm()
        along = to_tip * (1.0 / length)
        # k / m, by which the weight stretches the cord as stated
        square = motion.gravity / (self.stretch * self.cord)
        damping = 2.0 * self.damping_ratio * sqrt(square)
        tension = square * (length - self.cord) + damping * along.dot(
            speed - now.velocity
        )
        tension = where(length > self.cord, maximum(tension, 0.0), 0.0)
        velocity = now.velocity + (along * tension - E_Z * motion.gravity) * dt
        position = now.position + velocity * dt
        for solid in motion.solids:
            depth, normal = solid.depth(position, 0, 0.0)
            into = minimum(normal.dot(velocity), 0.0)
            # friction takes from the slip by what hits; 1e-24: at rest no 0 / 0
            beside = velocity - normal * into
            left = maximum(
                1.0 + solid.material.friction * divide(into, beside.smooth_norm()),
                0.0,
            )
            slower = beside * left
            out = position + normal * depth + (slower - beside) * dt
            velocity, position = blend(depth > 0.0, (slower, out), (velocity, position))
        return Swing(
            position=position,
            velocity=velocity,
            holder=now.holder + speed * dt,
            # on the frame: the reaction of what accelerated the load in this substep
            pull=now.pull - along * mul(tension, self.mass),
        )

    def wrenches(  # type: ignore[override]
        self,
        memory: HangingMemory,
        t: Scalar,
        motion: PointMotion,
        rotor_speeds: Sequence[Scalar],
    ) -> Sequence[Wrench]:
        """Wrench of the cord's tension on the frame."""
        point, body = motion.frame(self.frame or None)
        return (Wrench(force_W=memory.pull, point=point, body=body),)
