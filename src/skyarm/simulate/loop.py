"""Fly one episode: clock, sensors, controller, plant, log."""

from __future__ import annotations

import warnings
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from skyarm.actuation.hover import hover_trim
from skyarm.compile import leaves, rebuild, trace
from skyarm.dynamics import State
from skyarm.files import shown
from skyarm.plant.compiled import RigidBodyPlant, example_command, example_state
from skyarm.plant.interface import Plant, flat
from skyarm.plant.sensors import measure
from skyarm.simulate import native
from skyarm.simulate.inputs import EpisodeInputs, episode_inputs, first_state
from skyarm.simulate.log import Log, Samples, assemble
from skyarm.simulate.monitor import Monitor
from skyarm.simulate.scenario import Scenario, ScenarioError

Progress = Callable[[int, int], None]


def make_plant(scenario: Scenario, inputs: EpisodeInputs) -> Plant:
    """The scenario's plant."""
    step = 1.0 / scenario.rates.physics
    if scenario.plant == "mujoco":
        from skyarm.plant.mujoco import MujocoPlant

        return MujocoPlant(scenario.world, inputs.wind_example, scenario.integrator, step)
    return RigidBodyPlant(scenario.world, inputs.wind_example, scenario.integrator, step)


class _Loop:
    """Programs and buffers of one episode."""

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        self.inputs = episode_inputs(scenario)
        self.plant = make_plant(scenario, self.inputs)
        vehicle, controller = scenario.world.vehicle, scenario.controller
        n, rotors = vehicle.n, len(vehicle.rotors)
        state = example_state(n, rotors)
        time = (0.0,)
        noise = self.inputs.noise_example

        def sense(clock: Any, x: State, force: Any, draws: Any) -> Any:
            return measure(scenario.sensors, clock[0], x, force, draws)

        self.sense = trace(sense, time, state, state.velocity, noise)
        reading = self.sense.record(self.sense.flat((0.0, *flat(state), 0.0, 0.0, 9.81, *leaves(noise))))
        period = 1.0 / scenario.rates.control

        def control(memory: Any, measurement: Any, reference: Any) -> Any:
            return controller.law(memory, measurement, reference, period, par=controller.par)

        self.control = None
        self.memory: Any = controller.memory
        self.shapes = reading, self.inputs.reference_example
        self.law = control
        if controller.compiled:
            self.control = trace(control, controller.memory, reading, self.inputs.reference_example)
            self.memory = tuple(leaves(controller.memory))
        self.widths = [len(leaves(each)) for each in (state, example_command(n, rotors), reading)]

    def command(self, reading: Sequence[float], reference: Sequence[float]) -> tuple[float, ...]:
        if self.control is None:
            records = (rebuild(shape, iter(row)) for shape, row in zip(self.shapes, (reading, reference), strict=True))
            self.memory, command = self.law(self.memory, *records)
            return tuple(leaves(command))
        result = self.control.flat((*self.memory, *reading, *reference))
        split = len(self.memory)
        self.memory = result[:split]
        return result[split:]

    def samples(self, rows: Sequence[tuple[tuple[float, ...], ...]]) -> Samples:
        """(state, command, reading) of each instant as tables."""
        states, commands, readings = (
            np.array([row[i] for row in rows], dtype=float).reshape(len(rows), width)
            for i, width in enumerate(self.widths)
        )
        return Samples(states, commands, readings, self.inputs.wind_sample)


