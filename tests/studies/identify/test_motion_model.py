"""Predictions from commands against the plant of the simulator, whose sensors have no noise."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import skyarm
from skyarm.algebra.frames import to_base
from skyarm.scenario.scenario_record import Delays, NamedSensor, Rates
from skyarm.sensing.channel import Channel as Errors
from skyarm.sensing.measurement import SensorNoise
from skyarm.sensing.sensor_kinds import Imu
from skyarm.studies.identify.identified_parts import Surroundings
from skyarm.studies.identify.motion_model import Memo, Stretch, predict, prediction_errors
from skyarm.studies.identify.sampled_series import position_differences
from skyarm.studies.tune.excitation import of_vehicle, unseen_motion

PERIOD, DELAY = 0.002, 0.006


def vehicle():
    found = skyarm.load_vehicle("hummingbird_arm2_rotors")
    rotors = tuple(dataclasses.replace(each, inertia=2e-5) for each in found.rotors)
    drag = dataclasses.replace(found.drag, area=skyarm.algebra.Vec3(0.02, 0.03, 0.04))
    return dataclasses.replace(found, rotors=rotors, drag=drag)


def stretch_of(log):
    v = to_base(log.quaternion, log.velocity)
    middle = 0.5 * (log.quaternion[1:] + log.quaternion[:-1])
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    felt = to_base(middle, np.diff(log.velocity, axis=0) / PERIOD + [0.0, 0.0, 9.81])
    if "readings.imu.specific_force" in log.received:
        sampled = log.received["readings.imu.specific_force"]
        felt = 0.5 * (sampled[1:] + sampled[:-1])
    return Stretch(
        name="flight",
        start=0.0,
        period=PERIOD,
        fine=1,
        commands=log.rotor_commands[:-1],
        rate=log.rate,
        specific_force=felt,
        joints=log.joints,
        joint_rates=log.joint_rates,
        efforts=log.efforts[:-1],
        velocity=0.5 * (v[1:] + v[:-1]),
        voltage=np.ones(len(v) - 1),
    )


def log_of(duration, **changes):
    """Flight of the vehicle on a path that begins away from the reference, so that everything swings."""
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
def flown():
    """Six seconds with a law that gets noisy states."""
    unit = NamedSensor(name="imu", sensor=Imu(gyro=Errors(), accelerometer=Errors()))
    return stretch_of(log_of(6.0, noise=SensorNoise(position=0.002, rate=0.02, joints=0.002), sensors=(unit,)))


ABOUT = Surroundings(delay=DELAY, joint_delay=DELAY)


LEFT = np.array([0.005, 0.06, 0.005, 0.005, 0.005, 0.005, 0.005, 0.005])
"""Of each row. Across the arm's plane there is little force, and an accelerometer at instants meets rotors that just
speed up; the model has their means.
"""

GIVEN = np.array([0.12, 0.06, 0.008, 0.005, 0.005, 0.005, 0.005])
"""The same where motion of joints is given: an accelerometer meets them just as they accelerate, the model as means."""


def left(stretch, about=ABOUT, changed=None, driven=(True, True)):
    """What the prediction leaves of the accelerations, over what there is of them; each row."""
    foretold = predict(changed or vehicle(), about, stretch, driven)
    moving = [i for i, each in enumerate(driven) if each]
    rates = np.concatenate([stretch.rate, stretch.joint_rates[:, moving]], axis=1)
    measured = np.concatenate([stretch.specific_force, np.diff(rates, axis=0) / PERIOD], axis=1)
    error, whole = (measured - foretold)[200:], measured[200:]
    return error.std(axis=0) / whole.std(axis=0)


def test_commands_foretell_what_the_plant_does(flown):
    """All that acts is there: rotors with lag, spin and drag, the arm, the airframe's drag, the dead time."""
    assert (left(flown) < LEFT).all()


@pytest.mark.parametrize(
    "changes",
    [
        {"inertia": 0.0},
        {"drag_coefficient": 0.0},
        {"time_constant_up": 0.02},
        {"moment_coefficient": 0.02},
    ],
)
def test_each_part_of_a_rotor_counts(flown, changes):
    plant = vehicle()
    other = dataclasses.replace(plant, rotors=tuple(dataclasses.replace(r, **changes) for r in plant.rotors))
    assert (left(flown, changed=other) > 1.2 * left(flown)).any()


def test_delays_count(flown):
    assert (left(flown, Surroundings(delay=DELAY + 0.002, joint_delay=DELAY)) > 1.2 * left(flown)).any()
    assert (left(flown, Surroundings(delay=DELAY, joint_delay=DELAY + 0.002))[6:] > 1.2 * left(flown)[6:]).any()


def test_joints_whose_motion_is_given_leave_the_rest_as_it_is(flown):
    """With the measured acceleration of the joints in place of their torques, the base does the same."""
    some, none = left(flown, driven=(True, False)), left(flown, driven=(False, False))
    assert len(some) == 7
    assert len(none) == 6
    assert (some < GIVEN).all()
    assert (none < GIVEN[:6]).all()


