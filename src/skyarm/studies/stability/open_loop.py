"""Open-loop linearisation of one control period by finite differences at an instant of
a flight.

Differentiated is the machine code of one control period itself, by central differences
of fourth order: four steps in each direction, all lanes of one call. The attitude moves
by rotation vectors, in and out; everything else is a number. The rotors' lag is faster
upward than downward, so that a hovering loop has two linearisations, with either time
constant for both directions, in plant and model; between both lies the one that a small
swing meets.

Joint drives take part with their memories. A battery sags under its load as it does;
its charge, which takes minutes to move, is held as it is.

Source: B. Fornberg 1988, Table 1 (first derivative, fourth order).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, cast

import numpy as np

from skyarm.algebra import Quaternion, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import data
from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.tracing.lower import repeat
from skyarm.control.law_checks import checked_law
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.plant.rigid_body import COUPLED_STEP, accelerate
from skyarm.plant.surroundings import Memories, Together
from skyarm.records.arrays import Array, doubles, float_array
from skyarm.records.immutable import immutable
from skyarm.records.leaves import Tree, leaves, rebuild
from skyarm.reference import Reference
from skyarm.scenario.numbers import number_at, with_numbers
from skyarm.scenario.scenario_record import Scenario
from skyarm.sensing.measurement import Measurement, measure, measurement_of, noise_count
from skyarm.simulate.command_delay import drives_after
from skyarm.simulate.inputs import episode_inputs
from skyarm.simulate.loop_state import InputRow, LoopState
from skyarm.simulate.program import LoopProgram, PeriodRow, TracedPeriod
from skyarm.studies.stability.closed_loop import OpenLoop
from skyarm.studies.stability.frozen_scenario import (
    SHARES,
    nominal,
    require_no_memory,
    with_held_lag,
    with_lag,
)
from skyarm.studies.stability.loop_channels import vehicle_channels

STEP_SIZE = 1e-4
"""Finite difference, in the number's unit, or relative for numbers above 1; the
fourth-order error is 1e-12."""

STENCIL = ((-2.0, 1.0 / 12.0), (-1.0, -2.0 / 3.0), (1.0, 2.0 / 3.0), (2.0, -1.0 / 12.0))
"""Steps and weights of the first derivative, fourth order."""


def stencil_points(base: Array, attitude: Quaternion) -> tuple[Array, Array]:
    """Points (variables, directions * 4) for finite differences about an operating
    point, and their steps.

    Args:
        base: the point (leaves,): three of position, four of attitude (wxyz), then
            plain numbers.
        attitude: the same as ``base[3:7]``.
    """
    count = len(base)
    # a rotation has one direction less; steps are relative for large numbers, as rotor
    # speeds, and absolute near 0
    widths = STEP_SIZE * np.maximum(1.0, np.abs(np.delete(base, 3)))
    turns = slice(3, 6)
    widths[turns] = STEP_SIZE
    points = np.repeat(base[:, None], 4 * (count - 1), axis=1)
    for direction, width in enumerate(widths):
        for j, (steps, _) in enumerate(STENCIL):
            column = 4 * direction + j
            if 3 <= direction < 6:
                v = [0.0, 0.0, 0.0]
                # a quaternion turns by half of the angle
                v[direction - 3] = 0.5 * steps * width
                points[3:7, column] = list(_rotate(attitude, v))
            else:
                points[direction if direction < 3 else direction + 1, column] += (
                    steps * width
                )
    return points, widths


def derivatives(
    result: Array, still: Array, widths: Array, outs: list[int]
) -> list[Array]:
    """Jacobians of next vehicle state, measurement, controller state and command, by
    finite differences.

    Args:
        result: outputs at the points of :func:`stencil_points` (outputs, directions *
            4).
        still: outputs at the point itself (outputs,).
        widths: step of each direction (directions,).
        outs: numbers of outputs of the four; those of the state come first.
    """
    directions = len(widths)
    state = _tangent(result[: outs[0]], still[: outs[0]])
    values = np.vstack([state, result[outs[0] :] - still[outs[0] :, None]])
    weights = np.array([weight for _, weight in STENCIL])
    slopes = values.reshape(len(values), directions, len(STENCIL)) @ weights / widths
    ends = np.cumsum([outs[0] - 1, *outs[1:]])
    # an attitude has four numbers and three directions of change, so the state has one
    # row less
    return np.split(slopes, ends[:-1].tolist())


def _rotate(q: Quaternion, half: Sequence[float]) -> Quaternion:
    """Rotate quaternion q by a small rotation vector, twice ``half``; first order,
    normalised.
    """
    x, y, z = half
    w = float(np.sqrt(1.0 - x * x - y * y - z * z))
    return Quaternion(*map(float, q)) * Quaternion(w, x, y, z)


def _tangent(states: Array, still: Array) -> Array:
    """Differences (variables, points) of many vehicle states from a common one;
    attitude as a rotation vector.
    """
    w, x, y, z = still[3:7]
    a, b, c, d = states[3:7]
    # a small turn is twice the vector part of the inverse of still times the other
    turn = 2.0 * np.array(
        [
            w * b - x * a - y * d + z * c,
            w * c + x * d - y * a - z * b,
            w * d - x * c + y * b - z * a,
        ]
    )
    return np.vstack([states[:3] - still[:3, None], turn, states[7:] - still[7:, None]])


Given = tuple[tuple[Scalar, Scalar], Scalars]
"""Arrival time of a command (s) and fraction of the rotors' lag; values of the
parameter paths."""


@immutable
class OpenPoint:
    """Operating point of one open-loop control period; the battery's internal state is
    constant.
    """

    state: State
    drives: Memories
    old: Command
    new: Command
    memory: Tree
    seen: Measurement
    power: Any


def open_point(carry: LoopState, batteries: int = 0) -> OpenPoint:
    """Operating point for the linearisation, from the state of the simulation loop.

    Args:
        carry: state of the flight.
        batteries: number of the last components that are batteries.
    """
    # an open period asks for no time and no specific force
    own, waiting = carry.agent, carry.agent.sensors[0].waiting
    # the first sensor is of the full state
    seen = (
        cast("Measurement", waiting[0])
        if waiting
        else measurement_of(own.state, own.state.velocity * 0.0)
    )
    return OpenPoint(
        state=own.state,
        drives=own.drives,
        old=own.queue[0],
        new=own.queue[min(1, len(own.queue) - 1)],
        memory=own.memory,
        seen=seen,
        power=own.components[len(own.components) - batteries :] if batteries else (),
    )


def sizes_of(point: OpenPoint) -> list[int]:
    """Sizes of an operating point's parts: vehicle state, commands, controller state,
    measurement, battery.
    """
    parts = (point.old, point.new, point.memory, point.seen, point.power)
    return [
        len(leaves((point.state, point.drives))),
        *(len(leaves(part)) for part in parts),
    ]


class Differentiator:
    """Linearisation of a scenario's open-loop control period by finite differences of
    its machine code.

    Args:
        scenario: on the rigid-body plant; noise and turbulence are left out.
        paths: numbers that :meth:`at` may be given others of, as those of a batch; the
            code is made once for all.
    """

    def __init__(self, scenario: Scenario, paths: Sequence[str] = ()) -> None:
        self.scenario, self._paths = nominal(scenario), tuple(paths)
        self._numbers = tuple(number_at(self.scenario, path) for path in self._paths)
        inputs = episode_inputs(self.scenario)
        self._program = LoopProgram(
            self.scenario, self._scenario_of, ((0.0, 0.0), self._numbers)
        )
        first = self._first = self._program.first
        require_no_memory(self.scenario, first)
        self._period = scenario.rates.period
        self._substeps = self._program.plant.substeps
        ratio = scenario.rates.physics // scenario.rates.control
        self.lates = np.arange(ratio) / scenario.rates.physics
        self._point = open_point(first, len(scenario.agent.power))
        row = inputs.row_at(0, first.agent, first.ticks)
        loop = self._program.trace(
            self._open_period, self._point, PeriodRow(given=(row,))
        )
        # few periods are stepped: what compiles five times as fast is quicker in all
        self._kernel = Kernel(loop, logging=True, effort=0)
        self._row = len(leaves(row))

    def _scenario_of(self, given: Given) -> Scenario:
        """Scenario of an open-loop period, for a given rotor lag and parameters."""
        (_, lag), numbers = given
        own = self.scenario
        if self._paths:
            own = with_numbers(own, dict(zip(self._paths, numbers, strict=True)))
        return with_held_lag(with_lag(own, lag))

    def _open_period(
        self, period: TracedPeriod, point: OpenPoint
    ) -> tuple[OpenPoint, Scalars]:
        """Next state, measurement, controller state and command, with the loop open
        between them.
        """
        stages = period.stages
        scenario = stages.scenario
        late, _ = period.numbers[0]
        row = cast("InputRow[Reference]", period.row.given[0])
        power = tuple(
            each.supply(charge, self._period, point.state, point.old.rotor_speeds)
            for each, charge in zip(scenario.agent.power, point.power, strict=True)
        )
        own_models = self._first.agent.components
        models = (*own_models[: len(own_models) - len(power)], *power)
        agent = replace(self._first.agent, components=models, drives=point.drives)
        air = stages.surroundings(self._first.with_agent(agent), row.time)
        ((force, _),) = accelerate(stages.worlds, (point.state,), (point.old,), air)
        count = noise_count(len(point.state.joints), len(point.state.rotor_speeds))
        # without drag nothing pushes along x and y
        proper = Vec3(*map(data, force.linear))
        now = measure(scenario.agent.noise, row.time, point.state, proper, [0] * count)
        memory, command = checked_law(scenario.agent.controller)(
            point.memory,
            point.seen,
            stages.agent.law_reference(row),
            self._period,
            par=scenario.agent.controller.par,
        )
        # a drive hears the mean of both commands once in a period, as it does in flight
        drives = drives_after(
            scenario.agent.all_drives,
            point.drives,
            point.old,
            point.new,
            late,
            point.state,
            self._period,
        )
        air = air.with_drives([drives])
        after = self._advance(scenario, point.state, point.old, air, late)
        after = self._advance(scenario, after, point.new, air, self._period - late)
        return point, tuple(map(data, leaves((after, drives, now, memory, command))))

    def _advance(
        self,
        scenario: Scenario,
        state: State,
        command: Command,
        air: Together,
        seconds: Any,
    ) -> State:
        # as many steps as a whole period has: a part of it is integrated at least as
        # well
        count = self._substeps(self._period).near
        step = COUPLED_STEP[scenario.integrator]
        worlds = (scenario.agent.plant,)
        part = seconds / count
        return repeat(
            count, lambda x: step(worlds, (x,), (command,), air, part)[0][0], state
        )

    def at(
        self,
        carry: LoopState,
        row: Sequence[float],
        lag: str,
        numbers: Sequence[float] | None = None,
    ) -> OpenLoop:
        """Linearise the open loop at a state of the simulated flight.

        Args:
            carry: state of the nominal flight.
            row: leaves of the inputs of the instant.
            lag: one of ``SHARES``.
            numbers: numbers at the paths; the scenario's own if left out.
        """
        given = (SHARES[lag], *(self._numbers if numbers is None else numbers))
        point = open_point(carry, len(self.scenario.agent.power))
        sizes = sizes_of(point)
        base = self._complete(carry, point, sizes, row, given)
        completed = rebuild(point, iter(base.tolist()))
        moved, widths = stencil_points(base, point.state.quaternion)
        lates = range(len(self.lates))
        results = [self._outputs_of(moved, row, late, given) for late in lates]
        still = [
            self._outputs_of(base[:, None], row, late, given)[:, 0] for late in lates
        ]
        # in the order of _open_period: state, measurement, memory of the law, command
        outs = [sizes[0], sizes[4], sizes[3], sizes[1]]
        parts = [
            derivatives(result, at, widths, outs)
            for result, at in zip(results, still, strict=True)
        ]
        columns = np.cumsum([0, sizes[0] - 1, *sizes[1:5]])
        x, old, new, m, y = (slice(int(a), int(b)) for a, b in pairwise(columns))
        # only the next state depends on when a command arrives
        first = parts[0]
        following = np.array([part[0] for part in parts])
        return OpenLoop(
            period=self._period,
            rotors=len(point.state.rotor_speeds),
            lates=self.lates,
            x_x=following[:, :, x],
            x_old=following[:, :, old],
            x_new=following[:, :, new],
            y_x=first[1][:, x],
            y_old=first[1][:, old],
            m_m=first[2][:, m],
            m_y=first[2][:, y],
            u_m=first[3][:, m],
            u_y=first[3][:, y],
            measurement_delay=round(
                self.scenario.agent.delays.measurement * self.scenario.rates.control
            ),
            command_delay=float(self.scenario.agent.delays.command),
            states=len(leaves(point.state)) - 1,
            # cut at this operating point
            channels=vehicle_channels(
                self.scenario.agent.vehicle,
                list(map(float, completed.new.rotor_speeds)),
                completed.seen.quaternion,
            ),
        )

    def _complete(
        self,
        carry: LoopState,
        point: OpenPoint,
        sizes: list[int],
        row: Sequence[float],
        given: Sequence[float],
    ) -> Array:
        """Scalars of the operating point, with measurement and command computed where
        they have no delay.
        """
        base = float_array(leaves(point))
        ends = np.cumsum([sizes[0], sizes[4], sizes[3], sizes[1]])
        if not carry.agent.sensors[0].waiting:
            made = self._outputs_of(base[:, None], row, 0, given)[:, 0]
            base[sum(sizes[:4]) : sum(sizes[:5])] = made[ends[0] : ends[1]]
        # computed anew, since the command follows from the measurement filled in above
        if len(carry.agent.queue) == 1:
            made = self._outputs_of(base[:, None], row, 0, given)[:, 0]
            base[sizes[0] + sizes[1] : sum(sizes[:3])] = made[ends[2] : ends[3]]
        return base

    def _outputs_of(
        self, points: Array, row: Sequence[float], late: int, numbers: Sequence[float]
    ) -> Array:
        """Outputs (outputs, points) of the open loop at many operating points in one
        call of machine code.

        ``numbers`` are the lag's share and those of the paths.
        """
        lanes = points.shape[1]
        given = np.repeat(
            np.array([self.lates[late], *numbers])[:, None], lanes, axis=1
        )
        _, log = self._kernel.run(points, given, doubles(row).reshape(1, self._row))
        return doubles(log[0])


def carry_of(template: LoopState, values: Sequence[float]) -> LoopState:
    """Rebuild the state of the simulation loop from its scalar values."""
    return rebuild(template, map(float, values))
