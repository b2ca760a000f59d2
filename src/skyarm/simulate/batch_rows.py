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
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.inputs import EpisodeInputs
from skyarm.simulate.lane_loop import columns_of
from skyarm.simulate.loop_state import Row
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
            columns += [held, *(np.stack(columns_of(goal, scenario.steps), axis=1) for goal in goals)]
            columns += columns_of((inputs.told_reference, inputs.path_time), scenario.steps)
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


def _zeros(record: Any) -> Any:
    return rebuild(record, iter([0.0] * len(leaves(record))))
