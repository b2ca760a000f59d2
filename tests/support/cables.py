"""Scenarios of vehicles that carry one body on cables, and of two arms under Thapa's
law, as tables of a file.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from skyarm.records.arrays import Array
from skyarm.studies.trial.trial import NOISE

DATA = Path(__file__).parents[1] / "data" / "cables"

G = 9.81
NOISY: Mapping[str, Any] = {
    "sensors": {
        name: float(getattr(NOISE, name))
        for name in (
            "position",
            "velocity",
            "attitude",
            "rate",
            "joints",
            "joint_rates",
        )
    },
    "delays": {"measurement": 0.005},
}
"""Tables of noise on every measurement, and of their age (s), known to the laws."""

BODY_NOISY: Mapping[str, float] = {
    "position_noise": NOISE.position,
    "attitude_noise": NOISE.attitude,
    "velocity_noise": NOISE.velocity,
    "rate_noise": NOISE.rate,
    "pose_age": 0.005,
}
"""The same noise and age of the body's motion, as the law of the team measures it."""

HANGING = [{"kind": "lift", "height": 1e-4, "duration": 1.0}]
"""Phases of a body that hangs on its cables from the start."""

STIFF = {"stiffness": 2000.0, "damping": 4.0}


def on_cables(
    body: Mapping[str, Any],
    places: Mapping[str, Sequence[float]],
    *,
    vehicle: str = "dragonfly",
    team: Mapping[str, Any],
    motion: Mapping[str, Any],
    duration: float,
    length: float = 0.5,
    cable: Mapping[str, float] = STIFF,
    frame: str = "grip",
    **controller: Any,
) -> dict[str, Any]:
    """Tables of vehicles without arms that hold a body on cables.

    Args:
        body: table of the body. places: of the grasps (m, axes of the body), by the
            vehicles' names.
        vehicle: name or file. team: options of the team's law. motion: table of the
            body's motion.
        duration: s. length: of the cables, m. cable: stiffness and damping. frame: of
            the vehicles.
        controller: options of the vehicles' law.
    """
    (name,) = {str(body["name"])}
    grasp = {"frame": frame, "body": name, "kind": "cable", "length": length, **cable}
    return {
        "schema": 1,
        "name": "on_cables",
        "duration": round(duration, 2),
        "plant": {"vehicle": vehicle, "gravity": G},
        "controller": {
            "law": "centroidal",
            "mode": "joint",
            "bandwidth": 1.0,
            "carrying": 1.0,
            **controller,
        },
        "agents": {agent: {} for agent in places},
        "reference": {"object": {"kind": "phases", **motion}},
        "team": {"law": "object_wrench", "object": name, **team},
        "environment": {"ground": False},
        "world": {
            "objects": [dict(body)],
            "grasps": [
                {"agent": agent, "place": list(place), **grasp}
                for agent, place in places.items()
            ],
        },
    }


BAR = {
    "name": "bar",
    "shape": "box",
    "size": [0.0276, 0.684, 0.0276],
    "mass": 0.104,
    "inertia": [4.053e-3, 1.3225e-5, 4.053e-3],
}
"""Bar of RotorTM, without its place."""

HALF = 0.19
"""Distance (m) of its grasps from its middle."""


def beam(
    pull: float,
    gain: float = 0.5,
    tilt: float = 0.1,
    height: float = 0.0,
    duration: float = 8.0,
) -> Any:
    """Tables of two vehicles that hold RotorTM's bar on cables by constant forces, and
    never see its attitude.

    Args:
        pull: internal force, N. gain: velocity of a vehicle per error of its force,
            m/(N s).
        tilt: roll (rad) of the bar at the start, at which its cables, as long as that
            takes, hang level vehicles.
        height: of the grasps above the centre of mass, m.
        duration: s.
    """
    body = {**BAR, "position": [0.0, 0.0, 0.5 - height], "angles": [tilt, 0.0, 0.0]}
    places = {"left": (0.0, HALF, height), "right": (0.0, -HALF, height)}
    given = [
        {"agent": name, "place": list(place), "length": 0.5}
        for name, place in places.items()
    ]
    options = {
        "law": "decentralised",
        "internal_force": pull,
        "gain": gain,
        "adaptation": 0.0,
        "filter": 30.0,
    }
    team = {**options, "initial_mass": 0.5 * BAR["mass"], "members": given}  # type: ignore[operator]
    tables = on_cables(
        body, places, team=team, motion={"phases": HANGING}, duration=duration
    )
    for grasp in tables["world"]["grasps"]:
        grasp["length"] = 0.5 - grasp["place"][1] * math.sin(tilt)
    return tables


def rate_of_beam(pull: float, gain: float, height: float = 0.0) -> float:
    """Rate r (1/s) of tan(roll / 2) = tan(roll_0 / 2) exp(r t) of a bar between
    constant forces, for small roll.

    Both cables turn the bar by 2 a T sin(roll), and its weight by m g h sin(roll),
    against the ends' velocities.
    """
    return -gain / HALF * (pull + float(BAR["mass"]) * G * height / (2.0 * HALF))  # type: ignore[arg-type]


def roll(log: Any) -> Array:
    """Roll (rad) of a body that turns about x alone."""
    return np.asarray(
        2.0 * np.arctan2(log.object_quaternion[:, 1], log.object_quaternion[:, 0])
    )


SWINGING = {"swing": 0.1, "filter": 20.0}
"""Options of ``object_wrench`` for bodies on cables."""

TILT = 3.0
"""Tangent of the largest tilt of the vehicles on fast paths."""


