"""Traced program of one environment step: action in; observation, reward and
termination out.

A control period of the loop (:mod:`skyarm.simulate.period`) begins with what is
measured and ends with the plant. An environment's step is cut elsewhere: it takes an
action for what was measured before, flies the plant, and measures what the next period
begins with, which is what a policy acts on next. The stages and their order are the
loop's, and so are the numbers: :class:`skyarm.Session` with the same commands flies the
same bits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from skyarm.algebra import Scalar, Scalars, Vec3
from skyarm.algebra.scalars import absolute, clip, logical_and, where
from skyarm.compile.tracing.program import Loop, Program, trace
from skyarm.dynamics import State
from skyarm.dynamics.actuators.tilting import with_rest
from skyarm.envs.action_kinds import Decision, Turn
from skyarm.envs.env_task import LearningTask
from skyarm.envs.observed_quantities import Result, Sight
from skyarm.records.immutable import immutable
from skyarm.records.leaves import blend, leaves, rebuild
from skyarm.reference import Reference
from skyarm.scenario.endings import Divergence
from skyarm.scenario.numbers import number_at, with_numbers
from skyarm.scenario.scenario_record import Scenario
from skyarm.sensing.measurement import Measurement
from skyarm.simulate.check_endings import endings_of
from skyarm.simulate.first_state import first_loop_state
from skyarm.simulate.inputs import held_row
from skyarm.simulate.loop_state import InputRow, LoopState, structure_of
from skyarm.simulate.period import AgentHalf, Decided, FirstHalf, act, measure
from skyarm.simulate.program import LoopProgram, TracedPeriod
from skyarm.simulate.stages import Readings, Stages

LARGEST = 1e6
"""Largest magnitude of observations and rewards; larger ones are clipped, NaN becomes
0."""


@immutable
class EnvState:
    """State of a learning environment between two steps.

    Attributes:
        loop: state of the closed loop; sensors, estimator and components are those of
            the next period.
        seen: numbers of the next period's measurement that the observation or the law
            uses.
        action: last action.
    """

    loop: LoopState
    seen: Scalars
    action: Scalars


@immutable
class StepOutcome:
    """Result of an environment step: observation, reward, truncation and termination.

    Attributes:
        observation: numbers. reward: number. truncated: 1 where the scenario's duration
            is over, and no ending came.
        ending: 0 while none has come, else which of the scenario's endings, from 1 on;
            one more than there are where the command was not finite.
    """

    observation: Scalars
    reward: Scalar
    truncated: Scalar
    ending: Scalar


class EnvProgram:
    """Compiled step function of a learning task, and the initial state of its episodes.

    Args:
        task: learning task. loops: keep repetitions as loops, for machine code; JAX
            wants them written out.

    Attributes:
        base: numbers of the randomised paths in the scenario as it is. draws: example
            of a period's uniform numbers.
        size: length of an action. statuses: words of a step's ending, by its number.
        first: state of an episode, as an example. loop: the step, traced; it logs a
            :class:`StepOutcome`.
    """

    def __init__(self, task: LearningTask, *, loops: bool = True) -> None:
        self.task = task
        scenario = task.scenario
        self.paths = task.randomised.paths
        self.base = tuple(number_at(scenario, path) for path in self.paths)
        self.size = task.actions.size(scenario.agent.model.vehicle)
        numbers = self.base, (0.0,) * self.size
        self._program = LoopProgram(
            scenario,
            self._scenario_of,
            numbers,
            stiffest=task.randomised.stiffest,
            loops=loops,
        )
        endings = endings_of(scenario)
        # numbers count from 1; the last one is of a command that was not finite
        self.statuses = ("", *(each.status for each in endings), "diverged")
        # number of the ending whose state means nothing any more
        self._diverged = next(
            1.0 + k for k, each in enumerate(endings) if isinstance(each, Divergence)
        )
        self.uniforms = self._program.draws
        # the middle of each, of which no inverse distribution is infinite
        self.draws = (0.5,) * sum(count for _, count in self.uniforms)
        self._measurement = structure_of(self._begin(self.base, self.draws, None)[1])
        self._kept = tuple(range(len(leaves(self._measurement))))
        # what of the measurement the next step reads shows in a first trace: usually
        # all for a law, nothing else
        whole = self._trace()
        used = {arg.index for node in whole.program.nodes for arg in node.args}
        count = whole.carry - len(self._kept) - self.size
        self._kept = tuple(
            i for i in self._kept if whole.program.inputs[count + i].index in used
        )
        self.loop = self._trace()

    def _trace(self) -> Loop:
        first, _ = self.start(self.base, self.draws)
        self.first: EnvState = structure_of(first)
        return self._program.trace(self.step, self.first, own_seeds=True)

    def _scenario_of(self, values: tuple[Sequence[Scalar], Scalars]) -> Scenario:
        """Scenario of an episode, from the values of its randomised parameters beside
        an action.
        """
        return with_numbers(
            self.task.scenario, dict(zip(self.paths, values[0], strict=True))
        )

    def start(
        self,
        numbers: Sequence[Scalar],
        draws: Scalars,
        started: Sequence[Sequence[Scalar]] | None = None,
    ) -> tuple[EnvState, Scalars]:
        """Initial state and observation of an episode.

        Args:
            numbers: values of the randomised paths.
            draws: uniform numbers of the first period.
            started: uniform numbers that start each component; the scenario's own if
                left out.
        """
        now, measurement, reference = self._begin(numbers, draws, started)
        action = (0.0,) * self.size
        state = EnvState(
            loop=now, seen=self._select_numbers(measurement), action=action
        )
        return state, self._observe(
            self._program.stages((numbers, ())), measurement, reference, action
        )

    def trace_start(self) -> Program:
        """Trace the reset of an episode into a program whose inputs are all the
        episode's parameters.
        """
        return trace(self.start, self.base, self.draws, self._program.start_draws)

    def _begin(
        self,
        numbers: Sequence[Scalar],
        draws: Scalars,
        started: Sequence[Sequence[Scalar]] | None,
    ) -> tuple[LoopState, Measurement, Reference]:
        """Initial closed-loop state, first measurement and first reference of an
        episode.
        """
        stages = self._program.stages((numbers, ()))
        first = first_loop_state(stages.scenario, started)
        if not self.task.actions.asks_law:
            # a law that is not asked needs no memory, which each lane would carry
            first = first.with_agent(replace(first.agent, memory=()))
        row = held_row(stages.scenario, first.ticks)
        return (
            *self._measure_next(stages, first, row, draws),
            stages.agent.law_reference(row),
        )

    def step(self, period: TracedPeriod, now: EnvState) -> tuple[EnvState, StepOutcome]:
        """Simulate one control period with an action, and compute observation and
        reward.
        """
        stages = period.stages
        # again here: JAX hands actions over as they are
        action = tuple(clip(a, -1.0, 1.0) for a in period.numbers[1])
        loop, own = now.loop, now.loop.agent
        row = held_row(stages.scenario, loop.ticks)
        memory, command = self._decide(stages, now, row, action)
        around = stages.surroundings(loop, row.time)
        nothing: Any = None
        read = Readings(
            sensors=own.sensors, estimate=own.estimate, readings=(), measurement=nothing
        )
        half = AgentHalf(own.components, stages.agent.acting(own.queue), nothing, read)
        decided = [Decided(memory, command, own.clock)]
        flown = act(
            stages,
            period.plant,
            loop,
            FirstHalf(loop.components, around, (half,)),
            decided,
        )
        sent = flown.alive
        # a command that is not finite ends the episode where it is, as in a single run
        state = blend(sent > 0.5, flown.agent.state, own.state)
        # endings are a separate output of the step, and a period that ends an episode
        # counts
        flown = flown.with_agent(replace(flown.agent, state=state))
        flown = replace(flown, alive=1.0, ticks=loop.ticks + 1.0)
        coming = held_row(stages.scenario, flown.ticks)
        ending = self._ending(
            stages.scenario, state, self._goal(stages.scenario, flown.ticks), sent
        )
        following, measurement = self._measure_next(
            stages, flown, coming, period.uniforms
        )
        ended = where(ending > 0.5, 1.0, 0.0)
        result = Result(
            state=state,
            reference=coming.reference,
            vehicle=stages.scenario.agent.vehicle,
            action=action,
            action_before=now.action,
            command=command,
            ended=ended,
            scenario=stages.scenario,
        )
        # term by term: what one of them makes of a number that is none takes nothing
        # from the others
        reward: Scalar = 0.0
        # numbers of endings are whole, so half tells one from the next
        sound = absolute(ending - self._diverged) > 0.5
        for term in self.task.reward:
            value = _finite(term.value(result) * term.weight)
            reward = reward + (where(sound, value, 0.0) if term.of_state else value)
        # ticks are a number of the trace: half a step keeps rounding out
        over = flown.ticks > self.task.scenario.steps - 0.5
        outcome = StepOutcome(
            observation=self._observe(
                stages, measurement, stages.agent.law_reference(coming), action
            ),
            reward=_finite(reward),
            truncated=where(logical_and(over, ending < 0.5), 1.0, 0.0),
            ending=ending,
        )
        return (
            EnvState(
                loop=following, seen=self._select_numbers(measurement), action=action
            ),
            outcome,
        )

    def _goal(self, scenario: Scenario, ticks: Scalar) -> Vec3:
        """Position reference at the end of a control period."""
        # a flight has no reference after its last period
        last = float(self.task.scenario.steps - 1)
        return held_row(scenario, where(ticks > last, last, ticks)).reference.position

    def _decide(
        self, stages: Stages, now: EnvState, row: InputRow[Reference], action: Scalars
    ) -> Decision:
        """Convert an action to a vehicle command; return the control law's next
        internal state and the command.
        """
        values = iter(leaves(self._measurement))
        seen = dict(zip(self._kept, now.seen, strict=True))
        measurement = rebuild(
            self._measurement, [seen.get(i, old) for i, old in enumerate(values)]
        )
        par = stages.scenario.agent.controller.par
        reference = stages.agent.law_reference(row)
        turn = Turn(
            memory=now.loop.agent.memory,
            measurement=measurement,
            reference=reference,
            law=stages.agent.decide,
            par=par,
            setpoints=self.task.setpoints,
        )
        memory, command = self.task.actions.command(action, turn)
        return memory, with_rest(stages.scenario.agent.vehicle, command)

    def _measure_next(
        self, stages: Stages, now: LoopState, row: InputRow[Reference], draws: Scalars
    ) -> tuple[LoopState, Measurement]:
        """Advance wind, contacts and sensors to the next control period, and compute
        the measurement there.
        """
        measured = measure(
            stages, self._program.plant_steps(stages), now, (row,), draws
        )
        (half,) = measured.agents
        agent = replace(
            now.agent,
            sensors=half.read.sensors,
            estimate=half.read.estimate,
            components=half.components,
        )
        return (
            replace(now.with_agent(agent), components=measured.components),
            half.read.measurement,
        )

    def _select_numbers(self, measurement: Measurement) -> Scalars:
        numbers = leaves(measurement)
        return tuple(numbers[i] for i in self._kept)

    def _observe(
        self,
        stages: Stages,
        measurement: Measurement,
        reference: Reference,
        action: Scalars,
    ) -> Scalars:
        model = stages.scenario.agent.model
        return observation_of(
            self.task,
            Sight(
                measurement=measurement, reference=reference, action=action, model=model
            ),
        )

    def _ending(
        self, scenario: Scenario, state: State, goal: Vec3, sent: Scalar
    ) -> Scalar:
        """Index of the first termination condition that is met, counted from 1; 0 if
        none is met.
        """
        endings = endings_of(scenario)
        number = where(sent > 0.5, 0.0, float(len(endings) + 1))
        # from the last to the first, so that the first that holds has the last word
        for index in range(len(endings), 0, -1):
            fine = endings[index - 1].fine(scenario, state, goal, 0)
            # a literal True: the ending does not apply, and costs no operation
            if fine is not True:
                number = where(fine, number, float(index))
        return number


def observation_of(task: LearningTask, sight: Sight) -> Scalars:
    """Observation vector of a learning task, with every component finite."""
    return tuple(
        _finite(number) for each in task.observation for number in each.numbers(sight)
    )


def _finite(value: Scalar) -> Scalar:
    """Clip a number to a finite range; NaN becomes 0."""
    # a NaN fails every comparison and so reaches the last 0
    return where(
        absolute(value) <= LARGEST,
        value,
        where(value > 0.0, LARGEST, where(value < 0.0, -LARGEST, 0.0)),
    )
