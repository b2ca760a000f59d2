"""Identification from windows of flights that lack a sensor, or are flown by servos,
worn batteries or slow logs.
"""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.identify.identified_numbers import NOT_SHOWN
from skyarm.identify.identified_parts import vehicle_with
from skyarm.identify.identify_windows import (
    SearchOptions,
    WindowSearch,
    _without_lines,
    act_early,
    distinct_flights,
    explained_shares,
    first_fits,
    identify_by_windows,
    moved_joints,
    search_of,
    unknowns_of_sensors,
)
from skyarm.identify.logged_commands import are_samples, as_samples
from skyarm.identify.unknowns import second_moments, unknowns_of
from skyarm.identify.window_fit import WindowFit
from skyarm.identify.windows import SensorSamples
from skyarm.vehicle.thrust_table import ThrustTable
from support.flights import ONE, QUAD, flown, measured, on_servo

pytest.importorskip("scipy", reason="needs the extra 'identify'")

DELAY, PLACE = 0.0062, (0.03, -0.02, 0.05)
ROTOR, MOMENTS = QUAD.rotors[0], second_moments(QUAD.base)
PLANTED = {
    "rotors.thrust_coefficient": 1.1 * float(ROTOR.thrust_coefficient),
    "rotors.time_constant_up": 1.2 * float(ROTOR.time_constant_up),
    "rotors.drag_coefficient": 1.3 * float(ROTOR.drag_coefficient),
    "base.second_moment.x": 1.2 * MOMENTS[0],
    "base.second_moment.y": 0.85 * MOMENTS[1],
    "base.com.x": 0.004,
    "base.com.y": -0.003,
}
AROUND = {"delay": DELAY, "place.x": PLACE[0], "place.y": PLACE[1], "place.z": PLACE[2]}


def truth_of(name, vehicle, numbers):
    """True value of a reported number; None of one that the vehicle's records do not
    hold.
    """
    if name.startswith("base.inertia"):
        return float(getattr(vehicle.base.inertia, name[-2:]))
    if name.startswith("base.com"):
        return float(getattr(vehicle.base.com, name[-1]))
    if name.startswith(
        (
            "torque",
            "offset",
            "gyro_bias",
            "pose_delay",
            "drift",
            "drag.area",
            "accelerometer_delay",
        )
    ):
        return 0.0
    if name.startswith("rotors.") and hasattr(
        vehicle.rotors[0], name.partition(".")[2]
    ):
        return float(getattr(vehicle.rotors[0], name.partition(".")[2]))
    return numbers.get(name)


def check(found, vehicle, numbers, outside=0.12):
    """The search rests, and of the numbers that are shown all but a few lie within
    their intervals.
    """
    assert found.settled
    truths = {
        each.name: truth_of(each.name, vehicle, numbers) for each in found.numbers
    }
    known = [
        each
        for each in found.numbers
        if each.is_known and truths[each.name] is not None
    ]
    off = [
        each.name
        for each in known
        if not each.low - 1e-9 <= truths[each.name] <= each.high + 1e-9
    ]
    assert len(off) <= outside * len(known), off
    far = [
        each.name
        for each in known
        if abs(each.value - truths[each.name]) > 2.5 * (each.high - each.low)
    ]
    assert not far
    return {each.name: each for each in found.numbers}


def known_but(vehicle, searched, **numbers):
    """All numbers of a quadrotor as known, but for some."""
    every = unknowns_of(
        vehicle, curve=False, velocity=True, voltage=False, driven=[], servoed=[]
    )
    values = {each.name: each.start for each in every} | numbers
    # without a pose the drag of the body is not a number of the search
    return {
        name: value
        for name, value in values.items()
        if name not in searched and not name.startswith("drag.")
    }


