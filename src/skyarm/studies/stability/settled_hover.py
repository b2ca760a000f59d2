"""Stability margins in settled hover for many parameter sets, such as gains, compiled once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from skyarm.compile.llvm.kernel import host_width
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.records.arrays import Array
from skyarm.records.leaves import rebuild
from skyarm.scenario.in_flight import stretches
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.batch_leg import Leg, LegOptions
from skyarm.simulate.inputs import episode_inputs
from skyarm.simulate.loop_state import LoopState
from skyarm.studies.stability.along import Instant, hovering, instant_at
from skyarm.studies.stability.closed_loop import OpenLoop
from skyarm.studies.stability.frozen_scenario import nominal, without_adaptation
from skyarm.studies.stability.open_loop import Differentiator

SPEED = 1e3
"""m/s or rad/s: a hover that moves faster has diverged."""


class SettledHover:
    """Stability margins of a scenario in settled hover, as a function of its parameters.

    What a law adapts slowly is held, as in all margins.

    Args:
        scenario: its hover is simulated first, with the same parameters.
        paths: of those numbers (:mod:`skyarm.scenario.numbers`), as ``controller.gains.position.x``.

    Raises:
        ScenarioError: the loop has a memory that its linearisation does not know.
    """

    def __init__(self, scenario: Scenario, paths: Sequence[str]) -> None:
        flight = hovering(nominal(without_adaptation(scenario)))
        flight = flight.with_kind("rigid_body")
        self.paths = tuple(paths)
        self._differentiator = Differentiator(flight, self.paths)
        options = LegOptions(paths=self.paths, lanes=Lanes(host_width(), contract=False))
        self._leg = Leg(flight, stretches(flight)[0].overrides, range(flight.steps), options)
        inputs = episode_inputs(flight)
        self._row = inputs.rows[flight.steps - 1].tolist()
        self._time = float(self._row[0])

    def margins(self, values: Mapping[str, Array]) -> list[Instant | None]:
        """Stability margins for each parameter set, cut at the commands alone; None if its hover diverged.

        Args:
            values: path -> (sets,); every path.
        """
        found: list[Instant | None] = []
        sets = np.array([values[path] for path in self.paths], dtype=float).T.tolist()
        for settled, numbers in zip(self.settle(values), sets, strict=True):
            if settled is None:
                found.append(None)
                continue
            loops = partial(self.open_loop, settled, numbers)
            found.append(instant_at(loops, hover=True, time=self._time, measured=False))
        return found

    def settle(self, values: Mapping[str, Array], threads: int = 1) -> list[LoopState | None]:
        """Simulate hover for each parameter set; returns final simulation states, None where hover was not reached."""
        columns = [np.asarray(values[path], dtype=float) for path in self.paths]
        count = len(columns[0])
        parameters = self._leg.parameters(columns, count)
        keys = {"seed": 0, "episodes": np.arange(count)}
        carry = self._leg.begin(parameters, 0, np.zeros(count, dtype=int), None)
        with np.errstate(all="ignore"):
            carry, _ = self._leg.fly(carry, parameters, keys, threads)
        settled = [rebuild(self._leg.first, iter(column.tolist()))[0] for column in carry.T]
        return [each if _is_hover(each) else None for each in settled]

    def open_loop(self, settled: LoopState, numbers: Sequence[float], lag: str) -> OpenLoop:
        """Linearised open loop in the settled hover of one set of parameters."""
        return self._differentiator.at(settled, self._row, lag, numbers)


def _is_hover(settled: LoopState) -> bool:
    """True if a final simulation state is at rest and the flight did not end early."""
    if not settled.alive > 0.5:
        return False
    state = settled.agent.state
    moving = np.array([*state.velocity, *state.rate, *state.joint_rates], dtype=float)
    return bool(np.isfinite(moving).all() and np.abs(moving).max() < SPEED)
