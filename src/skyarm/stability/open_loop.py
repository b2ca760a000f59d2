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
from skyarm.compile import leaves, rebuild
from skyarm.compile.llvm.kernel import Kernel, host_width
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.repeat import repeat
from skyarm.compile.tracing.stepped_loop import trace_loop
from skyarm.control.law_checks import checked_law
from skyarm.dynamics import State
from skyarm.environment import MovingAir, Wind
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.plant.rigid_body import STEP, accelerate
from skyarm.plant.surroundings import Surroundings
from skyarm.scalars import data
from skyarm.scenario.scenario_record import PERFECT_SENSORS, Scenario, ScenarioError
from skyarm.sensors.measurement import Measurement, measurement_of
from skyarm.sensors.noise import measure, noise_count
from skyarm.simulate.command_line import switches
from skyarm.simulate.first_state import first_loop_state, first_surroundings
from skyarm.simulate.inputs import episode_inputs
from skyarm.simulate.loop_state import LoopState, Row, structure_of
from skyarm.simulate.stages import Stages
from skyarm.stability.finite_differences import derivatives, stencil_points
from skyarm.stability.loop_channels import Channel, vehicle_channels
from skyarm.vehicle.vehicle_records import Vehicle

Array = npt.NDArray[np.float64]

LAGS = ("up", "down")
"""Which time constant of the rotors holds in both directions."""


