"""The base's shift by a preview: against a solver of boundary value problems, closed
forms, and flown.
"""

import dataclasses
from itertools import pairwise

import numpy as np
import pytest
from law_parts import planned
from scipy.integrate import solve_bvp
from scipy.optimize import brentq

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.blocks.attitude import Posture, posture, upright
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.laws.centroidal.base_shift import (
    FIRST_SHIFT,
    Acting,
    PreviewInstant,
    PreviewInterval,
    Shift,
    _thrusts,
    bounded_shift,
    bounded_sweep,
    coming_levers,
    coming_thrusts,
    tilt_shares,
)
from skyarm.control.laws.centroidal.parameters import FOLLOWING
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.dynamics.kinematics import link_poses
from skyarm.reference import Constant, Ramp, Sine, Sum, hover
from skyarm.reference.preview import samples, samples_ahead
from skyarm.reference.splines import minimum_snap
from skyarm.reference.task_records import Guard, Phase
from skyarm.simulate.first_state import first_loop_state
from skyarm.simulate.inputs import episode_inputs
from skyarm.simulate.reference_clock import Waits
from skyarm.simulate.stages import joined_reference
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Frame
from skyarm.world import ForceWind

G, DT = 9.81, 0.005
LEAST, HELD = 0.02, 0.02
"""Height (m) and square of a rotation of the page."""
ZERO = Vec3(0.0, 0.0, 0.0)
STILL = Acting(force=ZERO, rate=ZERO, drag=0.0)
AHEAD = Taylor((0.0,) * 5)
"""The heading of a vehicle that does not turn."""


@pytest.fixture(scope="module")
def model():
    return Model(vehicle=skyarm.load_vehicle("hummingbird_arm2"), gravity=G)


def test_the_sweep_finds_the_bounded_solution_of_an_equation_whose_terms_change():
    """y'' = (n / l) y + d - a, all of them functions of time: rate at the beginning for
    two values there.
    """
    thrust = lambda t: G + 4.0 * np.sin(6.0 * t)  # noqa: E731
    lever = lambda t: 0.28 + 0.05 * np.cos(9.0 * t)  # noqa: E731
    asked = lambda t: 3.0 * np.sin(4.0 * t + 0.3) - 1.5  # noqa: E731
    times = np.linspace(0.0, 2.0, 201)
    rows = [PreviewInstant(t, 0.0, Vec3(-asked(t), 0.0, 0), lever(t)) for t in times]
    means = [thrust(0.5 * (a + b)) for a, b in pairwise(times)]
    line = bounded_sweep(rows, [*means, thrust(times[-1])])
    span = np.linspace(0.0, 4.0, 400)
    for start in (0.0, 0.2):
        found = solve_bvp(
            lambda t, y: np.array([y[1], thrust(t) / lever(t) * y[0] - asked(t)]),
            lambda a, b, start=start: np.array([a[0] - start, b[0]]),
            span,
            np.zeros((2, span.size)),
            tol=1e-8,
            max_nodes=100_000,
        )
        assert line[0].v.x - line[0].b * start == pytest.approx(
            float(found.sol(0.0)[1]), rel=1e-3
        )
    assert line[0].v.y == 0.0


def level_of(lever):
    """A posture without joints whose tip hangs ``lever`` below the centre of mass in
    the base's origin.
    """
    still = Taylor((0.0,) * 5)
    return Posture(Vec3(still, still, still), Vec3(still, still, still - lever), ())


def on_a_sine(par, w, level, share, begin=0.0):
    """Shift, derivatives and base after a few periods on a sine along y, begun on the
    closed form's solution.
    """
    size = 0.6
    along = lambda t, k: size * w ** (k - 2) * np.sin(w * t + 0.5 * np.pi * k)  # noqa: E731
    shift = dataclasses.replace(
        FIRST_SHIFT, place=Vec3(0.0, share * along(begin, 2), 0.0)
    )
    for k in range(12):
        t = begin + k * DT
        base, ahead = [Vec3(0.0, along(t, i), 0.0) for i in range(5)], []
        for lead in par.preview[FOLLOWING:]:
            still = (0.0, 0.0, 0.0)
            ahead.append(
                (
                    lead,
                    [
                        still,
                        (0.0, along(t + lead, 1), along(t + lead, 2)),
                        *[still] * 4,
                    ],
                )
            )
        before = shift
        moved, shift = bounded_shift(
            par, shift, base, AHEAD, (), level, STILL, ahead, DT
        )
    return before.place, moved, base


