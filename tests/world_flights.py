"""A short flight in a world, shared by the tests of everything that draws: a tip presses on a wall that is turned."""

from __future__ import annotations

import functools
from typing import Any

import skyarm
from skyarm.log.flight_log import Log

WALL_ANGLE = 0.2
"""rad, about z."""

DOCUMENT: dict[str, Any] = {
    "name": "touch",
    "duration": 1.2,
    "plant": {"vehicle": "hummingbird_arm2_rotors"},
    "model": {"vehicle": "hummingbird_arm2"},
    "controller": {"law": "centroidal", "mode": "tip", "interaction": [0.3, 0.1]},
    "reference": {
        "base": {"kind": "signals", "z": 1.0},
        "joints": [-0.45, -0.9],
        "push": {"force": {"kind": "constant", "value": 1.0, "start": 0.1}, "normal": [-1.0, 0.0, 0.0], "speed": 0.2},
    },
    "world": {
        "surfaces": [
            {"name": "ground", "position": [0.0, 0.0, -0.3]},
            {
                "name": "wall",
                "shape": "box",
                "size": [0.1, 2.0, 0.9],
                "position": [0.29, 0.0, 0.45],
                "angles": [0.0, 0.0, WALL_ANGLE],
            },
            {
                "name": "post",
                "shape": "cylinder",
                "size": [0.05, 1.0],
                "position": [0.0, 2.0, 0.5],
                "motion": [{"kind": "sine", "amplitude": 0.3, "frequency_hz": 0.5}, 0.0, 0.0],
            },
            {"name": "side", "position": [0.0, 3.0, 0.0], "angles": [1.5707963267948966, 0.0, 0.0]},
        ],
        "points": [
            {"name": "tip", "frame": "tip"},
            {"name": "skid", "body": "base", "position": [0.0, 0.1, -0.2], "radius": 0.02},
        ],
        "objects": [
            {"name": "parcel", "mass": 0.1, "shape": "box", "size": [0.1, 0.2, 0.3], "position": [-1.0, 0.0, 1.0]}
        ],
    },
}


@functools.lru_cache(maxsize=1)
def touching() -> Log:
    """The flight: the tip meets the wall after half a second, a parcel falls beside it."""
    return skyarm.run(skyarm.scenario_from(DOCUMENT))
