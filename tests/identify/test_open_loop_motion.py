"""The model's motion next to a simulated flight of the same vehicle: it lies on it, and
another vehicle's does not.
"""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

import skyarm
from skyarm.flight_data.flight_data import Channel
from skyarm.flight_data.own_log import measured_flight
from skyarm.identify.identified_file import read_surroundings
from skyarm.identify.identified_parts import IdentifiedSurroundings
from skyarm.identify.open_loop import OpenLoopFlight
from skyarm.log.motion import distance_between
from skyarm.scenario.scenario_record import Delays, Rates
from skyarm.studies.tune.excitation import of_vehicle, unseen_motion

DELAY = 0.006
ABOUT = IdentifiedSurroundings(delay=DELAY)


def vehicle():
    found = skyarm.load_vehicle("hummingbird_arm2_rotors")
    rotors = tuple(dataclasses.replace(each, inertia=2e-5) for each in found.rotors)
    drag = dataclasses.replace(found.drag, area=skyarm.algebra.Vec3(0.02, 0.03, 0.04))
    return dataclasses.replace(found, rotors=rotors, drag=drag)


def log_of(duration, **changes):
    """Flight of the vehicle on a path that begins away from the reference, so that
    everything swings.
    """
    plant = vehicle()
    base = of_vehicle(skyarm.load_vehicle("hummingbird_arm2_rotors"))
    return skyarm.run(
        dataclasses.replace(
            base,
            plant=dataclasses.replace(base.plant, vehicle=plant),
            rates=Rates(physics=1000, control=500, reference=50),
            reference=unseen_motion(plant),
            duration=duration,
            delays=Delays(command=DELAY),
            **changes,
        )
    )


@pytest.fixture(scope="module")
def flight():
    """Flight of a vehicle with an arm, without sensors: positions, attitudes and rates
    are the true ones.
    """
    return measured_flight(log_of(2.4), Path("swings.npz"))


@pytest.fixture(scope="module")
def followed(flight):
    return OpenLoopFlight(flight, vehicle(), ABOUT)


def errors(followed, found, motion):
    """Largest errors just before the motion is set back: m and rad."""
    times = np.append(found.begins[1:], found.model.time[-1]) - 1e-6
    return [
        each.max()
        for each in distance_between(motion.at(times), followed.measured.at(times))
    ]


def test_the_own_vehicle_lies_on_its_flight_and_goes_back_to_it(flight, followed):
    assert "accelerometer" not in flight, "no open loop uses it"
    assert flight.facts["command_delay"] == DELAY
    found = followed.over(0.5)
    np.testing.assert_allclose(np.diff(found.begins), 0.5, atol=0.01)
    # until half a second before the end, where the vehicle counts as landing
    assert found.model.time[-1] == pytest.approx(1.9, abs=0.03)
    position, attitude = errors(followed, found, found.model)
    held_position, held_attitude = errors(followed, found, found.held)
    assert position < 5e-3 * held_position
    assert attitude < 5e-3 * held_attitude
    begun = distance_between(
        found.model.at(found.begins), followed.measured.at(found.begins)
    )
    assert max(each.max() for each in begun) < 1e-6
    joints = (
        found.model.at(found.begins[:-1] + 0.2).joints
        - followed.measured.at(found.begins[:-1] + 0.2).joints
    )
    assert np.abs(joints).max() < 1e-3


def test_a_heavier_vehicle_a_later_one_and_other_gravity_leave_it(flight, followed):
    body = dataclasses.replace(vehicle().base, mass=1.1 * float(vehicle().base.mass))
    found = followed.over(0.1)
    true = errors(followed, found, found.model)
    for heavy, about, gravity in (
        (dataclasses.replace(vehicle(), base=body), ABOUT, 9.81),
        (vehicle(), IdentifiedSurroundings(delay=DELAY + 0.01), 9.81),
        (vehicle(), ABOUT, 9.6),
    ):
        other = OpenLoopFlight(flight, heavy, about, gravity=gravity)
        found = other.over(0.1)
        assert errors(other, found, found.model)[0] > 5.0 * true[0]


