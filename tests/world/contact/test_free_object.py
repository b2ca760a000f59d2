"""Free objects against closed forms: weights, slopes, rolling, bounces, tumbling,
pushes; what an object may be.
"""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from skyarm.algebra import Quaternion, Vec3
from skyarm.dynamics.energy import kinetic_energy
from skyarm.dynamics.point_motion import PointMotion
from skyarm.records.coerce import RecordError
from skyarm.records.leaves import rebuild
from skyarm.world.contact import (
    Contact,
    ContactPoint,
    FreeObject,
    Material,
    Mechanism,
    Surface,
)
from skyarm.world.contact.box_edges import EDGE_PAIRS
from skyarm.world.contact.free_object import uniform_moments
from support.worlds import (
    AWAY,
    BIRD,
    GRAVITY,
    Scene,
    at_rest,
    energy,
    limp,
    with_ground,
    with_object,
)

SPOT = (ContactPoint(name="spot", body="base"),)
SLOPE = Surface(name="ground", angles=(0.0, 1e-9, 0.0), material=Material(friction=0.5))


def lying(shape, size, **numbers):
    """An object on a ground whose angles are numbers."""
    return Contact(
        surfaces=(SLOPE,),
        points=SPOT,
        objects=(FreeObject(name="it", shape=shape, size=size, mass=0.1, **numbers),),
    )


BOX = lying("box", (0.1, 0.08, 0.06))


def remembered(contact, row):
    """The memory in which the only object is as its numbers say."""
    memory = contact.start(0.005, ())
    return dataclasses.replace(
        memory, carried=(rebuild(memory.carried[0], iter(row.tolist())),)
    )


@pytest.fixture(scope="module")
def box():
    """Steps of 1 ms: those of 60 g."""
    return Scene(with_object(BOX, mass=0.06))


@pytest.fixture(scope="module")
def ball():
    return Scene(lying("sphere", (0.05,)))


@pytest.fixture(scope="module")
def roller():
    return Scene(lying("cylinder", (0.04, 0.1)))


def on_slope(contact, angle, height, friction, turn=(0.0, 0.0, 0.0), dissipation=3.0):
    """The object that height above a slope down along x, turned with it."""
    n = (math.sin(angle), 0.0, math.cos(angle))
    lifted = with_object(
        contact,
        position=Vec3(*(height * c for c in n)),
        angles=Vec3(turn[0], turn[1] + angle, 0.0),
    )
    return with_ground(
        lifted, (0.0, angle, 0.0), friction=friction, dissipation=dissipation
    )


def along(rows, angle):
    """Speed (N,) down a slope, m/s."""
    return rows[:, 0, 7] * math.cos(angle) - rows[:, 0, 9] * math.sin(angle)


def acceleration(rows, angle, first):
    """Mean of the acceleration down a slope from a row on, m/s^2."""
    v = along(rows, angle)
    return (v[-1] - v[first]) / (0.005 * (len(v) - 1 - first))


def test_a_box_put_down_sinks_as_deep_as_its_weight_presses_its_four_corners(box):
    mass = 0.1
    depth = mass * GRAVITY / (4.0 * 5000.0)
    down = with_ground(
        with_object(BOX, mass=mass, position=Vec3(0.0, 0.0, 0.03)),
        friction=0.0,
        dissipation=100.0,
    )
    _, rows = box.fly(down, 0.15)
    assert rows[-1, 0, 2] == pytest.approx(0.03 - depth, abs=0.03 * depth)
    assert 0.03 - 0.97 * depth < rows[0, 0, 2] < 0.03 - 0.9 * depth, "it falls"
    memory = remembered(down, rows[-1, 0])
    pushes = [
        each.touch.normal for each in down.meetings(memory, PointMotion(BIRD, AWAY))
    ]
    assert sum(map(float, pushes)) == pytest.approx(mass * GRAVITY, rel=0.05)