@pytest.fixture(scope="module")
def hanging(model):
    """Posture of the arm that hangs straight, and its lever."""
    level = posture(model.vehicle, (Taylor((0.0,) * 5),) * 2, 4)
    return level, float(level.com.z.c[0] - level.tip.z.c[0])


@pytest.mark.parametrize("w", [1.0, 2.5, 4.0])
@pytest.mark.parametrize("begin", [0.0, 0.3])
def test_on_a_sine_the_shift_is_that_of_the_closed_form(model, hanging, w, begin):
    """y = (l / g) a / (1 + l w^2 / g): of a motion so small that the lever hardly
    turns.
    """
    par, (level, lever) = make_centroidal(model, mode="tip").par, hanging
    share = (lever / G) / (1.0 + lever * w * w / G)
    place, moved, base = on_a_sine(par, w, level, share, begin)
    size = share * 0.6
    assert place.y == pytest.approx(share * base[2].y, abs=0.02 * size)
    # an even change of the acceleration from instant to instant is a few per cent off a
    # sine
    for k in range(2):
        assert moved[k].y == pytest.approx(
            share * base[3 + k].y, abs=0.1 * size * max(w, 2.0) ** (k + 1)
        )
    assert abs(place.x) < 1e-3 * size
    assert abs(moved[1].z) < 2.0 * (size * w) ** 2 / lever


def test_every_derivative_is_that_of_the_one_before(model, hanging):
    par, (level, lever) = make_centroidal(model, mode="tip").par, hanging
    share = (lever / G) / (1.0 + lever * 4.0 / G)
    rows = [on_a_sine(par, 2.0, level, share, 0.2 + k * 0.01)[1] for k in range(3)]
    for k in range(2):
        slope = (rows[2][k].y - rows[0][k].y) / 0.02
        assert slope == pytest.approx(rows[1][k + 1].y, rel=0.1, abs=0.02)


TURNING = 1.2
"""rad/s, of a heading in the tests of one that turns."""


def on_a_turning_circle(par, level, place, begin, turn=0.0):
    """Shift, derivatives and instant on a circle of 0.4 m at 2 rad/s, the heading
    turning; ``turn``: of the world.
    """
    w = 2.0

    def at(t, k):
        phase = w * t + 0.5 * np.pi * k + turn
        return Vec3(0.4 * w**k * np.cos(phase), 0.4 * w**k * np.sin(phase), 0.0)

    def seen(t, k):
        return (
            *(
                (c, *more)
                for c, *more in zip(at(t, 0), at(t, 1), at(t, 2), strict=True)
            ),
            (0.3 + TURNING * t + turn, TURNING, 0.0),
        )[k]

    shift = dataclasses.replace(FIRST_SHIFT, place=place)
    for k in range(4):
        t = begin + k * DT
        ahead = [
            (lead, [*(seen(t + lead, i) for i in range(4)), *[(0.0, 0.0, 0.0)] * 2])
            for lead in par.preview[2:]
        ]
        yaw, before = Taylor((0.3 + TURNING * t + turn, TURNING, 0.0, 0.0, 0.0)), shift
        base = [at(t, i) for i in range(5)]
        moved, shift = bounded_shift(par, shift, base, yaw, (), level, STILL, ahead, DT)
    return before.place, moved, t


