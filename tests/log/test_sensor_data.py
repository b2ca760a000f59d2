"""Logs keep what estimator and law received; nothing that is the truth is called
measured.
"""

from __future__ import annotations

import dataclasses
import json
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.log.flight_log import log_of_arrays
from skyarm.log.log_columns import columns
from skyarm.log.stored_arrays import ArraysByName
from skyarm.scenario.scenario_record import NamedSensor
from skyarm.sensing.measurement import SensorNoise
from skyarm.sensing.sensor import Sensor
from skyarm.sensing.sensor_kinds import Encoders
from skyarm.simulate import Delays
from skyarm.simulate.loop import run_in_python
from support.cases import sampled
from support.components import Fix, same_logs
from support.flights import COMPASS, GPS, estimated, estimated_document
from support.logs import same

RATE = 200
FORMATS = ("npz", "mcap")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Altimeter(Sensor):
    """A user's sensor whose reading is one number."""

    def measure(self, memory, t, state, specific_force, draws, dt):
        return memory, state.position.z + 0.25


@dataclasses.dataclass(frozen=True, kw_only=True)
class Seen:
    """A user's reading: no units."""

    place: skyarm.Vec3
    sharp: Any


@dataclasses.dataclass(frozen=True, kw_only=True)
class Camera(Sensor):
    """A user's sensor whose reading is a record, at 25 Hz and 15 ms late."""

    frequency: float = 25.0
    latency: float = 0.015

    def measure(self, memory, t, state, specific_force, draws, dt):
        return memory, Seen(place=state.position, sharp=2.0 * state.position.x)


@cache
def sensing(plant: str = "rigid_body", seconds: float = 0.3) -> skyarm.Scenario:
    """A flight on the filter with a sensor of each kind and three of a user."""
    wrist = {"kind": "force_torque", "force": {"sigma": 0.05}}
    scenario = estimated(
        duration=seconds,
        sensors__gps=GPS,
        sensors__compass=COMPASS,
        sensors__wrist=wrist,
        sensors__finger={"kind": "tactile_switch"},
        plant__kind=plant,
    )
    own = {
        "fix": Fix(rate=20.0, delay=0.01),
        "altimeter": Altimeter(),
        "camera": Camera(),
    }
    named = tuple(NamedSensor(name=name, sensor=sensor) for name, sensor in own.items())
    return dataclasses.replace(scenario, sensors=(*scenario.sensors, *named))


@cache
def flown() -> skyarm.Log:
    return skyarm.run(sensing())


def test_nothing_that_is_the_truth_is_called_measured_in_a_flight_on_a_filter():
    log = flown()
    assert not [
        name
        for name in (*log.arrays(), *(each.name for each in columns(log)))
        if "measured" in name
    ]
    assert log.measured_position.size == log.measured_joints.size == 0
    for name in ("position", "quaternion", "velocity", "rate", "joints", "joint_rates"):
        assert log.estimate[name].shape == log[name].shape
        off = np.abs(log.estimate[name] - log[name]).max()
        assert 0.0 < off < 2.0, name


def test_the_estimate_is_the_measurement_of_the_law():
    session = skyarm.Session(sensing(), machine_code=False)
    for k in range(4):
        given = session.measurement
        session.step()
        for name, array in session.log.estimate.items():
            value = getattr(given, name)
            assert array[k].tolist() == (
                value if isinstance(value, float) else [float(each) for each in value]
            ), name


def test_readings_are_held_at_each_sensors_rate_and_as_late_as_they_arrive():
    log, k = flown(), np.arange(60)
    assert list(log.readings) == [
        "imu",
        "mocap",
        "encoders",
        "gps",
        "compass",
        "wrist",
        "finger",
        "fix",
        "altimeter",
        "camera",
    ]
    for name, every, late in (
        ("imu", 1, 0),
        ("mocap", 4, 2),
        ("encoders", 1, 0),
        ("gps", 10, 10),
        ("compass", 10, 0),
    ):
        taken = np.maximum(0, k - late) // every * every
        np.testing.assert_allclose(
            log.readings[name]["time"], taken / RATE, rtol=0, atol=1e-12
        )
    mocap, taken = log.readings["mocap"], np.maximum(0, k - 2) // 4 * 4
    off = mocap["position"] - log.position[taken]
    assert 0.003 < off[2::4].std() < 0.008  # 15 readings of 3 axes, 5 mm
    fix = log.readings["fix"]["value"]  # (t, count, x, y, z, dt) without noise
    taken = np.maximum(0, k - 2) // 10 * 10
    assert np.array_equal(fix[:, 2:5], log.position[taken])
    assert np.array_equal(log.readings["altimeter"]["value"], log.position[:, 2] + 0.25)
    taken = np.maximum(0, k - 3) // 8 * 8
    assert np.array_equal(log.readings["camera"]["place"], log.position[taken])
    assert np.array_equal(log.readings["camera"]["sharp"], 2.0 * log.position[taken, 0])
    assert log.readings["wrist"]["force"].std() == pytest.approx(0.05, rel=0.3)
    assert not log.readings["finger"]["closed"].any()


