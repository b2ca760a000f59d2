"""Delays and lags that were planted are found again, with honest intervals; a flight that cannot tell says so."""

from __future__ import annotations

import dataclasses
import tomllib

import numpy as np
import pytest

import skyarm
from planted_lags import lagging_drives, with_slower_motors
from skyarm.algebra.frames import to_base
from skyarm.scenario.scenario_record import first_state
from skyarm.studies.identify.lagged_inputs import Needed, model_forces, wrench_of_pushes
from skyarm.studies.identify.loop_lags import (
    Estimated,
    LoopLags,
    joint_lag,
    lag_tables,
    loop_lags,
    rotor_lag,
)
from skyarm.studies.identify.rotor_lag import lag_response
from skyarm.studies.tune.excitation import of_vehicle, tuning_flight

pytest.importorskip("scipy", reason="needs the extra 'identify'")

PERIOD = 0.005
VEHICLE = skyarm.load_vehicle("hummingbird_arm2_rotors")
DELAY, SLOWER, DRIVE = 0.012, 1.5, 0.02
"""s; of the motors over what is believed; s, of the joints' drives."""


@pytest.fixture(scope="module")
def flown():
    """Two noisy seconds of a vehicle whose commands are late and whose motors and drives are slow."""
    base = tuning_flight(of_vehicle(VEHICLE, "paper_ct"))
    plant = dataclasses.replace(base.plant, vehicle=with_slower_motors(VEHICLE, SLOWER))
    delays = skyarm.Delays(measurement=PERIOD, command=DELAY)
    return skyarm.run(
        dataclasses.replace(base, duration=2.0, plant=plant, drives=lagging_drives(VEHICLE, DRIVE), delays=delays)
    )


@pytest.fixture(scope="module")
def found(flown):
    return loop_lags(flown, VEHICLE)


def near(estimated: Estimated, truth: float, within: float) -> bool:
    return abs(estimated.value - truth) <= within


def test_what_was_planted_in_a_flight_is_found(found):
    """1.5 ms of the delay's 12, 8 % of the time constants: three times what 20 flights were off (docs)."""
    rotors, believed = found.rotors, VEHICLE.rotors[0]
    assert rotors.is_known
    assert near(rotors.delay, DELAY, 0.0015)
    assert rotors.factor == pytest.approx((SLOWER, SLOWER), rel=0.08)
    assert near(rotors.up, SLOWER * believed.time_constant_up, 0.0015)
    # in between, the rates count: the mean that a small swing meets
    rate = 0.5 / rotors.up.value + 0.5 / rotors.down.value
    assert rotors.together.value == pytest.approx(rotors.delay.value + 1.0 / rate)
    assert rotors.explained > 0.9
    # no interval is narrower than what sampling leaves
    assert all(each.high - each.value > 0.1 * PERIOD for each in (rotors.together, rotors.delay, rotors.up))
    for joint in found.joints:
        assert joint.is_known
        assert near(joint.together, DELAY + DRIVE, 0.0015)


def test_the_lines_to_paste_fly_the_scenario_that_was_found(found):
    text = lag_tables(found, measured=0.005)
    tables = tomllib.loads(text)
    assert tables["delays"]["command"] == pytest.approx(DELAY, abs=0.0015)
    # 12 ms and the age of 5 ms, in whole control periods
    assert ("# controller.delay = 0.015\n" in text, "# controller.delay_periods = 3\n" in text) == (True, True)
    document = {
        "schema": 1,
        "name": "found",
        "duration": 0.1,
        "plant": {"vehicle": "hummingbird_arm2_rotors", **tables["plant"]},
        "controller": {"law": "centroidal", "mode": "tip", "preset": "robust", "delay": 0.015},
        "delays": tables["delays"],
        "reference": {"base": {"kind": "hover", "position": [0.0, 0.0, 1.0]}, "joints": [0.0, 0.0]},
    }
    scenario = skyarm.scenario_from(document)
    assert [each.drive.time_constant for each in scenario.drives] == pytest.approx([DRIVE, DRIVE], rel=0.15)
    assert "time_constant_up" in text
    # a lag that is none asks for no drive
    prompt = Estimated(value=5e-4, low=1e-4, high=2e-3)
    joints = tuple(dataclasses.replace(each, up=prompt, down=prompt, apart=True) for each in found.joints)
    assert "[plant.drives" in text
    assert "[plant.drives" not in lag_tables(dataclasses.replace(found, joints=joints))


