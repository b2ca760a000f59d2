"""The sampled loop cut open at the commands and linearised at an instant, with any dead time of the commands.

Differentiated is the machine code of one control period itself, by central differences of fourth order: four steps in
each direction, all lanes of one call. The attitude moves by rotation vectors, in and out; everything else is a number.
The rotors' lag is faster upward than downward, so that a hovering loop has two linearisations; both are taken, with
either time constant for both directions, in plant and belief.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.actuation import Command
from skyarm.algebra import ZERO3, Quaternion
from skyarm.compile import leaves, rebuild
from skyarm.compile.llvm_text import Lanes
from skyarm.compile.loop import trace_loop
from skyarm.compile.native import Kernel, host_width
from skyarm.compile.repeat import repeat
from skyarm.dynamics import State
from skyarm.dynamics.measurement import Measurement, measurement_of
from skyarm.environment import Airspeed, Wind, WindSample, afflicted, wind
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.plant.interface import number
from skyarm.plant.rigid_body import STEP, accelerate
from skyarm.plant.sensors import measure, noise_count
from skyarm.simulate.carry import Carry, Row, structure_of
from skyarm.simulate.inputs import episode_inputs
from skyarm.simulate.native import first_carry
from skyarm.simulate.scenario import PERFECT_SENSORS, Scenario
from skyarm.vehicle.records import Vehicle

Array = npt.NDArray[np.float64]

LAGS = ("up", "down")
"""Which time constant of the rotors holds in both directions."""

STEP_SIZE = 1e-4
"""Step of a difference, in the number's unit or relative where the number is above 1: fourth order leaves 1e-12."""

STENCIL = ((-2.0, 1.0 / 12.0), (-1.0, -2.0 / 3.0), (1.0, 2.0 / 3.0), (2.0, -1.0 / 12.0))
"""(step, weight) of the first derivative, fourth order."""


@dataclass(frozen=True, kw_only=True, slots=True)
class OpenLoop:
    """Jacobians at an instant; x state (attitude as a rotation vector), u command, m memory, y measurement.

    Attributes:
        period: s. rotors: how many entries of u are rotor speeds; they come first.
        lates: s within a period after which a new command acts, ascending from 0.
        x_x, x_old, x_new: (lates, ...) of the next state by state, acting and new command.
        y_x, y_old: of the measurement now. m_m, m_y, u_m, u_y: of the law, by its memory and the measurement it sees.
        measurement_delay: control periods. command_delay: s.
    """

    period: float
    rotors: int
    lates: Array
    x_x: Array
    x_old: Array
    x_new: Array
    y_x: Array
    y_old: Array
    m_m: Array
    m_y: Array
    u_m: Array
    u_y: Array
    measurement_delay: int = 0
    command_delay: float = 0.0


@dataclass(frozen=True, kw_only=True, slots=True)
class _Point:
    """What the open period takes."""

    state: State
    old: Command
    new: Command
    memory: Any
    seen: Measurement


def nominal(scenario: Scenario) -> Scenario:
    """The scenario without noise and turbulence, which have no place in a linearisation."""
    calm: Wind = scenario.wind
    if isinstance(calm, Airspeed):
        calm = dataclasses.replace(calm, turbulence=None)
    return dataclasses.replace(scenario, sensors=PERFECT_SENSORS, wind=calm)


def with_lag(scenario: Scenario, share: Any) -> Scenario:
    """The scenario with rotors of one time constant, in plant and belief: up (share 0), down (1) or between."""

    def even(vehicle: Vehicle) -> Vehicle:
        rotors = []
        for rotor in vehicle.rotors:
            lag = rotor.time_constant_up + share * (rotor.time_constant_down - rotor.time_constant_up)
            rotors.append(dataclasses.replace(rotor, time_constant_up=lag, time_constant_down=lag))
        return dataclasses.replace(vehicle, rotors=tuple(rotors))

    par = scenario.controller.par
    model = dataclasses.replace(par.model, vehicle=even(par.model.vehicle))
    controller = dataclasses.replace(scenario.controller, par=dataclasses.replace(par, model=model))
    world = dataclasses.replace(scenario.world, vehicle=even(scenario.world.vehicle))
    return dataclasses.replace(scenario, controller=controller, world=world)