def run(scenario: Scenario, progress: Progress | None = None) -> Log:
    """Fly the scenario's episode and return its log.

    A diverging episode, a joint past its limit or ground contact ends the episode: the log's status, cause and end time
    say so. ``progress(done, total)`` is called about a hundred times.

    The rigid-body plant flies in machine code, unless the law cannot be traced. Where that code cannot be made a
    warning says so, and the episode flies in Python: about a hundred times slower, the same numbers to the last bit.
    """
    if not isinstance(scenario, Scenario):
        raise ScenarioError(f"scenario = {shown(scenario)}: must be a Scenario; load_scenario(name) makes one")
    if scenario.plant == "rigid_body" and scenario.controller.compiled:
        inputs = episode_inputs(scenario)
        try:
            flown = native.fly(scenario, inputs, progress=progress)
        except native.NoMachineCodeError as error:
            warnings.warn(f"no machine code here ({error}): flying in Python", RuntimeWarning, stacklevel=2)
        else:
            return assemble(scenario, inputs, native.samples(flown), native.ending(scenario, inputs, flown))
    return run_in_python(scenario, progress)


def run_in_python(scenario: Scenario, progress: Progress | None = None) -> Log:
    """Fly an episode as :func:`run` does, period by period in Python, on either plant."""
    loop = _Loop(scenario)
    inputs = loop.inputs
    x = flat(first_state(scenario))
    pending = _CommandLine(scenario, _standing(scenario, x))
    readings: deque[tuple[float, ...]] = deque(maxlen=round(scenario.delays.measurement * scenario.rates.control) + 1)
    monitor = Monitor(scenario)
    rows: list[tuple[tuple[float, ...], ...]] = []
    total = scenario.steps
    every = max(1, total // 100)
    ending = None
    tables = (inputs.goals, inputs.wind, inputs.held, inputs.noise)
    for k, (goal, wind, reference, noise) in enumerate(zip(*(table.tolist() for table in tables), strict=True)):
        if progress is not None and k % every == 0:
            progress(k, total)
        time = k / scenario.rates.control
        ending = monitor.ending(time, x, goal)
        if ending is not None:
            break
        force = loop.plant.specific_force(x, pending.now, wind)
        readings.append(loop.sense.flat((time, *x, *force, *noise)))
        command = loop.command(readings[0], reference)
        ending = monitor.refused(time, command)
        if ending is not None:
            break
        rows.append((x, command, readings[-1]))
        for applied, seconds in pending.put(command):
            x = loop.plant.advance(x, applied, wind, seconds)
    else:
        ending = monitor.ending(total / scenario.rates.control, x, goal)
    if progress is not None:
        progress(total, total)
    return assemble(scenario, inputs, loop.samples(rows), ending)


def _standing(scenario: Scenario, x: Sequence[float]) -> tuple[float, ...]:
    """What acts before the first command arrives: the rotors' own speeds and the torques that hold the arm."""
    vehicle = scenario.world.vehicle
    first = 13 + 2 * vehicle.n
    efforts = hover_trim(vehicle, tuple(x[13 : 13 + vehicle.n]), scenario.world.gravity).efforts
    return (*x[first : first + len(vehicle.rotors)], *(float(effort) for effort in efforts))


class _CommandLine:
    """Commands on their way to the actuators: which one acts for how long within a control period."""

    def __init__(self, scenario: Scenario, standing: tuple[float, ...]) -> None:
        ratio = scenario.rates.physics // scenario.rates.control
        whole = scenario.delays.command * scenario.rates.physics
        steps = round(whole)
        if abs(whole - steps) > 1e-6:
            raise ScenarioError(
                f"delays.command = {scenario.delays.command!r}: must be a whole number of physics steps for a law that "
                "cannot be traced, and without machine code"
            )
        self._whole, part = divmod(steps, ratio)
        self._period = 1.0 / scenario.rates.control
        self._late = part / scenario.rates.physics
        self._queue: deque[tuple[float, ...]] = deque([standing] * (self._whole + 1))
        self.now = standing

    def put(self, command: tuple[float, ...]) -> list[tuple[tuple[float, ...], float]]:
        """Queue a command; return the (command, seconds) that act during this period."""
        self._queue.append(command)
        previous = self._queue.popleft()
        current = self._queue[0]
        self.now = current
        if self._late == 0.0:
            return [(current, self._period)]
        return [(previous, self._late), (current, self._period - self._late)]
