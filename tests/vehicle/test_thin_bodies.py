"""Bodies without a moment of inertia about one axis: joints that turn about it move
nothing, others do.
"""

from __future__ import annotations

import numpy as np
import pytest

from skyarm.algebra import Sym3, Vec3
from skyarm.dynamics import array_front as arrays
from skyarm.vehicle import Body, Joint, Link, Vehicle, mobility

BASE = Body(mass=2.0, inertia=Sym3(0.02, 0.03, 0.04))
ALONG = {"x": Sym3(0, 1e-3, 1e-3), "y": Sym3(1e-3, 0, 1e-3), "z": Sym3(1e-3, 1e-3, 0)}
AXES = {"x": Vec3(1, 0, 0), "y": Vec3(0, 1, 0), "z": Vec3(0, 0, 1)}


@pytest.mark.parametrize("rod", ALONG)
@pytest.mark.parametrize("turned", AXES)
def test_a_thin_rod_cannot_turn_about_itself_and_about_nothing_else_is_that_said(
    rod, turned
):
    """The mass matrix is singular exactly where the rod turns about its own axis."""
    body = Body(mass=0.5, inertia=ALONG[rod], planar=True)
    joint = Joint(name="spin", axis=AXES[turned])
    links = (Link(name="rod", parent=-1, joint=joint, body=body),)
    try:
        vehicle = Vehicle(name="thin", base=BASE, links=links)
    except ValueError as error:
        assert rod == turned, error
        assert "spin" in str(error)
        return
    assert rod != turned
    assert mobility.immobile(vehicle) is None
    M = arrays.mass_matrix(vehicle, np.zeros(3), [1.0, 0.0, 0.0, 0.0], [0.3])
    assert np.linalg.cond(M) < 1e6


@pytest.mark.parametrize("base_mass", [1e-6, 0.9, 1e6, 9e8])
@pytest.mark.parametrize("link_mass", [1e-9, 0.04, 1.0])
def test_solid_bodies_move_mass_whatever_their_masses_are_beside_each_other(
    base_mass, link_mass
):
    """Nothing is eliminated to rounding there: a body with mass and inertia moves
    them.
    """
    links = (
        Link(
            name="arm",
            parent=-1,
            joint=Joint(name="a"),
            body=Body(
                mass=link_mass, com=Vec3(0, 0, -0.1), inertia=Sym3(1e-5, 1e-5, 1e-5)
            ),
        ),
    )
    vehicle = Vehicle(
        name="solid",
        base=Body(
            mass=base_mass, com=Vec3(0.01, 0, 0.02), inertia=Sym3(0.02, 0.03, 0.04)
        ),
        links=links,
    )
    assert mobility.immobile(vehicle) is None
