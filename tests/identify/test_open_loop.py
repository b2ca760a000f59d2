"""Predictions from measured states on: against the flights' own simulation, and what is
measured at their begins.
"""

from __future__ import annotations

import dataclasses
import math
from functools import cache
from itertools import islice

import numpy as np
import pytest

from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.identify.identified_parts import (
    IdentifiedSurroundings,
    numbers_around,
    surroundings_with,
)
from skyarm.identify.open_loop import (
    FIELDS,
    BaseStates,
    OpenLoopPredictor,
    measured_states,
    no_poses,
    places_of,
    slopes_of,
    smooth_motion,
)
from skyarm.identify.windows import on_clock
from support.flights import GRAVITY, ONE, QUAD, STEP, flown, measured, rotations

ROTORS = 0.0033
"""s, a dead time that is no whole number of steps."""

ABOUT = IdentifiedSurroundings(delay=ROTORS)
BEGINS = np.array([210, 250, 290])


@cache
def log_of(vehicle):
    return flown(vehicle, 0.8, ROTORS, 0.0)


@cache
def loop_of(vehicle=QUAD, about=ABOUT, gravity=GRAVITY, **changes):
    """Open loop of a flight without noise, all of which is usable."""
    flight = measured(log_of(vehicle))
    clocked = on_clock(flight, vehicle, STEP, sections=[(0.0, 1.0)])
    return OpenLoopPredictor(
        vehicle, about, [flight], [dataclasses.replace(clocked, **changes)], gravity
    )


def to_world(quaternions, vector):
    """Vector of the base in world axes."""
    return rotations(quaternions) @ np.array(vector)


def after(loop, begins, steps, log=None, **more):
    """States some steps after begins, which are those of a log if it is given."""
    errors = loop.windows([np.asarray(begins)])
    states = (
        loop.begins(errors.windows)
        if log is None
        else BaseStates(*(log[name][begins] for name in FIELDS))
    )
    *_, last = islice(loop.ahead(errors, states, **more), steps + 1)
    return last


@pytest.mark.parametrize(
    ("vehicle", "off"),
    [(QUAD, 3e-5), (ONE, 1.5e-3)],
    ids=["quadrotor", "joint moved as measured"],
)
def test_a_flight_without_noise_returns_its_own_states(vehicle, off):
    """A fifth of a second on, to what is left of old commands after the run-in of the
    rotors.

    Where joints are given, to what differences leave of their rates, as efforts jump
    from step to step.

    From measured ones on, the states of a log are the log's as well, but for a smooth
    rate.
    """
    log, loop = log_of(vehicle), loop_of(vehicle)
    found, near = after(loop, BEGINS, 100, log), after(loop, BEGINS, 100)
    for name in FIELDS:
        assert getattr(found, name) == pytest.approx(
            log[name][BEGINS + 100], abs=off
        ), name
        assert np.abs(log[name][BEGINS + 100] - log[name][BEGINS]).max() > 30.0 * off
        begun = getattr(loop.begins(loop.windows([BEGINS]).windows), name)
        assert begun == pytest.approx(
            log[name][BEGINS], abs=3e-3 if name == "rate" else 1e-9
        ), name
        assert getattr(near, name) == pytest.approx(getattr(found, name), abs=5e-3), (
            name
        )
    assert not vehicle.n or np.ptp(log.joints, axis=0).min() > 0.3


def test_joints_move_as_measured_whatever_acts_on_them():
    """Without the reaction of the arm the base goes elsewhere; limits and friction of
    its drive do not matter.
    """
    (link,) = ONE.links
    weak = dataclasses.replace(
        link, joint=dataclasses.replace(link.joint, effort_limit=1e-3, damping=3.0)
    )
    first = after(loop_of(ONE), BEGINS, 100)
    flight = measured(log_of(ONE))
    clocked = on_clock(flight, ONE, STEP, sections=[(0.0, 1.0)])
    stuck = OpenLoopPredictor(
        dataclasses.replace(ONE, links=(weak,)), ABOUT, [flight], [clocked], GRAVITY
    )
    assert after(stuck, BEGINS, 100).rate == pytest.approx(first.rate, abs=1e-9)
    angles = flight["joint_positions"]
    still = flight.with_channels(
        {"joint_positions": dataclasses.replace(angles, values=0.0 * angles.values)}
    )
    rigid = OpenLoopPredictor(ONE, ABOUT, [still], [clocked], GRAVITY)
    assert np.abs(after(rigid, BEGINS, 100).rate - first.rate).max() > 0.05