def test_a_box_slides_down_a_slope_by_g_sin_less_mu_g_cos_and_sticks_below_zero(box):
    angle = math.radians(25.0)
    _, rows = box.fly(on_slope(BOX, angle, 0.03, 0.2), 0.3)
    assert acceleration(rows, angle, 30) == pytest.approx(
        GRAVITY * (math.sin(angle) - 0.2 * math.cos(angle)), rel=5e-3
    )
    _, stuck = box.fly(on_slope(BOX, angle, 0.03, 0.8, dissipation=100.0), 0.2)
    assert np.linalg.norm(stuck[-1, 0, :3] - stuck[19, 0, :3]) < 5e-5


def test_a_high_box_tips_over_where_its_centre_is_beyond_its_edge(box):
    """10 cm high and 6 cm deep it stands up to atan(6 / 10) = 31 degrees."""
    high = with_object(BOX, size=(0.06, 0.08, 0.1))
    tilts = []
    for degrees in (29.0, 33.0):
        angle = math.radians(degrees)
        _, rows = box.fly(on_slope(high, angle, 0.05, 1.0, dissipation=30.0), 0.3)
        tilts.append(2.0 * math.atan2(rows[-1, 0, 5], rows[-1, 0, 3]) - angle)
    assert abs(tilts[0]) < 0.01
    assert tilts[1] > 0.05, "over the lower edge"


def test_a_ball_rolls_down_a_slope_with_five_sevenths_of_g_sin(ball):
    angle = math.radians(20.0)
    _, rows = ball.fly(on_slope(lying("sphere", (0.05,)), angle, 0.05, 0.6), 0.3)
    assert acceleration(rows, angle, 30) == pytest.approx(
        5.0 / 7.0 * GRAVITY * math.sin(angle), rel=5e-3
    )
    assert rows[-1, 0, 11] * 0.05 == pytest.approx(along(rows, angle)[-1], rel=1e-2), (
        "without slip"
    )


def test_a_lying_cylinder_rolls_with_two_thirds_and_a_standing_one_rests_on_its_rim(
    roller,
):
    angle, lies = math.radians(20.0), lying("cylinder", (0.04, 0.1))
    _, rows = roller.fly(on_slope(lies, angle, 0.04, 0.6, (math.pi / 2, 0.0)), 0.3)
    assert acceleration(rows, angle, 30) == pytest.approx(
        2.0 / 3.0 * GRAVITY * math.sin(angle), rel=5e-3
    )
    _, stands = roller.fly(on_slope(lies, 1e-12, 0.05, 0.6, dissipation=100.0), 0.15)
    assert stands[-1, 0, 2] == pytest.approx(
        0.05 - 0.1 * GRAVITY / (3.0 * 5000.0), abs=2e-6
    )


@pytest.mark.parametrize(
    ("mass", "size"),
    [
        (0.1, (0.1, 0.08, 0.06)),
        pytest.param(0.02, (0.1, 0.08, 0.06), marks=pytest.mark.thorough),
        pytest.param(0.3, (0.2, 0.2, 0.01), marks=pytest.mark.thorough),
        pytest.param(3.0, (0.1, 0.08, 0.06), marks=pytest.mark.thorough),
    ],
)
def test_a_bounce_on_a_corner_gains_no_energy(mass, size):
    """Without friction and dissipation, weightless, thrown at the ground: within 0.1 %,
    the aim of the issue.
    """
    rng = np.random.default_rng(3)
    first = lying(
        "box", size, velocity=Vec3(0.3, 0.0, -0.6), angular_velocity=Vec3(1.0, 2.0, 3.0)
    )
    thrown = with_ground(
        with_object(first, mass=mass, position=Vec3(0.0, 0.0, 0.16)),
        friction=0.0,
        dissipation=0.0,
    )
    scene = Scene(thrown, gravity=0.0)
    for _ in range(2):
        this = with_object(thrown, angles=Vec3(*rng.uniform(-3.0, 3.0, 3)))
        _, rows = scene.fly(this, 0.3)
        found = energy(rows[:, 0], this.objects[0])
        before, _ = energy(rows[:2, 0], this.objects[0])
        assert found.min() < 0.99 * before, "it touched"
        assert found.max() < 1.001 * before
        assert 0.98 * before < found[-1]


