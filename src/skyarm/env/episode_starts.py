"""What episodes begin with, made ahead of time for many at once: numbers drawn, first states, first observations."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.compile import trace
from skyarm.compile.tracing.array_evaluation import evaluate
from skyarm.env.env_program import EnvProgram
from skyarm.scalars.philox import uniforms
from skyarm.simulate.draws import draw_plan, start_draws

Array = npt.NDArray[Any]

AHEAD = 8192
"""Episodes of all lanes together that are made at a time: NumPy then takes about a microsecond for each."""


class EpisodeStarts:
    """The beginnings of the episodes of many lanes: pure functions of a lane's seed and of the episode's number.

    A lane that ends must begin again between two steps that take some microseconds; what it begins with lies ready.

    Args:
        program: of the environment. lanes: how many. dtype: of the numbers.

    Attributes:
        varies: whether one episode begins otherwise than another.
    """

    def __init__(self, program: EnvProgram, lanes: int, dtype: Any) -> None:
        self._program, self._lanes, self._dtype = program, lanes, dtype
        scenario = program.task.scenario
        self._counts = [2 * count for _, count in draw_plan(scenario).components]
        drawn = sum(count for _, count in program.uniforms)
        started = tuple((0.5,) * count for count in self._counts)
        self._start = trace(program.start, program.base, (0.5,) * drawn, started)
        self.varies = bool(program.paths or drawn or any(self._counts))
        self._depth = int(np.clip(AHEAD // lanes, 1, 64)) if self.varies else 1
        self._seeds = np.zeros(lanes, dtype=np.uint64)
        self._first = np.zeros(lanes, dtype=np.int64)
        rows = len(program.paths) + len(self._start.outputs)
        self._table = np.zeros((rows, lanes if self.varies else 1, self._depth), dtype)
        if not self.varies:
            self._table[:, :, 0] = self._made(np.zeros(1, dtype=np.uint64), np.zeros(1, dtype=np.int64))

    def seed(self, lanes: Array, seeds: Array) -> None:
        """Give lanes other seeds; their episodes are numbered from 0 again."""
        self._seeds[lanes] = seeds
        # as far as could be from any episode that is asked for: made when it is
        self._first[lanes] = -(2**40)

    def take(self, lanes: Array, episodes: Array) -> Array:
        """(numbers, lanes): of each lane and its episode the randomised numbers, the state, the observation."""
        if not self.varies:
            return self._table[:, np.zeros(len(lanes), dtype=np.intp), 0]
        at = episodes - self._first[lanes]
        missing = (at < 0) | (at >= self._depth)
        if missing.any():
            self._fill(lanes[missing], episodes[missing])
            at = episodes - self._first[lanes]
        return self._table[:, lanes, at]

    def _fill(self, lanes: Array, episodes: Array) -> None:
        """Make episodes of these lanes from these numbers on."""
        self._first[lanes] = episodes
        numbers = (episodes[:, None] + np.arange(self._depth)).ravel()
        columns = self._made(np.repeat(self._seeds[lanes], self._depth), numbers)
        self._table[:, lanes] = columns.reshape(len(columns), len(lanes), self._depth)

    def _made(self, seeds: Array, episodes: Array) -> Array:
        """The same, computed."""
        program, keys = self._program, seeds
        columns = program.task.randomised.draw(keys, episodes)
        # numbers are what 32 bits hold of them, where that is what the code flies
        with np.errstate(over="ignore"):
            columns = [np.asarray(column, self._dtype).astype(float) for column in columns]
        inputs: list[Any] = [*columns]
        each: Any = keys[:, None]
        for channel, count in program.uniforms:
            inputs += [*uniforms(each, episodes, channel, 0, count).T]
        several: Any = keys[:, None, None]
        for draws in start_draws(program.task.scenario, several, episodes):
            inputs += [*draws.T]
        found = evaluate(self._start, inputs, len(episodes))
        return np.concatenate([np.array(columns).reshape(len(columns), len(episodes)), found])

    @property
    def state(self) -> slice:
        """Rows of the state."""
        return slice(len(self._program.paths), len(self._program.paths) + self._program.loop.carry)

    @property
    def observation(self) -> slice:
        """Rows of the observation."""
        return slice(self.state.stop, len(self._table))
