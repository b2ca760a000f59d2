"""Pictures in the state of the loop, which laws and endings see."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from skyarm.scenario.scenario_record import Scenario
from skyarm.sensing.measurement import Image

Images = tuple[Image, ...]


def cameras_of(scenario: Scenario) -> dict[str, Any]:
    """Cameras and lidars by the names of :class:`skyarm.simulate.eyes.Eyes`."""
    return {
        f"{agent}.{each.name}" if scenario.is_team else each.name: each.sensor
        for agent, own in scenario.agents.items()
        for each in own.cameras
    }


def sensors_seen(scenario: Scenario) -> tuple[str, ...]:
    """Names of the sensors whose pictures the law or an ending of one vehicle sees."""
    endings = (name for ending in scenario.endings for name in ending.sees)
    return tuple(dict.fromkeys((*scenario.agent.controller.sees, *endings)))


def images_of(names: Iterable[str], images: Images) -> Images:
    """Pictures of some sensors, in their order."""
    return tuple(each for name in names for each in images if each.sensor == name)


def blank_images(scenario: Scenario, names: Iterable[str]) -> Images:
    """Example of the pictures of some sensors of one vehicle: 1 m everywhere."""
    shapes = {name: cameras_of(scenario)[name].shape for name in names}
    return tuple(
        Image(
            time=0.0,
            depth=(1.0,) * (rows * columns),
            rows=rows,
            columns=columns,
            sensor=name,
        )
        for name, (rows, columns) in shapes.items()
    )
