"""Excitation design: segments from rest to rest, the flight that they need, limits, and
the choice of segments.
"""

from __future__ import annotations

import dataclasses
import math
import tomllib
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

import skyarm
from skyarm.algebra.frames import turn_vectors
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.identify.design import (
    DesignLimits,
    design_segments,
    fitted_segment,
    information_of,
    measured_noise,
    volume_gain,
)
from skyarm.identify.designed_flight import (
    broken_axes,
    design_flight,
    scenario_document,
)
from skyarm.identify.identify_windows import SearchOptions, first_fits, search_of
from skyarm.identify.multisines import (
    axes_of,
    draw_segment,
    mutate_segment,
    reference_table,
)
from skyarm.identify.required_flight import arm_clearance, required_flight
from skyarm.identify.unknowns import unknowns_of
from skyarm.identify.window_fit import fit_windows
from skyarm.reference.reference_tables import trajectory_from
from skyarm.scenario.save import scenario_text
from skyarm.scenario.scenario_file import scenario_from
from support.flights import QUAD, flown, measured

VEHICLE = skyarm.load_vehicle("hummingbird_arm2_rotors")
GRAVITY, PERIOD, LENGTH = 9.81, 0.01, 10.0
TIMES = PERIOD * np.arange(1001)
AXES = axes_of(VEHICLE, 1.5, 3.0)


def still(**accelerations):
    """Motion in the rest posture, with sines of the base in some axes: name ->
    (amplitude, rad/s).
    """
    motion = np.zeros((3, 6, len(TIMES)))
    for name, (size, rate) in accelerations.items():
        axis = ("x", "y", "z", "yaw", "first", "second").index(name)
        wave = np.sin(rate * TIMES)
        motion[:, axis] = (
            size * wave,
            size * rate * np.cos(rate * TIMES),
            -size * rate**2 * wave,
        )
    return motion


def test_hover_needs_the_weight_and_no_torque():
    flight = required_flight(VEHICLE, still(), PERIOD)
    thrust = sum(
        r.thrust_coefficient * w**2
        for r, w in zip(VEHICLE.rotors, flight.speeds[0], strict=True)
    )
    assert thrust == pytest.approx(GRAVITY * VEHICLE.mass, rel=1e-9)
    assert np.abs(flight.efforts).max() < 1e-12
    assert flight.tilt.max() == 0.0


def test_thrust_tilts_towards_the_acceleration():
    """By atan(a / g) against a slow sine, whose window and arm matter little; to +x the
    base pitches forward.
    """
    flight = required_flight(VEHICLE, still(x=(2.0, 1.0)), PERIOD)
    wanted = np.arctan2(-2.0 * np.sin(TIMES), GRAVITY)
    found = np.arctan2(flight.turned[:, 0, 2], flight.turned[:, 2, 2])
    middle = slice(100, -100)
    assert np.abs(found - wanted)[middle].max() < 0.004
    assert (
        np.abs(flight.rate[middle, 1] - np.gradient(wanted, PERIOD)[middle]).max()
        < 0.01
    )


def test_a_fall_with_gravity_needs_no_thrust():
    motion = still()
    motion[2, 2] = -GRAVITY * (1.0 - 1e-6)
    assert required_flight(VEHICLE, motion, PERIOD).speeds.max() < 1.0


def test_segments_rest_at_their_ends_and_stay_in_their_ranges():
    draw = np.random.default_rng(3)
    segment = draw_segment(AXES, LENGTH, draw)
    for each in (segment, mutate_segment(segment, AXES, draw)):
        motion = each.motion(TIMES)
        assert np.abs(motion[:, :, [0, -1]]).max() < 1e-9
        value = motion[0] + AXES.rest[:, None]
        assert (value >= AXES.low[:, None] - 1e-3).all()
        assert (value <= AXES.high[:, None] + 1e-3).all()
        assert np.ptp(value, axis=1).min() > 0.0


