"""A vehicle that is not the paper's planar arm is refused by the field in which it
differs, one field at a time.
"""

from __future__ import annotations

import dataclasses

import pytest

from skyarm.algebra import Mat3, Sym3, Vec3
from skyarm.vehicle.vehicle_files import load_vehicle
from support import euler_lagrange as el

PAPER = load_vehicle("hummingbird_arm2")


def body(change, index):
    """The paper's vehicle with another body of a link."""
    links = list(PAPER.links)
    links[index] = dataclasses.replace(
        links[index], body=dataclasses.replace(links[index].body, **change)
    )
    return dataclasses.replace(PAPER, links=tuple(links))


def joint(change, index):
    links = list(PAPER.links)
    links[index] = dataclasses.replace(
        links[index], joint=dataclasses.replace(links[index].joint, **change)
    )
    return dataclasses.replace(PAPER, links=tuple(links))


def off(vector, axis, by=1e-6):
    return dataclasses.replace(vector, **{axis: float(getattr(vector, axis)) + by})


def heavier(index, **entries):
    """Other moments and products of inertia, kg m^2, beside I_yy."""
    held = {
        "xx": 0.0,
        "yy": 7.5e-5,
        "zz": 0.0,
        "xy": 0.0,
        "xz": 0.0,
        "yz": 0.0,
    } | entries
    return body({"inertia": Sym3.from_numbers(*held.values())}, index)


TURNED = Mat3(Vec3(0, 0, 1), Vec3(0, 1, 0), Vec3(-1, 0, 0))
CASES = {
    **{
        f"base com {axis}": (
            dataclasses.replace(
                PAPER,
                base=dataclasses.replace(PAPER.base, com=off(PAPER.base.com, axis)),
            ),
            "base.com",
        )
        for axis in "xyz"
    },
    **{
        f"joint 1 at {axis}": (
            joint({"position": off(PAPER.links[0].joint.position, axis)}, 0),
            "joint 1 position",
        )
        for axis in "xyz"
    },
    **{
        f"joint 2 at {axis}": (
            joint({"position": off(PAPER.links[1].joint.position, axis)}, 1),
            "joint 2 position.x and .y",
        )
        for axis in "xy"
    },
    **{
        f"com of link {i + 1}, {axis}": (
            body({"com": off(PAPER.links[i].body.com, axis)}, i),
            f"link '{PAPER.links[i].name}' com.x and .y",
        )
        for i in range(2)
        for axis in "xy"
    },
    # products that small pass for rounding of a body without the moments that go with
    # them
    **{
        f"inertia of link {i + 1}, {entry}": (
            heavier(i, **{entry: 1e-12}),
            f"link '{PAPER.links[i].name}' inertia.zz, .xy, .xz, .yz",
        )
        for i in range(2)
        for entry in ("zz", "xy", "xz", "yz")
    },
    "inertia of link 1, xx": (
        heavier(0, xx=1e-9),
        f"link '{PAPER.links[0].name}' inertia.xx",
    ),
    **{
        f"{name} of joint {i + 1}": (
            joint({name: value}, i),
            f"joint '{PAPER.links[i].joint.name}'",
        )
        for i in range(2)
        for name, value in (
            ("kind", "prismatic"),
            ("axis", Vec3(0, -1, 0)),
            ("rotation", TURNED),
        )
    },
    "parent of link 2": (
        dataclasses.replace(
            PAPER,
            links=(PAPER.links[0], dataclasses.replace(PAPER.links[1], parent=-1)),
        ),
        "parent of link",
    ),
    "one joint": (
        dataclasses.replace(PAPER, links=PAPER.links[:1], frames=(), end_effector=""),
        "1 joints, allowed 2",
    ),
}


def test_the_papers_own_vehicle_is_taken():
    el.parameters_of(PAPER)


@pytest.mark.parametrize("case", CASES)
def test_what_the_formulas_leave_out_is_refused_by_its_name(case):
    """A micrometre, or 1e-12 kg m^2, is enough: the formulas have no place for it at
    all.
    """
    vehicle, words = CASES[case]
    with pytest.raises(
        ValueError, match=r"^vehicle 'hummingbird_arm2' is not the paper's planar arm: "
    ) as caught:
        el.parameters_of(vehicle)
    assert words in str(caught.value)
