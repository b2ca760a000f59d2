"""The base's shift by a preview: against a solver of boundary value problems, closed forms, and flown."""

import dataclasses
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_bvp

import skyarm
from law_parts import step_of
from skyarm.algebra import Quaternion, Vec3
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.blocks.attitude import Posture, posture, upright
from skyarm.control.controller import ControllerError
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.laws.centroidal.base_shift import (
    FIRST_SHIFT,
    Acting,
    Directions,
    Instant,
    Shift,
    Stretch,
    _gains,
    _thrusts,
    bounded_shift,
    bounded_sweep,
    coming_levers,
    coming_thrusts,
    directions,
    lever_of,
)
from skyarm.control.laws.centroidal.demands import _course
from skyarm.control.laws.centroidal.parameters import FOLLOWING
from skyarm.control.laws.centroidal.presets import DeprecatedOptionWarning
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.dynamics.kinematics import link_poses
from skyarm.reference import Constant, Sine, Sum, hover
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
STILL = Acting(force=ZERO, rate=ZERO, drift=ZERO, drag=0.0)


@pytest.fixture(scope="module")
def model():
    return Model(vehicle=skyarm.load_vehicle("hummingbird_arm2"), gravity=G)


def test_the_sweep_finds_the_bounded_solution_of_an_equation_whose_terms_change():
    """y'' = (n / l) y + d - a, all of them functions of time: rate at the beginning for two values there."""
    thrust = lambda t: G + 4.0 * np.sin(6.0 * t)  # noqa: E731
    lever = lambda t: 0.28 + 0.05 * np.cos(9.0 * t)  # noqa: E731
    asked = lambda t: 3.0 * np.sin(4.0 * t + 0.3) - 1.5  # noqa: E731
    times = np.linspace(0.0, 2.0, 201)
    rows = [Instant(t, 0.0, (-asked(t), 0.0), lever(t)) for t in times]
    means = [thrust(0.5 * (a + b)) for a, b in pairwise(times)]
    line = bounded_sweep(rows, [(1.0, 1.0)] * len(rows), [*means, thrust(times[-1])])
    span = np.linspace(0.0, 4.0, 400)
    for start in (0.0, 0.2):
        found = solve_bvp(
            lambda t, y: np.array([y[1], thrust(t) / lever(t) * y[0] - asked(t)]),
            lambda a, b, start=start: np.array([a[0] - start, b[0]]),
            span, np.zeros((2, span.size)), tol=1e-8, max_nodes=100_000,
        )  # fmt: skip
        assert line[0].v[0] - line[0].b * start == pytest.approx(float(found.sol(0.0)[1]), rel=1e-3)
    assert line[0].v[1] == 0.0


def level_of(lever):
    """A posture without joints whose tip hangs ``lever`` below the centre of mass in the base's origin."""
    still = Taylor((0.0,) * 5)
    return Posture(Vec3(still, still, still), Vec3(still, still, still - lever), ())


def on_a_sine(par, w, level, share, begin=0.0):
    """Shift, derivatives and base after a few periods on a sine along y, begun on the closed form's solution."""
    size = 0.6
    along = lambda t, k: size * w ** (k - 2) * np.sin(w * t + 0.5 * np.pi * k)  # noqa: E731
    shift = dataclasses.replace(FIRST_SHIFT, place=Vec3(0.0, share * along(begin, 2), 0.0))
    for k in range(12):
        t = begin + k * DT
        base, ahead = [Vec3(0.0, along(t, i), 0.0) for i in range(5)], []
        for lead in par.preview[FOLLOWING:]:
            still = (0.0, 0.0, 0.0)
            ahead.append((lead, [still, (0.0, along(t + lead, 1), along(t + lead, 2)), *[still] * 4]))
        before = shift
        moved, _, shift = bounded_shift(par, shift, base, 0.0, level, STILL, ahead, DT, (0.0, 0.0))
    return before.place, moved, base


@pytest.fixture(scope="module")
def hanging(model):
    """Posture of the arm that hangs straight, and its lever."""
    level = posture(model.vehicle, (Taylor((0.0,) * 5),) * 2, 4)
    return level, float(level.com.z.c[0] - level.tip.z.c[0])


