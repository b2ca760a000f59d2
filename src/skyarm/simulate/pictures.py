"""Pictures on their way from cameras to the laws, endings and policies that see them.

A picture is computed outside of the traced program, at the camera's instants, from the
state of the loop. The program finds the newest one that has arrived among the numbers
of its state, which no control period changes.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from skyarm.records.arrays import AnyArray, Array
from skyarm.records.leaves import leaves, rebuild
from skyarm.scenario.scenario_record import NamedSensor, Scenario
from skyarm.sensing.measurement import Image
from skyarm.simulate.loop_state import AgentLoop, LoopState

NEVER = sys.maxsize
"""Number of a control period that never comes."""


def sensors_seen(scenario: Scenario) -> tuple[str, ...]:
    """Names of the sensors whose pictures the law or an ending of one vehicle sees."""
    endings = (name for ending in scenario.endings for name in ending.sees)
    return tuple(dict.fromkeys((*scenario.agent.controller.sees, *endings)))


def images_of(
    names: tuple[str, ...], scenario: Scenario, own: AgentLoop
) -> tuple[Image, ...]:
    """Newest pictures of some sensors of one vehicle."""
    if not names:
        return ()
    images = dict(zip(sensors_seen(scenario), own.images, strict=True))
    return tuple(images[name] for name in names)


def blank_images(scenario: Scenario, names: Sequence[str]) -> tuple[Image, ...]:
    """Example of the pictures of some sensors of one vehicle: 1 m everywhere."""
    images = []
    for name in names:
        rows, columns = _camera(scenario, name).sensor.shape
        depth = (1.0,) * (rows * columns)
        images.append(
            Image(time=0.0, depth=depth, rows=rows, columns=columns, sensor=name)
        )
    return tuple(images)


def _camera(scenario: Scenario, name: str) -> NamedSensor:
    return next(each for each in scenario.agent.cameras if each.name == name)


class Shutter(NamedTuple):
    """Clock of a camera in control periods: a picture ``every`` so many, which arrives
    ``late`` so many later.
    """

    every: int
    late: int

    @property
    def places(self) -> int:
        """Largest number of pictures on their way, and the one that has arrived."""
        return -(-self.late // self.every) + 1

    def next(self, tick: int) -> int:
        """First control period after ``tick`` in which a picture is taken or
        arrives.
        """
        to_come = (tick, tick - self.late)
        taken, arrived = ((each // self.every + 1) * self.every for each in to_come)
        return min(taken, self.late + arrived)


class Pictures:
    """Pictures of some cameras in flights of a scenario, from instant to arrival.

    Args:
        scenario: scenario of the flights.
        seen: names of the cameras that are looked through, of each vehicle.
        lanes: number of flights.

    Attributes:
        shapes: numbers of rows and columns by the name that :class:`Eyes` has.
        taken: time and depths (places, lanes, 1 + pixels) of the pictures on their way
            and of the newest; NaN before the first.
    """

    def __init__(
        self, scenario: Scenario, seen: Mapping[str, Sequence[str]], lanes: int = 1
    ) -> None:
        self._scenario: Scenario | None = None
        self._shutters = dict[str, Shutter]()
        self.shapes = dict[str, tuple[int, int]]()
        self.taken = dict[str, Array]()
        rate = scenario.rates.control
        for agent, names in seen.items():
            for each in names:
                sensor: Any = _camera(scenario.of(agent), each).sensor
                name = f"{agent}.{each}" if scenario.is_team else each
                shutter = Shutter(
                    round(rate / sensor.frequency), round(sensor.latency * rate)
                )
                self._shutters[name], self.shapes[name] = shutter, sensor.shape
                size = 1 + sensor.shape[0] * sensor.shape[1]
                self.taken[name] = np.full((shutter.places, lanes, size), np.nan)

    def next(self, tick: int) -> int:
        """First control period after ``tick`` in which a picture is taken or
        arrives.
        """
        return min((each.next(tick) for each in self._shutters.values()), default=NEVER)

    def look(
        self, scenario: Scenario, now: LoopState, lanes: AnyArray, **own: Any
    ) -> Iterator[Array]:
        """Take the pictures of this instant; give time and depths (m, 1 + pixels) of
        the newest that has arrived, of each camera.

        Args:
            scenario: scenario that flies now.
            now: state of the loop, its scalars (m,).
            lanes: (m,) numbers of the flights.
            own: numbers and keys of these (:meth:`Eyes.lane_depths`).
        """
        # most flights see nothing, so the module is loaded by those that do
        from skyarm.simulate.eyes import Eyes

        if self._shutters and scenario is not self._scenario:
            self._scenario, self._eyes = scenario, Eyes(scenario)
        ticks = np.asarray(now.ticks, float).astype(int)
        times = ticks / scenario.rates.control
        for name, (every, late) in self._shutters.items():
            taken = self.taken[name]
            # one that begins, or sees from now on, has this picture in all places
            fresh = np.isnan(taken[0, lanes, 0])
            if (due := fresh | (ticks % every == 0)).any():
                depths = self._eyes.lane_depths(name, now, times, ticks, **own)
                rows = np.hstack([times[:, None], depths.reshape(len(ticks), -1)])
                taken[:, lanes[fresh]] = rows[fresh]
                taken[ticks[due] // every % len(taken), lanes[due]] = rows[due]
            yield taken[(ticks - late) // every % len(taken), lanes]


class FlightPictures(Pictures):
    """Pictures that the laws and endings of one flight see.

    Args:
        scenario: scenario of the flight. example: state of its loop.
    """

    def __init__(self, scenario: Scenario, example: LoopState) -> None:
        each = {name: sensors_seen(scenario.of(name)) for name in scenario.agents}
        super().__init__(scenario, each)
        self._example = example
        # floats, as an int would be structure
        numbers = rebuild(example, map(float, range(len(leaves(example)))))
        images = (image for own in numbers.agents for image in own.images)
        self._places = [np.array(leaves(image), int) for image in images]

    def write(self, scenario: Scenario, carry: Array) -> None:
        """Write the newest pictures into the numbers of the loop's state."""
        if self._places:
            now = rebuild(self._example, iter(carry[:, None]))
            newest = self.look(scenario, now, np.zeros(1, int))
            for place, row in zip(self._places, newest, strict=True):
                carry[place] = row[0]