def turning_solution(lever, t):
    """Steady shift (place, rate, acceleration) on that circle, by a harmonic balance of
    the equation.
    """
    # a = -w^2 r: what joints leave of it in the vehicle's frame, whose heading is psi =
    # 0.3 + TURNING t
    w, left = 2.0, np.diag([HELD / (2.0 + HELD), 1.0])
    mean, half = 0.5 * np.trace(left), 0.5 * (left[0, 0] - left[1, 1])
    # complex numbers: G a = mean a + half e^(2 i psi) conj(a); a = -w^2 0.4 e^(i w t)
    terms = (
        (mean * w * w * 0.4, w),
        (half * w * w * 0.4 * np.exp(0.6j), 2.0 * TURNING - w),
    )
    pace = G / lever
    found = [
        sum(
            size * (1j * rate) ** k * np.exp(1j * rate * t) / (-rate * rate - pace)
            for size, rate in terms
        )
        for k in range(3)
    ]
    return [np.array([each.real, each.imag]) for each in found]


def test_under_a_heading_that_turns_the_shift_is_that_of_the_closed_form(
    model, hanging
):
    """Joints take back the tilts in their plane: the force that is left turns with the
    heading.
    """
    par, (level, lever) = make_centroidal(model, mode="tip").par, hanging
    for begin in (0.0, 0.7, 1.9):
        place, _, _ = turning_solution(lever, begin)
        shift, moved, t = on_a_turning_circle(par, level, Vec3(*place, 0.0), begin)
        there, rate, second = turning_solution(lever, t)
        np.testing.assert_allclose([shift.x, shift.y], there, atol=1e-3)
        np.testing.assert_allclose([moved[0].x, moved[0].y], rate, atol=0.02)
        np.testing.assert_allclose([moved[1].x, moved[1].y], second, atol=0.08)


def test_a_world_that_is_turned_turns_the_shift(model, hanging):
    par, (level, _) = make_centroidal(model, mode="tip").par, hanging
    c, s = np.cos(0.9), np.sin(0.9)
    _, plain, _ = on_a_turning_circle(par, level, Vec3(0.02, -0.01, 0.0), 0.4)
    _, turned, _ = on_a_turning_circle(
        par, level, Vec3(0.02 * c + 0.01 * s, 0.02 * s - 0.01 * c, 0.0), 0.4, turn=0.9
    )
    for one, other in zip(plain, turned, strict=True):
        assert [c * one.x - s * one.y, s * one.x + c * one.y, one.z] == pytest.approx(
            [*other], abs=1e-9
        )


def test_derivatives_are_those_of_the_ones_before_while_the_heading_turns(
    model, hanging
):
    par, (level, lever) = make_centroidal(model, mode="tip").par, hanging
    rows = []
    for k in range(3):
        begin = 0.6 + 0.01 * k
        rows.append(
            on_a_turning_circle(
                par, level, Vec3(*turning_solution(lever, begin)[0], 0.0), begin
            )[1]
        )
    for k in range(2):
        slope = (np.array([*rows[2][k]]) - np.array([*rows[0][k]])) / 0.02
        np.testing.assert_allclose(
            slope[:2], [rows[1][k + 1].x, rows[1][k + 1].y], atol=0.03 * 2.0**k
        )


def without_joints():
    """A vehicle whose tip is fixed to its base."""
    vehicle = skyarm.load_vehicle("hummingbird")
    tip = Frame(name="tip", link=BASE, position=Vec3(0.0, 0.0, -0.3))
    return dataclasses.replace(vehicle, frames=(tip,), end_effector="tip")


@pytest.mark.parametrize("lever", [0.3, -0.3])
def test_a_steady_force_shifts_by_the_lever_below_the_base_and_above(model, lever):
    """y = -(l / g) d / m of an arm whose joints do not help: here a vehicle that has
    none.
    """
    vehicle = without_joints()
    par = make_centroidal(model, mode="tip").par
    par = dataclasses.replace(par, model=Model(vehicle=vehicle, gravity=G))
    force = Vec3(0.2, -0.3, 0.0)
    acting = dataclasses.replace(STILL, force=force)
    shift, base = FIRST_SHIFT, [Vec3(0.0, 0.0, 1.0), ZERO, ZERO, ZERO, ZERO]
    for _ in range(200):
        before = shift.place
        moved, shift = bounded_shift(
            par, shift, base, Taylor((0.4, 0, 0)), (), level_of(lever), acting, (), DT
        )
        # of the way in a period, with its acceleration
        gone = moved[0] * DT + moved[1] * (0.5 * DT**2)
        np.testing.assert_allclose(
            [*shift.place][:2], [*(before + gone)][:2], rtol=1e-9, atol=1e-15
        )
    expected = force * (-lever / (G * float(vehicle.mass)))
    np.testing.assert_allclose([*shift.place], [*expected], rtol=0.01, atol=1e-5)
    assert moved[0].norm() < 1e-3


