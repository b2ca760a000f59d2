"""What a reference is made for: the vehicle that flies it, its gravity, the length of the flight."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from skyarm.vehicle.vehicle_records import Vehicle


@dataclass(frozen=True, kw_only=True, slots=True)
class TaskEvent:
    """An instant at which a task takes or leaves a payload.

    Attributes:
        kind: "pick" or "place". payload: its name. time: s. where: the phase's table, for messages.
    """

    kind: str
    payload: str
    time: float
    where: str


@dataclass(frozen=True, kw_only=True, slots=True)
class Setting:
    """Facts of the flight that a reference's tables may need.

    Attributes:
        vehicle: the plant's; None where a reference is read on its own.
        gravity: m/s^2. duration: s.
        thrust_to_weight: highest thrust over weight; infinite where nobody knows.
        events: filled while phases are read.
    """

    vehicle: Vehicle | None = None
    gravity: float = 9.81
    duration: float = 0.0
    thrust_to_weight: float = math.inf
    events: list[TaskEvent] = field(default_factory=list)