def test_free_tumbling_is_that_of_eulers_equations():
    """Centre of mass beside the middle; SciPy integrates both equations to 1e-11."""
    moments, com = np.array([2e-4, 3e-4, 4e-4]), np.array([0.01, -0.02, 0.005])
    v, w = np.array([0.3, -0.2, 1.0]), np.array([5.0, -3.0, 4.0])
    free = lying(
        "box",
        (0.1, 0.08, 0.06),
        inertia=Vec3(*moments),
        com=Vec3(*com),
        position=Vec3(0.1, 0.2, 20.0),
        angles=Vec3(0.3, -0.4, 0.5),
        velocity=Vec3(*v),
        angular_velocity=Vec3(*w),
    )
    _, rows = Scene(free).fly(free, 0.5)
    R = Rotation.from_euler("xyz", [0.3, -0.4, 0.5]).as_matrix()

    def rates(_, y):
        R, w = y[:9].reshape(3, 3), y[9:]
        skew = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
        return np.concatenate([(R @ skew).ravel(), -np.cross(w, moments * w) / moments])

    end = solve_ivp(
        rates, (0.0, 0.5), np.concatenate([R.ravel(), R.T @ w]), rtol=1e-11, atol=1e-12
    ).y[:, -1]
    x, q = rows[-1, 0, :3], rows[-1, 0, 3:7]
    assert x == pytest.approx(
        np.array([0.1, 0.2, 20.0]) + R @ com + 0.5 * v - [0.0, 0.0, 0.125 * GRAVITY],
        abs=1e-9,
    )
    found = np.array(
        [[float(c) for c in row] for row in Quaternion(*q.tolist()).rotation().rows]
    )
    assert found == pytest.approx(end[:9].reshape(3, 3), abs=2e-6)  # fourth order, 5 ms
    assert rows[-1, 0, 10:13] == pytest.approx(end[9:], abs=2e-5)
    memory = remembered(free, rows[-1, 0])
    frame = free.objects[0].frame(memory.carried[0])
    assert [*frame.position] == pytest.approx(x - found @ com)
    turning = found @ end[9:]
    assert [*frame.velocity] == pytest.approx(
        rows[-1, 0, 7:10] - np.cross(turning, found @ com), abs=1e-4
    )


@pytest.fixture(scope="module")
def pushed():
    """A limp vehicle whose skid, a ball, meets a box in free space: before and
    after.
    """
    bird = limp()
    skid = ContactPoint(
        name="skid", body="base", position=Vec3(0.1, 0.05, -0.12), radius=0.02
    )
    start = at_rest(
        bird, (0.0, 0.0, 0.0), velocity=Vec3(0.3, 0.1, 0.0), rate=Vec3(0.1, 0.3, -0.2)
    )
    free = FreeObject(
        name="it",
        size=(0.1, 0.2, 0.2),
        mass=0.2,
        position=Vec3(0.18, 0.0, -0.13),
        material=Material(dissipation=1.0, friction=0.4),
    )
    contact = Contact(points=(skid,), objects=(free,))
    vehicles, objects = Scene(contact, vehicle=bird, state=start, gravity=0.0).fly(
        contact, 0.15
    )
    return bird, start, free, vehicles, objects


def test_what_pushes_and_is_pushed_keep_their_momentum(pushed):
    """Linear and angular, about the world's origin: the forces are opposite and at one
    place.
    """
    bird, start, free, vehicles, objects = pushed
    body = bird.base
    moments = np.array([[float(c) for c in row] for row in body.inertia.full().rows])

    def momenta(x, o):
        state = rebuild(start, iter(x.tolist()))
        R = np.array(
            [[float(c) for c in row] for row in state.quaternion.rotation().rows]
        )
        com = R @ np.array([float(c) for c in body.com])
        v = x[7:10] + np.cross(R @ x[10:13], com)
        linear, angular = (
            float(body.mass) * v,
            R @ moments @ x[10:13] + float(body.mass) * np.cross(x[:3] + com, v),
        )
        Q = np.array(
            [
                [float(c) for c in row]
                for row in Quaternion(*o[3:7].tolist()).rotation().rows
            ]
        )
        own = Q @ (np.array([float(c) for c in free.moments]) * o[10:13])
        return linear + 0.2 * o[7:10], angular + own + 0.2 * np.cross(o[:3], o[7:10])

    assert len(bird.links) == 0
    first = momenta(vehicles[0], objects[0, 0])
    last = momenta(vehicles[-1], objects[-1, 0])
    assert np.linalg.norm(objects[-1, 0, 7:10]) > 0.1, "it was pushed"
    assert np.abs(objects[-1, 0, 10:13]).max() > 0.1, "and turned"
    assert last[0] == pytest.approx(first[0], abs=1e-9)
    # the attitude is of fourth order
    assert last[1] == pytest.approx(first[1], abs=1e-7)


