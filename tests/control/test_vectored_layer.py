"""A law on rotors that tilt: the wrench at the angles that stand, servos that are led,
small thrusts, and flights.
"""

from __future__ import annotations

import dataclasses
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
from tilting_flights import (
    NOISE,
    SWINGING,
    VOLIRO,
    across,
    eased_circle,
    errors,
    scenario,
    tilt,
)

import skyarm
from skyarm.control.controller import ControllerError
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.model import Model
from skyarm.control.safety import with_safety_layer
from skyarm.control.vectored_layer import (
    goal_angles,
    pairs_model,
    squares_at,
    turns_rotors,
    with_tilting,
)
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.actuators.tilting import TiltedForce, angle_after, speeds_of_pairs
from skyarm.log.log_columns import columns
from skyarm.reference import Reference
from skyarm.sensing.measurement import blank_measurement
from skyarm.simulate import run
from skyarm.simulate.batch import Batch
from skyarm.studies.stability.frozen_scenario import nominal

BARE = dataclasses.replace(VOLIRO, links=(), frames=(), end_effector="")
WANTED = tuple(
    TiltedForce(push, angle)
    for push, angle in zip(
        (2.2e5, 2.4e5, 2.0e5, 2.3e5, 2.5e5, 2.1e5),
        (0.30, -0.25, 0.20, 0.35, -0.30, 0.15),
        strict=True,
    )
)
LIMITS = {"stiffness": 8.0, "damping": 4.0}


def wrench(angles, squares):
    """Torque and force of all rotors at their angles, written out with NumPy."""
    total = np.zeros(6)
    for rotor, angle, square in zip(BARE.rotors, angles, squares, strict=True):
        at, n, t = (
            np.array([float(c) for c in v])
            for v in (rotor.position, rotor.axis, rotor.tilt.axis)
        )
        push = (
            float(rotor.thrust_coefficient)
            * float(square)
            * (n * np.cos(angle) + np.cross(t, n) * np.sin(angle))
        )
        twist = -rotor.direction * float(rotor.moment_coefficient) * push
        total += np.array([*(np.cross(at, push) + twist), *push])
    return total


def test_torque_and_thrust_are_right_while_the_servos_are_on_their_way():
    goal = wrench([f.angle for f in WANTED], [f.push for f in WANTED])
    rng = np.random.default_rng(4)
    for _ in range(10):
        angles = [
            f.angle + late
            for f, late in zip(WANTED, rng.uniform(-0.2, 0.2, 6), strict=True)
        ]
        found = wrench(angles, squares_at(BARE, WANTED, angles))
        np.testing.assert_allclose(found[[0, 1, 5]], goal[[0, 1, 5]], atol=1e-9)
        left = wrench(angles, [f.push for f in WANTED])
        # of the torque about z a part is left to the angles; without the correction the
        # others are off too
        assert abs(found[2] - goal[2]) < 0.75 * abs(left[2] - goal[2])
        assert np.abs(left[[0, 1, 5]] - goal[[0, 1, 5]]).max() > 0.05


def test_the_change_of_thrust_is_the_least_that_gives_three_rows_and_a_damped_fourth():
    """Of |c|^2 + (z(c) - z)^2 / d with the other rows exact, d the squared reach about
    z at rest: by NumPy.
    """
    angles = [
        f.angle + late
        for f, late in zip(WANTED, (0.1, -0.2, 0.15, 0.05, -0.1, 0.2), strict=True)
    ]
    columns, still = (
        np.array([wrench(at, one)[[0, 1, 2, 5]] for one in np.eye(6)]).T
        for at in (angles, np.zeros(6))
    )
    kept = np.array(
        [f.push * np.cos(f.angle - at) for f, at in zip(WANTED, angles, strict=True)]
    )
    short = (
        wrench([f.angle for f in WANTED], [f.push for f in WANTED])[[0, 1, 2, 5]]
        - columns @ kept
    )
    exact, yaw, reach = columns[[0, 1, 3]], columns[2], np.sqrt(still[2] @ still[2])
    first, free = (
        np.linalg.pinv(exact) @ short[[0, 1, 3]],
        scipy.linalg.null_space(exact),
    )
    rows = np.vstack([free, (yaw @ free) / reach])
    wanted = [*-first, (short[2] - yaw @ first) / reach]
    change = first + free @ np.linalg.lstsq(rows, np.array(wanted), rcond=None)[0]
    np.testing.assert_allclose(
        squares_at(BARE, WANTED, angles) - kept, change, rtol=1e-6
    )


