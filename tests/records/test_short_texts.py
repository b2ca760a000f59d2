"""Text of records and results, which a notebook prints below a cell: 300 characters at
most.
"""

from __future__ import annotations

import dataclasses
import inspect
import re
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.records.identity import identity
from skyarm.records.immutable import LONGEST, immutable, short_repr
from support.cases import whole_text
from support.logs import flown

PUBLIC = [getattr(skyarm, name) for name in skyarm.__all__]


def returned(function: Any) -> list[Any]:
    """Classes that a function may return, by its annotation."""
    named = re.findall(r"\w+", str(function.__annotations__.get("return", "")))
    return [
        function.__globals__[name]
        for name in named
        if inspect.isclass(function.__globals__.get(name))
    ]


def results() -> set[type]:
    """Public classes, what public functions and methods return, and what fields of
    these hold.
    """
    functions = [each for each in PUBLIC if inspect.isfunction(each)]
    for kind in filter(inspect.isclass, PUBLIC):
        functions += [
            each
            for name, each in inspect.getmembers(kind, inspect.isfunction)
            if not name.startswith("_")
        ]
    found = {kind for each in functions for kind in returned(each)} | set(
        filter(inspect.isclass, PUBLIC)
    )
    return {
        each
        for each in found
        if each.__module__.startswith("skyarm.") and "algebra" not in each.__module__
    }


def test_every_public_record_and_result_has_a_short_text() -> None:
    found = {kind for kind in results() if dataclasses.is_dataclass(kind)}
    named = {kind.__name__ for kind in found}
    assert {"Outcome", "Evidence", "FlightData", "Study", "Identified"} <= named
    assert {"Assessment", "Tuning", "ComparisonResults"} <= named
    own = {
        kind
        for kind in found
        if "__repr__" in vars(kind) and kind.__repr__ is not short_repr
    }
    assert own == {skyarm.Log}  # whose arrays say less than its status
    assert all(kind.__repr__ is short_repr for kind in found - own)


def test_what_a_cell_ends_with_is_short_and_says_what_it_is() -> None:
    log = flown()
    scenario = log.scenario
    for each in (
        scenario,
        scenario.agent,
        scenario.controller,
        scenario.plant.vehicle,
        scenario.environment,
        log,
    ):
        assert len(repr(each)) <= LONGEST, repr(each)
        assert repr(each).startswith(f"{type(each).__name__}(")
    assert f"status={log.status!r}" in repr(log)
    assert f"instants={log.time.size}" in repr(log)
    assert (
        len(repr(dataclasses.replace(log, info={**log.info, "scenario": "x" * 1000})))
        == LONGEST
    )


@immutable
class Held:
    """Record of anything."""

    first: Any
    second: Any = 0.5


@immutable
class Own:
    """Record with a text of its own."""

    def __repr__(self) -> str:
        return "mine"


@pytest.mark.parametrize(
    ("record", "text"),
    [
        (Held(first="a"), "Held(first='a', second=0.5)"),
        (
            Held(first=Held(first=(1,))),
            "Held(first=Held(first=(1,), second=0.5), second=0.5)",
        ),
        (Held(first=np.zeros((100, 3))), "Held(first=ndarray(...), second=0.5)"),
        (Held(first="y" * 400), "Held(first=str(...), second=0.5)"),
        (Own(), "mine"),
    ],
    ids=["whole", "nested", "array", "text", "own"],
)
def test_long_values_give_their_class_and_short_ones_stay(
    record: Any, text: str
) -> None:
    assert repr(record) == text


def test_a_record_of_very_many_fields_is_cut() -> None:
    numbers = {f"number_{i}": i for i in range(100)}
    wide = immutable(
        type("Wide", (), {"__annotations__": dict.fromkeys(numbers, int), **numbers})
    )
    assert len(repr(wide())) == LONGEST
    assert repr(wide()).startswith("Wide(number_0=0, number_1=1, ")
    assert repr(wide()).endswith("...)")


def test_two_scenarios_of_one_text_keep_two_digests() -> None:
    one = skyarm.load_scenario("case3", controller="paper_ct")
    two = dataclasses.replace(one, plant=dataclasses.replace(one.plant, gravity=9.7))
    assert repr(one) == repr(two)
    assert identity(one) != identity(two)
    assert one != two
    assert whole_text(one) != whole_text(two)


def test_a_text_of_just_the_largest_length_keeps_its_value() -> None:
    record = Held(first="")
    whole = Held(first="y" * (LONGEST - len(repr(record))))
    assert len(repr(whole)) == LONGEST == 300
    assert repr(whole).count("y") == LONGEST - len(repr(record))
