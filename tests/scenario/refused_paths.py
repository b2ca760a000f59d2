"""Answers for parameter paths of all sorts: the fields that they lead to and whether
they change in flight, or why not.

``python tests/scenario/refused_paths.py --write`` writes ``pins/refused_paths.json``
anew.
"""

from __future__ import annotations

import dataclasses
import json
import sys
from collections.abc import Callable
from typing import Any

from shipped_files import PINS, RICH, only_shipped, scenario

import skyarm
from skyarm.scenario.in_flight import require_changes
from skyarm.scenario.numbers import number_at
from skyarm.scenario.paths import places_of
from skyarm.scenario.scenario_record import Change, ScenarioError

FILE = PINS / "refused_paths.json"

PLAIN, GOVERNED, TASK = "case3_wind", "examples/fast_circle", "pick_and_carry"
"""Scenarios without a longest delay, with a path governor, and with a reference of the
tip and an object."""

TRIED: dict[str, tuple[tuple[str, Any], ...]] = {
    RICH: (
        *(
            (path, 1.0)
            for path in (
                "duration",
                "rates",
                "rates.control",
                "seed",
                "episode",
                "name",
                "title",
                "schema",
            )
        ),
        *(
            (path, 1.0)
            for path in (
                "plugins.need",
                "windows.last",
                "plant.kind",
                "plant.integrator",
                "initial",
            )
        ),
        *(
            (path, 1.0)
            for path in (
                "delays",
                "delays.measurement",
                "delays.longest_command",
                "delays.comand",
            )
        ),
        *(
            (path, 0.004)
            for path in ("delays.command", "delays.rotors", "delays.joints")
        ),
        *(
            (path, 1.0)
            for path in (
                "changes",
                "changes.0",
                "changes.0.at",
                "changes.0.path",
                "changes.0.value",
            )
        ),
        *(
            (path, 1.0)
            for path in (
                "changes.7.value",
                "changes.at",
                "gravity",
                "plants.gravity",
                "plant",
                "plant.",
            )
        ),
        *(
            (path, 9.0)
            for path in (
                "plant.gravity",
                "model.gravity",
                "controller.model.gravity",
                "plant.gravty",
            )
        ),
        *(
            (path, 1.0)
            for path in (
                "plant.vehicle",
                "plant.vehicle.name",
                "plant.vehicle.base",
                "plant.vehicle.n",
            )
        ),
        *(
            (path, 1.0)
            for path in (
                "plant.vehicle.links.link3.body.mass",
                "plant.vehicle.links.2.body.mass",
            )
        ),
        *(
            (path, 1.0)
            for path in (
                "plant..gravity",
                "plant.vehicle.base.mass.x",
                "plant.joints",
                "plant.joints.mass",
            )
        ),
        *(
            (path, 0.1)
            for path in (
                "plant.payload.mass",
                "plant.payload",
                "plant.payload.tip.mass",
                "plant.payload.m",
            )
        ),
        *((path, 0.1) for path in ("model.payload.elbow.mass", "model.payload.mass")),
        *(
            (path, 0.1)
            for path in (
                "plant.drives.joint1.time_constant",
                "plant.drives.joint2.time_constant",
            )
        ),
        *(
            (path, 0.1)
            for path in (
                "controller.limits.tilt",
                "controller.limit.tilt",
                "controller.safety.tilt",
            )
        ),
        ("controller.law", "paper_ct"),
        ("controller.law", "paper_tc"),
        ("controller.law", 3.0),
        ("controller.law", "hybrid_computed_torque"),
        ("controller", {"preset": "paper_ct"}),
        ("controller", {"preset": "paper_tc"}),
        ("controller.preset", "paper_ct"),
        ("model.vehicle", "hummingbird_arm2"),
        ("reference", {"base": {"kind": "hover", "position": [0.0, 0.0, 1.5]}}),
        ("reference.base", {"kind": "hover", "position": [0.0, 0.0, 1.5]}),
        ("reference.base", {"kind": "hover", "positon": [0.0, 0.0, 1.5]}),
        ("reference.yaw", 0.3),
        ("reference.yaw", {"kind": "sine", "amplitude": 0.1, "frequency_hz": 0.1}),
        ("reference.joints", [0.1, 0.2]),
        ("reference.joints", [0.1]),
        ("reference.push", {"force": 1.0, "normal": [1.0, 0.0, 0.0]}),
        *(
            (path, 0.1)
            for path in (
                "reference.base.0.radius",
                "reference.base.radius",
                "reference.tip.path.radius",
            )
        ),
        *(
            (path, 0.1)
            for path in (
                "reference.push.speed",
                "reference.tracking_start",
                "reference.governor.tilt",
            )
        ),
        ("environment.wind", {"mode": "none"}),
        ("environment.wind", {"mode": "breeze"}),
        ("environment.wind", 2.0),
        ("environment.faults", []),
        ("environment.faults", [{"rotor": "top", "effectiveness": 0.5}]),
        ("environment.air", [{"kind": "moving_air"}]),
        ("environment.forces", [{"kind": "moving_air"}]),
        ("environment.ground", False),
        ("environment.ground", 0.0),
        ("environment", {"ground": False}),
        ("environment.ground.x", 1.0),
        *(
            (path, 2.0)
            for path in ("environment.wind.velocity.0", "environment.wind.velocity_W.x")
        ),
        *(
            (path, 2.0)
            for path in (
                "environment.wind.gusts.0.velocity.0",
                "environment.wind.gust.start",
            )
        ),
        *(
            (path, 0.5)
            for path in (
                "environment.faults.front.effectiveness",
                "environment.faults.2.start",
            )
        ),
        *(
            (path, 0.5)
            for path in (
                "environment.air.air_signals.velocity.x",
                "environment.forces.disturbance.torque.x",
            )
        ),
        ("estimator", "pass_through"),
        ("estimator", "efk"),
        ("estimator.position", 0.01),
        ("endings", []),
        ("endings.joint_limits.stops", False),
        *(
            (path, 0.1)
            for path in (
                "sensors",
                "sensors.position",
                "sensors.gps",
                "sensors.gps.position.sigma",
            )
        ),
        *(
            (path, 20.0)
            for path in (
                "sensors.gps.frequency",
                "sensors.gsp.frequency",
                "sensors.capture.latency",
            )
        ),
        *(
            (path, 0.1)
            for path in (
                "initial.position.x",
                "initial.roll",
                "initial.quaternion_wxyz.0",
                "initial.rol",
            )
        ),
        *(
            (path, 0.1)
            for path in (
                "payloads",
                "payloads.parcel.mass",
                "payloads.1.cord",
                "payloads.parcle.mass",
            )
        ),
        *(
            (path, 0.1)
            for path in (
                "world",
                "world.surfaces.wall.material.friction",
                "world.surfaces.walls.size.0",
            )
        ),
        *(
            (path, 0.1)
            for path in (
                "world.mechanisms.door.damping",
                "world.objects.box.mass",
                "world.hit_steps",
            )
        ),
        ("world", {"surfaces": []}),
    ),
    PLAIN: (
        *(
            (path, 0.01)
            for path in (
                "delays.command",
                "delays.rotors",
                "delays.joints",
                "delays.longest_command",
            )
        ),
        *(
            (path, 0.1)
            for path in (
                "reference.base.radius",
                "reference.base.center.0",
                "reference.base.center.w",
            )
        ),
        *(
            (path, 0.1)
            for path in (
                "initial.position.x",
                "initial.yaw",
                "world.surfaces.0.size.0",
                "payloads.0.mass",
            )
        ),
        *(
            (path, 0.1)
            for path in (
                "reference.push.speed",
                "reference.load.value",
                "changes.0.value",
                "estimator.gate",
            )
        ),
        ("environment.wind.gust.start", 1.0),
    ),
    GOVERNED: (
        *(
            (path, 0.1)
            for path in (
                "reference.x.signal.amplitude",
                "reference.z.value",
                "reference.tracking_start",
            )
        ),
        ("reference.base", {"kind": "hover", "position": [0.0, 0.0, 1.5]}),
        ("reference", {"base": {"kind": "hover", "position": [0.0, 0.0, 1.5]}}),
    ),
    TASK: (
        *(
            (path, 0.1)
            for path in (
                "reference.base.x",
                "reference.tip.path.z",
                "reference.tip.path.radius",
            )
        ),
        ("reference.base", {"kind": "hover", "position": [0.0, 0.0, 1.5]}),
        ("reference.joints", [0.1, 0.2]),
    ),
}
"""Scenario -> paths, each with what a change would put in its place."""