def test_servos_that_stand_where_they_should_leave_the_thrusts_alone():
    squares = squares_at(BARE, WANTED, [f.angle for f in WANTED])
    np.testing.assert_allclose(squares, [f.push for f in WANTED], rtol=1e-9)


def test_a_correction_stays_within_what_the_rotors_have():
    top = 900.0**2
    strong = tuple(TiltedForce(0.98 * top, 0.7) for _ in WANTED)
    squares = np.array(
        squares_at(BARE, strong, [0.7, -0.7, 0.7, 0.0, 0.1, -0.5]), dtype=float
    )
    assert squares.max() <= top * (1.0 + 1e-12)
    # as much of the whole correction is taken as fits: the same share for every rotor
    angles = [0.4, 0.9, 0.3, 1.0, 0.5, 0.8]
    roomy = dataclasses.replace(
        BARE, rotors=tuple(dataclasses.replace(r, max_speed=1e4) for r in BARE.rotors)
    )
    kept = np.array(
        [f.push * np.cos(f.angle - a) for f, a in zip(strong, angles, strict=True)]
    )
    whole, cut = (np.array(squares_at(v, strong, angles)) - kept for v in (roomy, BARE))
    assert (kept + whole).max() > 1.01 * top
    np.testing.assert_allclose(cut / whole, cut[0] / whole[0], rtol=1e-9)
    assert 0.0 < cut[0] / whole[0] < 0.99
    assert (kept + cut).max() == pytest.approx(top)


def test_an_angle_of_next_to_no_thrust_moves_slowly_and_any_other_at_once():
    last = (0.5,) * 6
    none = goal_angles(MODEL, tuple(TiltedForce(0.0, -1.0) for _ in last), last, 0.005)
    assert none == last
    little, most = 0.002 * 900.0**2, 0.1 * 900.0**2
    moved = goal_angles(
        MODEL,
        (TiltedForce(little, -1.0), *(TiltedForce(most, -1.0) for _ in last[1:])),
        last,
        0.005,
    )
    assert moved[0] == pytest.approx(0.5 - 1.5 * 0.1)
    assert moved[1:] == pytest.approx((-1.0,) * 5)


def test_an_angle_of_little_thrust_moves_as_fast_at_every_rate_of_control():
    def after(seconds, rate):
        found = (0.5,) * 6
        for _ in range(round(seconds * rate)):
            found = goal_angles(
                MODEL, (TiltedForce(3e-5 * 900.0**2, -1.0),) * 6, found, 1.0 / rate
            )
        return found[0]

    assert after(0.1, 200) == pytest.approx(after(0.1, 1000), abs=1e-3)
    assert after(0.1, 200) < 0.47


def test_rotors_without_a_largest_speed_turn_as_others_do():
    free = dataclasses.replace(
        BARE,
        rotors=tuple(dataclasses.replace(r, max_speed=np.inf) for r in BARE.rotors),
    )
    # nobody hovers without gravity: a largest speed says then how strong a rotor is
    floats = Model(vehicle=BARE, gravity=0.0)
    assert goal_angles(
        floats, (TiltedForce(0.002 * 900.0**2, 1.0),) * 6, (0.0,) * 6, 0.005
    ) == pytest.approx([0.1] * 6)
    for gravity in (9.81, 1.62):
        turned = goal_angles(
            Model(vehicle=free, gravity=gravity), WANTED, (0.0,) * 6, 0.005
        )
        assert turned == pytest.approx([f.angle for f in WANTED])
    little = TiltedForce(0.02 * 2.0e4, 1.0)
    assert (
        0.0
        < goal_angles(Model(vehicle=free), (little,) * 6, (0.0,) * 6, 0.005)[0]
        < 0.1
    )


