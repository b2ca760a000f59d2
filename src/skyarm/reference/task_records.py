"""Dataclasses of a task: phases, conditions that end phases, events and joint moves."""

from __future__ import annotations

import math
from dataclasses import field, replace
from typing import Annotated, Any

from skyarm.algebra import Scalar
from skyarm.records.field_rules import checked
from skyarm.records.immutable import field_if_any, immutable
from skyarm.records.units import Unit, nonnegative, positive
from skyarm.reference.signals import Signal
from skyarm.reference.tip_motion import Components, TipPush
from skyarm.vehicle import Vehicle


@immutable
@checked("phase")
class Phase:
    """Phase of a task: kind, planned end time, and interval in which a position offset
    returns to zero.

    Attributes:
        name: its kind. end: planned end, s. back: start and end (s) of the interval in
            which an offset, left by a phase that ended early, returns to zero.
    """

    name: str
    end: Annotated[float, nonnegative("s", "planned end of the phase")]
    back: tuple[float, float] | None = None

    def later(self, seconds: float) -> Phase:
        """Copy of the task phase, shifted in time by some seconds."""
        back = (
            None
            if self.back is None
            else (self.back[0] + seconds, self.back[1] + seconds)
        )
        return replace(self, end=self.end + seconds, back=back)


@immutable
@checked("guard")
class Guard:
    """Condition, such as a contact force, that the flight must meet before the task
    continues.

    All conditions must hold together for ``hold`` seconds; None is no condition. Force,
    distance and error are those available to the law: the measured tip, the force that
    the law observes, or that a sensor at the tip reads.

    Attributes:
        at: s, planned end of the guarded phase, where the reference waits.
        begin: s, planned beginning: distances count from there.
        phase: index of its phase.
        error: m, of the tip (across the normal while a contact force is requested); of
            the base without a tip.
        force, force_below: N along ``direction``, above and below which it holds.
        sensed: the force is that of the force sensor at the tip. closed, open: names of
            tactile switches.
        distance: least way of the tip against ``direction``, m.
        direction: unit vector, world axes: out of the surface.
        hold: time for which all conditions must hold, s. timeout: time of waiting after
            which the reference continues anyway, s.
        fails: True if the flight ends after the timeout instead.
        early: True if the rest of the phase is skipped once the guard is met before its
            end.
        loads: names of the payloads that the task takes and leaves, at the reference's
            time.
    """

    at: Annotated[
        Scalar,
        nonnegative("s", "planned end of the guarded phase, where the reference waits"),
    ]
    begin: Annotated[
        Scalar,
        nonnegative(
            "s", "planned beginning of the guarded phase; distances count from there"
        ),
    ] = 0.0
    phase: int = 0
    error: Annotated[
        Scalar | None,
        positive(
            "m",
            "largest tip error; across the normal in contact, of the base without"
            " a tip",
        ),
    ] = None
    force: Annotated[
        Scalar | None, positive("N", "least tip force along the direction")
    ] = None
    force_below: Annotated[
        Scalar | None, positive("N", "largest tip force along the direction")
    ] = None
    distance: Annotated[
        Scalar | None,
        positive(
            "m",
            "least displacement of the tip against the direction since the phase began",
        ),
    ] = None
    direction: Annotated[
        Components,
        Unit("", "unit vector of force and distance, out of the surface, world axes"),
    ] = (0.0, 0.0, 1.0)
    hold: Annotated[
        Scalar, nonnegative("s", "time for which all conditions must hold")
    ] = 0.5
    timeout: Annotated[
        Scalar,
        positive("s", "longest wait; then the reference continues or the flight fails"),
    ] = 5.0
    fails: bool = False
    early: bool = False
    loads: tuple[str, ...] = ()
    sensed: bool = field_if_any(default=False)
    closed: str = field_if_any(default="")
    open: str = field_if_any(default="")


@immutable
class TaskEvent:
    """Event of a task: a payload is picked up or set down, or a gripper closes or
    opens.

    Attributes:
        kind: "pick" or "place". payload: its name; empty for a gripper's. time: s.
            where: the phase's table, for messages. gripper: its name.
    """

    kind: str
    payload: str
    time: float
    where: str
    gripper: str = ""


@immutable
class JointMove:
    """Planned move of a joint from rest to rest.

    Attributes:
        joint: its name. value: position at the end, rad or m. start, end: s. where:
            field, for messages.
    """

    joint: str
    value: float
    start: float
    end: float
    where: str


@immutable
class Setting:
    """Flight data for reading reference tables, and lists of the task events,
    conditions and moves read from them.

    Attributes:
        vehicle: vehicle of the plant; None where a reference is read on its own.
        gravity: m/s^2. duration: s.
        thrust_to_weight: highest thrust over weight; infinite if unknown.
        events, guards, phases, pushes, joint_moves: lists that are filled while phases
            are read.
        carried: path of the tip and change of the heading by which a team carries a
            body; None for another vehicle.
        turned: roll, pitch and yaw over time of a body that the tip holds by a fixed
            grasp; () for none.
    """

    vehicle: Vehicle | None = None
    gravity: float = 9.81
    duration: float = 0.0
    thrust_to_weight: float = math.inf
    events: list[TaskEvent] = field(default_factory=list)
    guards: list[Guard] = field(default_factory=list)
    phases: list[Phase] = field(default_factory=list)
    pushes: list[TipPush] = field(default_factory=list)
    joint_moves: list[JointMove] = field(default_factory=list)
    carried: Any = None
    turned: tuple[Signal, ...] = ()

    @property
    def all_guards(self) -> tuple[Guard, ...]:
        """All conditions that end phases of the tasks."""
        loads = tuple(
            dict.fromkeys(event.payload for event in self.events if event.payload)
        )
        return tuple(replace(guard, loads=loads) for guard in self.guards)

    @property
    def all_phases(self) -> tuple[Phase, ...]:
        """Phases of the task if any of them waits for a condition, else an empty
        tuple.
        """
        return tuple(self.phases) if self.guards else ()
