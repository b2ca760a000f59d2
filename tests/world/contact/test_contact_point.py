"""Where points of a vehicle are: beside a frame, on a ring about it; and rings that are
refused.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from skyarm.algebra import Mat3, Vec3
from skyarm.scenario.scenario_file import scenario_from
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.world.contact import Contact, ContactPoint, Surface
from skyarm.world.contact.contact_point import Ring

BIRD = load_vehicle("hummingbird_arm2")
TURNED = Mat3.columns(Vec3(0, 0, -1), Vec3(0, 1, 0), Vec3(1, 0, 0))
"""A frame's z axis along the x axis of its link."""


def with_turned_tip():
    (tip,) = BIRD.frames
    return dataclasses.replace(
        BIRD, frames=(dataclasses.replace(tip, rotation=TURNED),)
    )


def test_a_position_beside_a_frame_is_in_the_axes_of_the_frame():
    point = ContactPoint(name="p", frame="tip", position=Vec3(0.01, 0.02, 0.03))
    place, body = point.place(with_turned_tip())
    assert ([*place], body) == (pytest.approx([0.03, 0.02, -0.15 - 0.01]), 1)
    assert [*ContactPoint(name="p", frame="tip").place(with_turned_tip())[0]] == [
        0.0,
        0.0,
        -0.15,
    ]


def test_a_ball_without_a_radius_is_a_point_by_structure():
    radius = ContactPoint(name="p", frame="tip", radius=0.0).radius
    assert (radius, type(radius)) == (0, int)


def test_a_ring_is_points_on_a_circle_across_the_z_axis():
    peg = ContactPoint(
        name="peg", frame="tip", radius=0.001, ring=Ring(radius=0.01, count=6)
    )
    contact = Contact(surfaces=(Surface(name="ground"),), points=(peg,))
    assert [each.name for each in contact.points] == [f"peg_{i}" for i in range(1, 7)]
    assert {(each.radius, each.ring) for each in contact.points} == {(0.001, None)}
    assert contact.on({"": BIRD}) == contact
    places = np.array(
        [[*each.place(with_turned_tip())[0]] for each in contact.points], dtype=float
    )
    middle = np.array([0.0, 0.0, -0.15])
    assert np.linalg.norm(places - middle, axis=1) == pytest.approx(np.full(6, 0.01))
    assert (places - middle) @ [1.0, 0.0, 0.0] == pytest.approx(np.zeros(6), abs=1e-15)
    assert places[0] - middle == pytest.approx([0.0, 0.0, -0.01])
    assert places.mean(axis=0) == pytest.approx(middle)
    assert [len(Ring(radius=0.01, count=count).offsets()) for count in (3, 64)] == [
        3,
        64,
    ]
    turn = math.pi / 3.0
    assert places[1] - middle == pytest.approx(
        [0.0, 0.01 * math.sin(turn), -0.01 * math.cos(turn)]
    )


@pytest.mark.parametrize(
    ("ring", "words"),
    [
        ({"radius": 0.01, "count": 2}, "count = 2: must be at least 3"),
        ({"radius": 0.01, "count": 65}, "at most 64"),
        ({"radius": 0.0, "count": 4}, "radius = 0.0: must be above 0"),
        ({"radius": 0.01}, "count: is missing"),
        ({"radius": 0.01, "count": 4.5}, "count = 4.5"),
        (4, "ring"),
    ],
)
def test_rings_that_cannot_be_are_refused(ring, words):
    world = {
        "surfaces": [{"name": "g"}],
        "points": [{"name": "peg", "frame": "tip", "ring": ring}],
    }
    top = {
        "schema": 1,
        "name": "a",
        "duration": 1.0,
        "plant": {"vehicle": "hummingbird_arm2"},
        "controller": {"preset": "paper_ct"},
    }
    with pytest.raises(ValueError, match=words):
        scenario_from({**top, "world": world})