def test_numbers_that_are_not_known_are_found_and_the_others_stay():
    """Of four seconds, without a pose: what is known is neither searched nor
    reported.
    """
    vehicle = vehicle_with(QUAD, PLANTED, checked=True)
    flight = measured(
        flown(vehicle, 4.0, DELAY),
        noise=1.0,
        place=PLACE,
        without=("position", "quaternion", "velocity"),
    )
    searched = ("rotors.thrust_coefficient", "base.com.x", "delay", "offset.z")
    known = known_but(QUAD, searched, **{**PLANTED, **AROUND})
    lines = []
    found = identify_by_windows(
        [flight], QUAD, SearchOptions(known=known), lines.append
    )
    numbers = check(found, vehicle, AROUND, outside=0.2)
    assert set(numbers) == {*searched, *(f"gyro_bias.{axis}" for axis in "xyz")}
    assert numbers["rotors.thrust_coefficient"].value == pytest.approx(
        PLANTED["rotors.thrust_coefficient"], rel=2e-3
    )
    assert numbers["delay"].value == pytest.approx(DELAY, abs=1e-4)
    assert (
        found.vehicle.rotors[0].thrust_coefficient
        == numbers["rotors.thrust_coefficient"].value
    )
    assert float(found.vehicle.base.inertia.xx) == pytest.approx(
        float(vehicle.base.inertia.xx), rel=1e-9
    )
    assert found.surroundings.delay == numbers["delay"].value
    assert found.surroundings.place == pytest.approx(PLACE)
    assert found.counted == (True,)
    assert 2.0 < found.seconds < 4.0
    assert found.period == pytest.approx(0.002)
    assert len(lines) > 8
    assert min(found.explained[f"rate.{axis}"] for axis in "xyz") > 0.95


@pytest.mark.thorough
@pytest.mark.parametrize("every", [10, 1])
def test_commands_that_act_before_they_come_are_samples_of_a_faster_loop_s(every):
    """Held at 50 Hz those of a loop of 500 Hz would act 9 ms too early."""
    vehicle, late = vehicle_with(QUAD, PLANTED, checked=True), 0.002
    flight = measured(
        flown(vehicle, 4.0, late),
        noise=1.0,
        without=("position", "quaternion", "velocity"),
    )
    speeds = flight["rotor_speed_commands"]
    seldom = dataclasses.replace(
        speeds, time=speeds.time[::every], values=speeds.values[::every]
    )
    known = known_but(
        QUAD, ("delay", "offset.z"), **{**PLANTED, **dict.fromkeys(AROUND, 0.0)}
    )
    known.pop("delay", None)
    found = identify_by_windows(
        [flight.with_channels({"rotor_speed_commands": seldom})],
        QUAD,
        SearchOptions(known=known),
    )
    assert found.sampled == (every > 1)
    # a curve through the begins of held commands is half of the loop's period early
    assert found["delay"].value == pytest.approx(late + 0.001 * (every > 1), abs=1e-3)


def test_a_search_begins_again_with_samples_where_held_commands_act_early(monkeypatch):
    of, begun = "skyarm.identify.identify_windows", []
    monkeypatch.setattr(
        f"{of}.search_of", lambda flights, *_: begun.append(flights) or len(begun)
    )
    monkeypatch.setattr(
        f"{of}.first_fits", lambda search, _: [None] * 2 if search == 1 else 1 / 0
    )
    monkeypatch.setattr(f"{of}.act_early", lambda *_: True)
    with pytest.raises(ZeroDivisionError):
        identify_by_windows([made_of()], QUAD)
    assert [are_samples(each) for (each,) in begun] == [False, True]


@pytest.mark.parametrize(
    ("delay", "early"),
    [
        (-0.0029, False),
        (-0.0031, True),
        (-0.0149, True),
        (-0.0151, False),
        (0.01, False),
    ],
)
def test_held_commands_are_samples_if_they_act_up_to_three_quarters_of_it_early(
    delay, early
):
    time = np.arange(0.0, 2.0, 0.02)
    speeds = 400.0 + np.sin(7.0 * time)[:, None] * np.ones(4)
    flight = FlightData(
        name="a",
        file="",
        channels={"rotor_speed_commands": Channel(time=time, values=speeds, source="")},
    )
    search = SimpleNamespace(
        unknowns=[SimpleNamespace(name="delay")], slow=False, start=QUAD
    )
    fit = SimpleNamespace(values=np.array([delay]))
    assert act_early(search, fit, [flight]) == early
    assert not act_early(search, fit, [flight, as_samples(flight)])
    assert not act_early(
        SimpleNamespace(unknowns=search.unknowns, slow=True, start=QUAD), fit, [flight]
    )
    assert not act_early(
        SimpleNamespace(unknowns=[], slow=False, start=QUAD), fit, [flight]
    )


def given_fit(search, values, curvature):
    """Errors of windows of a search, and a fit to them that leaves none; its numbers
    and their errors are given.
    """
    errors, blocks = search.errors(search.whole), 8
    shape = errors.windows.length, errors.windows.count, len(errors.rows)
    information = np.linalg.inv(curvature)
    fit = WindowFit(
        values=values,
        curvature=curvature,
        covariance=curvature,
        prior_information=np.zeros_like(curvature),
        block_information=np.stack([information / blocks] * blocks),
        stretch_information=information[None],
        stretch_scores=np.zeros((1, len(values))),
        noise=np.ones((1, len(errors.rows))),
        spread=errors.push,
        errors=np.zeros(shape),
        counted=np.ones(shape, dtype=bool),
        states=errors.first_states(),
        settled=True,
    )
    return errors, fit


