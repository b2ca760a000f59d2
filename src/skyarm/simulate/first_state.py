"""Initial state of the closed loop: plant, law, delay queues, sensors, estimator, winds
and drives.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from skyarm.algebra import Scalar
from skyarm.algebra.scalars import data
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.actuators.hover import hover_trim
from skyarm.dynamics.state import State, example_state
from skyarm.plant.surroundings import Together, motions_of
from skyarm.records.coerce import concrete
from skyarm.scenario.scenario_record import Scenario, first_state
from skyarm.sensing.estimate.estimator import FULL_STATE
from skyarm.sensing.measurement import blank_measurement
from skyarm.sensing.sensor import NO_PUSH
from skyarm.simulate.draws import start_draws
from skyarm.simulate.loop_state import (
    AgentLoop,
    LoopState,
    Places,
    SensorState,
    structure_of,
)
from skyarm.simulate.pictures import blank_images, sensors_seen
from skyarm.simulate.reference_clock import Waits
from skyarm.simulate.stages import Stages


def first_loop_state(
    scenario: Scenario, draws: Sequence[Sequence[Scalar]] | None = None
) -> LoopState:
    """Initial state of plant, law, delay queues, sensors, estimator and models;
    parameter values may be traced.

    Args:
        scenario: scenario of the episode.
        draws: uniform numbers that start each component; the episode's own if left out.
    """
    if draws is None:
        draws = [
            row.tolist()
            for row in start_draws(scenario, scenario.seed, scenario.episode)
        ]
    period = scenario.rates.period
    left = iter(draws)
    alone = [scenario.of(name) for name in scenario.agents]
    states = [first_state(each) for each in alone]
    motions = motions_of(
        [each.agent.plant for each in alone], states, tuple(scenario.agents)
    )
    agents = []
    for each, state, motion in zip(alone, states, motions, strict=True):
        models = each.own_components(each.agent)
        begun = [model.start(period, next(left)) for model in models]
        settled = (
            model.settle(memory, motion, _is_still(state))
            for model, memory in zip(models, begun, strict=True)
        )
        agents.append(replace(_first_agent(each, state), components=tuple(settled)))
    still = all(map(_is_still, states))
    rows = [
        (model, model.start(period, next(left))) for model in scenario.shared_components
    ]
    # by the first vehicle's motion, as in every later period (Stages.surround)
    components = tuple(
        model.settle(memory, motions[0], still) for model, memory in rows
    )
    return LoopState(alive=1.0, ticks=0.0, agents=tuple(agents), components=components)


def _is_still(state: State) -> bool:
    """True if no rotor of a vehicle turns, as of one that stands on a surface."""
    return (
        concrete(*state.rotor_speeds)
        and bool(state.rotor_speeds)
        and not any(state.rotor_speeds)
    )


def _first_agent(scenario: Scenario, state: State) -> AgentLoop:
    """Initial state of one vehicle and its control, from the scenario of its flight and
    its initial state.
    """
    vehicle = scenario.agent.vehicle
    drives = scenario.agent.all_drives
    # joints hold the arm from the first instant, whatever the law will do
    efforts = hover_trim(vehicle, state.joints, scenario.agent.plant.gravity).efforts
    if drives:
        rows = zip(drives, efforts, state.joints, strict=True)
        efforts = tuple(drive.standing(effort, q) for drive, effort, q in rows)
    setpoints = tuple(map(data, efforts))
    standing = Command(
        rotor_speeds=state.rotor_speeds, efforts=setpoints, tilts=state.tilts
    )
    # drives are none, or one for each joint
    return AgentLoop(
        state=state,
        memory=scenario.agent.controller.memory,
        queue=(standing,) * commands_waiting(scenario),
        sensors=tuple(
            _first_reading(scenario, i) for i in range(len(scenario.agent.all_sensors))
        ),
        estimate=scenario.agent.placed_estimator.start(scenario.agent.model.vehicle),
        drives=tuple(
            drive.begin(q, u, scenario.rates.period)
            for drive, q, u in zip(drives, state.joints, standing.efforts, strict=False)
        ),
        clock=Waits(scenario).first(),
        images=blank_images(scenario, sensors_seen(scenario)),
    )


def _first_reading(scenario: Scenario, index: int) -> SensorState:
    """Initial state of a sensor, whose delay queue holds placeholders shaped like its
    reading.
    """
    vehicle, (_, sensor) = scenario.agent.vehicle, scenario.agent.all_sensors[index]
    waiting = readings_waiting(scenario, index)
    memory = sensor.start(vehicle)
    # the full state needs no call: its blank has the structure of every measurement
    if index == 0:
        blank = blank_measurement(*vehicle.sizes)
        return SensorState(memory=memory, held=(), waiting=(blank,) * waiting)
    state = example_state(*vehicle.sizes)
    draws = (0.5,) * sensor.uniforms(vehicle)
    period = 1.0 / (sensor.frequency or scenario.rates.control)
    # the zeros of a velocity stand for a specific force: its shape alone counts
    _, example = sensor.take(memory, 0.0, state, state.velocity, NO_PUSH, draws, period)
    reading = structure_of(example)
    slow = sensor.frequency and sensor.frequency < scenario.rates.control
    return SensorState(
        memory=memory, held=reading if slow else (), waiting=(reading,) * waiting
    )


def commands_waiting(scenario: Scenario) -> int:
    """Length of the queue of past commands that the command delay requires."""
    rates = scenario.rates
    delays = scenario.agent.delays
    if delays.longest_command is not None:
        # 1e-9: a multiple of the period up to rounding; one more: the command that acts
        return math.ceil(delays.longest_command * rates.control - 1e-9) + 1
    # delays end on physics steps; the rest within a period is no place in the queue
    return round(delays.longest * rates.physics) // (rates.physics // rates.control) + 1


def readings_waiting(scenario: Scenario, index: int) -> int:
    """Length of the queue of past readings that a sensor's delay requires."""
    name, sensor = scenario.agent.all_sensors[index]
    delay = scenario.agent.delays.measurement if name == FULL_STATE else sensor.latency
    return round(delay * scenario.rates.control)


def first_surroundings(scenario: Scenario, first: LoopState) -> Together:
    """Example of wind, contacts, faults and drives around the vehicles in the first
    control period, for tracing.
    """
    return Stages(scenario).surroundings(first, 0.0)


def component_places(scenario: Scenario) -> Places:
    """Parameter paths of the environment models: those of each vehicle's own, and of
    those that all share.
    """
    models = (
        each.placed_models(scenario.environment) for each in scenario.agents.values()
    )
    own = tuple(tuple(at for at, _ in placed) for placed in models)
    return own, tuple(at for at, _ in scenario.placed_shared)
