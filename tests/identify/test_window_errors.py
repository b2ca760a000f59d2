"""Errors of windows at the truth, their slopes against central differences, and the
weights of outliers.
"""

from __future__ import annotations

import copy
import dataclasses
import math
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from skyarm.algebra import Vec3
from skyarm.flight_data.flight_data import Channel
from skyarm.identify.unknowns import Unknown, unknowns_of
from skyarm.identify.window_errors import (
    OUTLIER,
    WindowErrors,
    WindowLanes,
    WindowStates,
    turn_attitudes,
)
from skyarm.identify.windows import ClockedWindows, Held, SensorSamples, on_clock
from support.flights import GRAVITY, ONE, QUAD, STEP, flown, measured, on_servo

ROTORS, JOINTS = 0.0033, 0.0047
PLACE = (0.03, -0.02, 0.05)
SERVO = on_servo(integral=8.0, speed_limit=4.0)

TRUTH = {
    "delay": ROTORS,
    "joint_delay": JOINTS,
    "drives.joint1.latency": JOINTS - ROTORS,
    "setpoint_hold": 0.0,
    "pose_delay": 0.004,
    "gyro_bias.x": 0.01,
    "gyro_bias.y": -0.02,
    "gyro_bias.z": 0.03,
    "offset.x": 0.1,
    "offset.y": 0.2,
    "offset.z": -0.3,
    **dict(zip(("place.x", "place.y", "place.z"), PLACE, strict=True)),
}
"""Numbers that are not those of the start vehicle and of what is usual around it."""

SETUPS = {
    "quadrotor": (QUAD, [], []),
    "torques": (ONE, [True], [False]),
    "servo": (SERVO, [False], [True]),
    "hats": (ONE, [False], [False]),
    "curve": (QUAD, [], []),
}
"""Vehicle, and of each joint whether its effort is logged and whether a servo moves
it."""


def biased(flight):
    """The flight with sensors that read too much by the true biases."""
    found = {}
    for name, number in (("gyro", "gyro_bias"), ("accelerometer", "offset")):
        more = np.array([TRUTH[f"{number}.{axis}"] for axis in "xyz"])
        found[name] = dataclasses.replace(
            flight[name], values=flight[name].values + more
        )
    return flight.with_channels(found)


@cache
def flight_of(vehicle):
    log = flown(vehicle, 0.8, ROTORS, JOINTS)
    return log, biased(
        measured(log, place=PLACE, late=TRUTH["pose_delay"], servo=bool(vehicle.drives))
    )


@cache
def errors_of(setup):
    """Errors of windows of a flight without noise, and numbers on the scale of the
    search at the truth.
    """
    vehicle, driven, servoed = SETUPS[setup]
    _, flight = flight_of(vehicle)
    windows = ClockedWindows(
        [on_clock(flight, vehicle, STEP, sections=[(0.0, 1.0)])], vehicle, 0.054, 3
    )
    options = {
        "curve": setup == "curve",
        "drag_height": setup == "curve",
        "voltage": setup == "curve",
    }
    unknowns = unknowns_of(
        vehicle, velocity=True, driven=driven, servoed=servoed, **options
    )
    names = ["gyro_bias.x", "gyro_bias.y", "gyro_bias.z", "pose_delay"]
    unknowns += [Unknown(name=each, unit="", start=0.0, spread=0.01) for each in names]
    begins = (
        (
            np.log(TRUTH[u.name])
            if u.positive and u.name in TRUTH
            else TRUTH.get(u.name, u.begin)
        )
        for u in unknowns
    )
    return WindowErrors(
        windows, vehicle, unknowns, {}, driven, servoed, GRAVITY
    ), np.array(list(begins))


def true_states(errors, vehicle):
    """States that the simulation had at the begins of the windows."""
    log, _ = flight_of(vehicle)
    at = errors.windows.begins
    parts = {
        name: log[name][at]
        for name in (
            "position",
            "quaternion",
            "velocity",
            "rate",
            "joints",
            "joint_rates",
        )
    }
    if errors.integrals:
        parts["integrals"] = integrals_of(log)[at][:, None]
    else:
        parts["integrals"] = np.zeros((len(at), 0))
    return WindowStates(
        parts, np.zeros((len(at), 6 + errors.hats * len(errors.unlogged)))
    )