@pytest.mark.parametrize("w", [1.0, 2.5, 4.0])
@pytest.mark.parametrize("begin", [0.0, 0.3])
def test_on_a_sine_the_shift_is_that_of_the_closed_form(model, hanging, w, begin):
    """y = (l / g) a / (1 + l w^2 / g): of a motion so small that the lever hardly turns."""
    par, (level, lever) = make_centroidal(model, mode="tip", preset="adaptive").par, hanging
    share = (lever / G) / (1.0 + lever * w * w / G)
    place, moved, base = on_a_sine(par, w, level, share, begin)
    size = share * 0.6
    assert place.y == pytest.approx(share * base[2].y, abs=0.02 * size)
    # an even change of the acceleration from instant to instant is a few per cent off a sine
    for k in range(2):
        assert moved[k].y == pytest.approx(share * base[3 + k].y, abs=0.1 * size * max(w, 2.0) ** (k + 1))
    assert abs(place.x) < 1e-3 * size
    assert abs(moved[1].z) < 2.0 * (size * w) ** 2 / lever


def test_every_derivative_is_that_of_the_one_before(model, hanging):
    par, (level, lever) = make_centroidal(model, mode="tip", preset="adaptive").par, hanging
    share = (lever / G) / (1.0 + lever * 4.0 / G)
    rows = [on_a_sine(par, 2.0, level, share, 0.2 + k * 0.01)[1] for k in range(3)]
    for k in range(2):
        slope = (rows[2][k].y - rows[0][k].y) / 0.02
        assert slope == pytest.approx(rows[1][k + 1].y, rel=0.1, abs=0.02)


def without_joints():
    """A vehicle whose tip is fixed to its base."""
    vehicle = skyarm.load_vehicle("hummingbird")
    tip = Frame(name="tip", link=BASE, position=Vec3(0.0, 0.0, -0.3))
    return dataclasses.replace(vehicle, frames=(tip,), end_effector="tip")


@pytest.mark.parametrize("lever", [0.3, -0.3])
def test_a_steady_force_shifts_by_the_lever_below_the_base_and_above(model, lever):
    """y = -(l / g) d / m of an arm whose joints do not help: here a vehicle that has none."""
    vehicle = without_joints()
    par = make_centroidal(model, mode="tip", preset="adaptive").par
    par = dataclasses.replace(par, model=Model(vehicle=vehicle, gravity=G))
    force = Vec3(0.2, -0.3, 0.0)
    acting = dataclasses.replace(STILL, force=force)
    shift, base = FIRST_SHIFT, [Vec3(0.0, 0.0, 1.0), ZERO, ZERO, ZERO, ZERO]
    for _ in range(200):
        before = shift.place
        moved, _, shift = bounded_shift(par, shift, base, 0.4, level_of(lever), acting, (), DT)
        gone = moved[0] * DT + moved[1] * (0.5 * DT**2)  # of the way in a period, with its acceleration
        np.testing.assert_allclose([*shift.place][:2], [*(before + gone)][:2], rtol=1e-9, atol=1e-15)
    expected = force * (-lever / (G * float(vehicle.mass)))
    np.testing.assert_allclose([*shift.place], [*expected], rtol=0.01, atol=1e-5)
    assert moved[0].norm() < 1e-3


def test_what_was_not_foretold_accelerates_the_shift_towards_its_new_place(model, hanging):
    par = make_centroidal(model, mode="tip", preset="adaptive").par
    level, lever = hanging
    base = [Vec3(0.0, 0.0, 1.0), ZERO, ZERO, ZERO, ZERO]
    acting = dataclasses.replace(STILL, drift=Vec3(0.0, 0.5, 0.0))
    _, drifting, _ = bounded_shift(par, FIRST_SHIFT, base, 0.0, level, acting, (), DT)
    assert drifting.y == pytest.approx(-0.5 / float(model.vehicle.mass) * np.sqrt(lever / G), rel=0.02)