def test_many_begins_equal_one_at_a_time():
    together = after(loop_of(), BEGINS, 60)
    for i, begin in enumerate(BEGINS):
        alone = after(loop_of(), [begin], 60)
        for name in FIELDS:
            assert getattr(alone, name)[0] == pytest.approx(
                getattr(together, name)[i], abs=1e-12
            )


def test_gravity_thrust_and_delay_act():
    """Less gravity, and more thrust by drift, flight or voltage, in 40 ms: half an
    acceleration times the time squared.

    A dead time of one more step flies the commands of one step before.
    """
    true, seconds = after(loop_of(), BEGINS, 20), 0.04
    lighter = after(loop_of(gravity=GRAVITY - 0.5), BEGINS, 20)
    assert (lighter.position - true.position)[:, 2] == pytest.approx(
        0.5 * 0.5 * seconds**2, rel=3e-3
    )
    up = to_world(true.quaternion, [0.0, 0.0, 1.0])
    thrust = after(loop_of(gravity=0.0), BEGINS, 20).velocity - true.velocity
    assert thrust[:, 2] == pytest.approx(GRAVITY * seconds, rel=5e-3)
    size = on_clock(measured(log_of(QUAD)), QUAD, STEP, sections=[(0.0, 1.0)]).size
    more = {
        "drift": loop_of(
            about=dataclasses.replace(ABOUT, drift=0.02), since=Given(np.ones(size))
        ),
        "thrust": loop_of(about=dataclasses.replace(ABOUT, thrust=1.02)),
        "sag": loop_of(
            about=dataclasses.replace(ABOUT, sag=1.0),
            voltage=Given(np.full(size, 1.02)),
        ),
    }
    pushed = {
        name: after(loop, BEGINS, 20).velocity - true.velocity
        for name, loop in more.items()
    }
    for name, each in pushed.items():
        assert each == pytest.approx(pushed["thrust"], rel=1e-6), name
        # 2 % of what lifts the weight, more or less
        assert 0.5 < (each * up).sum(axis=1).min() / (0.02 * GRAVITY * seconds) < 1.5
    late, speeds = (
        loop_of(about=IdentifiedSurroundings(delay=ROTORS + STEP)),
        log_of(QUAD).rotor_commands,
    )
    assert np.abs(np.diff(speeds, axis=0)[200:320]).max() > 1.0
    assert np.abs(after(late, BEGINS, 20).rate - true.rate).max() > 1e-3


class Given(np.ndarray):
    """Array that a cache may hold."""

    def __new__(cls, rows):
        return np.asarray(rows).view(cls)

    def __hash__(self):
        return hash(self.tobytes())

    def __eq__(self, other):
        return self is other


def test_a_wrench_that_is_given_acts_on_the_base_and_goes_on_as_it_is_told():
    force = np.array([[0.3, 0.0, 0.0, 0.0, 0.0, 0.0]] * 3)
    true, plain = (
        after(loop_of(), BEGINS, 20, pushes=lambda t: 0.0 * force),
        after(loop_of(), BEGINS, 20),
    )
    assert true.rate == pytest.approx(plain.rate, abs=1e-15)
    moved = after(loop_of(), BEGINS, 5, pushes=lambda t: force * (t < 0.006)).velocity
    moved = moved - after(loop_of(), BEGINS, 5).velocity
    gained = to_world(
        loop_of().measured.quaternion[BEGINS + 2],
        [0.3 * 0.006 / float(QUAD.mass), 0.0, 0.0],
    )
    assert moved == pytest.approx(gained, abs=0.15 * np.abs(gained).max())
    turn = np.array([[0.0, 0.0, 0.0, 0.0, 1e-3, 0.0]] * 3)
    turned = after(loop_of(), BEGINS, 20, pushes=lambda t: turn).rate - true.rate
    assert turned[:, 1] == pytest.approx(
        1e-3 * 0.04 / float(QUAD.base.inertia.yy), rel=0.1
    )


