"""Logs of simulated flights as measured ones."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.flight_data.flight_data import PLACE, Channel, FlightData, load_flight
from skyarm.flight_data.own_log import measured_flight
from skyarm.identify.identify_files import _place
from skyarm.log.flight_log import rows_of
from skyarm.log.ros.message_bytes import decode
from skyarm.log.ros.topics import FlightTopics
from skyarm.simulate import Log, run
from support.flights import estimated
from support.logs import flown


@cache
def sensed() -> Log:
    """A flight with an inertial unit, a motion capture of 10 ms delay, and encoders,
    without noise.
    """
    of = {
        "imu": ("gyro", "accelerometer"),
        "mocap": ("position", "attitude"),
        "encoders": ("joints",),
    }
    quiet = {
        f"sensors__{sensor}__{name}": {"sigma": 0.0}
        for sensor, names in of.items()
        for name in names
    }
    return run(estimated(sensors__mocap__frequency=100.0, **quiet))


@pytest.mark.parametrize("kind", ["npz", "mcap"])
def test_readings_are_the_true_state_at_the_times_at_which_they_were_taken(
    kind: str, tmp_path: Path
) -> None:
    log = sensed()
    flight = load_flight(skyarm.save_log(log, tmp_path / f"flight.{kind}"))
    assert flight["gyro"].source == "readings.imu.rate"
    assert flight["position"].source == "readings.mocap.position"
    assert flight["position"].rate == pytest.approx(100.0)
    rows = np.rint(flight["position"].time * 200).astype(int)
    np.testing.assert_allclose(flight["position"].time, rows / 200, atol=1e-12)
    np.testing.assert_allclose(
        flight["position"].values, log.position[rows], atol=1e-12
    )
    turns = np.abs(np.sum(flight["quaternion"].values * log.quaternion[rows], axis=1))
    np.testing.assert_allclose(turns, 1.0, atol=1e-12)
    rows = np.rint(flight["joint_positions"].time * 200).astype(int)
    np.testing.assert_allclose(
        flight["joint_positions"].values, log.joints[rows], atol=np.pi / 2**12
    )
    np.testing.assert_allclose(flight["gyro"].values[-1], log.rate[-1], atol=1e-12)
    assert flight["accelerometer"].values.shape == flight["gyro"].values.shape
    assert flight.notes == (
        "velocity: are true values, as no sensor of the flight reads them.",
    )


def test_a_reading_that_arrives_late_has_the_time_at_which_it_was_taken(
    tmp_path: Path,
) -> None:
    quiet = {
        f"sensors__imu__{name}": {"sigma": 0.0} for name in ("gyro", "accelerometer")
    }
    log = run(estimated(duration=0.5, sensors__imu__latency=0.01, **quiet))
    gyro = load_flight(skyarm.save_log(log, tmp_path / "flight.npz"))["gyro"]
    assert gyro.time.size == log.time.size - 2
    np.testing.assert_allclose(
        gyro.values, log.rate[np.rint(gyro.time * 200).astype(int)], atol=1e-12
    )


def test_an_inertial_unit_beside_the_origin_is_read_in_base_axes_with_its_place(
    tmp_path: Path,
) -> None:
    mount = {"position": [0.1, -0.05, 0.02], "rpy": [0.3, -0.2, 2.5]}
    quiet = {
        f"sensors__imu__{name}": {"sigma": 0.0} for name in ("gyro", "accelerometer")
    }
    log = run(
        estimated(
            duration=0.3,
            **quiet,
            **{f"sensors__imu__{name}": value for name, value in mount.items()},
        )
    )
    flight = load_flight(skyarm.save_log(log, tmp_path / "flight.npz"))
    np.testing.assert_allclose(flight["gyro"].values, log.rate, atol=1e-12)
    R = Rotation.from_euler("ZYX", mount["rpy"][::-1])
    read = R.apply(log.readings["imu"]["specific_force"])
    np.testing.assert_allclose(flight["accelerometer"].values, read, atol=1e-12)
    assert [*flight.place.values()] == mount["position"]
    # the topics of ROS have the frame, and the fixed transforms lead from it to the
    # base
    topics = FlightTopics(log)
    found = {
        each.name: decode(
            each.kind, topics.definitions, topics.encode(each, log)[1][0].tobytes()
        )
        for each in topics.topics
        if each.name in ("/sensors/imu", "/tf_static")
    }
    assert found["/sensors/imu"]["header"]["frame_id"] == "imu_link"
    assert found["/sensors/imu"]["orientation_covariance"][0] == -1.0
    (at,) = (
        each
        for each in found["/tf_static"]["transforms"]
        if each["child_frame_id"] == "imu_link"
    )
    assert at["header"]["frame_id"] == "base_link"
    assert [*at["transform"]["translation"].values()] == mount["position"]
    turn = Rotation.from_quat([at["transform"]["rotation"][axis] for axis in "xyzw"])
    np.testing.assert_allclose(turn.as_matrix(), R.as_matrix(), atol=1e-12)


def test_the_place_that_flights_state_is_known_unless_another_is_given() -> None:
    gyro = Channel(time=np.arange(3.0), values=np.zeros((3, 3)), source="x")
    facts = {
        name: dict(zip(PLACE, place, strict=True))
        for name, place in (("a", (0.1, 0.0, 0.0)), ("b", (0.2, 0.0, 0.0)))
    }
    a, b = (
        FlightData(name=name, file=name, channels={"gyro": gyro}, facts=each)
        for name, each in facts.items()
    )
    assert _place([a, a], {}) == a.place
    assert _place([FlightData(name="c", file="c", channels={"gyro": gyro})], {}) == {}
    with pytest.raises(
        ValueError,
        match=r"--known place.x, .y, .z: are missing: .* a \[0.1, 0.0, 0.0\], b \[0.2",
    ):
        _place([a, b], {})
    assert _place([a, a], {"place.x": 0.15}) == {"place.y": 0.0, "place.z": 0.0}
    assert _place([a, b], dict.fromkeys(PLACE, 0.15)) == {}


def test_without_sensors_the_true_state_is_read_and_said_to_be_true(
    tmp_path: Path,
) -> None:
    log = flown()
    flight = load_flight(skyarm.save_log(log, tmp_path / "flight.npz"))
    assert "accelerometer" not in flight
    np.testing.assert_array_equal(flight["gyro"].values, log.rate)
    np.testing.assert_array_equal(
        flight["rotor_speed_commands"].values, log.rotor_commands
    )
    np.testing.assert_array_equal(flight["joint_efforts"].values, log.efforts)
    assert "are true values" in flight.notes[0]


def test_a_part_of_a_log_says_when_it_starts_and_what_the_plant_felt() -> None:
    log = flown()
    late = measured_flight(rows_of(log, slice(10, None)), Path("folder/late.npz"))
    assert late.facts["start"] == log.time[10] > 0.0
    assert late.facts["gravity"] == late.gravity == log.info["plant_gravity"]
    assert (late.name, late.file) == ("late", str(Path("folder/late.npz")))
    np.testing.assert_array_equal(late["gyro"].time, log.time[10:])
    none = measured_flight(rows_of(log, slice(0, 0)), Path("none.npz"))
    assert (none.facts["start"], dict(none.channels)) == (0.0, {})


def test_a_mapping_is_refused_and_one_beside_the_log_is_for_other_files(
    tmp_path: Path,
) -> None:
    path = skyarm.save_log(flown(), tmp_path / "flight.npz")
    (tmp_path / "columns.toml").write_text('[gyro]\ncolumns = ["a", "b", "c"]\n')
    assert "gyro" in load_flight(path)
    with pytest.raises(
        ValueError, match=r"columns.toml: must be left out for a log of skyarm"
    ):
        load_flight(path, tmp_path / "columns.toml")
    (tmp_path / "bad.npz").write_bytes(path.read_bytes()[:-100])
    with pytest.raises(ValueError, match=r"must be a log that save_npz wrote") as error:
        load_flight(tmp_path / "bad.npz")
    assert "\n" not in str(error.value)


def test_a_log_of_several_vehicles_is_refused_by_their_names_and_with_a_cure() -> None:
    team: Any = SimpleNamespace(agents={"left": None, "right": None})
    words = re.escape(
        "vehicles = left, right: must be one; the log of one is written by: skyarm"
        " export "
    )
    with pytest.raises(ValueError, match=f"^{words}LOG --vehicle left -o NEW.npz$"):
        measured_flight(team, Path("team.npz"))