def test_of_segments_near_segments_none_leaves_the_ranges_and_each_is_a_motion():
    """Offsets of joints grow from one to the next until the joint rests at an end of
    its range.
    """
    draw, rested = np.random.default_rng(3), 0
    for _ in range(4):
        segment = draw_segment(AXES, LENGTH, draw)
        for _ in range(10):
            segment = mutate_segment(segment, AXES, draw)
            value = segment.motion(TIMES[::20])[0] + AXES.rest[:, None]
            assert (value >= AXES.low[:, None] - 1e-3).all()
            assert (value <= AXES.high[:, None] + 1e-3).all()
            rested += int((np.abs(segment.amplitudes[4:]).max(axis=1) == 0.0).sum())
    assert rested > 0


def test_a_range_is_that_of_box_and_joint_about_its_rest():
    """Joints of the vehicle: within 1.2 rad of the rest, and by a twentieth of their
    range inside of their limits.
    """
    limits = [(-math.inf, math.inf), (-0.4, 0.8)]
    links = [
        dataclasses.replace(
            each, joint=dataclasses.replace(each.joint, lower=low, upper=high)
        )
        for each, (low, high) in zip(VEHICLE.links, limits, strict=True)
    ]
    axes = axes_of(dataclasses.replace(VEHICLE, links=tuple(links)), 1.5, 3.0)
    assert axes.rest[:4].tolist() == [0.0, 0.0, 3.0, 0.0]
    assert (axes.high - axes.low)[:4] == pytest.approx([1.5, 1.5, 1.5, 2.4])
    assert (axes.high + axes.low)[:4] == pytest.approx([0.0, 0.0, 6.0, 0.0])
    assert (axes.low[4], axes.high[4]) == pytest.approx(
        (axes.rest[4] - 1.2, axes.rest[4] + 1.2)
    )
    assert (axes.low[5], axes.high[5]) == pytest.approx((-0.4 + 0.06, 0.8 - 0.06))
    assert -0.34 < axes.rest[5] < 0.74
    assert axes.fastest.tolist() == [1.2] * 4 + [2.5] * 2


def test_amplitudes_fall_with_a_drawn_power_of_the_frequency_between_none_and_two():
    """All of them are drawn: equal amplitudes, equal accelerations and what lies
    between.
    """
    draw, times = np.random.default_rng(8), np.linspace(0.0, LENGTH, 21)
    segments = [draw_segment(AXES, LENGTH, draw) for _ in range(30)]
    logs = [(np.log(each.frequencies), np.log(each.amplitudes)) for each in segments]
    powers = np.concatenate(
        [(a[:, 0] - a[:, -1]) / (f[:, -1] - f[:, 0]) for f, a in logs]
    )
    assert (powers >= 0.0).all()
    assert (powers <= 2.0).all()
    assert np.quantile(powers, [0.1, 0.5, 0.9]) == pytest.approx(
        [0.2, 1.0, 1.8], abs=0.25
    )
    # on every axis four sines, each in a quarter of its own on the logarithm's scale,
    # from 0.15 Hz on
    assert all((np.diff(f, axis=1) > 0.0).all() for f, _ in logs)
    lowest, highest = (
        np.stack([each.frequencies[:, i] for each in segments]) for i in (0, -1)
    )
    assert lowest.min() == pytest.approx(0.15, rel=0.2)
    assert lowest.min() >= 0.15
    assert highest.max(axis=0) == pytest.approx(AXES.fastest, rel=0.25)
    assert (highest <= AXES.fastest).all()
    factors = np.array([0.5, 1.0, 2.0, 0.0, 0.3, 0.7])
    segments[0] = dataclasses.replace(
        segments[0], offsets=np.array([0.1, -0.2, 0.3, 0.4, -0.5, 0.6])
    )
    scaled = segments[0].scale(factors).motion(times)
    # of 5 digits
    assert scaled[0] == pytest.approx(
        factors[:, None] * segments[0].motion(times)[0], abs=1e-4
    )


