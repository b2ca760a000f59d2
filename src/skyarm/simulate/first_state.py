"""Initial state of the closed loop: plant, law, delay queues, sensors, estimator, winds and drives."""

from __future__ import annotations

import math
from collections.abc import Sequence

from skyarm.algebra.scalars import Scalar, data
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.actuators.hover import hover_trim
from skyarm.dynamics.point_motion import PointMotion
from skyarm.dynamics.state import example_state
from skyarm.plant.surroundings import Surroundings
from skyarm.records.coerce import concrete
from skyarm.scenario.scenario_record import Scenario, first_state
from skyarm.sensing.estimate.estimator import FULL_STATE
from skyarm.sensing.measurement import blank_measurement
from skyarm.sensing.sensor import NO_PUSH
from skyarm.simulate.draws import start_draws
from skyarm.simulate.loop_state import AgentLoop, LoopState, SensorState, structure_of
from skyarm.simulate.reference_clock import Waits
from skyarm.simulate.stages import Stages


def first_loop_state(scenario: Scenario, draws: Sequence[Sequence[Scalar]] | None = None) -> LoopState:
    """Initial state of plant, law, delay queues, sensors, estimator and models; parameter values may be traced.

    Args:
        scenario: scenario of the episode.
        draws: uniform numbers that start each component; the episode's own if left out.
    """
    state, vehicle = first_state(scenario), scenario.agent.plant.vehicle
    efforts = hover_trim(vehicle, state.joints, scenario.agent.plant.gravity).efforts
    if scenario.agent.all_drives:
        rows = zip(scenario.agent.all_drives, efforts, state.joints, strict=True)
        efforts = tuple(drive.standing(effort, q) for drive, effort, q in rows)
    setpoints = tuple(data(effort) for effort in efforts)
    standing = Command(rotor_speeds=state.rotor_speeds, efforts=setpoints, tilts=state.tilts)
    if draws is None:
        draws = [row.tolist() for row in start_draws(scenario, scenario.seed, scenario.episode)]
    period = 1.0 / scenario.rates.control
    still = concrete(*state.rotor_speeds) and bool(state.rotor_speeds) and not any(state.rotor_speeds)
    motion = PointMotion(vehicle, state, gravity=scenario.agent.plant.gravity)
    begun = (c.start(period, row) for c, row in zip(scenario.components, draws, strict=True))
    agent = AgentLoop(
        state=state,
        memory=scenario.agent.controller.memory,
        queue=(standing,) * commands_waiting(scenario),
        sensors=tuple(_first_reading(scenario, i) for i in range(len(scenario.agent.all_sensors))),
        estimate=scenario.agent.estimator.start(scenario.agent.controller.par.model.vehicle),
        drives=tuple(
            drive.begin(q, u, period)
            for drive, q, u in zip(scenario.agent.all_drives, state.joints, standing.efforts, strict=False)
        ),
        clock=Waits(scenario).first(),
    )
    components = tuple(c.settle(memory, motion, still) for c, memory in zip(scenario.components, begun, strict=True))
    return LoopState(alive=1.0, ticks=0.0, agent=agent, components=components)


def _first_reading(scenario: Scenario, index: int) -> SensorState:
    """Initial state of a sensor, whose delay queue holds placeholders shaped like its reading."""
    vehicle, (_, sensor) = scenario.agent.plant.vehicle, scenario.agent.all_sensors[index]
    waiting, memory = readings_waiting(scenario, index), sensor.start(vehicle)
    if index == 0:
        blank = blank_measurement(*vehicle.sizes)
        return SensorState(memory=memory, held=(), waiting=(blank,) * waiting)
    state, draws = example_state(*vehicle.sizes), (0.5,) * sensor.uniforms(vehicle)
    period = 1.0 / (sensor.frequency or scenario.rates.control)
    _, example = sensor.take(memory, 0.0, state, state.velocity, NO_PUSH, draws, period)
    reading = structure_of(example)
    slow = sensor.frequency and sensor.frequency < scenario.rates.control
    return SensorState(memory=memory, held=reading if slow else (), waiting=(reading,) * waiting)


def commands_waiting(scenario: Scenario) -> int:
    """Length of the queue of past commands that the command delay requires."""
    rates, delays = scenario.rates, scenario.agent.delays
    if delays.longest_command is not None:
        return math.ceil(delays.longest_command * rates.control - 1e-9) + 1
    return round(delays.longest * rates.physics) // (rates.physics // rates.control) + 1


def readings_waiting(scenario: Scenario, index: int) -> int:
    """Length of the queue of past readings that a sensor's delay requires."""
    name, sensor = scenario.agent.all_sensors[index]
    delay = scenario.agent.delays.measurement if name == FULL_STATE else sensor.latency
    return round(delay * scenario.rates.control)


def first_surroundings(scenario: Scenario, first: LoopState) -> Surroundings:
    """Example of wind, contacts, faults and drives around the plant in the first control period, for tracing."""
    return Stages(scenario).surroundings(first.components, first.agent.drives, 0.0)


def component_places(scenario: Scenario) -> tuple[str, ...]:
    """Parameter paths of the scenario's wind, force, payload and contact models, in their order."""
    return tuple(place for place, _ in scenario.placed_components)