def test_without_a_preview_the_shift_goes_with_a_force_that_grows(model):
    """y = -(l / g) d / m at a force and y' at its rate: the bounded solution of one
    that grows evenly.
    """
    vehicle, lever = without_joints(), 0.3
    par = make_centroidal(model, mode="tip").par
    par = dataclasses.replace(par, model=Model(vehicle=vehicle, gravity=G))
    force, rate, share = (
        Vec3(0.02, -0.03, 0.0),
        Vec3(0.05, 0.04, 0.0),
        -lever / (G * float(vehicle.mass)),
    )
    acting, base = (
        dataclasses.replace(STILL, force=force, rate=rate),
        [
            Vec3(0.0, 0.0, 1.0),
            ZERO,
            ZERO,
            ZERO,
            ZERO,
        ],
    )
    shift = dataclasses.replace(FIRST_SHIFT, place=force * share)
    moved, _ = bounded_shift(
        par, shift, base, AHEAD, (), level_of(lever), acting, (), DT
    )
    np.testing.assert_allclose([*moved[0]][:2], [*(rate * share)][:2], rtol=0.01)


@pytest.mark.parametrize("yaw", [0.0, 0.7, -2.0])
def test_a_planar_arm_leaves_the_tilts_across_its_plane(model, yaw):
    level = posture(
        model.vehicle, (Taylor((0.3, *(0.0,) * 4)), Taylor((-0.2, *(0.0,) * 4))), 4
    )
    shares = tilt_shares(
        model.vehicle, make_centroidal(model, mode="tip").par.tip, (0.3, -0.2), level
    )
    # the joints turn about body y: a shift along it is left to the base, one across it
    # is the arm's
    y, x = Vec3(-np.sin(yaw), np.cos(yaw), 0.3), Vec3(np.cos(yaw), np.sin(yaw), -0.2)
    np.testing.assert_allclose([*shares.left(y, yaw)], [y.x, y.y, 0.0], atol=1e-4)
    # two joints about one axis: 0.02 of 2.02
    held = HELD / (2.0 + HELD)
    np.testing.assert_allclose(
        [*shares.left(x, yaw)], [held * x.x, held * x.y, 0.0], atol=1e-4
    )


ARMS = [
    "octo_coaxial_two_arms",
    "hexarotor_arm6",
    "hexarotor12_arm5",
    "quadrotor_roll_arm2",
    "hextilt_flying_arm_5",
]


@pytest.mark.parametrize("name", ARMS)
def test_the_shares_left_are_those_of_an_arm_that_keeps_its_links_level(name):
    """Against the way of the tip from the centre of mass, by differences, of a vehicle
    that tilts, at a heading.
    """
    vehicle, yaw = skyarm.load_vehicle(name), 0.8
    q = np.linspace(-0.3, 0.5, vehicle.n) + (
        0.4 if name == "hextilt_flying_arm_5" else 0.0
    )
    found, left = shares_of(vehicle, q), -ways_of(vehicle, q)
    Z = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    for v in np.eye(2):
        np.testing.assert_allclose(
            [*found.left(Vec3(*v, 0.0), yaw)][:2], Z @ left @ Z.T @ v, atol=1e-3
        )
    assert found.over(-0.2, 0.2) == pytest.approx(5.0)