def test_a_push_with_friction_and_dissipation_takes_energy(pushed):
    bird, start, free, vehicles, objects = pushed
    total = [
        float(kinetic_energy(bird, rebuild(start, iter(x.tolist()))))
        + energy(o, free)[0]
        for x, o in zip(vehicles[[0, -1]], objects[[0, -1]], strict=True)
    ]
    assert 0.5 * total[0] < total[1] < 0.999 * total[0]


def test_a_light_box_lies_still_on_a_heavy_one():
    """Objects touch each other: the corners of the upper one press the skin of the
    lower one with its weight.
    """
    lower = FreeObject(
        name="lower",
        size=(0.2, 0.2, 0.1),
        mass=0.5,
        position=Vec3(0.0, 0.0, 0.05 - 3.4e-5),
    )
    upper = FreeObject(
        name="upper",
        size=(0.1, 0.1, 0.1),
        mass=0.2,
        position=Vec3(0.0, 0.01, 0.15 - 5.8e-5),
    )
    contact = Contact(surfaces=(Surface(name="ground"),), objects=(lower, upper))
    memory = contact.start(0.005, ())
    assert len(memory.bristles) == contact.meeting_count == 8 + 8 + 8 + 8 + EDGE_PAIRS
    slope = contact.slope(memory, 0.0, PointMotion(BIRD, AWAY, gravity=GRAVITY), ())
    assert float(slope.carried[1].velocity.z) == pytest.approx(
        4 * 5000 * 2.4e-5 / 0.2 - GRAVITY, abs=1e-6
    )
    assert float(slope.carried[0].velocity.z) == pytest.approx(
        (4 * 5000 * 3.4e-5 - 4 * 5000 * 2.4e-5) / 0.5 - GRAVITY, abs=1e-6
    )


def corners(size, com):
    """Places of a box's corners from its centre of mass."""
    return [
        0.5 * np.array(signs) * size - com
        for signs in itertools.product((-1, 1), repeat=3)
    ]


@pytest.mark.parametrize("com", [(0.0, 0.0, 0.0), (0.02, -0.01, 0.01)])
def test_mobility_is_the_largest_eigenvalue_of_a_box_on_its_faces(com):
    """NumPy's eigenvalues of J^T J over the corners of each face; a centre beside the
    middle may be bounded above.
    """
    size, mass = np.array([0.1, 0.08, 0.06]), 0.1
    body = FreeObject(name="it", size=tuple(size), mass=mass, com=Vec3(*com))
    inertia = np.array([float(each) for each in body.moments])
    largest = 0.0
    for axis, side in itertools.product(range(3), (-1, 1)):
        n = np.eye(3)[axis]
        face = [r for r in corners(size, np.array(com)) if (r + com)[axis] * side > 0.0]
        rows = np.array(
            [
                np.concatenate([n / math.sqrt(mass), np.cross(r, n) / np.sqrt(inertia)])
                for r in face
            ]
        )
        largest = max(largest, np.linalg.eigvalsh(rows.T @ rows).max())
    if any(com):
        assert largest <= float(body.mobility) <= 1.6 * largest
    else:
        assert float(body.mobility) == pytest.approx(largest, rel=1e-9)


