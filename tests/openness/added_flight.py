"""A flight made of what a stranger adds: plugins, the scenario that names what is in
them, numbers that vary.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
EXAMPLES = HERE.parents[1] / "examples"
PLUGINS = (
    *(
        EXAMPLES / f"{name}.py"
        for name in ("own_wind", "ground_effect", "gps", "servo_drive", "own_plant")
    ),
    *(EXAMPLES / f"{name}.py" for name in ("own_log_format",)),
    HERE / "additions.py",
)
VARIED = {
    "environment.air.0.sigma": (0.2, 0.8),
    "environment.forces.0.radius": (0.05, 0.15),
    "sensors.gps.walk": (0.0, 0.01),
    "estimator.gain": (0.001, 0.02),
    "plant.drives.joint1.stiffness": (6.0, 10.0),
    "endings.0.height": (2.0, 3.0),
}

DOCUMENT: dict[str, Any] = {
    "schema": 1,
    "name": "added",
    "duration": 2.0,
    "plant": {
        "vehicle": "hummingbird_arm2_rotors",
        "drives": {name: {"kind": "servo"} for name in ("joint1", "joint2")},
    },
    "model": {"vehicle": "hummingbird_arm2"},
    "controller": {"law": "angles"},
    "reference": {
        "base": {"kind": "sway", "width": 0.1, "period": 4.0},
        "joints": [0.2, -0.1],
    },
    "environment": {
        "wind": {"mode": "moving_air", "velocity": [0.5, 0.0, 0.0]},
        "air": [{"kind": "gusty", "sigma": 0.4}],
        "forces": [{"kind": "near_ground", "radius": 0.1}],
    },
    "sensors": {"position": 0.001, "gps": {"kind": "gps"}},
    "estimator": {"kind": "gps_corrected"},
    "endings": [{"kind": "ceiling", "height": 2.5}],
    "delays": {"measurement": 0.005, "command": 0.002},
    "seed": 3,
}


def toml(**changes: Any) -> str:
    """The scenario's file: what ``DOCUMENT`` holds, with other tables at the top."""
    lines: list[str] = []
    _tables({**DOCUMENT, **changes}, "", lines)
    return "\n".join(lines) + "\n"


def _tables(table: dict[str, Any], at: str, lines: list[str]) -> None:
    inner = {name: value for name, value in table.items() if isinstance(value, dict)}
    lines += [
        f"{name} = {_inline(value)}"
        for name, value in table.items()
        if name not in inner
    ]
    for name, value in inner.items():
        lines.append(f"[{at}{name}]")
        _tables(value, f"{at}{name}.", lines)


def _inline(value: Any) -> str:
    if isinstance(value, dict):
        return (
            "{ "
            + ", ".join(f"{name} = {_inline(each)}" for name, each in value.items())
            + " }"
        )
    if isinstance(value, list):
        return "[" + ", ".join(map(_inline, value)) + "]"
    return json.dumps(value)
