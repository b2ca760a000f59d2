"""How far a vehicle is set down, from where, and how exactly it then stands."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skyarm.algebra import Vec3
from skyarm.dynamics.point_motion import PointMotion
from skyarm.world.contact import Contact, Surface
from skyarm.world.contact.static_equilibrium import stand_vehicle
from support.worlds import GRAVITY, SKIDS, at_rest, limp

BIRD = limp()
DEEP = float(BIRD.mass) * GRAVITY / 4.0 / 5000.0
"""m, into which four skids are pressed."""


def set_down(height, points=SKIDS, **ground):
    contact = Contact(surfaces=(Surface(name="ground", **ground),), points=points)
    return contact, stand_vehicle(BIRD, GRAVITY, contact, at_rest(BIRD, (0.3, 0.0, height)))


@pytest.mark.parametrize("above", [-0.049, 0.5, pytest.param(2.99, marks=pytest.mark.thorough)])
def test_it_comes_from_five_centimetres_above_and_three_metres_down(above):
    assert set_down(0.12 + above)[1].position.z == pytest.approx(0.12 - DEEP, abs=1e-9)


@pytest.mark.parametrize(
    ("above", "words"), [(-0.051, "5 cm above"), pytest.param(3.01, "within 3 m below", marks=pytest.mark.thorough)]
)
def test_beyond_that_it_is_refused(above, words):
    with pytest.raises(ValueError, match=words):
        set_down(0.12 + above)


def test_it_stands_on_a_slope_with_neither_force_nor_moment_left():
    """Skids of two lengths: what they carry is the weight, at the centre of mass, to 1e-10 of it."""
    uneven = (dataclasses.replace(SKIDS[0], position=Vec3(0.1, 0.1, -0.1201)), *SKIDS[1:])
    contact, state = set_down(0.3, points=uneven)
    motion, weight = PointMotion(BIRD, state), float(BIRD.mass) * GRAVITY
    touches = contact.on_points(contact.start(0.005, ()), motion)
    forces = np.array([float(touch.force.z) for touch in touches])
    places = np.array([[float(c) for c in motion.position(point.position)] for point in uneven])
    assert forces.sum() == pytest.approx(weight, rel=1e-10)
    middle = np.array([*state.position])
    assert forces @ (places - middle)[:, :2] == pytest.approx([0.0, 0.0], abs=1e-10 * weight)
    assert forces.max() > 1.1 * forces.min(), "it rocks on its long skid"


def test_on_two_skids_it_tips_over():
    with pytest.raises(ValueError, match="tips over"):
        set_down(0.2, points=SKIDS[:2])