def test_without_velocities_those_of_the_positions_begin_a_prediction(flight, followed):
    channels = {
        name: each for name, each in flight.channels.items() if name != "velocity"
    }
    bare = OpenLoopFlight(
        dataclasses.replace(flight, channels=channels), vehicle(), ABOUT
    )
    found, full = bare.over(0.1), followed.over(0.1)
    times = full.begins[:-1] + 0.05
    assert distance_between(found.model.at(times), full.model.at(times))[0].max() < 2e-4


def test_commands_that_were_logged_seldom_do_not_set_the_step_of_the_integration(
    flight, followed
):
    told = flight["rotor_speed_commands"]
    seldom = dataclasses.replace(told, time=told.time[::25], values=told.values[::25])
    other = OpenLoopFlight(
        flight.with_channels({"rotor_speed_commands": seldom}), vehicle(), ABOUT
    )
    found, full = other.over(0.1), followed.over(0.1)
    assert np.median(np.diff(seldom.time)) == pytest.approx(0.05)
    assert np.median(np.diff(found.model.time)) < 1.5 * np.median(
        np.diff(full.model.time)
    )


def test_all_that_a_flight_lacks_is_one_line(flight):
    channels = {name: flight[name] for name in ("quaternion", "gyro", "rotor_speeds")}
    with pytest.raises(
        ValueError,
        match=r"^swings: must hold position and joint_positions and rotor_commands or ",
    ) as at:
        OpenLoopFlight(dataclasses.replace(flight, channels=channels), vehicle())
    assert str(at.value).endswith("there is quaternion, gyro, rotor_speeds")
    late = {
        name: dataclasses.replace(flight[name], time=flight[name].time + 9.0)
        for name in ("position", "quaternion")
    }
    with pytest.raises(
        ValueError, match="gyro: must be measured at the same time as position"
    ):
        OpenLoopFlight(flight.with_channels(late), vehicle())


def test_surroundings_of_an_identification_are_read_back(tmp_path):
    given = IdentifiedSurroundings(delay=0.012, torque=(1e-4, -2e-4, 0.0), sag=2.1)
    file = tmp_path / "identified.json"
    file.write_text(
        json.dumps(
            {
                "start": "x",
                "surroundings": dataclasses.asdict(given),
                "known": {"voltage": 4.2},
            }
        )
    )
    assert read_surroundings(file) == ("x_identified", given, 4.2)
    # the second flight of an identification without the battery's voltage has a thrust
    # of its own
    numbers = [
        {"name": "thrust.second", "value": 0.91},
        {"name": "thrust.third", "value": None},
    ]
    file.write_text(
        json.dumps(
            {
                "start": "x",
                "surroundings": {"delay": 0.012},
                "known": {},
                "numbers": numbers,
            }
        )
    )
    for flight, thrust in (("first", 1.0), ("second", 0.91), ("third", 1.0)):
        assert read_surroundings(file, flight)[1] == IdentifiedSurroundings(
            delay=0.012, thrust=thrust
        )
    for text, words in (
        ("{", "must be a JSON file"),
        ("[]", "must hold 'surroundings' and 'known'"),
        (
            '{"surroundings": {"torque": 1}, "known": {}}',
            r"surroundings.torque = 1: must be 3 numbers",
        ),
        ('{"surroundings": {"delay": "x"}, "known": {}}', r"surroundings.delay"),
        ('{"surroundings": {}, "known": {"voltage": -1}}', r"known.voltage"),
    ):
        file.write_text(text)
        with pytest.raises(ValueError, match=words):
            read_surroundings(file)


def test_commands_at_a_full_voltage_are_scaled_by_the_batterys(flight):
    volts = Channel(
        time=flight["gyro"].time,
        values=np.full((len(flight["gyro"].time), 1), 11.1),
        source="volts",
    )
    lower = OpenLoopFlight(
        flight.with_channels({"voltage": volts}),
        vehicle(),
        IdentifiedSurroundings(delay=DELAY, sag=2.0),
        full_voltage=12.0,
    )
    found = lower.over(0.2)
    times = found.begins[:-1] + 0.15
    fallen = found.model.at(times).position - lower.measured.at(times).position
    # thrust of 0.856 times the weight in hover
    assert fallen[:, 2].mean() == pytest.approx(
        -0.5 * (1.0 - (11.1 / 12.0) ** 2) * 9.81 * 0.15**2, rel=0.2
    )
