"""Vehicles that are set down on their shapes, and those that start inside something."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.scenario.scenario_file import scenario_from
from skyarm.scenario.without_effect import without_effect
from support.shaped import shaped
from support.worlds import GRAVITY, limp

WEIGHT = float(limp().mass) * GRAVITY

LEVEL = [0.0, math.pi / 2, 0.0]

SHAPES: dict[str, list[dict[str, Any]]] = {
    "box": [{"shape": "box", "size": [0.2, 0.2, 0.04], "position": [0.0, 0.0, -0.1]}],
    "capsules": [
        {
            "shape": "capsule",
            "size": [0.01, 0.2],
            "position": [0.0, y, -0.11],
            "rpy": LEVEL,
        }
        for y in (-0.1, 0.1)
    ],
    "cylinder": [
        {"shape": "cylinder", "size": [0.12, 0.1], "position": [0.0, 0.0, -0.07]}
    ],
    "spheres": [
        {"shape": "sphere", "size": [0.02], "position": [0.1 * x, 0.1 * y, -0.1]}
        for x in (-1, 1)
        for y in (-1, 1)
    ],
}
"""Feet whose lowest points are 0.12 m below the base's origin."""

PLACES = {"box": 4, "capsules": 4, "cylinder": 3, "spheres": 4}
"""Shape -> number of places that carry the vehicle on level ground."""


def standing(folder: Path, shape: str, **fields: Any) -> skyarm.Scenario:
    """A vehicle without an arm, set down on its shapes."""
    ground = {"name": "ground", "angles": fields.pop("angles", [0.0, 0.0, 0.0])}
    ground["material"] = {"friction": fields.pop("friction", 0.5)}
    initial = {"standing": True, "position": [0.0, 0.0, fields.pop("height", 0.2)]}
    world = {"surfaces": [ground, *fields.pop("surfaces", [])]}
    document = {
        "schema": 1,
        "name": "stands",
        "duration": 1.0,
        "plant": {"gravity": GRAVITY, "vehicle": shaped(folder, SHAPES[shape])},
        "controller": {"law": "decoupled_pd"},
        "environment": {"ground": False},
        "world": {**world, **fields},
        "reference": {"base": {"kind": "hover", "position": [0.0, 0.0, 0.4]}},
        "initial": initial,
    }
    return scenario_from(document, folder)


def after_a_second(scenario: skyarm.Scenario) -> tuple[Any, Any]:
    """First and last state of a second without thrust."""
    session = skyarm.Session(scenario)
    first = session.state
    still = skyarm.Command(rotor_speeds=(0.0,) * 4, efforts=())
    while session.running:
        session.step(still)
    return first, session.state


@pytest.mark.parametrize("shape", SHAPES)
def test_a_vehicle_stands_on_its_shapes_and_stays_at_rest(tmp_path, shape):
    """Each place carries its share of the weight by 5000 N/m."""
    first, last = after_a_second(standing(tmp_path, shape))
    deep = WEIGHT / PLACES[shape] / 5000.0
    assert first.position.z == pytest.approx(0.12 - deep, abs=1e-8)
    assert np.abs([*last.velocity]).max() < 1e-6
    assert np.abs([*(last.position - first.position)]).max() < 1e-6


@pytest.mark.parametrize("shape", ["box", "capsules", "spheres"])
@pytest.mark.parametrize("angles", [[0.1, 0.0, 0.0], [0.0, -0.3, 0.0]])
def test_it_stands_on_a_slope_and_lies_as_the_slope_does(tmp_path, shape, angles):
    first, last = after_a_second(standing(tmp_path, shape, angles=angles))
    assert np.abs([*last.velocity]).max() < 1e-3
    up = first.quaternion.rotation().column(2)
    slope = math.acos(math.cos(angles[0]) * math.cos(angles[1]))
    assert math.acos(up.z) == pytest.approx(slope, abs=0.02)
    with pytest.raises(ValueError, match="and it slides"):
        standing(tmp_path, shape, angles=angles, friction=0.95 * math.tan(slope))


OUT = {"shape": "sphere", "size": [0.02], "position": [0.0, 0.0, -0.1]}


def starting(folder: Path, height: float, **world: Any) -> skyarm.Scenario:
    """A ball of 2 cm, 10 cm below a vehicle that starts at a height."""
    ground = {"name": "ground", "material": {"stiffness": 1000.0}}
    document = {
        "schema": 1,
        "name": "starts",
        "duration": 1.0,
        "plant": {"gravity": GRAVITY, "vehicle": shaped(folder, [OUT])},
        "controller": {"law": "decoupled_pd"},
        "world": {"surfaces": [ground], **world},
        "reference": {"base": {"kind": "hover", "position": [0.0, 0.0, height]}},
    }
    return scenario_from(document, folder)


