"""How far a vehicle is set down, from where, and how exactly it then stands."""

from __future__ import annotations

import dataclasses
import math
import re

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.algebra import Vec3
from skyarm.dynamics.point_motion import PointMotion
from skyarm.scenario.scenario_file import scenario_from
from skyarm.scenario.unlikely_numbers import unlikely_units
from skyarm.world.contact import Contact, FreeObject, Material, Surface
from skyarm.world.contact.static_equilibrium import stand_vehicle, with_standing_objects
from support.worlds import GRAVITY, SKIDS, at_rest, limp

BIRD = limp()
DEEP = float(BIRD.mass) * GRAVITY / 4.0 / 5000.0
"""m, into which four skids are pressed."""


def set_down(height, points=SKIDS, **ground):
    contact = Contact(surfaces=(Surface(name="ground", **ground),), points=points)
    return contact, stand_vehicle(
        BIRD, GRAVITY, contact, at_rest(BIRD, (0.3, 0.0, height))
    )


@pytest.mark.parametrize(
    "above", [-0.049, 0.5, pytest.param(2.99, marks=pytest.mark.thorough)]
)
def test_it_comes_from_five_centimetres_above_and_three_metres_down(above):
    assert set_down(0.12 + above)[1].position.z == pytest.approx(0.12 - DEEP, abs=1e-9)


@pytest.mark.parametrize(
    ("above", "words"),
    [
        (-0.051, "5 cm above"),
        pytest.param(3.01, "within 3 m below", marks=pytest.mark.thorough),
    ],
)
def test_beyond_that_it_is_refused(above, words):
    with pytest.raises(ValueError, match=words):
        set_down(0.12 + above)


def test_it_stands_on_a_slope_with_neither_force_nor_moment_left():
    """Skids of two lengths: what they carry is the weight, at the centre of mass, to
    1e-10 of it.
    """
    uneven = (
        dataclasses.replace(SKIDS[0], position=Vec3(0.1, 0.1, -0.1201)),
        *SKIDS[1:],
    )
    contact, state = set_down(0.3, points=uneven)
    motion, weight = PointMotion(BIRD, state), float(BIRD.mass) * GRAVITY
    touches = contact.on_points(contact.start(0.005, ()), motion)
    forces = np.array([float(touch.force.z) for touch in touches])
    places = np.array(
        [[float(c) for c in motion.position(point.position)] for point in uneven]
    )
    assert forces.sum() == pytest.approx(weight, rel=1e-10)
    middle = np.array([*state.position])
    assert forces @ (places - middle)[:, :2] == pytest.approx(
        [0.0, 0.0], abs=1e-10 * weight
    )
    assert forces.max() > 1.1 * forces.min(), "it rocks on its long skid"


def test_on_two_skids_it_tips_over():
    with pytest.raises(ValueError, match="tips over"):
        set_down(0.2, points=SKIDS[:2])


def on_slope(angles, friction, **world):
    """A scenario that begins at rest on a slope, with the rotors off."""
    points = [
        {"name": f"p{i}", "body": "base", "position": [x, y, -0.12]}
        for i, (x, y) in enumerate(((0.1, 0.1), (-0.1, 0.1), (-0.1, -0.1), (0.1, -0.1)))
    ]
    ground = {
        "name": "ground",
        "angles": list(angles),
        "material": {"friction": friction},
    }
    return scenario_from(
        {
            "schema": 1,
            "name": "slope",
            "duration": 0.5,
            "plant": {"vehicle": "hummingbird"},
            "controller": {"law": "decoupled_pd"},
            "environment": {"ground": False},
            "world": {"surfaces": [ground], "points": points, **world},
            "reference": {"base": {"kind": "hover", "position": [0.0, 0.0, 0.4]}},
            "initial": {"standing": True, "position": [0.0, 0.0, 0.4]},
        }
    )


@pytest.mark.parametrize("degrees", [5.0, 20.0, 37.0])
@pytest.mark.parametrize("about", [(1.0, 0.0), (0.0, -1.0)])
def test_it_stands_on_a_slope_up_to_the_angles_of_friction_and_tipping(degrees, about):
    """Feet 0.1 m from the middle and 0.12 m below it: it tips over beyond atan(0.1 /
    0.12), 39.8 degrees.
    """
    angles = [*(math.radians(degrees) * each for each in about), 0.0]
    session = skyarm.Session(on_slope(angles, 1.1 * math.tan(math.radians(degrees))))
    first = session.state
    still = skyarm.Command(rotor_speeds=(0.0,) * 4, efforts=())
    while session.running:
        session.step(still)
    moved = np.abs(session.log.position - [*first.position]).max()
    assert moved < 1e-6
    up = first.quaternion.rotation().column(2)
    assert math.degrees(math.acos(up.z)) == pytest.approx(degrees, abs=1.0)
    assert up.y == pytest.approx(-math.sin(angles[0]), abs=0.02)
    with pytest.raises(
        ValueError, match=r"by .* N; it is .* N at most, .* N too little, and it slides"
    ):
        on_slope(angles, 0.97 * math.tan(math.radians(degrees)))