def test_the_shift_goes_on_evenly_as_the_tip_passes_the_height_of_the_centre_of_mass():
    """What is left is a length, so that nothing changes its sign or its size there
    while the arm turns.
    """
    vehicle = skyarm.load_vehicle("hexarotor_arm6")
    par = make_centroidal(Model(vehicle=vehicle, gravity=G), mode="tip").par

    def posed(angle):
        return np.array([0.0, angle, 0.0, 0.0, 0.4, 0.0])

    middle = brentq(lambda angle: arm_of(vehicle, posed(angle))[2], -2.5, 0.0)
    base, found = [Vec3(0.0, 0.0, 1.0), ZERO, Vec3(1.0, 0.5, 0.0), ZERO, ZERO], []
    for off in np.linspace(-0.02, 0.02, 9):
        q = posed(middle + off)
        joints = [Taylor.constant(float(each), 4) for each in q]
        ahead = [
            (
                lead,
                [
                    *[(0.0, 0.0, 1.0)] * 2,
                    *[(0.0, 0.0, 0.0)] * 2,
                    *((float(each), 0.0, 0.0) for each in q),
                ],
            )
            for lead in par.preview[2:]
        ]
        moved, _ = bounded_shift(
            par,
            FIRST_SHIFT,
            base,
            AHEAD,
            joints,
            level_at(vehicle, q),
            STILL,
            ahead,
            DT,
        )
        found.append([moved[0].x, moved[0].y])
    assert np.ptp(found, axis=0).max() < 0.1 * np.abs(found).max()


def shares_of(vehicle, q):
    gains = make_centroidal(Model(vehicle=vehicle, gravity=G), mode="tip").par.tip
    return tilt_shares(vehicle, gains, tuple(map(float, q)), level_at(vehicle, q))


def ways_of(vehicle, q):
    """Way of the tip from the centre of mass, horizontal, m, in a tilt by a thrust
    along x and along y.

    The joints turn so that rotations of the links remain as small as they can, by a
    pseudoinverse.
    """
    e, R = 1e-6, [rotation_of(vehicle, q, link) for link in range(vehicle.n)]
    spins = np.array(
        [
            [
                unskewed((rotation_of(vehicle, q + each, link) - R[link]) @ R[link].T)
                / e
                for link in range(vehicle.n)
            ]
            for each in e * np.eye(vehicle.n)
        ]
    )
    jacobian, arm = spins.reshape(vehicle.n, -1).T, arm_of(vehicle, q)
    ways = []
    for tilt in ([0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]):
        turns = np.linalg.pinv(jacobian, rcond=1e-3) @ -np.tile(tilt, vehicle.n)
        ways.append(
            (np.cross(tilt, arm) + (arm_of(vehicle, q + e * turns) - arm) / e)[:2]
        )
    return np.array(ways).T


def level_at(vehicle, q):
    return posture(vehicle, [Taylor.constant(float(each), 4) for each in q], 4)


def arm_of(vehicle, q):
    """Place of the tip from the centre of mass, m, base axes."""
    at = level_at(vehicle, q)
    return np.array(
        [float(a.c[0]) - float(b.c[0]) for a, b in zip(at.tip, at.com, strict=True)]
    )


def unskewed(S):
    return np.array([S[2, 1], S[0, 2], S[1, 0]])


@pytest.mark.parametrize("yaw", [0.0, 1.2, np.pi / 2.0])
def test_an_arm_of_six_joints_keeps_its_tip_on_a_line_anywhere(yaw):
    """Its wrist turns about the arm's plane, too, but hardly moves the tip: the base
    must shift.
    """
    path = {
        "kind": "ramp",
        "start": 1.0,
        "duration": 4.0,
        "height": 0.9,
        "shape": "nonic",
    }
    scenario = skyarm.scenario_from(
        {
            "schema": 1,
            "name": "aside",
            "duration": 5.5,
            "plant": {"vehicle": "hexarotor_arm6"},
            "controller": {"law": "centroidal", "mode": "tip"},
            "reference": {
                "yaw": yaw,
                "base": {"kind": "signals", "x": path, "y": 0.0, "z": 1.0},
                "joints": [0.0, 0.6, -1.0, 0.0, 0.5, 0.0],
            },
        }
    )
    log = skyarm.run(scenario)
    assert log.info["status"] == "completed"
    assert np.linalg.norm(log.tip - log.tip_reference, axis=1).max() < 1.5e-3


def rotation_of(vehicle, q, link):
    """Rotation of a link."""
    pose = link_poses(vehicle, tuple(map(float, q)))[link]
    return np.array([[float(c) for c in row] for row in pose.R.rows])


