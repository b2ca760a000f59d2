"""One control period of the closed loop, stage after stage: the one loop of every engine."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

from skyarm.simulate.loop_state import LoopState, Row, Sample


class PlantSteps(Protocol):
    """A plant within a period: numbers of whatever kind the engine flies."""

    def specific_force(self, state: Any, command: Any, around: Any) -> Any:
        """Proper acceleration of the base origin, base axes, m/s^2."""
        ...

    def advance(self, state: Any, before: Any, after: Any, around: Any) -> Any:
        """State and coupled memories after the period: under the command before for the late part, then under this."""
        ...


class Begun(NamedTuple):
    """What stands before the plant is asked what its accelerometer reads.

    Attributes:
        alive: 1 while no ending has come. components: memories of air and forces. around: surroundings of the period.
        acting: the command that acts before this period's arrives. wind: what the log keeps of the surroundings.
        pushes: what sensors of force feel, one behind the other; () without any.
    """

    alive: Any
    components: Any
    around: Any
    acting: Any
    wind: Any
    pushes: Any = ()


class Response(NamedTuple):
    """What the plant is given for the period, and the memories of those who decided it.

    Attributes:
        alive: 1 while the command is finite, too. ticks, memory, queue, sensors, estimate, drives: of the loop state.
        command: of the law. measurement: that the law received. readings: that the log keeps beside it.
        acting: the command that acts now.
        clock: of a reference that waits. around: surroundings, the drives having heard their setpoints.
    """

    alive: Any
    ticks: Any
    memory: Any
    queue: Any
    sensors: Any
    estimate: Any
    drives: Any
    command: Any
    measurement: Any
    readings: Any
    acting: Any
    clock: Any
    around: Any


Period = Callable[[LoopState, Row, Any], tuple[LoopState, Sample]]


def begin(stages: Any, now: LoopState, row: Row, uniforms: Any) -> Begun:
    """Endings, surroundings and the command that acts: the stages before the plant is first called."""
    alive = stages.check(now.alive, now.state, row.reference, now.clock)
    components, around = stages.surround(now.components, now.drives, now.state, row.time, uniforms, row.path_time)
    wind, pushes = stages.felt(around, now.state), stages.pushes(around, now.state)
    return Begun(alive, components, around, stages.acting(now.queue), wind, pushes)


def respond(stages: Any, now: LoopState, row: Row, begun: Begun, force: Any, uniforms: Any) -> Response:
    """Sensors, estimator, law, command line and drives: the stages between the plant's two calls."""
    read = stages.sense(
        now.sensors, now.estimate, now.ticks, now.state, force, begun.acting, row.time, uniforms, begun.pushes
    )
    memory, command = stages.decide(now.memory, read.measurement, stages.joined(row), row.path_time)
    clock = stages.wait(now.clock, now.ticks, read.measurement, row, memory, command)
    return issue(stages, now, begun, read, memory, command, clock)


def issue(stages: Any, now: LoopState, begun: Begun, read: Any, memory: Any, command: Any, clock: Any = ()) -> Response:
    """Command line and drives: the stages after the law."""
    alive, queue, acting = stages.send(begun.alive, now.queue, command)
    drives = stages.drive(now.drives, begun.acting, acting, now.state)
    return Response(
        alive=alive,
        ticks=stages.count(now.ticks, alive),
        memory=memory,
        queue=queue,
        sensors=read.sensors,
        estimate=read.estimate,
        drives=drives,
        command=command,
        measurement=read.measurement,
        readings=read.readings,
        acting=acting,
        clock=clock,
        around=stages.with_drives(begun.around, drives),
    )


def after_period(stages: Any, begun: Begun, found: Response, state: Any, coupled: Any) -> LoopState:
    """The loop state after a period that ends in a state of the plant, with the coupled memories that it left."""
    return LoopState(
        alive=found.alive,
        ticks=found.ticks,
        state=state,
        memory=found.memory,
        queue=found.queue,
        sensors=found.sensors,
        estimate=found.estimate,
        components=stages.gone_on(begun.components, coupled),
        drives=found.drives,
        clock=found.clock,
    )


def make_period(stages: Any, plant: PlantSteps) -> Period:
    """The function of one control period.

    An episode that has ended keeps the state it ended in.

    Args:
        stages: :class:`skyarm.simulate.stages.Stages`. plant: of the same numbers.
    """

    def period(now: LoopState, row: Row, uniforms: Any) -> tuple[LoopState, Sample]:
        row = stages.led(now, row)
        begun = begin(stages, now, row, uniforms)
        force = plant.specific_force(now.state, begun.acting, begun.around)
        found = respond(stages, now, row, begun, force, uniforms)
        state, coupled = plant.advance(now.state, begun.acting, found.acting, found.around)
        following = after_period(stages, begun, found, state, coupled)
        sample = Sample(
            alive=found.alive,
            state=now.state,
            command=found.command,
            measurement=found.measurement,
            readings=found.readings,
            wind=begun.wind,
            found=stages.found(found.memory),
            led=stages.path_times(now),
        )
        return stages.keep(found.alive, following, now), sample

    return period