def test_the_vehicle_of_the_page_turns_its_rotors():
    file = (
        Path(__file__).resolve().parents[2]
        / "examples"
        / "files"
        / "tilting_quadrotor.toml"
    )
    log = run(scenario(skyarm.load_vehicle(file), across(1.5, start=0.0), 1.0))
    assert log.status == "completed"
    assert tilt(log).max() < 1.0
    assert np.abs(log.tilts).max() > 0.2


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf])
def test_an_angle_that_is_no_number_is_the_believed_one(wrong):
    now = (0.1, -0.2, 0.3, 0.2, -0.1, 0.0)
    first, _ = stepped(now)
    _, seen = stepped((*now[:3], first.angles[3], *now[4:]), first)
    second, command = stepped((*now[:3], wrong, *now[4:]), first)
    assert command == seen
    assert np.isfinite([*second.goals, *second.angles, *second.matched]).all()


def test_servos_are_led_by_what_they_lag_more_than_the_motors():
    def lead(seconds):
        tilt = dataclasses.replace(VOLIRO.rotors[0].tilt, time_constant=seconds)
        rotors = tuple(
            dataclasses.replace(each, tilt=tilt) for each in VOLIRO.rotors[:1]
        )
        believed = dataclasses.replace(BARE, rotors=(*rotors, *BARE.rotors[1:]))
        return make_centroidal(Model(vehicle=believed), sideways=0.9).par.lead[0]

    # motors of 30 ms up and 50 ms down
    assert [lead(each) for each in (0.01, 0.05, 0.08, 1.0)] == pytest.approx(
        [1.0, 1.25, 2.0, 3.0]
    )


def test_only_a_law_that_is_told_to_turns_rotors():
    with_it, without = (
        make_centroidal(Model(vehicle=VOLIRO), mode="tip", sideways=s)
        for s in (0.9, 0.0)
    )
    assert turns_rotors(with_it)
    assert not turns_rotors(without)
    with pytest.raises(ControllerError, match="has its tilting rotors already"):
        with_tilting(with_it, Model(vehicle=VOLIRO))
    with pytest.raises(ControllerError, match="must have a rotor with a tilt"):
        with_tilting(without, Model(vehicle=skyarm.load_vehicle("tilted_hexarotor")))


def still_law(memory, measurement, reference, dt, *, par):
    """Asks for what its memory holds; keeps the pairs' speeds that it was told of."""
    return (*memory[:12], *measurement.rotor_speeds), Command(rotor_speeds=memory[:12])


def stepped(measured, memory=None, share=1.0):
    """Memory and command of one step of the layer around a law that wants WANTED;
    angles as measured, or none.
    """
    pairs = speeds_of_pairs(
        BARE, [(share * f.push) ** 0.5 for f in WANTED], [f.angle for f in WANTED]
    )
    inside = make_centroidal(pairs_model(MODEL))
    made = with_tilting(
        dataclasses.replace(inside, law=still_law, memory=(*pairs, *pairs)), MODEL
    )
    seen = dataclasses.replace(
        blank_measurement(0, 6), rotor_speeds=(470.0,) * 6, tilts=measured
    )
    return made.law(memory or made.memory, seen, Reference(), 0.005, par=made.par)


MODEL = Model(vehicle=BARE)
GOALS = [f.angle for f in WANTED]


def test_a_servo_is_told_to_go_ahead_of_its_angle_and_no_further_than_its_range():
    now = (0.1, -0.2, 0.3, 1.5, -1.5, 0.0)
    _, command = stepped(now)
    np.testing.assert_allclose(
        command.tilts,
        np.clip(now + 1.25 * (np.array(GOALS) - now), -np.pi / 2, np.pi / 2),
    )


def test_next_to_no_thrust_turns_no_servo():
    _, command = stepped((0.0,) * 6, share=1e-4)
    assert np.abs(command.tilts).max() < 1e-3
    # the servo goes on to where it was told to go, not to where it stands
    first, _ = stepped((0.0,) * 6)
    going = dataclasses.replace(
        first, inner=(1.0,) * 24, goals=(0.3, -0.2, 0.1, 0.3, -0.2, 0.1)
    )
    _, command = stepped((0.05,) * 6, going)
    np.testing.assert_allclose(
        command.tilts, 0.05 + 1.25 * (np.array(going.goals) - 0.05), atol=1e-3
    )