def test_levers_to_come_are_those_of_the_postures_to_come(model):
    joints = [(0.3 + 0.1 * i, -0.4 - 0.05 * i) for i in range(5)]
    rows = [[*[(0.0, 0.0, 0.0)] * 4, *((q, 0.0, 0.0) for q in each)] for each in joints]
    found = coming_levers(model.vehicle, rows)
    exact = []
    for each in joints:
        at = posture(model.vehicle, [Taylor((q, 0.0)) for q in each], 1)
        exact.append(float(at.com.z.c[0] - at.tip.z.c[0]))
    assert [float(found[i]) for i in (0, 1, 3)] == pytest.approx(
        [exact[i] for i in (0, 1, 3)], rel=1e-12
    )
    assert float(found[2]) == pytest.approx(exact[2], rel=0.01)
    assert found[4] == found[3]


def test_a_lever_far_aside_has_a_secant_of_two():
    """A tilt of 60 degrees is the most that is reckoned with."""
    row, here = PreviewInstant(0.0, 0.0, ZERO, 0.2), PreviewInterval(1.0, ZERO)
    for place, secant in ((0.12, 1.25), (0.3, 2.0), (5.0, 2.0)):
        assert coming_thrusts([row], [here], Vec3(0.0, place, 0))[1] == pytest.approx(
            [secant]
        )


def test_thrusts_to_come_are_means_with_the_shifts_own_and_never_below_a_floor():
    """Rises of 2, 4 and -20 m/s^2, over which the shift sinks by 1 m/s^2 in the first
    stretch; secants likewise.
    """
    rows = [
        PreviewInstant(0.1 * k, rise, ZERO, 0.3)
        for k, rise in enumerate((2.0, 4.0, -20.0))
    ]
    shift = Shift(
        place=ZERO,
        sinking=(0.0,) * 3,
        secants=(1.0, 1.2, 1.5),
        coming=(-1.0, 0.0),
        first=0.1,
    )
    assert _thrusts(rows, G, 1.5, shift) == pytest.approx(
        [(G + 2.0) * 1.1, (G - 8.0) * 1.35, 1.5 * 1.5]
    )


def test_a_lever_near_zero_shifts_in_proportion(model):
    """As an arm turns past the horizontal: no step, and nothing at a lever of zero."""
    vehicle = without_joints()
    par = make_centroidal(model, mode="tip").par
    par = dataclasses.replace(par, model=Model(vehicle=vehicle, gravity=G))
    base = [Vec3(0.0, 0.0, 1.0), ZERO, Vec3(0.5, 0.0, 0.0), ZERO, ZERO]
    found = []
    for lever in (0.0, 0.5 * LEAST, LEAST):
        shift = FIRST_SHIFT
        for _ in range(100):
            _, shift = bounded_shift(
                par, shift, base, AHEAD, (), level_of(lever), STILL, (), DT
            )
        found.append(shift.place.x)
    assert found[0] == pytest.approx(0.0, abs=1e-9)
    assert found[1] == pytest.approx(0.5 * found[2], rel=0.02)


def test_the_drag_that_is_answered_is_that_of_the_base_as_it_shifts():
    """A base that shifts beside a reference at rest leans against the drag."""
    model = Model(vehicle=skyarm.load_vehicle("hummingbird_arm2_rotors"), gravity=G)
    made = make_centroidal(model, mode="tip")
    state = State(
        position=ZERO,
        quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
        velocity=ZERO,
        rate=ZERO,
        joints=(0.3, -0.4),
        joint_rates=(0.0, 0.0),
        rotor_speeds=(500.0,) * 4,
    )

    def leans(place, drag):
        before = dataclasses.replace(
            made.memory.following, shift=dataclasses.replace(FIRST_SHIFT, place=place)
        )
        signals = [
            Taylor((c, 0.0, 0.0, 0.0, 0.0)) for c in (0.0, 0.0, 1.0, 0.0, 0.3, -0.4)
        ]
        par = made.par
        if not drag:
            free = [
                dataclasses.replace(rotor, drag_coefficient=0.0)
                for rotor in model.vehicle.rotors
            ]
            vehicle = dataclasses.replace(model.vehicle, rotors=tuple(free))
            par = dataclasses.replace(par, model=Model(vehicle=vehicle, gravity=G))
        return float(planned(par, state, signals, DT, before).still.R.column(2).y)

    # 0.03 m off its place it comes back with some 0.17 m/s
    assert (
        leans(Vec3(0.0, -0.03, 0.0), True) - leans(Vec3(0.0, -0.03, 0.0), False) > 1e-4
    )


