"""Of several mistakes in a vehicle's file the misspelt field is told first; rotations
off square about any axis.
"""

from __future__ import annotations

import itertools
import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skyarm.algebra import Mat3, Sym3, Vec3
from skyarm.vehicle import Body, Frame, Joint, Link, Vehicle, VehicleError, mobility
from skyarm.vehicle.check import TOLERANCE
from skyarm.vehicle.vehicle_files import load_vehicle
from support.cases import toml_text

BODY = {"mass": 1.0, "inertia": [0.01, 0.01, 0.01]}
ROTOR = {
    "name": "front",
    "position": [0.1, 0.0, 0.0],
    "direction": "ccw",
    "thrust_coefficient": 1e-5,
    "moment_coefficient": 0.01,
}
LINK = {
    "name": "arm",
    "parent": "base",
    **BODY,
    "joint": {"name": "j", "axis": [0.0, 1.0, 0.0]},
}
WHOLE = {
    "schema": 1,
    "name": "v",
    "base": BODY,
    "links": [LINK],
    "rotors": [ROTOR],
    "frames": [{"name": "tip"}],
}


def renamed(table, old, new):
    """The table with a field under another name, in its old place and at the end."""
    swapped = {new if key == old else key: value for key, value in table.items()}
    return swapped, {
        **{key: value for key, value in table.items() if key != old},
        new: table[old],
    }


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def read(document):
    Path("v.toml").write_text(toml_text(document), encoding="utf-8")
    return load_vehicle("v.toml")


def message(document):
    with pytest.raises(VehicleError) as error:
        read(document)
    return str(error.value).removeprefix("v.toml: ")


def test_the_document_of_these_tests_is_right():
    assert read(WHOLE).name == "v"


@pytest.mark.parametrize(
    ("where", "old", "new"),
    [
        ((), "name", "nam"),
        ((), "schema", "scheme"),
        (("base",), "mass", "mas"),
        (("links", 0), "joint", "joints"),
        (("links", 0), "parent", "parents"),
        (("links", 0, "joint"), "axis", "axes"),
        (("links", 0, "joint"), "name", "nam"),
        (("rotors", 0), "direction", "directions"),
        (("frames", 0), "name", "names"),
    ],
)
def test_a_misspelt_field_is_told_before_the_one_that_is_missing_for_it(
    where, old, new
):
    def placed(table, at, value):
        if not at:
            return value
        first, *rest = at
        if isinstance(table, list):
            return [
                placed(each, rest, value) if i == first else each
                for i, each in enumerate(table)
            ]
        return {**table, first: placed(table[first], rest, value)}

    inner = WHOLE
    for step in where:
        inner = inner[step]
    for table in renamed(inner, old, new):
        text = message(placed(WHOLE, where, table))
        place, words = text.split(": ", 1)
        missing = place.split(".")[-1] == old and words.startswith(
            f"is missing; is '{new}' a misspelling of it? there are "
        )
        assert missing or re.match(
            rf".*{new} = .*: unknown field; (did you mean '\w+'\? )?allowed: ", text
        )


def test_a_field_that_is_missing_is_said_to_be_so_and_shows_no_table():
    nameless = {key: value for key, value in WHOLE.items() if key != "name"}
    assert message(nameless).startswith("name: is missing; there are base, ")
    bare = {key: value for key, value in ROTOR.items() if key != "direction"}
    assert message(WHOLE | {"rotors": [bare]}).startswith(
        "rotors[front].direction: is missing; there are "
    )


SOLID = Body(mass=2.0, inertia=Sym3(0.02, 0.02, 0.02))


def fixed(R):
    """A vehicle with a joint, and one with a frame, that stand so."""
    rows = Mat3(*(Vec3(*map(float, row)) for row in R))
    yield lambda: Vehicle(
        name="v",
        base=SOLID,
        links=(
            Link(name="a", parent=-1, joint=Joint(name="j", rotation=rows), body=SOLID),
        ),
    )
    yield lambda: Vehicle(
        name="v",
        base=SOLID,
        frames=(Frame(name="tip", link=-1, position=Vec3(0, 0, 0), rotation=rows),),
    )


TURNS = [np.eye(3), *Rotation.random(3, random_state=5).as_matrix()]
PAIRS = list(itertools.permutations(range(3), 2))


@pytest.mark.parametrize("turn", range(len(TURNS)))
@pytest.mark.parametrize(("moved", "towards"), PAIRS)
def test_rows_of_a_rotation_are_square_to_each_other_pair_by_pair(moved, towards, turn):
    """One row leans towards another, either way, and keeps its length: three
    milliradians change the volume by 5e-6.
    """
    for lean in (3e-3, -3e-3):
        R = TURNS[turn].copy()
        R[moved] = math.cos(lean) * R[moved] + math.sin(lean) * R[towards]
        for make in fixed(R):
            with pytest.raises(
                VehicleError, match=r"\.rotation = .*must be a rotation"
            ):
                make()
    # within the rounding of published numbers it stands
    R = TURNS[turn].copy()
    R[moved] = R[moved] + TOLERANCE * R[towards]
    for make in fixed(R):
        make()


@pytest.mark.parametrize("turn", range(len(TURNS)))
@pytest.mark.parametrize("row", range(3))
def test_a_mirror_is_refused_whichever_row_it_turns_around(row, turn):
    R = TURNS[turn].copy()
    R[row] = -R[row]
    for make in fixed(R):
        with pytest.raises(VehicleError, match=r"\.rotation = .*determinant \+1"):
            make()
    swapped = TURNS[turn][[1, 0, 2]]
    for make in fixed(swapped):
        with pytest.raises(VehicleError, match=r"\.rotation = .*determinant \+1"):
            make()


@pytest.mark.parametrize("row", range(3))
def test_rows_of_a_rotation_have_unit_length(row):
    for factor in (1.0 + 1e-4, 1.0 - 1e-4):
        R = np.eye(3)
        R[row] *= factor
        for make in fixed(R):
            with pytest.raises(VehicleError, match="must be a rotation"):
                make()


def test_joints_are_tried_at_zero_and_at_two_values_apart_from_it_and_each_other():
    """The search for joints without mass looks where symmetry hides none: no joint
    within 0.2 of zero or of another.
    """
    free = Joint(name="j")
    assert [mobility._joint_value(free, 0, index) for index in range(30)] == [0.0] * 30
    for turn in (1, 2):
        tried = [mobility._joint_value(free, turn, index) for index in range(30)]
        assert min(tried) >= 0.2
        assert max(tried) <= 1.2 < 0.5 * math.pi, (
            "beyond a right angle sines begin to repeat"
        )
        assert len({round(value, 6) for value in tried}) == 30
        other = [mobility._joint_value(free, 3 - turn, index) for index in range(30)]
        assert min(abs(a - b) for a, b in zip(tried, other, strict=True)) > 0.1
