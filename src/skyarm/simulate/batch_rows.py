"""What a batch's kernel is fed at each control instant: a table that all lanes share.

The reference is a table as long as no lane varies it; then the trajectory is evaluated in the kernel, at the held time,
by the same lines that make the table, and gives the same bits.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.compile import leaves, rebuild, trace
from skyarm.compile.tracing.array_evaluation import evaluate
from skyarm.compile.tracing.lower import live
from skyarm.compile.tracing.tracer import Node
from skyarm.metrics.accumulate import Goal
from skyarm.reference import Publisher, Reference
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.simulate.inputs import EpisodeInputs
from skyarm.simulate.lane_numbers import numbers_of, require_values, require_within_queue
from skyarm.simulate.loop_state import LoopState, Row
from skyarm.simulate.reference_clock import Waits
from skyarm.simulate.tip_and_goal import goal_of

Array = npt.NDArray[Any]


class Feed:
    """Rows of a batch and how its kernel reads them.

    Args:
        scenario: of the batch. paths: its varied numbers. inputs: tables of the scenario.
        masks: window -> (steps,) which instants lie in it.

    Attributes:
        rows: (steps, numbers). example: record of one row. times: (steps,), s.
    """

    def __init__(
        self, scenario: Scenario, paths: Sequence[str], inputs: EpisodeInputs, masks: Mapping[str, Array]
    ) -> None:
        self._scenario, self._paths, self._inputs, self._windows = scenario, tuple(paths), inputs, tuple(masks)
        self.times: Array = inputs.times
        publisher = Publisher(control_rate=scenario.rates.control, reference_rate=scenario.rates.reference)
        self._held_times = publisher.held_time(np.arange(scenario.steps))
        self._own_motion = any(path.startswith("reference.") for path in paths)
        # windows that hold every instant are structure
        self._flags = tuple(name for name in self._windows if not masks[name].all())
        flags = [np.asarray(masks[name], dtype=float) for name in self._flags]
        columns = [inputs.times, *flags]
        self.example: Any = (0.0, (0.0,) * len(flags))
        self._waits = bool(scenario.reference.guards)
        if self._waits:
            pass  # the loop has the reference's clock
        elif self._own_motion:
            columns.append(self._held_times)
            self.example = (*self.example, 0.0)
        else:
            goals = [self._goal_table(record) for record in (inputs.held_reference, inputs.reference)]
            held = np.array(inputs.held, dtype=float).reshape(scenario.steps, -1)
            columns += [held, *(np.stack(_columns(goal, scenario.steps), axis=1) for goal in goals)]
            columns += _columns((inputs.told_reference, inputs.path_time), scenario.steps)
            governor = (inputs.row_example.told, inputs.row_example.path_time)
            self.example = (*self.example, inputs.reference_example, *(_zeros(goal) for goal in goals), governor)
        self.rows = np.column_stack(columns)

    def _goal_table(self, reference: Reference) -> Goal:
        """Goals at every instant, as a record of arrays."""
        vehicle = self._scenario.plant.vehicle
        dense = reference.dense()
        program = trace(lambda one: goal_of(vehicle, one), rebuild(dense, iter([0.0] * len(leaves(dense)))))
        goal: Goal = program.record(list(evaluate(program, leaves(dense), self._scenario.steps)))
        return goal

    def read(self, varied: Scenario, fed: Any) -> tuple[Row, tuple[Goal, ...], dict[str, Any]]:
        """A row as the closed loop takes it: row, (held, continuous) goal, window -> condition.

        Without goals where phases wait: the loop knows where its reference is.
        """
        time, flags, *rest = fed
        inside: dict[str, Any] = dict.fromkeys(self._windows, True)
        inside |= {name: flag > 0.5 for name, flag in zip(self._flags, flags, strict=True)}
        vehicle = varied.plant.vehicle
        if self._waits:
            return Row(time=time, reference=()), (), inside
        if self._own_motion:
            held, free = (varied.reference.at(t) for t in (rest[0], time))
            goals = goal_of(vehicle, held.dense()), goal_of(vehicle, free.dense())
            return Row(time=time, reference=held), goals, inside
        reference, *tables, (told, path_time) = rest
        row = Row(time=time, reference=reference, told=told, path_time=path_time)
        if self._own_arm(varied):
            free = varied.reference.at(time)
            goals = goal_of(vehicle, reference.dense()), goal_of(vehicle, free.dense())
            return row, goals, inside
        return row, (tables[0], tables[1]), inside

    def _own_arm(self, varied: Scenario) -> bool:
        """Whether a varied number moves the tool of a vehicle whose joints stay where they are."""
        still = self._scenario.reference.at(0.0).dense()
        nodes = [c for c in goal_of(varied.plant.vehicle, still).tool if isinstance(c, Node)]
        return any(node.op == "input" for node in live(nodes))

    def goals(self, values: Mapping[str, Array], ticks: Array, now: LoopState) -> Array:
        """(lanes, 3) position of the held reference at each lane's instant, m; ``now`` is how each lane was left."""
        if self._waits:
            motion = {path: column for path, column in values.items() if path.startswith("reference.")}
            with np.errstate(all="ignore"):
                waits = Waits(with_numbers(self._scenario, motion))
                place = waits.held_reference(now.clock, now.ticks).dense().position
            return np.stack(_columns(place, len(ticks)), axis=1)
        if not self._own_motion:
            return np.stack(_columns(self._inputs.held_reference.dense().position, self._scenario.steps), axis=1)[ticks]
        motion = {path: column for path, column in values.items() if path.startswith("reference.")}
        with np.errstate(all="ignore"):
            found = with_numbers(self._scenario, motion).reference.at(self._held_times[ticks]).dense().position
        return np.stack(_columns(found, len(ticks)), axis=1)


def _columns(record: Any, count: int) -> list[Array]:
    """Every scalar of a record as a column."""
    return [np.broadcast_to(np.asarray(leaf, dtype=float), (count,)) for leaf in leaves(record)]


def _zeros(record: Any) -> Any:
    return rebuild(record, iter([0.0] * len(leaves(record))))


def lane_columns(
    scenario: Scenario, paths: Sequence[str], values: Mapping[str, Array], episodes: Array | None
) -> tuple[list[Array], int]:
    """Numbers of each path, and how many lanes fly.

    Raises:
        ScenarioError: a path that is missing or not of this batch, columns of different lengths, or a delay beyond
            the longest.
    """
    if set(require_values(values)) != set(paths):
        odd = sorted(set(values) ^ set(paths))
        raise ScenarioError(f"values: {odd[0]!r} must be there exactly if it is a path of the batch")
    columns = [numbers_of(f"values[{path!r}]", values[path]) for path in paths]
    count = columns[0].size if columns else 1 if episodes is None else len(episodes)
    for path, column in zip(paths, columns, strict=True):
        if column.shape != (count,) or (episodes is not None and len(episodes) != count):
            raise ScenarioError(f"values[{path!r}]: shape {column.shape}, must be one number for each of {count} lanes")
    require_within_queue(scenario, dict(zip(paths, columns, strict=True)))
    return columns, count