@pytest.mark.parametrize("every", [1, 50])
def test_lags_that_commands_at_ten_hertz_do_not_show_go_back_to_their_starts(
    every, monkeypatch
):
    """The rest is fitted to these: its mean where they are as before; the dead time
    stands for all that is late.

    So does a bias about x that is hardly known, beside which that about y is.
    """
    module = "skyarm.identify.identify_windows"
    for name in ("WHOLE", "SLOW"):
        monkeypatch.setattr(f"{module}.{name}", 0.2)
    flight = measured(
        flown(QUAD, 2.0, DELAY), without=("position", "quaternion", "velocity")
    )
    speeds = flight["rotor_speed_commands"]
    slow = dataclasses.replace(
        speeds, time=speeds.time[::every], values=speeds.values[::every]
    )
    lags = ["rotors.time_constant_up", "rotors.time_constant_down"]
    names = [
        "rotors.thrust_coefficient",
        *lags,
        "delay",
        *(f"gyro_bias.{axis}" for axis in "xyz"),
    ]
    options = SearchOptions(known=known_but(QUAD, names))
    search = search_of(
        [flight.with_channels({"rotor_speed_commands": slow})], QUAD, options
    )
    assert search.slow == (every == 50)
    assert [each.name for each in search.unknowns] == names
    correlation = np.eye(7)
    correlation[0, 1] = correlation[1, 0] = 0.5
    correlation[2, 3] = correlation[3, 2] = -0.9
    correlation[4, 5] = correlation[5, 4] = 0.5
    sizes = np.array([0.01, 0.02, 0.03, 2e-4, 0.1, 1e-2, 1e-4])
    values = search.begin + np.array([0.1, 0.2, 0.3, 0.004, 0.02, 0.03, 0.0])
    made = given_fit(search, values, correlation * np.outer(sizes, sizes))
    monkeypatch.setattr(f"{module}.first_fits", lambda *_: made)
    begun = list[dict[str, object]]()
    monkeypatch.setattr(
        f"{module}.fit_windows", lambda *_, **given: (begun.append(given), made[1])[1]
    )
    found = identify_by_windows(
        [flight.with_channels({"rotor_speed_commands": slow})], QUAD, options
    )
    wanted = values - np.array([0.0, 0.0, 0.0, 0.0, 0.02, 0.5 * 1e-2 / 0.1 * 0.02, 0.0])
    if every == 50:
        wanted -= np.array(
            [0.5 * 0.01 / 0.02 * 0.2, 0.2, 0.3, -0.9 * 2e-4 / 0.03 * 0.3, 0.0, 0.0, 0.0]
        )
    for each, value, fitted in zip(
        search.unknowns, wanted.tolist(), values.tolist(), strict=True
    ):
        assert found.searched[each.name] == pytest.approx(each.value(value), rel=1e-9)
        assert found[each.name].value == pytest.approx(each.value(fitted), rel=1e-9)
        is_late = every == 50 and each.name in (*lags, "delay")
        assert found[each.name].reason.startswith(NOT_SHOWN) == (
            is_late or each.name == "gyro_bias.x"
        )
    rotor = found.vehicle.rotors[0]
    for lag in (*lags, names[0]):
        assert getattr(rotor, lag.partition(".")[2]) == pytest.approx(
            found.searched[lag]
        )
    # the last search goes on where the first ones ended
    assert [
        (each["noise"] is made[1].noise, each["spread"] is made[1].spread)
        for each in begun
    ] == [(True, True)]
    assert found.surroundings.delay == found.searched["delay"]
    windows = made[0].windows
    assert found.seconds == pytest.approx(windows.count * 0.2, abs=1e-9)