def test_on_a_level_floor_it_stands_without_friction():
    """Tilts that the equilibrium leaves by rounding ask for 1e-13 N of friction:
    none.
    """
    state = skyarm.Session(on_slope((0.0, 0.0, 0.0), 0.0)).state
    assert [*state.rate] == [0.0, 0.0, 0.0]
    with pytest.raises(
        ValueError, match=r"it is 0 N at most, .* N too little, and it slides"
    ):
        on_slope((1e-6, 0.0, 0.0), 0.0)


def test_beyond_the_tipping_angle_it_is_refused():
    with pytest.raises(ValueError, match="tips over"):
        on_slope((math.radians(41.0), 0.0, 0.0), 3.0)


@pytest.mark.parametrize("degrees", [3.0, 25.0])
def test_a_level_box_is_set_down_on_a_slope(degrees):
    box = {
        "name": "box",
        "shape": "box",
        "size": [0.2, 0.2, 0.2],
        "mass": 0.5,
        "position": [1.0, 0.0, 1.0],
    }
    slope = math.radians(degrees)
    made = on_slope(
        (slope, 0.0, 0.0), 0.8, objects=[{**box, "standing": True}]
    ).world.objects[0]
    assert made.angles.x == pytest.approx(slope, abs=0.01)
    turned = on_slope(
        (slope, 0.0, 0.0),
        0.8,
        objects=[{**box, "standing": True, "angles": [0.0, 0.0, 90.0]}],
    )
    assert "world.objects[box].angles = 90" in "".join(unlikely_units(turned)), (
        "degrees"
    )
    above = float(made.position.z) * math.cos(slope)
    assert above == pytest.approx(0.1, abs=1e-3)


@pytest.mark.parametrize("degrees", [36.0, 39.0, 42.5, 44.0])
@pytest.mark.parametrize("along", [True, False])
def test_a_cube_stands_on_a_slope_up_to_45_degrees_set_down_level_or_along_it(
    degrees, along
):
    slope = math.radians(degrees)
    ground = Surface(
        name="ground", angles=Vec3(0.0, slope, 0.0), material=Material(friction=1.1)
    )
    cube = FreeObject(
        name="cube",
        size=(0.2, 0.2, 0.2),
        mass=0.5,
        standing=True,
        position=Vec3(0.0, 0.0, 1.0),
        angles=Vec3(0.0, slope if along else 0.0, 0.0),
    )
    (stood,) = with_standing_objects(
        Contact(surfaces=(ground,), objects=(cube,)), GRAVITY
    ).objects
    assert math.degrees(stood.angles.y) == pytest.approx(degrees, abs=0.2)
    steep = dataclasses.replace(ground, angles=Vec3(0.0, math.radians(46.0), 0.0))
    with pytest.raises(
        ValueError,
        match=(
            r"it tips over: a rigid one beyond 45 degrees, .* the slope has 46 \(less"
            r" slope\)"
        ),
    ):
        with_standing_objects(Contact(surfaces=(steep,), objects=(cube,)), GRAVITY)


