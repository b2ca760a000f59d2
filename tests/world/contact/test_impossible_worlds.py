"""Worlds that no flight can begin in: numbers that leave no steps, weights that sink
in.
"""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from skyarm.algebra import Vec3
from skyarm.world.contact import (
    Contact,
    FreeObject,
    Material,
    Surface,
    static_equilibrium,
)
from skyarm.world.contact.meetings import meetings_of
from skyarm.world.contact.static_equilibrium import with_standing_objects

PERIOD, GRAVITY = 0.005, 9.81
BOX = FreeObject(
    name="box",
    size=(0.1, 0.08, 0.06),
    mass=0.2,
    position=Vec3(0.3, 0.2, 1.0),
    angles=Vec3(0.2, 0.1, 0.7),
)
GROUND = Surface(name="ground")


@pytest.mark.parametrize(
    ("world", "part"),
    [
        (
            Contact(surfaces=(GROUND,), objects=(replace(BOX, mass=1e-9),)),
            "the mass of 'box'",
        ),
        (Contact(surfaces=(GROUND,), objects=(replace(BOX, mass=1e-300),)), "it"),
        (
            Contact(
                surfaces=(replace(GROUND, material=Material(stiffness=1e11)),),
                objects=(BOX,),
            ),
            "the mass of 'box'",
        ),
        (
            Contact(surfaces=(replace(GROUND, material=Material(stiffness=1e11)),)),
            "the material of surface 'ground'",
        ),
    ],
)
def test_a_part_that_leaves_no_steps_is_named(world, part):
    words = (
        "has no integration steps"
        if part == "it"
        else f"{part} asks for integration steps of"
    )
    with pytest.raises(ValueError, match=f"^world: {words}.* must leave them 5e-06 s"):
        world.require_steps(PERIOD / 1000)


@pytest.mark.parametrize(("mass", "thick"), [(9e8, None), (60.0, 0.02)])
def test_what_is_too_heavy_to_stand_is_told_its_mass_at_once(monkeypatch, mass, thick):
    """On a ground it sinks in by half its height; through a thin plate it falls."""
    under = (
        GROUND
        if thick is None
        else replace(GROUND, shape="box", size=(2.0, 2.0, thick))
    )
    box = replace(BOX, mass=mass, standing=True, angles=Vec3(0.0, 0.0, 0.0))
    looks = []
    monkeypatch.setattr(
        static_equilibrium,
        "meetings_of",
        lambda *given: looks.append(1) or meetings_of(*given),
    )
    with pytest.raises(
        ValueError, match=r"^world.objects\[0\].mass = .*: must be about \S+ kg or less"
    ) as error:
        with_standing_objects(Contact(surfaces=(under,), objects=(box,)), GRAVITY)
    assert len(looks) < 250
    monkeypatch.undo()
    bound = float(re.search(r"about (\S+) kg", str(error.value))[1])
    depth = 0.03 if thick is None else 0.5 * thick
    assert (
        0.8 * 4.0 * 5000.0 * depth / GRAVITY
        < bound
        < 1.15 * 4.0 * 5000.0 * depth / GRAVITY
    )
    if thick is not None:
        with_standing_objects(
            Contact(surfaces=(under,), objects=(replace(box, mass=0.8 * bound),)),
            GRAVITY,
        )
