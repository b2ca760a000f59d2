"""Many episodes of one scenario in machine code: other numbers per lane, metrics counted on the fly."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.algebra import Vec3
from skyarm.compile import rebuild, trace
from skyarm.compile.arrays import evaluate
from skyarm.compile.llvm_text import Lanes
from skyarm.compile.loop import trace_loop
from skyarm.compile.native import Kernel, host_width
from skyarm.dynamics import State
from skyarm.environment import Airspeed, dryden
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.scalars.philox import normal
from skyarm.simulate.batch_log import BatchLog, Logged, batch_log
from skyarm.simulate.batch_rows import Feed
from skyarm.simulate.carry import Carry, structure_of
from skyarm.simulate.closed_loop import make_counting_period
from skyarm.simulate.draws import CHANNEL_TURBULENCE, draws_needed
from skyarm.simulate.endings import endings
from skyarm.simulate.inputs import episode_inputs
from skyarm.simulate.measures import Windows, metric_names, needed
from skyarm.simulate.measures import values as metric_values
from skyarm.simulate.native import first_carry
from skyarm.simulate.paths import number_at, require_apart, with_numbers
from skyarm.simulate.places import LATE
from skyarm.simulate.scenario import Scenario, ScenarioError, noise_key
from skyarm.simulate.totals import first_totals

Array = npt.NDArray[Any]


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a batch of episodes left, one entry per lane.

    Attributes:
        metrics: by name; they count only the time an episode was alive. NaN where it ended before their window.
        completed: True where the episode flew its whole duration. end_time: s.
        status: "completed", or why it ended (:mod:`skyarm.simulate.endings`).
        state: the last one of each lane.
        log: of a batch that keeps one, else None.
    """

    metrics: dict[str, Array]
    completed: Array
    end_time: Array
    status: Array
    state: State
    log: BatchLog | None = None


