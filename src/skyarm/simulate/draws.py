"""Assignment of random channels (streams of random numbers) to sensors and wind, force and contact models."""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Sequence
from itertools import islice

import numpy as np
from numpy.typing import ArrayLike

from skyarm.algebra.scalars import Scalar
from skyarm.algebra.scalars.philox import uniforms
from skyarm.records.arrays import Array
from skyarm.records.immutable import immutable
from skyarm.scenario.scenario_record import Scenario

CHANNEL_SENSORS, CHANNEL_TURBULENCE = 0, 1
"""Channels of the random generator for the full state's noise and for the wind; added components have further ones."""

STARTS = (2**32 - 1, 2**32 - 2)
"""Steps -1 and -2 of a channel, which initialise a component's state; the flight's own begin at step 0."""


@immutable(kw_only=False)
class Draws:
    """Random-number stream and count per control period of each sensor and each wind, force or contact model.

    Attributes:
        sensors, components: (channel, count) of each.
    """

    sensors: tuple[tuple[int, int], ...]
    components: tuple[tuple[int, int], ...]

    @property
    def channels(self) -> tuple[tuple[int, int], ...]:
        """List the random-number streams in use, as pairs of stream number and random numbers per control period."""
        return tuple(pair for pair in (*self.sensors, *self.components) if pair[1])

    def shares(self, row: Sequence[Scalar]) -> tuple[list[tuple[Scalar, ...]], list[tuple[Scalar, ...]]]:
        """Split the random numbers of a control period among the sensors and the wind, force and contact models."""
        left = iter(row)
        shares = [tuple(islice(left, count)) for _, count in (*self.sensors, *self.components)]
        return shares[: len(self.sensors)], shares[len(self.sensors) :]


def draw_plan(scenario: Scenario) -> Draws:
    """Assign a random-number stream and a count per control period to each sensor and wind, force or contact model.

    A component's channel follows from its kind and from how many of that kind stand before it, a sensor's from its
    name: adding one changes no other's draws.
    """
    vehicle = scenario.agent.plant.vehicle
    sensors = [(0, sensor.uniforms(vehicle)) for _, sensor in scenario.agent.all_sensors[:1]]
    sensors += [(_channel("sensor", name), sensor.uniforms(vehicle)) for name, sensor in scenario.agent.all_sensors[1:]]
    first, *added = scenario.components
    components, before = [(CHANNEL_TURBULENCE, first.uniforms)], Counter[str]()
    for component in added:
        kind = type(component).__qualname__
        components.append((_channel(f"component {before[kind]}", kind), component.uniforms))
        before[kind] += 1
    return Draws(tuple(sensors), tuple(components))


def draws_needed(scenario: Scenario) -> tuple[tuple[int, int], ...]:
    """List the random-number streams of a scenario, as pairs of stream number and random numbers per control period."""
    return draw_plan(scenario).channels


def start_draws(scenario: Scenario, seed: int, episode: ArrayLike) -> list[Array]:
    """Uniform random numbers for the initial states of wind, force and contact models, one array for each model."""
    steps, keys = np.array(STARTS), np.asarray(episode)[..., None]
    draws = []
    for channel, count in draw_plan(scenario).components:
        numbers = uniforms(seed, keys, channel, steps, count) if count else np.zeros((*keys.shape[:-1], 2, 0))
        draws.append(numbers.reshape(*keys.shape[:-1], 2 * count))
    return draws


def _channel(kind: str, name: str) -> int:
    """Index of the random-number stream of a named sensor or model: a hash, larger than the built-in indices."""
    return zlib.crc32(f"{kind} {name}".encode()) | 2**31
