"""What stands at the start on a slope stays where it is up to the cone of friction,
from the first instant.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from skyarm.algebra import Quaternion, Vec3
from skyarm.dynamics.point_motion import PointMotion
from skyarm.plant.surroundings import Surroundings
from skyarm.world.contact import Contact, FreeObject, Material, Surface
from skyarm.world.contact.static_equilibrium import stand_vehicle, with_standing_objects
from support.cases import sampled
from support.worlds import AWAY, BIRD, GRAVITY, SKIDS, Scene, at_rest, fall


def slope(share, friction):
    angle = math.atan(share * friction)
    return angle, Surface(
        name="ground", angles=(0.0, angle, 0.0), material=Material(friction=friction)
    )


@pytest.mark.parametrize(("share", "friction"), sampled([(0.95, 0.5), (0.5, 0.3)], 2))
def test_a_standing_box_stays_where_it_is(share, friction):
    """Within 0.1 mm over 2 s, by a bristle that is bent by that share of its length
    along the slope.
    """
    angle, ground = slope(share, friction)
    box = FreeObject(
        name="box",
        size=(0.1, 0.1, 0.06),
        mass=0.1,
        standing=True,
        angles=Vec3(0.0, angle, 0.0),
        position=Vec3(0.0, 0.0, 0.0305 / math.cos(angle)),
    )
    contact = with_standing_objects(
        Contact(surfaces=(ground,), objects=(box,)), GRAVITY
    )
    motion = PointMotion(BIRD, AWAY, gravity=GRAVITY)
    memory = contact.settle(contact.start(0.005, ()), motion, False)
    bent = [np.linalg.norm([*map(float, each)]) for each in memory.bristles]
    assert sorted(bent)[-4:] == pytest.approx([share * 2e-4] * 4, rel=1e-5)
    _, rows = Scene(contact, memory=memory).fly(contact, 2.0)
    place = contact.objects[0].start().position
    assert np.abs(rows[:, 0, :3] - [*map(float, place)]).max() < 1e-4


def test_a_bristle_bends_no_further_than_its_length():
    """On a slope beyond the cone a box begins to slide with all of its friction."""
    angle, ground = slope(1.3, 0.3)
    box = FreeObject(
        name="box",
        size=(0.1, 0.1, 0.06),
        mass=0.1,
        standing=True,
        angles=Vec3(0.0, angle, 0.0),
        position=Vec3(0.0, 0.0, 0.0305 / math.cos(angle)),
    )
    rough = dataclasses.replace(ground, material=Material(friction=0.5))
    held = with_standing_objects(Contact(surfaces=(rough,), objects=(box,)), GRAVITY)
    contact = dataclasses.replace(held, surfaces=(ground,))
    memory = contact.settle(
        contact.start(0.005, ()), PointMotion(BIRD, AWAY, gravity=GRAVITY), False
    )
    bent = [np.linalg.norm([*map(float, each)]) for each in memory.bristles]
    assert sorted(bent)[-4:] == pytest.approx([2e-4] * 4, rel=1e-9)
    with pytest.raises(
        ValueError,
        match=r"object 'box': must stand where friction holds it, by .* and it slides",
    ):
        with_standing_objects(Contact(surfaces=(ground,), objects=(box,)), GRAVITY)


@pytest.mark.parametrize("share", [0.95, pytest.param(0.5, marks=pytest.mark.thorough)])
def test_a_standing_vehicle_stays_where_it_is(share):
    angle, ground = slope(share, 0.5)
    contact = Contact(surfaces=(ground,), points=SKIDS)
    above = dataclasses.replace(
        at_rest(BIRD, (0.0, 0.0, 0.13 / math.cos(angle))),
        quaternion=Quaternion(math.cos(0.5 * angle), 0.0, math.sin(0.5 * angle), 0.0),
    )
    state = stand_vehicle(BIRD, GRAVITY, contact, above)
    memory = contact.settle(
        contact.start(0.005, ()), PointMotion(BIRD, state, gravity=GRAVITY), True
    )
    rows = fall(
        BIRD, state, Surroundings(components=(contact,), memories=(memory,)), 2.0
    )
    assert np.abs(rows[:, :3] - [*map(float, state.position)]).max() < 1e-4
