"""Timed payload: a rigid load that the vehicle picks up and sets down during the
flight.

A load that is not held rests on something and is no part of the plant. It is grasped at
an instant, or as soon as the frame that grasps it is within reach of the place where it
lies; from then on it is a part of that frame's body: its mass, its centre of mass and
its moments of inertia enter the equations of motion. It is let go at an instant, or
within reach of a place, once.

A load at rest that is grasped by a frame that moves takes momentum: body and load go on
together (inelastic capture, :mod:`skyarm.plant.loads`). A load that is let go takes
along what momentum it has, and the vehicle's velocities stay. What happens to it
afterwards is not simulated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, ClassVar

from skyarm.algebra import ZERO3, Scalar, Scalars, Sym3, Vec3
from skyarm.algebra.scalars import logical_and, mul, where
from skyarm.algebra.vector import select
from skyarm.dynamics.point_motion import PointMotion
from skyarm.records.coerce import concrete
from skyarm.records.field_rules import accept_fields, checked
from skyarm.records.files import Fields
from skyarm.records.files.toml import Entry
from skyarm.records.immutable import field_if_any, immutable
from skyarm.records.read_table import record_entry
from skyarm.records.units import Unit, nonnegative, positive
from skyarm.records.words import Word
from skyarm.vehicle import Body, Vehicle
from skyarm.vehicle.vehicle_records import LOAD
from skyarm.world.component import Column, Component, Event, require_frame

if TYPE_CHECKING:
    from skyarm.world.scene.scene import Instants, Scene


@immutable
@checked("reach")
class Reach:
    """Sphere in the world that the gripping frame must enter before a payload is
    grasped or released.
    """

    within: Annotated[
        Scalar, positive("m", "largest distance of the frame from the point")
    ]
    of: Annotated[Vec3, Unit("m", "point that the frame must reach, world axes")]

    def holds(self, position_W: Vec3) -> Scalar:
        """True if a position (m, world axes) lies within the sphere."""
        away = position_W - self.of
        inside: Scalar = away.dot(away) <= mul(self.within, self.within)
        return inside


@immutable
class PayloadMemory:
    """Internal state of a payload: grasp status, and resting position while it is not
    held.

    Attributes:
        held: 1 while it is held. caught: 1 in the control period in which it is
            grasped. gone: 1 once it was let go.
        place: resting place, m, world axes: before the grasp where it is to be grasped,
            after it where it was let go.
    """

    held: Scalar
    caught: Scalar
    gone: Scalar
    place: Vec3


@immutable
class TimedPayload(Component[PayloadMemory]):
    """Rigid load that is picked up and set down at given times, or on arrival at given
    positions.

    With a place, the instant beside it is the earliest (0 if left out). What happens,
    happens in the first control period that does not begin before: a load is held for
    whole control periods.

    Attributes:
        name: name in logs and pictures; empty for its number.
        frame: frame that holds it; empty for the vehicle's tip.
        pick_place, drop_place: place that the frame must reach; None for anywhere.
        believed: True if the law's model includes the payload while the task carries
            it, at the reference's time.
    """

    name: str = ""
    mass: Annotated[Scalar, LOAD]
    inertia: Annotated[
        Vec3,
        nonnegative(
            "kg m^2",
            "moments of inertia about the payload's centre of mass, frame axes",
        ),
    ] = ZERO3
    com: Annotated[
        Vec3,
        Unit("m", "centre of mass of the payload, axes of the frame that holds it"),
    ] = ZERO3
    frame: str = ""
    pick: Annotated[
        Scalar,
        nonnegative(
            "s", "time at which the payload is picked up; with a place, the earliest"
        ),
    ] = 0.0
    pick_place: Annotated[Reach | None, Word("pick")] = None
    drop: Annotated[
        Scalar,
        nonnegative(
            "s",
            "time at which the payload is set down; with a place, the earliest",
            infinite=True,
        ),
    ] = math.inf
    drop_place: Annotated[Reach | None, Word("drop")] = None
    believed: bool = field_if_any(default=False)

    registered_as = "payload"

    hangs: ClassVar[Scalar] = 0
    """Length (m) by which the load hangs below its frame; 0 for a rigid one. A property
    of one on a cord."""

    def to_entry(self) -> dict[str, Entry]:
        """Scenario-file table of the payload; a pick-up or set-down at a position also
        states its earliest time.
        """
        table = record_entry(self, ("pick",))
        for name in ("pick", "drop"):
            place = table.get(name)
            if isinstance(place, dict):
                table[name] = place | {"after": getattr(self, name)}
        return table

    @staticmethod
    def short_spellings(fields: Fields) -> dict[str, Reach | float | None]:
        """Read pick-up and set-down of a payload: a time (s), or ``{ within, of, after
        }`` on arrival at a position.
        """
        values: dict[str, Reach | float | None] = {}
        for name in ("pick", "drop"):
            if not isinstance(fields.table.get(name), dict):
                values[f"{name}_place"] = None
            else:
                inner = fields.inner(name)
                reach = Reach(
                    within=inner.number("within", low=0.0, strict=True),
                    of=Vec3(*inner.vector("of")),
                )
                values |= {
                    name: inner.number("after", 0.0, low=0.0),
                    f"{name}_place": reach,
                }
                inner.done()
        if "pick" not in fields.table:
            # raises: it is missing
            fields.take("pick")
        if any(values.values()) and fields.table.get("believed") is True:
            words = "must be false where a place decides; its instant is unknown"
            raise ValueError(f"{fields.at('believed')} = true: {words}")
        return values

    @property
    def events(self) -> tuple[Event, ...]:  # type: ignore[override]
        """Time interval in which the payload is held; empty if pick-up or set-down
        depends on position.
        """
        if self.pick_place is not None or self.drop_place is not None:
            return ()
        return (
            (f"holds {float(self.mass):.3g} kg", float(self.pick), float(self.drop)),
        )

    @property
    def rigid(self) -> bool:  # type: ignore[override]
        """Always true: the payload is rigidly fixed to the body that holds the
        payload.
        """
        return True

    def __post_init__(self) -> None:
        accept_fields(self, "payload")
        if (
            self.drop_place is not None
            and isinstance(self.drop, float)
            and math.isinf(self.drop)
        ):
            # with a place an instant that is left out means: at any time
            object.__setattr__(self, "drop", 0.0)
        moments = tuple(self.inertia)
        # 1e-9: a flat body has equality up to rounding
        if concrete(*moments) and 2.0 * max(moments) > sum(moments) * (1.0 + 1e-9):
            raise ValueError(
                f"inertia = {list(moments)}: no moment may be larger than the sum of"
                " the other two"
            )
        instants = concrete(self.pick, self.drop)
        if instants and self.drop_place is None and not self.pick < self.drop:
            raise ValueError(
                f"drop = {self.drop!r}: must be after pick = {self.pick!r} s"
            )

    def require_vehicle(self, vehicle: Vehicle, period: float, gravity: Scalar) -> None:
        """Refuse a vehicle that lacks the frame that holds the payload."""
        require_frame(vehicle, self.frame)

    def start(self, period: float, draws: Sequence[Scalar]) -> PayloadMemory:
        """Initial internal state of the payload, which is not held yet."""
        place = (
            (0.0, 0.0, 0.0)
            if self.pick_place is None
            # 1.0 makes whole numbers data and leaves other scalars
            else tuple(1.0 * c for c in self.pick_place.of)
        )
        return PayloadMemory(held=0.0, caught=0.0, gone=0.0, place=Vec3(*place))

    def act(
        self, memory: PayloadMemory, t: Scalar, dt: float, motion: PointMotion
    ) -> PayloadMemory:
        """Internal state of the payload after a possible pick-up or set-down at a
        control instant.
        """
        return self.next_status(
            memory, t, motion.position(*motion.frame(self.frame or None))
        )

    @property
    def columns(self) -> tuple[Column, ...]:  # type: ignore[override]
        """Log column of the payload mass that the vehicle holds."""
        return (Column("payload_mass", self.name, "kg", "held"),)

    def logged(self, memory: PayloadMemory, motion: PointMotion) -> Scalars:
        """Payload mass (kg) that the vehicle holds, for the log."""
        return (mul(self.mass, memory.held),)

    def shapes(self, seen: Instants) -> Scene:
        """Drawn ball of the payload before, during and after it is carried."""
        from skyarm.world.payload_scene import payload_scene

        return payload_scene(
            seen,
            name=self.name,
            mass=float(self.mass),
            frame=self.frame,
            com=self.com,
            rigid=self.rigid,
        )

    def next_status(
        self, memory: PayloadMemory, t: Scalar, position_W: Vec3
    ) -> PayloadMemory:
        """Next grasp status and resting position of the payload, whose frame is at a
        position (m, world axes).
        """
        carried = memory.held > 0.5
        gone = memory.gone > 0.5
        pick, drop = self.events_reached(t, position_W)
        # what was let go is not grasped again
        caught = where(carried, 0.0, where(gone, 0.0, where(pick, 1.0, 0.0)))
        dropped = where(carried, where(drop, 1.0, 0.0), 0.0)
        return PayloadMemory(
            held=where(dropped > 0.5, 0.0, where(caught > 0.5, 1.0, memory.held)),
            caught=caught,
            gone=where(dropped > 0.5, 1.0, memory.gone),
            place=select(dropped > 0.5, position_W, memory.place),
        )

    def events_reached(self, t: Scalar, position_W: Vec3) -> tuple[Scalar, Scalar]:
        """Conditions of pick-up and of set-down, true if met: time reached, and
        gripping frame in a given sphere.
        """
        pick = t >= self.pick
        drop = t >= self.drop
        if self.pick_place is not None:
            pick = logical_and(pick, self.pick_place.holds(position_W))
        if self.drop_place is not None:
            drop = logical_and(drop, self.drop_place.holds(position_W))
        return pick, drop

    def body(self, vehicle: Vehicle, share: Scalar = 1) -> tuple[int, Body]:
        """Payload as a rigid body in the axes of the link that holds the payload, and
        the link's index.
        """
        at = vehicle.frame(self.frame or None)
        moments = Sym3(*(mul(each, share) for each in self.inertia)).rotate(at.rotation)
        return at.link, Body(
            mass=mul(self.mass, share),
            com=at.position + at.rotation.apply(self.com),
            inertia=moments,
        )
