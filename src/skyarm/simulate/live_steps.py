"""The engine of a live session: machine code whose numbers are read anew in every period."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from skyarm.compile import leaves, rebuild
from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.llvm.stepper import Stepper
from skyarm.compile.tracing.stepped_loop import trace_loop
from skyarm.dynamics import State
from skyarm.reference import Publisher
from skyarm.scenario.numbers import number_at, with_numbers
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.check_endings import Ended
from skyarm.simulate.compiled_session import Array, CompiledSteps
from skyarm.simulate.draws import draws_needed
from skyarm.simulate.first_state import first_loop_state
from skyarm.simulate.inputs import EpisodeInputs, episode_inputs
from skyarm.simulate.loop_state import LoopState, Row, Sample, structure_of
from skyarm.simulate.own_code_trials import try_own_code
from skyarm.simulate.period import make_period
from skyarm.simulate.rigid_body_steps import RigidBodySteps
from skyarm.simulate.session_code import plant_of
from skyarm.simulate.stages import Stages

BLOCK = 1000
"""Periods whose rows are stored in one array."""


class FlownRows:
    """Rows of a flight, in blocks: a flight that goes another way from an instant on shares those before it.

    Args:
        width: numbers of a row.
    """

    def __init__(self, width: int) -> None:
        self._width, self._blocks = width, list[Array]()

    def __setitem__(self, k: int, row: Array) -> None:
        block, place = divmod(k, BLOCK)
        if block == len(self._blocks):
            self._blocks.append(np.empty((BLOCK, self._width)))
        self._blocks[block][place] = row

    def __getitem__(self, rows: slice) -> Array:
        return np.concatenate([np.empty((0, self._width)), *self._blocks])[rows]

    def branch(self, count: int) -> FlownRows:
        """The first rows, to which others may be added than were added here."""
        found, (whole, left) = FlownRows(self._width), divmod(count, BLOCK)
        found._blocks = self._blocks[:whole]
        if left:
            found._blocks.append(self._blocks[whole].copy())
        return found


class LiveSteps(CompiledSteps):
    """The engine of a live session: one lane, one control period a call, the numbers of its paths read in each.

    The reference is evaluated in the code where one of its numbers is among them, and is a table otherwise.

    Args:
        origin: the scenario, the numbers of its paths as data.
        paths: of numbers (:mod:`skyarm.scenario.numbers`).
        scenario: the same with the numbers that it flies with, which fix the integration steps.
    """

    def __init__(self, origin: Scenario, paths: Sequence[str], scenario: Scenario) -> None:
        try_own_code(origin)
        self.scenario, self._origin, self._paths = scenario, origin, tuple(paths)
        self.first: LoopState = first_loop_state(origin)
        self._own_motion = any(path.startswith("reference.") for path in paths)
        plant = plant_of(scenario, self.first)
        self._asked: dict[float, int] = {}

        def substeps(seconds: float) -> int:
            self._asked[seconds] = plant.substeps(seconds)
            return self._asked[seconds]

        def step(now: LoopState, numbers: Any, fed: Any, drawn: Any) -> tuple[LoopState, Sample]:
            varied = with_numbers(origin, dict(zip(self._paths, numbers, strict=True)))
            stages = Stages(varied)
            row = fed
            if self._own_motion:
                row = Row(time=fed[0], reference=() if varied.trajectory.guards else varied.trajectory.at(fed[1]))
            return make_period(stages, RigidBodySteps(stages, substeps))(now, row, drawn)

        numbers = tuple(number_at(origin, path) for path in self._paths)
        self._rows = self._clock() if self._own_motion else self._inputs.rows(0, origin.steps)
        fed: Any = (0.0, 0.0)
        if not self._own_motion:
            fed = self._inputs.row_example
        loop = trace_loop(step, structure_of(self.first), numbers, fed, draws_needed(origin), loops=True)
        self._sample = loop.result[1]
        start, keys = np.array(leaves(self.first), dtype=float), {"seed": origin.seed, "episode": origin.episode}
        # a hand waits for it: code that is made in a hurry gives the same bits
        kernel = Kernel(loop, Lanes(1), logging=True, effort=0)
        self._stepper = Stepper(kernel, start, np.array(numbers, dtype=float), **keys)
        self._width, self._steps = self._rows.shape[1], origin.steps
        self._log: Any = FlownRows(loop.logged)
        self.tick = self.begun = 0
        self.ended: Ended | None = None
        self._last: Array | None = None

    @property
    def _inputs(self) -> EpisodeInputs:  # type: ignore[override]
        """Tables of the scenario as it is now, made where they are asked for: for an ending and a log."""
        return episode_inputs(self.scenario)

    def _clock(self) -> Array:
        """(steps, 2) time, and time of the held reference, s."""
        ticks, rates = np.arange(self._origin.steps), self._origin.rates
        publisher = Publisher(control_rate=rates.control, reference_rate=rates.reference)
        return np.stack([ticks / rates.control, publisher.held_time(ticks)], axis=1)

    def bears(self, scenario: Scenario) -> bool:
        """Whether a scenario with other numbers is integrated in the steps that the code was made with."""
        plant = plant_of(scenario, self.first)
        return all(plant.substeps(seconds) == count for seconds, count in self._asked.items())

    def set_numbers(self, scenario: Scenario, values: Mapping[str, float]) -> None:
        """Fly on with other numbers, by path, from the next period on; ``scenario`` is the one with them."""
        self.scenario = scenario
        for path, value in values.items():
            self._stepper.parameters[self._paths.index(path)] = value

    def state(self) -> State:
        """The plant's state now; it follows ``alive`` and ``ticks`` among the leaves."""
        state: State = rebuild(self.first.state, iter(self._stepper.carry[2:].tolist()))
        return state

    def snapshot(self) -> Any:
        """What :meth:`restore` takes: it holds on to the log, whose rows before this period no step writes again."""
        stepper = self._stepper
        return self.tick, self.ended, stepper.carry.copy(), stepper.parameters.copy(), self._log, self._last

    def restore(self, held: Any) -> None:
        """Go to a snapshot."""
        self.tick, self.ended, carry, parameters, log, self._last = held
        self._stepper.carry[:], self._stepper.parameters[:] = carry, parameters
        self._log = log.branch(self.tick)

    def go_on(self, other: LiveSteps) -> None:
        """Go on where another engine of the same loop stands."""
        held = other.snapshot()
        numbers = self._stepper.parameters.copy()
        self.restore(held)
        self._stepper.parameters[:] = numbers
