"""Records of the closed loop: what a control period hands on, what it is fed, what may be logged of it."""

from __future__ import annotations

from dataclasses import dataclass, fields, is_dataclass
from typing import Any

from skyarm.actuation import Command
from skyarm.compile import leaves, rebuild
from skyarm.dynamics import State
from skyarm.dynamics.measurement import Measurement
from skyarm.environment import DrydenMemory, WindSample
from skyarm.reference import Reference
from skyarm.scalars import Scalar, where


@dataclass(frozen=True, kw_only=True, slots=True)
class Carry:
    """What one control period hands to the next.

    Attributes:
        alive: 1 while the episode runs, 0 once it has ended. ticks: control periods flown.
        state: of the plant. memory: of the controller.
        queue: commands on their way, oldest first; the first acts now.
        readings: measurements on their way, oldest first.
        turbulence: of the air, or None.
    """

    alive: Scalar
    ticks: Scalar
    state: State
    memory: Any
    queue: tuple[Command, ...]
    readings: tuple[Measurement, ...]
    turbulence: DrydenMemory | None


@dataclass(frozen=True, kw_only=True, slots=True)
class Row:
    """What a control instant is fed from outside: its time and the held reference."""

    time: Scalar
    reference: Reference


@dataclass(frozen=True, kw_only=True, slots=True)
class Sample:
    """What may be logged of a control instant."""

    alive: Scalar
    state: State
    command: Command
    reading: Measurement
    wind: WindSample


def blend(condition: Any, new: Any, old: Any) -> Any:
    """``new`` where the condition holds, else ``old``, leaf by leaf; structure is the old record's."""
    values = (where(condition, a, b) for a, b in zip(leaves(new), leaves(old), strict=True))
    return rebuild(old, values)


def ended(carry: Carry) -> Carry:
    """The carry of an episode that has ended: as it was, not alive."""
    values = {field.name: getattr(carry, field.name) for field in fields(carry)}
    return Carry(**{**values, "alive": 0.0})


def structure_of(record: Any) -> Any:
    """An example of a record: every scalar 0.0, structure kept."""
    if is_dataclass(record) or isinstance(record, tuple):
        return rebuild(record, iter([0.0] * len(leaves(record))))
    return record
