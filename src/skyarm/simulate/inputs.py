"""What an episode is fed, for all control instants at once: held references, wind, noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from skyarm.algebra import ZERO3, Vec3
from skyarm.compile import leaves, rebuild, trace
from skyarm.dynamics import State
from skyarm.environment import Airspeed, WindSample, afflicted, dryden, wind
from skyarm.plant.interface import number
from skyarm.plant.sensors import noise_count
from skyarm.reference import Publisher, Reference
from skyarm.scalars.philox import normal
from skyarm.simulate.scenario import Scenario, trimmed_state

CHANNEL_SENSORS, CHANNEL_TURBULENCE = 0, 1
"""Channels of the noise generator; every engine draws the same numbers for (seed, episode, channel, step)."""


@dataclass(frozen=True, slots=True)
class EpisodeInputs:
    """Rows of leaves per control instant, and example records that carry their structure.

    Attributes:
        times: control instants, s.
        held: leaves of the held reference. goals: its position. wind: leaves of the wind sample.
        noise: standard normal draws.
        held_reference, reference: the same references as records of arrays, held and continuous.
        wind_sample: wind as a record of arrays.
    """

    times: Any
    held: Sequence[Sequence[float]]
    goals: Sequence[Sequence[float]]
    wind: Sequence[Sequence[float]]
    noise: Sequence[Sequence[float]]
    held_reference: Reference
    reference: Reference
    wind_sample: WindSample
    reference_example: Reference
    wind_example: WindSample
    noise_example: tuple[Any, ...]


def first_state(scenario: Scenario) -> State:
    """The scenario's initial state, or hover trim at the reference."""
    if scenario.initial is not None:
        return scenario.initial
    start = scenario.trajectory.at(0.0)
    return trimmed_state(scenario.world, start.position, number(start.yaw), tuple(start.joints))


def episode_inputs(scenario: Scenario) -> EpisodeInputs:
    """Tables of everything that does not depend on the flight."""
    ticks, rates = np.arange(scenario.steps), scenario.rates
    # k / rate, not k * period: 1500 * 0.005 is not 7.5 in binary, and a gust must start on its tick
    times = ticks / rates.control
    held_times = Publisher(control_rate=rates.control, reference_rate=rates.reference).held_time(ticks)
    # an absurd reference overflows to inf or NaN and ends the episode as diverged, without a warning here
    with np.errstate(all="ignore"):
        held, continuous = scenario.trajectory.at(held_times), scenario.trajectory.at(times)
    blowing = _wind(scenario, times)
    noise, noise_example = _noise(scenario)
    return EpisodeInputs(
        times=times,
        held=_rows(held, scenario.steps),
        goals=_rows(held.dense().position, scenario.steps),
        wind=_rows(blowing, scenario.steps),
        noise=noise,
        held_reference=held,
        reference=continuous,
        wind_sample=blowing,
        reference_example=_example(held),
        wind_example=_example(blowing),
        noise_example=noise_example,
    )


def _rows(record: Any, count: int) -> list[tuple[float, ...]]:
    """A record of arrays as one tuple of floats per instant."""
    columns = [np.broadcast_to(np.asarray(leaf, dtype=float), (count,)) for leaf in leaves(record)]
    if not columns:
        return [()] * count
    return [tuple(row) for row in np.stack(columns, axis=1).tolist()]


def _example(record: Any) -> Any:
    """The record with every array replaced by one float; its structure stays."""
    return rebuild(record, iter([0.0] * len(leaves(record))))


def _noise(scenario: Scenario) -> tuple[list[tuple[float, ...]], tuple[Any, ...]]:
    vehicle = scenario.world.vehicle
    count = noise_count(vehicle.n, len(vehicle.rotors))
    if not leaves(scenario.sensors):
        return [()] * scenario.steps, (0,) * count
    draws = normal(scenario.seed, scenario.episode, CHANNEL_SENSORS, np.arange(scenario.steps), count)
    return [tuple(row) for row in draws.tolist()], (0.0,) * count


def _wind(scenario: Scenario, times: Any) -> WindSample:
    """Wind and faults as a record of arrays; in Python floats, whose cosine is that of every engine and not NumPy's."""
    gusts = _turbulence(scenario)

    def surroundings(clock: Any, gust: Vec3) -> WindSample:
        return afflicted(wind(scenario.wind, clock[0], gust), scenario.faults, scenario.world.vehicle, clock[0])

    program = trace(surroundings, (0.0,), _example(gusts[0]))
    rows = [program.flat((time, *leaves(gust))) for time, gust in zip(times.tolist(), gusts, strict=True)]
    sample: WindSample = program.record(rows[0])
    return rebuild(sample, iter(np.array(rows, dtype=float).reshape(len(rows), -1).T))


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


def turbulence_start(seed: int, episode: int) -> tuple[Vec3, Vec3]:
    """Normal numbers that start the turbulence: steps -1 and -2 of its channel, the flight's own begin at step 0."""
    draws = normal(seed, episode, CHANNEL_TURBULENCE, np.array([2**32 - 1, 2**32 - 2]), 3).tolist()
    return Vec3(*draws[0]), Vec3(*draws[1])