def test_nothing_that_is_measured_after_a_begin_enters_its_prediction():
    """Positions and rates that jump after it change what is compared, and what is
    predicted by next to nothing.
    """
    plain = measured(log_of(QUAD), without=("velocity",))
    clocked = on_clock(plain, QUAD, STEP, sections=[(0.0, 1.0)])
    jumped = {
        name: dataclasses.replace(
            plain[name],
            values=plain[name].values
            + np.where(plain[name].time > 250.5 * STEP, size, 0.0)[:, None],
        )
        for name, size in (("position", 0.02), ("gyro", 0.3))
    }
    first, other = (
        OpenLoopPredictor(QUAD, ABOUT, [each], [clocked], GRAVITY)
        for each in (plain, plain.with_channels(jumped))
    )
    assert (
        np.abs(first.measured.velocity[250] - other.measured.velocity[250]).max() > 0.1
    )
    for name in FIELDS:
        one, two = (getattr(after(each, [250], 20), name) for each in (first, other))
        assert one == pytest.approx(two, abs=3e-3), name


def test_holding_goes_on_straight_and_turns_evenly():
    rate = np.array([[0.3, -0.4, 1.2], [0.0, 0.0, 0.0]])
    now = BaseStates(
        np.array([[7.0, -8.0, 9.0]] * 2),
        np.array([[0.6, 0.0, 0.8, 0.0]] * 2),
        np.array([[1.0, 2.0, 3.0]] * 2),
        rate,
    )
    held = now.at_even_rates(0.5)
    assert held.position == pytest.approx(now.position + 0.5 * now.velocity)
    assert np.array_equal(held.velocity, now.velocity)
    turned = np.abs((held.quaternion * now.quaternion).sum(axis=1))
    assert 2.0 * np.arccos(np.minimum(turned, 1.0)) == pytest.approx(
        [0.65, 0.0], abs=1e-7
    )
    assert np.array_equal(held.rate, rate)
    assert held.at(np.array([1])).velocity.shape == (1, 3)


def test_predictions_begin_evenly_after_known_rotor_speeds_and_at_usable_steps():
    usable = np.ones(400, dtype=bool)
    usable[[330, 331]] = False
    clocked = dataclasses.replace(
        on_clock(measured(log_of(QUAD)), QUAD, STEP), usable=usable, size=400
    )
    lag = max(
        max(float(r.time_constant_up), float(r.time_constant_down)) for r in QUAD.rotors
    )
    first = math.ceil(8.0 * lag / STEP)
    assert places_of(clocked, QUAD, 25).tolist() == [
        *range(first, 330, 25),
        *range(332, 400, 25),
    ]
    assert places_of(clocked, QUAD, 25, 0.02).tolist() == [
        *range(first, 330, 25),
        *range(342, 400, 25),
    ]
    loop = loop_of(usable=Given(usable))
    windows = loop.windows([np.array([200, 329, 332, 398])]).windows
    assert loop.left(windows).tolist() == [
        130,
        1,
        loop.flights[0].size - 332,
        loop.flights[0].size - 398,
    ]


SPEED = np.array([0.4, -0.2, 0.1])