def test_every_engine_keeps_the_same_numbers():
    scenario, log = sensing(), flown()
    for other in (run_in_python(scenario), skyarm.Session(scenario).run()):
        assert same_logs(log, other)
        assert log.info == other.info


def test_batches_keep_them_too():
    scenario, log = sensing(), flown()
    batch = skyarm.Batch(
        scenario, ["sensors.mocap.position.sigma"], bit_exact=True, log_every=5
    )
    outcome = batch.fly(
        {"sensors.mocap.position.sigma": np.array([0.005, 0.02])}, seed=scenario.seed
    )
    found = outcome.log
    assert list(found.readings) == list(log.readings)
    assert np.array_equal(
        found.estimate.position.x[0], log.estimate["position"][::5, 0]
    )
    assert np.array_equal(
        found.readings["camera"].sharp[0], log.readings["camera"]["sharp"][::5]
    )
    assert np.array_equal(
        found.readings["altimeter"][0], log.readings["altimeter"]["value"][::5]
    )
    assert not np.array_equal(
        found.readings["mocap"].position.x[1], found.readings["mocap"].position.x[0]
    )
    plain = (
        skyarm.Batch(skyarm.load_scenario("case1", duration=0.05), [], log_every=5)
        .fly({})
        .log
    )
    assert (plain.readings, plain.estimate) == ({}, None)


def test_the_other_plant_keeps_them():
    pytest.importorskip("mujoco")
    log = skyarm.run(sensing("mujoco", 0.1))
    assert set(log.received) == set(flown().received)
    assert np.array_equal(log.readings["altimeter"]["value"], log.position[:, 2] + 0.25)
    assert log.measured_position.size == 0


def test_of_arrays_in_a_file_an_estimate_reads_its_own():
    log, read = flown(), list[str]()

    def read_one(name):
        read.append(name)
        return log[name]

    stored = log_of_arrays(ArraysByName(log.arrays(), read_one), log.info)
    read.clear()
    assert list(stored.estimate) == list(log.estimate)
    assert read == [f"estimate.{name}" for name in log.estimate]


def test_without_sensors_or_estimator_the_measurement_is_what_the_law_received():
    scenario = skyarm.load_scenario("case1", duration=0.1)
    log = skyarm.run(scenario)
    assert log.received == log.readings == log.estimate == {}
    assert "received" not in log.info
    assert not [name for name in log.arrays() if "." in name]
    late = dataclasses.replace(
        scenario,
        noise=SensorNoise(position=0.01, joints=0.01),
        delays=Delays(measurement=0.015),
    )
    session = skyarm.Session(late)
    given = []
    for _ in range(8):
        given.append(session.measurement)
        session.step()
    log = session.log
    assert log.measured_position.tolist() == [list(each.position) for each in given]
    assert log.measured_joints.tolist() == [list(each.joints) for each in given]
    assert (log.measured_position[:4] == log.measured_position[0]).all()
    assert np.abs(log.measured_position - log.position).max() > 0.001


def test_the_full_states_reading_stands_beside_an_estimate_where_it_is_not_the_truth():
    noisy = dataclasses.replace(sensing(), noise=SensorNoise(position=0.01))
    log = run_in_python(dataclasses.replace(noisy, duration=0.05))
    state = log.readings["state"]
    assert 0.0 < np.abs(state["position"] - log.position).max() < 0.06
    assert "state" not in flown().readings
    assert (
        "state"
        not in skyarm.run(estimated(duration=0.05, sensors__position=0.0)).readings
    )


def test_parts_of_a_flight_without_estimate_have_none():
    """An estimator that is switched on in flight: what is not there is no number, and
    never the truth.
    """
    made = {
        name: each for name, each in estimated_document().items() if name != "estimator"
    }
    ekf = {"kind": "ekf", "delay_periods": 2, "gravity": 9.8}
    made |= {
        "duration": 0.1,
        "changes": [{"at": 0.05, "path": "estimator", "value": ekf}],
    }
    scenario = skyarm.scenario_from(made)
    for log in (skyarm.run(scenario), run_in_python(scenario)):
        assert np.isfinite(log.measured_position[:10]).all()
        assert np.isnan(log.measured_position[10:]).all()
        assert np.isnan(log.estimate["position"][:10]).all()
        assert np.isfinite(log.estimate["position"][10:]).all()
        assert np.isfinite(log.readings["imu"]["rate"]).all()
    estimate = (
        skyarm.Batch(scenario, [], bit_exact=True, log_every=1)
        .fly({}, seed=scenario.seed)
        .log.estimate
    )
    assert np.isnan(estimate.position.x[0, :10]).all()
    assert np.array_equal(estimate.position.x[0, 10:], log.estimate["position"][10:, 0])


