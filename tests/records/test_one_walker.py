"""Places, parts, pairs and leaves of records agree."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

import skyarm
from skyarm.control.catalogue import LAWS, make_controller, rescale
from skyarm.control.controller import ControllerError
from skyarm.control.model import Model
from skyarm.records.leaves import (
    as_data,
    is_leaf,
    is_record_class,
    leaves,
    mismatch,
    named_leaves,
    pairs,
    part,
    parts,
    replace_at,
    walk,
)
from skyarm.records.path_names import NumberView, below
from skyarm.records.units import Unit


@dataclass(frozen=True)
class Inner:
    gain: float
    count: int = 2


@dataclass(frozen=True)
class Outer:
    rows: tuple[tuple[float, ...], ...]
    inner: tuple[Inner, ...]
    name: str = "x"


RECORD = Outer(((1.0, 2.0), (3.0,)), (Inner(4.0), Inner(5.0)))


def test_every_scalar_has_a_place_that_leads_to_it() -> None:
    found = list(walk(RECORD))
    assert [place for place, _ in found] == [
        *(("rows", "0", "0"), ("rows", "0", "1"), ("rows", "1", "0")),
        *(
            ("inner", "0", "gain"),
            ("inner", "0", "count"),
            ("inner", "1", "gain"),
            ("inner", "1", "count"),
        ),
        ("name",),
    ]
    assert [part(RECORD, place) for place, _ in found] == [value for _, value in found]
    assert (
        [value for _, value in found if is_leaf(value)]
        == leaves(RECORD)
        == [1.0, 2.0, 3.0, 4.0, 5.0]
    )


@pytest.mark.parametrize("law", LAWS)
def test_leaves_of_every_law_have_the_order_of_their_places(law: str) -> None:
    par = make_controller(
        law, Model(vehicle=skyarm.load_vehicle("hummingbird_arm2"))
    ).par
    found = [value for _, value in walk(par) if is_leaf(value)]
    assert all(a is b for a, b in zip(found, leaves(par), strict=True))
    assert all(
        a is b for a, (_, b) in zip(found, named_leaves(par, "par"), strict=True)
    )


def test_names_of_leaves_read_like_python() -> None:
    assert [name for name, _ in named_leaves(RECORD)] == [
        *("rows[0][0]", "rows[0][1]", "rows[1][0]", "inner[0].gain", "inner[1].gain")
    ]
    assert [name for name, _ in named_leaves((1.0,), "memory")] == ["memory[0]"]


def test_data_are_the_same_record_with_floats_for_integers_alone() -> None:
    found = as_data(Outer(((1, -2.5), ()), (Inner(0),)))
    assert found == Outer(((1.0, -2.5), ()), (Inner(0.0, 2.0),))
    assert leaves(found) == [1.0, -2.5, 0.0, 2.0]
    assert as_data((True, None, "x", 3)) == (True, None, "x", 3.0)
    assert [type(each) for each in as_data((True, 3))] == [bool, float]


def test_parts_are_fields_or_items_and_nothing_of_a_scalar() -> None:
    assert list(parts(RECORD)) == ["rows", "inner", "name"]
    assert parts(RECORD.rows) == {"0": (1.0, 2.0), "1": (3.0,)}
    assert parts(1.0) == parts("text") == parts(Outer) == {}


def test_pairs_need_the_same_class_and_as_many_items() -> None:
    other = Outer(((1.0, 2.0),), (Inner(4.0), Inner(6.0)))
    assert [path for _, _, path in pairs(RECORD, other, "r") or ()] == [
        "r.rows",
        "r.inner",
        "r.name",
    ]
    assert pairs(RECORD.rows, other.rows, "r") is None
    assert pairs(RECORD, RECORD.inner[0], "r") is None
    assert (
        mismatch(RECORD, other, "r")
        == "r.rows is ((1.0, 2.0),), not ((1.0, 2.0), (3.0,))"
    )
    assert mismatch(RECORD.inner, other.inner, "r") is None


def test_only_what_stands_at_the_places_is_replaced() -> None:
    changed = replace_at(RECORD, {("rows", "1", "0"): 9.0, ("inner", "0"): Inner(8.0)})
    assert changed == Outer(((1.0, 2.0), (9.0,)), (Inner(8.0), Inner(5.0)))
    assert changed.inner[1] is RECORD.inner[1]
    assert replace_at(RECORD, {(): changed}) is changed


def test_names_of_a_part_lead_there_from_the_record_that_holds_it() -> None:
    angle = NumberView("roll", Unit("rad"), ("attitude",))
    assert below(
        ("state",), {"x": (("p", "x"), ("q",)), "roll": angle, "of": {"y": (("y",),)}}
    ) == {
        "x": (("state", "p", "x"), ("state", "q")),
        "roll": NumberView("roll", Unit("rad"), ("state", "attitude")),
        "of": {"y": (("state", "y"),)},
    }


@pytest.mark.parametrize(
    "path",
    ["gains.positions", "gains.position.w", "nothing", "joint_gains.stiffness.2"],
)
def test_a_tuned_constant_that_is_not_there_is_named(path: str) -> None:
    controller = make_controller(
        "decoupled_pd", Model(vehicle=skyarm.load_vehicle("hummingbird_arm2"))
    )
    with pytest.raises(
        ControllerError, match=rf"^controller\.{path}: the law has no such constant$"
    ):
        rescale(controller, {path: 2.0})
    changed = rescale(
        controller, {"joint_gains.stiffness.1": 2.0, "gains.position": 3.0}
    ).par
    assert (
        changed.joint_gains.stiffness[1]
        == 2.0 * controller.par.joint_gains.stiffness[1]
    )
    assert changed.joint_gains.stiffness[0] == controller.par.joint_gains.stiffness[0]
    assert list(changed.gains.position) == [
        3.0 * each for each in controller.par.gains.position
    ]


def test_a_dataclass_is_a_class_of_records_and_neither_a_number_nor_a_record_is() -> (
    None
):
    kinds = Outer, Inner, int, tuple[Inner, ...], RECORD, "Inner", None
    assert [is_record_class(kind) for kind in kinds] == [True, True, *[False] * 5]


def test_a_number_in_place_of_a_record_or_of_a_text_is_a_mismatch() -> None:
    for example, other in ((1.5, "x"), ("x", 1.5), (Inner(4.0), 1.5), (1.5, (1.0,))):
        assert mismatch(example, other, "r") == f"r is {other!r}, not {example!r}"
    assert mismatch(1.5, 2.5, "r") is None
