"""Many episodes of one scenario in machine code: other numbers per lane, metrics counted on the fly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from skyarm.compile import leaves, rebuild, trace
from skyarm.compile.llvm.kernel import Kernel, host_width
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.array_evaluation import evaluate
from skyarm.compile.tracing.stepped_loop import trace_loop
from skyarm.dynamics import State
from skyarm.files import shown
from skyarm.files.old_names import warn_of_old_name
from skyarm.log.batch_log import Logged, batch_log
from skyarm.metrics.accumulate import first_totals
from skyarm.metrics.metric_catalogue import metric_names, needed
from skyarm.metrics.metric_catalogue import values as metric_values
from skyarm.metrics.windows import Windows
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.plant.largest_step import largest_step
from skyarm.scenario.numbers import number_at, require_apart, with_numbers
from skyarm.scenario.scenario_checks import require_flight
from skyarm.scenario.scenario_record import Scenario, ScenarioError, noise_key
from skyarm.simulate.batch_rows import Feed, lane_columns
from skyarm.simulate.batch_session import BatchSession
from skyarm.simulate.check_endings import statuses
from skyarm.simulate.counting_period import make_counting_period
from skyarm.simulate.draws import draw_plan, draws_needed, start_draws
from skyarm.simulate.first_state import first_loop_state, first_surroundings
from skyarm.simulate.inputs import episode_inputs
from skyarm.simulate.lane_arguments import require_count, require_kind, require_paths, require_values, require_width
from skyarm.simulate.lane_rules import LaneRules
from skyarm.simulate.loop_state import LoopState, structure_of
from skyarm.simulate.outcome import Outcome
from skyarm.simulate.own_code_trials import try_own_code
from skyarm.simulate.short_steps import require_short_steps

Array = npt.NDArray[Any]


class Batch:
    """A batch flies a scenario compiled for many episodes, whole by its law (:meth:`fly`) or by actions (:meth:`step`).

    Threads that a call asks for are kept for the next one; they end with the batch, or with :meth:`close`, which the
    end of a ``with`` calls.

    Args:
        scenario: on the rigid-body plant; its other numbers are constants of the code.
        paths: numbers that differ from lane to lane (:mod:`skyarm.scenario.numbers`).
        metrics: names and groups of :mod:`skyarm.metrics.metric_catalogue`; what is not asked for costs nothing.
        windows: of the metrics, in place of the scenario's.
        single: 32-bit floats. bit_exact: every lane equals the Python floats bit for bit; else a multiplication and an
            addition may be rounded once. exact: old name of bit_exact.
        stiffest: a scenario with the stiffest joint friction of the batch, and the shortest largest step that its air,
            forces and drives state; both fix the integration steps.
        log_every: keep state, command and reference of each so many control periods; 0 keeps none. A sample takes
            8 bytes (4 if single) a number, 14 + 3 joints + 2 rotors + the reference's: 0.3 to 0.5 kB for two joints and
            four rotors. All of it is there twice while it is sorted.
        effort: of the compiler, as of :class:`skyarm.compile.llvm.kernel.Kernel`; 0 is worth it for few, short
            episodes.

    Attributes:
        stepped: the lanes that :meth:`step` flies, with what ended in them; None before they are begun.
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
        width: int | None = None,
        log_every: int = 0,
        effort: int = 2,
        exact: bool | None = None,
    ) -> None:
        if exact is not None:
            warn_of_old_name("Batch(exact=...)", "bit_exact")
            bit_exact = exact
        require_flight(scenario)
        self.scenario, self.paths = scenario, require_paths(paths)
        require_width(width)
        require_kind("windows", windows, Windows)
        require_kind("stiffest", stiffest, Scenario)
        require_count("effort", effort, 0)
        log_every = require_count("log_every", log_every, 0)
        self.windows = (windows or Windows()).of_flight(scenario.duration, scenario.windows)
        self._kind = {"single": single, "bit_exact": bit_exact, "stiffest": stiffest}
        self.stepped: BatchSession | None = None
        self.names = metric_names(metrics, scenario.world.vehicle.n)
        scenario.controller.require_compiled("a batch")
        try_own_code(scenario)
        require_apart(scenario, self.paths)
        self.base = np.array([number_at(scenario, path) for path in paths])
        self._rules = LaneRules(scenario, self.paths)
        self._wanted = needed(self.names, scenario.world.vehicle.n)
        self._log_every = log_every
        inputs = episode_inputs(scenario)
        first = first_loop_state(scenario)
        stiff = stiffest or scenario
        around = first_surroundings(stiff, first_loop_state(stiff) if stiffest else first)
        plant = RigidBodyPlant(stiff.world, around, scenario.integrator, 1.0 / scenario.rates.physics)
        self._largest = largest_step(around)
        self._masks = self.windows.masks(inputs.times)
        used = dict.fromkeys(window for _, window, _ in self._wanted)
        self._feed = Feed(scenario, self.paths, inputs, {name: self._masks[name] for name in used})
        self.rows = self._feed.rows
        counts = [2 * count for _, count in draw_plan(scenario).components]
        self._first = trace(self._start, tuple(self.base.tolist()), *((0.5,) * count for count in counts))
        self._example: tuple[LoopState, tuple[Any, ...]] = (first, first_totals(self._wanted))

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
        lanes = Lanes(width or host_width(single=single), single=single, contract=not bit_exact)
        self.kernel = Kernel(loop, lanes, logging=log_every > 0, effort=effort)

    def _varied(self, values: Sequence[Any]) -> Scenario:
        return with_numbers(self.scenario, dict(zip(self.paths, values, strict=True)))

    def _start(self, values: tuple[Any, ...], *draws: tuple[Any, ...]) -> Any:
        """First state of a lane's loop; ``draws`` start the components' memories."""
        return first_loop_state(self._varied(values), draws)

    def _starts(self, parameters: Array, seed: int, episodes: Array) -> Array:
        """First state of each lane's loop: (leaves, lanes)."""
        columns = [*parameters]
        for draws in start_draws(self.scenario, seed, episodes):
            columns += [*draws.T]
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

        Raises:
            ScenarioError: columns that do not fit, or a number that the scenario does not take: one line.
        """
        require_count("threads", threads)
        columns, count = lane_columns(self.scenario, self.paths, values, episodes)
        noise_key("seed", seed)
        named = dict(zip(self.paths, columns, strict=True))
        self._rules.require(named)
        require_short_steps(self.scenario, named, self._largest)
        parameters = np.stack(columns) if columns else np.zeros((0, count))
        keys = np.arange(count) if episodes is None else np.asarray(episodes)
        totals = np.repeat(np.array(leaves(self._example[1]))[:, None], count, axis=1)
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
        goals = self._feed.goals(named, np.minimum(ticks, self.scenario.steps - 1))
        status = statuses(self.scenario, named, ended[0].state, goals, ~completed)
        return Outcome(
            metrics=self._metrics(ended[1], ticks),
            # an ending may come in the very last period
            completed=completed & (status == "completed"),
            # k / rate, not k * period, as the clock of a single run
            end_time=ticks / self.scenario.rates.control,
            status=status,
            state=ended[0].state,
            log=batch_log(self._logged, log, self._feed.times[:: self._log_every]) if self._log_every else None,
        )

    def session(
        self,
        values: Mapping[str, Array] | None = None,
        *,
        lanes: int | None = None,
        seed: int = 0,
        threads: int = 1,
        autoreset: bool = True,
    ) -> BatchSession:
        """Begin an episode in every lane, for :meth:`step`; the lanes are :attr:`stepped` from then on.

        Args:
            values: path -> (lanes,); every path of the batch, or none: then the scenario's own numbers.
            lanes: how many, where ``values`` does not say.
            seed: key of the noise.
            threads: most that work.
            autoreset: a lane that has ended begins again by itself.
        """
        columns: list[Array] = []
        count = 1 if lanes is None else lanes
        if values is not None and require_values(values):
            columns, count = lane_columns(self.scenario, self.paths, values, None)
            self._rules.require(dict(zip(self.paths, columns, strict=True)))
        if self.stepped is not None:
            self.stepped.close()
        options: dict[str, Any] = {"seed": seed, "threads": threads, "autoreset": autoreset, **self._kind}
        begun = BatchSession(self.scenario, count, self.paths, **options)
        if columns:
            begun.set(dict(zip(self.paths, columns, strict=True)))
            begun.reset(seed=seed)
        self.stepped = begun
        return begun

    def step(self, actions: Array) -> State:
        """Fly one control period in every lane of :attr:`stepped` by actions in place of the law's.

        :meth:`session` begins the lanes; without it the first step does, with the scenario's numbers in each.

        Args:
            actions: (rotors + joints, lanes): rotor speeds (rad/s), then joint setpoints.

        Returns:
            the plant's state, a record of (lanes,) views that each step writes anew.
        """
        if self.stepped is not None:
            return self.stepped.step(actions)
        vehicle = self.scenario.world.vehicle
        rows, shape = len(vehicle.rotors) + vehicle.n, tuple(getattr(actions, "shape", ()))
        if len(shape) != 2 or not shape[-1]:
            raise ScenarioError(f"actions = {shown(actions)}: must be an array of shape ({rows}, lanes)")
        return self.session(lanes=shape[-1]).step(actions)

    def close(self) -> None:
        """End the threads; another call makes them again."""
        self.kernel.pools.close()
        if self.stepped is not None:
            self.stepped.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _metrics(self, totals: tuple[Array, ...], ticks: Array) -> dict[str, Array]:
        """Metrics of each lane."""
        # an episode's instants are the first of the clock: how many of them lie in a window is a table
        instants = {name: np.append(0, np.cumsum(mask))[ticks] for name, mask in self._masks.items()}
        held = dict(zip(self._wanted, totals, strict=True))
        joints, period = self.scenario.world.vehicle.n, 1.0 / self.scenario.rates.control
        return metric_values(self.names, held, instants, joints, period)