def test_low_thrust_keeps_the_direction_of_the_plan():
    """A force of the plan's direction turns no attitude; what is off it counts less the
    more the force is raised.
    """
    plan = Vec3(
        Taylor((1.2, 0.4, -0.3)), Taylor((-0.8, 0.2, 0.5)), Taylor((3.0, -1.0, 0.7))
    )
    raised = upright(plan * 1.1, 10.0, 0.8, plan)
    assert raised.z.c[0] > 1.1 * 3.0 + 0.5
    for k in range(3):
        for side, told in ((raised.x, plan.x), (raised.y, plan.y)):
            assert (side / raised.z).c[k] == pytest.approx(
                (told / plan.z).c[k], abs=1e-12
            )
    for one, other in zip(
        upright(plan * 4.0, 10.0, 0.8, plan), plan * 4.0, strict=True
    ):
        assert [*one.c] == pytest.approx([*other.c])


def flown(scenario, reference, wind=ZERO, duration=7.0, **options):
    """Tip error (mm), jitter of the rotors' commands (rad/s) and share of periods with
    one at its limit, at the end.
    """
    model = Model(vehicle=scenario.plant.vehicle, gravity=scenario.plant.gravity)
    controller = make_centroidal(model, mode="tip", **options)
    scenario = dataclasses.replace(scenario, reference=reference, controller=controller)
    log = skyarm.run(
        dataclasses.replace(scenario, wind=ForceWind(force_W=wind), duration=duration)
    )
    assert log.status == "completed"
    kept = log.time >= duration - 3.0
    commands = log.rotor_commands[kept]
    limit = float(scenario.plant.vehicle.rotors[0].max_speed) * (1.0 - 1e-9)
    error = 1e3 * np.linalg.norm(log.tip - log.tip_reference, axis=1)[kept].mean()
    return (
        error,
        np.sqrt(np.mean(np.diff(commands, axis=0) ** 2)),
        np.mean(np.any(commands >= limit, axis=1)),
    )


@pytest.fixture(scope="module")
def case3():
    return skyarm.load_scenario("case3", duration=7.0)


ARM = (Constant(0.2), Constant(-0.1))


def test_the_tip_stays_on_a_fast_circle_and_the_rotors_are_calm(case3):
    """2.3 m/s: with differentiators and estimated frequencies 6 mm and 150 rad/s."""
    turn = 2.3 / (2.0 * np.pi)
    x, y = (
        Sine(amplitude=1.0, frequency_hz=turn, phase=0.5 * np.pi),
        Sine(amplitude=1.0, frequency_hz=turn),
    )
    motion = dataclasses.replace(hover((0.0, 0.0, 1.5)), x=x, y=y, joints=ARM)
    error, jitter, limited = flown(case3, motion)
    assert error < 3.0
    assert jitter < 3.0
    assert limited == 0.0


def test_the_tip_stays_where_the_thrust_changes_under_a_side_wind(case3):
    """Up and down by half the weight: with the tilt of each instant 0.2 m."""
    z = Sum((Constant(1.5), Sine(amplitude=0.12, frequency_hz=1.0)))
    motion = dataclasses.replace(hover((0.0, 0.0, 1.5)), z=z, joints=ARM)
    assert flown(case3, motion, Vec3(0.0, 1.5, 0.0))[0] < 5.0


def test_the_tip_of_a_swinging_arm_stays_in_a_wind_from_the_side(case3):
    joints = tuple(
        Sine(amplitude=0.5, frequency_hz=1.0, phase=phase) for phase in (0.0, 0.9)
    )
    motion = dataclasses.replace(hover((0.0, 0.0, 1.5)), joints=joints)
    assert flown(case3, motion, Vec3(0.0, 2.0, 0.0))[0] < 5.0
    assert flown(case3, motion, Vec3(0.0, 2.0, 0.0), preview=0.0)[0] > 25.0


