"""Dataclasses of the closed loop: state between control periods, inputs, and logged quantities."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skyarm.algebra.scalars import Scalar
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.records.immutable import immutable
from skyarm.records.leaves import is_record, leaves, mismatch, parts, rebuild
from skyarm.reference import Reference
from skyarm.sensing.measurement import Measurement
from skyarm.world import WindSample


@immutable
class SensorState:
    """State of one sensor between two control periods: internal state, last reading, delay queue.

    Attributes:
        memory: of the sensor.
        held: its last reading, for a sensor slower than the loop; else ``()``.
        waiting: readings on their way, oldest first.
    """

    memory: Any
    held: Any
    waiting: tuple[Any, ...]


@immutable
class LoopState:
    """State of the closed loop from one control period to the next.

    Attributes:
        alive: 1 while the episode runs, 0 once it has ended. ticks: control periods flown.
        state: of the plant. memory: of the law.
        queue: commands on their way, oldest first; the first acts now.
        sensors: the full state's first, then the named ones. estimate: memory of the estimator.
        components: memories of air and forces. drives: memories of the joint drives.
        clock: of a reference whose phases wait (:mod:`skyarm.simulate.reference_clock`); () where none does.
    """

    alive: Scalar
    ticks: Scalar
    state: State
    memory: Any
    queue: tuple[Command, ...]
    sensors: tuple[SensorState, ...]
    estimate: Any
    components: tuple[Any, ...]
    drives: tuple[Any, ...]
    clock: Any = ()


@immutable
class Row:
    """Inputs of the closed loop at a control instant: time and reference.

    Of a scenario whose phases wait it is the time alone; the loop puts the reference there, and ``path_time``.
    ``told`` is the time-scaled sample that the law receives in its place and ``path_time`` the reference's time, s
    (:mod:`skyarm.reference.path_time`); both are empty where none is planned: structure.
    """

    time: Scalar
    reference: Any
    told: Reference | tuple[()] = ()
    path_time: Scalar | tuple[()] = ()


@immutable
class Sample:
    """Quantities of one control instant that a log may contain.

    ``measurement`` is what the law received; ``readings`` are those of the sensors that a log keeps, name and record of
    each, as they had arrived; ``found`` are the online estimates of the law, () of most laws
    (:mod:`skyarm.control.law_estimates`); ``led`` are the :meth:`skyarm.simulate.reference_clock.Waits.times` of a
    reference that waits.
    """

    alive: Scalar
    state: State
    command: Command
    measurement: Measurement
    readings: tuple[tuple[str, Any], ...]
    wind: WindSample
    found: tuple[Scalar, ...] = ()
    led: tuple[Scalar, ...] = ()


def carry_over(
    first: LoopState, now: LoopState, places: tuple[Sequence[str], Sequence[str]], clock: Any = ()
) -> LoopState:
    """Transfer the loop state to a changed scenario; states whose structure differs start anew, as in ``first``.

    Args:
        first: its first state.
        now: that of the loop before.
        places: parameter paths of the environment components in the new and the old scenario.
        clock: of a reference that is another one than before, as it begins in this period; () where it is the same.
    """
    fields: dict[str, Any] = {}
    for name, new in parts(first).items():
        old = getattr(now, name)
        if name == "components":
            before = dict(zip(places[1], old, strict=True))
            fields[name] = tuple(_kept(a, before.get(at)) for at, a in zip(places[0], new, strict=True))
        elif name == "drives" and len(new) == len(old):
            fields[name] = tuple(_kept(a, b) for a, b in zip(new, old, strict=True))
        elif name == "clock" and clock != ():
            fields[name] = clock
        else:
            fields[name] = _kept(new, old)
    return LoopState(**fields)


def _kept(new: Any, old: Any) -> Any:
    return new if mismatch(new, old, "memory") else old


def structure_of(record: Any) -> Any:
    """Copy of a dataclass with every scalar set to 0.0, as a structural example for tracing."""
    if is_record(record) or isinstance(record, tuple):
        return rebuild(record, iter([0.0] * len(leaves(record))))
    return record
