"""Scenario of the paper's vehicle that pushes a box along a table."""

from __future__ import annotations

from standing_walls import NOISE

BEHIND = 0.06
"""m, from the tip to the box, 12 cm long."""

START, FRICTION = 0.2 + BEHIND + 0.06, 0.2
"""m, of the box's middle along x; between box and table."""


def beside_a_box(phases, duration=9.0, **law):
    """Document of a scenario: 250 g, 12 x 20 x 10 cm, on a table, the tip behind its middle."""
    return {
        "schema": 1, "name": "push_a_box", "duration": duration,
        "plant": {"vehicle": "hummingbird_arm2_rotors"}, "model": {"vehicle": "hummingbird_arm2"},
        "controller": {"law": "centroidal", "mode": "tip", "interaction": [0.3, 0.1]} | law,
        "sensors": dict(NOISE), "delays": {"measurement": 0.005},
        "environment": {"wind": {"mode": "force_wind", "force": [0.1, 0.1, 0.0]}},
        "reference": {"tip": {
            "posture": [-0.45, -0.9], "path": {"kind": "phases", "position": [0.2, 0.0, 0.83], "phases": phases},
        }},
        "world": {
            "surfaces": [{"name": "table", "shape": "box", "size": [1.4, 1.0, 0.05], "position": [0.96, 0.0, 0.755],
                          "material": {"friction": FRICTION}}],
            "objects": [{"name": "box", "size": [0.12, 0.2, 0.1], "mass": 0.25, "standing": True,
                         "position": [START, 0.0, 0.83]}],
        },
    }  # fmt: skip


def by_force(distance=0.3, **until):
    """Phases that push with 1 N until the tip has moved that far, m."""
    guard = {"distance": distance, "on_timeout": "fail"} | until
    press = {"kind": "press", "force": 1.0, "normal": [-1.0, 0.0, 0.0], "until": guard}
    return [{"kind": "hold", "duration": 0.5}, press, {"kind": "retreat"}]


def by_place(distance=0.3):
    """Phases that lead the tip that far, m, against the box and on with it."""
    way = {"kind": "go_to", "position": [0.2 + distance, 0.0, 0.83], "duration": 4.0}
    back = {"kind": "go_to", "position": [0.15 + distance, 0.0, 0.83], "duration": 1.0}
    return [{"kind": "hold", "duration": 0.5}, way, back]