def test_of_two_numbers_that_look_alike_that_of_the_vehicle_stays(monkeypatch):
    """As it was: the other one takes what is off, and is told apart from it only. Both
    are known as little.
    """
    module = "skyarm.identify.identify_windows"
    monkeypatch.setattr(f"{module}.WHOLE", 0.2)
    flight = measured(
        flown(QUAD, 2.0, DELAY), without=("position", "quaternion", "velocity")
    )
    names = [
        "rotors.moment_coefficient",
        "torque.z",
        *(f"gyro_bias.{axis}" for axis in "xyz"),
    ]
    options = SearchOptions(known=known_but(QUAD, names))
    search = search_of([flight], QUAD, options)
    before = np.array([each.spread for each in search.unknowns])
    alike = np.eye(5)
    alike[0, 1] = alike[1, 0] = 0.999
    sizes = before * [0.9, 0.9, 0.01, 0.01, 0.01]
    values = search.begin + 0.3 * before
    made = given_fit(search, values, alike * np.outer(sizes, sizes))
    monkeypatch.setattr(f"{module}.first_fits", lambda *_: made)
    monkeypatch.setattr(f"{module}.fit_windows", lambda *_, **given: made[1])
    found = identify_by_windows([flight], QUAD, options)
    moment, torque = (found[name] for name in names[:2])
    assert moment.reason == NOT_SHOWN
    assert found.vehicle.rotors[0].moment_coefficient == pytest.approx(
        ROTOR.moment_coefficient, rel=1e-12
    )
    assert torque.reason == f"{NOT_SHOWN} apart from rotors.moment_coefficient"
    assert found.surroundings.torque[2] == pytest.approx(
        0.3 * before[1] * (1.0 - 0.999)
    )


def short(**more):
    """Two seconds of a quadrotor."""
    return measured(flown(QUAD, 2.0, DELAY), **more)


@pytest.mark.parametrize(
    ("flights", "options", "message"),
    [
        (lambda: [], {}, "^flights: must be one or more$"),
        (
            lambda: [short()],
            {"known": {"rotors.speed": 1.0}},
            r"^known\.rotors\.speed: did you mean .* must be one of mass, voltage, ",
        ),
        (lambda: [short()], {"known": {"delay": float("nan")}}, r"^known\.delay"),
        (
            lambda: [short()],
            {"known": {"rotors.thrust_coefficient": -1.0}},
            r"^known\.rotors\.thrust_coefficient",
        ),
        (
            lambda: [short()],
            {"sections": [(1.0, 1.05)]},
            "^flight: 0 of the 4 parts of ",
        ),
        (
            lambda: [short(without=("accelerometer",))],
            {},
            "^flight: accelerometer: is not in this flight",
        ),
    ],
    ids=[
        "no flight",
        "no such number",
        "no number",
        "not positive",
        "too short",
        "no accelerometer",
    ],
)
def test_what_cannot_be_identified_is_refused_in_one_line(flights, options, message):
    with pytest.raises(ValueError, match=message) as error:
        identify_by_windows(flights(), QUAD, SearchOptions(**options))
    assert "\n" not in str(error.value)


def test_a_line_is_taken_out_of_the_samples_of_each_window():
    draw = np.random.default_rng(0)
    there = (draw.random((30, 4)) < 0.7).astype(float)
    time = np.arange(30.0)[:, None]
    rows = there * draw.normal(size=(30, 4))
    found = _without_lines(rows + there * (3.0 - 0.2 * time * np.arange(4)), there)
    # of one sample, or of none, nothing is left
    alone = np.zeros((30, 3))
    alone[[0, 7], [1, 2]] = 1.0
    assert _without_lines(4.0 * alone, alone) == pytest.approx(
        np.zeros((30, 3)), abs=1e-12
    )
    for column, use, wanted in zip(rows.T, there.T > 0.0, found.T, strict=True):
        line = np.polyval(np.polyfit(time[use, 0], column[use], 1), time[use, 0])
        assert wanted[use] == pytest.approx(column[use] - line, abs=1e-9)
        assert (wanted[~use] == 0.0).all()


