"""Dataclasses of the closed loop: state between control periods, inputs, and logged
quantities.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Generic, TypeVar

from skyarm.algebra import Scalar, Scalars, Vec3
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.plant.surroundings import Memories
from skyarm.records.immutable import immutable
from skyarm.records.leaves import Record, Tree, is_record, leaves, mismatch, rebuild
from skyarm.reference import Reference
from skyarm.sensing.measurement import Image, Measurement
from skyarm.world import WindSample


@immutable
class SensorState:
    """State of one sensor between two control periods: internal state, last reading,
    delay queue.

    Attributes:
        memory: internal state of the sensor.
        held: its last reading, for a sensor slower than the loop; else ``()``.
        waiting: readings on their way, oldest first.
    """

    memory: Tree
    held: Tree
    waiting: tuple[Tree, ...]


Shift = tuple[Vec3, Scalar] | tuple[()]
"""Offset (m) of a reference and the path time, in control periods, at which it began;
() where no phase may end early."""


@immutable
class PathClock:
    """State of the clock of a reference that waits for conditions (guards); times are
    counts of control periods.

    Attributes:
        place: current path time. held: path time of the held sample.
        guard: index of the next guard. waited: time spent waiting for it. reached: time
            for which it has been met.
        origin: tip position at the start of the phase, m, world axes. failed: 1 once a
            mandatory phase has failed.
        shift: offset of the reference after a phase that ended early, m, and the path
            time at which it began. held_shift: that of the held sample.
    """

    place: Scalar
    held: Scalar
    guard: Scalar
    waited: Scalar
    reached: Scalar
    origin: Vec3 | tuple[()]
    failed: Scalar
    shift: Shift
    held_shift: Shift


Clock = PathClock | tuple[()]
"""State of the reference's clock; () where no phase waits."""


@immutable
class AgentLoop:
    """State of one vehicle, its plant and its control, from one control period to the
    next.

    Attributes:
        state: state of the plant. memory: internal state of the law.
        queue: commands on their way, oldest first; the first acts now.
        sensors: the full state's first, then the named ones. estimate: memory of the
            estimator.
        drives: memories of the joint drives.
        clock: clock of a reference whose phases wait
            (:mod:`skyarm.simulate.reference_clock`); () where none does.
        components: memories of the environment models that the vehicle has for itself.
        images: newest picture of each sensor that its law or an ending sees
            (:mod:`skyarm.simulate.pictures`), from outside: no period changes it.
    """

    state: State
    memory: Tree
    queue: tuple[Command, ...]
    sensors: tuple[SensorState, ...]
    estimate: Tree
    drives: Memories
    clock: Clock = ()
    components: Memories = ()
    images: tuple[Image, ...] = ()


@immutable
class LoopState:
    """State of the closed loop from one control period to the next.

    Attributes:
        alive: 1 while the episode runs, 0 once it has ended. ticks: control periods
            flown.
        agents: each vehicle and its control. components: memories of the environment
            models that all share.
    """

    alive: Scalar
    ticks: Scalar
    agents: tuple[AgentLoop, ...]
    components: Memories

    @property
    def agent(self) -> AgentLoop:
        """The only vehicle and its control."""
        (only,) = self.agents
        return only

    @property
    def memories(self) -> Memories:
        """Memories of all environment models of the only vehicle, in the order of
        ``Scenario.components``.
        """
        return (*self.agent.components, *self.components)

    def with_agent(self, agent: AgentLoop) -> LoopState:
        """Copy with another state of the only vehicle."""
        return replace(self, agents=(agent,) * len(self.agents))


Wanted_co = TypeVar("Wanted_co", bound=Reference | tuple[()], covariant=True)
"""Type of the reference in one row of the log; () until the loop has set it."""


@immutable
class InputRow(Generic[Wanted_co]):
    """Inputs of the closed loop at a control instant: time and reference.

    Of a scenario whose phases wait it is the time alone, a ``GivenRow``; the loop puts
    the reference there, and ``path_time``. ``scaled`` is the time-scaled sample that
    the law receives in its place and ``path_time`` the reference's time, s
    (:mod:`skyarm.reference.path_time`); both are empty where none is planned:
    structure.
    """

    time: Scalar
    reference: Wanted_co
    scaled: Reference | tuple[()] = ()
    path_time: Scalar | tuple[()] = ()