@pytest.mark.parametrize("yaw", [0.0, 0.7, -2.0])
def test_a_planar_arm_leaves_the_tilts_across_its_plane(model, yaw):
    level = posture(model.vehicle, (Taylor((0.3, *(0.0,) * 4)), Taylor((-0.2, *(0.0,) * 4))), 4)
    at = directions(model.vehicle, level, yaw)
    along = np.array([at.x, at.y])
    # the joints turn about body y: a shift along it is left to the base, one across it is the arm's
    assert abs(along @ [-np.sin(yaw), np.cos(yaw)]) == pytest.approx(1.0, abs=1e-4)
    assert at.left[0] > 0.95
    # two joints about one axis: 0.02 of 2.02
    assert [*at.left] == pytest.approx([1.0, HELD / (2.0 + HELD)], rel=1e-4)
    v = Vec3(0.3, -1.2, 0.0)
    np.testing.assert_allclose([*at.vector(at.pair(v))], [*v], atol=1e-9)


def moved_by(vehicle, joints):
    """Rotations of the links, and the centre of mass against the tip, m."""
    poses = link_poses(vehicle, tuple(map(float, joints)))
    rows = [np.array([[float(c) for c in row] for row in pose.R.rows]) for pose in poses]
    places = [np.array([float(c) for c in pose.p]) for pose in poses]
    total = np.array([float(c) for c in vehicle.base.com]) * float(vehicle.base.mass)
    for link, R, p in zip(vehicle.links, rows, places, strict=True):
        total = total + float(link.body.mass) * (p + R @ [float(c) for c in link.body.com])
    frame = vehicle.frame()
    tip = places[frame.link] + rows[frame.link] @ [float(c) for c in frame.position]
    return rows, total / float(vehicle.mass) - tip


@pytest.mark.parametrize("name", ["hummingbird_arm2", "octo_coaxial_two_arms", "hexarotor_arm6", "hexarotor12_arm5"])
def test_the_levers_left_are_those_of_joints_that_turn_the_links_back(name):
    """Against joint angles by least squares, Jacobians by differences; of the hanging arm."""
    vehicle, e = skyarm.load_vehicle(name), 1e-5
    q = np.zeros(vehicle.n)
    rows, arm = moved_by(vehicle, q)
    turns, shifts = [], []
    for each in e * np.eye(vehicle.n):
        there, moved = moved_by(vehicle, q + each)
        spins = [(a @ b.T - np.eye(3)) / e for a, b in zip(there, rows, strict=True)]
        turns.append(np.concatenate([[spin[2, 1], spin[0, 2], spin[1, 0]] for spin in spins]))
        shifts.append((moved - arm) / e)
    level = posture(vehicle, [Taylor.constant(float(each), 4) for each in q], 4)
    at, lever = directions(vehicle, level, 0.0), lever_of(vehicle, tuple(q))
    for k, axis in enumerate((np.array([-at.y, at.x, 0.0]), np.array([at.x, at.y, 0.0]))):
        # a tilt about one direction moves the centre of mass along the other
        tilt = [-float(axis[0]), -float(axis[1]), 0.0]
        angles = np.linalg.lstsq(np.array(turns).T, np.tile([-each for each in tilt], vehicle.n), rcond=1e-6)[0]
        moved = np.cross(tilt, arm) + np.array(shifts).T @ angles
        expected = abs(float(moved @ [float(at.x), float(at.y), 0.0] if k == 0 else moved @ [-at.y, at.x, 0.0]))
        assert float(at.left[k] * lever + at.rest[k]) == pytest.approx(expected, abs=0.025 * float(lever))


def test_levers_to_come_are_those_of_the_postures_to_come(model):
    joints = [(0.3 + 0.1 * i, -0.4 - 0.05 * i) for i in range(5)]
    rows = [[*[(0.0, 0.0, 0.0)] * 4, *((q, 0.0, 0.0) for q in each)] for each in joints]
    found = coming_levers(model.vehicle, (0.25, -0.38), rows)
    exact = []
    for each in joints:
        at = posture(model.vehicle, [Taylor((q, 0.0)) for q in each], 1)
        exact.append(float(at.com.z.c[0] - at.tip.z.c[0]))
    assert [float(found[i]) for i in (0, 1, 3)] == pytest.approx([exact[i] for i in (0, 1, 3)], rel=1e-12)
    assert float(found[2]) == pytest.approx(exact[2], rel=0.01)
    assert found[4] == found[3]


