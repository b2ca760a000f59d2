"""Many episodes of one scenario in machine code: other numbers per lane, metrics counted on the fly, no log."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.algebra import Vec3
from skyarm.compile import leaves, rebuild, trace
from skyarm.compile.llvm_text import Lanes
from skyarm.compile.loop import trace_loop
from skyarm.compile.native import Kernel, host_width
from skyarm.dynamics import State
from skyarm.environment import Airspeed, dryden
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.scalars.philox import normal
from skyarm.simulate.closed_loop import (
    CHANNEL_TURBULENCE,
    Carry,
    Row,
    Sample,
    draws_needed,
    make_counting_period,
    structure_of,
)
from skyarm.simulate.endings import endings
from skyarm.simulate.inputs import episode_inputs
from skyarm.simulate.kinematics import level_tool
from skyarm.simulate.native import first_carry
from skyarm.simulate.paths import number_at, with_numbers
from skyarm.simulate.scenario import Scenario, ScenarioError
from skyarm.simulate.totals import Totals, Windows, metrics, nothing_yet

Array = npt.NDArray[Any]


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a batch of episodes left, one entry per lane.

    Attributes:
        metrics: by name; they count only the time an episode was alive. NaN where it ended before their window.
        completed: True where the episode flew its whole duration. end_time: s.
        status: "completed", or why it ended (:mod:`skyarm.simulate.endings`).
        state: the last one of each lane.
    """

    metrics: dict[str, Array]
    completed: Array
    end_time: Array
    status: Array
    state: State


class Batch:
    """A scenario compiled for many episodes.

    Args:
        scenario: on the rigid-body plant; its other numbers are constants of the code.
        paths: numbers that differ from lane to lane (:mod:`skyarm.simulate.paths`).
        windows: of the metrics. single: 32-bit floats. exact: every lane equals the Python floats bit for bit; else a
            multiplication and an addition may be rounded once.
        stiffest: a scenario with the stiffest joint friction of the batch, which fixes the integration steps.
    """

    def __init__(
        self,
        scenario: Scenario,
        paths: Sequence[str] = (),
        *,
        windows: Windows | None = None,
        single: bool = False,
        exact: bool = False,
        stiffest: Scenario | None = None,
        width: int | None = None,
    ) -> None:
        self.scenario, self.paths, self.windows = scenario, tuple(paths), windows or Windows()
        if any(path.startswith("reference.") for path in paths):
            raise ScenarioError("paths: the reference is shared by all lanes; vary anything else")
        scenario.controller.require_compiled("a batch")
        self.base = np.array([number_at(scenario, path) for path in paths])
        inputs = episode_inputs(scenario)
        step_s = 1.0 / scenario.rates.physics
        plant = RigidBodyPlant((stiffest or scenario).world, inputs.wind_example, scenario.integrator, step_s)
        held = inputs.held_reference.dense()
        table = [np.broadcast_to(np.asarray(c, dtype=float), (scenario.steps,)) for c in held.position]
        joints = [np.broadcast_to(np.asarray(c, dtype=float), (scenario.steps,)) for c in held.joints]
        self._goals = np.stack(table, axis=1)
        yaw = np.broadcast_to(np.asarray(held.yaw, dtype=float), (scenario.steps,))
        goal = level_tool(
            scenario.world.vehicle,
            self._goals,
            yaw,
            np.stack(joints, axis=1) if joints else np.zeros((scenario.steps, 0)),
        )
        self.rows = np.column_stack([inputs.times, np.array(inputs.held).reshape(scenario.steps, -1), goal])
        row = Row(time=0.0, reference=inputs.reference_example, tool=Vec3(0.0, 0.0, 0.0))
        self._gusty = isinstance(scenario.wind, Airspeed) and scenario.wind.turbulence is not None
        self._first = trace(self._start, tuple(self.base.tolist()), (0.0,) * (6 * self._gusty))
        totals = nothing_yet(scenario.world.vehicle.n)
        self._example: tuple[Carry, Totals] = (first_carry(scenario), totals)

        def step(both: Any, values: tuple[Any, ...], fed: Row, uniforms: Any) -> tuple[Any, Sample]:
            varied = with_numbers(scenario, dict(zip(self.paths, values, strict=True)))
            return make_counting_period(varied, plant.substeps, self.windows)(both, fed, uniforms)

        draws = draws_needed(scenario)
        loop = trace_loop(step, structure_of(self._example), tuple(self.base.tolist()), row, draws, loops=True)
        lanes = Lanes(width or host_width(single=single), single=single, contract=not exact)
        self.kernel = Kernel(loop, lanes)

    def _start(self, values: tuple[Any, ...], draws: tuple[Any, ...]) -> Any:
        """First carry of a lane; six normal numbers start its turbulence."""
        varied = with_numbers(self.scenario, dict(zip(self.paths, values, strict=True)))
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
        if not columns:
            return np.repeat(np.array(self._first.flat(()))[:, None], len(episodes), axis=1)
        return np.array([self._first.flat(lane) for lane in np.stack(columns, axis=1).tolist()]).T

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
        columns = [np.asarray(values[path], dtype=float) for path in self.paths]
        count = columns[0].size if columns else 1 if episodes is None else len(episodes)
        parameters = np.stack(columns) if columns else np.zeros((0, count))
        keys = np.arange(count) if episodes is None else np.asarray(episodes)
        totals = np.repeat(np.array(leaves(self._example[1]))[:, None], count, axis=1)
        limit = np.finfo(self.kernel.dtype).max
        carry, _ = self.kernel.run(
            np.clip(np.vstack([self._starts(parameters, seed, keys), totals]), -limit, limit),
            parameters,
            self.rows,
            seed=seed,
            episodes=keys,
            threads=threads,
        )
        ended: tuple[Carry, Totals] = rebuild(self._example, iter(list(carry.astype(float))))
        ticks = np.asarray(ended[0].ticks)
        completed = ticks >= self.scenario.steps
        goals = self._goals[np.minimum(ticks.astype(int), self.scenario.steps - 1)]
        return Outcome(
            metrics=self._metrics(ended[1], ticks),
            completed=completed,
            # k / rate, not k * period, as the clock of a single run
            end_time=ticks / self.scenario.rates.control,
            status=endings(
                self.scenario, dict(zip(self.paths, columns, strict=True)), ended[0].state, goals, ~completed
            ),
            state=ended[0].state,
        )

    def _metrics(self, totals: Totals, ticks: Array) -> dict[str, Array]:
        """Metrics; NaN where no instant fell into their window."""
        rate = self.scenario.rates.control
        with np.errstate(all="ignore"):
            found = {name: np.asarray(value) for name, value in metrics(totals, 1.0 / rate).items()}
        steady = np.asarray(totals.count) > 0.5
        early = (ticks > 0.5) & ((ticks - 1.0) / rate >= self.windows.transient_start)
        always = np.ones_like(steady)
        seen = {"peak_pitch": early, "peak_position": early, "iae_position": always, "iae_joint": always}
        return {name: np.where(seen.get(name, steady), value, np.nan) for name, value in found.items()}
