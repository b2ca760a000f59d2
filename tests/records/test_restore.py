"""A record that was written as plain data is read back the same to the last bit, or
refused in one line.
"""

from __future__ import annotations

import dataclasses
import functools
import json
import math
import os
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.control.catalogue import AUTOPILOTS, LAWS
from skyarm.control.laws.paper import hybrid_computed_torque
from skyarm.control.safety import with_safety_layer
from skyarm.records.plain import plain
from skyarm.records.restore import restore
from skyarm.studies.compare.suite import PAPER_CASES
from support.cases import sampled, whole_text


def written(value: Any) -> Any:
    return json.loads(json.dumps(plain(value), allow_nan=False))


@pytest.mark.parametrize("name", PAPER_CASES)
@pytest.mark.parametrize(
    "law", sampled([None, *LAWS, *AUTOPILOTS], 5, keep=tuple(AUTOPILOTS))
)
def test_every_scenario_under_every_law_is_read_back(
    name: str, law: str | None
) -> None:
    scenario = skyarm.load_scenario(name, controller=law)
    again = restore(written(scenario))
    assert again == scenario
    assert written(again) == written(scenario)


def test_a_guarded_law_is_read_back() -> None:
    scenario = skyarm.load_scenario("case1")
    scenario = dataclasses.replace(
        scenario, controller=with_safety_layer(scenario.controller, stow=(0.1, 0.2))
    )
    assert written(restore(written(scenario))) == written(scenario)


def test_floats_integers_and_texts_stay_what_they_are() -> None:
    value = (
        0,
        0.0,
        -0.0,
        1,
        1.0,
        math.inf,
        -math.inf,
        0.1,
        True,
        None,
        "nan",
        "inf",
        {"type": 2.0},
        {"a": (1,)},
    )
    again = restore(written(value))
    assert [whole_text(each) for each in again] == [whole_text(each) for each in value]
    assert math.isnan(restore(written(math.nan)))


@pytest.mark.parametrize("kind", ["float64", "float32", "int64", "bool"])
def test_arrays_are_read_back_with_their_kind(kind: str) -> None:
    value = np.array([[0.1, 2.0], [3.0, -0.0]]).astype(kind)
    again = restore(written(value))
    assert again.dtype == value.dtype
    np.testing.assert_array_equal(again, value)


def test_partial_functions_of_laws_are_read_back() -> None:
    again = restore(
        written(functools.partial(hybrid_computed_torque, Vec3(1.0, 2.0, 3.0), dt=0.1))
    )
    assert again.func is hybrid_computed_torque
    assert (again.args, again.keywords) == ((Vec3(1.0, 2.0, 3.0),), {"dt": 0.1})


@dataclass(frozen=True)
class Unregistered:
    x: float = 1.0


def closed_over(x: float) -> Any:
    return lambda t: x * t


def of(name: str, /, **fields: Any) -> dict[str, Any]:
    return {"type": name, **fields}


WRONG: list[tuple[Any, str]] = [
    (
        of("skyarm.algebra.vector:Vec3", x=1.0, y=2.0),
        "was written by another version (z)",
    ),
    (
        of("skyarm.algebra.vector:Vec3", x=1.0, y=2.0, z=3.0, w=4.0),
        "was written by another version (w)",
    ),
    (of("skyarm.algebra.vector:Vector", x=1.0), "is not there any more"),
    (of("skyarm.algebra.vectors:Vec3", x=1.0), "is not there any more"),
    (of("Vec3", x=1.0, y=2.0, z=3.0), "nothing of this module is registered here"),
    (of("builtins:dict"), "nothing of this module is registered here"),
    (of("skyarm.simulate.session:Session"), "is no frozen dataclass"),
    (of("skyarm.compile.llvm.llvm_text:Writer"), "is no frozen dataclass"),
    (of("skyarm.control.controller:Command"), "is no frozen dataclass"),
    (
        of("skyarm.scenario.scenario_record:Rates", physics=0, control=1, reference=1),
        "rates.physics = 0",
    ),
    (of("function", name="os:system"), "nothing of this module is registered here"),
    (
        of("function", name="skyarm.records.files.writing:write_atomically"),
        "must be a function of a law",
    ),
    (
        of("function", name="skyarm.control.controller:os.system"),
        "is not there any more",
    ),
    (
        of("function", name="skyarm.control.controller:replace"),
        "is another function than was written",
    ),
    (
        of(
            "partial",
            function=of("function", name="os:system"),
            arguments=["true"],
            keywords={},
        ),
        "nothing of this",
    ),
    (of("function"), "must be a record that was written"),
    (
        of("array", kind="object", entries=[1]),
        "kind = 'object': must be one of float64",
    ),
    (of("array", kind="float64", entries=["x"]), "could not convert"),
    (
        of("enum", **{"class": "skyarm.algebra.vector:Vec3", "name": "x"}),
        "must be an enum",
    ),
    (of("text"), "must be a record that was written"),
    ({"type": 3}, "must be a name"),
    (written(Unregistered()), "nothing of this module is registered here"),
    (written(closed_over(2.0)), "was made inside a function"),
]


@pytest.mark.parametrize(
    ("data", "reason"), WRONG, ids=[str(i) for i in range(len(WRONG))]
)
def test_what_is_no_record_is_refused_in_one_line(data: Any, reason: str) -> None:
    for whole in (data, [1.0, {"a": data}]):
        with pytest.raises(ValueError, match=r"^[^\n]*$") as error:
            restore(whole)
        assert reason in str(error.value)


def test_reading_a_record_runs_nothing_that_it_names(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    called: list[Any] = []
    monkeypatch.setattr(os, "system", called.append)
    for name in (
        "os:system",
        "skyarm.records.registry.plugins:os.system",
        "subprocess:call",
    ):
        with pytest.raises(ValueError, match=r"must be|registered|any more"):
            restore(of(name, command="true"))
        with pytest.raises(ValueError, match=r"must be|registered|any more"):
            restore(of("function", name=name))
    assert not called