def test_a_log_that_cannot_tell_says_so(flown, found):
    still = dataclasses.replace(flown, rotor_commands=np.full_like(flown.rotor_commands, 500.0))
    motion = model_forces(VEHICLE, flown, 9.81)
    assert rotor_lag(VEHICLE, still, motion).reason == "the commands hardly change"
    # commands of another flight: nothing of the motion follows them
    rng = np.random.default_rng(3)
    other = 500.0 + 20.0 * rng.standard_normal(flown.rotor_commands.shape)
    strange = rotor_lag(VEHICLE, dataclasses.replace(flown, rotor_commands=other), motion)
    assert not strange.is_known
    assert strange.explained < 0.5
    nothing = LoopLags(period=PERIOD, seconds=2.0, rotors=strange, joints=(), left_out={})
    assert lag_tables(nothing) == ""


def test_a_planted_delay_is_that_of_a_cross_correlation():
    """An independent oracle: where the cross-correlation of a white command with what came of it is largest."""
    late = 0.0225
    from scipy.signal import correlate, correlation_lags

    rng = np.random.default_rng(5)
    torque = rng.standard_normal((401, 1))
    whole, rest = divmod(round(late / 1e-4), round(PERIOD / 1e-4))
    share = rest * 1e-4 / PERIOD
    held = np.concatenate([np.repeat(torque[:1], whole + 1, axis=0), torque])[: len(torque) + 1]
    came = share * held[:-2] + (1.0 - share) * held[1:-1]
    # noise of the rates, and a disturbance that wanders off
    noisy = (
        came
        + np.diff(0.05 * rng.standard_normal((401, 1)), axis=0)
        + 0.1 * np.cumsum(rng.standard_normal((400, 1)), axis=0)
    )
    correlation = correlate(noisy[:, 0] - noisy.mean(), torque[:-1, 0] - torque.mean())
    peak = correlation_lags(len(noisy), len(torque) - 1)[np.argmax(correlation)] * PERIOD
    assert peak == pytest.approx(late, abs=0.51 * PERIOD)
    time = PERIOD * np.arange(401)
    log = type("Log", (), {"efforts": torque, "time": time})()
    motion = Needed(PERIOD, np.zeros((400, 6)), noisy, rng.standard_normal((400, 1)))
    found = joint_lag("elbow", log, motion, 0)
    assert found.is_known
    assert near(found.together, late, 0.001)
    assert found.together.low <= late <= found.together.high


def test_means_of_a_lag_are_those_of_small_steps():
    """The closed form against Euler's method in steps of 10 us; two stretches and their joint among the periods."""
    rng = np.random.default_rng(0)
    commands = 500.0 + 100.0 * rng.standard_normal((121, 1))
    delay, up, down, step = 0.0122, 0.01, 0.03, 1e-5
    candidates = np.array([0.0, delay]), np.array([[0.02], [up]]), np.array([[down]])
    got = lag_response(commands[:-1], PERIOD, *candidates)[1][1, :, 0]
    value, squares = commands[0, 0], np.zeros(120)
    per = round(PERIOD / step)
    for k in range(120 * per):
        now = commands[max(0, int(np.floor((k + 0.5) * step / PERIOD - delay / PERIOD))), 0]
        before = value
        value += step * (now - value) / (up if now > value else down)
        squares[k // per] += 0.5 * (before**2 + value**2) / per
    assert got == pytest.approx(squares, rel=1e-3)


def test_the_wrench_of_a_hover_holds_the_vehicle(flown):
    """Forces by motion and by rotors are the same in a hover, whatever the attitude's sign."""
    state = first_state(of_vehicle(VEHICLE, "paper_ct"))
    wrench = wrench_of_pushes(VEHICLE.rotors) @ np.array([float(w) ** 2 for w in state.rotor_speeds])
    assert wrench[2] == pytest.approx(VEHICLE.mass * 9.81, rel=0.02)
    half = np.sqrt(0.5)
    turned = to_base(np.array([[half, half, 0.0, 0.0]]), np.array([[0.0, 0.0, 1.0]]))
    # rolled by a right angle, the body's y looks up
    assert turned[0] == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (lambda log: {"rotor_commands": log.rotor_commands[:, :3]}, "rotor_commands: the log has 3"),
        (lambda log: {"joints": log.joints[:, :1]}, "joints: the log has 1"),
        (lambda log: {"time": log.time**2}, "time: must be evenly spaced"),
        (lambda log: {"time": 0.1 * log.time}, "s are too short"),
        (lambda log: {"rate": log.rate * np.nan}, "rate: must be finite"),
        (lambda log: {"efforts": log.efforts * np.nan}, "efforts: must be finite"),
        (lambda log: {"quaternion": log.quaternion * 0.0}, "quaternion: must be of unit length"),
    ],
)
def test_a_log_that_does_not_fit_is_refused_in_a_line(flown, changed, message):
    with pytest.raises(ValueError, match=message):
        loop_lags(dataclasses.replace(flown, **changed(flown)), VEHICLE)
