"""Environments that are made in a fraction of a second: short episodes, code made in a
hurry.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

import skyarm
from skyarm.envs import env_lanes
from skyarm.world.wind import wind_from
from support.cases import whole_text

MASS = "plant.payload.mass"


@contextmanager
def one_program_a_task(cache: object) -> Iterator[None]:
    """Within it a task is traced once, however many environments fly it, and machine
    code is made in a hurry.

    Programs keep nothing of a flight. Tasks are the same if their texts are.
    """
    made: dict[str, Any] = {}
    program = env_lanes.EnvProgram

    def once(task: Any) -> Any:
        text = whole_text(task)
        if text not in made:
            # which keeps the task, so that no other takes the address of a function in
            # it
            made[text] = program(task)
        return made[text]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(env_lanes, "EnvProgram", once)
        yield


def noisy(**changes: Any) -> skyarm.Scenario:
    """The paper's vehicle on a fast circle with all that draws, noise and turbulence; a
    gust, late commands.
    """
    planned = skyarm.load_scenario(
        "case3_wind", **{"controller": "paper_ct", "duration": 0.1, **changes}
    )
    return dataclasses.replace(
        planned,
        reference=skyarm.circle(
            radius=0.3, frequency_hz=0.5, center=[0.0, 0.0, 1.0], joints=[0.1, 0.2]
        ),
        noise=skyarm.SensorNoise(position=0.001, rate=0.01, joints=0.01),
        delays=skyarm.Delays(command=0.002, measurement=0.005),
        wind=wind_from(
            {
                "mode": "moving_air",
                "turbulence": {"altitude": 6.0, "wind_20ft": 7.7},
                "gust": {
                    "velocity": [0.0, 5.0, 0.0],
                    "start": 0.02,
                    "duration": 0.01,
                    "shape": "step",
                },
            },
            "wind",
        ),
    )


def bare(**changes: Any) -> dict[str, Any]:
    """A quadrotor alone, which falls when its rotors stop: the arguments of an
    environment.
    """
    scenario = skyarm.scenario_from(
        {
            "schema": 1,
            "name": "bare",
            "duration": 0.3,
            "rates": {"physics": 1000, "control": 100, "reference": 100},
            "plant": {"vehicle": "hummingbird"},
            "controller": {"law": "decoupled_pd"},
            "reference": {"base": {"kind": "hover", "position": [0.0, 0.0, 0.3]}},
            "sensors": {"position": 0.01},
        }
    )
    return {
        "scenario": scenario,
        "observation": ("position_error", "attitude", "body_rate", "last_action"),
        **changes,
    }