@pytest.mark.parametrize("kind", FORMATS)
def test_each_file_gives_them_back_to_the_bit(kind, tmp_path):
    log = flown()
    path = skyarm.save_log(log, tmp_path / f"sensing.{kind}")
    read = skyarm.load_log(path)
    assert read.arrays().keys() == log.arrays().keys()
    assert same(read, log)
    assert all(
        array.flags.c_contiguous and array.flags.writeable
        for array in read.arrays().values()
    )
    assert (
        skyarm.save_log(read, tmp_path / f"again.{kind}").read_bytes()
        == path.read_bytes()
    )
    assert columns(read) == columns(log)


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("count", [0, 1])
def test_short_logs_are_read_back(kind, count, tmp_path):
    short = skyarm.log.flight_log.rows_of(flown(), slice(0, count))
    assert same(
        skyarm.load_log(skyarm.save_log(short, tmp_path / f"short.{kind}")), short
    )


def test_columns_have_names_and_units_of_their_records(tmp_path):
    units = {each.name: each.unit for each in columns(flown())}
    assert (units["imu_rate_x"], units["imu_specific_force_z"]) == ("rad/s", "m/s^2")
    assert (units["encoders_joint_1"], units["encoders_joint_rate_2"]) == (
        "rad",
        "rad/s",
    )
    assert (units["estimate_quaternion_w"], units["estimate_rotor_speed_front"]) == (
        "",
        "rad/s",
    )
    assert {
        "altimeter_value",
        "camera_place_y",
        "camera_sharp",
        "fix_value_5",
        "compass_heading",
    } <= set(units)
    head = (
        skyarm.save_log(flown(), tmp_path / "sensing.csv")
        .read_text("utf-8")
        .split("\n", 1)[0]
    )
    assert ",imu_rate_x [rad/s]," in head
    assert np.array_equal(
        np.load(skyarm.save_log(flown(), tmp_path / "a.npz"))["readings.imu.rate"],
        flown()["readings.imu.rate"],
    )
    assert set(flown().units) == set(flown().arrays())
    assert (
        flown().units["readings.imu.rate"].words
        == "rad/s, angular velocity, axes of the inertial unit"
    )


def test_messages_are_those_of_ros_at_the_instants_at_which_readings_arrive(tmp_path):
    rosbags = pytest.importorskip("rosbags.highlevel", reason="needs the extra 'logs'")
    log = flown()
    for suffix in ("mcap",):
        path, found = skyarm.save_log(log, tmp_path / f"sensing.{suffix}"), {}
        with rosbags.AnyReader([path]) as reader:
            for connection, time, data in reader.messages():
                entry = found.setdefault(
                    connection.topic, (connection.msgtype.removesuffix("/"), [], [])
                )
                entry[1].append(time)
                entry[2].append(reader.deserialize(data, connection.msgtype))
        kinds = {
            topic: kind
            for topic, (kind, _, _) in found.items()
            if topic.startswith(("/sensors", "/estimate"))
        }
        assert kinds == {
            "/sensors/imu": "sensor_msgs/msg/Imu",
            "/sensors/mocap": "geometry_msgs/msg/PoseStamped",
            "/sensors/encoders": "sensor_msgs/msg/JointState",
            "/sensors/gps": "geometry_msgs/msg/PointStamped",
            "/sensors/compass": "skyarm_msgs/msg/Reading",
            "/sensors/wrist": "geometry_msgs/msg/WrenchStamped",
            "/sensors/finger": "skyarm_msgs/msg/Reading",
            "/sensors/fix": "skyarm_msgs/msg/Reading",
            "/sensors/altimeter": "skyarm_msgs/msg/Reading",
            "/sensors/camera": "skyarm_msgs/msg/Reading",
            "/estimate/base": "nav_msgs/msg/Odometry",
            "/estimate/joints": "sensor_msgs/msg/JointState",
        }
        for name, first, every in (
            ("imu", 0, 1),
            ("mocap", 2, 4),
            ("gps", 10, 10),
            ("camera", 3, 8),
            ("fix", 2, 10),
        ):
            wanted = np.rint(log.time[first::every] * 1e9)
            assert found[f"/sensors/{name}"][1] == wanted.tolist(), name
        _, times, pose = found["/sensors/mocap"]
        stamps = np.array(
            [each.header.stamp.sec + 1e-9 * each.header.stamp.nanosec for each in pose]
        )
        # as late as the sensor is
        np.testing.assert_allclose(1e-9 * np.array(times) - stamps, 0.01, atol=1e-8)
        x = [each.pose.position.x for each in pose]
        assert x == log.readings["mocap"]["position"][2::4, 0].tolist()
        assert {each.header.frame_id for each in pose} == {"world"}
        imu = found["/sensors/imu"][2]
        assert [each.angular_velocity.z for each in imu] == log.readings["imu"]["rate"][
            :, 2
        ].tolist()
        assert [each.linear_acceleration.z for each in imu] == log.readings["imu"][
            "specific_force"
        ][:, 2].tolist()
        assert {
            (each.header.frame_id, each.orientation_covariance[0]) for each in imu
        } == {("base_link", -1.0)}
        wrench = found["/sensors/wrist"][2]
        assert [each.wrench.force.x for each in wrench] == log.readings["wrist"][
            "force"
        ][:, 0].tolist()
        assert {each.header.frame_id for each in wrench} == {
            sensing().plant.vehicle.end_effector
        }
        camera = found["/sensors/camera"][2]
        assert camera[0].name == ["place_x", "place_y", "place_z", "sharp"]
        assert camera[1].value[3] == log.readings["camera"]["sharp"][11]
        estimate = found["/estimate/base"][2]
        assert len(estimate) == 60
        assert {(each.header.frame_id, each.child_frame_id) for each in estimate} == {
            ("world", "base_estimate")
        }
        q = log.estimate["quaternion"]
        wanted = (
            Rotation.from_quat(q[:, [1, 2, 3, 0]]).inv().apply(log.estimate["velocity"])
        )
        linear = [each.twist.twist.linear for each in estimate]
        assert (
            np.abs(np.array([[v.x, v.y, v.z] for v in linear]) - wanted).max() < 1e-12
        )
        joints = found["/estimate/joints"][2]
        assert np.array_equal(
            [each.position for each in joints], log.estimate["joints"]
        )


