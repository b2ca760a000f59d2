"""Mechanisms against closed forms, energies and SciPy; what holds them, what gives,
where their surfaces are.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from skyarm.algebra import Vec3
from skyarm.compile import trace
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.plant.interface import Truth
from skyarm.plant.surroundings import Surroundings
from skyarm.records.leaves import leaves, rebuild
from skyarm.world.contact import Contact, ContactPoint, Detent, Mechanism, Surface
from skyarm.world.contact.mechanism import MechanismMotion
from support.worlds import at_rest, fall, limp

GRAVITY = 9.8


def hinge(**numbers):
    return Mechanism(
        **{"name": "m", "kind": "hinge", "axis": (0, 0, 1), "inertia": 0.5, **numbers}
    )


def slide(**numbers):
    return Mechanism(
        **{"name": "m", "kind": "slide", "axis": (0, 0, 2), "mass": 0.5, **numbers}
    )


def moved(
    mechanism,
    seconds,
    *,
    push=(0.0, 0.0, 0.0),
    twist=(0.0, 0.0, 0.0),
    rate=0.0,
    step=None,
    gravity=0.0,
):
    """Coordinates and rates (N, 2) under a constant force and torque at the origin, by
    Runge-Kutta steps.
    """
    memory = mechanism.start()
    dt = mechanism.largest_step if step is None else step
    count = math.ceil(seconds / dt - 1e-9)
    dt, x = seconds / count, np.array(leaves(memory))
    x[1] = rate
    program = trace(
        lambda at: mechanism.slope(at, Vec3(*push), Vec3(*twist), gravity), memory
    )

    def slope(at):
        return np.array(program.flat(tuple(at.tolist())))

    rows = [x]
    for _ in range(count):
        a = slope(x)
        b = slope(x + 0.5 * dt * a)
        c = slope(x + 0.5 * dt * b)
        x = x + dt / 6.0 * (a + 2.0 * b + 2.0 * c + slope(x + dt * c))
        rows.append(x)
    return np.array(rows)


def test_a_torque_turns_a_hinge_and_a_force_moves_a_slide_by_its_inertia():
    """q = effort t^2 / 2 m: the part about, or along, the axis alone."""
    turned = moved(
        hinge(), 0.8, step=0.02, twist=(3.0, -2.0, 0.25), push=(5.0, 4.0, 3.0)
    )[-1]
    assert turned[:2] == pytest.approx([0.25 / 0.5 * 0.32, 0.25 / 0.5 * 0.8], rel=1e-9)
    along = moved(
        slide(angles=(math.pi / 2.0, 0.0, 0.0)),
        0.8,
        step=0.02,
        push=(3.0, -0.25, 1.0),
        twist=(1.0, 1.0, 1.0),
    )[-1]
    # its z axis is the world's -y, of any length
    assert along[:2] == pytest.approx([0.25 / 0.5 * 0.32, 0.25 / 0.5 * 0.8], rel=1e-9)


def test_a_hinge_with_a_weight_is_a_pendulum():
    """A rod about a level axis, released level: SciPy's solution of I q'' = m g l cos
    q - c q'.
    """
    rod = hinge(axis=(0, 1, 0), mass=2.0, com=(0.3, 0, 0), damping=0.4)
    rows = moved(rod, 1.5, step=0.006, gravity=GRAVITY)

    def right(_t, x):
        return [x[1], (2.0 * GRAVITY * 0.3 * math.cos(x[0]) - 0.4 * x[1]) / 0.5]

    exact = solve_ivp(right, (0.0, 1.5), (0.0, 0.0), rtol=1e-10, atol=1e-12).y[:, -1]
    assert rows[-1, :2] == pytest.approx(exact, abs=1e-7)
    assert rows[:, 0].max() > math.pi / 2.0
    falling = moved(slide(mass=0.2), 0.5, step=0.02, gravity=GRAVITY)[-1]
    assert falling[:2] == pytest.approx([-GRAVITY * 0.125, -GRAVITY * 0.5])


def test_a_spring_swings_about_its_rest():
    rows = moved(slide(stiffness=50.0, rest=0.02, initial=0.05), 0.4, step=0.001)
    assert rows[-1, 0] == pytest.approx(0.02 + 0.03 * math.cos(10.0 * 0.4), abs=1e-9)


@pytest.mark.parametrize("make", [hinge, slide])
def test_dry_friction_holds_what_is_weaker_and_takes_its_part_of_what_is_stronger(make):
    still, along = make(friction=0.4), "twist" if make is hinge else "push"
    length = 2e-3 if make is hinge else 2e-4
    for load in (0.2, -0.36):
        held = moved(still, 1.0, **{along: (0.0, 0.0, load)})
        # it vibrates on its bristle while it takes the load, then nothing moves
        assert held[-1, 2] == pytest.approx(load / 0.4 * length, rel=5e-3)
        assert abs(held[-1, 0]) < 15.0 * length
        assert abs(held[-1, 0] - held[-len(held) // 10, 0]) < 3e-2 * length
    gave = moved(still, 0.5, **{along: (0.0, 0.0, 0.6)})
    assert (gave[-1, 1] - gave[len(gave) // 2, 1]) / 0.25 == pytest.approx(
        (0.6 - 0.4) / 0.5, rel=1e-2
    )
    back = moved(still, 0.3, rate=-1.0)
    assert back[-1, 1] + 1.0 == pytest.approx(0.4 / 0.5 * 0.3, rel=2e-2)
    soft = moved(make(friction=0.4, bristle=0.01), 1.2, **{along: (0.0, 0.0, 0.2)})
    assert soft[-1, 2] == pytest.approx(0.005, rel=1e-2)


def test_it_vibrates_on_its_bristle_with_half_of_critical_damping():
    """Far below sliding: q = v / w_d exp(-w t / 2) sin(w_d t), w^2 = friction /
    (bristle m).
    """
    rows = moved(hinge(friction=0.4, inertia=2.0), 0.1, rate=1e-6, step=0.001)
    w, t = math.sqrt(0.4 / 2e-3 / 2.0), 0.001 * np.arange(101)
    damped = w * math.sqrt(0.75)
    assert rows[:, 0] == pytest.approx(
        1e-6 / damped * np.exp(-0.5 * w * t) * np.sin(damped * t), abs=1e-11
    )


@pytest.mark.parametrize(("damping", "elastic"), [(0.0, True), (2.0, False)])
def test_a_stop_gives_no_more_than_it_takes(damping, elastic):
    """At many phases of a step and both ends: of two elastic ones 0.3 % is lost,
    nothing won; others take some.
    """
    for initial in (0.0, 0.0011, 0.0022):
        rows = moved(
            hinge(lower=-0.05, upper=0.05, initial=initial, stop_damping=damping),
            0.4,
            rate=0.6,
        )
        ends = np.abs(rows[np.abs(rows[:, 0]) < 0.03, 1])
        assert rows[:, 0].max() < 0.056
        assert rows[:, 0].min() > -0.056
        assert ends.max() < 0.6 * (1.0 + 1e-4)
        assert ends.min() > 0.997 * 0.6 if elastic else ends.min() < 0.6 * ends.max()


def test_a_stop_of_a_given_stiffness_is_entered_as_far_as_a_load_presses():
    pressed = moved(
        hinge(upper=0.1, initial=0.1, stop_stiffness=800.0, damping=40.0),
        0.8,
        twist=(0.0, 0.0, 4.0),
    )[-1]
    assert pressed[0] == pytest.approx(0.1 + 4.0 / 800.0, rel=1e-6)
    light = moved(
        slide(upper=0.1, initial=0.1, mass=0.02, damping=20.0),
        0.1,
        push=(0.0, 0.0, 1.0),
    )[-1]
    assert light[0] - 0.1 == pytest.approx(1.0 / 5000.0, rel=1e-4)
    usual = moved(
        hinge(upper=0.1, initial=0.1, damping=100.0), 0.3, twist=(0.0, 0.0, 4.0)
    )[-1]
    assert usual[0] - 0.1 == pytest.approx(4.0 / (0.5 * 200.0**2), rel=1e-4)


@pytest.mark.parametrize("make", [hinge, slide])
def test_both_ends_are_alike(make):
    """A mirrored mechanism pushes the other way in mirrored motion: into its stops, out
    of them, and between.
    """
    inner = {"stiffness": 4.0, "damping": 0.7, "friction": 0.3}
    way = make(lower=-0.3, upper=0.5, rest=0.1, **inner)
    mirror = make(lower=-0.5, upper=0.3, rest=-0.1, **inner)
    nothing = Vec3(0.0, 0.0, 0.0)
    for q in (-0.303, -0.3, 0.1, 0.5, 0.502):
        for rate in (-0.4, 0.0, 0.4):
            for z in (-1e-4, 2e-4):
                there, other = (
                    MechanismMotion(coordinate=s * q, rate=s * rate, bristle=(s * z,))
                    for s in (1.0, -1.0)
                )
                a, b = (
                    way.slope(there, nothing, nothing, 0.0),
                    mirror.slope(other, nothing, nothing, 0.0),
                )
                assert (a.rate, a.bristle[0]) == pytest.approx(
                    (-b.rate, -b.bristle[0]), abs=1e-12
                )


@pytest.mark.parametrize(("share", "opens"), [(0.96, False), (1.04, True)])
def test_a_detent_holds_up_to_its_force_and_gives_above_it(share, opens):
    door = hinge(
        detent=Detent(force=0.8, width=0.04, place=0.1),
        lower=0.0,
        upper=1.0,
        initial=0.1,
        damping=10.0,
    )
    rows = moved(door, 5.0, step=0.02, twist=(0.0, 0.0, 0.8 * share))
    assert (rows[-1, 0] > 0.15) == opens
    if not opens:
        assert 0.1 < rows[-1, 0] < 0.12, "less than half of its way"


def test_a_detent_takes_what_it_gives_back():
    """The work over the hump is 8/15 F w, half of it to the middle; the way back gives
    it back.
    """
    click = slide(detent=Detent(force=3.0, width=0.01, place=0.002))
    rows = moved(click, 0.04, rate=0.5, step=1e-4)
    inside, behind = (
        rows[np.argmin(np.abs(rows[:, 0] - 0.007))],
        rows[rows[:, 0] > 0.013][0],
    )
    u = (inside[0] - 0.002) / 0.01
    work = 3.0 * 0.01 * 16.0 * (u**3 / 3.0 - u**4 / 2.0 + u**5 / 5.0)
    assert 0.25 * 0.5**2 - 0.25 * inside[1] ** 2 == pytest.approx(work, rel=1e-6)
    assert work == pytest.approx(4.0 / 15.0 * 3.0 * 0.01, rel=0.1)
    assert 0.25 * 0.5**2 - 0.25 * behind[1] ** 2 == pytest.approx(
        8.0 / 15.0 * 3.0 * 0.01, rel=1e-6
    )
    back = moved(
        slide(detent=Detent(force=3.0, width=0.01), initial=0.012),
        0.06,
        rate=-behind[1],
        step=1e-4,
    )
    assert back[-1, 1] == pytest.approx(-0.5, rel=1e-6)
    drawn = moved(
        slide(detent=Detent(force=3.0, width=0.01), initial=0.004, damping=1.0), 0.1
    )
    assert drawn[-1, 0] < 0.0, "it draws shut again"


@pytest.mark.parametrize("make", [hinge, slide])
def test_places_move_as_its_coordinate_says_and_forces_work_as_they_do(make):
    """Velocities against differences of places; the work of a force at a place against
    that of the coordinate.
    """
    rng, h = np.random.default_rng(3), 1e-6
    for _ in range(10):
        m = make(
            axis=tuple(rng.normal(size=3)),
            angles=tuple(rng.normal(size=3)),
            position=tuple(rng.normal(size=3)),
        )
        start = m.start()
        memories = [
            rebuild(start, iter((0.4 + 0.7 * each, 0.7))) for each in (-h, 0.0, h)
        ]
        own, force = rng.normal(size=(2, 3))
        frames = [m.frame(each) for each in memories]
        places = [
            np.array([*(f.position + f.rotation.apply(Vec3(*own)))], dtype=float)
            for f in frames
        ]
        velocity = np.array([*frames[1].velocity_at(Vec3(*places[1]))], dtype=float)
        assert (places[2] - places[0]) / (2.0 * h) == pytest.approx(velocity, abs=1e-7)
        lever = Vec3(*(places[1] - np.array([*frames[1].position], dtype=float)))
        slope = m.slope(memories[1], Vec3(*force), lever.cross(Vec3(*force)), 0.0)
        assert float(slope.rate) * 0.5 * 0.7 == pytest.approx(
            float(velocity @ force), rel=1e-9
        )
        assert slope.coordinate == 0.7


def test_words_say_how_a_mechanism_moves_and_what_of_it_is_touched():
    """Places on the skins: a door ahead of its hinge, a drawer and a button behind
    their fronts.
    """
    numbers = {"name": "m", "mass": 2.0}
    door = Mechanism(**numbers, kind="door", size=(0.8, 2.0, 0.04))
    valve = Mechanism(**numbers, kind="valve", size=(0.15, 0.02))
    lever = Mechanism(**numbers, kind="valve", size=(0.3, 0.04, 0.02))
    drawer = Mechanism(**numbers, kind="drawer", size=(0.5, 0.4, 0.2))
    button = Mechanism(**numbers, kind="button", size=(0.03, 0.02))
    skins = {
        door: [(0.8, 0, 0), (0, 0, 0), (0.4, 0.02, 0), (0.4, 0, 1.0)],
        valve: [(0.15, 0, 0), (0, 0.15, 0), (0.1, 0.0, 0.01)],
        lever: [(0.3, 0, 0), (0, 0, 0), (0.1, 0.02, 0), (0.1, 0, 0.01)],
        drawer: [(0, 0, 0), (-0.5, 0, 0), (-0.1, 0.2, 0), (-0.1, 0, 0.1)],
        button: [(0.01, 0, 0), (0.03, 0, -0.01), (0, 0, -0.02)],
    }
    for m, places in skins.items():
        (surface,) = m.surfaces
        for place in places:
            assert float(
                surface.depth(Vec3(*map(float, place)), 0, 0.0)[0]
            ) == pytest.approx(0.0, abs=1e-9)
    # one radian, or one metre, on
    for m, place in (
        (door, (0.8 * math.cos(1.0), 0.8 * math.sin(1.0), 0.0)),
        (drawer, (1, 0, 0)),
        (button, (0, 0, -1)),
    ):
        frame = m.frame(rebuild(m.start(), iter((1.0, 0.0))))
        own = Vec3(0.8 if m is door else 0.0, 0.0, 0.0)
        assert [*(frame.position + frame.rotation.apply(own))] == pytest.approx(place)
    assert door.generalized_inertia == pytest.approx(2.0 * (0.64 / 3.0 + 0.0016 / 12.0))
    assert lever.generalized_inertia == pytest.approx(
        2.0 * (0.09 / 3.0 + 0.0016 / 12.0)
    )
    assert (valve.generalized_inertia, drawer.generalized_inertia) == (
        pytest.approx(2.0 * 0.15**2 / 2.0),
        2.0,
    )
    assert (
        Mechanism(
            **numbers, kind="door", size=(0.8, 2.0, 0.04), inertia=0.3
        ).generalized_inertia
        == 0.3
    )


ARM = Surface(name="arm", shape="box", size=(0.1, 0.4, 0.1), position=(0.0, 0.2, 0.05))


def test_a_semi_implicit_step_moves_with_the_new_rate():
    """Rate first, the coordinate with it; the bristle has moved before forces are
    taken.
    """
    m = hinge(friction=0.1)
    before, slope = (
        rebuild(m.start(), iter(numbers))
        for numbers in ((0.3, 0.5, 1e-3), (0.5, 2.0, 4e-3))
    )
    assert leaves(m.euler_step(before, slope, 0.1)) == pytest.approx(
        [0.3 + 0.1 * 0.7, 0.7, 1e-3]
    )
    assert leaves(m.before_euler_step(before, slope, 0.1)) == pytest.approx(
        [0.3, 0.5, 1e-3 + 4e-4]
    )


def test_left_out_nothing_brakes_a_mechanism_and_its_stops_take_energy():
    m = hinge()
    assert (m.stiffness, m.rest, m.damping, m.friction, m.detent) == (
        0.0,
        0.0,
        0.0,
        0,
        None,
    )
    assert (m.mass, m.initial, m.lower, m.upper) == (0, 0.0, -math.inf, math.inf)
    assert (m.stop_stiffness, m.stop_damping, m.logged(m.start())) == (
        0,
        2.0,
        (0.0, 0.0),
    )


def test_steps_follow_from_the_fastest_of_springs_friction_detents_and_stops():
    assert hinge().largest_step == 2.5e-3
    assert hinge(stiffness=5e5).largest_step == pytest.approx(1.5 / 1e3)
    assert hinge(damping=1e3).largest_step == pytest.approx(1.5 / 2e3)
    assert slide(friction=100.0).largest_step == pytest.approx(1.5 / 1e3)
    # the steepest place of the hump, by differences
    click = Detent(force=2.0, width=1e-3)
    q = np.linspace(0.0, 1e-3, 20001)
    steepest = np.abs(np.gradient([click.at(float(each)) for each in q], q)).max()
    assert slide(detent=click, mass=0.01).largest_step == pytest.approx(
        1.5 / math.sqrt(steepest / 0.01), rel=1e-6
    )
    assert slide(upper=1.0, stop_stiffness=5e5).largest_step == pytest.approx(
        0.85 / 1e3
    )
    assert slide(lower=-1.0, stop_stiffness=5e5).largest_step == pytest.approx(
        0.85 / 1e3
    )
    # 0.45 m from the axis at most, 0.5 kg m^2
    far = 0.2 + 0.5 * math.sqrt(0.1**2 + 0.4**2 + 0.1**2)
    assert hinge(parts=(ARM,)).mobility == pytest.approx(far**2 / 0.5)
    assert slide(parts=(ARM,)).mobility == pytest.approx(1.0 / 0.5)
    assert hinge(axis=(0, 3, 0), parts=(ARM,)).mobility < hinge(parts=(ARM,)).mobility


@pytest.mark.parametrize(
    ("numbers", "words"),
    [
        (
            {"kind": "gate"},
            "kind = 'gate': must be one of hinge, slide, door, valve, drawer, button",
        ),
        ({"name": ""}, "name = '': must not be empty"),
        ({"axis": (0, 0, 0)}, "axis: is missing; a hinge has none of its own"),
        ({"kind": "door", "size": (1, 2, 3)}, "axis: must be left out of a door"),
        ({"size": (1, 2, 3)}, "must be left out of a hinge, which is made of parts"),
        (
            {"kind": "valve", "axis": (0, 0, 0), "size": (1,)},
            "must be 2 numbers, radius, thickness or 3 numbers",
        ),
        (
            {"kind": "button", "axis": (0, 0, 0), "inertia": 0},
            "size = .*must be 2 numbers, radius, height",
        ),
        ({"kind": "slide"}, "inertia: must be left out of a slide"),
        ({"inertia": 0.0}, "inertia: is missing; a hinge must have one above 0"),
        (
            {"kind": "slide", "inertia": 0},
            "mass: is missing; a slide must have one above 0",
        ),
        (
            {"kind": "door", "axis": (0, 0, 0), "size": (1, 2, 3), "inertia": 0},
            "mass: is missing; a door",
        ),
        ({"lower": 1.0, "upper": 0.5}, r"lower = 1.0: must be below upper = 0.5"),
        ({"lower": 0.5}, "initial = 0.0: must be between lower = 0.5 and upper = inf"),
        ({"friction": -1.0}, "friction = -1.0: must be at least 0"),
        ({"damping": math.nan}, "damping = nan"),
        ({"upper": math.nan}, "upper = nan"),
        (
            {"parts": (Surface(name="p"),)},
            r"parts\[0\].shape = 'plane': must be a shape with an end",
        ),
    ],
)
def test_mechanisms_that_cannot_be_are_refused_in_one_line(numbers, words):
    with pytest.raises(ValueError, match=words) as error:
        hinge(**numbers)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(("away", "rounds"), [(5.0, 3), (0.0, 3)])
def test_it_moves_the_same_whether_the_vehicle_is_far_or_near(away, rounds):
    """A pendulum with friction beside a limp vehicle that falls, or below its skids: as
    one that is alone.
    """
    swing = hinge(
        axis=(0, 1, 0),
        mass=2.0,
        com=(0.3, 0, 0),
        friction=0.2,
        initial=0.4,
        parts=(ARM,),
        inertia=0.3,
        position=(away, -0.2, -0.16),
    )
    bird = limp()
    contact = Contact(
        mechanisms=(swing,),
        points=(ContactPoint(name="p", body="base", position=Vec3(0.0, 0.0, -0.05)),),
    )
    around = Surroundings(components=(contact,), memories=(contact.start(0.005, ()),))
    plant = RigidBodyPlant(Truth(vehicle=bird, gravity=GRAVITY), around)
    assert plant.substeps(0.005).rounds == rounds
    rows = fall(bird, at_rest(bird, (0.0, 0.0, 0.0)), around, 0.1)
    alone = moved(swing, 0.1, step=0.005 / rounds, gravity=GRAVITY)
    if away:
        assert rows[-1, -3:] == pytest.approx(alone[-1], rel=1e-12)
    else:
        assert abs(rows[-1, -2] - alone[-1, 1]) > 0.02, "it was touched"
