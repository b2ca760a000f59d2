"""Assignment of random channels (streams of random numbers) to sensors and wind, force
and contact models.
"""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Sequence
from itertools import chain, islice
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from skyarm.algebra import Scalar, Scalars
from skyarm.algebra.scalars.philox import uniforms
from skyarm.compile.tracing.program import Channels
from skyarm.plant.surroundings import AnyComponent
from skyarm.records.arrays import Array
from skyarm.records.immutable import positional
from skyarm.records.members import SOLE
from skyarm.scenario.scenario_record import Scenario

CHANNEL_SENSORS, CHANNEL_TURBULENCE = 0, 1
"""Channels of the random generator for the full state's noise and for the wind; added
components have further ones."""

STARTS = (2**32 - 1, 2**32 - 2)
"""Steps -1 and -2 of a channel, which initialise a component's state; the flight's own
begin at step 0."""


class Shares(NamedTuple):
    """Random numbers of a control period by vehicle and sensor, by vehicle and model,
    and by shared model.
    """

    sensors: list[list[Scalars]]
    components: list[list[Scalars]]
    shared: list[Scalars]


@positional
class Draws:
    """Random-number stream and count per control period of each sensor and each wind,
    force or contact model.

    Attributes:
        sensors, components: (channel, count) of each, for every vehicle. shared: those
            of the models that all share.
    """

    sensors: tuple[Channels, ...]
    components: tuple[Channels, ...]
    shared: Channels = ()

    @property
    def models(self) -> Channels:
        """Channel and count of every environment model: those of each vehicle in turn,
        then the shared ones.
        """
        return (*chain.from_iterable(self.components), *self.shared)

    @property
    def channels(self) -> Channels:
        """List the random-number streams in use, as pairs of stream number and random
        numbers per control period.
        """
        every = chain(chain.from_iterable(self.sensors), self.models)
        return tuple(pair for pair in every if pair[1])

    def shares(self, row: Sequence[Scalar]) -> Shares:
        """Split the random numbers of a control period among the sensors and the wind,
        force and contact models.
        """
        # in the order of ``channels``: what one part takes the next cannot
        left = iter(row)

        def shares_of(pairs: Channels) -> list[Scalars]:
            return [tuple(islice(left, count)) for _, count in pairs]

        sensors, components = (
            [shares_of(pairs) for pairs in each]
            for each in (self.sensors, self.components)
        )
        return Shares(sensors, components, shares_of(self.shared))


def draw_plan(scenario: Scenario) -> Draws:
    """Assign a random-number stream and a count per control period to each sensor and
    wind, force or contact model.

    A component's channel follows from its kind and from how many of that kind stand
    before it, a sensor's from its name, and of vehicles with other names than ``main``
    from theirs: adding one changes no other's draws.
    """
    sensors, components = [], []
    for name, agent in scenario.agents.items():
        of = _of(name)
        vehicle = agent.vehicle
        full, *named = agent.all_sensors
        # an only vehicle has the built-in channels, so that its flights keep their bits
        first = _channel("sensor", of) if of else CHANNEL_SENSORS
        rows = [(first, full[1].uniforms(vehicle))]
        rows += [
            (sensor_channel(each, name), one.uniforms(vehicle)) for each, one in named
        ]
        sensors.append(tuple(rows))
        wind, *added = scenario.own_components(agent)
        channel = _channel("wind", of) if of else CHANNEL_TURBULENCE
        components.append(((channel, wind.uniforms), *_by_kind(added, of)))
    shared = _by_kind(scenario.shared_components, " of all")
    return Draws(tuple(sensors), tuple(components), tuple(shared))


def _by_kind(components: Sequence[AnyComponent], of: str) -> list[tuple[int, int]]:
    """Channel and count of each environment model, by its kind and how many of that
    kind stand before it.
    """
    rows = list[tuple[int, int]]()
    before = Counter[str]()
    for component in components:
        kind = type(component).__qualname__
        rows.append(
            (_channel(f"component {before[kind]}", kind + of), component.uniforms)
        )
        before[kind] += 1
    return rows


def draws_needed(scenario: Scenario) -> Channels:
    """List the random-number streams of a scenario, as pairs of stream number and
    random numbers per control period.
    """
    return draw_plan(scenario).channels


def start_draws(scenario: Scenario, seed: int, episode: ArrayLike) -> list[Array]:
    """Uniform random numbers for the initial states of wind, force and contact models,
    one array for each model.

    Those of each vehicle in turn, then those of the models that all share.
    """
    steps = np.array(STARTS)
    keys = np.asarray(episode)[..., None]
    draws = []
    for channel, count in draw_plan(scenario).models:
        numbers = (
            uniforms(seed, keys, channel, steps, count)
            if count
            else np.zeros((*keys.shape[:-1], 2, 0))
        )
        draws.append(numbers.reshape(*keys.shape[:-1], 2 * count))
    return draws


def _of(agent: str) -> str:
    """Last words of the key of what a vehicle has, by its name."""
    return "" if agent == SOLE else f" of {agent}"


def sensor_channel(name: str, agent: str) -> int:
    """Index of the random-number stream of a vehicle's named sensor."""
    return _channel("sensor", name + _of(agent))


def _channel(kind: str, name: str) -> int:
    """Index of the random-number stream of a named sensor or model: a hash, larger than
    the built-in indices.
    """
    # crc32 has no seed of its own, as hash() has: the same in every process
    return zlib.crc32(f"{kind} {name}".encode()) | 2**31