def flight_of(names, rate=200.0, noise=0.0):
    """Flight on a parabola that turns evenly about z through half a turn, where a
    quaternion changes its sign.
    """
    time = np.arange(0.0, 1.8, 1.0 / rate)
    yaw = math.pi + 0.8 * (time - time.mean())
    turned = np.stack(
        [np.cos(0.5 * yaw), 0.0 * yaw, 0.0 * yaw, np.sin(0.5 * yaw)], axis=1
    )
    draw = (
        np.random.default_rng(1).normal(scale=noise, size=(len(time), 3))
        if noise
        else 0.0
    )
    rows = {
        "gyro": np.zeros((len(time), 3)),
        "accelerometer": np.zeros((len(time), 3)),
        "rotor_speed_commands": np.full((len(time), 4), 500.0),
        "position": SPEED * time[:, None] - 0.5 * time[:, None] ** 2 + draw,
        "velocity": SPEED - time[:, None] + np.zeros(3),
        "quaternion": np.where(turned[:, :1] < 0.0, -turned, turned),
    }
    wanted = ("gyro", "accelerometer", "rotor_speed_commands", *names)
    channels = {
        name: Channel(time=time, values=rows[name], source=name) for name in wanted
    }
    return FlightData(name="made", file="made.csv", channels=channels)


def states_of(flight, about=ABOUT):
    clocked = on_clock(flight, QUAD, 0.005)
    inside = slice(round(0.2 / 0.005), round(1.5 / 0.005))
    both = measured_states(flight, clocked, about, 0)[:2]
    return (
        *(each.at(np.arange(clocked.size + 1)[inside]) for each in both),
        clocked.edges[inside, None],
    )


@pytest.mark.parametrize(
    ("names", "noise", "off"),
    [
        (("position", "velocity", "quaternion"), 0.0, 1e-9),
        (("position", "quaternion"), 0.0, 1e-9),  # a parabola's slope is exact
        # of 10 ms alone a noise of 1 mm would be 0.14 m/s
        (("position", "quaternion"), 1e-3, 0.08),
        (("velocity", "quaternion"), 0.0, 1e-9),
    ],
)
def test_velocity_and_position_come_from_each_other_where_one_is_not_measured(
    names, noise, off
):
    states, begins, time = states_of(flight_of(names, noise=noise))
    for each in (states, begins):
        assert each.velocity == pytest.approx(
            SPEED - time, abs=(1.0 if each is states else 3.0) * off
        )
    moved = SPEED * (time - time[0]) - 0.5 * (time**2 - time[0] ** 2)
    assert states.position - states.position[0] == pytest.approx(
        moved, abs=max(10.0 * noise, 1e-5)
    )


def test_a_late_pose_is_that_of_a_later_stamp_and_attitude_passes_half_a_turn_evenly():
    flight = flight_of(("position", "quaternion"))
    middle = flight["quaternion"].time.mean()
    for late in (0.0, 0.0123):
        states, _, time = states_of(flight, IdentifiedSurroundings(pose_delay=late))
        q, time = states.quaternion, time[:, 0] + late
        assert np.linalg.norm(q, axis=1) == pytest.approx(1.0)
        yaw = 2.0 * np.arctan2(q[:, 3], q[:, 0])
        assert np.exp(1j * yaw) == pytest.approx(
            np.exp(1j * (math.pi + 0.8 * (time - middle))), abs=1e-5
        )
        assert states.position[:, 0] == pytest.approx(
            SPEED[0] * time - 0.5 * time**2, abs=1e-5
        )


def test_a_flight_without_poses_is_level_and_its_gyro_without_bias():
    flight = flight_of(("position",))
    states, begins, _ = states_of(
        flight, IdentifiedSurroundings(gyro_bias=(0.1, 0.2, 0.3))
    )
    clocked = on_clock(flight, QUAD, 0.005)
    for each in measured_states(flight, clocked, ABOUT, 0)[:2]:
        assert (
            each.position.shape
            == each.velocity.shape
            == each.rate.shape
            == (clocked.size + 1, 3)
        )
    for each in (states, begins):
        assert (each.quaternion == [1.0, 0.0, 0.0, 0.0]).all()
        assert not each.position.any()
        assert each.rate == pytest.approx(
            np.tile([-0.1, -0.2, -0.3], (len(each.rate), 1))
        )


