"""Channels: what each of their numbers does to a reading, by statistics; lost readings;
every kind of sensor.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.records.coerce import RecordError
from skyarm.sensing.channel import Channel, Dropouts
from skyarm.sensing.sensor_kinds import Encoders, Heading, Imu, Pose, Position
from support.vehicles import hummingbird_arm, tumbling

VEHICLE = hummingbird_arm()
STATE = tumbling(VEHICLE)
FORCE = Vec3(0.3, -0.2, 9.7)
DT = 0.005
LANES = 20000


def lanes(count: int, seed: int = 1) -> list[np.ndarray]:
    """Standard normal numbers of many episodes: arrays are scalars too."""
    return list(np.random.default_rng(seed).standard_normal((count, LANES)))


def test_noise_of_a_density_has_the_deviation_of_its_rate():
    """0.02 per sqrt(Hz) at 200 Hz is 0.283; a further 0.1 adds in variance. 20 000
    draws tell 1.5 %.
    """
    for channel, wanted in (
        (Channel(density=0.02), 0.02 * 200**0.5),
        (Channel(sigma=0.1), 0.1),
        (Channel(density=0.02, sigma=0.1), np.hypot(0.02 * 200**0.5, 0.1)),
    ):
        (reading,) = channel.read((3.0,), (), lanes(1), DT)
        assert np.std(reading) == pytest.approx(wanted, rel=0.015)
        assert np.mean(reading) == pytest.approx(3.0, abs=4 * wanted / LANES**0.5)


def test_a_bias_begins_with_its_own_deviation_and_walks_by_its_density():
    """Variance turn_on^2 + walk^2 t after 2 s, whatever the rate."""
    for every in (0.005, 0.02):
        channel = Channel(turn_on=0.3, walk=0.2)
        drift = channel.drift(channel.start(1), lanes(1), True, every)
        assert np.std(drift[0]) == pytest.approx(0.3, rel=0.015)
        for k in range(round(2.0 / every)):
            drift = channel.drift(drift, lanes(1, k + 2), False, every)
        assert np.std(drift[0]) == pytest.approx((0.09 + 0.04 * 2.0) ** 0.5, rel=0.015)


def test_scale_bias_and_rounding_come_in_that_order():
    channel = Channel(scale=0.1, bias=(0.03, -0.02), resolution=0.25)
    # 1.13 and 2.235 to the nearest quarter
    assert channel.read((1.0, 2.05), (), (), DT) == (1.25, 2.25)
    with pytest.raises(RecordError, match=r"gyro.bias = 2 numbers: must be 3, or none"):
        channel.require_count(3, "gyro")


def test_what_a_channel_does_not_have_costs_no_draw_and_changes_no_bit():
    for channel, wanted in (
        (Channel(), 0),
        (Channel(sigma=1.0), 3),
        (Channel(walk=1.0, density=1.0), 6),
    ):
        assert channel.normals(3) == wanted
    assert Channel().read((0.1, 0.2), (), (), DT) == (0.1, 0.2)
    bare = Imu(gyro=Channel(), accelerometer=Channel())
    assert bare.uniforms(VEHICLE) == 0
    assert Imu().uniforms(VEHICLE) == 12
    _, reading = bare.measure(bare.start(VEHICLE), 1.5, STATE, FORCE, (), DT)
    assert (reading.time, reading.rate, reading.specific_force) == (
        1.5,
        STATE.rate,
        FORCE,
    )


def test_every_kind_reads_the_truth_where_it_has_no_errors():
    pose = Pose(position=Channel(), attitude=Channel())
    _, seen = pose.measure(pose.start(VEHICLE), 0.0, STATE, FORCE, (), 0.02)
    assert seen.position == STATE.position
    np.testing.assert_allclose(
        tuple(seen.quaternion), tuple(STATE.quaternion), rtol=1e-15
    )
    place = Position(position=Channel())
    assert (
        place.measure(place.start(VEHICLE), 0.0, STATE, FORCE, (), 0.1)[1].position
        == STATE.position
    )
    compass = Heading(heading=Channel(bias=(0.1,)))
    _, found = compass.measure(compass.start(VEHICLE), 0.0, STATE, FORCE, (), 0.1)
    x = STATE.quaternion.rotation().column(0)
    assert found.heading == pytest.approx(np.arctan2(x.y, x.x) + 0.1, abs=1e-12)


def test_errors_of_an_attitude_turn_it_about_base_axes():
    turn = (0.02, -0.03, 0.05)
    pose = Pose(position=Channel(), attitude=Channel(bias=turn))
    _, seen = pose.measure(pose.start(VEHICLE), 0.0, STATE, FORCE, (), 0.02)
    between = STATE.quaternion.rotation().T @ seen.quaternion.rotation()
    np.testing.assert_allclose(
        np.array(between), np.eye(3) + np.cross(np.eye(3), turn), atol=2e-3
    )
    with pytest.raises(RecordError, match=r"attitude.scale = 0.1: must be left out"):
        Pose(attitude=Channel(scale=0.1))


def test_encoders_read_whole_steps_and_difference_them():
    encoders, step = Encoders(bits=12), 2 * np.pi / 4096
    memory, first = encoders.measure(encoders.start(VEHICLE), 0.0, STATE, FORCE, (), DT)
    for read, true in zip(first.joints, STATE.joints, strict=True):
        assert read / step == pytest.approx(round(true / step), abs=1e-9)
    assert first.joint_rates == (0.0, 0.0)
    moved = replace(STATE, joints=tuple(q + 10.2 * step for q in STATE.joints))
    _, second = encoders.measure(memory, DT, moved, FORCE, (), DT)
    for read, old, rate in zip(
        second.joints, first.joints, second.joint_rates, strict=True
    ):
        assert rate == pytest.approx((read - old) / DT)
        assert abs(rate - 10.2 * step / DT) <= step / DT
    measured = Encoders(bits=0, rates="measured", rate=Channel(scale=0.5))
    _, third = measured.measure(measured.start(VEHICLE), 0.0, STATE, FORCE, (), DT)
    assert third.joints == STATE.joints
    np.testing.assert_allclose(third.joint_rates, 1.5 * np.array(STATE.joint_rates))
    for wrong, words in (
        ({"rates": "none"}, "rates = 'none': must be one of difference, measured"),
        (
            {"joints": Channel(resolution=0.1)},
            "bits = 12: must be 0 where joints.resolution is given",
        ),
    ):
        with pytest.raises(RecordError, match=words):
            Encoders(**wrong)


@pytest.mark.parametrize(
    ("share", "duration", "run"), [(0.2, 0.1, 5.0), (0.2, 0.0, 1.25), (0.5, 0.0, 2.0)]
)
def test_losses_at_random_have_their_share_and_their_length(share, duration, run):
    """Of readings at 50 Hz: runs of 0.1 s are five readings; independent losses end
    with probability 1 - share.
    """
    dropouts, generator = (
        Dropouts(share=share, duration=duration),
        np.random.default_rng(3),
    )
    lost, seen = np.zeros(2000), []
    for _ in range(600):
        lost = np.asarray(dropouts.lost(lost, generator.uniform(size=2000), 0.02))
        seen.append(lost)
    kept = np.array(seen[100:])
    assert kept.mean() == pytest.approx(share, rel=0.03)
    begun = (kept[1:] > kept[:-1]).sum()
    assert kept[1:].sum() / begun == pytest.approx(run, rel=0.03)


def test_a_reading_that_does_not_come_leaves_the_one_before_with_its_instant():
    place = Position(position=Channel(), dropouts=Dropouts(intervals=((0.1, 0.3),)))
    memory, times = place.start(VEHICLE), []
    for k in range(6):
        here = replace(STATE, position=Vec3(0.1 * k, 0.0, 0.0))
        memory, reading = place.measure(memory, 0.1 * k, here, FORCE, (), 0.1)
        assert reading.position.x == pytest.approx(reading.time)
        times.append(round(reading.time, 9))
    # from the beginning of an interval to before its end
    assert times == [0.0, 0.0, 0.0, 0.3, 0.4, 0.5]
    never = Position(position=Channel(), dropouts=Dropouts(intervals=((0.0, 9.0),)))
    assert (
        never.measure(never.start(VEHICLE), 0.0, STATE, FORCE, (), 0.1)[1].position
        == STATE.position
    )


@pytest.mark.parametrize(
    ("sensor", "words"),
    [
        (
            {"gyro": {"sigma": -1.0}},
            r"sensors.imu.gyro.sigma = -1.0: must be at least 0",
        ),
        ({"gyro": {"noise": 1.0}}, r"sensors.imu.gyro.noise = 1.0: unknown field"),
        (
            {"gyro": {"bias": 1.0}},
            r"sensors.imu.gyro.bias = 1.0: must be a list of numbers",
        ),
        (
            {"dropouts": {"share": 1.0}},
            r"sensors.imu.dropouts.share = 1.0: must be at most 0.99",
        ),
        (
            {"dropouts": {"intervals": [1.0, 2.0]}},
            r"sensors.imu.dropouts.intervals.0 = 1.0: must be a list of numbers",
        ),
        (
            {"dropouts": {"intervals": 3}},
            r"sensors.imu.dropouts.intervals = 3: must be a list of lists of numbers",
        ),
        (
            {"dropouts": {"intervals": [[2.0, 1.0]]}},
            r"intervals\[0\] = \[2, 1\]: must begin at 0 or later",
        ),
        (
            {"dropouts": {"intervals": [[0.5, 0.5]]}},
            r"intervals\[0\] = \[0.5, 0.5\]: must begin .*, and end later",
        ),
        (
            {"gyro": {"bias": [0.1, 0.2]}},
            r"sensors.imu.gyro.bias = 2 numbers: must be 3, or none",
        ),
        (
            {"accelerometer": {"offset": [0.1]}},
            r"sensors.imu.accelerometer.offset = 1 signals: must be 3, or none",
        ),
        (
            {"kind": "heading", "heading": {"bias": [0.1, 0.2]}},
            r"sensors.imu.heading.bias = 2 numbers: must be 1, or",
        ),
        (
            {"kind": "encoders", "joints": {"bias": [0.1]}},
            r"sensors.imu.joints.bias = 1 numbers: must be 2, or none",
        ),
        (
            {
                "kind": "encoders",
                "rates": "measured",
                "rate": {"bias": [0.1, 0.2, 0.3]},
            },
            r"sensors.imu.rate.bias = 3 numbers: must be 2, or none",
        ),
        (
            {"kind": "encoders", "rate": {"sigma": 0.1}},
            r"sensors.imu.rate: must be left out where rates = 'difference'",
        ),
        (
            {"dropouts": {"intervals": [[2.0]]}},
            r"intervals\[0\] = .*: must have 2 items",
        ),
        (
            {"frequency": 70.0},
            r"sensors.imu.frequency = 70: must divide rates.control = 200",
        ),
        (
            {"latency": 0.003},
            r"sensors.imu.latency = 0.003: must be a whole number of control periods",
        ),
    ],
)
def test_a_wrong_number_is_refused_in_one_line(sensor, words):
    document = {
        "schema": 1,
        "name": "x",
        "duration": 1.0,
        "plant": {"vehicle": "hummingbird_arm2"},
        "controller": {"preset": "paper_ct"},
        "reference": {"base": {"kind": "hover", "position": [0.0, 0.0, 1.0]}},
        "sensors": {"imu": {"kind": "imu", **sensor}},
    }
    with pytest.raises(skyarm.ScenarioError, match=words) as refused:
        skyarm.scenario_from(document)
    assert "\n" not in str(refused.value)


def test_noise_of_a_channel_changes_only_that_of_later_channels_of_its_sensor():
    """Readings of an inertial unit and of a compass after three periods, with noise of
    one channel more or less.
    """

    def read(**channels):
        imu = {
            "kind": "imu",
            "frequency": 100.0,
            "gyro": {"sigma": 0.01},
            "accelerometer": {"sigma": 0.01},
            **channels,
        }
        document = {
            "schema": 1,
            "name": "x",
            "duration": 1.0,
            "plant": {"vehicle": "hummingbird_arm2_rotors"},
            "controller": {"preset": "paper_ct"},
            "reference": {"base": {"kind": "hover", "position": [0.0, 0.0, 1.0]}},
            "sensors": {"imu": imu, "compass": {"kind": "heading", "frequency": 100.0}},
        }
        session = skyarm.Session(skyarm.scenario_from(document), machine_code=False)
        for _ in range(3):
            session.step()
        held = [sensor.held for sensor in session.now.agent.sensors[1:]]
        return held[0].rate, held[0].specific_force, held[1].heading

    both, without, quiet = read(), read(accelerometer={}), read(gyro={})
    assert both[0] == without[0]
    assert both[1] != quiet[1]
    assert both[2] == without[2] == quiet[2]


@pytest.mark.parametrize(
    ("resolution", "read"),
    [(0.0, 0.37), (0.25, 0.25), (0.1, 0.4), (1e-9, 0.37), (2.0, 0.0)],
)
def test_a_resolution_rounds_and_one_of_zero_does_not(resolution, read):
    with np.errstate(all="ignore"):  # both branches are computed
        found = Channel(resolution=np.array([resolution])).quantize(np.array([0.37]))
    assert found[0] == pytest.approx(read, abs=1e-12)


def test_a_heading_stays_within_half_a_turn_with_its_errors():
    """Headings about pi with a bias and noise: the reading is their sum as an angle, by
    atan2.
    """
    compass = Heading(heading=Channel(bias=(0.3,)))
    memory = compass.start(VEHICLE)
    for yaw in (-3.1, -2.9, 0.0, 2.9, 3.0, 3.1):
        state = replace(
            STATE, quaternion=Quaternion(math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2))
        )
        _, reading = compass.measure(memory, 0.0, state, FORCE, (), 0.1)
        assert reading.heading == pytest.approx(
            math.atan2(math.sin(yaw + 0.3), math.cos(yaw + 0.3)), abs=1e-12
        )
        assert abs(reading.heading) <= math.pi
