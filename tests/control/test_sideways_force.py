"""What sideways force the law counts on, what leans, and the lead of rotors: programs
and differences as oracles.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from law_parts import demanded
from scipy.spatial.transform import Rotation
from sideways_program import array, largest, lopsided

import skyarm
from skyarm.algebra import Mat3, Quaternion, Vec3
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.compile import trace
from skyarm.control.blocks.actuators import command_for, compensate_motor_lag
from skyarm.control.blocks.attitude import DesiredAttitude
from skyarm.control.blocks.prediction import Disturbance
from skyarm.control.catalogue import ControllerError
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.laws.centroidal.com_tracking import planned_rate
from skyarm.control.laws.centroidal.step_records import RotorForce
from skyarm.control.laws.centroidal.tilting.sideways_force import (
    SidewaysForce,
    SidewaysGains,
    gauge,
    leaning,
    reach_of,
    slightest,
    thrust_axis,
)
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.dynamics.actuators import make_mixer
from skyarm.dynamics.actuators.rotor import speed_after
from skyarm.plant.interface import Truth
from skyarm.records.leaves import leaves, rebuild
from skyarm.reference import hover
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_record import Scenario
from support.laws import cases, vec

HEXA = skyarm.load_vehicle("tilted_hexarotor")
ARM = dataclasses.replace(skyarm.load_vehicle("hummingbird_arm2"), rotors=HEXA.rotors)
BENT = lopsided(HEXA)
MIXER = make_mixer(BENT, "priority", sideways=True)
WEIGHT = float(HEXA.mass) * 9.81
RESTING = State(
    position=Vec3(0.0, 0.0, 1.5),
    quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
    velocity=Vec3(0.0, 0.0, 0.0),
    rate=Vec3(0.0, 0.0, 0.0),
    joints=(0.3, -0.2),
    joint_rates=(0.0, 0.0),
)
RESTING_ROTORS = dataclasses.replace(RESTING, rotor_speeds=(480.0,) * 6)
NOTHING = Disturbance(
    force=Vec3(0.0, 0.0, 0.0), torque=Vec3(0.0, 0.0, 0.0), efforts=(0.0, 0.0)
)
COM = Vec3(0.01, -0.02, -0.06)
REACH = reach_of(MIXER, COM, WEIGHT)
GIVEN = SidewaysForce(SidewaysGains(share=0.9, attitude=None), REACH)
LEVEL, STILL = Mat3.identity(), Vec3(0.0, 0.0, 0.0)


@pytest.mark.parametrize("share", [0.6, 1.0, 1.6])
def test_the_reach_that_is_counted_on_lies_just_within_that_of_all_rotors(share):
    angles = np.radians(np.arange(0.0, 360.0, 15.0))
    far = [
        largest(BENT, (math.cos(a), math.sin(a)), share * WEIGHT, array(COM))
        for a in angles
    ]
    least = float(slightest(REACH, Taylor([share * WEIGHT, 0.0])).derivative(0)) ** -0.5
    assert 0.7 * min(far) < least < min(far)
    for a, limit in zip(angles, far, strict=True):
        side = [math.cos(a), math.sin(a), share * WEIGHT]
        at = (
            float(gauge(REACH, Vec3(*(Taylor([c]) for c in side))).derivative(0))
            ** -0.125
        )
        room = [
            (r.z * side[2], t - r.z * side[2])
            for r, t in zip(REACH.rows, REACH.highest, strict=True)
        ]
        taken = [float(r.x) * side[0] + float(r.y) * side[1] for r in REACH.rows]
        hard = min(
            (up if c > 0.0 else down) / abs(c)
            for c, (down, up) in zip(taken, room, strict=True)
        )
        assert hard == pytest.approx(limit, rel=1e-6)
        # six rotors at most share one limit: 6^(1/8) = 1.25
        assert limit / 1.2512 < at < limit * (1.0 + 1e-9)


def moving(t):
    """A force, an attitude and their motion: world axes, N."""
    force = np.array(
        [2.0 + 3.0 * t - t * t, -1.0 + 5.0 * t + 2.0 * t * t, WEIGHT - 4.0 * t + t * t]
    )
    return force, Rotation.from_rotvec([0.8 * t - 0.2, 0.1 - 0.5 * t, 0.7 + 0.3 * t])


@pytest.mark.parametrize("size", [1.0, 2.5])
def test_what_rotors_give_of_a_force_and_its_derivative(size):
    """Inside the reach the force itself; beyond, in the body's axes, its part across z
    shortened. By differences.
    """

    def given(t):
        force, R = moving(t)
        force[:2] *= size
        rows = Mat3(*(vec(row) for row in R.as_matrix()))
        return array(GIVEN.achievable([vec(force)], rows, STILL))

    h = 1e-6
    force, R = moving(0.3)
    force[:2] *= size
    slope = (moving(0.3 + h)[0] - moving(0.3 - h)[0]) / (2.0 * h) * [size, size, 1.0]
    rate = (moving(0.3 - h)[1].inv() * moving(0.3 + h)[1]).as_rotvec() / (2.0 * h)
    found = GIVEN.achievable(
        [vec(force), vec(slope)], Mat3(*(vec(row) for row in R.as_matrix())), vec(rate)
    )
    np.testing.assert_allclose(
        array(found),
        (given(0.3 + h) - given(0.3 - h)) / (2.0 * h),
        rtol=1e-5,
        atol=1e-6,
    )
    body, wanted = R.inv().apply(given(0.3)), R.inv().apply(force)
    assert body[2] == pytest.approx(wanted[2], rel=1e-12)
    assert body[0] * wanted[1] == pytest.approx(body[1] * wanted[0])
    inside = size == 1.0
    assert (
        np.linalg.norm(body[:2]) == pytest.approx(np.linalg.norm(wanted[:2]), rel=1e-9)
    ) == inside
    at = gauge(REACH, Vec3(*(Taylor([c]) for c in body)))
    assert float(at.derivative(0)) == pytest.approx(1.0, rel=1e-9) or inside


def test_a_thrust_along_body_z_is_what_is_left_without_a_reach():
    force, R = moving(0.3)
    rows = Mat3(*(vec(row) for row in R.as_matrix()))
    found = R.inv().apply(array(RotorForce().achievable([vec(force)], rows, STILL)))
    np.testing.assert_allclose(found, [0.0, 0.0, R.inv().apply(force)[2]], atol=1e-12)


def leant(size, share):
    """Force for the attitude at t = 0 and its derivatives, of a sideways force of that
    size that grows.
    """
    series = [[size, 3.0, 1.4], [0.5 * size, -2.0, 0.6], [WEIGHT, 5.0, -1.0]]
    return series, leaning(REACH, Vec3(*(Taylor(c) for c in series)), share)


def test_what_leans_is_little_inside_all_beyond_and_has_its_derivative():
    most = float(slightest(REACH, Taylor([WEIGHT, 0.0])).derivative(0)) ** -0.5
    length = math.hypot(1.0, 0.5)
    for part, low, high in (
        (0.3, 0.0, 1e-4),
        (0.8, 0.0, 0.03),
        (1.0, 0.08, 0.09),
        (40.0, 0.97, 0.98),
    ):
        series, found = leant(part * 0.9 * most / length, 0.9)
        assert low <= float(found.x.derivative(0)) / series[0][0] < high, part
        h = 1e-6
        steps = [
            Vec3(*(Taylor([c[0] + h * s * c[1], 0.0, 0.0]) for c in series))
            for s in (1.0, -1.0)
        ]
        after, before = (
            array(Vec3(*(c.derivative(0) for c in leaning(REACH, step, 0.9))))
            for step in steps
        )
        slope = [float(c.derivative(1)) for c in found]
        np.testing.assert_allclose(
            slope, (after - before) / (2.0 * h), rtol=1e-4, atol=1e-6
        )
    # almost no share: the attitude is that of the whole force, as of a flat vehicle
    series, found = leant(3.0, 1e-6)
    np.testing.assert_allclose(
        [[float(c) for c in each.c] for each in found],
        [[*c[:2], c[2]] for c in series],
        rtol=1e-5,
    )


def test_a_held_attitude_is_that_of_its_angles_and_yields_where_sideways_force_ends():
    """Z-Y-X angles by SciPy, under a yaw that turns; what hovers within the reach leans
    nowhere else.
    """
    yaw, angles = Taylor([0.7, 0.4, 0.1]), (0.12, -0.1)
    axis = thrust_axis(angles, yaw)

    def by_scipy(t):
        return Rotation.from_euler(
            "ZYX", [0.7 + 0.4 * t + 0.1 * t * t, angles[1], angles[0]]
        ).as_matrix()[:, 2]

    h = 1e-5
    np.testing.assert_allclose(
        [float(c.derivative(0)) for c in axis], by_scipy(0.0), atol=1e-12
    )
    slope = (by_scipy(h) - by_scipy(-h)) / (2.0 * h)
    np.testing.assert_allclose([float(c.derivative(1)) for c in axis], slope, atol=1e-9)
    hover = Vec3(*(Taylor([c, 0.0, 0.0]) for c in (0.0, 0.0, WEIGHT)))
    for size, within in ((0.5, 1e-4), (6.0, math.inf)):
        axis = thrust_axis((size * 0.12, size * -0.1), yaw)
        b3 = array(Vec3(*(c.derivative(0) for c in leaning(REACH, hover, 0.9, axis))))
        off = np.linalg.norm(
            np.cross(b3 / np.linalg.norm(b3), [float(c.derivative(0)) for c in axis])
        )
        assert off < within
    # beyond: between the wanted axis and upright
    assert 0.2 < off < 0.8
    # turned together, force and axis lean as about world z
    turn = Rotation.from_rotvec([0.5, -0.3, 0.2])
    series, level = leant(5.0, 0.9)
    turned = [vec(turn.apply([each[k] for each in series])) for k in range(3)]
    force = Vec3(*(Taylor(each) for each in zip(*turned, strict=True)))
    z = vec(turn.apply([0.0, 0.0, 1.0]))
    found = leaning(REACH, force, 0.9, Vec3(*(Taylor.constant(c, 2) for c in z)))
    for k in range(3):
        expected = turn.apply([float(c.c[k]) for c in level])
        np.testing.assert_allclose([float(c.c[k]) for c in found], expected, atol=1e-9)


def test_an_attitude_without_sideways_force_is_refused():
    with pytest.raises(
        ControllerError,
        match=r"^controller.attitude = .*: must be level without the option sideways",
    ):
        make_centroidal(Model(vehicle=HEXA), attitude=(0.1, 0.0))
    with pytest.raises(ControllerError, match=r"^controller.attitude\[1\] = -1.5: "):
        make_centroidal(Model(vehicle=HEXA), sideways=0.9, attitude=(0.1, -1.5))


def test_the_planned_force_changes_in_the_planned_bodys_axes_as_differences_say():
    def force(t):
        p2 = np.array([math.sin(t), math.cos(2.0 * t), 0.4 * t])
        return moving(t)[1].inv().apply(2.5 * np.add(p2, [0.0, 0.0, 9.81]))

    h, t = 1e-6, 0.3
    turn = (moving(t - h)[1].inv() * moving(t + h)[1]).as_rotvec() / (2.0 * h)
    still = DesiredAttitude(
        Mat3(*(vec(row) for row in moving(t)[1].as_matrix())), vec(turn), STILL
    )
    motion = [
        vec([math.sin(t), math.cos(2.0 * t), 0.4 * t]),
        vec([math.cos(t), -2.0 * math.sin(2.0 * t), 0.4]),
    ]
    found = array(planned_rate(still, motion, 2.5, 9.81))
    np.testing.assert_allclose(
        found, (force(t + h) - force(t - h)) / (2.0 * h), rtol=1e-6, atol=1e-6
    )


@pytest.mark.parametrize("share", [0.0, 0.1, 1.0])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_rotors_follow_a_force_that_changes_as_planned_without_lag(share, sign):
    """Up and down, the mean of a period against the wanted mean: to second order of the
    change of speed in a lag.
    """
    dt, rate = 0.005, Vec3(sign * 1.5, sign * 0.6, 0.0)
    change = np.array(
        [a[0] * float(rate.x) + a[1] * float(rate.y) for a in MIXER.across]
    )
    start = 480.0**2
    speeds, late, plain = [480.0] * 6, [], [480.0] * 6
    for k in range(100):
        wanted = [start + c * k * dt for c in change]
        ahead = compensate_motor_lag(HEXA.rotors, MIXER, rate, wanted, dt, share)
        now = []
        for who, targets in ((speeds, ahead), (plain, wanted)):
            sent = [
                command_for(r, w, math.sqrt(t), dt, share)
                for r, w, t in zip(HEXA.rotors, who, targets, strict=True)
            ]
            after = [
                speed_after(r, w, c, dt)
                for r, w, c in zip(HEXA.rotors, who, sent, strict=True)
            ]
            now.append(
                [
                    0.5 * (a * a + b * b) - w
                    for a, b, w in zip(who, after, wanted, strict=True)
                ]
            )
            who[:] = after
        late.append(np.abs(np.array(now) - 0.5 * dt * change).max(axis=1))
    led_off, plain_off = np.array(late)[80:].mean(axis=0)
    assert led_off < 0.06 * plain_off


def test_sideways_force_of_the_rotors_is_no_disturbance_of_the_planned_attitude():
    """Beyond the reach, so that there is a tilt: with rotors that push sideways now and
    with even ones.
    """
    flown = make_centroidal(Model(vehicle=ARM), mode="tip", sideways=0.9)
    signals = [
        Taylor([float(v), 0.0, 0.0, 0.0, 0.0]) for v in (0.0, 0.0, 1.5, 0.0, 0.3, -0.2)
    ]
    found = []
    for speeds in ((480.0,) * 6, (300.0, 520.0, 480.0, 610.0, 350.0, 600.0)):
        state = dataclasses.replace(RESTING, rotor_speeds=speeds)
        wind = Vec3(0.0, 9.0, 0.0)
        demand = demanded(flown.par, state, signals, NOTHING, wind)
        found.append(demand.planned.R)
    tilted = math.degrees(math.acos(float(found[0].column(2).z)))
    assert tilted > 5.0
    assert leaves(found[1]) == pytest.approx(leaves(found[0]), abs=1e-12)
    flown = make_centroidal(
        Model(vehicle=ARM), mode="tip", sideways=0.9, attitude=(0.05, -0.1)
    )
    demand = demanded(flown.par, RESTING_ROTORS, signals, NOTHING)
    expected = Rotation.from_euler("ZYX", [0.0, -0.1, 0.05]).as_matrix()[:, 2]
    np.testing.assert_allclose(array(demand.planned.R.column(2)), expected, atol=1e-4)


def test_a_belief_with_another_rotor_has_its_own_mixer():
    controller = make_centroidal(Model(vehicle=HEXA), sideways=0.9)
    scenario = Scenario(
        name="x",
        duration=1.0,
        plant=Truth(vehicle=HEXA),
        controller=controller,
        reference=hover((0.0, 0.0, 1.5)),
        ground=False,
    )
    path = "model.vehicle.rotors.0.thrust_coefficient"
    par = with_numbers(scenario, {path: 3e-5}).controller.par
    expected = make_mixer(
        par.model.vehicle, "priority", True, controller.par.mixer.yaw_slack
    )
    assert leaves(par.mixer) == leaves(expected)
    assert leaves(par.mixer) != leaves(controller.par.mixer)


def test_a_vehicle_without_sideways_force_is_refused_by_the_options_name():
    with pytest.raises(
        ControllerError,
        match=r"^controller.sideways: vehicle 'hummingbird': .* rank 4: must be 6",
    ):
        make_centroidal(Model(vehicle=skyarm.load_vehicle("hummingbird")), sideways=0.9)


@pytest.mark.parametrize(
    "mode", [pytest.param("joint", marks=pytest.mark.thorough), "tip"]
)
def test_every_engine_computes_the_same(mode):
    """A trace bit for bit, NumPy lanes up to rounding; with delay, at attitudes and
    speeds far from hover.
    """
    flown = make_centroidal(
        Model(vehicle=ARM), mode=mode, sideways=0.9, delay=0.005, attitude=(0.1, -0.2)
    )
    turning = (300.0, 520.0, 480.0, 610.0, 0.0, 700.0)
    inputs = [
        (
            dataclasses.replace(case.measurement(), rotor_speeds=turning),
            case.reference(),
        )
        for case in cases(3, seed=8)
    ]

    def step(memory, measurement, reference):
        return flown.law(memory, measurement, reference, 0.005, par=flown.par)

    program = trace(step, flown.memory, *inputs[0])
    memory = flown.memory
    for pair in inputs:
        found, plain = program(memory, *pair), step(memory, *pair)
        assert leaves(found) == leaves(plain)
        assert np.isfinite(leaves(plain)).all()
        memory = plain[0]
    if mode == "tip":
        lanes = [
            rebuild(pair, iter(np.array([leaves(each[k]) for each in inputs]).T))
            for k, pair in enumerate(inputs[0])
        ]
        batch = leaves(step(flown.memory, *lanes))
        spread = np.stack(
            [np.broadcast_to(leaf, (len(inputs),)) for leaf in batch], axis=1
        )
        alone = np.array(
            [leaves(step(flown.memory, *pair)) for pair in inputs], dtype=float
        )
        np.testing.assert_allclose(spread, alone, rtol=1e-7, atol=1e-5)