@pytest.mark.parametrize(
    ("size", "inertia"),
    [
        ((0.3, 0.02, 0.03), (2e-5, 4e-4, 3.9e-4)),
        ((0.2, 0.15, 0.01), (2e-5, 4e-4, 3.9e-4)),
        ((0.1, 0.08, 0.06), ()),
    ],
)
def test_names_of_the_axes_change_no_mobility(size, inertia):
    com, inertia = (
        (0.02, 0.005, -0.003),
        inertia or [*uniform_moments("box", size, 0.1)],
    )
    found = []
    for order in itertools.permutations(range(3)):
        sizes, moments, middle = (
            [each[i] for i in order] for each in (size, inertia, com)
        )
        body = FreeObject(
            name="it",
            size=tuple(sizes),
            mass=0.1,
            inertia=Vec3(*moments),
            com=Vec3(*middle),
        )
        found.append(
            (float(body.mobility), float(body.gyration), float(body.mobility_at(0.02)))
        )
    assert found[0] == pytest.approx((found[0][0], min(inertia) / 0.1, found[0][2]))
    for each in found[1:]:
        assert each == pytest.approx(found[0], rel=1e-12)


def test_moments_of_uniform_bodies():
    """Monte Carlo over the volume: 1 % of 40 000 points."""
    rng = np.random.default_rng(5)
    points = rng.uniform(-0.5, 0.5, (40000, 3))
    for shape, size, inside, scale in (
        ("box", (0.3, 0.2, 0.1), np.ones(40000, bool), (0.3, 0.2, 0.1)),
        ("sphere", (0.1,), (points**2).sum(axis=1) < 0.25, (0.2, 0.2, 0.2)),
        (
            "cylinder",
            (0.1, 0.5),
            (points[:, :2] ** 2).sum(axis=1) < 0.25,
            (0.2, 0.2, 0.5),
        ),
    ):
        p = points[inside] * scale
        expected = [
            2.0 * (p**2).mean(axis=0)[[a, b]].sum() for a, b in ((1, 2), (0, 2), (0, 1))
        ]
        found = FreeObject(name="it", shape=shape, size=size, mass=2.0).moments
        assert [*found] == pytest.approx(expected, rel=0.02)


def test_lighter_objects_and_stiffer_materials_ask_for_shorter_steps():
    steps = [
        float(with_object(BOX, mass=mass).largest_step) for mass in (0.3, 0.03, 0.003)
    ]
    assert steps[0] > 2.0 * steps[1] > 4.0 * steps[2]
    assert steps[1] / steps[2] == pytest.approx(math.sqrt(10.0), rel=0.15)
    stiff = dataclasses.replace(BOX.objects[0].material, stiffness=45000.0)
    assert float(with_object(BOX, material=stiff).largest_step) == pytest.approx(
        float(BOX.largest_step) / 3.0, rel=0.2
    )


@pytest.mark.parametrize(
    ("height", "speed", "far"),
    [
        (0.036, 0.0, True),
        (0.034, 0.0, False),
        (0.039, -1.0, False),
        (0.041, -1.0, True),
    ],
)
def test_an_object_is_far_while_it_stays_five_millimetres_away(height, speed, far):
    there = with_object(
        BOX, position=Vec3(0.0, 0.0, height), velocity=Vec3(0.0, 0.0, speed)
    )
    assert (
        bool(there.far(there.start(0.005, ()), PointMotion(BIRD, AWAY), 0.005)) is far
    )


def test_the_attitude_is_put_in_unit_length_at_control_instants():
    memory = BOX.start(0.005, ())
    long = dataclasses.replace(
        memory.carried[0], attitude=Quaternion(0.9, 0.1, 0.3, -0.4)
    )
    after = BOX.advance(
        dataclasses.replace(memory, carried=(long,)), 0.1, 0.005, AWAY, ()
    )
    assert sum(float(c) ** 2 for c in after.carried[0].attitude) == pytest.approx(
        1.0, abs=1e-15
    )
    assert float(after.carried[0].attitude.x) == pytest.approx(0.1 / math.sqrt(1.07))


