"""Which random numbers an episode draws, by channel and step: the same for every engine."""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from skyarm.algebra.scalars import Scalar
from skyarm.algebra.scalars.philox import uniforms
from skyarm.scenario.scenario_record import Scenario

CHANNEL_SENSORS, CHANNEL_TURBULENCE = 0, 1
"""Channels of the full state's noise and of the wind; what a scenario adds has channels of its own."""

STARTS = (2**32 - 1, 2**32 - 2)
"""Steps -1 and -2 of a channel start a component's memory; the flight's own begin at step 0."""


@dataclass(frozen=True, slots=True)
class Draws:
    """The uniform numbers of a period, in one row.

    Attributes:
        sensors, components: (channel, count) of each.
    """

    sensors: tuple[tuple[int, int], ...]
    components: tuple[tuple[int, int], ...]

    @property
    def channels(self) -> tuple[tuple[int, int], ...]:
        """(channel, count) of those that draw."""
        return tuple(pair for pair in (*self.sensors, *self.components) if pair[1])

    def of_sensor(self, index: int, row: Sequence[Scalar]) -> tuple[Scalar, ...]:
        """A sensor's share of a row."""
        return self._share(index, row)

    def of_component(self, index: int, row: Sequence[Scalar]) -> tuple[Scalar, ...]:
        """A component's share of a row."""
        return self._share(len(self.sensors) + index, row)

    def _share(self, index: int, row: Sequence[Scalar]) -> tuple[Any, ...]:
        counts = [count for _, count in (*self.sensors, *self.components)]
        first = sum(counts[:index])
        return tuple(row[first : first + counts[index]])


def draw_plan(scenario: Scenario) -> Draws:
    """Channels and counts of everything that draws.

    A component's channel follows from its kind and from how many of that kind stand before it, a sensor's from its
    name: adding one changes no other's draws.
    """
    vehicle = scenario.plant.vehicle
    sensors = [(0, sensor.uniforms(vehicle)) for _, sensor in scenario.all_sensors[:1]]
    sensors += [(_channel("sensor", name), sensor.uniforms(vehicle)) for name, sensor in scenario.all_sensors[1:]]
    first, *added = scenario.components
    components, before = [(CHANNEL_TURBULENCE, first.uniforms)], Counter[str]()
    for component in added:
        kind = type(component).__qualname__
        components.append((_channel(f"component {before[kind]}", kind), component.uniforms))
        before[kind] += 1
    return Draws(tuple(sensors), tuple(components))


def draws_needed(scenario: Scenario) -> tuple[tuple[int, int], ...]:
    """(channel, count) of the uniform numbers a period takes; counts are even, normals come in pairs."""
    return draw_plan(scenario).channels


def start_draws(scenario: Scenario, seed: int, episode: Any) -> list[Any]:
    """Uniform numbers that start each component's memory: (..., 2 count), steps -1 and -2 of its channel."""
    steps, keys = np.array(STARTS), np.asarray(episode)[..., None]
    found = []
    for channel, count in draw_plan(scenario).components:
        numbers = uniforms(seed, keys, channel, steps, count) if count else np.zeros((*keys.shape[:-1], 2, 0))
        found.append(numbers.reshape(*keys.shape[:-1], 2 * count))
    return found


def _channel(kind: str, name: str) -> int:
    """A channel beyond those of the library, from a name."""
    return zlib.crc32(f"{kind} {name}".encode()) | 2**31