def test_what_is_explained_is_beyond_white_noise(monkeypatch):
    """Of a rate that swings by 1, white noise of 0.1 and errors of 0.3: all but 0.08 of
    what is no line.
    """
    monkeypatch.setattr(
        "skyarm.identify.identify_windows.first_noise", lambda _: np.full((1, 1), 0.1)
    )
    windows = SimpleNamespace(
        owners=np.zeros(2, int), begins=np.array([0, 40]), length=40
    )
    swing = np.where(np.arange(80) % 2, 1.0, -1.0)[:, None]
    samples = {"gyro": SensorSamples(swing, np.ones(80), np.ones(80, dtype=bool))}
    errors = SimpleNamespace(windows=windows, rows=[("gyro", 0)], samples=samples)
    fit = SimpleNamespace(
        counted=np.ones((40, 2, 1), dtype=bool), errors=np.full((40, 2, 1), 0.3)
    )
    explained, deviation = explained_shares(errors, fit)
    time = np.arange(40.0)
    bends = np.mean(
        (swing[:40, 0] - np.polyval(np.polyfit(time, swing[:40, 0], 1), time)) ** 2
    )
    assert explained == {"rate.x": pytest.approx(1.0 - 0.08 / (bends - 0.01))}
    assert deviation == {"rate.x": pytest.approx(0.3)}
    # errors that are larger than the motion: nothing; as small as the noise: all
    for size, share in (
        (1.5, 0.0),
        (1.0, 1.0 - 0.99 / (bends - 0.01) if bends > 1.0 else 0.0),
        (0.1, 1.0),
        (0.05, 1.0),
    ):
        fit.errors = np.full((40, 2, 1), size)
        assert explained_shares(errors, fit)[0] == {
            "rate.x": pytest.approx(share, abs=1e-12)
        }
    # a row that does not move is not told, but for what is left of it
    errors.samples = {
        "gyro": SensorSamples(0.05 * swing, np.ones(80), np.ones(80, dtype=bool))
    }
    assert explained_shares(errors, fit) == ({}, {"rate.x": pytest.approx(0.05)})


class HalvedErrors:
    """Errors of a method of second order: what its steps add to the second row falls
    with their number's square.
    """

    def __init__(self, substeps, size):
        self.replay, self.windows = (
            SimpleNamespace(substeps=substeps),
            SimpleNamespace(owners=np.array([0, 1, 1])),
        )
        self.size, self.samples, self.taken = (
            size,
            f"samples of {substeps}",
            f"delays of {substeps}",
        )

    def errors_at(self, values, states):
        """Half of the steps move; windows of the second flight ten times as far as
        those of the first.
        """
        assert states == f"states of {self.samples}"
        moved = np.zeros((4, 3, 2))
        moved[::2, :, 1] = (
            self.size / self.replay.substeps**2 * np.array([1.0, 10.0, 10.0])
        )
        return 0.3 + moved, np.ones_like(moved, dtype=bool)


def made_of(name="flight", rate=500.0, **channels):
    """Flight of ten samples of a gyroscope, and of what is given."""
    time = np.arange(10) / rate
    rows = {"gyro": np.zeros((10, 3)), **channels}
    return FlightData(
        name=name,
        file="none",
        channels={
            each: Channel(time=time[: len(v)], values=v, source=each)
            for each, v in rows.items()
        },
    )


def test_flights_of_one_name_are_numbered_and_what_hardly_was_measured_is_none():
    """Three samples are no channel; a position without an attitude tells nothing that
    can be flown.
    """
    three, four, pose = np.zeros((3, 1)), np.zeros((4, 1)), np.zeros((10, 3))
    level = np.tile([1.0, 0.0, 0.0, 0.0], (10, 1))
    given = [
        made_of("a", voltage=three, position=pose, velocity=pose),
        made_of("b", voltage=four, position=pose, velocity=pose, quaternion=level),
        made_of("a", quaternion=level[:3], position=pose),
    ]
    found = distinct_flights(given)
    assert [each.name for each in found] == ["a (1)", "b", "a (3)"]
    assert [set(each) for each in found] == [
        {"gyro"},
        {"gyro", "voltage", "position", "velocity", "quaternion"},
        {"gyro", "position"},
    ]
    assert [each.file for each in found] == ["none"] * 3
    for quantity in ("joint_efforts", "joint_commands"):
        arms = [made_of("x", **{quantity: pose[:, :1]}), made_of("y")]
        words = (
            f"^y: {quantity}: is not in this flight, and is in x: identify them apart$"
        )
        for order in (arms, arms[::-1]):
            with pytest.raises(ValueError, match=words):
                distinct_flights(order)
        assert len(distinct_flights([arms[0], arms[0]])) == 2


def test_joints_are_moved_by_logged_efforts_or_by_setpoints():
    """Of several flights by any; a column of zeros is none, and setpoints beside
    efforts are not of a servo.
    """
    arm, still = SimpleNamespace(n=4), np.zeros((10, 4))
    efforts, setpoints = still.copy(), still.copy()
    efforts[5, [0, 1]] = 0.1
    setpoints[2, [1, 2]] = -0.1
    flights = [
        made_of(joint_efforts=still, joint_commands=setpoints),
        made_of(joint_efforts=efforts),
    ]
    driven, servoed = moved_joints(flights, arm)
    assert driven == [True, True, False, False]
    assert servoed == [False, False, True, False]
    assert moved_joints([made_of()], arm) == ([False] * 4, [False] * 4)