def test_a_lever_far_aside_has_a_secant_of_two():
    """A tilt of 60 degrees is the most that is reckoned with."""
    row, here = Instant(0.0, 0.0, (0.0, 0.0), 0.2), Stretch(1.0, (0.0, 0.0))
    for place, secant in ((0.12, 1.25), (0.3, 2.0), (5.0, 2.0)):
        assert coming_thrusts([row], [here], (0.0, place))[1] == pytest.approx([secant])


def test_what_joints_leave_of_a_lever_is_divided_by_its_size():
    at = Directions(1.0, 0.0, (0.5, 0.2), (0.03, -0.01))
    assert _gains(at, 0.1) == pytest.approx((0.8, 0.1))
    assert _gains(at, -0.1) == pytest.approx((-0.2, -0.3))
    assert _gains(at, 0.01) == pytest.approx((1.75, -0.4))  # over LEAST


def test_thrusts_to_come_are_means_with_the_shifts_own_and_never_below_a_floor():
    """Rises of 2, 4 and -20 m/s^2, over which the shift sinks by 1 m/s^2 in the first stretch; secants likewise."""
    rows = [Instant(0.1 * k, rise, (0.0, 0.0), 0.3) for k, rise in enumerate((2.0, 4.0, -20.0))]
    shift = Shift(place=ZERO, sinking=(0.0,) * 3, secants=(1.0, 1.2, 1.5), coming=(-1.0, 0.0), first=0.1)
    assert _thrusts(rows, G, 1.5, shift) == pytest.approx([(G + 2.0) * 1.1, (G - 8.0) * 1.35, 1.5 * 1.5])


def test_a_lever_near_zero_shifts_in_proportion(model):
    """As an arm turns past the horizontal: no step, and nothing at a lever of zero."""
    vehicle = without_joints()
    par = make_centroidal(model, mode="tip", preset="adaptive").par
    par = dataclasses.replace(par, model=Model(vehicle=vehicle, gravity=G))
    base = [Vec3(0.0, 0.0, 1.0), ZERO, Vec3(0.5, 0.0, 0.0), ZERO, ZERO]
    found = []
    for lever in (0.0, 0.5 * LEAST, LEAST):
        shift = FIRST_SHIFT
        for _ in range(100):
            _, _, shift = bounded_shift(par, shift, base, 0.0, level_of(lever), STILL, (), DT)
        found.append(shift.place.x)
    assert found[0] == pytest.approx(0.0, abs=1e-9)
    assert found[1] == pytest.approx(0.5 * found[2], rel=0.02)


def test_the_drag_that_is_answered_is_that_of_the_base_as_it_shifts():
    """A base that shifts beside a reference at rest leans against the drag."""
    model = Model(vehicle=skyarm.load_vehicle("hummingbird_arm2_rotors"), gravity=G)
    made = make_centroidal(model, mode="tip", preset="adaptive")
    state = State(position=ZERO, quaternion=Quaternion(1.0, 0.0, 0.0, 0.0), velocity=ZERO, rate=ZERO,
                  joints=(0.3, -0.4), joint_rates=(0.0, 0.0), rotor_speeds=(500.0,) * 4)  # fmt: skip

    def leans(place, drag):
        before = dataclasses.replace(made.memory.following, shift=dataclasses.replace(FIRST_SHIFT, place=place))
        signals = [Taylor((c, 0.0, 0.0, 0.0, 0.0)) for c in (0.0, 0.0, 1.0, 0.0, 0.3, -0.4)]
        par = made.par
        if not drag:
            free = [dataclasses.replace(rotor, drag_coefficient=0.0) for rotor in model.vehicle.rotors]
            vehicle = dataclasses.replace(model.vehicle, rotors=tuple(free))
            par = dataclasses.replace(par, model=Model(vehicle=vehicle, gravity=G))
        return float(_course(step_of(par, state, signals, DT, following=before)).still.R.column(2).y)

    # 0.03 m off its place it comes back with some 0.17 m/s
    assert leans(Vec3(0.0, -0.03, 0.0), True) - leans(Vec3(0.0, -0.03, 0.0), False) > 1e-4


