"""The elimination that looks for joints without mass, against the mass matrix of the
dynamics.
"""

import numpy as np
import pytest

from skyarm.algebra import Mat3, Sym3, Vec3
from skyarm.dynamics import array_front as arrays
from skyarm.vehicle import (
    Body,
    Joint,
    Link,
    Vehicle,
    VehicleError,
    description,
    mobility,
)

SOLID = Body(
    mass=2.0,
    com=Vec3(0.01, -0.02, 0.03),
    inertia=Sym3(0.02, 0.03, 0.04, 0.001, 0.002, -0.003),
)
POINT = [1.0, 2.0, 3.0]


def random_vehicle(seed, n):
    rng = np.random.default_rng(seed)
    links = []
    for i in range(n):
        joint = Joint(
            name=f"j{i}",
            kind=("revolute", "prismatic")[rng.integers(2)],
            axis=description.unit_axis("axis", rng.normal(size=3).tolist()),
            position=Vec3(*rng.uniform(-0.2, 0.2, 3).tolist()),
            rotation=description.rotation_rpy(rng.uniform(-3, 3, 3).tolist()),
        )
        body = Body(
            mass=float(rng.uniform(0.1, 1.0)),
            com=Vec3(*rng.uniform(-0.1, 0.1, 3).tolist()),
            inertia=Sym3(*rng.uniform(1e-3, 1.5e-3, 3).tolist(), 1e-4, -1e-4, 2e-4),
        )
        links.append(
            Link(name=f"l{i}", parent=int(rng.integers(-1, i)), joint=joint, body=body)
        )
    return Vehicle(name="random", base=SOLID, links=tuple(links))


@pytest.mark.parametrize("seed", range(10))
def test_the_mass_matrix_is_that_of_the_dynamics(seed):
    n = 1 + seed % 6
    vehicle = random_vehicle(seed, n)
    joints = np.random.default_rng(seed + 50).uniform(-1, 1, n)
    wanted = arrays.mass_matrix(vehicle, np.zeros(3), [1.0, 0.0, 0.0, 0.0], joints)
    # the mass matrix of the dynamics begins with translation
    swap = [3, 4, 5, 0, 1, 2, *range(6, 6 + n)]
    found, _ = mobility.mass_matrix(vehicle, joints.tolist())
    np.testing.assert_allclose(found, wanted[np.ix_(swap, swap)], rtol=0, atol=1e-12)


@pytest.mark.parametrize("reach", [0.1, 0.037, 1.7, 33.3])
def test_a_point_on_a_slanted_axis_is_refused_though_rounding_leaves_some_inertia(
    reach,
):
    axis = description.unit_axis("axis", POINT)
    body = Body(mass=0.3, com=Vec3(*(reach * c for c in POINT)))
    with pytest.raises(VehicleError, match=r"joints\[j\]"):
        Vehicle(
            name="v",
            base=SOLID,
            links=(
                Link(name="a", parent=-1, joint=Joint(name="j", axis=axis), body=body),
            ),
        )


@pytest.mark.parametrize("com", [Vec3(0, 0, 0), Vec3(0.1, 0.2, 0.3), Vec3(0, 0, 0.3)])
def test_a_point_for_a_base_is_refused_wherever_it_sits(com):
    with pytest.raises(
        VehicleError, match=r"^base.inertia = .*no axis without inertia"
    ):
        Vehicle(name="v", base=Body(mass=1.0, com=com))


def test_a_slanted_rod_for_a_base_is_refused_though_no_diagonal_entry_is_zero():
    along = np.full(3, np.sqrt(1.0 / 3.0))
    tensor = 0.01 * (np.eye(3) - np.outer(along, along))
    places = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
    thin, thick = (
        Sym3(*(each[at] for at in places))
        for each in (tensor, tensor + 1e-4 * np.eye(3))
    )
    with pytest.raises(
        VehicleError,
        match=r"^base.inertia = 'principal moments .*no axis without inertia",
    ):
        Vehicle(name="v", base=Body(mass=1.0, inertia=thin))
    Vehicle(name="v", base=Body(mass=1.0, inertia=thick))


def test_a_thin_rod_is_accepted_across_its_axis_and_refused_along_it():
    rod = Body(mass=0.1, com=Vec3(0, 0, -0.1), inertia=Sym3(1e-4, 1e-4, 0))
    across = Link(
        name="a", parent=-1, joint=Joint(name="j", axis=Vec3(0, 1, 0)), body=rod
    )
    along = Link(
        name="a", parent=-1, joint=Joint(name="j", axis=Vec3(0, 0, 1)), body=rod
    )
    assert Vehicle(name="v", base=SOLID, links=(across,)).n == 1
    with pytest.raises(
        VehicleError, match=r"joints\[j\] = .*must move mass outward of it"
    ):
        Vehicle(name="v", base=SOLID, links=(along,))


def test_a_massless_wrist_that_is_singular_when_straight_is_refused_with_its_values():
    """Two parallel joints and a point: stretched out, the inner one only does what the
    outer one can.
    """
    empty, point = Body(mass=0.0), Body(mass=0.2, com=Vec3(0, 0, -0.1))
    links = (
        Link(name="a", parent=-1, joint=Joint(name="j"), body=empty),
        Link(
            name="b",
            parent=0,
            joint=Joint(name="k", position=Vec3(0, 0, -0.1)),
            body=point,
        ),
    )
    with pytest.raises(
        VehicleError, match=r"joints\[j\] = .* at joint values \[0, 0\]"
    ):
        Vehicle(name="v", base=SOLID, links=links)
    M = arrays.mass_matrix(
        Vehicle(name="v", base=SOLID), np.zeros(3), [1.0, 0, 0, 0], []
    )
    assert np.linalg.cond(M) < 1e4


def test_joint_values_tried_lie_within_the_limits():
    joint = Joint(name="j", lower=0.4, upper=0.5, rotation=Mat3.identity())
    assert [
        0.4 <= mobility._joint_value(joint, turn, 3) <= 0.5 for turn in range(3)
    ] == [True] * 3
