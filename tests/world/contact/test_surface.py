"""Depth, normal and clearance of surfaces against properties of a distance, and against
points drawn on discs.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from skyarm.algebra import Mat3, Vec3
from skyarm.compile import trace
from skyarm.reference import Constant, Sine
from skyarm.world import SignalVector
from skyarm.world.contact import Surface
from support.cases import sampled

TURNED = {"position": (0.3, -0.2, 0.5), "angles": (0.4, -0.7, 1.1)}
SURFACES = {
    "plane": Surface(name="s", shape="plane", **TURNED),
    "box": Surface(name="s", shape="box", size=(0.4, 0.6, 0.8), **TURNED),
    "cylinder": Surface(name="s", shape="cylinder", size=(0.3, 0.8), **TURNED),
    "sphere": Surface(name="s", shape="sphere", size=(0.4,), **TURNED),
}


def depth(surface, point, radius=0, t=0.0):
    found, normal = surface.depth(Vec3(*(float(c) for c in point)), radius, t)
    return float(found), np.array([float(c) for c in normal])


def around(rng, count, reach=0.7):
    return np.array(TURNED["position"]) + rng.uniform(-reach, reach, size=(count, 3))


@pytest.mark.parametrize("name", SURFACES)
def test_the_normal_leads_to_the_surface_and_is_the_slope_of_the_depth(name):
    """A ball: from its middle the way `depth` along the normal ends on the surface of a
    point.
    """
    surface, h = SURFACES[name], 1e-6
    for point in around(np.random.default_rng(5), 40):
        found, n = depth(surface, point, 1e-9)
        assert np.linalg.norm(n) == pytest.approx(1.0, abs=1e-9)
        assert depth(surface, point + n * found, 1e-9)[0] == pytest.approx(
            0.0, abs=1e-6
        )
        slope = [
            (
                depth(surface, point + h * e, 1e-9)[0]
                - depth(surface, point - h * e, 1e-9)[0]
            )
            / (2 * h)
            for e in np.eye(3)
        ]
        assert slope == pytest.approx(-n, abs=1e-5)


@pytest.mark.parametrize("name", SURFACES)
def test_inside_is_inside_and_a_point_sees_the_nearest_face(name):
    surface = SURFACES[name]
    for point in around(np.random.default_rng(6), 60):
        inner = depth(surface, point)[0]
        assert (inner > 0.0) == (depth(surface, point, 1e-12)[0] > 0.0)
        if inner > 0.0:
            assert depth(surface, point, 0.05)[0] == pytest.approx(
                inner + 0.05, rel=1e-12
            )


def test_a_box_has_its_faces_where_its_size_says():
    box = Surface(
        name="s",
        shape="box",
        size=(0.2, 0.4, 0.6),
        position=(1.0, 0.0, 0.0),
        angles=(0.0, 0.0, math.pi / 2),
    )
    # turned by 90 degrees about z its x axis is the world's y
    assert depth(box, (1.0 + 0.2 - 0.01, 0.0, 0.0))[0] == pytest.approx(0.01, abs=1e-12)
    found, n = depth(box, (1.0, -0.1 + 0.02, 0.1))
    assert found == pytest.approx(0.02, abs=1e-12)
    assert n == pytest.approx([0.0, -1.0, 0.0], abs=1e-12)
    assert depth(box, (1.0, 0.0, 0.3 + 0.05))[0] == pytest.approx(-0.05, abs=1e-12)
    # a ball beside the edge: by the way to the edge
    assert depth(box, (1.0, 0.1 + 0.03, 0.3 + 0.04), 0.06)[0] == pytest.approx(
        0.01, abs=1e-9
    )


def test_roll_pitch_and_yaw_turn_about_the_axes_of_the_world_one_after_the_other():
    c, s = math.cos, math.sin
    about_x = np.array([[1, 0, 0], [0, c(0.4), -s(0.4)], [0, s(0.4), c(0.4)]])
    about_y = np.array([[c(-0.7), 0, s(-0.7)], [0, 1, 0], [-s(-0.7), 0, c(-0.7)]])
    about_z = np.array([[c(1.1), -s(1.1), 0], [s(1.1), c(1.1), 0], [0, 0, 1]])
    assert depth(SURFACES["plane"], (0.0, 0.0, 0.0))[1] == pytest.approx(
        (about_z @ about_y @ about_x)[:, 2], abs=1e-12
    )


def test_what_moves_is_structure_whatever_its_numbers_are():
    assert not Surface(name="s").moves
    assert not Surface(name="s", motion=SignalVector(x=Constant(0))).moves
    assert Surface(name="s", motion=SignalVector(y=Constant(0.0))).moves
    node = trace(
        lambda x: (
            (
                1.0
                if Surface(name="s", motion=SignalVector(z=Constant(x[0]))).moves
                else 0.0
            ),
        ),
        (0.5,),
    )
    assert node.flat((0.5,)) == (1.0,)


def test_a_surface_moves_as_its_signals_say():
    lift = Surface(
        name="s",
        position=(0.0, 0.0, 0.2),
        motion=SignalVector(z=Sine(amplitude=0.1, frequency_hz=0.5)),
    )
    place, velocity = lift.place(0.3)
    assert place.z == pytest.approx(0.2 + 0.1 * math.sin(math.pi * 0.3), rel=1e-12)
    assert velocity.z == pytest.approx(
        0.1 * math.pi * math.cos(math.pi * 0.3), rel=1e-12
    )
    assert depth(lift, (3.0, 1.0, 0.2), t=0.3)[0] == pytest.approx(
        0.1 * math.sin(math.pi * 0.3), rel=1e-12
    )


@pytest.mark.parametrize("name", sampled([*list(SURFACES)[1:], "plane"], every=9))
def test_a_disc_is_clear_where_every_point_of_it_is_outside(name):
    """Against 400 points of each of 200 discs: no touch is missed, and few discs are
    held for touching that do not.
    """
    surface, rng, wrong = SURFACES[name], np.random.default_rng(7), 0
    turns = np.linspace(0.0, 2.0 * math.pi, 40, endpoint=False)
    rings = np.linspace(0.1, 1.0, 10)
    grid = np.array([(r * math.cos(a), r * math.sin(a)) for a in turns for r in rings])
    for centre in around(rng, 200, 0.8):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        across = np.linalg.svd(axis[None])[2][1:]
        points = centre + 0.15 * grid @ across
        deepest = np.max([surface.depth(Vec3(*points.T), 0, 0.0)[0]])
        clear = surface.clearance(Vec3(*centre), Vec3(*axis), 0.15, 0.0)
        assert not (deepest > 1e-3 and clear > 0.0)
        wrong += deepest < -5e-3 and clear < 0.0
    assert wrong <= 4
    assert surface.clearance(Vec3(*centre), Vec3(*axis), 0, 0.0) == pytest.approx(
        -depth(surface, centre, 1e-12)[0]
    )


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_disc_along_a_face_is_clear_though_it_reaches_beyond_the_edge(axis):
    """3 cm above one face, its hub 8 cm beyond the edge: the way to the edge crosses
    it, the face does not.
    """
    box, centre = Surface(name="s", shape="box", size=(0.4, 0.4, 0.4)), np.zeros(3)
    centre[axis], centre[(axis + 1) % 3] = 0.23, 0.28
    along = Vec3(*np.eye(3)[axis])
    assert box.clearance(Vec3(*centre), along, 0.15, 0.0) == pytest.approx(
        0.03, abs=1e-9
    )
    centre[axis] = 0.19
    assert box.clearance(Vec3(*centre), along, 0.15, 0.0) == pytest.approx(
        -0.01, abs=1e-9
    ), "a centimetre would part them"


def test_nothing_is_undefined_in_the_middle():
    for name in ("sphere", "cylinder"):
        found, n = depth(SURFACES[name], TURNED["position"])
        assert found == pytest.approx(SURFACES[name].size[0], abs=1e-9)
        assert np.isfinite(n).all()
    plane = SURFACES["plane"]
    assert plane.clearance(
        Vec3(0.3, -0.2, 0.5), plane.rotation.column(2), 0.15, 0.0
    ) == pytest.approx(0.0, abs=1e-9)


def test_zeros_of_a_file_are_structure_and_cost_nothing():
    at_origin = Surface(
        name="s", position=Vec3(0.0, 1.0, 0.0), angles=Vec3(0.0, 0.0, 0.0)
    )
    assert [type(c) for c in at_origin.position] == [int, float, int]
    assert at_origin.rotation == Mat3.identity()
    assert all(type(entry) is int for row in at_origin.rotation.rows for entry in row)
    assert at_origin.clearance(Vec3(0.0, 0.0, 0.7), Vec3(0, 0, 1), 0, 0.0) == 0.7


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        (
            {"shape": "cone"},
            "shape = 'cone': must be one of plane, box, cylinder, sphere",
        ),
        (
            {"shape": "box", "size": (1.0, 2.0)},
            r"size = \[1.0, 2.0\]: must be 3 numbers, x, y, z",
        ),
        ({"size": (1.0,)}, "must be left out of a plane"),
        ({"shape": "sphere", "size": (-1.0,)}, "must be above 0"),
        ({"name": ""}, "must not be empty"),
    ],
)
def test_surfaces_that_cannot_be_are_refused(fields, words):
    with pytest.raises(ValueError, match=words):
        Surface(**{"name": "s", **fields})
