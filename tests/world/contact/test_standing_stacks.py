"""Objects that stand on each other are set down one after the other, from below."""

from __future__ import annotations

import math

import pytest

from skyarm.algebra import Vec3
from skyarm.world.contact import Contact, FreeObject, Material, Surface
from skyarm.world.contact.static_equilibrium import with_standing_objects

G = 9.8
GROUND = Surface(name="ground", material=Material(stiffness=4000.0))


def box(name, side, mass, x, z, **numbers):
    return FreeObject(
        name=name,
        size=(side, side, 0.05),
        mass=mass,
        position=Vec3(x, 0.0, z),
        standing=True,
        **numbers,
    )


LOWER = box("lower", 0.2, 0.3, 0.0, 0.03)
UPPER = box(
    "upper",
    0.06,
    0.15,
    0.02,
    0.085,
    com=Vec3(0.004, 0.002, 0.0),
    angles=Vec3(0.0, 0.0, 0.4),
)
ALONE = box("alone", 0.1, 0.2, 3.0, 0.03)


def settled(*objects):
    return with_standing_objects(Contact(surfaces=(GROUND,), objects=objects), G)


@pytest.mark.thorough
def test_a_stack_that_falls_stays_as_its_objects_were_set_down():
    """Each stands for itself; the lower one does not with the upper one at its edge,
    which leans as the lever says.
    """
    narrow = FreeObject(
        name="narrow",
        size=(0.02, 0.02, 0.1),
        mass=0.01,
        position=Vec3(0.0, 0.0, 0.051),
        standing=True,
    )
    heavy = box("heavy", 0.2, 3.0, 0.009, 0.13, com=Vec3(-0.0, 0.0, 0.0))
    contact = settled(narrow, heavy)
    assert [each.name for each in contact.objects] == ["narrow", "heavy"]
    assert all(abs(float(each.angles.x)) < 0.1 for each in contact.objects)
    # four corners of 5000 N/m, 0.01 m from the middle, and friction across them
    leaning = 0.009 * 3.0 * G / (4.0 * 5000.0 * 0.01**2)
    assert math.tan(float(contact.objects[1].angles.y)) == pytest.approx(
        leaning, rel=1e-4
    )


@pytest.mark.parametrize("gap", [-1e-3, 0.0, 1e-3])
def test_a_stack_is_set_down_from_below_in_any_order_and_from_any_distance(gap):
    """Exactly on each other, a millimetre inside or above: the lower one is not in the
    way of the upper one's place.
    """
    low, high = (
        box("low", 0.2, 0.3, 0.0, 0.03),
        box("high", 0.06, 0.15, 0.02, 0.08 + gap),
    )
    one, other = settled(low, high), settled(high, low)
    for name, i, j in (("low", 0, 1), ("high", 1, 0)):
        assert one.objects[i].name == other.objects[j].name == name
        assert tuple(one.objects[i].position) == pytest.approx(
            tuple(other.objects[j].position), abs=1e-9
        )
    assert float(one.objects[1].position.z) == pytest.approx(0.075, abs=1e-3), (
        "on the lower one, not below it"
    )
