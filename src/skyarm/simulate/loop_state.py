"""Dataclasses of the closed loop: state between control periods, inputs, and logged quantities."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Generic, TypeVar

from skyarm.algebra import Vec3
from skyarm.algebra.scalars import Scalar
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.plant.surroundings import Memories
from skyarm.records.immutable import immutable
from skyarm.records.leaves import Record, Tree, is_record, leaves, mismatch, rebuild
from skyarm.reference import Reference
from skyarm.sensing.measurement import Measurement
from skyarm.world import WindSample


@immutable
class SensorState:
    """State of one sensor between two control periods: internal state, last reading, delay queue.

    Attributes:
        memory: internal state of the sensor.
        held: its last reading, for a sensor slower than the loop; else ``()``.
        waiting: readings on their way, oldest first.
    """

    memory: Tree
    held: Tree
    waiting: tuple[Tree, ...]


@immutable
class PathClock:
    """State of the clock of a reference that waits for conditions (guards); times are counts of control periods.

    Attributes:
        place: current path time. held: path time of the held sample.
        guard: index of the next guard. waited: time spent waiting for it. reached: time for which it has been met.
        origin: tip position at the start of the phase, m, world axes. failed: 1 once a mandatory phase has failed.
        offset: offset of the reference after a phase that ended early, m. since: path time at which the offset began.
        held_offset, held_since: offset and its beginning for the held sample.
    """

    place: Scalar
    held: Scalar
    guard: Scalar
    waited: Scalar
    reached: Scalar
    origin: Vec3 | tuple[()]
    failed: Scalar
    offset: Vec3 | tuple[()]
    since: Scalar | tuple[()]
    held_offset: Vec3 | tuple[()]
    held_since: Scalar | tuple[()]


Clock = PathClock | tuple[()]
"""State of the reference's clock; () where no phase waits."""


@immutable
class AgentLoop:
    """State of one vehicle, its plant and its control, from one control period to the next.

    Attributes:
        state: state of the plant. memory: internal state of the law.
        queue: commands on their way, oldest first; the first acts now.
        sensors: the full state's first, then the named ones. estimate: memory of the estimator.
        drives: memories of the joint drives.
        clock: clock of a reference whose phases wait (:mod:`skyarm.simulate.reference_clock`); () where none does.
    """

    state: State
    memory: Tree
    queue: tuple[Command, ...]
    sensors: tuple[SensorState, ...]
    estimate: Tree
    drives: Memories
    clock: Clock = ()


@immutable
class LoopState:
    """State of the closed loop from one control period to the next.

    Attributes:
        alive: 1 while the episode runs, 0 once it has ended. ticks: control periods flown.
        agent: the vehicle and its control. components: memories of air and forces.
    """

    alive: Scalar
    ticks: Scalar
    agent: AgentLoop
    components: Memories


Wanted_co = TypeVar("Wanted_co", bound=Reference | tuple[()], covariant=True)
"""Type of the reference in one row of the log; () until the loop has set it."""


@immutable
class InputRow(Generic[Wanted_co]):
    """Inputs of the closed loop at a control instant: time and reference.

    Of a scenario whose phases wait it is the time alone, a ``GivenRow``; the loop puts the reference there, and
    ``path_time``.
    ``told`` is the time-scaled sample that the law receives in its place and ``path_time`` the reference's time, s
    (:mod:`skyarm.reference.path_time`); both are empty where none is planned: structure.
    """

    time: Scalar
    reference: Wanted_co
    told: Reference | tuple[()] = ()
    path_time: Scalar | tuple[()] = ()


GivenRow = InputRow[Reference | tuple[()]]
"""Inputs as the loop receives them, with or without a reference."""


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
    readings: tuple[tuple[str, Tree], ...]
    wind: WindSample
    found: tuple[Scalar, ...] = ()
    led: tuple[Scalar, ...] = ()


def carry_over(
    first: LoopState, now: LoopState, places: tuple[Sequence[str], Sequence[str]], clock: Clock = ()
) -> LoopState:
    """Transfer the closed-loop state to a changed scenario; states whose structure differs are initialised anew.

    Args:
        first: first state of the changed scenario.
        now: state of the loop before.
        places: parameter paths of the environment components in the new and the old scenario.
        clock: clock of another reference than before, as it begins in this period; () where it is the same one.
    """
    before = dict(zip(places[1], now.components, strict=True))
    new, old = first.agent, now.agent
    drives = zip(new.drives, old.drives, strict=True) if len(new.drives) == len(old.drives) else ()
    agent = AgentLoop(
        state=_kept(new.state, old.state),
        memory=_kept(new.memory, old.memory),
        queue=_kept(new.queue, old.queue),
        sensors=_kept(new.sensors, old.sensors),
        estimate=_kept(new.estimate, old.estimate),
        drives=tuple(_kept(*both) for both in drives) or new.drives,
        clock=clock or _kept(new.clock, old.clock),
    )
    components = tuple(_kept(own, before.get(at)) for at, own in zip(places[0], first.components, strict=True))
    return LoopState(alive=now.alive, ticks=now.ticks, agent=agent, components=components)


def _kept(new: Record, old: Record) -> Record:
    return new if mismatch(new, old, "memory") else old


def structure_of(record: Record) -> Record:
    """Copy of a dataclass with every scalar set to 0.0, as a template of its structure for tracing."""
    if is_record(record) or isinstance(record, tuple):
        return rebuild(record, iter([0.0] * len(leaves(record))))
    return record