GivenRow = InputRow[Reference | tuple[()]]
"""Inputs of one vehicle as the loop receives them, with or without a reference."""

GivenRows = tuple[GivenRow, ...]
"""Inputs of all vehicles at a control instant."""


@immutable
class AgentSample:
    """Quantities of one vehicle at a control instant that a log may contain.

    ``measurement`` is what the law received; ``readings`` are those of the sensors that
    a log keeps, name and record of each, as they had arrived; ``found`` are the online
    estimates of the law, () of most laws (:mod:`skyarm.control.law_estimates`); ``led``
    are the :meth:`skyarm.simulate.reference_clock.Waits.times` of a reference that
    waits.
    """

    state: State
    command: Command
    measurement: Measurement
    readings: tuple[tuple[str, Tree], ...]
    wind: WindSample
    found: Scalars = ()
    led: Scalars = ()


@immutable
class Sample:
    """Quantities of one control instant that a log may contain: those of all vehicles
    while the episode is alive.
    """

    alive: Scalar
    agents: tuple[AgentSample, ...]

    @property
    def agent(self) -> AgentSample:
        """Quantities of the only vehicle."""
        (only,) = self.agents
        return only


Places = tuple[tuple[tuple[str, ...], ...], tuple[str, ...]]
"""Parameter paths of each vehicle's own environment models, and of those that all
share."""


def carry_over(
    first: LoopState,
    now: LoopState,
    places: tuple[Places, Places],
    clocks: Sequence[Clock],
) -> LoopState:
    """Transfer the closed-loop state to a changed scenario; states whose structure
    differs are initialised anew.

    Args:
        first: first state of the changed scenario.
        now: state of the loop before.
        places: parameter paths of the environment components in the new and the old
            scenario.
        clocks: clocks of other references than before, as they begin in this period; ()
            where it is the same one.
    """
    (own, shared), (owned, shared_before) = places
    rows = zip(first.agents, now.agents, own, owned, clocks, strict=True)
    agents = tuple(
        replace(
            _carry_agent(new, old, clock),
            components=_carry_models(new.components, old.components, at, before),
        )
        for new, old, at, before, clock in rows
    )
    components = _carry_models(first.components, now.components, shared, shared_before)
    return LoopState(
        alive=now.alive, ticks=now.ticks, agents=agents, components=components
    )


def _carry_models(
    new: Memories, old: Memories, places: Sequence[str], places_before: Sequence[str]
) -> Memories:
    """Internal states of environment models, kept where a model of the same structure
    stands at the same path.
    """
    before = dict(zip(places_before, old, strict=True))
    return tuple(
        _kept(own, before.get(at)) for at, own in zip(places, new, strict=True)
    )


def _carry_agent(new: AgentLoop, old: AgentLoop, clock: Clock) -> AgentLoop:
    """State of a vehicle and its control, kept in each part that has the same structure
    as before.
    """
    drives = (
        # drives have no names: of another number none is known to be the same
        zip(new.drives, old.drives, strict=True)
        if len(new.drives) == len(old.drives)
        else ()
    )
    kept = {
        name: _kept(getattr(new, name), getattr(old, name))
        for name in ("state", "memory", "queue", "sensors", "estimate", "images")
    }
    return replace(
        new,
        drives=tuple(_kept(*both) for both in drives) or new.drives,
        clock=clock or _kept(new.clock, old.clock),
        **kept,
    )


def _kept(new: Record, old: Record) -> Record:
    # numbers of another structure mean something else: such a part begins anew
    return new if mismatch(new, old, "memory") else old


def structure_of(record: Record) -> Record:
    """Copy of a dataclass with every scalar set to 0.0, as a template of its structure
    for tracing.
    """
    if is_record(record) or isinstance(record, tuple):
        return rebuild(record, [0.0] * len(leaves(record)))
    return record
