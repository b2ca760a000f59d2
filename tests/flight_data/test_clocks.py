"""Offsets of clocks, planted in motions made here, are found with intervals that cover
them.
"""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, RotationSpline

from skyarm.algebra.frames import turn_vectors
from skyarm.flight_data.clocks import (
    ClockOffset,
    _is_inside,
    _Pair,
    _refine,
    _robust,
    align,
    align_poses,
    clock_offset,
    fresh_poses,
    join_flights,
    straight_stamps,
)
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.flight_data.series import attitude_at, columns_at, rotations_between

LENGTH, FINE = 30.0, 1000


@cache
def motion(seed: int) -> tuple[np.ndarray, ...]:
    """Times, rates, attitudes, positions, velocities and specific forces of a drawn
    motion of up to 3 Hz.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(round(LENGTH * FINE) + 1) / FINE

    def wave(size: float) -> tuple[np.ndarray, np.ndarray]:
        value, slope = np.zeros((time.size, 3)), np.zeros((time.size, 3))
        for pulse in 2 * np.pi * rng.uniform(0.2, 3.0, 12):
            angle = pulse * time[:, None] + rng.uniform(0, 2 * np.pi, 3)
            value, slope = (
                value + size * np.sin(angle),
                slope + size * pulse * np.cos(angle),
            )
        return value, slope

    rate, _ = wave(0.15)
    velocity, acceleration = wave(0.1)
    position = np.cumsum(velocity, axis=0) / FINE - 0.5 * velocity / FINE  # by trapezes
    turn = np.zeros((time.size, 4))
    turn[0, 0] = 1.0
    for k in range(time.size - 1):
        w = 0.5 * (rate[k] + rate[k + 1])
        half = 0.5 * float(np.sqrt(w @ w)) / FINE
        x, y, z = w * (np.sin(half) / (2 * half) / FINE)
        c, (q0, q1, q2, q3) = np.cos(half), turn[k]
        turn[k + 1] = (
            c * q0 - x * q1 - y * q2 - z * q3,
            c * q1 + x * q0 + z * q2 - y * q3,
            c * q2 + y * q0 - z * q1 + x * q3,
            c * q3 + z * q0 + y * q1 - x * q2,
        )
    force = turn_vectors(
        turn * [1, -1, -1, -1], acceleration + np.array([0.0, 0.0, 9.81])
    )
    return time, rate, turn, position, velocity, force


def flight(
    seed: int,
    offset: float = 0.0,
    drift: float = 0.0,
    noise: float = 1.0,
    motions: int = 4,
) -> FlightData:
    """A gyro and an accelerometer of 500 Hz, and a motion capture of 100 Hz whose clock
    is behind by the offset.
    """
    time, rate, turn, position, velocity, force = motion(seed % motions)
    rng = np.random.default_rng(1000 + seed)
    fast, slow = slice(0, None, FINE // 500), slice(FINE, -FINE, FINE // 100)

    def channel(
        rows: slice, values: np.ndarray, sigma: float, stamp: np.ndarray
    ) -> Channel:
        return Channel(
            time=stamp,
            values=values[rows] + noise * sigma * rng.normal(size=values[rows].shape),
            source="",
        )

    middle = 0.5 * (time[slow][0] + time[slow][-1])
    stamps = (time[slow] - offset + drift * middle) / (1.0 + drift)
    attitude = Channel(time=time[slow], values=turn[slow], source="")
    tilted = attitude_at(attitude, time[slow]) + noise * 5e-4 * rng.normal(
        size=(time[slow].size, 4)
    )
    return FlightData(
        name="drawn",
        file="",
        channels={
            "gyro": channel(fast, rate, 0.05, time[fast]),
            "accelerometer": channel(fast, force, 0.3, time[fast]),
            "position": channel(slow, position, 2e-4, stamps),
            "velocity": channel(slow, velocity, 0.01, stamps),
            "quaternion": Channel(time=stamps, values=tilted, source=""),
        },
    )


@pytest.mark.parametrize("stream", ["quaternion", "velocity", "position"])
@pytest.mark.parametrize(
    ("offset", "drift"), [(0.123, 0.0), (-0.4567, 2e-4), (0.003, -1e-3)]
)
def test_a_planted_offset_and_drift_are_found(
    stream: str, offset: float, drift: float
) -> None:
    found = clock_offset(flight(1, offset, drift, noise=0.0), stream)
    assert found.offset == pytest.approx(
        offset + drift * (found.middle - 0.5 * LENGTH), abs=5e-6
    )
    assert found.drift == pytest.approx(drift, abs=2e-6)
    assert found.correlation > 1.0 - 3e-5
    assert found.wander < 3e-5


@pytest.mark.thorough
@pytest.mark.parametrize("stream", ["quaternion", "velocity"])
def test_intervals_cover_the_truth(stream: str) -> None:
    rng = np.random.default_rng(5)
    hits = []
    for seed in range(24):
        offset, drift = rng.uniform(-1.0, 1.0), rng.uniform(-5e-4, 5e-4)
        found = clock_offset(flight(seed, offset, drift), stream)
        true = offset + drift * (found.middle - 0.5 * LENGTH)
        hits += [
            abs(found.offset - true) < found.offset_error,
            abs(found.drift - drift) < found.drift_error,
        ]
        assert found.offset_error < 3e-3
    assert np.mean(hits) >= 0.85


def test_a_row_whose_kernel_begins_with_the_reference_is_inside_it() -> None:
    reference = np.arange(11) / 10.0
    assert _is_inside(reference, np.array([0.1, 0.2, 0.8, 0.9]), 0.2).tolist() == [
        False,
        True,
        True,
        False,
    ]


def test_a_landing_does_not_decide() -> None:
    good = flight(2, 0.05)
    hit = good["accelerometer"].values.copy()
    hit[3000:3200] += 300.0 * np.random.default_rng(4).normal(size=(200, 3))
    channels = {
        "accelerometer": Channel(time=good["accelerometer"].time, values=hit, source="")
    }
    found = clock_offset(good.with_channels(channels), "velocity")
    assert found.offset == pytest.approx(0.05, abs=5e-4)


def test_aligned_streams_have_the_clock_of_the_reference_and_a_note() -> None:
    given = flight(3, 0.2, 1e-4)
    found = clock_offset(given)
    assert (found.reference, found.stream) == ("gyro", "quaternion")
    moved = align(given, found, ["quaternion", "position", "velocity"])
    again = clock_offset(moved, "velocity")
    assert abs(again.offset) < 2 * again.offset_error + found.offset_error
    assert found.offset == pytest.approx(0.2, abs=1e-3)
    assert moved.notes[-1].startswith(
        "quaternion, position, velocity: moved to the clock of gyro: offset +"
    )


def test_poses_move_to_the_gyro_s_clock_with_what_has_their_times() -> None:
    given = flight(3, 0.037, 5e-5)
    stamps, values = (
        given["quaternion"].time,
        np.zeros((given["quaternion"].time.size, 2)),
    )
    joints = Channel(time=stamps, values=values, source="")
    moved, found = align_poses(
        given.with_channels(
            {"joint_positions": joints, "joint_rates": joints.section(0.0, 9.0)}
        )
    )
    assert found is not None
    assert found.offset == pytest.approx(0.037, abs=found.offset_error)
    for name in ("position", "velocity", "quaternion", "joint_positions"):
        np.testing.assert_array_equal(moved[name].time, found.times(stamps))
    for name in ("gyro", "accelerometer", "joint_rates"):
        assert moved[name].time[-1] in (
            given[name].time[-1] if name in given else 0.0,
            joints.section(0.0, 9.0).time[-1],
        )


def test_a_clock_within_its_interval_or_a_millisecond_changes_nothing() -> None:
    for offset in (0.0, 8e-4):
        given = flight(2, offset, noise=0.1)
        assert align_poses(given) == (given, None)
    quiet = FlightData(name="a", file="", channels={"gyro": flight(2)["gyro"]})
    assert align_poses(quiet) == (quiet, None)


def test_two_files_of_one_flight_are_join_flights() -> None:
    both = flight(1, 25.0)
    onboard = FlightData(
        name="card", file="", channels={k: both[k] for k in ("gyro", "accelerometer")}
    )
    camera = FlightData(
        name="mocap", file="", channels={k: both[k] for k in ("position", "quaternion")}
    )
    found, clock = join_flights(onboard, camera)
    assert clock.offset == pytest.approx(25.0, abs=2e-3)
    assert set(found) == {"gyro", "accelerometer", "position", "quaternion"}
    assert abs(clock_offset(found).offset) < 2e-3
    assert "mocap, moved to the clock of gyro: offset +" in found.notes[-1]


@pytest.mark.parametrize("more", [(), ("position",), ("position", "velocity")])
def test_a_joined_pose_replaces_that_of_the_log_whose_world_is_another(
    more: tuple[str, ...],
) -> None:
    """The x axis of a motion capture is 60 degrees from that of the log, by SciPy."""
    log, about = flight(1), Rotation.from_euler("z", 60.0, degrees=True)
    stamps, own = (
        log["quaternion"].time,
        Rotation.from_quat(log["quaternion"].values, scalar_first=True),
    )
    turned = Channel(
        time=stamps - 25.0,
        values=(about * own).as_quat(scalar_first=True),
        source="take",
    )
    place = Channel(
        time=stamps - 25.0, values=about.apply(log["position"].values), source="take"
    )
    camera = FlightData(
        name="mocap",
        file="",
        channels={"position": place, "quaternion": turned},
        jumps=((-9.0, -8.0),),
    )
    kept = ("gyro", "accelerometer", "quaternion", *more)
    onboard = FlightData(
        name="px4", file="", channels={k: log[k] for k in kept}, jumps=((2.0, 2.1),)
    )
    found, clock = join_flights(onboard, camera)
    assert clock.offset == pytest.approx(25.0, abs=2e-3)
    assert {
        name: found[name].source for name in set(found) - {"gyro", "accelerometer"}
    } == {
        "position": "mocap: take",
        "quaternion": "mocap: take",
    }
    np.testing.assert_array_equal(found["quaternion"].values, turned.values)
    np.testing.assert_array_equal(found["position"].values, place.values)
    dropped = ", ".join(("quaternion", *more))
    assert (
        found.notes[-1]
        == f"{dropped}: of px4 are dropped: a pose is of one world, that of mocap."
    )
    # of the dropped pose none
    assert np.array(found.jumps) == pytest.approx(np.array([[16.0, 17.0]]), abs=5e-3)


def test_a_take_with_another_axis_up_is_not_joined_and_its_axes_are_named() -> None:
    """A world and a base with z up that are read as ones with y up are turned by a
    quarter about x.
    """
    log, quarter = flight(1), Rotation.from_euler("x", 90.0, degrees=True)
    own = Rotation.from_quat(log["quaternion"].values, scalar_first=True)
    wrong = (quarter * own * quarter.inv()).as_quat(scalar_first=True)
    camera = log.with_channels(
        {"quaternion": dataclasses.replace(log["quaternion"], values=wrong)}
    )
    with pytest.raises(
        ValueError,
        match=(
            r"correlation with gyro = .*: a take of Motive must have y up, and its body"
        ),
    ):
        join_flights(log, camera)


@pytest.mark.parametrize(
    ("until", "begin", "shared"),
    [(36.0, 23.0, True), (34.0, 26.0, False), (22.0, 36.0, False)],
)
def test_files_that_share_less_than_three_tenths_of_the_shorter_are_not_joined(
    until: float, begin: float, shared: bool
) -> None:
    """Of two records of one random swing about x, 13, 8 and no s of which are common,
    either of which may begin.
    """
    time = 0.02 * np.arange(3001)
    rate = np.convolve(
        np.random.default_rng(9).normal(size=time.size), np.hanning(7) / 2.0, "same"
    )
    half = 0.5 * np.append(0.0, np.cumsum(0.01 * (rate[1:] + rate[:-1])))
    nought = 0.0 * time
    gyro = Channel(
        time=time, values=np.stack([rate, nought, nought], axis=1), source=""
    )
    turn = Channel(
        time=time,
        values=np.stack([np.cos(half), np.sin(half), nought, nought], axis=1),
        source="",
    )
    for first, second in (((0.0, until), (begin, 60.0)), ((begin, 60.0), (0.0, until))):
        onboard = FlightData(
            name="card", file="", channels={"gyro": gyro.section(*first)}
        )
        camera = FlightData(
            name="mocap", file="", channels={"quaternion": turn.section(*second)}
        )
        if shared:
            assert join_flights(onboard, camera)[1].offset == pytest.approx(
                0.0, abs=2e-3
            )
        else:
            with pytest.raises(ValueError, match=r"^clock"):
                join_flights(onboard, camera)


def test_a_clock_that_jumps_in_flight_is_told_by_the_parts_before_and_behind() -> None:
    """The middle half's stamps are 20 ms late: one offset lies between, and the parts
    are about 10 ms from it.
    """
    given = flight(1, noise=0.1)
    time, values = given["quaternion"].time, given["quaternion"].values
    late = time + 0.02 * ((time > 8.0) & (time < 22.0))
    rising = np.append(True, np.diff(np.maximum.accumulate(late)) > 1e-6)
    jumping = given.with_channels(
        {"quaternion": Channel(time=late[rising], values=values[rising], source="")}
    )
    assert clock_offset(given, "quaternion").wander < 1e-3
    assert 0.008 < clock_offset(jumping, "quaternion").wander < 0.013


@pytest.mark.parametrize(
    ("part", "wander"), [(0, 25 / 64), (1, 45 / 64), (2, 45 / 64), (3, 25 / 64)]
)
def test_a_clock_that_is_late_for_a_quarter_of_the_flight_is_told_whichever_it_is(
    part: int, wander: float
) -> None:
    """Stamps of one quarter are 20 ms late; a quarter is off by this share of it, or
    more with outliers left out.
    """
    given = flight(1, noise=0.1)
    time, values = given["quaternion"].time, given["quaternion"].values
    begin, end = time[0] + np.ptp(time) * np.array([0.25 * part, 0.25 * (part + 1)])
    late = time + 0.02 * ((time >= begin) & (time < end))
    rising = np.append(True, np.diff(np.maximum.accumulate(late)) > 1e-6)
    jumping = given.with_channels(
        {"quaternion": Channel(time=late[rising], values=values[rising], source="")}
    )
    assert 0.9 * wander < clock_offset(jumping, "quaternion").wander / 0.02 < 1.0


@pytest.mark.parametrize("start", [(0.1, 0.0), (0.2, 3e-3)])
def test_a_turn_of_the_search_moves_no_sample_by_more_than_an_interval_twice(
    start: tuple[float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Once by the offset, once by the drift over the flight; free steps from there
    would be an eighth longer.
    """
    monkeypatch.setattr("skyarm.flight_data.clocks.ITERATIONS", 1)
    given = flight(1, noise=0.1)
    pair = _Pair(given, "gyro", given, "quaternion")
    found, _ = _refine(pair, pair.time > 0.0, np.array(start), 15.0)
    moved, drifted = np.abs(found - start)
    assert moved <= pair.width * 1.0001
    assert drifted * np.ptp(pair.time) <= pair.width * 1.05


