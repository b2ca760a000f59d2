"""Pictures on their way from cameras to the laws, endings and policies that see them.

A picture is computed outside of the traced program, at the camera's instants, from the
state of the loop. The program finds the newest one that has arrived among the numbers
of its state, which no control period changes.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from math import prod
from typing import Any

import numpy as np

from skyarm.records.arrays import AnyArray, Array
from skyarm.records.leaves import leaves, rebuild
from skyarm.scenario.scenario_record import Scenario, cameras_of
from skyarm.sensing.measurement import Image
from skyarm.simulate.loop_state import LoopState

Images = tuple[Image, ...]

Present = tuple[LoopState, Sequence[Any], Mapping[str, Array]]
"""State of the loops of some flights, and their keys and numbers (``Eyes.depths``)."""

NEVER = sys.maxsize
"""Number of a control period that never comes."""


def sensors_seen(scenario: Scenario) -> tuple[str, ...]:
    """Names of the sensors whose pictures the law or an ending of one vehicle sees."""
    endings = (name for ending in scenario.endings for name in ending.sees)
    return tuple(dict.fromkeys((*scenario.agent.controller.sees, *endings)))


def images_of(names: Iterable[str], images: Images) -> Images:
    """Pictures of some sensors, in their order."""
    return tuple(each for name in names for each in images if each.sensor == name)


def blank_images(scenario: Scenario, names: Iterable[str]) -> Images:
    """Example of the pictures of some sensors of one vehicle: 1 m everywhere."""
    cameras = scenario.agent.cameras
    shapes = {name: cameras[name].shape for name in names}
    return tuple(
        Image(
            time=0.0,
            # laws are tried with it, too, and may divide by a depth
            depth=(1.0,) * (rows * columns),
            rows=rows,
            columns=columns,
            sensor=name,
        )
        for name, (rows, columns) in shapes.items()
    )


class ArrivingPictures:
    """Pictures of some cameras in flights of a scenario, from instant to arrival.

    Args:
        scenario: scenario of the flights.
        names: names of the cameras, as of ``cameras_of``.
        lanes: number of flights.

    Attributes:
        taken: time and depths (places, lanes, 1 + pixels) of the pictures on their way
            and of the newest, by camera; NaN before the first.
    """

    def __init__(
        self, scenario: Scenario, names: Sequence[str], lanes: int = 1
    ) -> None:
        self._scenario: Scenario | None = None
        self._clocks = dict[str, tuple[int, int]]()
        self.taken = dict[str, Array]()
        cameras, rates = cameras_of(scenario), scenario.rates
        for name in names:
            _, sensor = cameras[name]
            every = rates.periods_between(sensor.frequency)
            late = round(sensor.latency * rates.control)
            self._clocks[name] = every, late
            # as many as may be on their way, and the newest that has arrived
            size = -(-late // every) + 1, lanes, 1 + prod(sensor.shape)
            self.taken[name] = np.full(size, np.nan)

    def next(self, tick: int) -> int:
        """First control period after ``tick`` in which a picture is taken or
        arrives.
        """
        return min(
            (
                ((tick - delay) // every + 1) * every + delay
                for every, late in self._clocks.values()
                for delay in (0, late)
            ),
            default=NEVER,
        )

    def look(
        self,
        scenario: Scenario,
        ticks: AnyArray,
        lanes: AnyArray,
        present: Callable[[AnyArray], Present],
    ) -> Iterator[Array]:
        """Take the pictures of this instant; give time and depths (m, 1 + pixels) of
        the newest that has arrived, of each camera.

        Args:
            scenario: scenario that flies now.
            ticks: (m,) numbers of the control periods.
            lanes: (m,) numbers of the flights.
            present: function of numbers of flights.
        """
        # most flights see nothing, so the module is loaded by those that do
        from skyarm.simulate.eyes import Eyes

        if scenario is not self._scenario:
            self._scenario, self._eyes = scenario, Eyes(scenario)
        for name, (every, late) in self._clocks.items():
            taken = self.taken[name]
            # one that begins, or sees from now on, has this picture in all places
            fresh = np.isnan(taken[0, lanes, 0])
            due = fresh | (ticks % every == 0)
            if due.any():
                now, keys, numbers = present(lanes[due])
                counts = ticks[due]
                times = counts / scenario.rates.control
                depths = self._eyes.depths(name, now, times, counts, keys, numbers)
                rows = np.hstack([times[:, None], depths.reshape(len(times), -1)])
                taken[:, lanes[fresh]] = rows[fresh[due]]
                taken[counts // every % len(taken), lanes[due]] = rows
            yield taken[(ticks - late) // every % len(taken), lanes]


class FlightPictures(ArrivingPictures):
    """Pictures that the laws and endings of one flight see.

    Args:
        scenario: scenario of the flight. example: state of its loop.

    Attributes:
        pixels: places of pictures among the numbers of the loop's state.
    """

    def __init__(self, scenario: Scenario, example: LoopState) -> None:
        self._example = example
        # floats, as an int would be structure
        numbers = rebuild(example, map(float, range(len(leaves(example)))))
        self._places = {
            f"{agent}.{image.sensor}" if scenario.is_team else image.sensor: (
                np.array(leaves(image), int)
            )
            for agent, own in zip(scenario.agents, numbers.agents, strict=True)
            for image in own.images
        }
        self.pixels = [i for place in self._places.values() for i in place]
        super().__init__(scenario, [*self._places])

    def write(self, scenario: Scenario, tick: int, carry: Array) -> None:
        """Write the newest pictures into the numbers of the loop's state."""
        if self._places:
            newest = self.look(
                scenario,
                np.array([tick]),
                np.zeros(1, int),
                lambda _: (rebuild(self._example, carry[:, None]), (), {}),
            )
            for place, row in zip(self._places.values(), newest, strict=True):
                carry[place] = row[0]
