"""What an episode is fed, for all control instants at once: held references, wind, noise."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.algebra import ZERO3, Vec3
from skyarm.compile import Program, leaves, rebuild, trace
from skyarm.compile.arrays import evaluate
from skyarm.dynamics import State
from skyarm.environment import Airspeed, WindSample, afflicted, dryden, wind
from skyarm.plant.interface import number
from skyarm.plant.sensors import noise_count
from skyarm.reference import Publisher, Reference
from skyarm.scalars.philox import normal
from skyarm.simulate.draws import CHANNEL_SENSORS, CHANNEL_TURBULENCE, turbulence_start
from skyarm.simulate.scenario import Scenario, trimmed_state

Array = npt.NDArray[Any]


@dataclass(frozen=True)
class EpisodeInputs:
    """Tables of a row an instant, made when they are asked for, and example records that carry their structure.

    Attributes:
        scenario: whose inputs these are.
        times: control instants, s.
        held_reference: the reference as published and held, as a record of arrays.
    """

    scenario: Scenario
    times: Any
    held_reference: Reference

    @property
    def reference(self) -> Reference:
        """The continuous reference, as a record of arrays."""
        program = _motion(self.scenario)
        sampled: Reference = program.record(list(evaluate(program, [self.times], self.scenario.steps)))
        return sampled

    @cached_property
    def held(self) -> Array:
        """Leaves of the held reference."""
        return _rows(self.held_reference, self.scenario.steps)

    def rows(self, start: int, stop: int) -> Array:
        """What the closed loop is fed at these instants: time and held reference."""
        columns = (np.asarray(leaf, dtype=float) for leaf in (self.times, *leaves(self.held_reference)))
        count = stop - start
        return np.stack([c[start:stop] if c.ndim else np.broadcast_to(c, (count,)) for c in columns], axis=1)

    @cached_property
    def goals(self) -> Array:
        """Position of the held reference, m."""
        return _rows(self.held_reference.dense().position, self.scenario.steps)

    @cached_property
    def wind_sample(self) -> WindSample:
        """Wind as a record of arrays."""
        return _wind(self.scenario, self.times)

    @property
    def wind(self) -> Array:
        """Leaves of the wind sample."""
        return _rows(self.wind_sample, self.scenario.steps)

    @property
    def noise(self) -> Array:
        """Standard normal draws of the sensors; no columns for perfect ones."""
        if not leaves(self.scenario.sensors):
            return np.zeros((self.scenario.steps, 0))
        keys = self.scenario.seed, self.scenario.episode, CHANNEL_SENSORS
        return normal(*keys, np.arange(self.scenario.steps), len(self.noise_example))

    @cached_property
    def reference_example(self) -> Reference:
        """A held reference of one instant."""
        example: Reference = _example(self.held_reference)
        return example

    @cached_property
    def wind_example(self) -> WindSample:
        """A wind sample of one instant."""
        program = _wind_program(self.scenario)
        sample: WindSample = program.record([0.0] * len(program.outputs))
        return sample

    @cached_property
    def noise_example(self) -> tuple[Any, ...]:
        """The draws of one instant; structural zeros for perfect sensors."""
        vehicle = self.scenario.world.vehicle
        draw = 0.0 if leaves(self.scenario.sensors) else 0
        return (draw,) * noise_count(vehicle.n, len(vehicle.rotors))


def first_state(scenario: Scenario) -> State:
    """The scenario's initial state, or hover trim at the reference."""
    if scenario.initial is not None:
        return scenario.initial
    start = scenario.trajectory.at(0.0)
    return trimmed_state(scenario.world, start.position, number(start.yaw), tuple(start.joints))


def episode_inputs(scenario: Scenario) -> EpisodeInputs:
    """Tables of everything that does not depend on the flight, with the bits of Python floats, not of NumPy's sine."""
    ticks, rates = np.arange(scenario.steps), scenario.rates
    # k / rate, not k * period: 1500 * 0.005 is not 7.5 in binary, and a gust must start on its tick
    times = ticks / rates.control
    publisher = Publisher(control_rate=rates.control, reference_rate=rates.reference)
    program = _motion(scenario)
    samples = evaluate(program, [times], scenario.steps)
    return EpisodeInputs(scenario, times, program.record(list(samples[:, publisher.held_tick(ticks)])))


def _motion(scenario: Scenario) -> Program:
    """The reference at a time; an absurd one overflows to inf or NaN and ends the episode as diverged."""
    return trace(lambda clock: scenario.trajectory.at(clock[0]), (0.0,))


def _rows(record: Any, count: int) -> Array:
    """A record of arrays as one row of leaves per instant."""
    columns = [np.broadcast_to(np.asarray(leaf, dtype=float), (count,)) for leaf in leaves(record)]
    return np.stack(columns, axis=1) if columns else np.zeros((count, 0))


def _example(record: Any) -> Any:
    """The record with every array replaced by one float; its structure stays."""
    return rebuild(record, iter([0.0] * len(leaves(record))))


def _wind_program(scenario: Scenario) -> Program:
    """Wind and faults of a time and a gust of turbulence."""
    turbulent = isinstance(scenario.wind, Airspeed) and scenario.wind.turbulence is not None
    gust = Vec3(0.0, 0.0, 0.0) if turbulent else ZERO3

    def surroundings(clock: Any, air: Vec3) -> WindSample:
        return afflicted(wind(scenario.wind, clock[0], air), scenario.faults, scenario.world.vehicle, clock[0])

    return trace(surroundings, (0.0,), gust)


def _wind(scenario: Scenario, times: Any) -> WindSample:
    """Wind and faults as a record of arrays."""
    program, gusts = _wind_program(scenario), _turbulence(scenario)
    columns = list(zip(*(leaves(gust) for gust in gusts), strict=True))
    sample: WindSample = program.record(list(evaluate(program, [times, *columns], len(gusts))))
    return sample


def _turbulence(scenario: Scenario) -> list[Vec3]:
    """Turbulence velocity at each instant, stationary from the first on."""
    par = scenario.wind.turbulence if isinstance(scenario.wind, Airspeed) else None
    if par is None:
        return [ZERO3] * scenario.steps
    period = 1.0 / scenario.rates.control
    first, second = turbulence_start(scenario.seed, scenario.episode)
    memory = dryden.start(first, second, period, par=par)
    found = []
    draws = normal(scenario.seed, scenario.episode, CHANNEL_TURBULENCE, np.arange(scenario.steps), 3)
    for draw in draws.tolist():
        memory, velocity = dryden.step(memory, Vec3(*draw), period, par=par)
        found.append(velocity)
    return found