def test_a_motion_that_does_not_show_the_offset_is_refused() -> None:
    given = flight(1)
    still = np.zeros_like(given["gyro"].values) + 0.05 * np.random.default_rng(
        1
    ).normal(size=(given["gyro"].time.size, 3))
    quiet = given.with_channels(
        {"gyro": Channel(time=given["gyro"].time, values=still, source="")}
    )
    with pytest.raises(
        ValueError, match=r"clock of quaternion: correlation with gyro = "
    ):
        clock_offset(quiet, "quaternion")
    time = given["gyro"].time
    wave = np.stack(
        [np.sin(2 * np.pi * 1.0 * time), np.zeros_like(time), np.zeros_like(time)],
        axis=1,
    )
    half = 0.5 * (1.0 - np.cos(2 * np.pi * time[::5])) / (2 * np.pi)
    turn = np.stack([np.cos(half), np.sin(half), 0 * half, 0 * half], axis=1)
    periodic = FlightData(
        name="wave",
        file="",
        channels={
            "gyro": Channel(time=time, values=wave, source=""),
            "quaternion": Channel(time=time[::5], values=turn, source=""),
        },
    )
    with pytest.raises(
        ValueError,
        match="fit equally well: must be a motion that does not repeat itself",
    ):
        clock_offset(periodic)
    with pytest.raises(ValueError, match="clocks: must hold gyro and quaternion or"):
        clock_offset(FlightData(name="a", file="", channels={"gyro": given["gyro"]}))
    with pytest.raises(ValueError, match="stream = 'yaw': must be one of"):
        clock_offset(given, "yaw")