def test_thrusts_change_only_for_an_angle_that_is_not_as_the_motors_lag():
    first, begun = stepped((0.0,) * 6)
    wanted = [f.push**0.5 for f in WANTED]
    np.testing.assert_allclose(begun.rotor_speeds, wanted, rtol=1e-9)
    # of motors of 40 ms, a period on
    on_the_way = np.array(GOALS) * (1.0 - np.exp(-0.005 / 0.04))
    np.testing.assert_allclose(first.matched, on_the_way, rtol=1e-9)
    _, as_due = stepped(tuple(on_the_way), first)
    np.testing.assert_allclose(as_due.rotor_speeds, wanted, rtol=1e-9)
    off = np.array([0.1, -0.05, 0.08, 0.0, -0.1, 0.05])
    _, corrected = stepped(tuple(on_the_way + off), first)
    squares = np.square(corrected.rotor_speeds)
    np.testing.assert_allclose(
        squares, squares_at(BARE, WANTED, tuple(np.array(GOALS) + off)), rtol=1e-9
    )
    assert np.abs(np.array(corrected.rotor_speeds) / wanted - 1.0).max() > 1e-3


def test_a_measurement_without_angles_leaves_the_belief_of_the_servos():
    first, command = stepped(())
    believed = [
        angle_after(t, 0.0, u, 0.005)
        for t, u in zip(BARE.tilts, command.tilts, strict=True)
    ]
    np.testing.assert_allclose(first.angles, believed, rtol=1e-9)
    _, second = stepped((), first)
    np.testing.assert_allclose(
        second.tilts,
        np.array(believed) + 1.25 * (np.array(GOALS) - believed),
        rtol=1e-9,
    )


def test_a_law_is_told_how_its_pairs_push():
    memory, _ = stepped((0.2,) * 6)
    np.testing.assert_allclose(
        memory.inner[12:], speeds_of_pairs(BARE, (470.0,) * 6, (0.2,) * 6), rtol=1e-12
    )


@cache
def moved():
    return run(scenario(BARE, across(1.5), 2.2))


def test_a_metre_is_flown_level_by_turning_the_rotors():
    log = moved()
    assert log.status == "completed"
    assert tilt(log).max() < 0.3
    assert errors(log, "position").max() < 3.0
    assert 0.3 < np.abs(log.tilts).max() < 0.7
    assert log.tilts.shape == log.tilt_commands.shape == (440, 6)


def test_logged_angles_follow_their_commands_as_the_servos_do():
    log = moved()
    for i, servo in enumerate(BARE.tilts):
        following = servo.time_constant
        step = (log.tilt_commands[:-1, i] - log.tilts[:-1, i]) * (
            1.0 - np.exp(-0.005 / following)
        )
        slow = (
            np.abs(log.tilt_commands[:-1, i] - log.tilts[:-1, i])
            < servo.max_rate * following
        )
        np.testing.assert_allclose(
            np.diff(log.tilts[:, i])[slow], step[slow], atol=1e-9
        )


def test_a_linearisation_holds_the_rotors_at_rest_or_says_that_it_cannot():
    plain = scenario(BARE, across(1.5), 1.0, sideways=0.0)
    assert nominal(plain).plant.vehicle.tilts == ()
    with pytest.raises(skyarm.ScenarioError, match="must be left out of margins"):
        nominal(scenario(BARE, across(1.5), 1.0))


@pytest.mark.thorough
def test_with_its_arm_swinging_the_tip_is_kept_level_and_within_a_millimetre():
    for plant in ("rigid_body", "mujoco"):
        log = run(
            dataclasses.replace(
                scenario(VOLIRO, across(3.0, SWINGING), 5.0), kind=plant
            )
        )
        late = log.time >= 0.5
        assert tilt(log)[late].max() < 0.1
        assert errors(log, "tip")[late].max() < 0.5


@pytest.mark.thorough
@pytest.mark.parametrize("seconds", [0.02, 0.1])
def test_servos_of_another_lag_than_believed_cost_little(seconds):
    rotors = tuple(
        dataclasses.replace(r, tilt=dataclasses.replace(r.tilt, time_constant=seconds))
        for r in VOLIRO.rotors
    )
    flown = scenario(
        VOLIRO,
        across(1.5, SWINGING),
        4.0,
        truth=dataclasses.replace(VOLIRO, rotors=rotors),
        delay=0.005,
    )
    log = run(dataclasses.replace(flown, noise=NOISE))
    late = log.time >= 0.5
    assert tilt(log)[late].max() < 2.0
    assert errors(log, "tip")[late].mean() < 1.5