def test_the_reference_of_the_centre_of_mass_accelerates_with_what_was_not_foretold(model):
    made = make_centroidal(model, mode="tip", preset="gusts")
    state = State(position=ZERO, quaternion=Quaternion(1.0, 0.0, 0.0, 0.0), velocity=ZERO, rate=ZERO,
                  joints=(0.0, 0.0), joint_rates=(0.0, 0.0), rotor_speeds=(500.0,) * 4)  # fmt: skip
    signals = [Taylor((c, 0.0, 0.0, 0.0, 0.0)) for c in (0.0, 0.0, 1.0, 0.0, 0.0, 0.0)]

    def course(drift):
        step = step_of(made.par, state, signals, DT, following=made.memory.following, drift=drift)
        return _course(step)

    still, gust = course(ZERO), course(Vec3(0.0, 2.0, 0.0))
    assert gust.base[2].y - still.base[2].y < -0.2
    assert gust.still == still.still
    assert gust.base[3:] == still.base[3:]


def test_low_thrust_keeps_the_direction_of_the_plan():
    """A force of the plan's direction turns no attitude; what is off it counts less the more the force is raised."""
    plan = Vec3(Taylor((1.2, 0.4, -0.3)), Taylor((-0.8, 0.2, 0.5)), Taylor((3.0, -1.0, 0.7)))
    raised = upright(plan * 1.1, 10.0, 0.8, plan)
    assert raised.z.c[0] > 1.1 * 3.0 + 0.5
    for k in range(3):
        for side, told in ((raised.x, plan.x), (raised.y, plan.y)):
            assert (side / raised.z).c[k] == pytest.approx((told / plan.z).c[k], abs=1e-12)
    for one, other in zip(upright(plan * 4.0, 10.0, 0.8, plan), plan * 4.0, strict=True):
        assert [*one.c] == pytest.approx([*other.c])


def flown(scenario, reference, wind=ZERO, duration=7.0, **options):
    """Tip error (mm), jitter of the rotors' commands (rad/s) and share of periods with one at its limit, at the end."""
    model = Model(vehicle=scenario.plant.vehicle, gravity=scenario.plant.gravity)
    controller = make_centroidal(model, mode="tip", preset="adaptive", **options)
    scenario = dataclasses.replace(scenario, reference=reference, controller=controller)
    log = skyarm.run(dataclasses.replace(scenario, wind=ForceWind(force_W=wind), duration=duration))
    assert log.status == "completed"
    kept = log.time >= duration - 3.0
    commands = log.rotor_commands[kept]
    limit = float(scenario.plant.vehicle.rotors[0].max_speed) * (1.0 - 1e-9)
    error = 1e3 * np.linalg.norm(log.tip - log.tip_reference, axis=1)[kept].mean()
    return error, np.sqrt(np.mean(np.diff(commands, axis=0) ** 2)), np.mean(np.any(commands >= limit, axis=1))


@pytest.fixture(scope="module")
def case3():
    return skyarm.load_scenario("case3", duration=7.0)


ARM = (Constant(0.2), Constant(-0.1))


def test_the_tip_stays_on_a_fast_circle_and_the_rotors_are_calm(case3):
    """2.3 m/s: with differentiators and estimated frequencies 6 mm and 150 rad/s."""
    turn = 2.3 / (2.0 * np.pi)
    x, y = Sine(amplitude=1.0, frequency_hz=turn, phase=0.5 * np.pi), Sine(amplitude=1.0, frequency_hz=turn)
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
    joints = tuple(Sine(amplitude=0.5, frequency_hz=1.0, phase=phase) for phase in (0.0, 0.9))
    motion = dataclasses.replace(hover((0.0, 0.0, 1.5)), joints=joints)
    assert flown(case3, motion, Vec3(0.0, 2.0, 0.0))[0] < 5.0
    assert flown(case3, motion, Vec3(0.0, 2.0, 0.0), preview=0.0)[0] > 25.0