@pytest.mark.parametrize("parts", [(0.98, 1.0), (1.0, 0.98), (0.9, 1.0), (1.0, 0.9)])
def test_a_swing_that_comes_twice_shows_no_offset_unless_it_is_weaker_by_a_tenth(
    parts: tuple[float, float],
) -> None:
    """Once before and once behind the one that fits best; a camera sees it once, for
    ten seconds of its own clock.
    """
    time = 0.02 * np.arange(501)
    rate = np.convolve(
        np.random.default_rng(5).normal(size=time.size), np.hanning(51) / 5.0, "same"
    )
    half = 0.5 * np.append(0.0, np.cumsum(0.01 * (rate[1:] + rate[:-1])))
    seen = Channel(
        time=time,
        values=np.stack([np.cos(half), np.sin(half), 0 * half, 0 * half], axis=1),
        source="",
    )
    twice = np.concatenate([parts[0] * rate[:-1], parts[1] * rate])
    rates = np.stack([twice, 0.0 * twice, 0.0 * twice], axis=1)
    gyro = Channel(time=0.02 * np.arange(twice.size), values=rates, source="")
    onboard = FlightData(name="card", file="", channels={"gyro": gyro})
    camera = FlightData(name="mocap", file="", channels={"quaternion": seen})
    if min(parts) < 0.97:
        later = 10.0 if parts[1] == 1.0 else 0.0
        assert clock_offset(onboard, other=camera).offset == pytest.approx(
            later, abs=2e-3
        )
    else:
        with pytest.raises(
            ValueError,
            match="fit equally well: must be a motion that does not repeat itself",
        ):
            clock_offset(onboard, other=camera)