def test_the_tip_stays_on_a_circle_while_the_vehicle_turns(case3):
    """Half a turn a second: 4.0 mm where all instants to come had the directions of
    now.
    """
    x, y = (
        Sine(amplitude=0.3, frequency_hz=0.3, phase=0.5 * np.pi),
        Sine(amplitude=0.3, frequency_hz=0.3),
    )
    turn = Ramp(start=1.0, duration=20.0, height=10.0 * np.pi)
    motion = dataclasses.replace(hover((0.0, 0.0, 1.5)), x=x, y=y, yaw=turn, joints=ARM)
    assert flown(case3, motion)[0] < 1.0


def begun(scenario):
    """First state of the vehicle and its control, and the control periods flown."""
    first = first_loop_state(scenario)
    return first.agent, first.ticks


def test_a_preview_in_the_law_is_that_of_the_trajectory(case3):
    """What a flight's rows bring: samples of the reference at the times that the law
    asks for.
    """
    scenario = dataclasses.replace(
        case3, controller=make_centroidal(case3.controller.par.model, mode="tip")
    )
    inputs, par = episode_inputs(scenario), scenario.controller.par
    row = inputs.row_at(1301, *begun(scenario))
    held = 1300 / 200.0
    found = samples_ahead(row.reference)
    assert len(found) == len(par.preview) == 7
    for lead, sample in zip(par.preview, found, strict=True):
        expected = samples(scenario.reference.at(held + lead))
        np.testing.assert_allclose(
            np.array(sample, dtype=float), np.array(expected, dtype=float), atol=1e-12
        )


def test_before_it_starts_to_track_a_law_is_shown_a_reference_at_rest(case3):
    law = make_centroidal(case3.controller.par.model, mode="tip")
    late = dataclasses.replace(case3, controller=law, tracking_start=2.0)
    row = episode_inputs(late).row_at(100, *begun(late))
    shown = samples_ahead(joined_reference(late, row.reference, 0.5))
    rest = [(value, 0.0, 0.0) for value, _, _ in samples(late.reference.at(0.0))]
    assert len(shown) == 7
    for sample in shown:
        np.testing.assert_allclose(
            np.array(sample, dtype=float), np.array(rest, dtype=float)
        )
    assert joined_reference(late, row.reference, 2.5).ahead == row.reference.ahead


def test_a_reference_that_waits_is_previewed_as_far_as_it_is_certain_to_go(case3):
    """Up to the guard's time, where it stands until the guard lets it on."""
    law = make_centroidal(case3.controller.par.model, mode="tip")
    x = minimum_snap((0.0, 4.0), (0.0, 1.0))
    guard = Guard(at=1.5, begin=1.0, phase=0, error=0.01, timeout=9.0)
    motion = dataclasses.replace(
        hover((0.0, 0.0, 1.5)),
        x=x,
        joints=ARM,
        guards=(guard,),
        phases=(Phase(name="a", end=1.5),),
    )
    scenario = dataclasses.replace(
        dataclasses.replace(case3, reference=motion), controller=law
    )
    waits = Waits(scenario)
    clock = dataclasses.replace(waits.first(), place=240.0, held=240.0)
    held = waits.previewed_reference(clock, 240.0)
    assert float(held.position.x) == pytest.approx(x.derivatives(1.2)[0])
    for lead, sample in zip(law.par.preview, samples_ahead(held), strict=True):
        expected = x.derivatives(min(1.2 + lead, 1.5))[:3]
        np.testing.assert_allclose(
            np.array(sample[0], dtype=float), expected, atol=1e-12
        )


def test_laws_without_a_preview_are_shown_none(case3):
    plain = skyarm.load_scenario("case3", controller="paper_ct", duration=0.1)
    assert episode_inputs(plain).row_at(3, *begun(plain)).reference.ahead == ()
    unmoved = make_centroidal(case3.controller.par.model, mode="tip", preview=0.0)
    assert unmoved.par.preview == (0.02, 0.04)