def test_the_reference_is_that_of_the_segments():
    """Read back from its table, each segment at its own time."""
    draw = np.random.default_rng(4)
    segments = [draw_segment(AXES, LENGTH, draw) for _ in range(2)]
    path = trajectory_from(reference_table(segments, AXES), VEHICLE.n, "reference")
    for t in (0.0, 4.321, 13.7, 19.999):
        at = segments[int(t // LENGTH)].motion(np.array([t % LENGTH]))[:, :, 0]
        found = path.at(t)
        assert tuple(found.position) == pytest.approx(
            tuple(at[0, :3] + AXES.rest[:3]), abs=1e-9
        )
        assert tuple(found.velocity) == pytest.approx(tuple(at[1, :3]), abs=1e-9)
        assert (found.yaw, found.yaw_rate) == pytest.approx(
            (at[0, 3], at[1, 3]), abs=1e-9
        )
        assert tuple(found.joints) == pytest.approx(
            tuple(at[0, 4:] + AXES.rest[4:]), abs=1e-9
        )
        assert tuple(found.joint_rates) == pytest.approx(tuple(at[1, 4:]), abs=1e-9)


def test_a_segment_is_shrunk_into_the_limits_and_no_further():
    limits = DesignLimits()
    draw = np.random.default_rng(5)
    for _ in range(3):
        segment = draw_segment(AXES, LENGTH, draw)
        found, flight = fitted_segment(VEHICLE, segment, AXES, limits, PERIOD)
        assert flight.tilt.max() <= limits.tilt
        assert flight.speeds.max() < 0.8 * VEHICLE.rotors[0].max_speed + 1e-9
        assert arm_clearance(VEHICLE, flight.joints)[0].min() >= limits.clear
        assert limits.broken_by(
            VEHICLE, required_flight(VEHICLE, motion_of(segment), PERIOD)
        ).any()
        assert (np.abs(found.amplitudes) <= np.abs(segment.amplitudes) + 1e-12).all()
    narrow = dataclasses.replace(limits, tilt=math.radians(12.0))
    flat, _ = fitted_segment(VEHICLE, segment, AXES, narrow, PERIOD)
    assert np.abs(flat.amplitudes[0]).max() < np.abs(found.amplitudes[0]).max()


def test_a_designed_flight_beyond_a_limit_says_which_axes_are_to_shrink():
    limits, flight = DesignLimits(), required_flight(VEHICLE, still(), PERIOD)

    def broken(**arrays):
        return limits.broken_by(VEHICLE, dataclasses.replace(flight, **arrays)).tolist()

    assert broken() == [0.0] * 6
    efforts, most = np.zeros((len(TIMES), 2)), VEHICLE.links[1].joint.effort_limit
    efforts[500, 1] = -0.599 * most
    assert broken(efforts=efforts) == [0.0] * 6
    efforts[500, 1] = -0.601 * most
    assert broken(efforts=efforts) == [0.0] * 5 + [1.0]
    for angle, wanted in ((21.2, 0.0), (21.3, 1.0)):  # 0.85 of 25 degrees
        tilted = flight.turned.copy()
        tilted[300, 2, 2] = math.cos(math.radians(angle))
        assert broken(turned=tilted) == [wanted] * 2 + [0.0] * 4
    folded = flight.joints.copy()
    folded[700] = [0.0, math.pi]  # the tip in the base
    assert broken(joints=folded) == [0.0] * 4 + [1.0, 1.0]
    # all rotors too fast: by thrust, and not by the heading
    assert broken(
        speeds=np.full_like(flight.speeds, 0.81 * VEHICLE.rotors[0].max_speed),
        shares=lifting(flight),
    ) == [
        *[1.0] * 3,
        *[0.0] * 3,
    ]


def lifting(flight):
    """Shares of a flight that lifts half of it more at one instant."""
    shares = flight.shares.copy()
    shares[0, 400] *= 1.5
    return shares


def test_segments_are_those_that_leave_the_least_volume(monkeypatch):
    """Of one segment the best of all candidates; of two none of which a later one
    serves better, nor a first one.
    """
    tried, told = [], []

    def information(segment):
        rows = segment.phases[:3]
        return rows.T @ rows

    def fitted(vehicle, segment, axes, limits, period):
        tried.append(segment)
        flight = SimpleNamespace(flight_data=lambda vehicle, like: segment)
        return None if segment.phases[0, 0] > 2.5 else (segment, flight)

    def volume(*segments):
        whole = sum(map(information, segments)) + np.eye(4)
        return np.linalg.slogdet(whole)[1] - np.linalg.slogdet(whole[3:, 3:])[1]

    module = "skyarm.identify.design"
    monkeypatch.setattr(f"{module}.fitted_segment", fitted)
    monkeypatch.setattr(
        f"{module}.information_of", lambda flight, measured: information(flight)
    )
    measured = SimpleNamespace(
        flight=None, prior=np.ones(4), in_vehicle=np.array([True, True, True, False])
    )
    for count in (1, 2):
        tried.clear()
        told.clear()
        limits = DesignLimits(seconds=11.0 * count)
        found = design_segments(
            VEHICLE,
            measured,
            AXES,
            limits,
            candidates=30,
            seed=3,
            progress=lambda done, words: told.append(done),
        )
        assert len(tried) == 30
        assert told == [*range(30)]
        assert len(found) == count
        assert {each.duration for each in tried} == {11.0}
        kept = [each for each in tried if each.phases[0, 0] <= 2.5]
        if count == 1:
            assert volume(*found) == max(map(volume, kept))
        else:
            first = max(kept[:10], key=volume)
            assert volume(*found) >= max(
                volume(first, each) for each in tried[:10] if each in kept
            )
            later = kept[
                max(
                    next(i for i, one in enumerate(kept) if one is each)
                    for each in found
                ) :
            ]
            assert volume(*found) >= max(
                volume(one, each) for one in found for each in later
            )
            # Fedorov's exchange, of the same candidates in turn
            taken = [
                first,
                max(
                    kept,
                    key=lambda each: (
                        -math.inf if each not in tried[:10] else volume(first, each)
                    ),
                ),
            ]
            for each in (each for each in tried[10:] if each in kept):
                taken = max(
                    (taken, [each, taken[1]], [taken[0], each]),
                    key=lambda two: volume(*two),
                )
            assert [id(each) for each in found] == [id(each) for each in taken]
    monkeypatch.setattr(f"{module}.fitted_segment", lambda *_: None)
    with pytest.raises(
        ValueError,
        match=(
            r"^box = 1\.5 m, tilt = 25 deg, clear = 0\.1 m: vehicle '.*widen one of"
            r" them$"
        ),
    ):
        design_segments(VEHICLE, measured, AXES, DesignLimits(), candidates=3)


def motion_of(segment):
    motion = segment.motion(TIMES)
    motion[0] += AXES.rest[:, None]
    return motion


def test_the_arm_is_clear_by_its_nearest_point():
    """Hanging: the elbow 0.15 m below the base; folded up: the tip in the base; ahead:
    the elbow in a rotor's disc.
    """
    distance, height = arm_clearance(
        VEHICLE, np.array([[0.0, 0.0], [0.0, math.pi], [-0.5 * math.pi, 0.0]])
    )
    assert distance == pytest.approx([0.15, 0.0, 0.01], abs=1e-9)
    assert height == pytest.approx([-0.3, -0.15, 0.0], abs=1e-9)


def test_the_gain_is_that_of_the_marginal_covariance():
    """Of some numbers beside others, by the inverse of the whole information."""
    rows = np.random.default_rng(6).normal(size=(30, 5))
    prior, inside = (
        np.array([1.0, 2.0, 0.5, 3.0, 1.0]),
        np.array([True, True, False, True, False]),
    )
    before = np.diag(prior**2)[np.ix_(inside, inside)]
    after = np.linalg.inv(rows.T @ rows + np.diag(prior**-2.0))[np.ix_(inside, inside)]
    wanted = np.linalg.slogdet(before)[1] - np.linalg.slogdet(after)[1]
    assert volume_gain(rows.T @ rows, prior, inside) == pytest.approx(wanted)


def test_the_scenario_that_is_written_is_the_one_that_was_flown():
    segments = [draw_segment(AXES, LENGTH, np.random.default_rng(7))]
    document = scenario_document(
        VEHICLE, "hummingbird_arm2_rotors", segments, AXES, LENGTH, 1
    )
    text = scenario_text(document)
    assert tomllib.loads(text) == document
    assert "\n[reference.base]\n" in text, "axes stand below each other"
    assert document["seed"] == 1
    flown = scenario_from(document)
    assert {each.name for each in flown.sensors} == {"imu", "encoders"}
    assert (
        flown.reference.at(4.2).position
        == trajectory_from(document["reference"], 2, "reference").at(4.2).position
    )
    assert flown.duration == LENGTH


def flown_log(**arrays):
    """Flight in hover at the axes' rest, with other columns."""
    size = 5
    rows = {
        "position": np.tile(AXES.rest[:3], (size, 1)),
        "quaternion": np.tile([1.0, 0.0, 0.0, 0.0], (size, 1)),
        "joints": np.zeros((size, 2)),
        "rotor_commands": np.full((size, 4), 500.0),
    }
    return SimpleNamespace(info={"status": "completed"}, **rows | arrays)


def test_a_flight_beyond_a_limit_is_found_with_the_axes_at_fault():
    def broken(**arrays):
        return broken_axes(flown_log(**arrays), VEHICLE, AXES, DesignLimits()).tolist()

    assert not any(broken())
    assert broken(position=AXES.rest[:3] + np.array([[0.0, 0.76, 0.0]])) == [
        False,
        True,
        *[False] * 4,
    ]
    assert broken(position=AXES.rest[:3] - np.array([[0.74, 0.0, 0.76]])) == [
        False,
        False,
        True,
        *[False] * 3,
    ]
    # at one instant, to either side
    for angle, found in ((24.9, False), (25.1, True)):
        half = 0.5 * math.radians(angle)
        for side in ((math.sin(half), 0.0), (0.0, -math.sin(half))):
            leaning = flown_log().quaternion
            leaning[3] = math.cos(half), *side, 0.0
            assert broken(quaternion=leaning) == [found, found, *[False] * 4]
    turned = np.tile([math.cos(0.5), 0.0, 0.0, math.sin(0.5)], (5, 1))
    assert not any(broken(quaternion=turned)), "a heading is no tilt"
    assert broken(joints=np.array([[0.0, math.pi]])) == [*[False] * 4, True, True]
    limited = [
        dataclasses.replace(
            each, joint=dataclasses.replace(each.joint, lower=-0.5, upper=0.4)
        )
        for each in VEHICLE.links
    ]
    vehicle = dataclasses.replace(VEHICLE, links=tuple(limited))
    for angles in ((0.41, 0.0), (0.0, 0.41), (-0.51, 0.0), (0.0, -0.51), (0.39, -0.49)):
        joints = np.zeros((5, 2))
        joints[2] = angles
        wanted = [not -0.5 <= each <= 0.4 for each in angles]
        assert broken_axes(
            flown_log(joints=joints), vehicle, AXES, DesignLimits()
        ).tolist() == [*[False] * 4, *wanted]
    # at one of 500 instants a rotor may be at its limit
    commands = np.full((500, 4), 500.0)
    commands[:4, 0] = 838.0
    assert not any(broken(rotor_commands=commands))
    commands[4, 0] = 838.0
    assert all(broken(rotor_commands=commands))
    assert all(broken(rotor_commands=np.full((5, 4), 838.0)))


def test_a_required_flight_is_read_as_another_one_was():
    """Channels of the other one alone, at its rates; commands come before the motion by
    dead time and lag.
    """
    flight = required_flight(VEHICLE, still(x=(2.0, 3.0)), PERIOD)
    time = np.arange(0.0, 5.0, 0.004)
    like = FlightData(
        name="like",
        file="like",
        channels={
            "gyro": Channel(time=time, values=np.zeros((len(time), 3)), source=""),
            "quaternion": Channel(
                time=time[::5], values=np.zeros((len(time[::5]), 4)), source=""
            ),
            "rotor_speed_commands": Channel(
                time=time, values=np.zeros((len(time), 4)), source=""
            ),
        },
    )
    found = flight.flight_data(VEHICLE, like)
    assert set(found.channels) == set(like.channels)
    assert found["gyro"].rate == pytest.approx(250.0)
    assert found["quaternion"].rate == pytest.approx(50.0)
    k = 1000
    assert found["gyro"].values[k] == pytest.approx(flight.rate[400], abs=1e-9)
    turned = turn_vectors(
        found["quaternion"].values[200:201], np.array([[0.3, -0.2, 0.9]])
    )[0]
    assert turned == pytest.approx(flight.turned[400] @ [0.3, -0.2, 0.9], abs=1e-9)
    speeds, change = flight.speeds[:, 0], np.gradient(flight.speeds[:, 0], PERIOD)
    lag = np.where(
        change > 0.0,
        VEHICLE.rotors[0].time_constant_up,
        VEHICLE.rotors[0].time_constant_down,
    )
    ahead = np.interp(4.0 + 0.005, TIMES, speeds + lag * change)
    assert found["rotor_speed_commands"].values[k, 0] == pytest.approx(ahead)


def test_a_flight_is_flown_with_less_until_it_stays_in_the_limits(monkeypatch):
    """The first flight breaks limits of y and the second joint, whose swings shrink;
    what is told is of the last one.

    Each number's half width is 2 in the undesigned flight and 1 in the designed one.
    """
    segments, tried, told = (
        [draw_segment(AXES, LENGTH, np.random.default_rng(9)) for _ in range(2)],
        [],
        [],
    )
    extents = np.diag([3.0, 2.0, 1.0])[[0, 0, 1, 2, 2]]
    plain, flights = (
        flown_log(),
        [flown_log(position=AXES.rest[:3] + extents * k) for k in (3, 1)],
    )
    flights[1].quaternion[2] = [math.cos(0.1), 0.0, math.sin(0.1), 0.0]
    flights[1].rotor_commands[:2] = 838.0
    flights[1].joints[4] = [0.0, math.pi]  # the tip in the base
    still_broken = False

    def fly(scenario):
        tried.append(scenario)
        return plain if len(tried) == 1 else flights[min(len(tried) - 2, 1)]

    def broken(log, vehicle, axes, limits):
        found = np.zeros(6, dtype=bool)
        found[[1, 5]] = log is flights[0] or still_broken
        return found

    def designed(vehicle, measured, axes, limits, *, candidates, seed, progress):
        assert measured == ("noise of", plain)
        assert axes.rest[2] == pytest.approx(height)
        progress(candidates - 1, "last")
        return segments

    module, limits = (
        "skyarm.identify.designed_flight",
        DesignLimits(seconds=20.0, box=2.0),
    )
    height = math.ceil(10.0 * (1.0 + 0.33 + 0.1)) / 10.0  # an arm of 0.33 m
    fakes = {
        "run": fly,
        "broken_axes": broken,
        "design_segments": designed,
        "measured_noise": lambda log, vehicle: ("noise of", log),
        "_flight_data": lambda log: log,
        "expected_numbers": lambda logs, vehicle: [
            SimpleNamespace(half_width=2.0 if logs[0] is plain else 1.0)
        ],
    }
    for name, fake in fakes.items():
        monkeypatch.setattr(f"{module}.{name}", fake)

    def flight():
        words = {
            "candidates": 12,
            "seed": 5,
            "progress": lambda *each: told.append(each),
        }
        return design_flight(VEHICLE, "hummingbird_arm2_rotors", limits, **words)

    found = flight()
    assert len(tried) == 3
    assert [each.ratio for each in found.numbers] == [2.0]
    shrunk = [
        each.scale(np.array([1.0, 0.85, 1.0, 1.0, 1.0, 0.85])) for each in segments
    ]
    axes = axes_of(VEHICLE, 2.0, height)
    assert found.document == scenario_document(
        VEHICLE, "hummingbird_arm2_rotors", shrunk, axes, 20.0, 5
    )
    assert tried[2] == scenario_from(found.document)
    assert tomllib.loads(found.text()) == found.document
    assert found.tilt == pytest.approx(0.2)
    assert found.box == pytest.approx((3.0, 2.0, 1.0))
    assert found.clearance == pytest.approx(0.0, abs=1e-9)
    assert found.saturated == pytest.approx(0.4)
    assert {total for _, total, _ in told} == {14}
    assert [done for done, _, _ in told] == [0, 12, 13, 13, 14]
    still_broken = True
    monkeypatch.setattr(f"{module}.FLIGHTS", 2)
    tried.clear()
    with pytest.raises(ValueError, match=r"no flight stays in the limits; widen them$"):
        flight()
    assert len(tried) == 1 + 2
    tried.clear()
    plain.info["status"] = "crashed"
    with pytest.raises(
        ValueError, match=r"the law centroidal_joint does not fly it \(crashed\)$"
    ):
        flight()


def test_information_of_a_flight_is_that_of_the_fit_to_its_windows(monkeypatch):
    """At the vehicle that flew: of the fit to all its windows, under the noise and the
    spread that it found.
    """
    fits = []

    def fitted(search):
        fits.append(first_fits(search))
        return fits[-1]

    def few_numbers(flights, vehicle):
        every = {
            each.name: each.start
            for each in unknowns_of(
                vehicle, curve=False, velocity=True, voltage=False, driven=[]
            )
        }
        searched = ("rotors.thrust_coefficient", "base.com.x", "delay")
        known = {
            **every,
            "delay": 0.0033,
            **{f"gyro_bias.{axis}": 0.0 for axis in "xyz"},
            "pose_delay": 0.0,
        }
        given = {name: value for name, value in known.items() if name not in searched}
        return search_of(flights, vehicle, SearchOptions(known=given))

    monkeypatch.setattr("skyarm.identify.design.search_of", few_numbers)
    monkeypatch.setattr("skyarm.identify.design.first_fits", fitted)
    quick = partial(fit_windows, turns=6)
    for name, few in (
        ("FEW", 6),
        ("WHOLE", 0.2),
        ("FIRST", 0.03),
        ("fit_windows", quick),
    ):
        monkeypatch.setattr(f"skyarm.identify.identify_windows.{name}", few)
    flight = measured(flown(QUAD, 2.0, 0.0033), noise=1.0)
    found = measured_noise(flight, QUAD)
    ((errors, fit),) = fits
    assert found.plant is errors
    assert found.noise is fit.noise
    assert found.loose[errors.wrench] == pytest.approx(fit.spread)
    others = [i for i in range(len(errors.free)) if i not in errors.wrench]
    assert found.loose[others].tolist() == errors.loose[others].tolist()
    unknowns = found.search.unknowns
    assert found.prior.tolist() == [each.spread for each in unknowns]
    names = [
        each.name
        for each, inside in zip(unknowns, found.in_vehicle, strict=True)
        if inside
    ]
    assert names == ["rotors.thrust_coefficient", "base.com.x"]
    size = np.sqrt(np.diag(fit.stretch_information[0]))
    off = (information_of(flight, found) - fit.stretch_information[0]) / np.outer(
        size, size
    )
    assert np.abs(off).max() < 0.1


@pytest.mark.thorough
def test_a_designed_flight_stays_in_its_limits_and_is_sharper_than_an_undesigned_one():
    """Flown from its file: moments of inertia within 0.55 %, those about x and z, which
    a swing of the arm in its plane hardly shows, at least twice as sharp; no number of
    the base worse by two thirds.
    """
    limits = DesignLimits(box=1.2, tilt=math.radians(20.0), seconds=40.0)
    found = design_flight(VEHICLE, "hummingbird_arm2_rotors", limits, candidates=60)
    flown = skyarm.run(scenario_from(tomllib.loads(found.text())))
    assert flown.info["status"] == "completed"
    assert np.ptp(flown.position, axis=0).max() <= 1.2
    x, y = flown.quaternion[:, 1], flown.quaternion[:, 2]
    assert np.arccos(1.0 - 2.0 * (x**2 + y**2)).max() <= limits.tilt
    assert np.ptp(flown.position[[0, -1]], axis=0).max() < 0.05
    sharper = {each.designed.name: each.ratio for each in found.numbers}
    widths = {each.designed.name: each.designed.relative for each in found.numbers}
    assert max(widths[f"base.inertia.{axis}"] for axis in ("xx", "yy", "zz")) < 0.0055
    assert min(sharper["base.inertia.xx"], sharper["base.inertia.zz"]) > 2.0
    assert (
        min(ratio for name, ratio in sharper.items() if name.startswith("base.")) > 0.6
    )
