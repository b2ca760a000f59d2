"""Plant models within a control period: the rigid body is traced, other plants and laws
are called from Python.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from skyarm.algebra import Motion, Scalar, Vec3
from skyarm.compile import Graph, Node, trace
from skyarm.control.law_estimates import PushAlone
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.state import example_state
from skyarm.plant.compiled import RigidBodyPlant, Steps, hold
from skyarm.plant.interface import Plant, example_command
from skyarm.plant.rigid_body import Moved, accelerate, after_impacts
from skyarm.plant.surroundings import Together, coupled_places
from skyarm.records.leaves import Tree, blend, leaves, rebuild
from skyarm.reference import Reference
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.sensing.measurement import Measurement
from skyarm.sensing.sensor import at_origin
from skyarm.simulate.command_delay import arrivals
from skyarm.simulate.first_state import first_loop_state, first_surroundings
from skyarm.simulate.loop_state import InputRow, LoopState
from skyarm.simulate.stages import AgentStages, Stages

Flat = tuple[float, ...]


def rigid_body_plant(scenario: Scenario, first: LoopState | None) -> RigidBodyPlant:
    """Rigid-body plant of a scenario, from which the number of integration steps
    follows.

    Args:
        scenario: scenario with concrete numbers.
        first: its first loop state; made anew if left out.
    """
    around = first_surroundings(scenario, first or first_loop_state(scenario))
    worlds = tuple(each.plant for each in scenario.agents.values())
    return RigidBodyPlant(
        worlds, around, scenario.integrator, 1.0 / scenario.rates.physics
    )


class Substeps:
    """Number of integration steps in an interval (s).

    Args:
        plant: plant that is integrated.
        at_rest: those that joint stops need at rest; else what more a motion needs is a
            loop, which JAX has not.

    Attributes:
        traced: intervals that are compiled into a program, with their numbers.
    """

    def __init__(self, plant: RigidBodyPlant, *, at_rest: bool = False) -> None:
        self._count = plant.steps_at_rest if at_rest else plant.substeps
        self.traced = dict[float, Steps]()

    def __call__(self, seconds: float) -> Steps:
        """Return the number of integration steps in an interval of ``seconds``, and
        record both.
        """
        self.traced[seconds] = self._count(seconds)
        return self.traced[seconds]

    def fit(self, plant: RigidBodyPlant) -> bool:
        """True if another plant needs the same number of integration steps in all
        compiled intervals.
        """
        return all(
            plant.substeps(seconds) == count for seconds, count in self.traced.items()
        )


class RigidBodySteps:
    """Traced rigid-body plant model within one control period.

    Args:
        stages: stages of the episode. substeps: counts of integration steps in an
            interval (s).
    """

    def __init__(self, stages: Stages, substeps: Callable[[float], Steps]) -> None:
        self._worlds = stages.worlds
        self._integrator = stages.scenario.integrator
        self._period = stages.period
        self._substeps = substeps
        self._late = [each.arrival for each in stages.agents]

    def proper_accelerations(
        self, states: Sequence[State], commands: Sequence[Command], around: Together
    ) -> tuple[Motion, ...]:
        """Specific force (m/s^2) and angular acceleration (rad/s^2) of each base, at
        its origin, base axes.
        """
        return tuple(
            base for base, _ in accelerate(self._worlds, states, commands, around)
        )

    def advance(
        self,
        states: Sequence[State],
        before: Sequence[Command],
        after: Sequence[Command],
        around: Together,
    ) -> Moved:
        """States of vehicles and contacts after a control period in which new commands
        arrive.
        """
        # an impact comes at a control instant, before anything is integrated
        now = after_impacts(self._worlds, states, around), around.coupled_memories()
        left: Scalar = self._period
        for seconds, commands in arrivals(self._late, before, after):
            # a varied delay may be zero: an integration over nothing is then not taken
            if type(seconds) is not float:
                now = blend(
                    seconds > 0.0, self._hold(now, commands, around, seconds), now
                )
            elif seconds > 0.0:
                now = self._hold(now, commands, around, seconds)
            left = left - seconds
        return self._hold(now, after, around, left)

    def _hold(
        self, now: Moved, commands: Sequence[Command], around: Together, seconds: Scalar
    ) -> Moved:
        """States of vehicles and contacts after an interval with constant commands."""
        # a traced interval may be as long as the period: its steps are those of one
        count = self._substeps(seconds if type(seconds) is float else self._period)
        return hold(
            self._worlds, self._integrator, count, now, commands, around, seconds
        )


class EpisodeEndedError(Exception):
    """Early termination of a flight, raised within a control period that is evaluated
    in Python.

    Attributes:
        agent: name of the vehicle whose command is what ended the episode; else "".
            command: its numbers; else ().
    """

    def __init__(self, agent: str, command: Flat) -> None:
        super().__init__("the episode has ended")
        self.agent = agent
        self.command = command


class StagesInPython(Stages):
    """Stages of a control period evaluated in Python with any Python laws; a
    termination raises an exception.

    Args:
        scenario: scenario of the episode. calls: internal states of the laws.
        commands, given: arguments of :class:`Stages`.
    """

    def __init__(
        self,
        scenario: Scenario,
        calls: Sequence[LawCalls],
        commands: Sequence[Command] = (),
        given: Sequence[Scalar] = (),
    ) -> None:
        self._called = dict(zip(scenario.agents, calls, strict=True))
        super().__init__(scenario, commands, given)

    def _stages_of(
        self, name: str, command: Command | None, given: Scalar | None
    ) -> AgentStages:
        """Stages of one vehicle, whose law is called where it cannot be traced."""
        calls = self._called[name]
        return AgentStagesInPython(self.scenario.of(name), calls, command, given)

    def alive(self, now: LoopState, rows: Sequence[InputRow[Reference]]) -> Scalar:
        """Evaluate the termination conditions; raise EpisodeEndedError if one is
        met.
        """
        going = super().alive(now, rows)
        return _graph_of(going).external(partial(_require_alive, ""), [(going,)], 1)[0]


class AgentStagesInPython(AgentStages):
    """Stages of one vehicle in a control period that is evaluated in Python, with any
    Python law.

    Args:
        scenario: scenario of its flight alone. calls: internal state of its law.
        command, given: arguments of :class:`AgentStages`.
    """

    def __init__(
        self,
        scenario: Scenario,
        calls: LawCalls,
        command: Command | None = None,
        given: Scalar | None = None,
    ) -> None:
        super().__init__(scenario, command, given)
        self._calls = calls

    def send(
        self, alive: Scalar, queue: Sequence[Command], command: Command
    ) -> tuple[Scalar, tuple[Command, ...], Command]:
        """Put a command into the delay queue; raise EpisodeEndedError if it is not
        finite.
        """
        going, moved, acting = super().send(alive, queue, command)
        (name,) = self.scenario.agents
        checked = _graph_of(going).external(
            partial(_require_alive, name), [(going,), leaves(command)], 1
        )
        return checked[0], moved, acting

    def apply_law(
        self,
        memory: Tree,
        measurement: Measurement,
        reference: Reference,
        path_time: Scalar | tuple[()],
    ) -> tuple[Tree, Command]:
        """Evaluate the control law; a law that cannot be traced is called with
        floats.
        """
        if self.scenario.agent.controller.compiled:
            return super().apply_law(memory, measurement, reference, path_time)
        inputs = (measurement, reference, path_time)
        law = super().apply_law
        example = example_command(*self.scenario.agent.vehicle.sizes)
        count = len(leaves((example, memory)))

        def call(given: Flat, numbers: Flat) -> Flat:
            # mode 1, a command from outside: the law is not called, so its memory stays
            if given and 0.5 < given[0] < 1.5:
                return (0.0,) * count
            # kept outside the program, as it may be any object
            self._calls.memory, command = law(
                self._calls.memory, *rebuild(inputs, numbers)
            )
            return (*leaves(command), *leaves(PushAlone.of(self._calls.memory)))

        given = () if self._given is None else (self._given,)
        results = iter(_graph_of(inputs).external(call, [given, leaves(inputs)], count))
        command = rebuild(example, results)
        return rebuild(memory, results), command


@dataclass(slots=True)
class LawCalls:
    """Internal state of an untraceable control law between two calls; any Python
    object.
    """

    memory: Any


def _graph_of(record: Tree) -> Graph:
    """Computation graph of the traced program to which the scalars of a dataclass
    belong.
    """
    # one traced number is enough: all of a trace belong to one graph
    return next(leaf.graph for leaf in leaves(record) if isinstance(leaf, Node))


def _require_alive(agent: str, alive: Flat, command: Flat = ()) -> Flat:
    if alive[0] < 0.5:
        raise EpisodeEndedError(agent, command)
    return alive


class CalledPlant:
    """Plant model called from a traced program as a Python function, on flat tuples of
    floats.

    Args:
        plant: plant model of floats. stages: stages of the episode. around:
            surroundings of one period, as an example.

    Raises:
        ScenarioError: a user-defined plant that has no function for a part of the
            scenario, or a delay that is no whole number of physics steps.
    """

    def __init__(self, plant: Plant, stages: Stages, around: Together) -> None:
        self._plant = plant
        self._period = stages.period
        self._late = [tuple(map(float, each.arrival)) for each in stages.agents]
        scenario = stages.scenario
        for name, delay in (
            (name, getattr(each.delays, name))
            for each in scenario.agents.values()
            for name in DELAYS
        ):
            steps = delay * scenario.rates.physics
            # a delay in decimals is a whole number of steps only up to rounding
            if abs(steps - round(steps)) > 1e-6:
                raise ScenarioError(
                    f"delays.{name} = {delay!r}: must be a whole number of physics"
                    f" steps on the plant {scenario.kind}"
                )
        sizes = [each.vehicle.sizes for each in stages.worlds]
        self._kind = scenario.kind
        commands = tuple(example_command(*each) for each in sizes)
        self._intervals = [
            float(seconds) for seconds, _ in arrivals(self._late, commands, commands)
        ]
        in_force = trace(
            lambda *both: tuple(now for _, now in arrivals(self._late, *both)),
            commands,
            commands,
        )
        self._in_force = in_force.flat
        self._end = sum(len(leaves(example_state(*each))) for each in sizes)
        self._several = getattr(plant, "several", False)
        self._impact = _impact_of(plant, scenario)
        self._coupled = coupled_places(self._for_plant(around))
        self._turning = any(
            not at_origin(sensor.mounted_at)
            for each in stages.agents
            for _, sensor in each.sensors
        )
        if self._turning and not hasattr(plant, "angular_acceleration"):
            raise ScenarioError(
                f"plant.kind = {self._kind!r}: must define angular_acceleration for a"
                " sensor beside the base origin"
            )
        self._read: tuple[Flat, Flat] = ((), ())

    def _for_plant(self, around: Together) -> Together:
        """Surroundings as inputs of the plant; for one of one vehicle, shared models
        are among that vehicle's own.
        """
        return around if self._several else Together((around.of(0),), around.names)

    def proper_accelerations(
        self, states: Sequence[State], commands: Sequence[Command], around: Together
    ) -> tuple[Motion, ...]:
        """Specific force (m/s^2) and angular acceleration (rad/s^2) of each base, at
        its origin, base axes.

        The angular acceleration is asked of the plant where a sensor is beside the base
        origin, and zero elsewhere.
        """
        groups = [
            leaves(tuple(states)),
            leaves(tuple(commands)),
            leaves(self._for_plant(around)),
        ]
        graph = _graph_of(states[0])
        size = 3 * len(states)
        forces = graph.external(self._specific_force, groups, size)
        turns = (
            graph.external(self._plant.angular_acceleration, groups, size)
            if self._turning
            else [0] * size
        )
        rows = zip(
            *(zip(*[iter(numbers)] * 3, strict=True) for numbers in (turns, forces)),
            strict=True,
        )
        return tuple(
            Motion(angular=Vec3(*turn), linear=Vec3(*force)) for turn, force in rows
        )

    def advance(
        self,
        states: Sequence[State],
        before: Sequence[Command],
        after: Sequence[Command],
        around: Together,
    ) -> Moved:
        """States of vehicles and contacts after a control period in which new commands
        arrive.
        """
        groups = [
            leaves(tuple(states)),
            leaves(tuple(before)),
            leaves(tuple(after)),
            leaves(self._for_plant(around)),
        ]
        numbers = iter(
            _graph_of(states[0]).external(
                self._advance, groups, self._end + len(self._coupled)
            )
        )
        return rebuild(tuple(states), numbers), rebuild(
            around.coupled_memories(), numbers
        )

    def _specific_force(self, state: Flat, command: Flat, around: Flat) -> Flat:
        self._read = state, around
        return self._plant.specific_force(state, command, around)

    def _advance(self, state: Flat, before: Flat, after: Flat, around: Flat) -> Flat:
        # a plant that has just been given these tuples need not read them again
        if state == self._read[0]:
            state = self._read[0]
        if around == self._read[1]:
            around = self._read[1]
        if self._impact is not None:
            state = self._impact(state, around)
        left = self._period
        commands = self._in_force((*before, *after))
        for k, seconds in enumerate(self._intervals):
            if seconds > 0.0:
                command = commands[k * len(before) : (k + 1) * len(before)]
                numbers = self._hold(state, command, around, seconds)
                state = numbers[: self._end]
                around = self._with_memories(around, numbers[self._end :])
            left = left - seconds
        return self._hold(state, after, around, left)

    def _hold(self, state: Flat, command: Flat, around: Flat, seconds: float) -> Flat:
        """Vehicle and contact states as a flat tuple, after an interval with a constant
        command.
        """
        numbers = self._plant.advance(state, command, around, seconds)
        if self._coupled and len(numbers) != self._end + len(self._coupled):
            raise ScenarioError(
                f"plant.kind = {self._kind!r}: does not know [world]; it has no coupled"
                " memories"
            )
        return numbers

    def _with_memories(self, around: Flat, memories: Flat) -> Flat:
        """Plant inputs as a flat tuple, with the states of the contacts replaced."""
        if not self._coupled:
            return around
        numbers = list(around)
        for place, value in zip(self._coupled, memories, strict=True):
            numbers[place] = value
        return tuple(numbers)


DELAYS = ("command", "rotors", "joints")
"""Delays of commands, which end between physics steps where they are no whole number of
these."""


def _impact_of(plant: Plant, scenario: Scenario) -> Callable[[Flat, Flat], Flat] | None:
    """Function of a plant that applies impacts of grasps and locking joints; None for a
    scenario without them.

    Raises:
        ScenarioError: a user-defined plant without it.
    """
    agents = scenario.agents.values()
    stuck = any(fault.stuck for each in agents for fault in each.faults)
    rigid = any(payload.rigid for each in agents for payload in each.payloads)
    if not rigid and not stuck:
        return None
    after_impact: Callable[[Flat, Flat], Flat] | None = getattr(
        plant, "after_impact", None
    )
    if after_impact is None:
        what = "rigid payloads" if rigid else "environment.faults with stuck"
        raise ScenarioError(
            f"plant.kind = {scenario.kind!r}: does not know {what}; it has no"
            " after_impact"
        )
    return after_impact