def answer(ask: Callable[[], str]) -> str:
    """What a call gives, or its error."""
    try:
        return ask()
    except ScenarioError as error:
        return f"ScenarioError: {error}"


def answers(given: skyarm.Scenario, path: str, value: Any) -> dict[str, Any]:
    """Fields that a path leads to, number there, and whether a change of it is
    accepted.
    """

    def change() -> str:
        require_changes(
            dataclasses.replace(
                given, changes=(Change(at=1.0, path=path, value=value),)
            )
        )
        return "may change in flight"

    places = answer(lambda: " & ".join(map(".".join, places_of(given, path))))
    number = answer(lambda: f"{number_at(given, path):.12g}")
    said = {} if number == places else {"number": number}  # mostly the same refusal
    return {
        "path": path,
        "value": value,
        "places": places,
        **said,
        "change": answer(change),
    }


def found() -> dict[str, list[dict[str, Any]]]:
    """All answers by scenario."""
    return {
        name: [answers(scenario(name), path, value) for path, value in rows]
        for name, rows in TRIED.items()
    }


if __name__ == "__main__":
    if sys.argv[1:] != ["--write"]:
        sys.exit("usage: python tests/scenario/refused_paths.py --write")
    with only_shipped():
        told = found()
    FILE.write_text(json.dumps(told, indent=1) + "\n", "utf-8")
