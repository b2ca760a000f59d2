"""Many episodes of one scenario in machine code: other numbers per lane, metrics counted on the fly, no log."""

from __future__ import annotations

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
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.simulate.closed_loop import Carry, Row, Sample, draws_needed, make_counting_period, structure_of
from skyarm.simulate.inputs import episode_inputs
from skyarm.simulate.kinematics import level_tool
from skyarm.simulate.native import first_carry
from skyarm.simulate.paths import number_at, with_numbers
from skyarm.simulate.scenario import Scenario
from skyarm.simulate.totals import Totals, Windows, metrics, nothing_yet

Array = npt.NDArray[Any]


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a batch of episodes left, one entry per lane.

    Attributes:
        metrics: by name; they count only the time an episode was alive.
        completed: True where the episode flew its whole duration. end_time: s.
    """

    metrics: dict[str, Array]
    completed: Array
    end_time: Array


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
        self.scenario, self.paths = scenario, tuple(paths)
        self.base = np.array([number_at(scenario, path) for path in paths])
        inputs = episode_inputs(scenario)
        steps, windows = 1.0 / scenario.rates.physics, windows or Windows()
        plant = RigidBodyPlant((stiffest or scenario).world, inputs.wind_example, scenario.integrator, steps)
        held = inputs.held_reference.dense()
        table = [np.broadcast_to(np.asarray(c, dtype=float), (scenario.steps,)) for c in held.position]
        joints = [np.broadcast_to(np.asarray(c, dtype=float), (scenario.steps,)) for c in held.joints]
        yaw = np.broadcast_to(np.asarray(held.yaw, dtype=float), (scenario.steps,))
        goal = level_tool(
            scenario.world.vehicle,
            np.stack(table, axis=1),
            yaw,
            np.stack(joints, axis=1) if joints else np.zeros((scenario.steps, 0)),
        )
        self.rows = np.column_stack([inputs.times, np.array(inputs.held).reshape(scenario.steps, -1), goal])
        row = Row(time=0.0, reference=inputs.reference_example, tool=Vec3(0.0, 0.0, 0.0))
        self._first = trace(self._start, tuple(self.base.tolist()))
        totals = nothing_yet(scenario.world.vehicle.n)
        self._example: tuple[Carry, Totals] = (first_carry(scenario), totals)

        def step(both: Any, values: tuple[Any, ...], fed: Row, uniforms: Any) -> tuple[Any, Sample]:
            varied = with_numbers(scenario, dict(zip(self.paths, values, strict=True)))
            return make_counting_period(varied, plant.substeps, windows)(both, fed, uniforms)

        loop = trace_loop(step, structure_of(self._example), tuple(self.base.tolist()), row, draws_needed(scenario))
        lanes = Lanes(width or host_width(single=single), single=single, contract=not exact)
        self.kernel = Kernel(loop, lanes)

    def _start(self, values: tuple[Any, ...]) -> Any:
        return first_carry(with_numbers(self.scenario, dict(zip(self.paths, values, strict=True))))

    def fly(
        self, values: Mapping[str, Array], *, seed: int = 0, episodes: Array | None = None, threads: int = 1
    ) -> Outcome:
        """Fly one episode per lane.

        Args:
            values: path -> (lanes,); every path of the batch.
            seed, episodes: keys of the noise; lane k is episode k if left out.
            threads: results do not depend on it.
        """
        columns = [np.asarray(values[path], dtype=float) for path in self.paths]
        count = columns[0].size if columns else 1 if episodes is None else len(episodes)
        parameters = np.stack(columns) if columns else np.zeros((0, count))
        starts = [self._first.flat(tuple(column)) for column in parameters.T.tolist()] if columns else None
        first = np.array(starts).T if starts else np.repeat(np.array(leaves(self._example[0]))[:, None], count, axis=1)
        totals = np.repeat(np.array(leaves(self._example[1]))[:, None], count, axis=1)
        limit = np.finfo(self.kernel.dtype).max
        carry, _ = self.kernel.run(
            np.clip(np.vstack([first, totals]), -limit, limit),
            parameters,
            self.rows,
            seed=seed,
            episodes=episodes,
            threads=threads,
        )
        ended: tuple[Carry, Totals] = rebuild(self._example, iter(list(carry.astype(float))))
        period = 1.0 / self.scenario.rates.control
        with np.errstate(all="ignore"):
            found = metrics(ended[1], period)
        ticks = np.asarray(ended[0].ticks)
        return Outcome(
            {name: np.asarray(value) for name, value in found.items()}, ticks >= self.scenario.steps, ticks * period
        )