def figure_eight(
    rate: float,
    size: float = 2.0,
    laps: float = 1.0,
    members: int = 3,
    radius: float = 0.2,
) -> tuple[dict[str, Any], float]:
    """Tables of a load of 0.4 kg on cables of 1 m along x = A sin wt, y = A sin wt cos
    wt; time (s) of the first lap.

    Args:
        rate: w, rad/s. size: A, m. laps: flown after the amplitude has risen. members:
            vehicles of 0.6 kg.
        radius: of the grasps, m.
    """
    rise, period = max(4.0, 2.0 * math.pi / rate), 2.0 * math.pi / rate
    grows = {
        "kind": "ramp",
        "start": 0.0,
        "duration": rise,
        "height": 1.0,
        "shape": "quintic",
    }
    x, y = (
        {
            "kind": "product",
            "signal": {
                "kind": "sine",
                "amplitude": size / k,
                "frequency_hz": k / period,
            },
            "factor": grows,
        }
        for k in (1, 2)
    )
    turns = (2.0 * math.pi * k / members for k in range(members))
    places = {
        f"q{k}": (radius * math.cos(a), radius * math.sin(a), 0.0)
        for k, a in enumerate(turns)
    }
    body = {
        "name": "load",
        "shape": "cylinder",
        "size": [2.0 * radius, 0.05],
        "mass": 0.4,
        "position": [0.0, 0.0, 1.0],
    }
    return (
        on_cables(
            body,
            places,
            vehicle=str(DATA / "quadrotor_600g.toml"),
            team={"internal_force": 1.0, **SWINGING},
            motion={
                "phases": HANGING,
                "path": {"kind": "signals", "x": x, "y": y, "z": 0.0},
            },
            duration=rise + laps * period,
            length=1.0,
            frame="hook",
            tilt=TILT,
        ),
        rise,
    )


SPREAD = 0.54 / 0.841
"""Tangent of the cables' angle to the vertical at the start of col-trans's plans."""


def recorded_paths() -> dict[str, Array]:
    """Set points of col-trans's payload by row: time (s), x, y, z (m)."""
    with (DATA / "col_trans_paths.csv").open(encoding="utf-8") as file:
        lines = csv.reader(line for line in file if not line.startswith("#"))
        next(lines)
        rows: dict[str, list[list[float]]] = {}
        for name, *numbers in lines:
            rows.setdefault(name, []).append([float(number) for number in numbers])
    return {name: np.array(each) for name, each in rows.items()}


def col_trans(row: str) -> tuple[dict[str, Any], float]:
    """Tables of Crazyflies that carry 10 g along a recorded path, and the time (s) from
    which it is judged.

    The path goes on for a second in which it stops, after the flight has ended.
    """
    path, members, radius = recorded_paths()[row], int(row[0]), 0.01
    times, points = path[:, 0] - path[0, 0], path[:, 1:]
    stop = points[-1] + 0.5 * (points[-1] - points[-2]) / (times[-1] - times[-2])
    when, values = (
        [*times.tolist(), float(times[-1]) + 1.0],
        np.vstack([points, stop]) - points[0],
    )
    signals = {
        axis: {"kind": "spline", "times": when, "values": values[:, i].tolist()}
        for i, axis in enumerate("xyz")
    }
    first = 0.5 * math.pi if "window" in row else 0.0
    turns = (first + 2.0 * math.pi * k / members for k in range(members))
    places = {
        f"q{k}": (radius * math.cos(a), radius * math.sin(a), 0.0)
        for k, a in enumerate(turns)
    }
    body = {
        "name": "load",
        "shape": "sphere",
        "size": [0.03],
        "mass": 0.01,
        "position": points[0].tolist(),
    }
    return (
        on_cables(
            body,
            places,
            vehicle=str(DATA / "crazyflie.toml"),
            team={"internal_force": 0.01 * G / members * SPREAD, **SWINGING},
            motion={"phases": HANGING, "path": {"kind": "signals", **signals}},
            duration=float(times[-1]),
            cable={"stiffness": 100.0, "damping": 0.1},
            frame="hook",
        ),
        1.0,
    )


def thapa(gain: float, duration: float = 20.0) -> dict[str, Any]:
    """Tables of two hexarotors with arms under Thapa's law, with his load, forces,
    velocity, masses and adaptation.

    Args:
        gain: velocity of a tip per error of its force, m/(N s); his is 0.1.
        duration: s.
    """
    places = {"left": -0.55, "right": 0.55}
    body = {
        "name": "bar",
        "shape": "box",
        "size": [1.2, 0.04, 0.04],
        "mass": 0.5,
        "position": [0.0, 0.0, 1.0],
    }
    arm = {"mode": "tip", "reach": 0.24, "damping": 0.06, "adaptation": 0.0}
    tables = on_cables(
        body,
        {name: (x, 0.0, 0.0) for name, x in places.items()},
        vehicle="hexarotor_arm6",
        team={
            "law": "decentralised",
            "internal_force": 2.0,
            "gain": gain,
            "adaptation": 1.0,
            "initial_mass": 0.1,
            "members": [
                {"agent": name, "place": [x, 0.0, 0.0], "mass": c}
                for (name, x), c in zip(places.items(), (0.6, 0.4), strict=True)
            ],
        },
        motion={
            "phases": HANGING,
            "path": {
                "kind": "signals",
                "x": {"kind": "ramp", "start": 0.0, "duration": 100.0, "height": 20.0},
            },
        },
        duration=duration,
        **arm,
    )
    tables["reference"]["tip"] = {"posture": [0.0, 0.6, -1.0, 0.0, 0.5, 0.0]}
    for grasp in tables["world"]["grasps"]:
        for name in ("frame", "length"):
            del grasp[name]
        grasp |= {"kind": "ball", "stiffness": 1e4, "damping": 15.0}
    return tables
