"""Bodies that carry a gripper or a grasp do not touch what these hold."""

from __future__ import annotations

from typing import Any

import pytest

from skyarm.scenario.scenario_file import scenario_from
from support.flights import document
from support.shaped import shaped

CRATES = [
    {
        "name": name,
        "shape": "box",
        "size": [0.1, 0.1, 0.1],
        "mass": 0.1,
        "position": [3.0, y, 0.05],
    }
    for name, y in (("crate", 0.0), ("other", 1.0))
]

EVERY = {f"{a}/{b}" for a in ("base", "link2") for b in ("crate", "other")}


def pairs(
    folder: Any, airframe: str = "hummingbird_arm2_rotors", **world: Any
) -> set[str]:
    """Names of pairs with objects, of a vehicle with a ball at base and tip."""
    shapes = [
        {"shape": "sphere", "size": [0.02], "link": link} for link in ("base", "link2")
    ]
    made = document("case1", endings=[])
    made["plant"] |= {"vehicle": shaped(folder, shapes, airframe)}
    made["world"] = {
        "surfaces": [{"name": "ground", "position": [0.0, 0.0, -2.0]}],
        "objects": CRATES,
        **world,
    }
    (contact,) = scenario_from(made, folder).worlds
    names = {each.name for each in contact.body_pairs}
    assert {"base/ground", "link2/ground"} <= names
    return {each for each in names if not each.endswith("/ground")}


def test_a_body_with_a_gripper_touches_no_object_that_it_may_take(tmp_path):
    assert pairs(tmp_path) == EVERY
    grippers = [{"name": "magnet", "kind": "magnet"}]
    assert pairs(tmp_path, grippers=grippers) == {"base/crate", "base/other"}
    named = [{"name": "magnet", "kind": "magnet", "frame": "tip"}]
    assert pairs(tmp_path, grippers=named) == {"base/crate", "base/other"}


@pytest.mark.parametrize("frame", ["", "tip"])
def test_a_body_with_a_grasp_touches_all_but_the_body_of_the_grasp(tmp_path, frame):
    away = {**CRATES[0], "position": [0.0, 0.0, 0.5]}
    grasps = [{"body": "crate", "frame": frame, "kind": "cable", "length": 5.0}]
    found = pairs(tmp_path, objects=[away, CRATES[1]], grasps=grasps)
    assert found == EVERY - {"link2/crate"}
