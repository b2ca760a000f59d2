"""Pictures on their way from cameras to the laws and endings that see them.

A picture is computed outside of the traced program, at the camera's instants, from the
state of the loop. The program finds the newest one that has arrived among the numbers
of its state, which no control period changes.
"""

from __future__ import annotations

import sys
from typing import Any, NamedTuple

import numpy as np

from skyarm.records.arrays import Array
from skyarm.records.leaves import leaves, rebuild
from skyarm.scenario.scenario_record import Scenario
from skyarm.sensing.measurement import Image
from skyarm.simulate.loop_state import AgentLoop, LoopState

NEVER = sys.maxsize
"""Number of a control period that never comes."""

NONE_YET = -1.0
"""Time of the picture of a camera that has not taken any."""


def sensors_seen(scenario: Scenario) -> tuple[str, ...]:
    """Names of the sensors whose pictures the law or an ending of one vehicle's flight
    sees.
    """
    endings = (name for ending in scenario.endings for name in ending.sees)
    return tuple(dict.fromkeys((*scenario.agent.controller.sees, *endings)))


def images_of(
    names: tuple[str, ...], scenario: Scenario, own: AgentLoop
) -> tuple[Image, ...]:
    """Newest pictures of named sensors that have arrived."""
    if not names:
        return ()
    images = dict(zip(sensors_seen(scenario), own.images, strict=True))
    return tuple(images[name] for name in names)


def blank_images(scenario: Scenario, names: tuple[str, ...]) -> tuple[Image, ...]:
    """Pictures of named sensors before they have taken one: 1 m everywhere."""
    sensors = {each.name: each.sensor for each in scenario.agent.cameras}
    images = []
    for name in names:
        rows, columns = sensors[name].shape
        images.append(
            Image(
                time=NONE_YET,
                depth=(1.0,) * (rows * columns),
                rows=rows,
                columns=columns,
                sensor=name,
            )
        )
    return tuple(images)


class Shutter(NamedTuple):
    """Clock of a camera in control periods: one picture ``every`` so many, which
    arrives ``late`` so many later.
    """

    every: int
    late: int

    @staticmethod
    def of(scenario: Scenario, name: str) -> Shutter:
        """Clock of a sensor of the only vehicle."""
        (sensor,) = (e.sensor for e in scenario.agent.cameras if e.name == name)
        rate = scenario.rates.control
        return Shutter(round(rate / sensor.frequency), round(sensor.latency * rate))

    @property
    def on_their_way(self) -> int:
        """Largest number of pictures that are taken and have not arrived."""
        return -(-self.late // self.every)

    def newest(self, tick: Any) -> Any:
        """Number of the newest picture that has arrived; the first one is there at
        once.
        """
        return np.maximum(0, (tick - self.late) // self.every)

    def next(self, tick: int) -> int:
        """First control period after ``tick`` in which a picture is taken or
        arrives.
        """
        arrival = self.late + (self.newest(tick) + 1) * self.every
        return min(arrival, (tick // self.every + 1) * self.every)


class Pictures:
    """Pictures that the laws and endings of a flight see, from instant to arrival.

    Args:
        scenario: scenario of the flight. example: state of its loop.

    Attributes:
        taken: time and depths of pictures by sensor and number, those that are on their
            way and the newest that has arrived.
    """

    def __init__(self, scenario: Scenario, example: LoopState) -> None:
        self.taken = dict[tuple[str, int], list[float]]()
        self._scenario: Scenario | None = None
        self._cameras = list[tuple[str, Shutter, slice]]()
        # floats, as an int would be structure
        places = rebuild(example, map(float, range(len(leaves(example)))))
        for agent, own in zip(scenario.agents, places.agents, strict=True):
            one = scenario.of(agent)
            for name, image in zip(sensors_seen(one), own.images, strict=True):
                named = f"{agent}.{name}" if scenario.is_team else name
                first, *_, last = leaves(image)
                at = slice(int(first), int(last) + 1)
                self._cameras.append((named, Shutter.of(one, name), at))

    def next(self, tick: int) -> int:
        """First control period after ``tick`` in which a picture is taken or
        arrives.
        """
        return min((each.next(tick) for _, each, _ in self._cameras), default=NEVER)

    def look(
        self, scenario: Scenario, tick: int, example: LoopState, carry: Array
    ) -> None:
        """Take the pictures of a control instant, and write those that have arrived
        into the state of the loop.

        Args:
            scenario: scenario that flies now. tick: number of the period.
            example: state of the loop, whose numbers ``carry`` has.
        """
        if not self._cameras:
            return
        # most flights see nothing, so the module is loaded by those that do
        from skyarm.simulate.eyes import Eyes

        if scenario is not self._scenario:
            self._scenario, self._eyes = scenario, Eyes(scenario)
        time = tick / scenario.rates.control
        now = rebuild(example, iter(carry.tolist()))

        def picture(name: str) -> list[float]:
            depth = self._eyes.frame(name, now, time, tick).depth
            return [time, *depth.ravel().tolist()]

        for name, shutter, place in self._cameras:
            if tick % shutter.every == 0:
                self.taken[name, tick // shutter.every] = picture(name)
            newest = shutter.newest(tick)
            arrived = self.taken.get((name, newest))
            if arrived is None and carry[place.start] < 0.0:
                # a law that sees comes in flight: what a law before it saw is not kept
                arrived = picture(name)
            if arrived is not None:
                carry[place] = arrived
            self.taken.pop((name, newest - 1), None)
