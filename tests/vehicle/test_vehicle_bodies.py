"""Numbers of a file become bodies, rotations and structure."""

import copy
import dataclasses
import functools
import math
import re
from pathlib import Path

import numpy as np
import pytest
from vehicle_documents import DOCUMENT, file_of

from skyarm.algebra import Mat3, Sym3, Vec3
from skyarm.vehicle import Body, Joint, Link, Vehicle, VehicleError, description
from skyarm.vehicle.vehicle_files import load_vehicle

SOLID = Body(mass=1.0, inertia=Sym3(0.01, 0.01, 0.01))


def points_of(body):
    """Six point masses with a body's mass, centre and inertia (about principal axes),
    NumPy.
    """
    i = body.inertia
    J = np.array(
        [[i.xx, i.xy, i.xz], [i.xy, i.yy, i.yz], [i.xz, i.yz, i.zz]], dtype=float
    )
    moments, axes = np.linalg.eigh(J)
    second = (moments.sum() / 2 - moments) / body.mass
    c = np.array([float(v) for v in body.com])
    offsets = [
        sign * math.sqrt(max(3 * s, 0.0)) * axis
        for s, axis in zip(second, axes.T, strict=True)
        for sign in (1, -1)
    ]
    return [(body.mass / 6, c + offset) for offset in offsets]


@pytest.mark.parametrize("seed", range(5))
def test_parts_of_a_link_are_summed_like_the_points_they_are_made_of(seed):
    rng = np.random.default_rng(seed)
    parts = []
    for _ in range(4):
        cloud = rng.normal(size=(4, 3))
        J = sum((p @ p) * np.eye(3) - np.outer(p, p) for p in cloud)
        parts.append(
            Body(
                mass=float(rng.uniform(0.1, 2)),
                com=Vec3(*rng.normal(size=3).tolist()),
                inertia=Sym3(
                    *(
                        float(J[i, j])
                        for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
                    )
                ),
            )
        )
    points = [point for part in parts for point in points_of(part)]
    whole = description.body(parts)
    mass = sum(m for m, _ in points)
    com = sum(m * p for m, p in points) / mass
    J = sum(
        m * (((p - com) @ (p - com)) * np.eye(3) - np.outer(p - com, p - com))
        for m, p in points
    )
    assert whole.mass == pytest.approx(mass, rel=1e-13)
    np.testing.assert_allclose(np.array(list(whole.com)), com, rtol=0, atol=1e-13)
    found = np.array([[float(c) for c in row] for row in whole.inertia.full().rows])
    np.testing.assert_allclose(found, J, rtol=0, atol=1e-12 * np.abs(J).max())


def test_joined_bodies_are_the_same_in_either_order():
    a = Body(mass=1.0, com=Vec3(0.1, 0.2, 0.3), inertia=Sym3(0.01, 0.02, 0.025))
    b = Body(mass=0.5, com=Vec3(-0.3, 0.1, 0.0), planar=True)
    one, other = a.merge(b), b.merge(a)
    np.testing.assert_allclose(one.inertia.entries, other.inertia.entries, rtol=1e-14)
    assert one.planar
    assert other.planar


def test_a_payload_of_zero_mass_is_no_nan():
    body = Body(mass=0.0, com=Vec3(0, 0, 0)).merge(Body(mass=0.0, com=Vec3(0, 0, -0.1)))
    assert [float(c) for c in (*body.com, *body.inertia.entries)] == [0.0] * 9


@pytest.mark.parametrize(
    "rpy", [(0.3, -0.7, 1.9), (2.5, 0.1, -3.0), (0.0, math.pi / 2, 0.4)]
)
def test_rpy_turns_first_about_x_then_y_then_z_of_the_parent(rpy):
    spatial = pytest.importorskip("scipy.spatial.transform")
    expected = spatial.Rotation.from_euler("xyz", rpy).as_matrix()
    found = [[float(c) for c in row] for row in description.rotation_rpy(rpy).rows]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-15 * 4)


def test_a_quaternion_is_w_first_and_gives_child_axes_to_parent_axes():
    spatial = pytest.importorskip("scipy.spatial.transform")
    wxyz = np.array([0.7, -0.1, 0.3, 0.5])
    wxyz /= np.linalg.norm(wxyz)
    expected = spatial.Rotation.from_quat(np.roll(wxyz, -1)).as_matrix()
    found = [
        [float(c) for c in row]
        for row in description.rotation_quaternion("q", wxyz.tolist()).rows
    ]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-15)


def test_quarter_turns_are_structure_and_near_ones_are_not():
    quarter = description.rotation_rpy((0.0, 0.0, math.pi / 2))
    assert [tuple(row) for row in quarter.rows] == [(0, -1, 0), (1, 0, 0), (0, 0, 1)]
    assert all(type(c) is int for row in quarter.rows for c in row)
    near = description.rotation_rpy((0.0, 0.0, 1.5708))
    assert type(near.r0.x) is float
    assert near.r0.x != 0.0


def test_any_nonzero_axis_is_normalised():
    assert tuple(description.unit_axis("a", [0.0, -3.0, 0.0])) == (0, -1, 0)
    assert type(description.unit_axis("a", [0.0, -3.0, 0.0]).y) is int
    slanted = description.unit_axis("a", [1e-3, 2e-3, 2e-3])
    np.testing.assert_allclose(list(slanted), [1 / 3, 2 / 3, 2 / 3], rtol=1e-15)