class Batch:
    """A scenario compiled for many episodes.

    Args:
        scenario: on the rigid-body plant; its other numbers are constants of the code.
        paths: numbers that differ from lane to lane (:mod:`skyarm.simulate.paths`).
        metrics: names and groups of :mod:`skyarm.simulate.measures`; what is not asked for costs nothing.
        windows: of the metrics. single: 32-bit floats. exact: every lane equals the Python floats bit for bit; else a
            multiplication and an addition may be rounded once.
        stiffest: a scenario with the stiffest joint friction of the batch, which fixes the integration steps.
        log_every: keep state, command and reference of each so many control periods; 0 keeps none. A sample takes
            8 bytes (4 if single) a number, 14 + 3 joints + 2 rotors + the reference's: 0.3 to 0.5 kB for two joints and
            four rotors. All of it is there twice while it is sorted.
        effort: of the compiler, as of :class:`skyarm.compile.native.Kernel`; 0 is worth it for few, short episodes.
    """

    def __init__(
        self,
        scenario: Scenario,
        paths: Sequence[str] = (),
        *,
        metrics: Sequence[str] = ("standard",),
        windows: Windows | None = None,
        single: bool = False,
        exact: bool = False,
        stiffest: Scenario | None = None,
        width: int | None = None,
        log_every: int = 0,
        effort: int = 2,
    ) -> None:
        self.scenario, self.paths, self.windows = scenario, tuple(paths), windows or Windows()
        self.names = metric_names(metrics, scenario.world.vehicle.n)
        scenario.controller.require_compiled("a batch")
        require_apart(scenario, self.paths)
        self.base = np.array([number_at(scenario, path) for path in paths])
        self._wanted = needed(self.names, scenario.world.vehicle.n)
        self._log_every = log_every
        inputs = episode_inputs(scenario)
        step_s = 1.0 / scenario.rates.physics
        plant = RigidBodyPlant((stiffest or scenario).world, inputs.wind_example, scenario.integrator, step_s)
        self._masks = self.windows.masks(inputs.times, scenario.duration)
        used = dict.fromkeys(window for _, window, _ in self._wanted)
        self._feed = Feed(scenario, self.paths, inputs, {name: self._masks[name] for name in used})
        self.rows = self._feed.rows
        self._gusty = isinstance(scenario.wind, Airspeed) and scenario.wind.turbulence is not None
        self._first = trace(self._start, tuple(self.base.tolist()), (0.0,) * (6 * self._gusty))
        self._example: tuple[Carry, tuple[Any, ...]] = (first_carry(scenario), first_totals(self._wanted))

        def step(both: Any, values: tuple[Any, ...], fed: Any, uniforms: Any) -> tuple[Any, Any]:
            varied = self._varied(values)
            row, goals, inside = self._feed.read(varied, fed)
            period = make_counting_period(varied, plant.substeps, self._wanted)
            following, sample = period(both, row, goals, inside, uniforms)
            kept = Logged(alive=sample.alive, state=sample.state, command=sample.command, reference=row.reference)
            return following, kept if log_every else ()

        example, fed = structure_of(self._example), self._feed.example
        loop = trace_loop(step, example, tuple(self.base.tolist()), fed, draws_needed(scenario), loops=True)
        self._logged = loop.result[1]
        lanes = Lanes(width or host_width(single=single), single=single, contract=not exact)
        self.kernel = Kernel(loop, lanes, logging=log_every > 0, effort=effort)

    def _varied(self, values: Sequence[Any]) -> Scenario:
        return with_numbers(self.scenario, dict(zip(self.paths, values, strict=True)))

    def _start(self, values: tuple[Any, ...], draws: tuple[Any, ...]) -> Any:
        """First carry of a lane; six normal numbers start its turbulence."""
        varied = self._varied(values)
        carry = first_carry(varied)
        if not isinstance(varied.wind, Airspeed) or varied.wind.turbulence is None:
            return carry
        period = 1.0 / self.scenario.rates.control
        air = dryden.start(Vec3(*draws[:3]), Vec3(*draws[3:]), period, par=varied.wind.turbulence)
        return dataclasses.replace(carry, turbulence=air)

    def _starts(self, parameters: Array, seed: int, episodes: Array) -> Array:
        """First carry of each lane: (leaves, lanes)."""
        columns = [*parameters]
        if self._gusty:
            # steps -1 and -2 of the channel, as in a single run
            draws = normal(seed, episodes[:, None], CHANNEL_TURBULENCE, np.array([2**32 - 1, 2**32 - 2]), 3)
            columns += [*draws.reshape(-1, 6).T]
        return evaluate(self._first, columns, len(episodes))

    def fly(
        self, values: Mapping[str, Array], *, seed: int = 0, episodes: Array | None = None, threads: int = 1
    ) -> Outcome:
        """Fly one episode per lane.

        Args:
            values: path -> (lanes,); every path of the batch.
            seed: key of the noise.
            episodes: (lanes,) further keys of the noise; lane k is episode k if left out.
            threads: results do not depend on it.
        """
        columns, count = self._columns(values, episodes)
        noise_key("seed", seed)
        parameters = np.stack(columns) if columns else np.zeros((0, count))
        keys = np.arange(count) if episodes is None else np.asarray(episodes)
        totals = np.repeat(np.array(self._example[1])[:, None], count, axis=1)
        limit = np.finfo(self.kernel.dtype).max
        carry, log = self.kernel.run(
            np.clip(np.vstack([self._starts(parameters, seed, keys), totals]), -limit, limit),
            parameters,
            self.rows,
            seed=seed,
            episodes=keys,
            threads=threads,
            every=max(1, self._log_every),
        )
        ended = rebuild(self._example, iter(list(carry.astype(float))))
        ticks = np.asarray(ended[0].ticks).astype(int)
        completed = ticks >= self.scenario.steps
        named = dict(zip(self.paths, columns, strict=True))
        goals = self._feed.goals(named, np.minimum(ticks, self.scenario.steps - 1))
        return Outcome(
            metrics=self._metrics(ended[1], ticks),
            completed=completed,
            # k / rate, not k * period, as the clock of a single run
            end_time=ticks / self.scenario.rates.control,
            status=endings(self.scenario, named, ended[0].state, goals, ~completed),
            state=ended[0].state,
            log=batch_log(self._logged, log, self._feed.times[:: self._log_every]) if self._log_every else None,
        )

    def _columns(self, values: Mapping[str, Array], episodes: Array | None) -> tuple[list[Array], int]:
        """Numbers of each path, and how many lanes fly.

        Raises:
            ScenarioError: a path that is missing or not of this batch, columns of different lengths, or a delay beyond
                the longest.
        """
        if set(values) != set(self.paths):
            odd = sorted(set(values) ^ set(self.paths))
            raise ScenarioError(f"values: {odd[0]!r} must be there exactly if it is a path of the batch")
        columns = [np.asarray(values[path], dtype=float) for path in self.paths]
        count = columns[0].size if columns else 1 if episodes is None else len(episodes)
        for path, column in zip(self.paths, columns, strict=True):
            if column.shape != (count,) or (episodes is not None and len(episodes) != count):
                raise ScenarioError(
                    f"values[{path!r}]: shape {column.shape}, must be one number for each of {count} lanes"
                )
            longest = self.scenario.delays.longest_command
            if path == LATE and longest is not None and count and not 0.0 <= column.min() <= column.max() <= longest:
                raise ScenarioError(f"values[{path!r}]: must be from 0 to delays.longest_command = {longest!r}")
        return columns, count

    def _metrics(self, totals: tuple[Array, ...], ticks: Array) -> dict[str, Array]:
        """Metrics of each lane."""
        # an episode's instants are the first of the clock: how many of them lie in a window is a table
        instants = {name: np.append(0, np.cumsum(mask))[ticks] for name, mask in self._masks.items()}
        held = dict(zip(self._wanted, totals, strict=True))
        joints, period = self.scenario.world.vehicle.n, 1.0 / self.scenario.rates.control
        return metric_values(self.names, held, instants, joints, period)
