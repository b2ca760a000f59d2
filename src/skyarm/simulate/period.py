"""Sequence of computations in one control period of the closed loop, shared by all
simulators.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import chain
from math import prod
from typing import NamedTuple, Protocol, TypeVar

from skyarm.algebra import Motion, Scalar, Scalars
from skyarm.compile.llvm.kernel import SHARES
from skyarm.compile.tracing.lower import compiled_once
from skyarm.control.law_estimates import numbers_found
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.plant.loads import wind_at
from skyarm.plant.surroundings import Memories, Together
from skyarm.records.identity import all_files
from skyarm.records.leaves import Tree, blend
from skyarm.records.plain import digest, plain
from skyarm.reference import Reference
from skyarm.simulate.loop_state import (
    AgentLoop,
    AgentSample,
    Clock,
    GivenRows,
    InputRow,
    LoopState,
    Sample,
)
from skyarm.simulate.plant_steps import RigidBodySteps, Substeps
from skyarm.simulate.stages import Readings, Stages
from skyarm.world import WindSample

Body = TypeVar("Body")
"""Type of the state of a moving body."""


class PlantSteps(Protocol[Body]):
    """Interface (typing.Protocol) of plant models within one control period, over any
    scalar type.
    """

    def proper_accelerations(
        self, states: Sequence[Body], commands: Sequence[Command], around: Together
    ) -> tuple[Motion, ...]:
        """Specific force (m/s^2) and angular acceleration (rad/s^2) of each base, at
        its origin, base axes.
        """
        ...

    def advance(
        self,
        states: Sequence[Body],
        before: Sequence[Command],
        after: Sequence[Command],
        around: Together,
    ) -> tuple[tuple[Body, ...], Memories]:
        """States of vehicles and contacts after a control period in which new commands
        arrive.
        """
        ...


class AgentHalf(NamedTuple):
    """Results of the first half of a control period for one vehicle: surroundings,
    sensor readings, measurement.

    Attributes:
        components: memories of its own environment models.
        acting: the command that acts before this period's arrives. wind: surroundings
            as the log has them.
        read: sensors, estimator, readings for the log and the law's measurement.
    """

    components: Memories
    acting: Command
    wind: WindSample
    read: Readings


class FirstHalf(NamedTuple):
    """Results of the first half of a control period: surroundings of all vehicles, and
    what each has measured.

    Attributes:
        components: memories of the shared environment models. around: surroundings of
            the period.
        agents: results of each vehicle.
    """

    components: Memories
    around: Together
    agents: tuple[AgentHalf, ...]


Uniforms = Scalars
"""Random numbers of a period, uniform in (0, 1)."""

Period = Callable[[LoopState, GivenRows, Uniforms], tuple[LoopState, Sample]]

Rows = Sequence[InputRow[Reference]]
"""Inputs of all vehicles at a control instant, with their references."""


def measure(
    stages: Stages,
    plant: PlantSteps[State],
    now: LoopState,
    rows: Rows,
    uniforms: Uniforms,
) -> FirstHalf:
    """Evaluate winds, contacts, sensors and estimator of every vehicle at the start of
    a control period.
    """
    own, shared, around = stages.surround(now, rows, uniforms)
    motions = stages.motions(now, around)
    acting = [
        each.acting(loop.queue)
        for each, loop in zip(stages.agents, now.agents, strict=True)
    ]
    forces = plant.proper_accelerations(
        [loop.state for loop in now.agents], acting, around
    )
    measured = []
    for i, (each, loop, draws) in enumerate(
        zip(
            stages.agents,
            now.agents,
            stages.draws.shares(uniforms).sensors,
            strict=True,
        )
    ):
        beside = around.of(i)
        motion = motions[i]
        wind = wind_at(beside, motion)
        pushes = each.pushes(beside, motion, acting[i])
        read = each.sense(
            loop, now.ticks, forces[i], acting[i], rows[i].time, draws, pushes
        )
        # a grasp is one of the models of this period, and measured as it is now
        read = each.with_grasp(read, (*own[i], *shared))
        measured.append(AgentHalf(own[i], acting[i], wind, read))
    return FirstHalf(shared, around, tuple(measured))


class Decided(NamedTuple):
    """Output of one vehicle's law in a control period: its next internal state,
    command, reference clock.
    """

    memory: Tree
    command: Command
    clock: Clock = ()


def decide(
    stages: Stages, now: LoopState, measured: FirstHalf, rows: Rows
) -> list[Decided]:
    """Evaluate the law of every vehicle, and the clock of a reference whose phases
    wait.
    """
    decided = []
    # all references first: a team's law gives its instructions to every vehicle at once
    references = stages.law_references(rows, measured.components)
    loops = zip(
        stages.agents, now.agents, measured.agents, rows, references, strict=True
    )
    for each, own, half, row, reference in loops:
        seen = each.with_images(half.read.measurement, own)
        memory, command = each.decide(own.memory, seen, reference, row.path_time)
        decided.append(
            Decided(
                memory,
                command,
                # the law's next memory: a phase may wait for the force observed now
                each.waits.advance(own.clock, now.ticks, seen, row, memory),
            )
        )
    return decided


def act(
    stages: Stages,
    plant: PlantSteps[State],
    now: LoopState,
    measured: FirstHalf,
    decided: Sequence[Decided],
) -> LoopState:
    """Apply commands through delay, joint drives and plant; return the loop state after
    the control period.
    """
    alive = now.alive
    agents = list[AgentLoop]()
    acting = list[Command]()
    for each, own, half, law in zip(
        stages.agents, now.agents, measured.agents, decided, strict=True
    ):
        # one command that is not finite ends the episode of all
        alive, queue, arrived = each.send(alive, own.queue, law.command)
        agents.append(
            AgentLoop(
                state=own.state,
                memory=law.memory,
                queue=queue,
                sensors=half.read.sensors,
                estimate=half.read.estimate,
                drives=each.drive(own.drives, half.acting, arrived, own.state),
                clock=law.clock,
                components=half.components,
                images=own.images,
            )
        )
        acting.append(arrived)
    # the plant takes the drives as they are after this period's setpoints
    around = measured.around.with_drives([each.drives for each in agents])
    before = [half.acting for half in measured.agents]
    states, coupled = plant.advance(
        [own.state for own in now.agents], before, acting, around
    )
    after = around.with_coupled(coupled)
    flown = zip(agents, states, after.each, strict=True)
    moved = tuple(
        replace(each, state=state, components=beside.memories)
        for each, state, beside in flown
    )
    return LoopState(
        alive=alive, ticks=now.ticks + alive, agents=moved, components=after.memories
    )


def make_period(stages: Stages, plant: PlantSteps[State]) -> Period:
    """Make the function that advances the closed loop by one control period.

    An episode that has ended keeps the state it ended in; only the laws' memories,
    which nobody reads then, go on.

    Args:
        stages: stages of the scenario.
        plant: plant model over the same scalars.
    """

    def period(
        before: LoopState, given: GivenRows, uniforms: Uniforms
    ) -> tuple[LoopState, Sample]:
        rows = stages.lead(before, given)
        now = replace(before, alive=stages.alive(before, rows))
        measured = measure(stages, plant, now, rows, uniforms)
        decided = decide(stages, now, measured, rows)
        following = act(stages, plant, now, measured, decided)
        over = zip(before.agents, decided, strict=True)
        ended = replace(
            before,
            alive=0.0,
            agents=tuple(replace(own, memory=law.memory) for own, law in over),
        )
        sample = _sample(stages, before, measured, decided, following.alive)
        # the sample stays that of the instant: a log ends with what ended the flight
        return blend(following.alive > 0.5, following, ended), sample

    return period


def make_fleet_period(whole: Stages, substeps: Substeps) -> Period | None:
    """Make the function that advances equal vehicles, whose period is compiled once,
    with the bits of any team's.

    Where one ends, others go on to the end of that period: a flight is flown again up
    to its end.

    Args:
        whole: stages of the scenario, whose numbers are concrete.
        substeps: counts of integration steps in an interval (s).

    Returns:
        None if vehicles differ in more than paths and first states, if one acts on
        another or a model on one alone, where it does not pay, and for code of the
        user's, which may tell vehicles by their names.
    """
    scenario = whole.scenario
    agents = [*whole.scenario.agents.values()]
    if (
        # cheap questions first: digests and sources of all vehicles take the longest
        scenario.steps > SHARES * (len(agents) - 3)
        or whole.shared
        or any(model.coupled or getattr(model, "agent", "") for model in whole.own[0])
        or any(
            each.tracking_start or each.reference.guards or each.reference.load
            for each in agents
        )
        or len(
            {
                digest(
                    plain(replace(each, reference=agents[0].reference, initial=None))
                )
                for each in agents
            }
        )
        > 1
        or all_files(scenario)
    ):
        return None
    stages = Stages(
        replace(scenario, agents={next(iter(scenario.agents)): agents[0]}, changes=())
    )
    one = make_period(stages, RigidBodySteps(stages, substeps))

    def period(
        before: LoopState, given: GivenRows, uniforms: Uniforms
    ) -> tuple[LoopState, Sample]:
        flown = list[tuple[LoopState, Sample]]()
        draws = whole.draws.shares(uniforms)
        for i, own in enumerate(before.agents):
            # as the period of one vehicle deals them out: sensors first, then models
            numbers = tuple(chain(*draws.sensors[i], *draws.components[i]))
            record = replace(before, agents=(own,)), given[i : i + 1], numbers
            # a constant key: within one program there is only this period to share
            flown.append(compiled_once("period", lambda each: one(*each), record))
        # 1.0 or 0.0 of each: the team is alive while all are
        alive = prod(after.alive for after, _ in flown)
        agents, samples = (
            tuple(each.agent for each in column) for column in zip(*flown, strict=True)
        )
        following = replace(
            before, alive=alive, ticks=before.ticks + alive, agents=agents
        )
        return following, Sample(alive=alive, agents=samples)

    return period


def _sample(
    stages: Stages,
    before: LoopState,
    measured: FirstHalf,
    decided: Sequence[Decided],
    alive: Scalar,
) -> Sample:
    """Quantities of the control instant that a log may contain."""
    rows = zip(stages.agents, before.agents, measured.agents, decided, strict=True)
    agents = tuple(
        AgentSample(
            state=own.state,
            command=law.command,
            measurement=half.read.measurement,
            readings=half.read.readings,
            wind=half.wind,
            found=numbers_found(law.memory),
            led=each.waits.log_values(own.clock, before.ticks),
        )
        for each, own, half, law in rows
    )
    return Sample(alive=alive, agents=agents)
