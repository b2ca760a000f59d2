"""The stages of a control period as programs over flat tuples of floats: for plants and laws that cannot be traced."""

from __future__ import annotations

import copy
from dataclasses import replace
from functools import cached_property
from typing import Any

from skyarm.compile import leaves, rebuild
from skyarm.control.blocks.observed_push import PushAlone
from skyarm.control.found_by_law import numbers_found
from skyarm.plant.coupled_memory import places_among
from skyarm.records.leaves import parts
from skyarm.simulate.flat_function import ONE, Flat, FlatFunction, replaced_at
from skyarm.simulate.loop_state import LoopState, Row
from skyarm.simulate.period import Begun, Response, begin, issue, respond
from skyarm.simulate.stages import Readings, Stages


class EpisodeEndedError(Exception):
    """An ending came within a period.

    Attributes:
        command: flat, if it was the command; else None.
    """

    def __init__(self, command: Flat | None = None) -> None:
        super().__init__("the episode has ended")
        self.command = command


class FlatStages:
    """The stages of an episode over flat tuples: those before and those between the plant's two calls, a program each.

    A law that is called, or a command from outside, cuts the second program in two: sensing, and what follows the
    command. Programs are made when they are first needed.

    Args:
        stages: of the episode. first: its first loop state. row: what an instant is fed, as an example; in flight
            its ``reference`` holds all that is fed but the time.

    Attributes:
        given: a command in place of the law's, whose memory stays; None for the law's own.
    """

    def __init__(self, stages: Stages, first: LoopState, row: Row) -> None:
        self._stages, self._first, self._fed = stages, first, row
        self._row = row
        if first.clock != ():
            reference, told, path_time = self._lead.example(0)
            self._row = replace(row, reference=reference, told=told, path_time=path_time)
        self._traced = stages.scenario.controller.compiled
        # not from zeros: a component may refuse numbers that are not its own
        self._around = stages.surroundings(first.components, first.drives, 0.0)
        self._uniforms = (0.0,) * sum(count for _, count in stages.draws.needed)
        self.given: Flat | None = None

    @cached_property
    def _lead(self) -> FlatFunction:
        def program(ticks: Any, clock: Any, row: Row) -> tuple[Any, ...]:
            now = replace(self._first, ticks=ticks[0], clock=clock)
            fed = self._stages.led(now, row)
            return ((fed.reference, fed.told, fed.path_time),)

        return FlatFunction(program, ONE, self._first.clock, self._fed)

    def led(self, now: Any, row: Any) -> Any:
        """What the instant is fed, with the reference where its own clock stands."""
        return (
            replace(row, reference=self._lead(now.ticks, now.clock, (*row.time, *row.reference))[0])
            if now.clock
            else row
        )

    def path_times(self, now: Any) -> Flat:
        """What the log keeps of a reference that waits."""
        return self._times(now.ticks, now.clock)[0] if now.clock else ()

    @cached_property
    def _times(self) -> FlatFunction:
        def program(ticks: Any, clock: Any) -> tuple[Any, ...]:
            return (self._stages.path_times(replace(self._first, ticks=ticks[0], clock=clock)),)

        return FlatFunction(program, ONE, self._first.clock)

    @property
    def led_count(self) -> int:
        """How many numbers the log keeps of a reference that waits."""
        return 0 if self._first.clock == () else len(self._stages.path_times(self._first))

    @cached_property
    def _begin(self) -> FlatFunction:
        def program(alive: Any, x: Any, queue: Any, m: Any, d: Any, c: Any, row: Row, uniforms: Any) -> Begun:
            now = replace(self._first, alive=alive[0], state=x, queue=queue, components=m, drives=d, clock=c)
            return begin(self._stages, now, row, uniforms)

        x = self._first
        return FlatFunction(program, ONE, x.state, x.queue, x.components, x.drives, x.clock, self._row, self._uniforms)

    @cached_property
    def _respond(self) -> FlatFunction:
        def program(
            alive: Any, k: Any, x: Any, m: Any, queue: Any, s: Any, e: Any, d: Any, c: Any, row: Row, u: Any, f: Any,
            p: Any, draws: Any,
        ) -> tuple[Any, ...]:  # fmt: skip
            now = replace(self._first, ticks=k[0], state=x, memory=m, queue=queue, sensors=s, estimate=e, drives=d)
            now = replace(now, clock=c)
            return respond(self._stages, now, row, Begun(alive[0], (), self._around, u, (), p), f, draws)[:-1]

        x = self._first
        loop = x.state, x.memory, x.queue, x.sensors, x.estimate, x.drives, x.clock
        felt = x.state.velocity, self._pushes
        return FlatFunction(program, ONE, ONE, *loop, self._row, x.queue[0], *felt, self._uniforms)

    @cached_property
    def _pushes(self) -> Any:
        """What sensors of force feel, as an example."""
        return self._begin.example(Begun._fields.index("pushes"))

    @cached_property
    def _sense(self) -> FlatFunction:
        def program(s: Any, e: Any, k: Any, x: Any, f: Any, u: Any, t: Any, uniforms: Any, p: Any) -> tuple[Any, ...]:
            read = self._stages.sense(s, e, k[0], x, f, u, t[0], uniforms, p)
            return read.sensors, read.estimate, read.readings, read.measurement

        x, force = self._first, self._first.state.velocity
        given = x.state, force, x.queue[0], ONE, self._uniforms, self._pushes
        return FlatFunction(program, x.sensors, x.estimate, ONE, *given)

    @cached_property
    def _issue(self) -> FlatFunction:
        def program(alive: Any, k: Any, x: Any, queue: Any, d: Any, command: Any) -> tuple[Any, ...]:
            now = replace(self._first, ticks=k[0], state=x, queue=queue, drives=d)
            nothing: Any = ()
            read = Readings(sensors=(), estimate=(), readings=(), measurement=nothing)
            begun = Begun(alive[0], (), self._around, self._stages.acting(queue), ())
            return issue(self._stages, now, begun, read, (), command, ())[:-1]

        x = self._first
        return FlatFunction(program, ONE, ONE, x.state, x.queue, x.drives, x.queue[0])

    @cached_property
    def _wait(self) -> FlatFunction:
        def program(clock: Any, k: Any, told: Any, row: Row, memory: Any, command: Any) -> tuple[Any, ...]:
            return (self._stages.wait(clock, k[0], told, row, memory, command),)

        memory = self._first.memory if self._traced else PushAlone.of(self._first.memory)
        return FlatFunction(program, self._first.clock, ONE, self.told, self._row, memory, self._first.queue[0])

    @cached_property
    def wind(self) -> Any:
        """What the log keeps of the surroundings, as an example."""
        return self._begin.example(Begun._fields.index("wind"))

    @cached_property
    def readings(self) -> Any:
        """The readings that the log keeps, as an example."""
        return self._respond.example(Response._fields.index("readings")) if self._traced else self._sense.example(2)

    @cached_property
    def told(self) -> Any:
        """What the law is told, as an example."""
        return self._respond.example(Response._fields.index("measurement")) if self._traced else self._sense.example(3)

    def surround(self, now: Any, row: Any, uniforms: Flat) -> Begun:
        """What stands before the plant is first called."""
        loop = now.alive, now.state, now.queue, now.components, now.drives, now.clock
        return Begun._make(self._begin(*loop, row.time, row.reference, uniforms))

    def begin(self, now: Any, row: Any, uniforms: Flat) -> Begun:
        """What stands before the plant is first called; raises where an ending has come."""
        found = self.surround(now, row, uniforms)
        if found.alive[0] < 0.5:
            raise EpisodeEndedError
        return found

    def respond(self, now: Any, row: Any, begun: Begun, force: Flat, uniforms: Flat) -> Response:
        """What stands between the plant's two calls; raises where the command is refused."""
        if self._traced and self.given is None:
            loop = now.state, now.memory, now.queue, now.sensors, now.estimate, now.drives, now.clock
            given = row.time, row.reference, begun.acting, force, begun.pushes, uniforms
            found = Response._make((*self._respond(begun.alive, now.ticks, *loop, *given), begun.around))
        else:
            found = self._in_pieces(now, row, begun, force, uniforms)
        if found.alive[0] < 0.5:
            raise EpisodeEndedError(found.command)
        if not found.drives:
            return found
        # drive memories are the last numbers of the surroundings
        return found._replace(around=(*begun.around[: -len(found.drives)], *found.drives))

    def sense(self, now: Any, row: Any, begun: Begun, force: Flat, uniforms: Flat) -> list[Flat]:
        """Memories of the sensors and of the estimator, the readings for the log, and what the law is told."""
        loop = now.sensors, now.estimate, now.ticks, now.state
        return self._sense(*loop, force, begun.acting, row.time, uniforms, begun.pushes)

    def _in_pieces(self, now: Any, row: Any, begun: Begun, force: Flat, uniforms: Flat) -> Response:
        """A response whose command is made outside of any program."""
        sensors, estimate, readings, told = self.sense(now, row, begun, force, uniforms)
        memory, command = now.memory, self.given
        if command is None:
            # a law that cannot be traced is called with records of floats; its memory is its own
            seen, fed = rebuild(self.told, iter(told)), rebuild(self._row, iter((*row.time, *row.reference)))
            memory, decided = self._stages.decide(memory, seen, self._stages.joined(fed), fed.path_time)
            command = tuple(leaves(decided))
        parts = self._issue(begun.alive, now.ticks, now.state, now.queue, now.drives, command)
        found = Response._make((*parts, begun.around))
        clock: Flat = ()
        if now.clock:
            held = memory if self._traced else tuple(leaves(PushAlone.of(memory)))
            (clock,) = self._wait(now.clock, now.ticks, told, (*row.time, *row.reference), held, command)
        return found._replace(
            memory=memory, sensors=sensors, estimate=estimate, measurement=told, readings=readings, command=command,
            clock=clock,
        )  # fmt: skip

    @cached_property
    def found_places(self) -> tuple[int, ...]:
        """Places of what the law finds out among the numbers of its memory."""
        first = self._first.memory
        return numbers_found(rebuild((first,), iter(range(len(leaves(first)))))[0]) if self._traced else ()

    def found(self, memory: Any) -> Flat:
        """What the law has found out, for the log."""
        return tuple(memory[place] for place in self.found_places)

    @cached_property
    def _coupled(self) -> tuple[int, ...]:
        return places_among(self._first.components, self._stages.coupled)

    def gone_on(self, memories: Flat, coupled: Flat) -> Flat:
        """Memories of the components at the end of the period."""
        return replaced_at(self._coupled, memories, coupled)

    def keep(self, alive: Flat, following: LoopState, now: LoopState) -> LoopState:
        """The next period's state."""
        return following


def flatten(first: LoopState, *, called: bool) -> Any:
    """A loop state whose fields are flat tuples; a law that is called gets a copy of its memory: it may write to it."""
    fields = {name: tuple(leaves(part)) for name, part in parts(first).items()}
    if called:
        fields["memory"] = copy.deepcopy(first.memory)
    return LoopState(**fields)  # type: ignore[arg-type]