def set_down_drawn(kind, rng, powers):
    """What becomes of a drawn body on a drawn slope, and what SciPy's linear program
    and Coulomb say of it.
    """
    yaw, way = rng.uniform(-3.0, 3.0), rng.uniform(0.0, 2.0 * np.pi)
    around = np.linspace(0.0, 2.0 * np.pi, 720)
    if kind == "box":
        size = rng.uniform(0.05, 0.4, 3)
        spots, height = (
            np.array([[a, b] for a in (-0.5, 0.5) for b in (-0.5, 0.5)]) * size[:2],
            0.5 * size[2],
        )
    elif kind == "cylinder":
        size = rng.uniform(0.04, [0.2, 0.4])
        spots, height = (
            size[0] * np.stack([np.cos(around), np.sin(around)], axis=1),
            0.5 * size[1],
        )
    else:
        count = int(rng.integers(3, 6))
        at = (np.arange(count) + rng.uniform(0.0, 0.6, count)) * 2.0 * np.pi / count
        spots, height = (
            rng.uniform(0.1, 0.3) * np.stack([np.cos(at), np.sin(at)], axis=1),
            rng.uniform(0.05, 0.2),
        )
    turn = Rotation.from_euler("z", yaw).as_matrix()[:2, :2]
    down, spots = (
        np.array([math.cos(way), math.sin(way)]),
        spots @ (np.eye(2) if kind == "feet" else turn.T),
    )
    # the furthest that the line of the weight may move down the slope within the hull
    # of what touches
    rows = np.vstack([np.column_stack([spots.T, -down]), [*np.ones(len(spots)), 0.0]])
    lowest = linprog(
        [*np.zeros(len(spots)), -1.0],
        A_eq=rows,
        b_eq=[0.0, 0.0, 1.0],
        bounds=[(0.0, None)] * len(spots) + [(None, None)],
    )
    tipping = -lowest.fun / height
    tangent = min(
        1.5,
        tipping
        * rng.choice([rng.uniform(0.1, 0.95), rng.uniform(1.05, 1.3)], p=[0.8, 0.2]),
    )
    friction = tangent * rng.choice(
        [rng.uniform(1.04, 2.0), rng.uniform(0.5, 0.96)], p=[0.7, 0.3]
    )
    right = (
        "stands"
        if tangent < min(tipping, friction)
        else "tips over"
        if tangent > tipping
        else "slides"
    )
    leaning = Rotation.from_rotvec(
        math.atan(tangent) * np.array([-down[1], down[0], 0.0])
    )
    material = Material(friction=friction, stiffness=10.0 ** rng.uniform(*powers))
    ground = Surface(
        name="ground", angles=Vec3(*leaning.as_euler("xyz").tolist()), material=material
    )
    try:
        if kind == "feet":
            places = [Vec3(x, y, -height) for x, y in spots.tolist()]
            points = tuple(
                dataclasses.replace(SKIDS[0], name=f"p{i}", position=p)
                for i, p in enumerate(places)
            )
            contact = Contact(surfaces=(ground,), points=points)
            up = (
                stand_vehicle(BIRD, GRAVITY, contact, at_rest(BIRD, (0.0, 0.0, 0.6)))
                .quaternion.rotation()
                .column(2)
            )
        else:
            body = FreeObject(
                name="body",
                shape=kind,
                size=tuple(size.tolist()),
                mass=rng.uniform(0.1, 1.0),
                standing=True,
                position=Vec3(0.0, 0.0, 0.8),
                angles=Vec3(0.0, 0.0, yaw),
            )
            (stood,) = with_standing_objects(
                Contact(surfaces=(ground,), objects=(body,)), GRAVITY
            ).objects
            up = Rotation.from_euler("xyz", [*map(float, stood.angles)]).as_matrix()[
                :, 2
            ]
        assert np.array([*map(float, up)]) @ leaning.as_matrix()[:, 2] > math.cos(0.03)
        return right, "stands"
    except ValueError as error:
        if " beyond " in str(error):
            said = float(str(error).split(" beyond ")[1].split()[0])
            assert said == pytest.approx(math.degrees(math.atan(tipping)), rel=0.01)
        return right, str(error)


def test_a_box_on_its_edge_is_refused_and_not_laid_flat():
    """At 45 degrees it is in equilibrium, an unstable one; at 20 it falls onto its
    side.
    """
    ground = Surface(name="ground", material=Material(friction=0.5, stiffness=5000.0))
    balanced = 0.05 * math.sqrt(2.0) - 0.1 * GRAVITY / 5000.0 / 2.0
    for lean, height in (
        (0.25 * math.pi, balanced),
        (0.25 * math.pi, 0.2),
        (0.35, 0.2),
    ):
        box = FreeObject(
            name="box",
            size=(0.1, 0.3, 0.1),
            mass=0.1,
            standing=True,
            angles=Vec3(0.0, lean, 0.0),
            position=Vec3(0.0, 0.0, height),
        )
        with pytest.raises(ValueError, match=r"it tips over$"):
            with_standing_objects(Contact(surfaces=(ground,), objects=(box,)), GRAVITY)


def test_a_cylinder_tips_over_the_lowest_point_of_its_rim():
    body = FreeObject(
        name="body",
        shape="cylinder",
        size=(0.1, 0.2),
        mass=0.3,
        standing=True,
        position=Vec3(0.0, 0.0, 0.5),
        angles=Vec3(0.0, 0.0, 0.4),
    )
    for degrees, way in ((47.0, 1.0), (50.0, -1.0)):
        angles = Vec3(0.0, way * math.radians(degrees), 0.0)
        ground = Surface(name="ground", angles=angles, material=Material(friction=2.0))
        with pytest.raises(
            ValueError,
            match=(
                "it tips over: a rigid one beyond 45 degrees, .* slope has"
                f" {degrees:g} "
            ),
        ):
            with_standing_objects(Contact(surfaces=(ground,), objects=(body,)), GRAVITY)