@pytest.mark.parametrize(
    ("numbers", "refusal"),
    [
        ({"mass": 0.0}, "object.mass = 0.0: must be above 0"),
        ({"mass": math.nan}, "object.mass"),
        ({"shape": "plane", "size": ()}, "object.shape = 'plane': must be one of"),
        ({"shape": "torus"}, "object.shape = 'torus'"),
        ({"size": (0.1, 0.1)}, "must be 3 numbers, x, y, z"),
        ({"size": (0.1, 0.1, -0.1)}, "object.size"),
        (
            {"inertia": Vec3(1.0, 1.0, 3.0)},
            "no moment may be larger than the sum of the other two",
        ),
        ({"inertia": Vec3(1.0, 1.0, 0.0)}, "must be above 0, or left out"),
        ({"name": ""}, "object.name = '': must not be empty"),
        (
            {"standing": True, "velocity": Vec3(1.0, 0.0, 0.0)},
            "object.standing = true: must be false",
        ),
    ],
)
def test_an_object_that_no_world_has_is_refused(numbers, refusal):
    with pytest.raises(RecordError) as caught:
        FreeObject(**({"name": "it", "size": (0.1, 0.1, 0.1), "mass": 0.1} | numbers))
    assert refusal in str(caught.value)
    assert "\n" not in str(caught.value)


def test_names_are_of_one_surface_or_object_only():
    for twice in (
        {"objects": (*BOX.objects, *BOX.objects)},
        {"objects": (dataclasses.replace(BOX.objects[0], name="ground"),)},
        {"objects": (dataclasses.replace(BOX.objects[0], name="spot"),)},
    ):
        with pytest.raises(RecordError, match="must be of one only"):
            dataclasses.replace(BOX, **twice)


@pytest.fixture(scope="module")
def spinning():
    """Two points of a vehicle at rest on the top of a box that turns about z and sinks:
    contact, memory, touches.
    """
    points = tuple(
        ContactPoint(name=name, body="base", position=Vec3(x, 0.02, -0.12))
        for name, x in (("a", 0.03), ("b", -0.02))
    )
    box = FreeObject(
        name="it",
        size=(0.2, 0.2, 0.1),
        mass=0.05,
        position=Vec3(0.0, 0.0, -0.1695),
        velocity=Vec3(0.0, 0.0, 0.01),
        angular_velocity=Vec3(0.0, 0.0, 2.0),
        material=Material(stiffness=2000.0, dissipation=2.0, friction=0.7),
    )
    contact = Contact(
        points=points,
        objects=(box,),
        surfaces=(Surface(name="ground", position=(0.0, 0.0, -1.0)),),
    )
    memory, motion = (
        contact.start(0.005, ()),
        PointMotion(BIRD, at_rest(BIRD, (0.0, 0.0, 0.0))),
    )
    return (
        contact,
        memory,
        motion,
        [each.touch for each in contact.meetings(memory, motion)[2:4]],
    )


def test_a_point_slips_against_what_turns_under_it(spinning):
    """The skin goes with w x r where the point is."""
    _, _, _, touches = spinning
    for touch, x in zip(touches, (0.03, -0.02), strict=True):
        assert [*touch.slip][:2] == pytest.approx([2.0 * 0.02, -2.0 * x], abs=1e-9)
        assert float(touch.slip.z) == pytest.approx(-0.01)
        assert float(touch.depth) == pytest.approx(5e-4)


def test_force_and_friction_of_a_light_body_follow_its_mass_and_act_where_it_touches(
    spinning,
):
    """f = k d (1 + c dd/dt), d being 0.5 mm, and the bristle's damping 5 N s/m sqrt(m /
    20 g).
    """
    contact, memory, motion, touches = spinning
    mass = 1.0 / (1.0 / 0.02 + float(contact.objects[0].mobility))
    (wrench,) = contact.wrenches(memory, 0.0, motion, ())
    places = [
        np.array([*motion.position(point.position)], dtype=float)
        for point in contact.points
    ]
    forces = [np.array([*touch.force], dtype=float) for touch in touches]
    assert [*wrench.force_W] == pytest.approx(sum(forces))
    assert [*wrench.torque_W] == pytest.approx(
        sum(np.cross(place, f) for place, f in zip(places, forces, strict=True))
    )
    for touch in touches:
        assert float(touch.normal) == pytest.approx(2000.0 * 5e-4 * 1.02)
        slip = np.array([float(touch.slip.x), float(touch.slip.y), 0.0])
        damping = min(1.0, float(touch.normal)) * 5.0 * math.sqrt(mass / 0.02)
        assert [*touch.friction] == pytest.approx(-damping * slip, abs=1e-9)


