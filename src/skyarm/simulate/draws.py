"""Which random numbers an episode draws, by channel and step: the same for every engine."""

from __future__ import annotations

from typing import Any

import numpy as np

from skyarm.algebra import Vec3
from skyarm.compile import leaves
from skyarm.environment import Airspeed
from skyarm.plant.sensors import noise_count
from skyarm.scalars.philox import normal, normal_pair
from skyarm.simulate.scenario import Scenario

CHANNEL_SENSORS, CHANNEL_TURBULENCE = 0, 1
"""Channels of the noise generator; every engine draws the same numbers for (seed, episode, channel, step)."""


def draws_needed(scenario: Scenario) -> tuple[tuple[int, int], ...]:
    """(channel, count) of the uniform numbers a period takes; counts are even, normals come in pairs."""
    vehicle = scenario.world.vehicle
    found = []
    if leaves(scenario.sensors):
        count = noise_count(vehicle.n, len(vehicle.rotors))
        found.append((CHANNEL_SENSORS, count + count % 2))
    if isinstance(scenario.wind, Airspeed) and scenario.wind.turbulence is not None:
        found.append((CHANNEL_TURBULENCE, 4))
    return tuple(found)


def normals(uniforms: tuple[Any, ...]) -> list[Any]:
    """Normal numbers of uniform ones, pair by pair."""
    numbers: list[Any] = []
    for a, b in zip(uniforms[0::2], uniforms[1::2], strict=True):
        numbers += normal_pair(a, b)
    return numbers


def turbulence_start(seed: int, episode: int) -> tuple[Vec3, Vec3]:
    """Normal numbers that start the turbulence: steps -1 and -2 of its channel, the flight's own begin at step 0."""
    draws = normal(seed, episode, CHANNEL_TURBULENCE, np.array([2**32 - 1, 2**32 - 2]), 3).tolist()
    return Vec3(*draws[0]), Vec3(*draws[1])