@dataclass(frozen=True, kw_only=True, slots=True)
class OpenLoop:
    """Jacobians at an instant; x state (attitude as a rotation vector), u command, m memory, y measurement.

    Attributes:
        period: s. rotors: how many entries of u are rotor speeds; they come first.
        lates: s within a period after which the rotors hear of a new command, ascending from 0; the joints hear of it
            so much later, or earlier in the period, as their delay differs.
        x_x, x_old, x_new: (lates, ...) of the next state by state, acting and new command.
        y_x, y_old: of the measurement now. m_m, m_y, u_m, u_y: of the law, by its memory and the measurement it sees.
        measurement_delay: control periods. command_delay: s, of all commands. rotors_delay, joints_delay: s on top of
            it, of the rotors' and of the joints' part.
        channels: where it is cut for the margins of single loops; none: each number of a command and a measurement.
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
    rotors_delay: float = 0.0
    joints_delay: float = 0.0
    channels: tuple[Channel, ...] = ()


@dataclass(frozen=True, kw_only=True, slots=True)
class _Point:
    """What the open period takes."""

    state: State
    old: Command
    new: Command
    memory: Any
    seen: Measurement


def nominal(scenario: Scenario) -> Scenario:
    """The scenario without noise, turbulence and changes in flight, which have no place in a linearisation."""
    calm: Wind = scenario.wind
    if isinstance(calm, MovingAir):
        calm = dataclasses.replace(calm, turbulence=None)
    return dataclasses.replace(scenario, sensors=PERFECT_SENSORS, wind=calm, changes=())


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
        first = first_loop_state(self.scenario)
        _require_no_memory(self.scenario, first)
        self._components = first.components
        around = first_surroundings(self.scenario, first)
        plant = RigidBodyPlant(self.scenario.world, around, scenario.integrator, 1.0 / scenario.rates.physics)
        self._period, self._substeps = 1.0 / scenario.rates.control, plant.substeps
        ratio = scenario.rates.physics // scenario.rates.control
        self.lates = np.arange(ratio) / scenario.rates.physics
        self._ages: tuple[int, int] | None = None
        """Whole periods that rotors and joints are late; None where they hear of a command together."""
        self._joints_lates = self.lates
        """s within a period after which the joints hear of a command, beside :attr:`lates` of the rotors."""
        if scenario.delays.apart:
            steps = [round(delay * scenario.rates.physics) for delay in _delays(scenario)]
            self._ages = steps[0] // ratio, steps[1] // ratio
            self._joints_lates = (np.arange(ratio) + steps[1] - steps[0]) % ratio / scenario.rates.physics
        self._point = _point(first, self._ages)
        row = Row(time=0.0, reference=inputs.reference_example)

        def step(point: _Point, given: tuple[Any, ...], fed: Row, _uniforms: Any) -> tuple[_Point, Any]:
            return point, self._outputs(point, given, fed)

        given = (0.0, 0.0) if self._ages is None else (0.0, 0.0, 0.0)
        loop = trace_loop(step, structure_of(self._point), given, row, loops=True)
        # few periods are stepped: what compiles five times as fast is quicker in all
        self._kernel = Kernel(loop, Lanes(host_width(), contract=False), logging=True, effort=0)
        self._row = len(leaves(row))

    def _outputs(self, point: _Point, given: tuple[Any, ...], row: Row) -> tuple[Any, ...]:
        """Next state, measurement now, next memory, command; given when rotors (and joints) hear, and the lag."""
        *lates, lag = given
        scenario = with_lag(self.scenario, lag)
        stages = Stages(scenario)
        air = stages.surroundings(self._components, (), row.time)
        force, _ = accelerate(
            scenario.world, point.state, point.state.rotor_speeds, point.old.efforts, air, point.old.rotor_speeds
        )
        count = noise_count(len(point.state.joints), len(point.state.rotor_speeds))
        now = measure(scenario.sensors, row.time, point.state, force.linear, [0] * count)
        memory, command = checked_law(scenario.controller)(
            point.memory, point.seen, stages.joined(row.reference, row.time), self._period, par=scenario.controller.par
        )
        after, left = point.state, self._period
        pieces = [(lates[0], point.old)] if self._ages is None else switches(point.old, point.new, lates[0], lates[1])
        for seconds, acting in pieces:
            after, left = self._advanced(scenario, after, acting, air, seconds), left - seconds
        after = self._advanced(scenario, after, point.new, air, left)
        return tuple(data(leaf) for leaf in leaves((after, now, memory, command)))

    def _advanced(self, scenario: Scenario, state: State, command: Command, air: Surroundings, seconds: Any) -> State:
        # as many steps as a whole period has: a part of it is integrated at least as well
        count = self._substeps(self._period)
        step = STEP[scenario.integrator]
        return repeat(count, lambda x: step(scenario.world, x, command, air, seconds / count), state)

    def at(self, carry: LoopState, row: Sequence[float], lag: str) -> OpenLoop:
        """The linearised open loop where the flight is at ``carry``.

        Args:
            carry: of the nominal flight.
            row: leaves of what the instant is fed.
            lag: one of ``LAGS``.
        """
        point = _point(carry, self._ages)
        sizes = [len(leaves(part)) for part in (point.state, point.old, point.new, point.memory, point.seen)]
        share = float(LAGS.index(lag))
        base = self._completed(carry, point, sizes, row, share)
        moved, widths = stencil_points(base, point.state.quaternion)
        lates = range(len(self.lates))
        results = [self._outputs_of(moved, row, late, share) for late in lates]
        still = [self._outputs_of(base[:, None], row, late, share)[:, 0] for late in lates]
        outs = [sizes[0], sizes[4], sizes[3], sizes[1]]
        parts = [derivatives(result, at, widths, outs) for result, at in zip(results, still, strict=True)]
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
            rotors_delay=float(self.scenario.delays.rotors),
            joints_delay=float(self.scenario.delays.joints),
            channels=self._channels(point, base),
        )

    def _channels(self, point: _Point, base: Array) -> tuple[Channel, ...]:
        """Where the loop is cut, at the command and the measurement of the instant."""
        at: _Point = rebuild(point, iter(base.tolist()))
        speeds = [float(speed) for speed in at.new.rotor_speeds]
        return vehicle_channels(self.scenario.world.vehicle, speeds, at.seen.quaternion)

    def _completed(
        self, carry: LoopState, point: _Point, sizes: list[int], row: Sequence[float], share: float
    ) -> Array:
        """Numbers of the point, with what the period itself makes: the measurement now, and the command it leads to."""
        base = np.array([float(leaf) for leaf in leaves(point)])
        ends = np.cumsum([sizes[0], sizes[4], sizes[3], sizes[1]])
        if not carry.sensors[0].waiting:
            made = self._outputs_of(base[:, None], row, 0, share)[:, 0]
            base[sum(sizes[:4]) :] = made[ends[0] : ends[1]]
        ages = self._ages or (len(carry.queue) - 1,) * 2
        at_once = np.repeat(np.array(ages) == 0, [len(point.new.rotor_speeds), len(point.new.efforts)])
        if at_once.any():
            made = self._outputs_of(base[:, None], row, 0, share)[:, 0]
            following = base[sizes[0] + sizes[1] : sum(sizes[:3])]
            following[at_once] = made[ends[2] : ends[3]][at_once]
        return base

    def _outputs_of(self, points: Array, row: Sequence[float], late: int, share: float) -> Array:
        """Outputs of points, (numbers, lanes), where the command arrives at one of ``lates``, by its number."""
        lanes = points.shape[1]
        when = [self.lates[late]] if self._ages is None else [self.lates[late], self._joints_lates[late]]
        given = np.repeat(np.array([*when, share])[:, None], lanes, axis=1)
        _, log = self._kernel.run(points, given, np.array(row, dtype=float).reshape(1, self._row))
        return np.asarray(log[0], dtype=float)


def _require_no_memory(scenario: Scenario, first: LoopState) -> None:
    """Refuse a loop whose linearisation would have to know more memories than the law's.

    Raises:
        ScenarioError: air, a force, a drive, a sensor or an estimator remembers something, or there is a sensor beside
            the full state; names the first of them by its field.
    """
    fields = ["environment.wind", *(f"environment.air[{i}]" for i in range(len(scenario.air)))]
    fields += [f"environment.forces[{i}]" for i in range(len(scenario.forces))]
    fields += [f"payloads[{i}]" for i in range(len(scenario.payloads))]
    fields += ["plant.vehicle.battery"] * len(scenario.power)
    for field, component, memory in zip(fields, scenario.components, first.components, strict=True):
        _require_none(leaves(memory), field, component)
    for each in scenario.joint_drives:
        joint = [link.joint.name for link in scenario.world.vehicle.links].index(each.joint)
        _require_none(leaves(first.drives[joint]), f"plant.drives.{each.joint}", each.drive)
    for named in scenario.instruments:
        _require_none(True, f"sensors.{named.name}", named.sensor)
    _require_none(leaves(first.estimate), "estimator", scenario.estimator)
    _require_none(leaves(first.sensors[0].memory), "sensors", scenario.sensors)


def _require_none(held: Any, field: str, part: Any) -> None:
    if held:
        what = f"{field} = {type(part).__name__}"
        raise ScenarioError(f"{what}: must be left out of margins, whose loop has no memory but the law's")


def _delays(scenario: Scenario) -> tuple[float, float]:
    """Delays of the rotors' and of the joints' part of a command, s."""
    delays = scenario.delays
    return float(delays.command) + float(delays.rotors), float(delays.command) + float(delays.joints)


def _point(carry: LoopState, ages: tuple[int, int] | None = None) -> _Point:
    """Where the open period is differentiated, as far as the carry tells.

    Args:
        carry: of the flight.
        ages: whole periods that rotors and joints are late; left out: the queue is as long as both.
    """
    last = len(carry.queue) - 1
    old, following = carry.queue[0], carry.queue[min(1, last)]
    if ages is not None:
        old, following = (
            Command(
                rotor_speeds=carry.queue[min(last - ages[0] + k, last)].rotor_speeds,
                efforts=carry.queue[min(last - ages[1] + k, last)].efforts,
            )
            for k in (0, 1)
        )
    # an open period asks for no time and no specific force
    waiting = carry.sensors[0].waiting
    seen = waiting[0] if waiting else measurement_of(carry.state, carry.state.velocity * 0.0)
    return _Point(state=carry.state, old=old, new=following, memory=carry.memory, seen=seen)


def open_loop(scenario: Scenario, carry: LoopState, row: Sequence[float], lag: str = "up") -> OpenLoop:
    """The linearised open loop of a scenario at a carry of its flight; see :class:`Differentiator`."""
    return Differentiator(scenario).at(carry, row, lag)


def carry_of(template: LoopState, values: Sequence[float]) -> LoopState:
    """A carry from its numbers."""
    found: LoopState = rebuild(template, iter([float(value) for value in values]))
    return found