def test_a_slow_touch_is_smoothed_over_the_step_of_its_mass():
    """Just above the skin the mean over the way of a step is (way / 2 - height)^2 / (2
    way).
    """
    box = FreeObject(
        name="it",
        size=(0.2, 0.2, 0.1),
        mass=0.05,
        position=Vec3(0.0, 0.0, -0.17005),
        velocity=Vec3(0.0, 0.0, 0.2),
        material=Material(dissipation=0.0, friction=0.0),
    )
    contact = Contact(
        points=(ContactPoint(name="a", body="base", position=Vec3(0.0, 0.0, -0.12)),),
        objects=(box,),
    )
    (meeting,) = contact.meetings(
        contact.start(0.005, ()), PointMotion(BIRD, at_rest(BIRD, (0.0, 0.0, 0.0)))
    )
    mass = 1.0 / (1.0 / 0.02 + float(box.mobility))
    way = 0.2 * 0.7 * 0.85 * math.sqrt(mass / 5000.0)
    assert float(meeting.touch.normal) == pytest.approx(
        5000.0 * (0.5 * way - 5e-5) ** 2 / (2.0 * way), rel=1e-6
    )


def test_steps_are_those_of_the_masses_that_meet():
    soft, hard = (
        Material(stiffness=1000.0, friction=0.0),
        Material(stiffness=8000.0, friction=0.0),
    )
    heavy = FreeObject(
        name="heavy",
        size=(0.1, 0.1, 0.1),
        mass=0.1,
        material=hard,
        position=Vec3(0.0, 0.0, 1.0),
    )
    light = FreeObject(name="light", size=(0.1, 0.1, 0.1), mass=0.01, material=soft)
    contact = Contact(
        surfaces=(Surface(name="ground", material=hard),),
        points=SPOT,
        objects=(heavy, light),
    )

    def step(mass, stiffness, share=0.7):
        return pytest.approx(share * 0.85 * math.sqrt(mass / stiffness))

    def both(a, b):
        return 1.0 / (1.0 / a + 1.0 / b)

    a, b = (1.0 / float(each.mobility) for each in (heavy, light))
    assert [(what, float(each)) for what, each in contact.steps] == [
        ("the material of surface 'ground'", step(0.02, 8000.0, 1.0)),
        ("the mass of 'heavy'", step(both(a, 0.02), 8000.0)),
        ("the mass of 'heavy'", step(both(a, b), 8000.0)),
        ("the mass of 'heavy'", step(a, 8000.0)),
        ("the mass of 'light'", step(both(b, 0.02), 1000.0)),
        ("the mass of 'light'", step(both(a, b), 1000.0)),
        ("the mass of 'light'", step(b, 8000.0)),
    ]
    assert float(contact.largest_step) == step(both(a, b), 8000.0)


def test_a_box_on_a_mechanism_bears_the_share_of_a_body_that_turns():
    box = FreeObject(
        name="box", size=(0.1, 0.1, 0.1), mass=0.1, position=Vec3(0.0, 0.0, 1.0)
    )
    tray = Mechanism(
        name="tray",
        kind="drawer",
        size=(0.3, 0.3, 0.02),
        mass=0.5,
        material=Material(friction=0.0),
    )
    asked = [
        float(each)
        for what, each in Contact(objects=(box,), mechanisms=(tray,)).steps
        if "'tray'" in what
    ]
    mass = 1.0 / (float(box.mobility) + 1.0 / 0.5)
    assert asked[0] == pytest.approx(0.7 * 0.85 * math.sqrt(mass / 5000.0))


