"""What a reference is made for: the vehicle that flies it, its gravity, the length of the flight."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field

from skyarm.reference.phase_guard import Guard, Phase
from skyarm.reference.tip_push import TipPush
from skyarm.vehicle.vehicle_records import Vehicle


@dataclass(frozen=True, kw_only=True, slots=True)
class TaskEvent:
    """An instant at which a task takes or leaves a payload, or closes or opens a gripper.

    Attributes:
        kind: "pick" or "place". payload: its name; empty for a gripper's. time: s. where: the phase's table, for
            messages. gripper: its name.
    """

    kind: str
    payload: str
    time: float
    where: str
    gripper: str = ""


@dataclass(frozen=True, kw_only=True, slots=True)
class JointMove:
    """A move of a joint from rest to rest.

    Attributes:
        joint: its name. value: rad or m, where it ends. start, end: s. where: the field, for messages.
    """

    joint: str
    value: float
    start: float
    end: float
    where: str


@dataclass(frozen=True, kw_only=True, slots=True)
class Setting:
    """Facts of the flight that a reference's tables may need.

    Attributes:
        vehicle: the plant's; None where a reference is read on its own.
        gravity: m/s^2. duration: s.
        thrust_to_weight: highest thrust over weight; infinite where nobody knows.
        events, guards, phases, pushes, joint_moves: filled while phases are read.
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

    @property
    def all_guards(self) -> tuple[Guard, ...]:
        """The guards, each with the payloads that wait for it."""
        loads = tuple(dict.fromkeys(event.payload for event in self.events if event.payload))
        return tuple(dataclasses.replace(guard, loads=loads) for guard in self.guards)

    @property
    def all_phases(self) -> tuple[Phase, ...]:
        """The phases of a task that waits for the flight; none of one that does not."""
        return tuple(self.phases) if self.guards else ()
