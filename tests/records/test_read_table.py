"""A record's annotations are read once: by its table in a file, by the check where it
is made, by comments.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import pytest

import skyarm
from skyarm.algebra.scalars import Scalar
from skyarm.records.coerce import RecordError
from skyarm.records.field_rules import accept_fields
from skyarm.records.files import Fields
from skyarm.records.read_table import entry_of, options_from, record_from
from skyarm.records.units import Unit, units


@dataclass(frozen=True)
class Spring:
    stiffness: Annotated[Scalar, Unit("N/m", low=0.0)]


@dataclass(frozen=True)
class Tether:
    spring: Spring
    anchor: Annotated[skyarm.Vec3, Unit("m", "world axes")]
    length: Annotated[float, Unit("m", "at rest", low=0.0)] | None = None
    turns: int = 1

    def __post_init__(self) -> None:
        accept_fields(self, "tether")


@dataclass(frozen=True)
class Own(skyarm.Force):
    """Force that is not registered."""


TABLE = {"spring": {"stiffness": 3}, "anchor": [0, 1.5, 2]}


def test_a_table_is_read_by_the_annotations_units_or_not() -> None:
    tether = record_from(
        Tether, Fields({**TABLE, "length": 2, "turns": 4.0}, "forces[0]")
    )
    assert tether == Tether(Spring(3.0), skyarm.Vec3(0.0, 1.5, 2.0), 2.0, 4)
    assert record_from(Tether, Fields(TABLE, "forces[0]")).length is None


def test_a_zero_is_data_unless_its_field_folds() -> None:
    made, read = (
        Tether(Spring(3.0), [0, 0.0, 2]),
        record_from(Tether, Fields(TABLE, ""), folds=True),
    )  # type: ignore[arg-type]
    assert [type(each) for tether in (made, read) for each in tether.anchor] == [
        float
    ] * 6


def test_an_entry_is_read_back_and_a_class_that_no_file_can_name_has_none() -> None:
    tether = Tether(Spring(3.0), skyarm.Vec3(0.0, 1.5, 2.0), turns=4)
    assert entry_of(tether) == {
        "spring": {"stiffness": 3.0},
        "anchor": [0.0, 1.5, 2.0],
        "turns": 4,
    }
    assert record_from(Tether, Fields(entry_of(tether), "")) == tether
    with pytest.raises(TypeError, match=r"^Own is registered under no name$"):
        entry_of(Own())


def test_the_unit_of_an_option_of_a_union_is_the_field_s() -> None:
    assert {name: unit.words for name, unit in units(Tether).items()} == {
        "anchor": "m, world axes",
        "length": "m, at rest",
    }
    with pytest.raises(
        RecordError, match=r"^tether\.length = -1\.0: must be at least 0$"
    ):
        Tether(Spring(1.0), skyarm.Vec3(0.0, 0.0, 0.0), -1.0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"length": "long"}, "forces[0].length = 'long': must be a finite number"),
        ({"turns": 1.5}, "forces[0].turns = 1.5: must be a whole number"),
        ({"anchor": [1, 2]}, "forces[0].anchor = [1, 2]: must be three numbers"),
        (
            {"spring": {"stiffness": 1, "colour": 2}},
            "forces[0].spring.colour = 2: unknown field",
        ),
    ],
)
def test_what_an_annotation_does_not_allow_is_named(
    change: dict[str, object], words: str
) -> None:
    with pytest.raises(ValueError) as error:  # noqa: PT011
        record_from(Tether, Fields({**TABLE, **change}, "forces[0]"))
    assert str(error.value).startswith(words)


@dataclass(frozen=True)
class Lost:
    mass: Nowhere = 0.0  # type: ignore[name-defined]  # noqa: F821


def test_an_annotation_that_cannot_be_found_is_one_line() -> None:
    with pytest.raises(
        ValueError,
        match=(
            r"^forces\[0\]\.mass: the annotation of this field names a type that cannot"
        ),
    ):
        record_from(Lost, Fields({"mass": 1.0}, "forces[0]"))


def test_options_of_a_function_are_read_by_the_same_rules() -> None:
    def lemniscate(
        size: Annotated[float, Unit("m")], turns: int = 2, *, level=0.0
    ) -> None: ...  # type: ignore[no-untyped-def]

    assert options_from(
        lemniscate, Fields({"size": 2, "turns": 3, "level": 1}, "reference")
    ) == {
        "size": 2.0,
        "turns": 3,
        "level": 1.0,
    }
