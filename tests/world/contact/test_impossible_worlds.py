"""Worlds that no flight can begin in: numbers that leave no steps, bodies inside each other, weights that sink in."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from skyarm.algebra import Vec3
from skyarm.world.contact import Contact, FreeObject, Material, Surface
from skyarm.world.contact.initial_world import require_places_apart, require_steps_to_fly
from skyarm.world.contact.mechanism import Mechanism
from skyarm.world.contact.static_equilibrium import with_standing_objects
from skyarm.world.contact.surface import rotation_of

PERIOD, GRAVITY = 0.005, 9.81
BOX = FreeObject(name="box", size=(0.1, 0.08, 0.06), mass=0.2, position=Vec3(0.3, 0.2, 1.0), angles=Vec3(0.2, 0.1, 0.7))
GROUND = Surface(name="ground")
TURN = Vec3(0.5, -0.4, 0.3)
OUTSIDE = Vec3(0.307, 0.205, 1.0) + rotation_of(TURN).column(2) * 0.3
"""Angles and middle of a rod of 1 m that goes through the box, m."""


@pytest.mark.parametrize(
    ("world", "part"),
    [(Contact(surfaces=(GROUND,), objects=(replace(BOX, mass=1e-9),)), "the mass of 'box'"),
     (Contact(surfaces=(GROUND,), objects=(replace(BOX, mass=1e-300),)), "it"),
     (Contact(surfaces=(replace(GROUND, material=Material(stiffness=1e25)),), objects=(BOX,)), "the mass of 'box'"),
     (Contact(surfaces=(replace(GROUND, material=Material(stiffness=1e25)),)), "the material of surface 'ground'")],
)  # fmt: skip
def test_a_part_that_leaves_no_steps_is_named(world, part):
    words = "has no integration steps" if part == "it" else f"{part} asks for integration steps of"
    with pytest.raises(ValueError, match=f"^world: {words}.* must leave them 5e-06 s"):
        require_steps_to_fly(world, PERIOD / 1000)


@pytest.mark.parametrize(
    ("numbers", "apart"),
    [({}, False),
     ({"size": (0.005, 0.005, 1.0), "position": OUTSIDE, "angles": TURN}, False),
     ({"shape": "cylinder", "size": (0.02, 0.4)}, False),
     ({"shape": "cylinder", "size": (0.003, 1.0), "position": OUTSIDE, "angles": TURN}, False),
     ({"shape": "sphere", "size": (0.2,)}, False),
     ({"angles": Vec3(0.0, 0.0, 0.0), "position": Vec3(0.3, 0.2, 1.055)}, False),
     ({"position": Vec3(0.3, 0.2, 1.09)}, True),
     ({"position": Vec3(0.3, 0.2, 5.0)}, True)],
)  # fmt: skip
def test_bodies_that_cross_are_refused_though_no_corner_is_inside(numbers, apart):
    """In either order: a thin rod through a box is seen by its own places, the box by those of what is around it."""
    other = replace(BOX, name="other", **numbers)
    for pair in ((BOX, other), (other, BOX)):
        world = Contact(objects=pair)
        if apart:
            require_places_apart(world, GRAVITY, 2.0)
            continue
        with pytest.raises(ValueError, match=r"^world: .* starts inside .*, both are at \[.*\] m: must start outside"):
            require_places_apart(world, GRAVITY, 2.0)


def test_a_body_in_a_mechanism_is_refused_and_one_as_deep_as_weights_press_is_not():
    button = Mechanism(name="button", kind="button", size=(0.03, 0.02), mass=0.1, position=Vec3(0.3, 0.2, 1.0))
    with pytest.raises(ValueError, match="'button' starts inside 'box'"):
        require_places_apart(Contact(objects=(BOX,), mechanisms=(button,)), GRAVITY, 2.0)
    handle = Surface(name="handle", shape="box", size=(0.005, 0.005, 1.0), angles=TURN)
    slide = Mechanism(name="slide", kind="slide", mass=0.1, axis=Vec3(1.0, 0.0, 0.0), position=OUTSIDE, parts=(handle,))
    with pytest.raises(ValueError, match="'handle' starts inside 'box'"):
        require_places_apart(Contact(objects=(BOX,), mechanisms=(slide,)), GRAVITY, 2.0)
    level = replace(BOX, angles=Vec3(0.0, 0.0, 0.0))
    above = replace(level, name="above", position=Vec3(0.3, 0.2, 1.055))  # 5 mm, of which the lattice sees 1.8
    for mass, gravity in ((20.0, GRAVITY), (0.2, 500.0)):
        require_places_apart(Contact(objects=(replace(level, mass=mass), above)), gravity, 2.0)


def test_a_part_beside_the_axis_of_a_turned_mechanism_is_looked_for_where_it_is():
    """A plate 0.3 m out along x of axes that are turned by 90 degrees: out along y of the world, thin across x."""
    plate = Surface(name="plate", shape="box", size=(0.2, 0.004, 0.2), position=Vec3(0.3, 0.0, 0.0))
    turned = Mechanism(
        name="slide", kind="slide", mass=0.1, axis=Vec3(1.0, 0.0, 0.0), position=Vec3(0.3, -0.1, 1.0),
        angles=Vec3(0.0, 0.0, 1.5707963267948966), parts=(plate,),
    )  # fmt: skip
    require_places_apart(
        Contact(objects=(replace(BOX, position=Vec3(0.3, -0.4, 1.0)),), mechanisms=(turned,)), GRAVITY, 2.0
    )
    with pytest.raises(
        ValueError, match=r"'plate' starts inside 'box', both are at \[0\.(29|3)\d*, 0\.\d+, (0\.9|1\.0)\d*\]"
    ):
        require_places_apart(Contact(objects=(BOX,), mechanisms=(turned,)), GRAVITY, 2.0)


@pytest.mark.parametrize(("mass", "thick"), [(1e300, None), (60.0, 0.02)])
def test_what_is_too_heavy_to_stand_is_told_its_mass_at_once(monkeypatch, mass, thick):
    """On a ground it sinks in by half its height; through a thin plate it falls."""
    under = GROUND if thick is None else replace(GROUND, shape="box", size=(2.0, 2.0, thick))
    box = replace(BOX, mass=mass, standing=True, angles=Vec3(0.0, 0.0, 0.0))
    looks, meetings = [], Contact.meet
    monkeypatch.setattr(Contact, "meet", lambda *given: looks.append(1) or meetings(*given))
    with pytest.raises(ValueError, match=r"^world.objects\[0\].mass = .*: must be about \S+ kg or less") as error:
        with_standing_objects(Contact(surfaces=(under,), objects=(box,)), GRAVITY)
    assert len(looks) < 250
    monkeypatch.undo()
    bound = float(re.search(r"about (\S+) kg", str(error.value))[1])
    depth = 0.03 if thick is None else 0.5 * thick
    assert 0.8 * 4.0 * 5000.0 * depth / GRAVITY < bound < 1.15 * 4.0 * 5000.0 * depth / GRAVITY
    if thick is not None:
        with_standing_objects(Contact(surfaces=(under,), objects=(replace(box, mass=0.8 * bound),)), GRAVITY)