def test_residuals_weigh_less_beyond_two_standard_deviations() -> None:
    noise = np.random.default_rng(6).normal(size=(4000, 3))
    _, residual, weights = _robust(np.ones((4000, 3, 1)), noise)
    size = np.abs(residual) / np.std(residual)
    assert (weights[size < 1.9] == 1.0).all()
    assert weights[size > 2.1] == pytest.approx(2.0 / size[size > 2.1], rel=0.05)


def test_steps_between_attitudes_of_either_sign_are_those_of_scipy() -> None:
    rng = np.random.default_rng(5)
    first = Rotation.random(200, random_state=1)
    steps = rng.normal(size=(200, 3)) * np.geomspace(1e-9, 1.0, 200)[:, None]
    pairs = np.stack(
        [first.as_quat(), (first * Rotation.from_rotvec(steps)).as_quat()], axis=1
    )[..., [3, 0, 1, 2]]
    pairs *= rng.choice([-1.0, 1.0], (200, 2, 1))
    found = rotations_between(pairs[:, 0], pairs[:, 1])
    # rounding of a unit quaternion
    np.testing.assert_allclose(found, steps, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("stream", ["quaternion", "velocity", "position"])
def test_a_pose_measured_in_a_turned_world_has_the_same_clock(stream: str) -> None:
    """Attitudes far from rest, in quaternions of either sign: turned about z alone
    where gravity is measured.
    """
    level = flight(2, offset=0.137, drift=2e-5)
    about = Rotation.from_euler("xz", [np.pi if stream == "quaternion" else 0.0, 2.0])
    own = Rotation.from_quat(level["quaternion"].values[:, [1, 2, 3, 0]])
    signs = np.where(np.arange(level["quaternion"].time.size) // 7 % 2, 1.0, -1.0)[
        :, None
    ]
    values = {
        name: about.apply(level[name].values) for name in ("position", "velocity")
    }
    values["quaternion"] = (about * own).as_quat()[:, [3, 0, 1, 2]] * signs
    turned = {
        name: dataclasses.replace(level[name], values=each)
        for name, each in values.items()
    }
    before, after = (
        clock_offset(level, stream),
        clock_offset(level.with_channels(turned), stream),
    )
    assert after.offset == pytest.approx(before.offset, abs=1e-6)
    assert after.correlation == pytest.approx(before.correlation, abs=1e-6)
    assert abs(after.offset - 0.137) < 0.002


def stamped(samples: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Rows at which a log writes samples: the first that is not before each."""
    return rows[np.searchsorted(rows, samples - 1e-9)]


def test_even_samples_that_a_log_stamps_on_its_rows_are_straightened() -> None:
    rows, samples = np.arange(10001) / 500.0, 0.0031 + np.arange(1190) / 60.0
    stamps = stamped(samples, rows)
    assert np.ptp(stamps - samples) > 1e-3
    straight = straight_stamps(stamps, rows)
    assert np.ptp(straight - samples) < 1e-4
    assert straight.mean() == pytest.approx(stamps.mean(), abs=1e-9)


@pytest.mark.parametrize(
    ("rate", "jitter", "gap"),
    [
        (60.0, 3e-3, 0),  # beyond a row
        (60.0, 0.0, 5),  # a lost sample
        (100.0, 0.0, 0),  # every fifth row: the samples are those of the rows
        (500.0, 0.0, 0),
    ],
)
def test_stamps_that_are_real_stay(rate: float, jitter: float, gap: int) -> None:
    rng = np.random.default_rng(3)
    rows = np.arange(10001) / 500.0 + rng.uniform(
        0.0, 1e-3 if rate == 100.0 else 0.0, 10001
    )
    samples = 0.0031 + np.arange(round(19 * rate)) / rate
    stamps = np.unique(
        stamped(samples + rng.uniform(0.0, 2.0 * jitter, samples.size), rows)
    )
    if rate == 100.0:
        stamps = rows[::5]
    if gap:
        stamps = np.delete(stamps, gap)
    assert straight_stamps(stamps, rows) is stamps


def test_stamps_that_are_no_rows_stay() -> None:
    rows, stamps = (
        np.arange(10001) / 500.0,
        stamped(0.0031 + np.arange(1190) / 60.0, np.arange(10001) / 500.0),
    )
    stamps[600] += 1e-4
    assert straight_stamps(stamps, rows) is stamps
    assert straight_stamps(stamps[:5], rows).size == 5


@pytest.mark.parametrize("noise", [0.1, 1.0])
def test_a_pose_stamped_on_the_gyro_s_rows_is_straightened_with_what_has_its_times(
    noise: float,
) -> None:
    given = flight(2, noise=noise)
    rows = given["gyro"].time
    samples = np.arange(1.0, 28.9, 1.0 / 60.0)
    channels = {
        name: Channel(
            time=stamped(samples, rows),
            values=columns_at(samples, given[name].time, given[name].values),
            source="",
        )
        for name in ("position", "velocity", "quaternion")
    }
    channels["joint_positions"] = Channel(
        time=stamped(samples, rows), values=np.zeros((samples.size, 2)), source=""
    )
    found, clock = align_poses(given.with_channels(channels))
    names = "position, velocity, quaternion, joint_positions"
    assert (
        found.notes[0]
        == f"{names}: stamps straightened: they are even but for the rows of the gyro."
    )
    for name in channels:
        assert np.ptp(found[name].time - samples) < 1e-4 + (
            0.0 if clock is None else 1e-3
        )
    assert found["gyro"] is given["gyro"]


@pytest.mark.parametrize(
    ("error", "straightened"),
    [(0.89, False), (0.9, False), (0.905, True), (None, True)],
)
def test_stamps_are_straightened_unless_they_fit_the_gyro_better_by_a_tenth(
    error: float | None, straightened: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Offset of the stamps as they are, known within an error or not at all, and of the
    straight ones within 1 s.
    """
    given = flight(2)
    rows = given["gyro"].time
    stamps = stamped(np.arange(1.0, 28.9, 1.0 / 60.0), rows)
    pose = Channel(time=stamps, values=np.zeros((stamps.size, 4)), source="")
    before = None if error is None else clock_of(error)
    clocks = iter((before, clock_of(1.0)))
    monkeypatch.setattr(
        "skyarm.flight_data.clocks._clock_of_attitude", lambda _: next(clocks)
    )
    found, clock = align_poses(given.with_channels({"quaternion": pose}))
    assert ("straightened" in found.notes[0]) == straightened
    assert clock == (clock_of(1.0) if straightened else before)


@pytest.mark.parametrize(
    ("offset", "drift", "moves"),
    [
        (2e-3, 0.0, True),
        (-2e-3, 0.0, True),
        (0.9e-3, 0.0, False),
        (0.0, 1e-4, True),  # of 28 s: 1.4 ms at both ends
        (0.0, -1e-4, True),
        (0.0, 6e-5, False),
    ],
)
def test_a_clock_changes_what_it_moves_by_more_than_a_millisecond_somewhere(
    offset: float, drift: float, moves: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = flight(2)
    clock = dataclasses.replace(
        clock_of(5e-4), offset=offset, drift=drift, drift_error=1e-5, middle=15.0
    )
    monkeypatch.setattr("skyarm.flight_data.clocks._clock_of_attitude", lambda _: clock)
    found, used = align_poses(given)
    assert used is (clock if moves else None)
    late = found["position"].time - given["position"].time
    assert late == pytest.approx(
        moves * (offset + drift * (given["position"].time - 15.0)), abs=1e-12
    )
    # neither of them counts within its own interval
    sure = dataclasses.replace(
        clock, offset_error=abs(offset) + 1e-9, drift_error=abs(drift) + 1e-9
    )
    monkeypatch.setattr("skyarm.flight_data.clocks._clock_of_attitude", lambda _: sure)
    assert align_poses(given) == (given, None)


def clock_of(error: float) -> ClockOffset:
    """A clock that is 10 s late, known within an error."""
    return ClockOffset("gyro", "quaternion", 10.0, error, 0.0, 1e-9, 0.0, 0.0, 0.9)


def test_intervals_of_few_rows_are_wider_by_the_published_critical_values(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of Bartlett's kernel over a share b of the rows, at 97.5 %: Kiefer and Vogelsang
    (2005), table 1.
    """
    given = flight(1, noise=0.0)
    short = dataclasses.replace(
        given, channels={name: given[name].section(2.0, 5.0) for name in given}
    )
    pair = _Pair(short, "gyro", short, "quaternion")
    rows, start = np.ones(pair.time.size, dtype=bool), np.zeros(2)
    inside = pair.is_inside(pair.time).sum()
    monkeypatch.setattr("skyarm.flight_data.clocks.MEMORY", 0.75 * inside * pair.width)
    usual = _refine(pair, rows, start, 3.5)[1]
    monkeypatch.setattr("skyarm.flight_data.clocks.NORMAL", 0.0)
    less = _refine(pair, rows, start, 3.5)[1]
    b = round(0.75 * inside) / inside
    critical = 1.9600 + 2.9694 * b + 0.4160 * b**2 - 0.5324 * b**3
    assert 1.959964 * usual / (usual - less) == pytest.approx(
        [critical, critical], rel=0.06
    )


def test_an_offset_is_known_best_in_the_middle_of_the_flight() -> None:
    """As of a line through even points with equal errors: of its height there, and of
    its slope, by the root of 12.
    """
    found = clock_offset(flight(1), "quaternion")
    assert found.middle == pytest.approx(0.5 * LENGTH, abs=0.1)
    length = np.ptp(flight(1)["quaternion"].time)
    assert found.offset_error == pytest.approx(
        found.drift_error * length / np.sqrt(12.0), rel=0.3
    )


def test_a_clock_in_words() -> None:
    found = ClockOffset(
        "gyro", "quaternion", 0.0123, 2e-4, -5e-5, 1e-5, 3.0, 0.0011, 0.987
    )
    assert (
        found.words
        == "offset +12.30 ms, +- 0.20, drift -50 ppm, +- 10, parts of the flight up to"
        " 1.1 ms from that, of quaternion against gyro (correlation 0.99)"
    )


def rows_of(*names: str, count: int = 400) -> FlightData:
    """Noise as a gyro and a pose, all on the gyro's rows."""
    time, draw = 0.005 * np.arange(count), np.random.default_rng(0)
    return FlightData(
        name="rows",
        file="rows.csv",
        channels={
            name: Channel(time=time, values=draw.normal(size=(count, 3)), source=name)
            for name in names
        },
    )


def repeated(flight: FlightData, name: str, rows: np.ndarray) -> FlightData:
    """The flight with, in each row of a channel, the values of another row."""
    return flight.with_channels(
        {name: dataclasses.replace(flight[name], values=flight[name].values[rows])}
    )


def test_of_a_pose_that_a_logger_held_the_new_rows_are_kept() -> None:
    """Every fifth and, as the pose has a rate of its own, now and then every fourth or
    sixth.
    """
    flight, new = rows_of("gyro", "position", "velocity"), np.arange(0, 400, 5)
    new[3::7] += 1
    new[5::11] -= 1
    held = repeated(
        flight, "position", new[np.searchsorted(new, np.arange(400), "right") - 1]
    )
    found = fresh_poses(held)
    np.testing.assert_array_equal(found["position"].time, flight["position"].time[new])
    np.testing.assert_array_equal(
        found["position"].values, flight["position"].values[new]
    )
    assert found.notes == ("position: 320 rows repeat the one before: left out.",)
    assert all(found[name] is held[name] for name in ("gyro", "velocity"))
    aligned, clock = align_poses(held)
    assert clock is None
    np.testing.assert_array_equal(
        aligned["position"].time, flight["position"].time[new]
    )


def test_a_logger_that_holds_two_rows_is_one() -> None:
    assert (
        fresh_poses(repeated(rows_of("velocity"), "velocity", np.arange(400) // 2 * 2))[
            "velocity"
        ].time.size
        == 200
    )


@pytest.mark.parametrize(
    "rows",
    [
        np.arange(400),
        np.maximum(np.arange(400), 300),  # stands before it takes off
        np.minimum(np.arange(400), 100),  # freezes
        np.arange(400) // 60 * 60,  # too few rows to tell
    ],
)
def test_rows_of_a_pose_that_is_not_held_evenly_stay(rows: np.ndarray) -> None:
    flight = repeated(rows_of("position"), "position", rows)
    assert fresh_poses(flight) is flight


def test_a_pose_is_new_where_one_of_its_columns_is() -> None:
    flight = rows_of("position")
    values = flight["position"].values[np.arange(400) // 5 * 5].copy()
    values[:, 2] = flight["position"].values[:, 2]
    moved = flight.with_channels(
        {"position": dataclasses.replace(flight["position"], values=values)}
    )
    assert fresh_poses(moved) is moved


def test_a_pose_that_falls_out_for_more_than_some_rows_is_not_held_evenly() -> None:
    new = np.append(np.arange(0, 200, 2), np.arange(200, 400, 10))
    flight = repeated(
        rows_of("position"),
        "position",
        new[np.searchsorted(new, np.arange(400), "right") - 1],
    )
    assert fresh_poses(flight) is flight


def test_a_velocity_without_an_attitude_shows_no_clock() -> None:
    given = flight(1)
    bare = FlightData(
        name="a",
        file="",
        channels={name: given[name] for name in ("accelerometer", "velocity")},
    )
    with pytest.raises(ValueError, match="clocks: must hold gyro and quaternion or"):
        clock_offset(bare)


def shaking(
    seed: int,
    rate: float,
    band: tuple[float, float],
    offset: float,
    seconds: float = 16.0,
    noise: float = 2e-3,
) -> FlightData:
    """A hover that sways slowly and shakes within a band (Hz): a gyro of 250 Hz, and
    attitudes whose clock is behind.

    Attitudes and their rates are those of a spline of SciPy's rotations.
    """
    rng, knots = np.random.default_rng(seed), np.arange(0.0, seconds, 0.008)

    def tones(low: float, high: float, size: float) -> np.ndarray:
        pulses = 2 * np.pi * rng.uniform(low, high, 12)
        sines = (
            np.sin(pulses * knots[:, None] + rng.uniform(0.0, 2 * np.pi, 12)) / pulses
        )
        return size * sines.sum(axis=1) / np.std(np.gradient(sines.sum(axis=1), knots))

    turns = np.stack(
        [tones(0.3, 2.0, 0.05) + tones(*band, 0.12) for _ in range(3)], axis=1
    )
    spline = RotationSpline(knots, Rotation.from_rotvec(turns))
    time, stamps = (
        np.arange(0.0, seconds - 0.1, 0.004),
        np.arange(0.05, seconds - 0.1, 1.0 / rate),
    )
    rates = spline(time, 1) + noise * rng.normal(size=(time.size, 3))
    poses = spline(stamps).as_quat()[:, [3, 0, 1, 2]] + 2e-4 * rng.normal(
        size=(stamps.size, 4)
    )
    gyro, pose = (
        Channel(time=time, values=rates, source=""),
        Channel(time=stamps - offset, values=poses, source=""),
    )
    return FlightData(
        name="shakes", file="", channels={"gyro": gyro, "quaternion": pose}
    )


@pytest.mark.parametrize(
    ("rate", "band", "offset"),
    [
        (20.8, (6.0, 9.0), 0.0),
        (20.8, (6.0, 9.0), 0.04),
        (30.0, (8.0, 12.0), -0.05),
        (60.0, (5.0, 8.0), 0.02),
        (150.0, (8.0, 12.0), -0.03),
    ],
)
def test_a_hover_that_shakes_as_fast_as_its_pose_is_sampled_has_its_true_clock(
    rate: float, band: tuple[float, float], offset: float
) -> None:
    """Within 2 s a correlation has a hill for each period of the shaking; only one of
    them is the clock's.
    """
    found = clock_offset(shaking(3, rate, band, offset))
    assert abs(found.offset - offset) < 2.0 * found.offset_error
    assert found.offset_error < 1.5e-3


def test_a_reset_of_the_heading_changes_no_clock_and_moves_with_the_pose() -> None:
    """The heading jumps by 0.5 rad between two rows, again and again; each such step is
    left out.
    """
    given = shaking(3, 60.0, (2.0, 4.0), 0.03)
    pose = given["quaternion"]
    rows, turns = (
        np.arange(20, pose.time.size - 1, 40),
        Rotation.from_quat(pose.values[:, [1, 2, 3, 0]]),
    )
    steps = np.searchsorted(rows, np.arange(pose.time.size), "left")
    turned = (
        Rotation.from_rotvec(0.5 * steps[:, None] * [0.0, 0.0, 1.0]) * turns
    ).as_quat()[:, [3, 0, 1, 2]]
    jumping = given.with_channels(
        {"quaternion": dataclasses.replace(pose, values=turned)}
    )
    jumps = tuple((float(pose.time[row]), float(pose.time[row + 1])) for row in rows)
    before, found = (
        clock_offset(given),
        clock_offset(dataclasses.replace(jumping, jumps=jumps)),
    )
    assert found.offset == pytest.approx(before.offset, abs=before.offset_error)
    assert found.correlation > 0.99
    aligned, clock = align_poses(dataclasses.replace(jumping, jumps=jumps))
    assert clock is not None
    assert aligned.jumps[0] == pytest.approx(clock.times(np.array(jumps[0])), abs=1e-12)


def test_a_clock_is_unknown_where_a_period_of_the_shaking_later_fits_as_well() -> None:
    """The hills of the correlation differ by less than the noise makes them differ."""
    flown = shaking(1, 50.0, (6.6, 7.4), 0.0, 6.0, 0.5)
    with pytest.raises(ValueError, match=r"offsets of .* s fit equally well"):
        clock_offset(flown, "quaternion")
    assert align_poses(flown) == (flown, None)
