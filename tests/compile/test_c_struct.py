"""Records as C structs: arrays where a field is whole, members of their own where
structure is folded away.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import pytest

from skyarm.algebra import Mat3, Quaternion, Sym3, Vec3
from skyarm.compile.c_source import (
    Floats,
    comment,
    declaration,
    initialiser,
    make_struct,
)
from skyarm.records.leaves import leaves
from skyarm.records.units import Unit


@dataclass(frozen=True)
class Inner:
    mass: Annotated[float, Unit("kg")]
    com: Annotated[Vec3, Unit("m")]


@dataclass(frozen=True)
class Outer:
    name: str
    gains: Annotated[Vec3, Unit("N")]
    attitude: Quaternion
    parts: tuple[Inner, ...]
    rows: tuple[tuple[float, ...], ...]
    turn: Mat3
    moments: Sym3
    empty: tuple[float, ...] = ()
    count: int = 3


RECORD = Outer(
    name="x",
    gains=Vec3(1.0, 2.0, 3.0),
    attitude=Quaternion(4.0, 5.0, 6.0, 7.0),
    parts=(Inner(8.0, Vec3(0, 9.0, 0)), Inner(10.0, Vec3(11.0, 12.0, 13.0))),
    rows=((14.0, 15.0, 16.0), (17.0, 18.0, 19.0)),
    turn=Mat3(Vec3(20.0, 21.0, 22.0), Vec3(23.0, 24.0, 25.0), Vec3(26.0, 27.0, 28.0)),
    moments=Sym3(29.0, 0, 30.0),
)


def name(path):
    return "_".join(map(str, path))


def made(keep=None):
    return make_struct(RECORD, name, keep or [True] * len(leaves(RECORD)))


def test_every_leaf_has_the_place_of_its_value():
    """The numbers of the record count its leaves, so a place that is out of order
    shows.
    """
    struct = made()
    assert [float(leaf) for leaf in leaves(RECORD)] == [float(i) for i in range(1, 31)]
    assert struct.places == (
        *(
            "gains[0]",
            "gains[1]",
            "gains[2]",
            "attitude[0]",
            "attitude[1]",
            "attitude[2]",
            "attitude[3]",
        ),
        *(
            "parts_0_mass",
            "parts_0_com_y",
            "parts_1_mass",
            "parts_1_com[0]",
            "parts_1_com[1]",
            "parts_1_com[2]",
        ),
        *(
            "rows[0][0]",
            "rows[0][1]",
            "rows[0][2]",
            "rows[1][0]",
            "rows[1][1]",
            "rows[1][2]",
        ),
        *(f"turn[{i}][{j}]" for i in range(3) for j in range(3)),
        *("moments_xx", "moments_zz"),
    )


def test_declaration_and_values_follow_the_same_order():
    struct = made()
    text = declaration("s", struct, Floats())
    assert text.startswith(
        "struct s {\n    double gains[3]; /* N */\n    double attitude[4];\n"
    )
    assert (
        "    double parts_0_mass; /* kg */\n    double parts_0_com_y; /* m */\n" in text
    )
    assert (
        "    double rows[2][3];\n    double turn[3][3];\n    double moments_xx;\n"
        in text
    )
    values = initialiser(struct, Floats())
    assert "    {1.0, 2.0, 3.0}, /* gains */\n" in values
    assert "    {{14.0, 15.0, 16.0}, {17.0, 18.0, 19.0}}, /* rows */\n" in values
    assert values.index("/* parts_0_com_y */") < values.index("/* parts_1_mass */")


def test_a_unit_that_is_another_here_stands_in_the_comment():
    struct = make_struct(
        RECORD, name, [True] * 30, {("parts", "1"): {"mass": Unit("g", "of this law")}}
    )
    assert [member.note for member in struct.members if "mass" in member.name] == [
        "kg",
        "g, of this law",
    ]


def test_a_leaf_nobody_wants_has_no_member():
    keep = [True] * 30
    keep[1] = keep[7] = False
    struct = made(keep)
    assert struct.places[:3] == ("gains_x", None, "gains_z")
    assert struct.places[7] is None
    assert "parts_0_mass" not in declaration("s", struct, Floats())


def test_no_member_at_all_is_a_reserved_one():
    struct = make_struct((), name, [])
    assert "double reserved;" in declaration("s", struct, Floats())
    assert initialiser(struct, Floats()) == "{0.0}"


def test_two_fields_of_one_name_are_refused():
    with pytest.raises(ValueError, match="share the names \\['same'\\]"):
        make_struct(RECORD, lambda path: "same", [True] * 30)


@pytest.mark.parametrize(
    "text",
    [
        "a */ b",
        "/* x",
        "a **/ b",
        "/*/",
        "??/",
        "end \\",
        "two\nlines",
        "\u00e9",
        "*//*",
    ],
)
def test_no_text_ends_or_opens_a_comment(text):
    safe = comment(text)
    assert safe.isascii()
    assert safe.isprintable()
    for bad in ("*/", "/*", "?", "\\"):
        assert bad not in safe
