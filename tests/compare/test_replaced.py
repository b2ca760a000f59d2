"""A folder that holds another comparison's report is told from one that holds this comparison's."""

from __future__ import annotations

import dataclasses
import json

import pytest

from skyarm.compare.comparison import Comparison
from skyarm.compare.entrants import ENTRANTS
from skyarm.compare.overwrites import replaced
from skyarm.compare.suite import conditions


def comparison(laws=("paper_ct", "centroidal_tip"), flown=("perfect", "plants"), plants=5, **more):
    every = conditions(plants, 2)
    return Comparison(
        entrants={name: ENTRANTS[name] for name in laws}, conditions={name: every[name] for name in flown}, **more
    )


@pytest.fixture
def stored(tmp_path):
    """Of paper_ct and centroidal_tip, perfect and on five wrong plants."""
    flights = {"perfect": 1, "plants": 5}
    summaries = {
        name: {"case3_wind": {law: {"episodes": count} for law in ("paper_ct", "centroidal_tip")}}
        for name, count in flights.items()
    }
    file = tmp_path / "results.json"
    file.write_text(json.dumps({"seed": 0, "plant": "rigid_body", "summaries": summaries}))
    return file


def test_the_same_comparison_replaces_nothing(stored):
    assert replaced(comparison(), stored) == []


def test_another_comparison_says_what_the_stored_one_was_of(stored):
    assert replaced(comparison(laws=("paper_ct",)), stored) == ["laws centroidal_tip, paper_ct"]
    assert replaced(comparison(flown=("perfect",)), stored) == ["conditions perfect, plants"]
    assert replaced(comparison(plants=8), stored) == ["plants of 5 flights"]
    assert replaced(comparison(seed=1), stored) == ["seed 0"]
    assert replaced(dataclasses.replace(comparison(), plant="mujoco", one_by_one=5), stored) == ["plant rigid_body"]


@pytest.mark.parametrize("content", [None, "{", "[]", '{"summaries": 1}', '{"summaries": {"perfect": {}}, "seed": 0}'])
def test_a_file_of_something_else_says_nothing(tmp_path, content):
    file = tmp_path / "results.json"
    if content is not None:
        file.write_text(content)
    assert replaced(comparison(), file) == []
