"""Results of pure functions are kept by the content of records, in which 0, 0.0, -0.0
and False differ.
"""

import dataclasses
import math
from collections import Counter
from enum import Enum
from typing import NamedTuple

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.records.content import content, keep_results
from skyarm.records.members import Members
from skyarm.scenario.scenario_checks import begin
from skyarm.scenario.scenario_record import first_state


class Side(Enum):
    LEFT = "left"


class Row(NamedTuple):
    length: float
    count: int


def test_equal_records_of_other_kinds_have_another_content():
    keys = {content(Vec3(1.0, 2.0, each)) for each in (0, 0.0, -0.0, False)}
    assert len(keys) == 4
    assert content(Vec3(1.0, 2.0, math.nan)) == content(Vec3(1.0, 2.0, math.nan))
    assert content((1.0, 2.0)) != content([1.0, 2.0])
    assert content("1.0") != content(1.0)
    assert content(Members(("a",), (1.0,))) != content({"a": 1.0})
    assert content({"a": 1.0}) != content({"b": 1.0})
    assert content((Side.LEFT, len.__class__, content)) == content(
        (Side.LEFT, len.__class__, content)
    )


def test_a_vehicle_read_anew_has_the_content_of_the_first():
    given, other = (skyarm.load_vehicle("hummingbird_arm2") for _ in range(2))
    moved = dataclasses.replace(
        other, base=dataclasses.replace(other.base, mass=other.base.mass + 1e-15)
    )
    assert content(given) == content(other) != content(moved)


def test_a_vehicle_is_walked_once_and_a_row_has_its_own_class():
    given = skyarm.load_vehicle("hummingbird_arm2")
    assert content(given) is content(given) is not content(dataclasses.replace(given))
    assert content(Row(1.0, 2)) == content(Row(1.0, 2)) != content((1.0, 2))


def test_a_number_that_python_does_not_write_is_computed_each_time():
    calls = []
    keep_results(2)(calls.append)(10**5000)
    keep_results(2)(calls.append)(10**5000)
    assert len(calls) == 2


@pytest.mark.parametrize(
    "value", [np.float64(1.0), np.zeros(2), object(), Vec3(1.0, 2.0, np.zeros(3))]
)
def test_arrays_and_objects_have_none(value):
    with pytest.raises(TypeError, match="has no content"):
        content(value)


def test_a_result_is_kept_for_the_content_of_its_arguments():
    calls = Counter()

    @keep_results(2)
    def length(vector: Vec3) -> object:
        calls[vector.x] += 1
        if vector.x == 0.0:
            raise ValueError("of no length")
        return vector.norm() if isinstance(vector.x, float) else None

    assert length(Vec3(3.0, 4.0, 0.0)) is length(Vec3(3.0, 4.0, 0.0))
    assert calls == {3.0: 1}
    assert length(Vec3(3.0, 4.0, 0)) == 5.0
    assert calls == {3.0: 2}
    for _ in range(2):
        with pytest.raises(ValueError, match="of no length"):
            length(Vec3(0.0, 4.0, 0.0))
    assert calls[0.0] == 2


def test_the_start_is_met_once_by_file_check_and_flight(monkeypatch):
    given = skyarm.load_scenario("slide_circle")
    met = []
    monkeypatch.setattr(
        "skyarm.world.contact.initial_world.require_start_outside",
        lambda *given: met.append(given[0]),
    )
    own = dataclasses.replace(
        given,
        initial=dataclasses.replace(first_state(given), position=Vec3(0.0, 0.0, 1.25)),
    )
    begin(own)
    begin(own)
    begin(dataclasses.replace(own, seed=own.seed + 1))
    assert len(met) == 1
    begin(
        dataclasses.replace(
            own, initial=dataclasses.replace(own.initial, position=Vec3(0.0, 0.0, 1.5))
        )
    )
    assert len(met) == 2