def test_polynomials_are_exact_where_they_fit_and_shorter_where_they_do_not():
    """Noise: over the whole length, a quarter is left of it. A swing too fast for that
    length: as good as without.
    """
    time = 0.002 * np.arange(600)
    draw = np.random.default_rng(3).normal(scale=0.01, size=(600, 1))

    def channel(values):
        return Channel(time=time, values=values, source="made")

    cubic = channel((time**3 - time)[:, None])
    value, slope = slopes_of(cubic, 5, 5, 4)
    assert value.time == pytest.approx(time)
    assert value.values[5:-5] == pytest.approx(cubic.values[5:-5], abs=1e-12)
    assert slope.values[5:-5, 0] == pytest.approx((3.0 * time**2 - 1.0)[5:-5], abs=1e-9)
    # a lost sample is made up between its neighbours
    lost = np.delete(np.arange(600), 300)
    line = Channel(time=time[lost], values=3.0 * time[lost, None], source="made")
    for found, wanted in zip(
        slopes_of(line, 5, 5, 2), (3.0 * time, 3.0 + 0.0 * time), strict=True
    ):
        assert found.time == pytest.approx(time)
        assert found.values[:, 0] == pytest.approx(wanted, abs=1e-9)
    noisy = channel(0.1 * time[:, None] + draw)
    value, _ = smooth_motion(noisy, 0.2, 2)
    assert np.std(value.values[60:-60, 0] - 0.1 * time[60:-60]) < 0.25 * 0.01
    swing = np.sin(40.0 * time)[:, None]
    for past in (False, True):
        value, _ = smooth_motion(channel(swing + 0.1 * draw), 0.2, 2, past=past)
        assert np.std((value.values - swing)[60:-60]) < 0.0013
    # a slower one bears a quarter of that length
    slow = np.sin(10.0 * time)[:, None]
    value, _ = smooth_motion(channel(slow + 0.1 * draw), 0.4, 2)
    assert np.std((value.values - slow)[60:-60]) < 5e-4
    with pytest.raises(ValueError, match=r"^made: 8 samples: must be at least 11$"):
        slopes_of(Channel(time=time[:8], values=swing[:8], source="made"), 5, 5, 4)


def test_noise_is_averaged_over_all_of_the_length_that_fits():
    """To a parabola's variance of 9 / (4 n) amid n samples and of about 9 / n at their
    end; else over half of them.
    """
    time, noise = (
        0.002 * np.arange(6000),
        np.random.default_rng(5).normal(scale=0.01, size=(6000, 3)),
    )
    line = Channel(time=time, values=0.1 * time[:, None] + noise, source="made")
    for past, variance in ((False, 9.0 / (4.0 * 101.0)), (True, 9.0 / 101.0)):
        value, _ = smooth_motion(line, 0.2, 2, past=past)
        left = (value.values - 0.1 * time[:, None])[110:-110]
        assert np.sqrt((left**2).mean()) == pytest.approx(
            0.01 * math.sqrt(variance), rel=0.1
        )
    # the bend of a swing that a parabola leaves grows sixteenfold with twice the length
    # here to 0.6 of the noise, of one column: all are of one length
    swung = dataclasses.replace(
        line, values=0.15 * np.sin(10.0 * time)[:, None] * [0.0, 1.0, 0.0] + noise
    )
    value, slope = smooth_motion(swung, 0.4, 2)
    half, steep = slopes_of(swung, 50, 50, 2)
    assert np.array_equal(value.values, half.values)
    assert np.array_equal(slope.values, steep.values)


@pytest.mark.parametrize(
    ("degree", "before", "after"), [(2, 2, 0), (2, 1, 1), (4, 2, 2)]
)
def test_steps_of_an_encoder_are_seen_by_as_few_samples_as_a_polynomial_needs(
    degree, before, after
):
    """Most of its samples do not change, as if there was no noise at all: no length
    fits.
    """
    time = 0.002 * np.arange(600)
    stairs = Channel(
        time=time, values=0.01 * np.floor(3.0 * time)[:, None], source="encoder"
    )
    value, slope = smooth_motion(stairs, 0.2, degree, past=not after)
    wanted = slopes_of(stairs, before, after, degree)
    assert np.array_equal(slope.values, wanted[1].values)
    assert np.array_equal(value.values, wanted[0].values)
    assert np.abs(slope.values).max() > 1.0


