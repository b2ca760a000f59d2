"""Flights that touch: both plants, engines, logs, endings, starts at rest, files and what they refuse."""

from __future__ import annotations

import copy
import dataclasses
import tomllib
from pathlib import Path

import numpy as np
import pytest

import skyarm
from skyarm.log.log_columns import columns
from skyarm.scenario.scenario_file import scenario_from

EXAMPLES = Path(__file__).parents[2] / "examples"


def document(name):
    return tomllib.loads((EXAMPLES / f"{name}.toml").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def press():
    """The tip meets the wall 0.2 s after the start."""
    found = document("press_a_wall")
    found["duration"] = 0.7
    found["reference"]["base"]["x"] = {"kind": "sequence", "start": 0.0, "segments": [[0.3, 0.03]]}
    found["world"]["surfaces"][0]["position"][0] = 0.268
    return found


@pytest.fixture(scope="module")
def pressed(press):
    return skyarm.run(scenario_from(press))


def test_the_tip_is_stopped_by_the_wall_and_the_log_says_how_strongly(pressed):
    assert pressed.status == "completed"
    force, friction, depth = pressed.contact_force[:, 0], pressed.contact_friction[:, 0], pressed.contact_depth[:, 0]
    assert 1.0 < force.max() < 20.0
    assert depth == pytest.approx(np.maximum(pressed.tip[:, 0] - 0.218, 0.0), abs=1e-9)
    still = (depth > 1e-4) & (np.abs(np.gradient(pressed.tip[:, 0], pressed.time)) < 0.01)
    assert still.sum() > 5
    assert force[still] == pytest.approx(5000.0 * depth[still], rel=0.03)
    assert (friction <= 0.3 * force + 1e-12).all()
    assert friction.max() > 0.1
    assert (force[depth == 0.0] < 0.1).all()
    assert np.abs(pressed.wind_force).max() == 0.0, "contact is no wind"


def test_columns_are_named_by_surface_and_point_and_files_keep_them(pressed, tmp_path):
    named = {each.name: each for each in columns(pressed)}
    for word, unit in (("force", "N"), ("friction", "N"), ("depth", "m")):
        assert named[f"contact_{word}_wall_tip"].unit == unit
    again = skyarm.load_log(pressed.save_npz(tmp_path / "a.npz"))
    assert np.array_equal(again.contact_force, pressed.contact_force)
    assert again.scenario.contact == pressed.scenario.contact


def test_both_plants_fly_the_same(press, pressed):
    """To a micrometre and a millinewton after half a second of touches at other steps: 1.67 and 1 ms."""
    theirs = skyarm.run(scenario_from(press, replaced={"plant": "mujoco"}))
    assert np.abs(theirs.position - pressed.position).max() < 2e-5
    assert theirs.contact_force[-20:] == pytest.approx(pressed.contact_force[-20:], abs=0.02)


def test_python_floats_and_a_batch_fly_the_same_bits(press, pressed):
    short = {**press, "duration": 0.35}
    scenario = scenario_from(short)
    slow = skyarm.run(scenario, engine="reference")
    assert np.array_equal(slow.contact_force, pressed.contact_force[: len(slow.time)])
    assert np.array_equal(slow.position, pressed.position[: len(slow.time)])
    assert slow.contact_force.max() > 0.5
    stiffness = np.array([2000.0, 5000.0])
    batch = skyarm.Batch(scenario, ["world.surfaces.wall.material.stiffness"], every=1, bit_exact=True)
    flown = batch.run({"world.surfaces.wall.material.stiffness": stiffness})
    print(flown)