def test_sensors_have_a_bias_and_poses_a_delay():
    names = ["gyro_bias.x", "gyro_bias.y", "gyro_bias.z"]
    level = np.tile([1.0, 0.0, 0.0, 0.0], (10, 1))
    assert [each.name for each in unknowns_of_sensors([made_of()])] == names
    found = unknowns_of_sensors([made_of(), made_of(quaternion=level)])
    assert [(each.name, each.unit) for each in found] == [
        *((name, "rad/s") for name in names),
        ("pose_delay", "s"),
    ]
    assert all(
        each.start == 0.0 and not each.in_vehicle and not each.positive
        for each in found
    )
    assert found[3].spread < found[0].spread < 0.1


@pytest.mark.parametrize(
    ("sample", "slow", "first", "whole"),
    [
        (0.002, False, 0.06, 0.25),
        (0.01, False, 0.12, 0.25),
        (0.04, False, 0.48, 0.48),
        (0.04, True, 0.48, 1.0),
    ],
)
def test_windows_are_long_enough_for_the_gyroscope_and_for_slow_commands(
    sample, slow, first, whole
):
    """Twelve samples at least; a second where commands were logged below 40 Hz, which
    hide three lags.
    """
    search = WindowSearch([], QUAD, [], [], {}, [], [], slow, sample, 9.81)
    assert (search.first, search.whole) == pytest.approx((first, whole))
    lags = {"delay", "rotors.time_constant_up", "rotors.time_constant_down"}
    assert search.hidden_lags() == (lags if slow else set())


def halved(monkeypatch, size, name="links.arm.joint.coulomb", least=1):
    """Integration steps of the result of the first fits, and those of all fits to
    windows of the whole length.
    """
    fits = []

    def fitted(errors, begin, *, noise=None, spread=None, lasting=False, progress=None):
        fits.append((errors.replay.substeps, begin))
        values, states = f"fit {len(fits)}", f"states of {errors.samples}"
        found = SimpleNamespace(
            values=values,
            states=states,
            noise=np.array([[1.0, 2.0], [10.0, 20.0]]),
            spread=None,
        )
        found.errors, _ = errors.errors_at(values, states)
        return found

    def errors(seconds, most, before=None, finer=1):
        assert before is None or finer == 1
        return HalvedErrors(max(least, finer), size)

    monkeypatch.setattr("skyarm.identify.identify_windows.fit_windows", fitted)
    unknowns = [SimpleNamespace(name="base.com.x"), SimpleNamespace(name=name)]
    search = SimpleNamespace(
        unknowns=unknowns,
        begin="start",
        slow=False,
        first=0.06,
        whole=0.25,
        errors=errors,
    )
    some, fit = first_fits(search)
    assert [begin for _, begin in fits] == [
        "start",
        *(f"fit {i}" for i in range(1, len(fits))),
    ]
    assert fit.values == f"fit {len(fits)}"
    # the samples are placed on the clock by the fit, not anew by each halving
    assert some.samples == f"samples of {least}"
    assert some.taken == f"delays of {least}"
    return some.replay.substeps, [substeps for substeps, _ in fits[1:]]


def test_integration_steps_are_halved_until_no_row_moves_by_a_twentieth_of_its_noise(
    monkeypatch,
):
    """A halving takes away three quarters of an error; in the root mean square here
    0.265 of it over the noise of 2.
    """
    once = 0.75 * 0.5**0.5 / 2.0
    for substeps, times in (
        (1, 0.0),
        (1, 0.99),
        (2, 1.01),
        (2, 3.99),
        (4, 4.01),
        (8, 63.9),
        (16, 64.1),
        (16, 1e9),
    ):
        found, fits = halved(monkeypatch, times * 0.05 / once)
        assert (found, fits[-1]) == (substeps, substeps)
        assert fits == [2**i for i in range(substeps.bit_length())]
    assert halved(monkeypatch, 1e9, least=4) == (16, [4, 8, 16])
    # without dry friction the steps are those that the vehicle needs
    assert halved(monkeypatch, 1e9, name="links.arm.joint.coulomb_rate") == (1, [1])


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("name", "without"),
    [
        ("position alone", ("velocity",)),
        ("velocity alone", ("position",)),
        ("attitude alone", ("position", "velocity")),
        ("no pose", ("position", "velocity", "quaternion")),
    ],
)
def test_a_quadrotor_is_found_without_some_of_its_pose(name, without):
    """The accelerometer shows the rotors' drag; that of the body needs a velocity, and
    is not searched without one.
    """
    vehicle = vehicle_with(QUAD, PLANTED, checked=True)
    found = identify_by_windows(
        [
            measured(
                flown(vehicle, 12.0, DELAY), noise=1.0, place=PLACE, without=without
            )
        ],
        QUAD,
    )
    numbers = check(found, vehicle, AROUND)
    assert numbers["rotors.thrust_coefficient"].value == pytest.approx(
        PLANTED["rotors.thrust_coefficient"], rel=2e-3
    )
    assert numbers["base.inertia.xx"].value == pytest.approx(
        float(vehicle.base.inertia.xx), rel=5e-3
    )
    assert numbers["rotors.drag_coefficient"].value == pytest.approx(
        PLANTED["rotors.drag_coefficient"], rel=0.03
    )
    assert ("drag.area.x" in numbers) is not {"position", "velocity"}.issubset(without)
    assert ("pose_delay" in numbers) is ("quaternion" not in without)