def test_rates_to_begin_with_are_parabolas_through_the_last_tenth_of_a_second():
    """Of the gyroscope's samples until then; its bias is taken off."""
    flight, draw = (
        flight_of(("position", "velocity", "quaternion")),
        np.random.default_rng(2),
    )
    gyro = dataclasses.replace(
        flight["gyro"], values=draw.normal(size=flight["gyro"].values.shape)
    )
    about = IdentifiedSurroundings(gyro_bias=(0.1, -0.2, 0.3))
    _, begins, _ = states_of(flight.with_channels({"gyro": gyro}), about)
    for k in (0, 57, 200):
        last = 40 + k  # states begin at 0.2 s, of 200 samples a second
        rows = gyro.values[last - 20 : last + 1]
        wanted = np.polyfit(np.arange(-20.0, 1.0), rows, 2)[-1] - [0.1, -0.2, 0.3]
        assert begins.rate[k] == pytest.approx(wanted, abs=1e-9)


def test_velocities_are_slopes_of_parabolas_through_a_tenth_of_a_second_of_positions():
    """Around an instant, and of those to begin with before it: 20 samples and the one
    at its instant.
    """
    flight, draw = flight_of(("position", "quaternion")), np.random.default_rng(3)
    place = dataclasses.replace(
        flight["position"], values=draw.normal(size=flight["position"].values.shape)
    )
    states, begins, _ = states_of(flight.with_channels({"position": place}))
    for k in (0, 57, 200):
        for found, first in ((states, -10), (begins, -20)):
            at = np.arange(first, first + 21)
            wanted = np.polyfit(0.005 * at, place.values[40 + k + at], 2)[-2]
            assert found.velocity[k] == pytest.approx(wanted, rel=1e-9)


def test_joints_are_given_with_the_rates_and_accelerations_of_their_measured_angles():
    """A quartic is exact but where samples end; an acceleration is the mean over its
    step.
    """
    flight = flight_of(("position", "velocity", "quaternion"))
    time = flight["gyro"].time
    angles = Channel(
        time=time,
        values=np.stack([time**4 - time, 0.5 * time**2], axis=1),
        source="angles",
    )
    clocked = on_clock(flight, QUAD, 0.005)
    _, _, motion = measured_states(
        flight.with_channels({"joint_positions": angles}), clocked, ABOUT, 2
    )
    assert motion.shape == (3, clocked.size, 2)
    inside, edges = slice(20, -20), clocked.edges
    t = edges[:-1]
    wanted = [
        np.stack([t**4 - t, 0.5 * t**2], axis=1),
        np.stack([4.0 * t**3 - 1.0, t], axis=1),
        np.stack([np.diff(4.0 * edges**3) / 0.005, np.ones(clocked.size)], axis=1),
    ]
    for found, exact in zip(motion, wanted, strict=True):
        assert found[inside] == pytest.approx(exact[inside], abs=1e-6)
    assert measured_states(flight, clocked, ABOUT, 0)[2].shape == (3, clocked.size, 0)


@pytest.mark.parametrize(
    ("names", "missing"),
    [
        (("position", "quaternion"), None),
        (("velocity", "quaternion"), None),
        (("quaternion",), "position"),
        (("position", "velocity"), "quaternion"),
        ((), "quaternion"),
    ],
)
def test_a_pose_is_an_attitude_and_a_place_or_a_velocity(names, missing):
    words = (
        f"no {missing} is measured: rate and specific force are predicted, and no pose"
    )
    assert no_poses(flight_of(names)) == (words if missing else "")


def test_numbers_of_surroundings_make_them_again():
    about = IdentifiedSurroundings(
        delay=0.01,
        gyro_bias=(1.0, 2.0, 3.0),
        sag=1.5,
        torque=(0.1, 0.0, -0.1),
        setpoint_hold=0.7,
    )
    assert surroundings_with(numbers_around(about)) == about
    assert "thrust" not in numbers_around(dataclasses.replace(about, thrust=1.1))