def test_structure_of_the_example_of_the_documentation(tmp_path):
    vehicle = load_vehicle(file_of(tmp_path, DOCUMENT))
    assert vehicle.title == "Quadrotor with one swinging link"
    assert vehicle.mass == pytest.approx(0.78, abs=1e-15)
    assert vehicle.base.com.x == pytest.approx(0.03 * 0.06 / 0.73, rel=1e-14)
    assert type(vehicle.base.com.y) is int
    # camera against body: reduced mass times distance squared
    assert vehicle.base.inertia.yy == pytest.approx(
        0.007 + 0.7 * 0.03 / 0.73 * 0.06**2, rel=1e-13
    )
    shoulder = vehicle.links[0].joint
    assert (shoulder.kind, shoulder.lower, shoulder.effort_limit, shoulder.coulomb) == (
        "revolute",
        -1.6,
        0.5,
        0,
    )
    assert shoulder.rotation.r0.y == pytest.approx(-math.sin(0.3), abs=1e-16)
    assert [rotor.direction for rotor in vehicle.rotors] == [-1, 1, -1, 1]
    assert ("links.inertia", "rod, m L^2 / 12") in vehicle.sources


def test_a_rotors_own_value_stands_before_the_default(tmp_path):
    document = {
        **DOCUMENT,
        "rotors": [
            {
                **DOCUMENT["rotors"][0],
                "thrust_coefficient": 1e-5,
                "axis": [0.0, 0.0, 2.0],
            }
        ],
    }
    rotor = load_vehicle(file_of(tmp_path, document)).rotors[0]
    assert rotor.thrust_coefficient == 1e-5
    assert rotor.moment_coefficient == 0.016
    assert tuple(rotor.axis) == (0, 0, 1)
    assert rotor.drag_coefficient == 0
    assert type(rotor.drag_coefficient) is int


def test_drag_is_read(tmp_path):
    drag = load_vehicle(
        file_of(tmp_path, {**DOCUMENT, "drag": {"area": [0.1, 0.0, 0.3]}})
    ).drag
    assert (*drag.area, drag.air_density) == (0.1, 0, 0.3, 1.225)


def test_every_field_of_a_vehicle_file_is_documented(tmp_path):
    """Of what a file may hold the message about an unknown word tells all."""
    text = (Path(__file__).parents[2] / "docs" / "vehicle_files.md").read_text(
        encoding="utf-8"
    )
    names = set()
    for where in (
        (),
        ("base",),
        ("links", 0),
        ("links", 0, "joint"),
        ("rotors", 0),
        ("rotor_defaults",),
        ("frames", 0),
    ):
        document = copy.deepcopy(DOCUMENT)
        functools.reduce(lambda table, step: table[step], where, document)["odd"] = 1
        with pytest.raises(
            VehicleError, match=r"odd = 1: unknown field; allowed: "
        ) as error:
            load_vehicle(file_of(tmp_path, document))
        names |= set(str(error.value).partition("allowed: ")[2].split(", "))
    assert len(names) > 25
    assert [name for name in sorted(names) if not re.search(rf"\b{name}\b", text)] == []


def test_a_rotation_that_is_not_orthogonal_is_refused():
    # three milliradians off square: the determinant is 1 to 5e-6
    slanted = Mat3(
        Vec3(1, 0, 0), Vec3(math.sin(3e-3), math.cos(3e-3), 0.0), Vec3(0, 0, 1)
    )
    with pytest.raises(VehicleError, match=r"joints\[j\].rotation"):
        Joint(name="j", rotation=slanted)


def test_a_mirror_is_no_rotation():
    mirror = Mat3(Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, -1))
    with pytest.raises(VehicleError, match="determinant"):
        Joint(name="j", rotation=mirror)


def test_a_negative_drag_area_is_refused():
    from skyarm.vehicle import BodyDrag

    with pytest.raises(VehicleError, match=r"drag.area.y = -0.1: must be at least 0"):
        Vehicle(name="v", base=SOLID, drag=BodyDrag(area=Vec3(0, -0.1, 0)))


def test_lanes_of_a_batch_are_not_checked_for_singularity():
    rod = Body(mass=np.array([0.0, 1.0]), com=Vec3(0, 0, -0.1))
    link = Link(name="a", parent=-1, joint=Joint(name="j"), body=rod)
    assert Vehicle(name="v", base=SOLID, links=(link,)).n == 1
    with pytest.raises(VehicleError, match=r"joints\[j\]"):
        Vehicle(
            name="v",
            base=SOLID,
            links=(dataclasses.replace(link, body=Body(mass=0.0)),),
        )


@pytest.mark.parametrize(
    ("entry", "is_zero"), [(1e-15, True), (-1e-15, True), (1.1e-15, False)]
)
def test_an_entry_of_a_rotation_within_rounding_of_zero_is_zero(entry, is_zero):
    R = description.rotation(
        Mat3.from_numbers([[1.0, entry, 0.0], [-entry, 1.0, 0.0], [0.0, 0.0, 1.0]])
    )
    assert (float(R.r0.y) == 0.0) is is_zero