@pytest.mark.parametrize(
    ("shape", "size", "degrees", "stiffness"),
    [("cylinder", (0.05, 0.2), 26.0, 5000.0), ("box", (0.1, 0.2, 0.3), 18.4, 5000.0)],
)
def test_what_tips_over_by_its_softness_alone_is_told_so(
    shape, size, degrees, stiffness
):
    """Below atan(half width / half height) the refusal asks for stiffness, and with it
    the body stands.
    """
    rigid = math.degrees(
        math.atan2(size[0] * (1.0 if shape == "cylinder" else 0.5), 0.5 * size[-1])
    )
    assert degrees < rigid
    body = FreeObject(
        name="body",
        shape=shape,
        size=size,
        mass=0.5,
        standing=True,
        position=Vec3(0.0, 0.0, 1.0),
    )
    soft, hard = (
        Surface(
            name="ground",
            angles=Vec3(0.0, math.radians(degrees), 0.0),
            material=Material(friction=5.0, stiffness=each),
        )
        for each in (stiffness, 1e5)
    )
    words = (
        r"a rigid one beyond (.*) degrees, a soft one earlier; the slope has (.*)"
        r" \(less slope, or more stiffness\)"
    )
    with pytest.raises(ValueError, match=words) as refused:
        with_standing_objects(Contact(surfaces=(soft,), objects=(body,)), GRAVITY)
    said, slope = map(float, re.search(words, str(refused.value)).groups())
    assert said == pytest.approx(rigid, abs=0.02)
    assert slope == degrees < said
    with_standing_objects(Contact(surfaces=(hard,), objects=(body,)), GRAVITY)


def test_a_cylinder_across_the_slope_has_no_angle():
    body = FreeObject(
        name="body",
        shape="cylinder",
        size=(0.05, 0.2),
        mass=0.5,
        standing=True,
        position=Vec3(0.0, 0.0, 1.0),
        angles=Vec3(0.5 * math.pi, 0.0, 0.0),
    )
    ground = Surface(
        name="ground",
        angles=Vec3(0.0, math.radians(5.0), 0.0),
        material=Material(friction=5.0),
    )
    with pytest.raises(
        ValueError,
        match=r"it tips over as it lies; the slope has 5 degrees \(level ground",
    ):
        with_standing_objects(Contact(surfaces=(ground,), objects=(body,)), GRAVITY)


def test_what_is_in_equilibrium_already_is_asked_for_friction_too():
    box = FreeObject(
        name="box",
        size=(0.1, 0.1, 0.1),
        mass=0.1,
        standing=True,
        position=Vec3(0.0, 0.0, 0.5),
        angles=Vec3(0.0, 0.3, 0.0),
    )
    rough, smooth = (
        Surface(
            name="ground", angles=Vec3(0.0, 0.3, 0.0), material=Material(friction=mu)
        )
        for mu in (0.5, 0.1)
    )
    held = with_standing_objects(Contact(surfaces=(rough,), objects=(box,)), GRAVITY)
    assert with_standing_objects(held, GRAVITY) == held
    with pytest.raises(ValueError, match="and it slides"):
        with_standing_objects(dataclasses.replace(held, surfaces=(smooth,)), GRAVITY)


@pytest.mark.parametrize("kind", ["box", "cylinder", "feet"])
@pytest.mark.parametrize(
    ("powers", "count"),
    [
        ((4.0, 5.0), 5),
        ((7.0, 9.0), 2),
        pytest.param((6.0, 9.0), 20, marks=pytest.mark.thorough),
    ],
)
def test_drawn_bodies_stand_up_to_the_angles_of_tipping_and_friction(
    kind, powers, count
):
    """On ground of some stiffness, and on one into which they sink by a nanometre."""
    rng = np.random.default_rng(20)
    for right, found in (set_down_drawn(kind, rng, powers) for _ in range(count)):
        assert right in found


@pytest.mark.parametrize("stiffness", [1e7, 1e9])
def test_on_very_stiff_ground_rounding_neither_slides_nor_stands_on_an_edge(stiffness):
    """A box far from the origin needs no friction on a level floor, and at 45 degrees
    it does not stand.
    """
    ground = Surface(
        name="ground", material=Material(friction=0.0, stiffness=stiffness)
    )
    flat, edge = (
        FreeObject(
            name="box",
            size=(0.1, 0.3, 0.1),
            mass=0.1,
            standing=True,
            angles=Vec3(0.0, lean, 0.7),
            position=Vec3(3.0, 2.0, 0.3),
        )
        for lean in (0.01, 0.25 * math.pi)
    )
    (stood,) = with_standing_objects(
        Contact(surfaces=(ground,), objects=(flat,)), GRAVITY
    ).objects
    assert float(stood.position.z) == pytest.approx(
        0.05 - 0.1 * GRAVITY / (4.0 * stiffness), abs=1e-15
    )
    with pytest.raises(ValueError, match=r"it tips over$"):
        with_standing_objects(Contact(surfaces=(ground,), objects=(edge,)), GRAVITY)
