"""Cases left to the nightly run: what they reach is reached by others, and no mutant
needs them.
"""

from __future__ import annotations

import json

import mutation_record
import nightly_cases
import pytest


def case(name, seconds, *functions):
    return mutation_record.Test(
        name=name,
        seconds=seconds,
        functions=frozenset(functions),
        collected=frozenset(),
    )


F, G = "skyarm/log/ranges.py:5", "skyarm/log/ranges.py:50"
CASES = [
    case("tests/log/test_a.py::test_slow", 9.0, F),
    case("tests/log/test_a.py::test_quick", 1.0, F),
    case("tests/log/test_b.py::test_other", 2.0, F),
    case("tests/log/test_b.py::test_last", 0.1, F),
    case("tests/log/test_b.py::test_alone", 5.0, F, G),
    case("tests/log/test_b.py::test_of_g", 0.1, G),
]


def test_the_slowest_case_goes_whose_functions_are_reached_by_others():
    assert nightly_cases.spared(CASES, (), 0.5) == ["tests/log/test_a.py::test_slow"]


def test_cases_go_until_the_share_of_the_seconds_is_left():
    assert nightly_cases.spared(CASES, (), 0.45) == [
        "tests/log/test_a.py::test_slow",
        "tests/log/test_b.py::test_other",
    ]
    assert nightly_cases.spared(CASES, (), 1.0) == []


def test_what_first_saw_a_mutant_stays():
    assert "tests/log/test_a.py::test_slow" not in nightly_cases.spared(
        CASES, {"tests/log/test_a.py::test_slow"}, 0.0
    )


def test_the_last_two_of_a_function_stay():
    assert "tests/log/test_b.py::test_alone" not in nightly_cases.spared(CASES, (), 0.0)
    left = [
        each for each in CASES if each.name not in nightly_cases.spared(CASES, (), 0.0)
    ]
    assert sum(F in each.functions for each in left) >= nightly_cases.OTHERS


def test_the_last_two_of_the_own_room_stay():
    other = [case(f"tests/view/test_{i}.py::test_x", 0.1, F) for i in range(9)]
    left = [
        each
        for each in CASES
        if each.name not in nightly_cases.spared([*CASES, *other], (), 0.0)
    ]
    assert sum(F in each.functions for each in left) >= nightly_cases.OTHERS


@pytest.mark.parametrize("file", ["tests/project/test_a.py", "tests/log/test_kept.py"])
def test_files_that_always_run_stay(file):
    cases = [
        *CASES,
        case(f"{file}::test_one", 20.0, F),
        case(f"{file}::test_two", 20.0, F),
    ]
    assert not any(
        file in name
        for name in nightly_cases.spared(cases, (), 0.0, ["tests/log/test_kept.py"])
    )


def test_names_are_added_to_those_that_are_nightly_already(tmp_path):
    budget = tmp_path / "budget.json"
    budget.write_text(
        json.dumps({"tests/b.py": {"seconds": 1.0, "nightly": ["test_x"]}})
    )
    assert (
        nightly_cases.write_nightly(
            budget, ["tests/b.py::test_y[a::b]", "tests/a.py::TestOf::test_z"]
        )
        == 3
    )
    table = json.loads(budget.read_text())
    assert list(table) == ["tests/a.py", "tests/b.py"]
    assert table["tests/a.py"]["nightly"] == ["test_z"]
    assert table["tests/b.py"] == {
        "seconds": 1.0,
        "nightly": ["test_x", "test_y[a::b]"],
    }
