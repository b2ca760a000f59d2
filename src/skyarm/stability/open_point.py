"""Where an open control period is differentiated: what it takes, read from the loop state of a flight."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from skyarm.actuation import Command
from skyarm.compile import leaves
from skyarm.dynamics import State
from skyarm.sensors.measurement import Measurement, measurement_of
from skyarm.simulate.loop_state import LoopState


@dataclass(frozen=True, kw_only=True, slots=True)
class OpenPoint:
    """What the open period takes; the battery's memory is a number that stays, not one that is stepped beside."""

    state: State
    drives: tuple[Any, ...]
    old: Command
    new: Command
    memory: Any
    seen: Measurement
    power: Any


def open_point(carry: LoopState, ages: tuple[int, int] | None = None, batteries: int = 0) -> OpenPoint:
    """Where the open period is differentiated, as far as the carry tells.

    Args:
        carry: of the flight.
        ages: whole periods that rotors and joints are late; left out: the queue is as long as both.
        batteries: how many of the last components are batteries.
    """
    last = len(carry.queue) - 1
    old, following = carry.queue[0], carry.queue[min(1, last)]
    if ages is not None:
        old, following = (
            Command(
                rotor_speeds=carry.queue[min(last - ages[0] + k, last)].rotor_speeds,
                efforts=carry.queue[min(last - ages[1] + k, last)].efforts,
            )
            for k in (0, 1)
        )
    # an open period asks for no time and no specific force
    waiting = carry.sensors[0].waiting
    seen = waiting[0] if waiting else measurement_of(carry.state, carry.state.velocity * 0.0)
    return OpenPoint(
        state=carry.state,
        drives=carry.drives,
        old=old,
        new=following,
        memory=carry.memory,
        seen=seen,
        power=carry.components[len(carry.components) - batteries :] if batteries else (),
    )


def sizes_of(point: OpenPoint) -> list[int]:
    """How many numbers a point has of state with drives, old and new command, memory, measurement and battery."""
    parts = (point.old, point.new, point.memory, point.seen, point.power)
    return [len(leaves((point.state, point.drives))), *(len(leaves(part)) for part in parts)]
