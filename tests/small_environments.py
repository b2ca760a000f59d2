"""Environments that are made in a fraction of a second: short episodes, code made in a hurry."""

from __future__ import annotations

import dataclasses
from typing import Any

import skyarm
from skyarm.environment.environment_tables import wind_from

MASS = "plant.payload.mass"


def noisy(**changes: Any) -> skyarm.Scenario:
    """The paper's vehicle on a fast circle with all that draws: noise, turbulence that starts anew; late commands."""
    planned = skyarm.load_scenario("case3_wind", **{"controller": "paper_ct", "duration": 0.1, **changes})
    return dataclasses.replace(
        planned,
        trajectory=skyarm.circle(radius=0.3, frequency_hz=0.5, center=[0.0, 0.0, 1.0], joints=[0.1, 0.2]),
        sensors=skyarm.SensorNoise(position=0.001, rate=0.01),
        delays=skyarm.Delays(command=0.002, measurement=0.005),
        wind=wind_from({"mode": "moving_air", "turbulence": {"altitude": 6.0, "wind_20ft": 7.7}}, "wind"),
    )


def bare(**changes: Any) -> dict[str, Any]:
    """A quadrotor alone, which falls when its rotors stop: the arguments of an environment."""
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
    return {"scenario": scenario, "observation": ("position_error", "attitude", "body_rate", "last_action"), **changes}
