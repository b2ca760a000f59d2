"""Scenes in which the centroidal law presses: what ``measure_pressing.py`` and
``measure_tasks.py`` measure.
"""

from skyarm.scenario.scenario_file import scenario_from

NOISE = {
    "position": 1e-3,
    "velocity": 1e-2,
    "attitude": 2e-3,
    "rate": 1e-2,
    "joints": 1e-3,
    "joint_rates": 1e-2,
}
# plant, model, height, posture, tip ahead, mass of the tip along the normal, options of
# the law
VEHICLES = {
    "arm2": (
        "hummingbird_arm2_rotors",
        "hummingbird_arm2",
        1.0,
        [-0.45, -0.9],
        0.2126,
        0.076,
        {"interaction": [0.3, 0.1]},
    ),
    "arm6": (
        "hexarotor_arm6",
        "hexarotor_arm6",
        1.5,
        [0.0, -0.6, -0.97, 0.0, -0.8, 0.0],
        0.5,
        0.066,
        {
            "interaction": [0.5, 0.15],
            "reach": 0.24,
            "damping": 0.06,
            "observer": [27.0, 31.0, 60.0, 60.0],
        },
    ),
}


def scene(name, **about):
    """The scenario of :func:`scene_document`."""
    return scenario_from(scene_document(name, **about))


def scene_document(
    name,
    *,
    noisy=True,
    friction=0.3,
    slide=0.0,
    ahead=0.04,
    normal=(-1.0, 0.0, 0.0),
    duration=10.0,
):
    """A wall so far ahead of the tip; with a slide it is high, and only the hubs of the
    rotors are looked at.
    """
    plant, model, height, joints, tip, _, options = VEHICLES[name]
    top = 0.9 if name == "arm2" and not slide else 3.0
    up = {
        "kind": "ramp",
        "start": 4.0,
        "duration": slide / 0.1,
        "height": slide,
        "shape": "linear",
    }
    found = {
        "schema": 1,
        "name": "press",
        "duration": duration,
        "plant": {"vehicle": plant},
        "model": {"vehicle": model},
        "controller": {"law": "centroidal", "mode": "tip", **options},
        "reference": {
            "base": {"kind": "signals", "z": [height, up] if slide else height},
            "joints": joints,
            "push": {
                "force": {"kind": "constant", "value": 1.0, "start": 0.5},
                "normal": list(normal),
                "speed": 0.1,
            },
        },
        "world": {
            "rotor_radius": 0.1 if name == "arm2" and not slide else 0.0,
            "surfaces": [
                {
                    "name": "wall",
                    "shape": "box",
                    "size": [0.1, 2.0, top],
                    "position": [tip + ahead + 0.05, 0.0, 0.5 * top],
                    "material": {"friction": friction},
                }
            ],
        },
    }
    return found | (
        {"sensors": dict(NOISE), "delays": {"measurement": 0.005}} if noisy else {}
    )