def test_a_semi_implicit_step_goes_on_with_the_new_velocities():
    body, contact = BOX.objects[0], BOX
    memory = contact.start(0.005, ())
    first = memory.carried[0]
    slope = contact.slope(memory, 0.0, PointMotion(BIRD, AWAY, gravity=GRAVITY), ())
    pushed = body.slope(first, Vec3(0.1, 0.0, 0.0), Vec3(1e-3, 0.0, 0.0), 0.0)
    after = contact.euler_step(
        memory, dataclasses.replace(slope, carried=(pushed,)), 0.01
    ).carried[0]
    alpha = 1e-3 / float(body.moments.x)
    assert float(after.velocity.x) == pytest.approx(0.01)
    assert float(after.position.x - first.position.x) == pytest.approx(1e-4)
    assert float(after.rate.x) == pytest.approx(alpha * 0.01)
    assert 2.0 * float(after.attitude.x) == pytest.approx(alpha * 1e-4, rel=1e-3)


@pytest.mark.parametrize(
    ("shape", "size"),
    [("box", (0.1, 0.08, 0.06)), ("cylinder", (0.04, 0.1)), ("sphere", (0.05,))],
)
def test_spots_lie_on_the_skin_and_one_of_them_is_its_deepest_place(shape, size):
    body = FreeObject(
        name="it", shape=shape, size=size, mass=0.1, com=Vec3(0.01, -0.02, 0.005)
    )
    rng = np.random.default_rng(12)
    for _ in range(5):
        turn, n = rng.normal(size=3), rng.normal(size=3)
        n /= np.linalg.norm(n)
        lying = dataclasses.replace(
            body, position=Vec3(0.3, -0.2, 1.0), angles=Vec3(*turn.tolist())
        )
        frame = lying.frame(lying.start())
        places, radii = zip(
            *lying.spots(frame, lambda place, n=n: Vec3(*n.tolist())), strict=True
        )
        assert len(places) == lying.spot_count
        own = np.array([[*each] for each in places], dtype=float) - (0.3, -0.2, 1.0)
        own = own @ Rotation.from_euler("xyz", turn).as_matrix()
        assert [*frame.position] == pytest.approx([0.3, -0.2, 1.0])
        down = Rotation.from_euler("xyz", turn).inv().apply(-n)
        if shape == "box":
            assert np.abs(own) == pytest.approx(np.tile(0.5 * np.array(size), (8, 1)))
            deepest = 0.5 * np.abs(down) @ size
        elif shape == "cylinder":
            assert np.hypot(own[:, 0], own[:, 1]) == pytest.approx([0.04] * 6)
            assert np.abs(own[:, 2]) == pytest.approx([0.05] * 6)
            deepest = 0.04 * np.hypot(down[0], down[1]) + 0.05 * abs(down[2])
        else:
            deepest = 0.05
        assert (own @ down + np.array(radii, dtype=float)).max() == pytest.approx(
            deepest, rel=1e-6
        )
        assert len(np.unique(own.round(9), axis=0)) == len(own)


def test_mobility_of_cylinders_and_balls():
    """Standing, lying on two rims, or pushed at the skin: the largest of them, by NumPy
    and by hand.
    """
    radius, length, mass = 0.04, 0.1, 0.1
    for size in ((radius, length), (0.1, 0.01), (0.01, 0.2)):
        r, half = size[0], 0.5 * size[1]
        body = FreeObject(name="it", shape="cylinder", size=size, mass=mass)
        inertia = np.array([float(each) for each in body.moments])

        def largest(places, n, inertia=inertia):
            rows = [
                np.concatenate(
                    [n / math.sqrt(mass), np.cross(place, n) / np.sqrt(inertia)]
                )
                for place in places
            ]
            return np.linalg.eigvalsh(np.array(rows).T @ np.array(rows)).max()

        rim = [
            (r * math.cos(t), r * math.sin(t), half)
            for t in (0.0, 2.0 * math.pi / 3.0, 4.0 * math.pi / 3.0)
        ]
        stands = largest(rim, np.array([0.0, 0.0, 1.0]))
        lies = largest([(r, 0.0, half), (r, 0.0, -half)], np.array([1.0, 0.0, 0.0]))
        pushed = 1.0 / mass + max(r, half) ** 2 / inertia.min()
        assert float(body.mobility) == pytest.approx(
            max(stands, lies, pushed), rel=1e-9
        )
    ball = FreeObject(name="it", shape="sphere", size=(radius,), mass=mass)
    assert float(ball.mobility) == pytest.approx(3.5 / mass)