def test_a_start_inside_a_surface_is_refused_above_twice_the_weight(tmp_path):
    """Of a soft ground: depth times stiffness."""
    deepest = 2.0 * WEIGHT / 1000.0
    starting(tmp_path, 0.12 - 0.99 * deepest)
    deep = 1.01 * deepest
    words = (
        f"world: base/ground start {deep:.3g} m inside each other, which would push"
        f" them with {1000.0 * deep:.3g} N: must start apart"
    )
    with pytest.raises(ValueError, match=re.escape(words)):
        starting(tmp_path, 0.12 - deep)
    deeper = {"name": "deeper", "position": [0.0, 0.0, -1.0]}
    ground = {"name": "ground"}
    starting(tmp_path, 0.12 - deep, surfaces=[ground, deeper], ignore=["base/ground"])


def test_a_start_inside_an_object_counts_the_heavier_of_both(tmp_path):
    """A ball in a block, by its depth times the block's stiffness."""
    deep = 0.01
    block = {
        "name": "block",
        "shape": "box",
        "size": [0.2, 0.2, 0.2],
        "position": [0.0, 0.0, 0.1],
        "material": {"stiffness": 5000.0},
    }
    assert 5000.0 * deep > 2.0 * WEIGHT
    with pytest.raises(ValueError, match=r"base/block start 0\.01 m .* with 50 N"):
        starting(tmp_path, 0.32 - deep, objects=[{**block, "mass": 0.1}])
    heavy = 1.1 * 5000.0 * deep / (2.0 * GRAVITY)
    starting(tmp_path, 0.32 - deep, objects=[{**block, "mass": heavy}])


def test_vehicles_that_start_inside_each_other_are_refused(tmp_path):
    vehicle = shaped(tmp_path, [{"shape": "sphere", "size": [0.2]}])

    def pair(apart):
        agents = {
            name: {
                "plant": {"vehicle": vehicle},
                "controller": {"law": "decoupled_pd"},
                "reference": {"base": {"kind": "hover", "position": [x, 0.0, 2.0]}},
            }
            for name, x in (("left", 0.0), ("right", apart))
        }
        world = {"surfaces": [{"name": "ground"}], "ignore": ["left.base/ground"]}
        document = {"schema": 1, "name": "two", "duration": 1.0, "agents": agents}
        return scenario_from({**document, "world": world}, tmp_path)

    pair(0.41)
    with pytest.raises(ValueError, match=r"left\.base/right\.base start 0\.03 m ins"):
        pair(0.37)


def test_shapes_of_one_vehicle_that_start_in_each_other_are_refused(tmp_path):
    """Only where its own shapes touch, and with the cure."""
    vehicle = shaped(
        tmp_path,
        [
            {"shape": "sphere", "size": [0.2]},
            {"shape": "sphere", "size": [0.05], "link": "link2"},
        ],
        "hummingbird_arm2_rotors",
    )
    document = {
        "schema": 1,
        "name": "own",
        "duration": 1.0,
        "plant": {"vehicle": vehicle},
        "controller": {"preset": "paper_ct"},
        "model": {"vehicle": "hummingbird_arm2"},
        "reference": {"base": {"kind": "hover", "position": [0.0, 0.0, 1.0]}},
        "world": {"surfaces": [{"name": "ground"}]},
    }
    scenario_from(document, tmp_path)
    document["world"]["self_collision"] = True
    with pytest.raises(ValueError, match=r"base/link2 start .* world\.ignore"):
        scenario_from(document, tmp_path)
    document["world"]["ignore"] = ["base/link2"]
    scenario_from(document, tmp_path)


def test_shapes_without_a_world_are_said_to_touch_nothing(tmp_path):
    document = {
        "schema": 1,
        "name": "free",
        "duration": 1.0,
        "plant": {"vehicle": shaped(tmp_path, [OUT])},
        "controller": {"law": "decoupled_pd"},
        "reference": {"base": {"kind": "hover", "position": [0.0, 0.0, 1.0]}},
    }
    line = (
        "plant.vehicle: has shapes that touch nothing without a [world]; its surfaces?"
    )
    assert without_effect(scenario_from(document, tmp_path)) == (line,)
    assert without_effect(starting(tmp_path, 1.0)) == ()


def test_self_collision_of_one_body_is_said_to_have_no_effect(tmp_path):
    (line,) = without_effect(standing(tmp_path, "box", self_collision=True))
    assert line.startswith("world.self_collision: no two bodies of the vehicle")