def test_a_safety_layer_goes_around_the_law_of_pairs():
    guarded = with_safety_layer(
        make_centroidal(Model(vehicle=BARE), sideways=0.9), LIMITS
    )
    assert guarded.name == "guarded_centroidal_joint"
    assert turns_rotors(guarded)
    assert len(guarded.memory.inner.sent.rotor_speeds) == 12
    with pytest.raises(ControllerError, match="has a safety layer already"):
        with_safety_layer(guarded, LIMITS)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("trial", "trajectory"),
    [
        ("1 m in 3 s", across(3.0, SWINGING, 1.0)),
        ("circle of 1 m, 1 m/s", eased_circle(1.0)),
    ],
    ids=["metre", "circle"],
)
def test_the_table_of_the_page_is_flown(trial, trajectory):
    docs = Path(__file__).resolve().parents[2] / "docs"
    page = (docs / "data" / "results_laws.md").read_text("utf-8")
    text = page.partition("<!-- tilting rotors;")[2].partition(
        "<!-- /tilting rotors -->"
    )[0]
    rows = {
        tuple(map(str.strip, line.split("|")[1:3])): line.split("|")[3:6]
        for line in text.splitlines()[1:]
    }
    seconds = 5.0 if trial.startswith("1 m") else 12.0
    for flown, options in (
        ("without `sideways`", {"sideways": 0.0}),
        ("with `sideways`", {}),
    ):
        log = run(scenario(VOLIRO, trajectory, seconds, **options))
        late = log.time >= 1.0
        mean, most, angle = map(float, rows[trial, flown])
        found = errors(log, "tip")[late]
        assert [found.mean(), found.max()] == pytest.approx([mean, most], abs=6e-3)
        assert tilt(log)[late].max() == pytest.approx(angle, abs=0.06)


@pytest.mark.thorough
def test_a_pitch_is_held_in_hover_and_the_safety_layer_stays_out_of_it():
    for guarded in (False, True):
        log = run(
            scenario(
                VOLIRO, across(2.0, SWINGING), 4.0, guarded=guarded, attitude=(0.0, 0.3)
            )
        )
        late = log.time >= 3.0
        np.testing.assert_allclose(log.euler[late, 1], 0.3, atol=0.01)
        assert errors(log, "tip")[late].max() < 2.0


def test_a_log_names_the_angles_by_their_rotors():
    log = moved()
    names = [
        each.name for each in columns(log) if each.array in ("tilts", "tilt_commands")
    ]
    assert names == [
        f"rotor_{kind}_{i}" for kind in ("tilt", "tilt_command") for i in range(6)
    ]


@pytest.mark.thorough
def test_a_session_and_a_batch_turn_rotors_by_commands_and_a_lag_is_swept():
    planned = scenario(BARE, across(1.5), 1.5)
    session = skyarm.Session(planned)
    for _ in range(20):
        session.step(Command(rotor_speeds=(480.0,) * 6, tilts=(0.1,) * 6))
    held = session.state.tilts
    np.testing.assert_allclose(held, 0.1 * (1.0 - np.exp(-2.0)), rtol=1e-9)
    session.step(Command(rotor_speeds=(480.0,) * 6))
    assert session.state.tilts[0] < held[0]
    with pytest.raises(skyarm.ScenarioError, match="5 tilts: must be 6, or none"):
        session.step(Command(rotor_speeds=(480.0,) * 6, tilts=(0.1,) * 5))
    batch = Batch(
        planned, ["plant.vehicle.rotors.0.tilt.time_constant"], bit_exact=True
    )
    lags = np.array([0.02, 0.05, 0.2])
    found = batch.fly({"plant.vehicle.rotors.0.tilt.time_constant": lags}).state
    for lane, lag in enumerate(lags):
        first = dataclasses.replace(
            BARE.rotors[0],
            tilt=dataclasses.replace(BARE.rotors[0].tilt, time_constant=lag),
        )
        truth = dataclasses.replace(BARE, rotors=(first, *BARE.rotors[1:]))
        alone = skyarm.Session(scenario(BARE, across(1.5), 1.5, truth=truth))
        while alone.step():
            pass
        np.testing.assert_allclose(
            [each[lane] for each in found.tilts], alone.state.tilts, rtol=1e-12
        )
        assert found.position.x[lane] == pytest.approx(
            alone.state.position.x, abs=1e-12
        )
