"""Types of the variables in C text, the opening comment's shape, and records that mix
numbers with other things.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import pytest

from skyarm.algebra import Vec3, scalars
from skyarm.compile import trace
from skyarm.compile.c_source import Floats, StepFile, make_struct
from skyarm.records.leaves import leaves
from support.engines import c_function

DECLARED = re.compile(r"const (\w+) (v\d+) = (.*);")
VARIABLE = re.compile(r"v\d+|[01](?!\.)")


def decisions(a, b):
    """Every way to make a truth, and numbers chosen by each."""
    less, most = a < b, b <= 0.5
    one_of = scalars.where(less, most, b < a)
    truths = (less & most, less | most, scalars.logical_not(less), one_of)
    truths += (scalars.where(less, True, most), scalars.where(most, most, False))
    numbers = (
        *(scalars.where(truth, a + b, a) for truth in truths),
        scalars.where(less, 1.0, a),
    )
    return truths + numbers


def truth_of(expression, types):
    """Whether C's rules make an expression a truth: its operator says so, or the
    branches it chooses from.
    """
    if " ? " in expression:
        condition, yes, no = re.split(r" [?:] ", expression)
        assert types[condition] == "int", expression
        kinds = {
            types.get(each, "int" if each in ("0", "1") else "number") == "int"
            for each in (yes, no)
        }
        assert len(kinds) == 1, f"{expression} chooses between a truth and a number"
        return kinds.pop()
    if "&&" in expression or "||" in expression or expression.startswith("!"):
        assert all(types[name] == "int" for name in re.findall(r"v\d+", expression)), (
            expression
        )
        return True
    return " < " in expression or " <= " in expression


@pytest.mark.parametrize("single", [False, True])
def test_every_truth_is_an_int_and_every_number_a_float(single):
    text = c_function(trace(decisions, 0.25, 0.75).lowered, "p", single=single)
    types = {}
    for kind, name, expression in DECLARED.findall(text):
        types[name] = kind
        expected = (
            "int" if truth_of(expression, types) else ("float" if single else "double")
        )
        assert kind == expected, f"{kind} {name} = {expression}"
    assert list(types.values()).count("int") == 9
    assert sum(kind != "int" for kind in types.values()) == 2 + 1 + 7


@dataclass(frozen=True)
class Gain:
    k: float


@dataclass(frozen=True)
class Value:
    x: float


def step_file(name="spring"):
    program = trace(
        lambda par, given, memory: (Value(memory.x + par.k * given.x), Value(memory.x)),
        *RECORDS,
    )
    structs = {
        key: make_struct(record, "_".join, [True] * len(leaves(record)))
        for key, record in zip(
            ("parameters", "given", "memory", "output"),
            (*RECORDS, Value(0.0)),
            strict=True,
        )
    }
    return StepFile(
        name=name,
        floats=Floats(),
        program=program.lowered,
        structs=structs,
        notes=dict.fromkeys(structs, "a note"),
        inputs=("given",),
        output="output",
    )


RECORDS = (Gain(2.0), Value(0.0), Value(1.0))


def test_the_opening_comment_keeps_its_lines_as_they_stand():
    opening = ["title", "", "  joint 0: arm   ", "      deeper  still", " one\t"]
    lines = step_file().text(opening).splitlines()
    assert lines[:7] == [
        "/*",
        " * title",
        " *",
        " *   joint 0: arm",
        " *       deeper still",
        " *  one",
        " */",
    ]


@dataclass(frozen=True)
class Mixed:
    """Tuples that are no array of numbers, each in a way of its own, between two that
    are.
    """

    first: tuple = (1.0, 2.0)
    named: tuple = ("left", 3.0)
    switched: tuple = (True, 4.0)
    missing: tuple = (5.0, None)
    vectors: tuple = (6.0, Vec3(7.0, 8.0, 9.0))
    ragged: tuple = ((10.0, 11.0), (12.0,))
    uneven: tuple = (13.0, (14.0,))
    nested: tuple = (((15.0,),), ((16.0,),))
    words: tuple = (("a", 17.0), ("b", 18.0))
    truths: tuple = ((False, 19.0), (True, 20.0))
    empty: tuple = ()
    last: tuple = ((21.0, 22.0), (23.0, 24.0))


def test_a_tuple_of_more_than_numbers_is_no_array():
    """The numbers count the leaves, and each has the place that its path in the record
    says.
    """
    assert [float(leaf) for leaf in leaves(Mixed())] == [float(i) for i in range(1, 25)]
    struct = make_struct(Mixed(), lambda path: "_".join(map(str, path)), [True] * 24)
    assert struct.places == (
        *("first[0]", "first[1]", "named_1", "switched_1", "missing_0", "vectors_0"),
        *(
            "vectors_1[0]",
            "vectors_1[1]",
            "vectors_1[2]",
            "ragged_0[0]",
            "ragged_0[1]",
            "ragged_1[0]",
        ),
        *(
            "uneven_0",
            "uneven_1[0]",
            "nested_0[0][0]",
            "nested_1[0][0]",
            "words_0_1",
            "words_1_1",
        ),
        *(
            "truths_0_1",
            "truths_1_1",
            "last[0][0]",
            "last[0][1]",
            "last[1][0]",
            "last[1][1]",
        ),
    )
    values = [value for member in struct.members for value in member.values]
    assert values == [float(i) for i in range(1, 25)]
    shapes = {member.name: member.shape for member in struct.members}
    assert (
        shapes["first"],
        shapes["vectors_1"],
        shapes["last"],
        shapes["named_1"],
    ) == ((2,), (3,), (2, 2), ())


def test_a_vector_of_which_one_number_is_not_wanted_is_no_array():
    for dropped in range(3):
        keep = [i != dropped for i in range(3)]
        struct = make_struct(Vec3(1.0, 2.0, 3.0), "_".join, keep)
        assert struct.places == tuple(
            axis if kept else None for axis, kept in zip("xyz", keep, strict=True)
        )