def integrals_of(log):
    """Integral (rad s) of the servo's error at each row, of a goal that follows the
    late setpoints by its limit.
    """
    body, q, servo = ONE.links[0].body, log.joints[:, 0], SERVO.drives[0].drive
    goal = q[0] + body.mass * GRAVITY * -body.com.z * np.sin(q[0]) / servo.stiffness
    # late by two periods and a part of one; a setpoint acts from within a period on by
    # its share of it
    whole, rest = int(JOINTS // STEP), JOINTS % STEP
    setpoints = np.concatenate([np.full(whole + 1, goal), log.efforts[:, 0]])
    total, found = 0.0, []
    for k, angle in enumerate(q):
        found.append(total)
        mean = setpoints[k + 1] + (setpoints[k] - setpoints[k + 1]) * rest / STEP
        goal += min(
            max(mean - goal, -servo.speed_limit * STEP), servo.speed_limit * STEP
        )
        total += (goal - angle) * STEP
    return np.array(found)


@pytest.mark.parametrize("setup", ["quadrotor", "torques", "servo"])
def test_errors_are_nothing_at_the_truth(setup):
    """Of a flight without noise, with late poses, biases and an inertial unit that is
    off the base's origin.
    """
    errors, searched = errors_of(setup)
    errors.take_samples(searched)
    found, there = errors.errors_at(searched, true_states(errors, errors.start))
    assert there.all()
    worst = {
        name: max(
            float(np.abs(found[:, :, i]).max())
            for i, (n, _) in enumerate(errors.rows)
            if n == name
        )
        for name in errors.samples
    }
    # rotors' speeds at the begins are known to 3e-4 of a change
    bounds = {
        "gyro": 4e-5,
        "accelerometer": 2e-4,
        "position": 1e-7,
        "quaternion": 2e-6,
        "joint_positions": 1e-6,
    }
    assert all(worst[name] < bounds[name] for name in worst), worst


def by_central_differences(errors, searched, states, names):
    """Slopes of the errors (steps, W, rows, x) by the free numbers, and (steps, W,
    rows, names) by the numbers.
    """
    h, windows, moved = 1e-4, errors.windows, []
    for place in (errors.names.index(name) for name in names):
        change = np.zeros(len(searched))
        change[place] = (
            h if errors.unknowns[place].positive else h * errors.unknowns[place].spread
        )
        both = [
            errors.errors_at(searched + sign * change, states)[0]
            for sign in (1.0, -1.0)
        ]
        moved.append((both[0] - both[1]) / (2.0 * change[place]))
    # the same windows several times over, each moved in one direction
    x, begins, owners = len(errors.free), windows.begins, windows.owners
    sizes = np.array(
        [h * errors.push[i] if name == "wrench" else h for name, i in errors.free]
    )
    change = np.repeat(
        np.concatenate([np.diag(sizes), -np.diag(sizes)]), len(begins), axis=0
    )
    parts = {name: np.tile(rows, (2 * x, 1)) for name, rows in states.parts.items()}
    many = WindowStates(parts, np.tile(states.beside, (2 * x, 1))).moved_by(change)
    windows.begins, windows.owners, windows.count = (
        np.tile(begins, 2 * x),
        np.tile(owners, 2 * x),
        2 * x * len(begins),
    )
    found, _ = errors.errors_at(searched, many)
    windows.begins, windows.owners, windows.count = begins, owners, len(begins)
    found = found.reshape(len(found), 2, x, len(begins), -1)
    free = np.moveaxis(
        (found[:, 0] - found[:, 1]) / (2.0 * sizes[:, None, None]), 1, -1
    )
    return free, np.stack(moved, axis=-1) if moved else np.zeros((*free.shape[:-1], 0))


def displaced(errors):
    """States beside the first estimates, none of whose numbers is 0."""
    states, draw = errors.first_states(), np.random.default_rng(1)
    change = 0.01 * draw.normal(size=(errors.windows.count, len(errors.free)))
    change[:, errors.wrench] *= errors.push
    return states.moved_by(change)


SOME = (
    "rotors.time_constant_up",
    "links.link1.mass",
    "drives.joint1.integral",
    "drives.joint1.latency",
    "drives.joint1.speed_limit",
    "setpoint_hold",
    "delay",
    "drift",
    "accelerometer_delay",
    "pose_delay",
    "place.z",
    "offset.x",
    "torque.y",
    "gyro_bias.z",
)


@pytest.mark.parametrize(
    ("setup", "names", "memory"),
    [
        ("servo", SOME, None),
        ("torques", ("joint_delay", "links.link1.joint.damping"), 0.02),
        *(
            pytest.param(each, None, None, marks=pytest.mark.thorough)
            for each in SETUPS
        ),
    ],
    ids=lambda each: (
        each
        if isinstance(each, str)
        else f"{len(each)} numbers"
        if isinstance(each, tuple)
        else f"{each or 0} s"
    ),
)
def test_slopes_are_central_differences_of_the_errors(setup, names, memory):
    """Of one sensor after the other, whose rows the others' noise hides: products of
    slopes, and with errors.

    Of a force that is hardly there, as the drag of the body, rounding moves the slope
    by some hundredths.
    """
    errors, searched = errors_of(setup)
    errors.take_samples(searched)
    # setpoints that are held jump, and the speed limit alone moves the goal
    if "setpoint_hold" in errors.names:
        searched = np.where(np.array(errors.names) == "setpoint_hold", 2.3, searched)
    names = errors.names if names is None else names
    free, moved = by_central_differences(errors, searched, displaced(errors), names)
    places, states = [errors.names.index(name) for name in names], displaced(errors)
    found, there = errors.errors_at(searched, states)
    slopes = np.concatenate([free, moved, found[..., None]], axis=-1)
    hidden, shown = 1e12, 1e3  # the least is so great that nothing is an outlier
    sizes = [np.abs(slopes[:, :, i]).max(axis=(0, 1)) for i in range(len(errors.rows))]
    assert len(names) == len(errors.names) or np.max(sizes, axis=0).min() > 1e-12, (
        "every one of some shows"
    )
    if memory:  # each sample's less what it keeps of the one before
        memory = np.full((1, len(errors.rows)), memory)
        slopes = np.stack(
            [
                errors.innovations(each, there, memory)
                for each in np.moveaxis(slopes, -1, 0)
            ],
            axis=-1,
        )
        sizes = [
            np.abs(slopes[:, :, i]).max(axis=(0, 1)) for i in range(len(errors.rows))
        ]
        free = slopes[..., : free.shape[-1]]
    for sensor in errors.samples:
        rows = [i for i, (name, _) in enumerate(errors.rows) if name == sensor]
        noise = np.full((1, len(errors.rows)), hidden)
        noise[0, rows] = shown
        again, counted, normal = errors.normal(searched, states, noise, memory=memory)
        assert np.array_equal(again, found)
        assert np.array_equal(counted, there)
        wanted = np.einsum("twri,twrj->wij", slopes[:, :, rows], slopes[:, :, rows])
        x, width = free.shape[-1], slopes.shape[-1]
        columns = np.concatenate(
            [np.arange(x), x + np.array(places, dtype=int), [x + len(errors.names)]]
        )
        whole = (
            np.block(
                [
                    [normal.own, normal.mixed, normal.pull[..., None]],
                    [
                        normal.mixed.transpose(0, 2, 1),
                        normal.common,
                        normal.push[..., None],
                    ],
                    [
                        normal.pull[:, None],
                        normal.push[:, None],
                        np.ones((len(normal.own), 1, 1)),
                    ],
                ]
            )[:, columns[:, None], columns]
            * shown**2
        )
        whole[:, -1, -1] = wanted[:, -1, -1]
        rounding = 1e-6 if sensor == "accelerometer" else 1e-7
        size = (
            np.sqrt(np.einsum("wii->wi", wanted))
            + 1e-3 * np.max(sizes, axis=0)
            + rounding
        )
        off = np.abs(whole - wanted) / (size[:, :, None] * size[:, None, :])
        labels = [*errors.free, *names, "errors"]
        i, j = np.unravel_index(off.max(axis=0).argmax(), (width, width))
        assert off.max() < 0.1, (sensor, labels[i], labels[j], off.max())
        parts = np.einsum("twri,twrj->rwij", free[:, :, rows], free[:, :, rows])
        least = size[:, :x, None] * size[:, None, :x]
        assert (np.abs(normal.of_rows[rows] * shown**2 - parts) / least).max() < 0.1


def test_a_delay_shifts_errors_by_the_slope_of_the_reading_until_samples_count_it():
    """Linear and exact shift agree: a pose 0.3 ms later than the one by which samples
    were put on the clock.
    """
    errors, searched = errors_of("quadrotor")
    states, place = true_states(errors, QUAD), errors.names.index("pose_delay")
    rows = [
        i
        for i, (name, _) in enumerate(errors.rows)
        if name in ("position", "quaternion")
    ]
    late = searched.copy()
    late[place] += 3e-4
    by_truth, by_late = errors.over(errors.windows), errors.over(errors.windows)
    by_truth.take_samples(searched)
    by_late.take_samples(late)
    linear, exact = (
        each.errors_at(late, states)[0][2:-2] for each in (by_truth, by_late)
    )
    assert not np.array_equal(
        by_truth.samples["position"].share, by_late.samples["position"].share
    )
    moved = np.abs(exact[:, :, rows]).max()
    assert moved > 3e-4
    assert linear[:, :, rows] == pytest.approx(exact[:, :, rows], abs=0.05 * moved)
    others = [i for i in range(len(errors.rows)) if i not in rows]
    assert np.array_equal(linear[:, :, others], exact[:, :, others])


def test_samples_are_put_on_the_clock_anew_less_and_less_often():
    """Of delays in steps: by more than a tenth for each time that they were put there,
    of these windows only.
    """
    errors, searched = errors_of("quadrotor")
    place = errors.names.index("pose_delay")

    def taken(errors, steps):
        late, before = searched.copy(), errors.samples
        late[place] = steps * STEP
        errors.take_samples(late)
        at = errors.taken["position"] / STEP
        assert (errors.samples is before) == (at != pytest.approx(steps))
        return at

    errors = errors.over(errors.windows)
    delays = (0.0, 0.19, -0.19, 0.21, -0.08, 0.5, -0.1, 0.52, 0.13)
    wanted = (0.0, 0.0, 0.0, 0.21, 0.21, 0.21, -0.1, 0.52, 0.52)
    assert [taken(errors, each) for each in delays] == pytest.approx(list(wanted))
    assert taken(errors.over(errors.windows), 0.01) == pytest.approx(0.01)


def test_an_outlier_counts_by_its_size_only():
    """One sample of the gyroscope at 10 standard deviations pulls as one at 3 would, by
    Huber's weight of 3 / 10.
    """
    errors, searched = errors_of("quadrotor")
    errors.take_samples(searched)
    states, noise = true_states(errors, QUAD), np.full((1, len(errors.rows)), 0.01)
    plain, samples = errors.normal(searched, states, noise)[2], errors.samples
    step, window, column = 7, 1, errors.free.index(("rate", 1))
    at = errors.windows.begins[window] + step

    def with_error(size):
        values = samples["gyro"].values.copy()
        values[at, 1] += size * 0.01
        errors.samples = {
            **samples,
            "gyro": dataclasses.replace(samples["gyro"], values=values),
        }
        found, _, normal = errors.normal(searched, states, noise)
        errors.samples = samples
        assert found[step, window, 1] == pytest.approx(size * 0.01, abs=1e-4)
        return (
            normal.pull[window] - plain.pull[window],
            normal.own[window, column, column],
        )

    (small, whole), (bound, same), (great, less) = (
        with_error(each) for each in (1.0, OUTLIER, 10.0)
    )
    assert small[column] == pytest.approx(-1.0 / 0.01, rel=0.1)
    assert bound == pytest.approx(3.0 * small, rel=1e-2, abs=1e-2 * np.abs(small).max())
    assert great == pytest.approx(bound, rel=1e-2, abs=1e-2 * np.abs(small).max())
    assert whole == pytest.approx(same, rel=1e-3)
    # of its slope's square 7 of 10 parts are gone
    assert less - whole == pytest.approx(-0.7 / 0.01**2, rel=0.1)


def test_attitudes_turn_about_the_axes_of_the_base():
    """By small angles, as a product with the quaternion of the turn does, whose length
    stays.
    """
    quarter = np.sqrt(0.5)
    first = np.array([[quarter, 0.0, 0.0, quarter], [1.0, 0.0, 0.0, 0.0]])
    found = turn_attitudes(first, np.array([[2e-3, 0.0, 0.0], [0.0, 0.0, -4e-3]]))
    assert np.linalg.norm(found, axis=1) == pytest.approx(1.0, abs=1e-12)
    # heading along world y: the base's x is world y
    assert found[0] == pytest.approx(
        [quarter, quarter * 1e-3, quarter * 1e-3, quarter], abs=1e-6
    )
    assert found[1] == pytest.approx([1.0, 0.0, 0.0, -2e-3], abs=1e-5)
    states = WindowStates(
        {"rate": np.ones((2, 3)), "quaternion": first, "joints": np.ones((2, 1))},
        np.zeros((2, 2)),
    )
    moved = states.moved_by(np.arange(18.0).reshape(2, 9) * 1e-3)
    assert moved.parts["rate"][1] == pytest.approx([1.009, 1.010, 1.011])
    assert moved.parts["quaternion"] == pytest.approx(
        turn_attitudes(first, np.array([[3, 4, 5], [12, 13, 14]]) * 1e-3)
    )
    assert moved.parts["joints"][:, 0] == pytest.approx([1.006, 1.015])
    assert moved.beside == pytest.approx(np.array([[0.007, 0.008], [0.016, 0.017]]))


def test_errors_without_samples_do_not_count():
    errors, searched = errors_of("quadrotor")
    errors.take_samples(searched)
    states, samples = true_states(errors, QUAD), errors.samples
    begin = errors.windows.begins[2]
    there = samples["gyro"].there.copy()
    there[begin + 3] = False
    errors.samples = {
        **samples,
        "gyro": dataclasses.replace(samples["gyro"], there=there),
    }
    noise = np.ones((1, len(errors.rows)))
    _, counted, normal = errors.normal(searched, states, noise)
    errors.samples = samples
    _, every, whole = errors.normal(searched, states, noise)
    assert np.argwhere(every & ~counted).tolist() == [[3, 2, 0], [3, 2, 1], [3, 2, 2]]
    assert every.all()
    column = errors.free.index(("rate", 0))
    assert whole.own[2, column, column] - normal.own[
        2, column, column
    ] == pytest.approx(1.0, rel=0.1)
    assert whole.own[0] == pytest.approx(normal.own[0])


def test_a_reading_counts_by_its_noise():
    """A window's first position moves all of its readings as much: each gives one over
    the variance, and its error.
    """
    errors, searched = errors_of("quadrotor")
    errors.take_samples(searched)
    states, noise = displaced(errors), np.full((1, len(errors.rows)), 1e9)
    x = errors.free.index(("position", 0))
    row = errors.rows.index(("position", 0))
    noise[0, row] = 0.2
    found, there, normal = errors.normal(searched, states, noise)
    assert np.abs(found[:, :, row]).max() < 0.6  # no outlier
    counts = there[:, :, row].sum(axis=0)
    assert normal.own[:, x, x] == pytest.approx(counts / 0.04, rel=1e-9)
    assert normal.of_rows[row, :, x, x] == pytest.approx(counts / 0.04, rel=1e-9)
    assert normal.pull[:, x] == pytest.approx(
        -(found * there)[:, :, row].sum(axis=0) / 0.04, rel=1e-9, abs=1e-9
    )


def test_what_nothing_explains_is_thought_of_by_the_weight_at_the_rotors_distance():
    """Of rotors 0.17 m from the axis, whatever their height: a fortieth; of an effort
    that is not logged a quarter.
    """
    raised = tuple(
        dataclasses.replace(each, position=Vec3(*each.position[:2], 0.4))
        for each in QUAD.rotors
    )
    errors, _ = errors_of("hats")
    windows = errors.windows
    assert math.hypot(
        *(float(each) for each in QUAD.rotors[0].position[:2])
    ) == pytest.approx(0.17)
    for vehicle in (ONE, dataclasses.replace(ONE, rotors=raised)):
        found = WindowErrors(windows, vehicle, [], {}, [False], [False], GRAVITY)
        weight = GRAVITY * float(ONE.mass)
        assert found.push == pytest.approx(
            weight * np.array([1 / 15] * 3 + [0.17 / 40] * 3)
        )
        assert found.hats == 3, "of 54 ms one every 20 ms"
        hats = found.loose[[name == "hats" for name, _ in found.free]]
        assert hats == pytest.approx(np.full(found.hats, 0.25 * weight * 0.17))
    none = [
        found.loose[found.free.index((name, 0))]
        for name in ("position", "velocity", "rate", "joint_rates")
    ]
    assert min(none) >= 1.0, "nothing is known of a state before"


def test_windows_of_one_flight_have_its_noise():
    errors, searched = errors_of("quadrotor")
    errors.take_samples(searched)
    states, windows = true_states(errors, QUAD), errors.windows
    noise = np.stack([np.full(len(errors.rows), 0.01), np.full(len(errors.rows), 0.03)])
    begins = windows.begins
    _, _, plain = errors.normal(searched, states, noise[:1])
    windows.flights, windows.owners = windows.flights * 2, np.array([0, 1, 0])
    windows.firsts = np.array([0, *windows.firsts[1:], 2 * windows.firsts[1]])
    windows.begins, samples = begins + windows.firsts[windows.owners], errors.samples
    errors.samples = {
        name: SensorSamples(
            *(
                np.concatenate([part, part])
                for part in (each.values, each.share, each.there)
            )
        )
        for name, each in samples.items()
    }
    errors.averaged = np.array([1, 1])
    _, _, normal = errors.normal(searched, states, noise)
    errors.averaged = errors.averaged[:1]
    windows.flights, windows.owners, windows.begins = (
        windows.flights[:1],
        np.zeros(3, dtype=int),
        begins,
    )
    windows.firsts, errors.samples = windows.firsts[:2], samples
    assert normal.own[[0, 2]] == pytest.approx(plain.own[[0, 2]])
    assert 9.0 * normal.own[1] == pytest.approx(plain.own[1], rel=1e-6)


def test_an_accelerometer_that_is_read_seldom_averages_what_lies_between():
    """Every fourth sample alone: the mean of four steps, which is that of the velocity
    gained.
    """
    log, flight = flight_of(QUAD)
    force = flight["accelerometer"]
    sums = np.cumsum(force.values, axis=0)
    slow = Channel(
        time=force.time[4::4] - 1.5 * STEP,
        values=(sums[4::4] - sums[:-4:4]) / 4.0,
        source="every fourth",
    )
    clocked = on_clock(
        flight.with_channels({"accelerometer": slow}), QUAD, STEP, sections=[(0.0, 1.0)]
    )
    whole, searched = errors_of("quadrotor")
    windows = ClockedWindows([clocked], QUAD, 0.032, 3)
    errors = WindowErrors(windows, QUAD, whole.unknowns, {}, [], [], GRAVITY)
    errors.take_samples(searched)
    found, there = errors.errors_at(searched, true_states(errors, QUAD))
    rows = [i for i, (name, _) in enumerate(errors.rows) if name == "accelerometer"]
    last = found[4:, :, rows][there[4:, :, rows]]
    assert there[:, :, rows].sum() == 3 * 3 * 4
    assert np.abs(last).max() < 1e-2
    assert np.ptp(log.rate, axis=0).max() > 1.0


def test_a_mean_force_that_begins_before_its_window_does_not_count():
    """Read in the middle of its step, it is the mean of halves of two steps, of which
    the first is not flown.
    """
    whole, searched = errors_of("quadrotor")
    windows = whole.windows
    errors = WindowErrors(windows, QUAD, whole.unknowns, {}, [], [], GRAVITY)
    searched = searched.copy()
    searched[errors.names.index("accelerometer_delay")] = 0.5 * STEP
    rows = [i for i, (name, _) in enumerate(errors.rows) if name == "accelerometer"]
    errors.take_samples(searched)
    assert errors.samples["accelerometer"].share[windows.begins] == pytest.approx(0.5)
    _, there = errors.errors_at(searched, errors.first_states())
    assert not there[0][:, rows].any()
    assert there[1:][:, :, rows].all()


def test_searched_lags_are_those_of_a_vehicle_that_has_them():
    """In the windows and before them, where the speeds of the rotors begin."""
    errors, searched = errors_of("quadrotor")
    errors, states, slower = (
        copy.copy(errors),
        true_states(errors, QUAD),
        searched.copy(),
    )
    slower[errors.names.index("rotors.time_constant_up")] += np.log(1.5)
    longer = [
        dataclasses.replace(each, time_constant_up=1.5 * each.time_constant_up)
        for each in QUAD.rotors
    ]
    known = {
        name: value
        for name, value in errors.numbers(searched).items()
        if name not in QUAD_NUMBERS
    }
    fixed = WindowErrors(
        errors.windows,
        dataclasses.replace(QUAD, rotors=tuple(longer)),
        [],
        known,
        [],
        [],
        GRAVITY,
    )
    errors.take_samples(slower)
    fixed.take_samples(np.zeros(0))
    found, wanted = (
        errors.errors_at(slower, states)[0],
        fixed.errors_at(np.zeros(0), states)[0],
    )
    assert found == pytest.approx(wanted, abs=1e-9)
    assert np.abs(found - errors.errors_at(searched, states)[0]).max() > 0.1


@pytest.mark.parametrize("setup", ["servo", "torques"])
def test_the_plant_in_machine_code_sees_the_vehicle_s_numbers_alone(setup):
    """And where the inertial unit is: it is not made anew for flights of other names,
    sensors or delays.
    """
    errors, _ = errors_of(setup)
    of_vehicle = {
        each.name
        for each in errors.unknowns
        if each.in_vehicle and "_bias" not in each.name
    }
    around = {
        "pose_delay",
        "accelerometer_delay",
        "delay",
        "drift",
        "setpoint_hold",
        "joint_delay",
    }
    assert set(errors.replay.names) == of_vehicle - around | {
        "place.x",
        "place.y",
        "place.z",
    }
    assert not any(
        name.startswith(("torque.", "offset.", "gyro_bias.", "thrust."))
        for name in errors.replay.names
    )


def test_a_joint_s_torque_jumps_when_its_late_command_does():
    """Amid a step, at the instant of the log and not at its middle."""
    errors, searched = errors_of("torques")
    held, lanes = (
        errors.windows.commands("efforts", JOINTS),
        WindowLanes(errors, searched, errors.first_states()),
    )
    assert held.late[errors.windows.begins] == pytest.approx(JOINTS % STEP)
    for k in range(3):
        lanes.advance(k)
        at, inputs = errors.windows.begins + k, lanes.flights.inputs
        assert inputs["late"][1] == pytest.approx(held.late[at])
        assert inputs["setpoints_before"][0] == pytest.approx(held.before[at, 0])
        assert inputs["setpoints_after"][0] == pytest.approx(held.after[at, 0])
    lanes.close()


def test_rotors_begin_with_the_speeds_of_each_lane_s_own_delay_and_lags():
    """Of a millisecond more, and of a tenth more; other lanes begin with those of the
    estimate.
    """
    errors, searched = errors_of("quadrotor")
    windows, x = errors.windows, len(errors.free)
    moved = [
        ("delay", 1e-3),
        ("rotors.time_constant_up", math.log(1.1)),
        ("base.com.x", 1e-3),
    ]
    directions = [(x + errors.names.index(name), size) for name, size in moved]
    lanes = WindowLanes(errors, searched, errors.first_states(), directions)
    found = lanes.flights.state["rotor_speeds"].T.reshape(4, windows.count, 4).copy()
    lanes.close()
    slower = [
        dataclasses.replace(each, time_constant_up=1.1 * each.time_constant_up)
        for each in QUAD.rotors
    ]
    for speeds, rotors, delay in (
        (found[0], QUAD.rotors, ROTORS),
        (found[1], QUAD.rotors, ROTORS + 1e-3),
        (found[2], slower, ROTORS),
        (found[3], QUAD.rotors, ROTORS),
    ):
        wanted = windows.rotor_speeds([rotors], [windows.commands("speeds", delay)])[0]
        assert speeds == pytest.approx(wanted, rel=1e-12)
    assert np.abs(found[1:3] - found[0]).max(axis=(1, 2)).min() > 0.1


def lanes_of(*joints, hats=None):
    """Lanes of two windows of four steps without a plant, whose joints have commands;
    what they would simulate.
    """
    which, flat = (
        np.array([0]),
        Held(np.zeros((1, 8, 4)), np.zeros((1, 8, 4)), np.zeros((1, 8))),
    )
    inputs = {name: np.full((size, 2), np.nan) for name, size in INPUTS.items()}
    return SimpleNamespace(
        _windows=SimpleNamespace(
            before=lambda k: np.array([k, 4 + k]), step=STEP, length=4
        ),
        _errors=SimpleNamespace(
            given=None,
            unlogged=[] if hats is None else [1],
            hats=0 if hats is None else 3,
        ),
        _speeds=(flat, which),
        _thrust=(np.ones((1, 8)), which),
        _joints=[(i, each, which) for i, each in enumerate(joints)],
        _hats=hats,
        flights=SimpleNamespace(inputs=inputs, step=lambda: None),
    )


INPUTS = {
    "speeds_before": 4,
    "speeds_after": 4,
    "late": 2,
    "thrust": 1,
    "setpoints_before": 2,
    "setpoints_after": 2,
}


def held_by(late, seed):
    draw = np.random.default_rng(seed)
    return Held(
        draw.normal(size=(1, 8, 2)), draw.normal(size=(1, 8, 2)), np.full((1, 8), late)
    )


def test_joints_that_switch_together_do_so_at_their_time_and_others_in_mid_step():
    """Where each keeps its impulse: the plant has one switch for all joints."""
    late, at = 0.3 * STEP, np.array([2, 6])
    for other in (late, 0.8 * STEP):
        first, second = held_by(late, 1), held_by(other, 2)
        lanes = lanes_of(first, second)
        WindowLanes.advance(lanes, 2)
        inputs = lanes.flights.inputs
        same = other == late
        assert inputs["late"][1] == pytest.approx([late if same else 0.5 * STEP] * 2)
        for i, each in enumerate((first, second)):
            rows = each.before[0, at, i], each.after[0, at, i]
            share = each.late[0, 0] / STEP
            told = inputs["setpoints_before"][i], inputs["setpoints_after"][i]
            assert (np.array(told) == pytest.approx(np.array(rows))) == same
            now = 0.3 if same and i == 0 else 0.3 if same else 0.5
            mean = share * rows[0] + (1.0 - share) * rows[1]
            assert now * told[0] + (1.0 - now) * told[1] == pytest.approx(mean)


def test_an_effort_that_is_not_logged_is_straight_from_hat_to_hat():
    """Three hats over a window of four steps, read in the middle of each step."""
    heights = np.array([[[1.0, 3.0, -5.0]], [[0.0, 2.0, 2.0]]])
    lanes = lanes_of(held_by(0.0, 1), hats=heights)
    for k in range(4):
        WindowLanes.advance(lanes, k)
        wanted = [
            np.interp((k + 0.5) / 4.0, [0.0, 0.5, 1.0], rows[0]) for rows in heights
        ]
        for name in ("setpoints_before", "setpoints_after"):
            assert lanes.flights.inputs[name][1] == pytest.approx(wanted)
    # the other joint has its command
    assert lanes.flights.inputs["setpoints_before"][0] == pytest.approx(
        held_by(0.0, 1).before[0, [3, 7], 0]
    )


QUAD_NUMBERS = [
    each.name
    for each in unknowns_of(QUAD, curve=False, velocity=True, voltage=False, driven=[])
    if each.in_vehicle
]
"""Names of what the vehicle itself has."""