JOINT = {
    "links.link1.mass": 1.2 * float(ONE.links[0].body.mass),
    "links.link1.joint.damping": 0.013,
    "links.link1.joint.armature": 1.2e-3,
}


@pytest.mark.thorough
@pytest.mark.parametrize(
    "without",
    [("velocity",), ("velocity", "joint_efforts")],
    ids=["efforts", "no efforts"],
)
def test_an_arm_is_found_with_and_without_efforts(without):
    """Without efforts hats stand for them: no friction is searched, and the base is
    found all the same.
    """
    vehicle = vehicle_with(ONE, {**PLANTED, **JOINT}, checked=True)
    start = dataclasses.replace(
        ONE,
        base=dataclasses.replace(
            ONE.base, mass=ONE.base.mass + vehicle.mass - ONE.mass
        ),
    )
    log = flown(vehicle, 12.0, DELAY, 0.0047)
    found = identify_by_windows(
        [measured(log, noise=1.0, place=PLACE, without=without)], start
    )
    numbers = check(found, vehicle, {**AROUND, **JOINT, "joint_delay": 0.0047})
    assert numbers["base.inertia.xx"].value == pytest.approx(
        float(vehicle.base.inertia.xx), rel=0.01
    )
    assert numbers["rotors.thrust_coefficient"].value == pytest.approx(
        PLANTED["rotors.thrust_coefficient"], rel=3e-3
    )
    if "joint_efforts" in without:
        assert not any("joint" in name for name in numbers)
    else:
        assert numbers["links.link1.joint.damping"].value == pytest.approx(
            0.013, rel=0.05
        )
        assert numbers["joint_delay"].value == pytest.approx(0.0047, abs=2e-4)


@pytest.mark.thorough
def test_a_position_servo_is_found_by_the_engine_s_own_drive():
    truth = on_servo(stiffness=5.0, damping=0.24)
    found = identify_by_windows(
        [
            measured(
                flown(truth, 12.0, DELAY, 0.011),
                noise=1.0,
                without=("velocity",),
                servo=True,
            )
        ],
        on_servo(),
    )
    assert found.settled
    numbers = {each.name: each for each in found.numbers}
    for name, value in (
        ("stiffness", 5.0),
        ("damping", 0.24),
        ("latency", 0.011 - DELAY),
    ):
        each = numbers[f"drives.joint1.{name}"]
        assert each.is_known
        assert each.value == pytest.approx(
            value, rel=0.05 if name != "latency" else 0.25
        )
    assert found.vehicle.drives[0].drive.stiffness == pytest.approx(5.0, rel=0.05)


def without_hub_drag(vehicle):
    """A vehicle whose rotors' forces go with the square of their speeds."""
    changes = {"drag_coefficient": 0.0, "rolling_moment_coefficient": 0.0}
    return dataclasses.replace(
        vehicle,
        rotors=tuple(dataclasses.replace(each, **changes) for each in vehicle.rotors),
    )


def weakened(flight, share):
    """The flight as if its rotors had a share (N,) of their thrust, which their
    commands make up for.
    """
    speeds = flight["rotor_speed_commands"]
    more = Channel(
        time=speeds.time, values=speeds.values / np.sqrt(share)[:, None], source="more"
    )
    return flight.with_channels({"rotor_speed_commands": more})


PLAIN = without_hub_drag(vehicle_with(QUAD, PLANTED, checked=True))


