"""An episode flown stage by stage in Python floats: any plant, any law."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Sequence
from itertools import chain
from typing import Any

import numpy as np

from skyarm.compile import leaves, rebuild
from skyarm.dynamics import State
from skyarm.log.flight_log import Log
from skyarm.plant.plant_by_name import make_plant
from skyarm.records.leaves import parts
from skyarm.reference import Reference
from skyarm.scalars.philox import uniforms
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.sensors.measurement import Measurement
from skyarm.simulate.assemble_log import Piece, Samples, joined
from skyarm.simulate.check_endings import Ended, ended_by, failed_phase, going_on, refused
from skyarm.simulate.clock_of_change import clock_of_change
from skyarm.simulate.clock_records import PathClock
from skyarm.simulate.first_state import component_groups, first_loop_state, first_surroundings
from skyarm.simulate.flat_stages import EpisodeEndedError, FlatStages, flatten
from skyarm.simulate.flat_steps import FlatSteps
from skyarm.simulate.inputs import EpisodeInputs, episode_inputs
from skyarm.simulate.loop_state import LoopState, Row, carried
from skyarm.simulate.own_code_trials import try_own_code
from skyarm.simulate.period import make_period
from skyarm.simulate.stages import Stages

DRAWN = 256
"""Periods whose random numbers are drawn at once."""

_WHOLE = (
    "delays.{} = {!r}: must be a whole number of physics steps for a law that cannot be traced, "
    "and without machine code"
)


class StagedFlight:
    """An episode flown stage by stage in Python floats.

    Attributes:
        scenario, inputs: of the episode. first: the loop before its first period.
        ended: why it has ended before its time, or None. begun: number of the first period that it flies.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        try_own_code(scenario)
        self.inputs: EpisodeInputs = episode_inputs(scenario)
        stages, first = Stages(scenario), first_loop_state(scenario)
        for name in ("command", "rotors", "joints"):
            delay = getattr(scenario.delays, name)
            if abs(delay * scenario.rates.physics - round(delay * scenario.rates.physics)) > 1e-6:
                raise ScenarioError(_WHOLE.format(name, delay))
        around = first_surroundings(scenario, first)
        self._plant = make_plant(scenario, around)
        self._stages = FlatStages(stages, first, self.inputs.row_example)
        steps_of = FlatSteps(self._plant, stages, around)
        self._period = make_period(self._stages, steps_of, FlatStages.begin, FlatStages.respond)
        self.first, self._flat = first, flatten(first, called=not scenario.controller.compiled)
        self._needed = stages.draws.needed
        # what stands behind the time: the held reference, and what a governor tells the law in its place
        fed = self.inputs.rows(0, scenario.steps)
        self._held, self._times = list(map(tuple, fed[:, 1:].tolist())), self.inputs.times.tolist()
        self._drawn: list[tuple[float, ...]] = []
        self._block = -1
        self._logged: list[tuple[Any, ...]] = []
        self.ended: Ended | None = None
        self.begun = 0

    @property
    def tick(self) -> int:
        """Control periods flown."""
        return self.begun + len(self._logged)

    def step(self, command: Sequence[float] | None = None) -> bool:
        """Fly one control period; False once the episode has ended or flown its time.

        Args:
            command: in place of the law's, whose memory stays.
        """
        k = self.tick
        if self.ended is not None or k >= self.scenario.steps:
            return False
        self._stages.given = None if command is None else tuple(command)
        try:
            self._flat, sample = self._period(self._flat, self._row(k), self._draws(k))
        except EpisodeEndedError as error:
            self.ended = self._why(k, error.command)
            return False
        numbers = sample.state, sample.command, sample.measurement, sample.readings
        self._logged.append((*numbers, sample.wind, sample.found, sample.led))
        if self.tick == self.scenario.steps:
            self.ended = self._why(self.tick, None)
        return self.ended is None and self.tick < self.scenario.steps

    def _row(self, k: int) -> Any:
        return Row(time=(self._times[k],), reference=self._held[k])  # type: ignore[arg-type]

    def _draws(self, k: int) -> tuple[float, ...]:
        """Uniform numbers of a period, made for a second or so at a time."""
        if not self._needed:
            return ()
        block, row = divmod(k, DRAWN)
        # a session goes to and fro: what is held may be of any block
        if block != self._block:
            keys, steps = (self.scenario.seed, self.scenario.episode), np.arange(block * DRAWN, (block + 1) * DRAWN)
            rows = np.concatenate([uniforms(*keys, channel, steps, n) for channel, n in self._needed], axis=1)
            self._drawn, self._block = [tuple(numbers) for numbers in rows.tolist()], block
        return self._drawn[row]

    def _why(self, k: int, command: Sequence[float] | None) -> Ended | None:
        """The ending at tick k, in words."""
        time = k / self.scenario.rates.control
        if command is not None:
            return refused(self.scenario, time, command)
        now = self.now
        goal = self.inputs.held_position(k, now)
        return ended_by(self.scenario, time, self._flat.state, goal) or failed_phase(self.scenario, time, now.clock)

    def log(self) -> Log:
        """What was flown so far."""
        return joined(self.scenario, [self.piece], self.ended or going_on(self.scenario, self.tick))

    @property
    def piece(self) -> Piece:
        """What this engine flew so far."""
        return Piece(self.scenario, self.inputs, self.begun, self.samples(self.begun, self.tick))

    def samples(self, start: int, stop: int) -> Samples:
        """What some of the periods left that this engine flew."""
        ends = np.cumsum([len(leaves(each)) for each in self._examples])
        rows = self._rows(start - self.begun, stop - self.begun)
        led = rows.shape[1] - self._stages.led_count
        states, commands, *parts, found, led_by = np.split(rows, [*ends.tolist(), led], axis=1)
        records = (rebuild(each, iter(part.T)) for each, part in zip(self._examples[2:], parts, strict=True))
        measurement, readings, wind = records
        return Samples(states, commands, measurement, readings, wind, found, led_by)

    @property
    def _examples(self) -> tuple[Any, ...]:
        """Records that are logged of a period, as examples; numbers of law and clock follow them."""
        stages = self._stages
        return self.first.state, self.first.queue[0], stages.told, stages.readings, stages.wind

    def _rows(self, start: int, stop: int) -> Any:
        """What was logged: a row a period, the leaves of a sample but for ``alive``."""
        width = len(leaves(self._examples))
        width += len(self._stages.found_places) + self._stages.led_count
        numbers = chain.from_iterable(chain.from_iterable(self._logged[start:stop]))
        return np.fromiter(numbers, dtype=float, count=width * (stop - start)).reshape(-1, width)

    @property
    def now(self) -> LoopState:
        """The loop's state before the next period, as records."""
        fields = {}
        for name, example in parts(self.first).items():
            value = getattr(self._flat, name)
            called = name == "memory" and not self.scenario.controller.compiled
            fields[name] = value if called else rebuild((example,), iter(value))[0]
        return LoopState(**fields)

    def state(self) -> State:
        """The plant's state now."""
        return self.now.state

    def reference(self) -> Reference:
        """The held reference of the next period."""
        if isinstance(self.first.clock, PathClock):
            return self.inputs.held_now(self.now)
        held: Reference = rebuild(self.inputs.reference_example, iter(self._held[self.tick]))
        return held

    def measurement(self) -> Measurement:
        """What the law is told in the next period."""
        now, stages, drawn = self._flat, self._stages, self._draws(self.tick)
        row = stages.led(now, self._row(self.tick))
        begun = stages.surround(now, row, drawn)
        force = self._plant.specific_force(now.state, begun.acting, begun.around)
        _, _, _, read = stages.sense(now, row, begun, force, drawn)
        told: Measurement = rebuild(stages.told, iter(read))
        return told

    def snapshot(self) -> Any:
        """What :meth:`restore` takes; the memory of a law that is called is copied."""
        return self.begun, self._flat, copy.deepcopy(self._flat.memory), list(self._logged), self.ended

    def restore(self, held: Any) -> None:
        """Go to a snapshot."""
        self.begun, flat, memory, logged, self.ended = held
        self._flat = dataclasses.replace(flat, memory=copy.deepcopy(memory))
        self._logged = list(logged)

    def give(self, *_: Any) -> bool:
        """Its numbers are constants: another flight goes on from where it is."""
        return False

    def take_over(self, other: Any, *, anew: bool) -> None:
        """Go on where another engine stands; ``anew``: with another reference."""
        called = not self.scenario.controller.compiled
        now = other.now
        clock = clock_of_change(self.scenario, self.first, now, anew=anew)
        kept = carried(self.first, now, component_groups(self.scenario, other.scenario), clock)
        if called and self.scenario.controller.law is other.scenario.controller.law:
            # the memory of a law that is called is its own: it may hold anything
            kept = dataclasses.replace(kept, memory=now.memory)
        self._flat = flatten(kept, called=called)
        self._logged, self.begun = [], other.tick
        self.ended = other.ended
