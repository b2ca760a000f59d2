"""A vehicle that is its own mirror image flies mirrored references on mirrored paths,
if its rolling moment is signed.

The mirror turns y round: positions and forces lose its sign, turns keep only theirs
about y, and a rotor becomes its partner on the other side, which turns the other way.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.records.files.toml import toml_value

MIRROR = np.array([1.0, -1.0, 1.0])


def link(
    name: str, parent: str, x: float, y: float, z: float, **joint: Any
) -> dict[str, Any]:
    """Table of a link whose joint is at x, y, z (m) of its parent."""
    return {
        "name": name,
        "parent": parent,
        "mass": 0.04,
        "com": [0.0, 0.0, -0.07],
        "inertia": [1e-4, 1e-4, 2e-5],
        "joint": {
            "name": f"of {name}",
            "axis": [0, 1, 0],
            "position": [x, y, z],
            "damping": 0.002,
            **joint,
        },
    }


ARM = [link("upper", "base", 0.02, 0.0, -0.03), link("lower", "upper", 0.0, 0.0, -0.15)]
LIMITS = {"lower": -1.2, "upper": 1.2, "effort_limit": 2.0}
TWO_ARMS = [
    each
    for name, y in (("lower", 0.06), ("lower right", -0.06))
    for each in (
        link(f"upper of {name}", "base", 0.0, y, -0.03, **LIMITS, axis=[1, 0, 0]),
        link(name, f"upper of {name}", 0.0, 0.0, -0.14, **LIMITS),
    )
]


def vehicle(
    rng: np.random.Generator,
    folder: Path,
    rolling: str,
    links: list[dict[str, Any]] = ARM,
) -> str:
    """File of a drawn vehicle of four or six rotors and the links."""
    pairs, length, coefficient = (
        int(rng.choice([2, 3])),
        rng.uniform(0.12, 0.3),
        10.0 ** rng.uniform(-5.3, -4.7),
    )
    rotors = list[Any]()
    for k in range(pairs):
        angle, arm = (k + 0.5) * np.pi / pairs, length * rng.uniform(0.9, 1.1)
        for side in (1, -1):
            turns = "ccw" if (k % 2 == 0) == (side == 1) else "cw"
            place = [
                float(arm * np.cos(angle)),
                float(side * arm * np.sin(angle)),
                0.02,
            ]
            rotors.append(
                {"name": f"r{k}{turns}", "position": place, "direction": turns}
            )
    mass = rng.uniform(0.6, 1.5)
    inertia = (mass * np.array([0.012, 0.014, 0.022])).tolist()
    place = [float(rng.uniform(-0.01, 0.01)), 0.0, float(rng.uniform(-0.02, 0.02))]
    tables = {
        "schema": 1,
        "name": "drawn",
        "end_effector": "tip",
        "base": {"mass": float(mass), "inertia": inertia, "com": place},
        "rotor_defaults": {
            "thrust_coefficient": float(coefficient),
            "moment_coefficient": float(rng.uniform(0.012, 0.02)),
            "drag_coefficient": float(rng.uniform(0.5e-4, 2e-4)),
            "rolling_moment_coefficient": float(rng.uniform(0.5e-6, 4e-6)),
            "rolling": rolling,
            "max_speed": float(
                np.sqrt(2.2 * (mass + 0.1) * 9.81 / (2 * pairs * coefficient))
            ),
        },
        "rotors": rotors,
        "links": links,
        "frames": [{"name": "tip", "link": "lower", "position": [0.0, 0.0, -0.12]}],
    }
    file = folder / "drawn.toml"
    file.write_text(
        "\n".join(f"{name} = {toml_value(value)}" for name, value in tables.items()),
        encoding="utf-8",
    )
    return str(file)


def parted(seed: int, law: str, folder: Path, rolling: str = "signed") -> float:
    """Largest distance (m) between a drawn flight and the mirror image of its mirrored
    one.
    """
    rng = np.random.default_rng(seed)
    file, paths = vehicle(rng, folder, rolling), []
    (x, y, z, yaw), wind = (
        rng.uniform(-1.0, 1.0, 4)
        * [
            3.0,
            3.0,
            1.0,
            1.0,
        ],
        rng.uniform(-4.0, 4.0, 2),
    )

    def ramp(height: float) -> dict[str, Any]:
        return {
            "kind": "ramp",
            "start": 0.2,
            "duration": 1.2,
            "height": float(height),
            "shape": "quintic",
        }

    for side in (1.0, -1.0):
        tables = {
            "name": "mirrored",
            "duration": 1.6,
            "plant": {"vehicle": file},
            "controller": {"law": law},
            "environment": {
                "ground": False,
                "wind": {
                    "mode": "moving_air",
                    "velocity": [float(wind[0]), float(side * wind[1]), 0.0],
                },
            },
            "reference": {
                "base": {
                    "kind": "signals",
                    "x": ramp(x),
                    "y": ramp(side * y),
                    "z": ramp(z),
                },
                "yaw": ramp(side * yaw),
                "joints": [ramp(0.6), ramp(-0.5)],
            },
        }
        log = skyarm.run(skyarm.scenario_from(tables))
        assert log.status == "completed"
        paths.append(log.position)
    assert np.abs(paths[0][:, 1]).max() > 0.05
    return float(np.abs(paths[0] - paths[1] * MIRROR).max())


# in the second two rotors reach both their limits at once
@pytest.mark.parametrize(("seed", "law"), [(9003, "indi"), (9012, "centroidal")])
def test_mirror_images_of_flights_are_equal(
    seed: int, law: str, tmp_path: Path
) -> None:
    assert parted(seed, law, tmp_path) < 1e-9


def test_the_form_of_rotors_sim_breaks_the_symmetry(tmp_path: Path) -> None:
    """Its moment has one sense for all rotors: a push along x tips the vehicle to one
    side.
    """
    assert parted(9000, "decoupled_pd", tmp_path, "rotors_sim") > 1e-3


@pytest.mark.parametrize("integrator", ["rk4", "euler"])
def test_a_left_and_a_right_arm_meet_their_stops_alike(
    integrator: str, tmp_path: Path
) -> None:
    """The default stops of a joint, and its steps there, do not depend on its place in
    the file.
    """
    rng = np.random.default_rng(2)
    file, logs = vehicle(rng, tmp_path, "signed", TWO_ARMS), []
    still, moving = (
        np.array([1.1, 0.2, -0.1, 0.3]) * rng.uniform(0.5, 1.0, 4),
        rng.uniform(5.0, 25.0, 4),
    )
    for side in (1.0, -1.0):
        # the arms change places, and about x the sense of their turns
        joints, rates = (
            (each if side > 0.0 else each[[2, 3, 0, 1]] * [-1, 1, -1, 1])
            for each in (still, moving)
        )
        tables = {
            "name": "mirrored",
            "duration": 0.2,
            "plant": {"vehicle": file, "integrator": integrator},
            "controller": {"law": "decoupled_pd"},
            "environment": {"ground": False},
            "initial": {
                "position": [0.0, 0.0, 5.0],
                "joints": joints.tolist(),
                "joint_rates": rates.tolist(),
            },
        }
        logs.append(skyarm.run(skyarm.scenario_from(tables)))
    assert np.abs(logs[0].joints).max() > 1.2
    assert np.abs(logs[0].position - logs[1].position * MIRROR).max() < 1e-9