@pytest.mark.thorough
def test_thrust_sags_with_the_voltage():
    flight = measured(
        flown(PLAIN, 12.0, DELAY, pace=0.6), noise=1.0, without=("velocity",)
    )
    time = flight["rotor_speed_commands"].time
    volts = 12.0 - 1.5 * time / 12.0
    worn = weakened(flight, (volts / 12.0) ** 1.6)
    worn = worn.with_channels(
        {"voltage": Channel(time=time, values=volts[:, None], source="volts")}
    )
    found = identify_by_windows(
        [worn], without_hub_drag(QUAD), SearchOptions(full_voltage=12.0)
    )
    numbers = check(
        found,
        PLAIN,
        {**AROUND, "sag": 1.6, "place.x": 0.0, "place.y": 0.0, "place.z": 0.0},
    )
    assert numbers["sag"].value == pytest.approx(1.6, abs=0.02)
    assert "drift" not in numbers


@pytest.mark.thorough
def test_each_of_several_flights_has_a_thrust_of_its_own():
    """Of two flights of one name the second has 0.9 of the first one's thrust."""
    flights = [
        measured(
            flown(PLAIN, 8.0, DELAY, pace=0.6), noise=1.0, seed=i, without=("velocity",)
        )
        for i in range(2)
    ]
    flights[1] = weakened(flights[1], np.full(len(flights[1]["gyro"].time), 0.9))
    found = identify_by_windows(flights, without_hub_drag(QUAD))
    beside = {f"place.{axis}": 0.0 for axis in "xyz"}
    numbers = check(found, PLAIN, {**AROUND, **beside, "thrust.flight (2)": 0.9})
    assert numbers["thrust.flight (2)"].value == pytest.approx(0.9, rel=2e-3)
    # a thrust of its own is no disagreement on that of the first
    assert found["rotors.thrust_coefficient"].widened < 2.0
    assert found.counted == (True, True)


@pytest.mark.thorough
def test_a_thrust_curve_of_its_own_is_found_where_the_flight_was():
    """Between a quarter and three quarters of the full signal, of a curve that bends
    otherwise than a square.
    """
    full = float(ROTOR.max_speed)
    speeds = tuple(share * full for share in (0.25, 0.5, 0.75, 1.0))
    square = [float(ROTOR.thrust_coefficient) * speed**2 for speed in speeds]
    curve = ThrustTable(
        speed=speeds,
        thrust=(1.1 * square[0], square[1], 0.95 * square[2], 0.9 * square[3]),
    )
    rotors = tuple(
        dataclasses.replace(
            each, table=curve, thrust_coefficient=curve.thrust_coefficient
        )
        for each in without_hub_drag(QUAD).rotors
    )
    vehicle = dataclasses.replace(QUAD, rotors=rotors)
    flight = measured(flown(vehicle, 12.0, DELAY), noise=1.0, without=("velocity",))
    found = identify_by_windows(
        [flight], without_hub_drag(QUAD), SearchOptions(curve=True)
    )
    assert found.settled
    numbers = {each.name: each for each in found.numbers}
    for share, thrust in zip((50, 75), curve.thrust[1:3], strict=True):
        each = numbers[f"rotors.thrust_at_{share}_percent"]
        assert each.is_known
        assert each.value == pytest.approx(thrust, rel=0.02)
    assert found.vehicle.rotors[0].table is not None


@pytest.mark.thorough
def test_commands_at_ten_hertz_do_not_show_lags():
    """They go back to the start; the dead time stands for all that is late."""
    vehicle = vehicle_with(QUAD, PLANTED, checked=True)
    flight = measured(
        flown(vehicle, 20.0, DELAY, pace=0.3), noise=1.0, without=("velocity",)
    )
    speeds = flight["rotor_speed_commands"]
    slow = Channel(time=speeds.time[::50], values=speeds.values[::50], source="slow")
    found = identify_by_windows(
        [flight.with_channels({"rotor_speed_commands": slow})], QUAD
    )
    numbers = {each.name: each for each in found.numbers}
    for way in ("up", "down"):
        each = numbers[f"rotors.time_constant_{way}"]
        assert each.reason.startswith(NOT_SHOWN)
        assert float(
            getattr(found.vehicle.rotors[0], f"time_constant_{way}")
        ) == pytest.approx(each.start)
    assert numbers["delay"].reason.startswith(NOT_SHOWN)
    assert numbers["rotors.thrust_coefficient"].value == pytest.approx(
        PLANTED["rotors.thrust_coefficient"], rel=0.05
    )
