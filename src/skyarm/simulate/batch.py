"""Batches of closed-loop flights of one scenario in machine code; parameters differ
between the SIMD lanes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from skyarm.compile.llvm.kernel import host_width
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.dynamics import State
from skyarm.log.metrics.metric_catalogue import names_by_agent, required_totals
from skyarm.log.metrics.metric_catalogue import values as metric_values
from skyarm.log.metrics.windows import Windows
from skyarm.log.team_log import OfOneAgentError
from skyarm.records.arrays import AnyArray as Array
from skyarm.records.immutable import positional
from skyarm.records.leaves import leaves, rebuild
from skyarm.scenario.in_flight import require_changes, stretches
from skyarm.scenario.scenario_checks import require_flight
from skyarm.scenario.scenario_record import Scenario, noise_key
from skyarm.simulate.batch_leg import Leg, LegOptions, Tallies
from skyarm.simulate.batch_log import BatchLog, LoggedRows, batch_logs
from skyarm.simulate.examine import require_shapes
from skyarm.simulate.lane_numbers import (
    LaneRules,
    lane_columns,
    require_apart_from_changes,
    require_compiled,
    require_count,
    require_draws,
    require_kind,
    require_paths,
    require_rigid_body,
    warn_of_measured_limits,
)
from skyarm.simulate.loop_state import LoopState


@positional
class AgentOutcome:
    """Motion of one vehicle in a batch of flights.

    Attributes:
        state: its last state in each lane. log: its log in a batch that keeps one, else
            None.
    """

    state: State
    log: BatchLog | None = None


@positional
class Outcome:
    """Results of a batch of flights: arrays with one entry per flight.

    Attributes:
        metrics: metrics by name, of several vehicles as ``left/tilt_max``; they count
            only the time an episode was alive. NaN where it ended before their window.
        completed: True where the episode flew its whole duration without an ending,
            even at its very end. end_time: s.
        status: "completed", or why it ended (:mod:`skyarm.scenario.endings`).
        agents: last state and log of each vehicle by name.
    """

    metrics: dict[str, Array]
    completed: Array
    end_time: Array
    status: Array
    agents: Mapping[str, AgentOutcome]

    @property
    def state(self) -> State:
        """Last state of the only vehicle in each lane."""
        return self._only("state").state

    @property
    def log(self) -> BatchLog | None:
        """Log of the only vehicle in a batch that keeps one, else None."""
        return self._only("log").log

    def _only(self, name: str) -> AgentOutcome:
        # outcome.state is of an only vehicle; among several a choice would be a guess
        if len(self.agents) > 1:
            names = ", ".join(self.agents)
            raise OfOneAgentError(
                f"outcome.{name}: is of one agent; outcome.agents[NAME].{name}, of"
                f" {names}"
            )
        return next(iter(self.agents.values()))


class Batch:
    """Compiled simulation of many flights of one scenario at once, whose parameters
    differ from flight to flight.

    Args:
        scenario: scenario on the rigid-body plant; its other numbers are constants of
            the code.
        paths: numbers that differ from lane to lane (:mod:`skyarm.scenario.numbers`).
        metrics: names and groups of :mod:`skyarm.log.metrics.metric_catalogue`; others
            are not computed.
        windows: time windows of the metrics, in place of the scenario's.
        single: 32-bit floats. bit_exact: every lane equals the Python floats bit for
            bit; else a multiplication and an addition may be rounded once.
        stiffest: a scenario with the stiffest joint friction of the batch, and the
            shortest largest step that its air, forces and drives state; both fix the
            integration steps.
        log_every: keep state, command and reference of each so many control periods; 0
            keeps none. A sample takes 8 bytes (4 if single) a number, 14 + 3 joints + 2
            rotors + the reference's: 0.3 to 0.5 kB for two joints and four rotors. All
            of it is there twice while it is sorted.
        effort: effort of the compiler, as of
            :class:`skyarm.compile.llvm.kernel.Kernel`; 0 is worth it for few, short
            episodes.
    """

    def __init__(
        self,
        scenario: Scenario,
        paths: Sequence[str] = (),
        *,
        metrics: Sequence[str] = ("standard",),
        windows: Windows | None = None,
        single: bool = False,
        bit_exact: bool = False,
        stiffest: Scenario | None = None,
        log_every: int = 0,
        effort: int = 2,
    ) -> None:
        require_flight(scenario)
        require_rigid_body(scenario)
        self.scenario = scenario
        self.paths = require_paths(scenario, paths)
        require_kind("windows", windows, Windows)
        require_kind("stiffest", stiffest, Scenario)
        require_count("effort", effort, 0)
        log_every = require_count("log_every", log_every, 0)
        self.windows = (windows or Windows()).of_flight(
            scenario.duration, scenario.windows
        )
        self._listed = names_by_agent(metrics, scenario.setpoints)
        self.names = tuple(name for own in self._listed.values() for name in own)
        require_compiled(scenario)
        require_shapes(scenario)
        require_changes(scenario)
        self._rules = LaneRules(scenario, self.paths)
        require_draws(scenario, self.paths)
        require_apart_from_changes(scenario, self.paths)
        warn_of_measured_limits(scenario, self.paths)
        vehicles = scenario.vehicles
        self._totals = [
            required_totals([*own.values()], vehicles[name].n)
            for name, own in self._listed.items()
        ]
        self._log_every = log_every
        self._times = np.arange(scenario.steps) / scenario.rates.control
        self._masks = self.windows.masks(self._times)
        course = stretches(scenario)
        # contracted code is faster, and its bits are not those of a single flight
        options = LegOptions(
            paths=self.paths,
            stiffest=stiffest,
            wanted=self._totals,
            masks=self._masks,
            lanes=Lanes(
                host_width(single=single), single=single, contract=not bit_exact
            ),
            every=log_every,
            changing=len(course) > 1,
            effort=effort,
        )
        self._legs: list[Leg] = []
        stops = [*(stretch.start for stretch in course[1:]), scenario.steps]
        for stretch, stop in zip(course, stops, strict=True):
            self._legs.append(
                Leg(
                    scenario,
                    stretch.overrides,
                    range(stretch.start, stop),
                    options,
                    self._legs,
                )
            )
        self.base = np.array(self._legs[0].base)

    def __enter__(self) -> Batch:
        """Return the batch for a ``with`` statement, at whose end nothing has to be
        released.
        """
        return self

    def __exit__(self, *error: object) -> None:
        """Do nothing: a batch holds no resources that have to be released."""

    def fly(
        self,
        values: Mapping[str, Array],
        *,
        seed: int | None = None,
        episodes: Array | None = None,
        threads: int = 1,
    ) -> Outcome:
        """Simulate one flight per SIMD lane, with that lane's parameter values, and
        return the results of all flights.

        Args:
            values: path -> (lanes,); every path of the batch. A number that a change in
                flight sets wins from then on.
            seed: key of the noise; that of the scenario if left out.
            episodes: (lanes,) further keys of the noise; lane k is episode k if left
                out.
            threads: results do not depend on it.

        Raises:
            ScenarioError: columns that do not fit, or a number that the scenario does
                not take: one line.
        """
        require_count("threads", threads)
        seed = self.scenario.seed if seed is None else seed
        columns, count = lane_columns(self.scenario, self.paths, values, episodes)
        noise_key("seed", seed)
        named = dict(zip(self.paths, columns, strict=True))
        self._rules.require(named)
        for leg in self._legs:
            leg.require(columns)
        keys = np.arange(count) if episodes is None else np.asarray(episodes)
        ends, log = self._fly_legs(columns, seed, keys, threads)
        ended = ends[-1]
        ticks = np.asarray(ended[0].ticks).astype(int)
        completed = ticks >= self.scenario.steps
        # from the last states, not in flight: causes cost nothing in the loop
        status = self._statuses(columns, [loop for loop, _ in ends], ticks, ~completed)
        logs = (
            batch_logs(log, self._times[:: self._log_every])
            if self._log_every
            else [None] * len(ended[0].agents)
        )
        return Outcome(
            metrics=self._metrics(ended[1], ticks),
            # an ending may come in the very last period
            completed=completed & (status == "completed"),
            # k / rate, not k * period, as the clock of a single run
            end_time=ticks / self.scenario.rates.control,
            status=status,
            agents={
                name: AgentOutcome(own.state, each)
                for name, own, each in zip(
                    self.scenario.agents, ended[0].agents, logs, strict=True
                )
            },
        )

    def _fly_legs(
        self, columns: list[Array], seed: int, episodes: Array, threads: int
    ) -> tuple[list[tuple[LoopState, Tallies]], list[LoggedRows]]:
        """Simulate a batch from change to change; return final states and metric sums
        per interval, and all logs.
        """
        last: tuple[Leg, Array] | None = None
        ends = list[tuple[LoopState, Tallies]]()
        log = list[LoggedRows]()
        for leg in self._legs:
            parameters = leg.parameters(columns, len(episodes))
            carry = leg.begin(parameters, seed, episodes, last)
            carry, logged = leg.fly(carry, parameters, seed, episodes, threads)
            last = (leg, carry)
            log = [*log, *logged]
            # floats of 64 bits: sums of 32 bits are divided and compared below
            ends.append(rebuild(leg.first, carry.astype(float)))
        return ends, log

    def _statuses(
        self, columns: list[Array], ends: list[LoopState], ticks: Array, ended: Array
    ) -> Array:
        """Termination status of each flight of the batch, under the scenario in force
        when the flight ended.
        """
        statuses = np.full(len(ticks), "completed", dtype=object)
        for leg, now in zip(self._legs, ends, strict=True):
            # a flight of full length ends at the end of the last leg, which belongs to
            # it
            here = (ticks >= leg.periods.start) & (
                (ticks < leg.periods.stop) | (leg is self._legs[-1])
            )
            if here.any():
                left = rebuild(
                    now, [np.asarray(number)[here] for number in leaves(now)]
                )
                mine = [column[here] for column in columns]
                statuses[here] = leg.statuses(mine, left, ticks[here], ended[here])
        return statuses.astype(str)

    def _metrics(self, tallies: Tallies, ticks: Array) -> dict[str, Array]:
        """Metrics of each flight of the batch, from the sums accumulated in flight."""
        # an episode's instants are the first of the clock: how many of them lie in a
        # window is a table
        instants = {
            name: np.append(0, np.cumsum(mask))[ticks]
            for name, mask in self._masks.items()
        }
        period = self.scenario.rates.period
        metrics = dict[str, Array]()
        for (agent, names), totals, sums in zip(
            self._listed.items(), self._totals, tallies, strict=True
        ):
            named = dict(zip(totals, sums, strict=True))
            joints = self.scenario.vehicles[agent].n
            numbers = metric_values([*names.values()], named, instants, joints, period)
            metrics |= {name: numbers[each] for name, each in names.items()}
        return metrics