def test_options_of_the_version_before_are_read_once_more(model):
    now = make_centroidal(model, mode="tip", preset="adaptive").par
    with pytest.warns(DeprecatedOptionWarning, match=r"^controller\.path_rate = 2\.0: .*; write preview, s$"):
        assert make_centroidal(model, mode="tip", preset="adaptive", path_rate=2.0).par == now
    with pytest.warns(DeprecatedOptionWarning, match=r"controller\.shift_bandwidth = 0\.0"):
        assert make_centroidal(model, mode="tip", preset="adaptive", shift_bandwidth=0.0).par.tip.shift is None
    with pytest.raises(ControllerError, match=r"controller\.swing_rate = -1\.0"):
        make_centroidal(model, mode="tip", swing_rate=-1.0)


def test_a_preview_in_the_law_is_that_of_the_trajectory(case3):
    """What a flight's rows bring: samples of the reference at the times that the law asks for."""
    scenario = dataclasses.replace(
        case3, controller=make_centroidal(case3.controller.par.model, mode="tip", preset="adaptive")
    )
    inputs, par = episode_inputs(scenario), scenario.controller.par
    row = inputs.row_at(1301, first_loop_state(scenario))
    held = 1300 / 200.0
    found = samples_ahead(row.reference)
    assert len(found) == len(par.preview) == 7
    for lead, sample in zip(par.preview, found, strict=True):
        expected = samples(scenario.reference.at(held + lead))
        np.testing.assert_allclose(np.array(sample, dtype=float), np.array(expected, dtype=float), atol=1e-12)


def test_before_it_starts_to_track_a_law_is_shown_a_reference_at_rest(case3):
    law = make_centroidal(case3.controller.par.model, mode="tip", preset="adaptive")
    late = dataclasses.replace(case3, controller=law, tracking_start=2.0)
    row = episode_inputs(late).row_at(100, first_loop_state(late))
    shown = samples_ahead(joined_reference(late, row.reference, 0.5))
    rest = [(value, 0.0, 0.0) for value, _, _ in samples(late.reference.at(0.0))]
    assert len(shown) == 7
    for sample in shown:
        np.testing.assert_allclose(np.array(sample, dtype=float), np.array(rest, dtype=float))
    assert joined_reference(late, row.reference, 2.5).ahead == row.reference.ahead


def test_a_reference_that_waits_is_previewed_as_far_as_it_is_certain_to_go(case3):
    """Up to the guard's time, where it stands until the guard lets it on."""
    law = make_centroidal(case3.controller.par.model, mode="tip", preset="adaptive")
    x = minimum_snap((0.0, 4.0), (0.0, 1.0))
    guard = Guard(at=1.5, begin=1.0, phase=0, error=0.01, timeout=9.0)
    motion = dataclasses.replace(
        hover((0.0, 0.0, 1.5)), x=x, joints=ARM, guards=(guard,), phases=(Phase(name="a", end=1.5),)
    )
    scenario = dataclasses.replace(dataclasses.replace(case3, reference=motion), controller=law)
    waits = Waits(scenario)
    clock = dataclasses.replace(waits.first(), place=240.0, held=240.0)
    held = waits.previewed_reference(clock, 240.0)
    assert float(held.position.x) == pytest.approx(x.derivatives(1.2)[0])
    for lead, sample in zip(law.par.preview, samples_ahead(held), strict=True):
        expected = x.derivatives(min(1.2 + lead, 1.5))[:3]
        np.testing.assert_allclose(np.array(sample[0], dtype=float), expected, atol=1e-12)


def test_laws_without_a_preview_are_shown_none(case3):
    plain = skyarm.load_scenario("case3", controller="paper_ct", duration=0.1)
    assert episode_inputs(plain).row_at(3, first_loop_state(plain)).reference.ahead == ()
    robust = make_centroidal(case3.controller.par.model, mode="tip", preset="robust")
    assert robust.par.preview == (0.02, 0.04)