def test_an_accelerometer_meets_the_torques_of_its_instants(flown):
    """To 0.1 % along the arm's plane; means of the periods are 9 % off there."""
    assert (left(flown)[[0, 2]] < 0.001).all()


@pytest.mark.parametrize("driven", [(), (True,), (True, True, True)])
def test_another_number_of_driven_joints_is_refused(flown, driven):
    with pytest.raises(ValueError, match=f"^driven: {len(driven)} joints, vehicle '{vehicle().name}' has 2$"):
        predict(vehicle(), ABOUT, flown, driven)


def test_rates_by_differences_of_positions_are_foretold(flown):
    """What differences and a moving mean make of the joints' rates: to 2 %, in place of 5 % and more."""
    rates = position_differences(flown.joints) / PERIOD
    made = dataclasses.replace(flown, joint_rates=rates)
    assert (left(dataclasses.replace(made, differenced=True))[6:] < 0.02).all()
    assert (left(made)[6:] > 0.05).all()


def test_sensors_have_a_place_an_offset_and_a_delay(flown):
    """Of a rigid body: a + dw/dt x r + w x (w x r)."""
    plain = predict(vehicle(), ABOUT, flown, (True, True))
    place = np.array([0.05, -0.02, 0.03])
    moved = dataclasses.replace(ABOUT, place=tuple(place), offset=(0.1, 0.2, 0.3))
    w = 0.5 * (flown.rate[1:] + flown.rate[:-1])
    wanted = plain[:, :3] + np.cross(plain[:, 3:6], place) + np.cross(w, np.cross(w, place)) + [0.1, 0.2, 0.3]
    # forces at instants in place of means: a little beside
    assert predict(vehicle(), moved, flown, (True, True))[:, :3] == pytest.approx(wanted, abs=0.03)
    late = predict(vehicle(), dataclasses.replace(ABOUT, accelerometer_delay=2 * PERIOD), flown, (True, True))
    assert late[2:, :3] == pytest.approx(plain[:-2, :3])
    assert late[:, 3:] == pytest.approx(plain[:, 3:])


def test_voltage_and_time_scale_the_thrust(flown):
    full = predict(vehicle(), ABOUT, flown, (True, True))[:, 2]
    low = dataclasses.replace(flown, voltage=np.full(flown.size, 0.9))
    sagged = predict(vehicle(), dataclasses.replace(ABOUT, sag=2.0), low, (True, True))[:, 2]
    assert sagged.mean() == pytest.approx(0.81 * full.mean(), rel=0.01)
    fading = predict(vehicle(), dataclasses.replace(ABOUT, drift=-0.01), flown, (True, True))[:, 2]
    assert fading[-100:].mean() == pytest.approx((1 - 0.01 * flown.seconds) * full[-100:].mean(), rel=0.01)


def test_rates_are_summed_up(flown):
    """White noise of a gyroscope is white in the errors."""
    errors = prediction_errors(vehicle(), ABOUT, flown, (True, True))
    foretold = predict(vehicle(), ABOUT, flown, (True, True))
    steps = np.diff(flown.rate, axis=0) - foretold[:, 3:6] * PERIOD
    assert np.diff(errors[:, 3:6], axis=0) == pytest.approx(steps[1:])
    assert errors[:, 3:].mean(axis=0) == pytest.approx(0.0, abs=1e-12)


def test_a_memo_changes_nothing(flown):
    memo, plant = Memo(), vehicle()
    for delay in (DELAY, 0.004, DELAY):
        about = dataclasses.replace(ABOUT, delay=delay)
        slow = tuple(dataclasses.replace(rotor, time_constant_up=0.02) for rotor in plant.rotors)
        for other in (plant, dataclasses.replace(plant, rotors=slow)):
            kept = prediction_errors(other, about, flown, (True, True), memo)
            assert np.array_equal(kept, prediction_errors(other, about, flown, (True, True)))


def test_the_middle_of_a_swing_is_found_between_means_of_its_samples():
    """Of 2 Hz at 100 Hz, moving means of three samples; halves of the ends are 0.3 % below."""
    time = 0.005 * np.arange(402)
    swing = np.sin(4.0 * np.pi * time)
    means = np.convolve(swing, np.ones(3) / 3.0, "valid")[::2, None]
    size = len(means) - 1
    empty = np.zeros((size, 0))
    stretch = Stretch(
        name="swing",
        start=0.005,
        period=0.01,
        samples=2,
        fine=2,
        width=3,
        commands=empty,
        rate=np.zeros((size + 1, 3)),
        specific_force=np.zeros((size, 3)),
        joints=means,
        joint_rates=means,
        efforts=empty,
        velocity=np.zeros((size, 3)),
        voltage=np.ones(size),
    )
    truth = np.sin(4.0 * np.pi * (0.01 + 0.01 * np.arange(size)))
    inside = slice(1, -1)
    assert np.abs(stretch.at_middles(means, slice(None))[:, 0] - truth)[inside].max() < 2e-4
    assert np.abs(0.5 * (means[1:, 0] + means[:-1, 0]) - truth)[inside].max() > 2e-3
    some = np.array([5, 0, size - 1])
    assert np.array_equal(stretch.at_middles(means, some), stretch.at_middles(means, slice(None))[some])
