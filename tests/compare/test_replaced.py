"""A folder that holds another bench's report is told from one that holds this bench's."""

from __future__ import annotations

import dataclasses
import json

import pytest

from skyarm.compare.entrants import ENTRANTS
from skyarm.compare.replaced import replaced
from skyarm.compare.results import Bench
from skyarm.compare.suite import conditions


def bench(laws=("paper_ct", "exact_ee"), flown=("perfect", "plants"), plants=5, **more):
    every = conditions(plants, 2)
    return Bench(
        entrants={name: ENTRANTS[name] for name in laws}, conditions={name: every[name] for name in flown}, **more
    )


@pytest.fixture
def stored(tmp_path):
    """Of paper_ct and exact_ee, perfect and on five wrong plants."""
    flights = {"perfect": 1, "plants": 5}
    summaries = {
        name: {"case3_wind": {law: {"episodes": count} for law in ("paper_ct", "exact_ee")}}
        for name, count in flights.items()
    }
    file = tmp_path / "results.json"
    file.write_text(json.dumps({"seed": 0, "plant": "rigid_body", "summaries": summaries}))
    return file


def test_the_same_bench_replaces_nothing(stored):
    assert replaced(bench(), stored) == []


def test_another_bench_says_what_the_stored_one_was_of(stored):
    assert replaced(bench(laws=("paper_ct",)), stored) == ["laws exact_ee, paper_ct"]
    assert replaced(bench(flown=("perfect",)), stored) == ["conditions perfect, plants"]
    assert replaced(bench(plants=8), stored) == ["plants of 5 flights"]
    assert replaced(bench(seed=1), stored) == ["seed 0"]
    assert replaced(dataclasses.replace(bench(), plant="mujoco", single=5), stored) == ["plant rigid_body"]


@pytest.mark.parametrize("content", [None, "{", "[]", '{"summaries": 1}', '{"summaries": {"perfect": {}}, "seed": 0}'])
def test_a_file_of_something_else_says_nothing(tmp_path, content):
    file = tmp_path / "results.json"
    if content is not None:
        file.write_text(content)
    assert replaced(bench(), file) == []