def test_a_sensor_that_reads_nothing_of_a_vehicle_has_no_messages(tmp_path):
    """Encoders without joints."""
    vehicle, base = (
        {"vehicle": "hummingbird"},
        {
            "kind": "hover",
            "position": [0.0, 0.0, 1.0],
        },
    )
    made = {
        "schema": 1,
        "name": "bare",
        "duration": 0.05,
        "plant": vehicle,
        "reference": {"base": base},
    }
    scenario = skyarm.scenario_from(
        made | {"controller": {"preset": "centroidal_joint"}}
    )
    named = NamedSensor(name="encoders", sensor=Encoders())
    log = skyarm.run(dataclasses.replace(scenario, sensors=(named,)))
    assert list(log.readings["encoders"]) == ["time"]
    assert log.measured_joints.shape == (10, 0)
    for suffix in ("mcap", "npz"):
        assert same(
            skyarm.load_log(skyarm.save_log(log, tmp_path / f"jointless.{suffix}")), log
        )


def test_the_pattern_of_messages_repeats_with_the_slowest_sensor():
    from skyarm.log.ros.topics import period_of

    assert period_of(flown()) == 40  # of 4, 8 and 10 control periods


DAMAGED = [
    3,
    {"estimate": 3},
    {"estimate": {"fields": 3}},
    {
        "estimate": {
            "fields": {"time": {"unit": 3}},
            "every": 1,
            "late": 0,
            "frame": None,
        }
    },
    {"estimate": {"fields": {}, "every": 0, "late": 0, "frame": None}},
    {
        "readings.imu": {
            "fields": {"rate": {"unit": "", "meaning": "", "axes": "xyz"}},
            "every": 1,
            "late": 0,
            "frame": None,
        }
    },
    {},
]


@pytest.mark.parametrize("described", sampled(DAMAGED, 3))
@pytest.mark.parametrize("kind", FORMATS)
def test_a_damaged_description_is_one_line(described, kind, tmp_path):
    log = flown()
    path = tmp_path / f"damaged.{kind}"
    with pytest.MonkeyPatch.context() as patch:
        module = "skyarm.log.formats"
        whole = json.dumps

        def dumps(data, **options):
            return whole(
                data | {"received": described} if "columns" in data else data, **options
            )

        patch.setattr(f"{module}.json.dumps", dumps)
        skyarm.save_log(log, path)
    with pytest.raises(
        ValueError, match=rf"^log = '.*damaged\.{kind}': must be a log of schema 1$"
    ):
        skyarm.load_log(path)


def test_logs_of_before_are_read(tmp_path):
    """A flight on a filter as it was written when its log had no readings."""
    log = flown()
    arrays = {name: array for name, array in log.arrays().items() if "." not in name}
    info = {name: value for name, value in log.info.items() if name != "received"}
    arrays |= {"measured_position": log.position, "measured_joints": log.joints}
    np.savez(tmp_path / "before.npz", **arrays, info=np.array(json.dumps(info)))
    read = skyarm.load_log(tmp_path / "before.npz")
    assert read.estimate == {}
    assert np.array_equal(read.measured_position, log.position)