class Differentiator:
    """One control period of a scenario, cut open, as machine code that is stepped beside a point.

    Args:
        scenario: on the rigid-body plant; noise and turbulence are left out.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = nominal(scenario)
        inputs = episode_inputs(self.scenario)
        plant = RigidBodyPlant(
            self.scenario.world, inputs.wind_example, scenario.integrator, 1.0 / scenario.rates.physics
        )
        self._period, self._substeps = 1.0 / scenario.rates.control, plant.substeps
        ratio = scenario.rates.physics // scenario.rates.control
        self.lates = np.arange(ratio) / scenario.rates.physics
        self._point = _point(first_carry(self.scenario))
        row = Row(time=0.0, reference=inputs.reference_example)

        def step(point: _Point, given: tuple[Any, ...], fed: Row, _uniforms: Any) -> tuple[_Point, Any]:
            return point, self._outputs(point, given, fed)

        loop = trace_loop(step, structure_of(self._point), (0.0, 0.0), row, loops=True)
        self._kernel = Kernel(loop, Lanes(host_width(), contract=False), logging=True)
        self._row = len(leaves(row))

    def _outputs(self, point: _Point, given: tuple[Any, ...], row: Row) -> tuple[Any, ...]:
        """Next state, measurement now, next memory, command."""
        late, lag = given
        scenario = with_lag(self.scenario, lag)
        air = afflicted(wind(scenario.wind, row.time, ZERO3), scenario.faults, scenario.world.vehicle, row.time)
        force, _ = accelerate(scenario.world, point.state, point.state.rotor_speeds, point.old.efforts, air)
        count = noise_count(len(point.state.joints), len(point.state.rotor_speeds))
        now = measure(scenario.sensors, row.time, point.state, force.linear, [0] * count)
        memory, command = scenario.controller.law(
            point.memory, point.seen, row.reference, self._period, par=scenario.controller.par
        )
        between = self._advanced(scenario, point.state, point.old, air, late)
        after = self._advanced(scenario, between, point.new, air, self._period - late)
        return tuple(number(leaf) for leaf in leaves((after, now, memory, command)))

    def _advanced(self, scenario: Scenario, state: State, command: Command, air: WindSample, seconds: Any) -> State:
        # as many steps as a whole period has: a part of it is integrated at least as well
        count = self._substeps(self._period)
        step = STEP[scenario.integrator]
        return repeat(count, lambda x: step(scenario.world, x, command, air, seconds / count), state)

    def at(self, carry: Carry, row: Sequence[float], lag: str) -> OpenLoop:
        """The linearised open loop where the flight is at ``carry``.

        Args:
            carry: of the nominal flight.
            row: leaves of what the instant is fed.
            lag: one of ``LAGS``.
        """
        point = _point(carry)
        sizes = [len(leaves(part)) for part in (point.state, point.old, point.new, point.memory, point.seen)]
        share = float(LAGS.index(lag))
        base = self._completed(carry, point, sizes, row, share)
        moved, widths = self._moved(base, point.state, sum(sizes[1:]))
        results = [self._outputs_of(moved, row, late, share) for late in self.lates]
        still = [self._outputs_of(base[:, None], row, late, share)[:, 0] for late in self.lates]
        outs = [sizes[0], sizes[4], sizes[3], sizes[1]]
        parts = [self._derivatives(result, at, widths, outs) for result, at in zip(results, still, strict=True)]
        columns = np.cumsum([0, sizes[0] - 1, *sizes[1:]])
        x, old, new, m, y = (slice(int(a), int(b)) for a, b in pairwise(columns))
        first = parts[0]
        return OpenLoop(
            period=self._period,
            rotors=len(point.state.rotor_speeds),
            lates=self.lates,
            x_x=np.array([part[0][:, x] for part in parts]),
            x_old=np.array([part[0][:, old] for part in parts]),
            x_new=np.array([part[0][:, new] for part in parts]),
            y_x=first[1][:, x],
            y_old=first[1][:, old],
            m_m=first[2][:, m],
            m_y=first[2][:, y],
            u_m=first[3][:, m],
            u_y=first[3][:, y],
            measurement_delay=round(self.scenario.delays.measurement * self.scenario.rates.control),
            command_delay=float(self.scenario.delays.command),
        )

    def _completed(self, carry: Carry, point: _Point, sizes: list[int], row: Sequence[float], share: float) -> Array:
        """Numbers of the point, with what the period itself makes: the measurement now, and the command it leads to."""
        base = np.array([float(leaf) for leaf in leaves(point)])
        ends = np.cumsum([sizes[0], sizes[4], sizes[3], sizes[1]])
        if not carry.readings:
            made = self._outputs_of(base[:, None], row, 0.0, share)[:, 0]
            base[sum(sizes[:4]) :] = made[ends[0] : ends[1]]
        if len(carry.queue) == 1:
            made = self._outputs_of(base[:, None], row, 0.0, share)[:, 0]
            base[sizes[0] + sizes[1] : sum(sizes[:3])] = made[ends[2] : ends[3]]
        return base

    def _moved(self, base: Array, state: State, others: int) -> tuple[Array, Array]:
        """Every point of the stencils, (leaves, directions * 4), and the step of each direction."""
        count = len(base)
        widths = STEP_SIZE * np.maximum(1.0, np.abs(np.delete(base, 3)))  # a rotation has one direction less
        turns = slice(3, 6)
        widths[turns] = STEP_SIZE
        found = np.repeat(base[:, None], 4 * (count - 1), axis=1)
        for direction, width in enumerate(widths):
            for j, (steps, _) in enumerate(STENCIL):
                column = 4 * direction + j
                if 3 <= direction < 6:
                    v = [0.0, 0.0, 0.0]
                    v[direction - 3] = 0.5 * steps * width
                    found[3:7, column] = list(_turned(state.quaternion, v))
                else:
                    found[direction if direction < 3 else direction + 1, column] += steps * width
        assert others == count - len(leaves(state))
        return found, widths

    def _outputs_of(self, points: Array, row: Sequence[float], late: float, share: float) -> Array:
        lanes = points.shape[1]
        given = np.repeat(np.array([[late], [share]]), lanes, axis=1)
        _, log = self._kernel.run(points, given, np.array(row, dtype=float).reshape(1, self._row))
        return np.asarray(log[0], dtype=float)

    def _derivatives(self, result: Array, still: Array, widths: Array, outs: list[int]) -> list[Array]:
        """Jacobians of next state, measurement, memory and command by every direction."""
        directions = len(widths)
        state = _tangent(result[: outs[0]], still[: outs[0]])
        values = np.vstack([state, result[outs[0] :] - still[outs[0] :, None]])
        weights = np.array([weight for _, weight in STENCIL])
        slopes = values.reshape(len(values), directions, len(STENCIL)) @ weights / widths
        ends = np.cumsum([outs[0] - 1, *outs[1:]])
        return np.split(slopes, ends[:-1].tolist())


def _point(carry: Carry) -> _Point:
    """Where the open period is differentiated, as far as the carry tells."""
    following = carry.queue[1] if len(carry.queue) > 1 else carry.queue[0]
    # an open period asks for no time and no specific force
    seen = carry.readings[0] if carry.readings else measurement_of(carry.state, carry.state.velocity * 0.0)
    return _Point(state=carry.state, old=carry.queue[0], new=following, memory=carry.memory, seen=seen)


def _turned(q: Quaternion, half: Sequence[float]) -> Quaternion:
    """q times the rotation of twice the vector ``half``, first order with unit length to 1e-16."""
    x, y, z = half
    w = float(np.sqrt(1.0 - x * x - y * y - z * z))
    turned: Quaternion = Quaternion(*(float(c) for c in q)) * Quaternion(w, x, y, z)
    return turned


def _tangent(states: Array, still: Array) -> Array:
    """Differences of states (leaves, lanes) from one; the attitude's as twice the vector part of q0^-1 q."""
    w, x, y, z = still[3:7]
    a, b, c, d = states[3:7]
    turn = 2.0 * np.array([w * b - x * a - y * d + z * c, w * c + x * d - y * a - z * b, w * d - x * c + y * b - z * a])
    return np.vstack([states[:3] - still[:3, None], turn, states[7:] - still[7:, None]])


def open_loop(scenario: Scenario, carry: Carry, row: Sequence[float], lag: str = "up") -> OpenLoop:
    """The linearised open loop of a scenario at a carry of its flight; see :class:`Differentiator`."""
    return Differentiator(scenario).at(carry, row, lag)


def carry_of(template: Carry, values: Sequence[float]) -> Carry:
    """A carry from its numbers."""
    found: Carry = rebuild(template, iter([float(value) for value in values]))
    return found
