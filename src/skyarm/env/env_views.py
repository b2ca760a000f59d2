"""What an observation and a reward may read: an observation what a law is told, a reward the truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from skyarm.actuation import Command
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.reference import Reference
from skyarm.sensors.measurement import Measurement
from skyarm.vehicle.vehicle_records import Vehicle


@dataclass(frozen=True, kw_only=True, slots=True)
class Sight:
    """What a policy sees before it acts: that of a law, and no truth.

    Attributes:
        measurement: of this period. reference: told for this period.
        action: the one before, each number in [-1, 1]; zeros in an episode's first period.
        model: belief of the scenario's controller.
    """

    measurement: Measurement
    reference: Reference
    action: tuple[Any, ...]
    model: Model


@dataclass(frozen=True, kw_only=True, slots=True)
class Result:
    """What a period came to: the truth at its end.

    Attributes:
        state: of the plant. reference: held at that time. vehicle: the true one.
        action, action_before: of this period and of the one before, each number in [-1, 1].
        command: that this period's action became.
        ended: 1 if the period has ended the episode before its time, else 0.
    """

    state: State
    reference: Reference
    vehicle: Vehicle
    action: tuple[Any, ...]
    action_before: tuple[Any, ...]
    command: Command
    ended: Any
