"""Names that go on a path inside a record: fields, components by letter and number,
items by number and name.
"""

from __future__ import annotations

from dataclasses import dataclass

from skyarm.algebra import Quaternion, Vec3
from skyarm.records.path_names import path_names
from skyarm.scenario.scenario_record import Rates


@dataclass(frozen=True)
class Item:
    name: object
    mass: float = 1.0


def test_components_have_their_letter_and_their_number() -> None:
    assert path_names(Vec3(1.0, 2.0, 3.0)) == {
        name: ((name[0],),) for name in "xyz"
    } | {str(i): ((name,),) for i, name in enumerate("xyz")}
    assert path_names(Quaternion(1.0, 0.0, 0.0, 0.0))["3"] == (("z",),)


def test_fields_of_other_records_have_no_numbers() -> None:
    assert path_names(Rates()) == {
        name: ((name,),) for name in ("physics", "control", "reference")
    }


def test_items_have_their_number_and_a_name_that_is_theirs_alone() -> None:
    names = path_names((Item("left"), Item("right"), Item("right"), Item(3)))
    assert names == {**{str(i): ((str(i),),) for i in range(4)}, "left": (("0",),)}
