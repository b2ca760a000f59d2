"""Betaflight in the loop: settings and signs by hand, flights and failures with a
stand-in, and the real program.
"""

from __future__ import annotations

import dataclasses
import fcntl
import math
import os
import re
import shutil
import signal
import socket
import stat
import struct
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from skyarm.control.controller import ControllerError
from skyarm.dynamics.actuators.rotor import push
from skyarm.links.autopilots import betaflight, betaflight_process
from skyarm.links.autopilots.angle_control import AttitudeCommand
from skyarm.links.autopilots.autopilot import BaseGoal, LinkError
from skyarm.links.autopilots.betaflight import make_betaflight
from skyarm.links.autopilots.betaflight_process import GUARDED_PORTS
from skyarm.links.autopilots.betaflight_settings import (
    MOTORS,
    STATE,
    Sticks,
    console_lines,
    hover_slope,
    mixer,
    shares,
    state_message,
    vehicle_loops,
)
from skyarm.links.autopilots.effectiveness import inertias
from skyarm.links.autopilots.flight import planned_scenario
from skyarm.links.transcript import Tape
from skyarm.log.flight_log import Log
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.simulate.session import open_session
from skyarm.vehicle.vehicle_files import load_vehicle

GRAVITY = 9.8
VEHICLES = (
    "hummingbird_arm2_rotors",
    "pelican_arm2",
    "hexarotor_arm6",
    "crazyflie_arm1",
    "quadrotor_roll_arm2",
)
STAND_IN = Path(__file__).with_name("betaflight_stand_in.py")


def settings(vehicle) -> dict[str, float]:
    rows = [line.split() for line in console_lines(vehicle, GRAVITY, {})]
    return {
        row[1]: float(row[3])
        for row in rows
        if row[0] == "set" and row[3].replace(".", "").isdigit()
    }


def test_mixer_of_an_x_quadrotor_has_betaflights_own_signs():
    # Betaflight's quad X: right motors -1 in roll, rear motors +1 in pitch, and yaw -1
    # for clockwise ones
    vehicle = load_vehicle("crazyflie_arm1")
    for rotor, (throttle, roll, pitch, yaw) in zip(
        vehicle.rotors, mixer(vehicle), strict=True
    ):
        x, y, _ = (float(c) for c in rotor.position)
        assert throttle == pytest.approx(1.0, abs=0.2)
        assert (math.copysign(1, roll), math.copysign(1, pitch)) == (
            math.copysign(1, y),
            math.copysign(1, -x),
        )
        assert math.copysign(1, yaw) == float(rotor.direction)


@pytest.mark.parametrize("name", VEHICLES)
def test_columns_of_the_mixer_turn_about_one_axis_each(name):
    vehicle = load_vehicle(name)
    made = shares(vehicle) @ mixer(vehicle)
    sized = made / np.abs(np.diag(made))
    np.testing.assert_allclose(sized, np.diag([1.0, 1.0, 1.0, -1.0]), atol=1e-9)


@pytest.mark.parametrize("name", VEHICLES)
def test_limp_and_locked_inertia_by_adding_up_bodies(name):
    vehicle = load_vehicle(name)
    limp, locked = inertias(vehicle)
    assert (limp <= locked * (1.0 + 1e-9)).all()
    # hanging rods and a point, about the common centre of mass, by hand
    if name == "hummingbird_arm2_rotors":
        base = vehicle.base
        masses = [float(base.mass), 0.04, 0.04, 0.01]
        heights = [float(base.com.z), -0.075, -0.225, -0.3]
        middle = sum(m * z for m, z in zip(masses, heights, strict=True)) / sum(masses)
        pitch = (
            sum(m * (z - middle) ** 2 for m, z in zip(masses, heights, strict=True))
            + 2 * 7.5e-5
        )
        assert locked[1] == pytest.approx(pitch + 0.0077174, rel=2e-3)


@pytest.mark.parametrize("name", VEHICLES)
def test_gains_give_the_bandwidth_by_betaflights_units(name):
    vehicle = load_vehicle(name)
    mix, _ = vehicle_loops(vehicle, GRAVITY)
    gains = settings(vehicle)
    linear, idle = gains["thrust_linear"] / 100.0, gains["motor_idle"] / 1e4

    def thrusts(mixes):
        outputs = [
            idle + (1 - idle) * min(max(m * (1 + linear * (1 - m) ** 2), 0.0), 1.0)
            for m in mixes
        ]
        rows = zip(vehicle.rotors, outputs, strict=True)
        return np.array(
            [float(r.thrust_coefficient * push(r, r.max_speed * u)) for r, u in rows]
        )

    hover = brentq(
        lambda t: thrusts(t * mix[:, 0]).sum() - float(vehicle.mass) * GRAVITY,
        0.01,
        1.0,
    )
    limp, locked = inertias(vehicle)
    for i, axis in enumerate(("roll", "pitch", "yaw")):
        # deg/s of a body that turns 0.02 rad/s too slowly
        error = 0.02 * 180.0 / math.pi
        signal = 0.032029 * gains[f"p_{axis}"] * error / 1000.0
        sign = -1.0 if axis == "yaw" else 1.0
        change = thrusts(hover * mix[:, 0] + sign * signal * mix[:, i + 1]) - thrusts(
            hover * mix[:, 0]
        )
        acceleration = (shares(vehicle) @ change)[i + 1] / math.sqrt(
            limp[i] * locked[i]
        )
        slowest = max(float(rotor.time_constant_up) for rotor in vehicle.rotors)
        wanted = min(8.0 if axis == "yaw" else 32.0, 0.4 / slowest)
        # whole numbers of gains, down to 7, and the curve over the step
        assert acceleration / 0.02 == pytest.approx(wanted, rel=0.1)
        # integral over proportional gain, 1/s: a share of the bandwidth with locked
        # joints; yaw's is scaled by 2.5
        slow = wanted * math.sqrt(limp[i] / locked[i])
        ratio = (
            0.244381
            * gains[f"i_{axis}"]
            * (2.5 if axis == "yaw" else 1.0)
            / (0.032029 * gains[f"p_{axis}"])
        )
        limited = gains[f"i_{axis}"] == 250.0
        # both rounded
        assert (
            ratio == pytest.approx(slow / (4.0 if axis == "yaw" else 3.0), rel=0.15)
            or limited
        )
    assert min(gains.values()) >= 0.0


def test_state_is_forward_right_down_with_the_accelerometer_turned_round():
    turn = Rotation.from_euler("ZYX", (0.5, 0.2, -0.3))
    x, y, z, w = turn.as_quat()
    message = state_message(
        2.0,
        (0, 0.1, 0.2, 0.3, 1.0, 2.0, 9.0),
        (0, 4.0, 5.0, 6.0, w, x, y, z),
        (0.7, 0.8, 0.9),
    )
    seconds, *rest = STATE.unpack(message)
    assert len(message) == 144
    assert seconds == 2.0
    np.testing.assert_allclose(rest[:6], [0.1, -0.2, -0.3, -1.0, -2.0, -9.0])
    flip = np.diag([1.0, -1.0, -1.0])
    told = Rotation.from_quat([*rest[7:10], rest[6]]).as_matrix()
    np.testing.assert_allclose(told, flip @ turn.as_matrix() @ flip, atol=1e-12)
    np.testing.assert_allclose(rest[10:16], [0.7, -0.8, -0.9, 4.0, -5.0, -6.0])
    assert rest[16] == pytest.approx(101325.0 - 12.0 * 6.0)  # Pa, 12 a metre


def test_sticks_at_their_ends_are_the_limits_of_the_settings():
    vehicle = load_vehicle("pelican_arm2")
    numbers = settings(vehicle)
    sticks = Sticks(vehicle, GRAVITY)
    most = AttitudeCommand(
        math.radians(numbers["angle_limit"]),
        0.0,
        -math.radians(10.0 * numbers["yaw_rc_rate"]),
        1e3,
    )
    assert sticks.channels(most) == (2000, 1500, 2000, 2000)
    assert sticks.channels(
        AttitudeCommand(0.99 * most.roll, 0.0, 0.99 * most.yaw_rate, 0.0)
    ) == (
        1995,
        1500,
        1050,
        1995,
    )
    assert sticks.channels(AttitudeCommand(-9.0, -9.0, 9.0, 0.0)) == (
        1000,
        1000,
        1050,
        1000,
    )


def test_the_slope_of_the_thrust_in_hover_is_its_derivative():
    """Signal 0.03 + 0.97 m (1 + 1.5 (1 - m)^2) of the mixed throttle m, thrust with its
    square; a step of 0.02.
    """
    vehicle = load_vehicle("hummingbird_arm2_rotors")
    most = [
        float(r.thrust_coefficient * r.max_speed * r.max_speed) for r in vehicle.rotors
    ]
    signal = np.polynomial.Polynomial([0.03]) + 0.97 * np.polynomial.Polynomial(
        [0.0, 2.5, -3.0, 1.5]
    )
    curve = signal**2
    share = mixer(vehicle)[:, 0]
    weight = float(vehicle.mass) * GRAVITY
    hover = brentq(
        lambda m: (
            sum(f * curve(m * s) for f, s in zip(most, share, strict=True)) - weight
        ),
        0.0,
        1.0,
    )
    expected = [f * curve.deriv()(hover * s) for f, s in zip(most, share, strict=True)]
    np.testing.assert_allclose(hover_slope(vehicle, GRAVITY), expected, rtol=2e-3)


@pytest.mark.parametrize("name", VEHICLES)
def test_throttle_stick_gives_the_thrust_through_betaflights_curve(name):
    vehicle = load_vehicle(name)
    mass = float(vehicle.mass)
    roll, pitch, stick, yaw = Sticks(vehicle, GRAVITY).channels(
        AttitudeCommand(0.1, -0.05, 0.3, GRAVITY)
    )
    assert (roll, pitch, yaw) == (
        round(1500 + 500 * math.degrees(0.1) / 30),
        round(1500 - 500 * math.degrees(0.05) / 30),
        round(1500 - 500 * math.degrees(0.3) / 120),
    )
    linear, throttle = 1.5, (stick - 1050) / 950
    throttle /= 1 + (linear - 0.5 * linear**2) * (1 - throttle) ** 2
    total = 0.0
    for rotor, share in zip(vehicle.rotors, mixer(vehicle)[:, 0], strict=True):
        mix = share * throttle
        signal = 0.03 + 0.97 * mix * (1 + linear * (1 - mix) ** 2)
        total += float(rotor.thrust_coefficient * push(rotor, signal * rotor.max_speed))
    assert total == pytest.approx(mass * GRAVITY, rel=0.005)  # a step of the stick


def test_too_many_rotors_too_little_thrust_and_wrong_parameters_are_one_line():
    octo = load_vehicle("hummingbird_arm2_rotors")
    with pytest.raises(
        ScenarioError, match=r"full thrust must be at least 1.1 times the weight"
    ):
        vehicle_loops(octo, 40.0)
    with pytest.raises(ControllerError, match="must be a number up to"):
        make_betaflight(
            load_scenario("hover_swing").controller.par.model,
            parameters={"p_roll": "much"},
        )
    with pytest.raises(ControllerError, match="at most 40 letters"):
        make_betaflight(
            load_scenario("hover_swing").controller.par.model, parameters={"p" * 41: 1}
        )


def test_missing_program_names_the_extra(monkeypatch):
    monkeypatch.delenv("SKYARM_BETAFLIGHT", raising=False)
    monkeypatch.setattr(betaflight_process, "usual_program", lambda: "")
    with pytest.raises(
        ScenarioError,
        match=r"^autopilot: Betaflight's program is missing; .*skyarm\[betaflight\]",
    ):
        open_session(load_scenario("hover_swing", controller="betaflight"))


@pytest.fixture
def ports() -> Iterator[None]:
    """Betaflight's ports, which are fixed: one test at a time on this machine."""
    with Path(tempfile.gettempdir(), f"skyarm_betaflight_{os.getuid()}.lock").open(
        "w"
    ) as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def free(kind: socket.SocketKind, port: int) -> bool:
    with socket.socket(socket.AF_INET, kind) as one:
        if kind == socket.SOCK_STREAM:
            one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            one.bind(("127.0.0.1", port))
        except OSError:
            return False
    return True


def all_free() -> bool:
    return all(free(kind, port) for kind, port in GUARDED_PORTS)


def stand_in(folder: Path, way: str = "") -> Path:
    """Executable that plays Betaflight and fails in a way."""
    script = shutil.copy(STAND_IN, folder)
    Path(folder, "way").write_text(way)
    program = folder / "betaflight_SITL"
    program.write_text(f"#!/bin/sh\nexec {sys.executable} -S -E {script}\n")
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    return program


def scenario_with(program: Path, **options: object) -> Scenario:
    scenario = load_scenario("hover_swing")
    options = {
        "program": str(program),
        "patience": 5.0,
        "preparation": 20.0,
        "climb": 0.2,
        **options,
    }
    return dataclasses.replace(
        scenario,
        controller=make_betaflight(scenario.controller.par.model, **options),
        duration=0.8,
    )


def flown(scenario: Scenario) -> Log:
    session = open_session(scenario)
    try:
        return session.run()
    finally:
        session.close()


@pytest.fixture
def soon(monkeypatch):
    monkeypatch.setattr(betaflight, "POWER_ON", 0.3)
    monkeypatch.setattr(betaflight, "WARM", 0.2)


def test_stand_in_hovers_through_a_pause_and_its_transcript_flies_again_to_the_bit(
    tmp_path, ports, soon
):
    tape = tmp_path / "flight.gz"
    session = open_session(scenario_with(stand_in(tmp_path), transcript=str(tape)))
    try:
        for _ in range(100):
            assert session.step()
        before, child = session._link.facts["halts"], session._link._child.pid
        until = time.monotonic() + 10.0
        while (
            Path(f"/proc/{child}/stat").read_text().rsplit(")", 1)[1].split()[0] != "T"
        ):
            assert time.monotonic() < until
            time.sleep(0.02)
        log = session.run()
    finally:
        session.close()
    assert (log.status, log.info["cause"]) == ("completed", "")
    assert log.info["autopilot"]["halts"] > before
    assert np.linalg.norm(log.position - log.position_reference, axis=1).max() < 0.15
    said = log.info["autopilot"]
    assert said["answered"] > 0.95 * said["steps"]
    assert said["bad_frames"] == 0
    assert {
        "late_ms_p50",
        "late_ms_p99",
        "answer_ms_p50",
        "answer_ms_p99",
        "halts",
    } <= set(said)
    assert all_free()
    again = flown(scenario_with(tmp_path / "absent", replayed=str(tape)))
    np.testing.assert_array_equal(again.position, log.position)
    np.testing.assert_array_equal(again.rotor_commands, log.rotor_commands)


FAILURES = {
    "dies": "Betaflight has ended .*out of luck",
    "silent": "Betaflight has sent no motors for 0.5 s",
    "garbage": r"Betaflight has sent no motors for 0.5 s but \d+ other datagrams",
    "numbers": r"Betaflight sent 4 motors, \[nan, .*must be 4 numbers",
    "motors": "Betaflight sent 5 motors",
    "ends": r"Betaflight ended while it started \(no such luck\)",
    "unsaved": r"Betaflight ended before its settings were saved \(disk full\)",
    "faints": r"Betaflight ended while it started \(out of breath\)",
    "deaf": "Betaflight does not open port 5761",
}


def test_a_start_that_is_silent_is_tried_again(tmp_path, ports, soon):
    log = flown(
        dataclasses.replace(
            scenario_with(stand_in(tmp_path, "drowsy"), patience=0.5), duration=0.2
        )
    )
    assert (log.status, log.info["cause"]) == ("completed", "")


NIGHTLY = {"garbage", "numbers", "motors"}
"""Failures that tests without a program show as well."""


@pytest.mark.parametrize(
    "way",
    [
        pytest.param(each, marks=pytest.mark.thorough) if each in NIGHTLY else each
        for each in FAILURES
    ],
)
def test_failure_is_a_result_of_one_line_with_ports_free_and_no_process(
    way, tmp_path, ports, soon
):
    session = open_session(
        scenario_with(
            stand_in(tmp_path, way),
            patience={"silent": 0.5, "garbage": 0.5, "deaf": 0.15}.get(way, 3.0),
        )
    )
    link = session._link
    try:
        log = session.run()
    finally:
        session.close()
    assert log.status == "autopilot"
    cause = log.info["cause"]
    assert "\n" not in cause
    assert re.search(FAILURES[way], cause), cause
    if link is not None:
        with pytest.raises(ProcessLookupError):
            os.kill(link._child.pid, 0)
    assert all_free()


def test_disarmed_in_flight_ends_it(tmp_path, ports, soon):
    log = flown(
        dataclasses.replace(scenario_with(stand_in(tmp_path, "disarms")), duration=20.0)
    )
    assert (
        log.status,
        log.info["cause"].startswith("Betaflight disarmed in flight"),
    ) == ("autopilot", True)


def test_refused_setting_is_named(tmp_path, ports):
    log = flown(scenario_with(stand_in(tmp_path), parameters={"nonsense": 1.0}))
    assert "Betaflight refuses 'set nonsense = 1'" in log.info["cause"]
    assert all_free()
    log = flown(scenario_with(stand_in(tmp_path), parameters={"p_roll": 45.7}))
    assert (
        log.info["cause"]
        == "Betaflight refuses 'set p_roll = 45.7': must be what it takes, '45'"
    )


@pytest.mark.parametrize(("kind", "port"), GUARDED_PORTS)
def test_taken_port_is_named(kind, port, tmp_path, ports):
    with socket.socket(socket.AF_INET, kind) as taken:
        if kind == socket.SOCK_STREAM:
            taken.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        taken.bind(("127.0.0.1", port))
        if kind == socket.SOCK_STREAM:
            taken.listen(1)
        log = flown(scenario_with(stand_in(tmp_path)))
    assert (
        f"port {port} must be free for Betaflight, one flight at a time"
        in log.info["cause"]
    )


@pytest.mark.thorough
def test_real_betaflight_holds_the_hover_with_a_swinging_arm(ports):
    if not (os.environ.get("SKYARM_BETAFLIGHT") or betaflight_process.usual_program()):
        pytest.skip(
            "no program of Betaflight: neither SKYARM_BETAFLIGHT nor the extra"
            " 'betaflight'"
        )
    log = flown(
        dataclasses.replace(
            load_scenario("hover_swing", controller="betaflight"), duration=12.0
        )
    )
    assert (log.status, log.info["cause"]) == ("completed", "")
    assert np.linalg.norm(log.position - log.position_reference, axis=1).max() < 0.1


def test_motor_message_is_a_count_and_sixteen_floats():
    assert MOTORS.size == 68
    assert MOTORS.unpack(struct.pack("<HH16f", 4, 77, *range(16)))[:3] == (4, 0.0, 1.0)


def linked() -> betaflight.BetaflightLink:
    """Link without a program."""
    planned = planned_scenario(load_scenario("case3", controller="betaflight"))
    tape = Tape()
    tape.plays = True
    return betaflight.BetaflightLink(betaflight.Betaflight(patience=0.5), planned, tape)


@pytest.mark.parametrize(
    ("count", "first", "words"),
    [
        (4, math.nan, r"Betaflight sent 4 motors, \[nan, .*must be 4 numbers"),
        (5, 1500.0, "Betaflight sent 5 motors"),
    ],
)
def test_motors_that_are_none_end_the_flight(count, first, words):
    with pytest.raises(LinkError, match=words):
        linked()._take(MOTORS.pack(count, first, *(1500.0,) * 15))


def test_motors_are_signals_from_zero_to_one_and_disarmed_ones_end_the_flight():
    link = linked()
    assert (link.facts["steps"], link.facts["answered"]) == (0, 0)
    link._take(MOTORS.pack(4, 1100.0, 1500.0, 900.0, 2100.0, *(0.0,) * 12))
    assert link.facts["answered"] == 1
    assert link._signals == pytest.approx((0.1, 0.5, 0.0, 1.0))
    assert not link._armed
    link._take(MOTORS.pack(4, *(1100.0,) * 4, *(0.0,) * 12))
    assert link._armed
    link.following = True
    with pytest.raises(LinkError, match=r"Betaflight disarmed in flight$"):
        link._take(MOTORS.pack(4, *(1000.0,) * 4, *(0.0,) * 12))
    # late by little delays that were never made up
    link._late, link._armed = [0.34] * 400, True
    with pytest.raises(LinkError, match=r"Betaflight disarmed in flight$"):
        link._take(MOTORS.pack(4, *(1000.0,) * 4, *(0.0,) * 12))
    link._tape.plays, link._armed = False, True
    for pause in (0.0, 0.002, 0.34, 0.002):
        time.sleep(pause)
        link._pace()
    with pytest.raises(
        LinkError,
        match=(
            r"in flight: states were up to 0\.[3-9]\d* s apart, the machine is too"
            r" busy$"
        ),
    ):
        link._take(MOTORS.pack(4, *(1000.0,) * 4, *(0.0,) * 12))


def test_other_datagrams_are_named_in_a_silence():
    link = linked()
    link._silent_since = time.monotonic() - 1.0
    assert link._motors_of([(bytes(67), "ours"), (bytes(69), "ours")]) == []
    with pytest.raises(
        LinkError,
        match=r"Betaflight has sent no motors for 0\.5 s but 2 other datagrams",
    ):
        link._check_alive(time.monotonic())


def test_the_first_sender_of_motors_is_the_only_one_that_is_heard():
    link = linked()
    one, two = MOTORS.pack(4, *(1100.0,) * 16), MOTORS.pack(4, *(1900.0,) * 16)
    assert link._motors_of(
        [(b"x", "other"), (one, "ours"), (two, "other"), (one, "ours")]
    ) == [one, one]
    assert link._motors_of([(two, "other")]) == []
    assert link.facts["bad_frames"] == 3


class Clock:
    """Clock that moves on by sleeping."""

    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


def test_states_go_out_in_real_time_and_at_most_a_third_faster_after_a_delay(
    monkeypatch,
):
    clock, link, period = Clock(), linked(), 0.002
    monkeypatch.setattr(betaflight, "time", clock)
    link._tape.plays, link._steps = False, 7
    sent = []
    for k in range(40):
        clock.now += 0.1 * period
        if k == 20:
            clock.now += 2.0 * period
        link._pace()
        sent.append(clock.now)
        link._steps += 1
    assert link._period == period
    gaps = np.diff(sent) / period
    np.testing.assert_allclose(gaps[:19], 1.0, atol=1e-9)
    assert gaps[19] == pytest.approx(2.1)
    np.testing.assert_allclose(gaps[20:24], 0.75, atol=1e-9)
    np.testing.assert_allclose(gaps[25:], 1.0, atol=1e-9)
    assert sent[-1] == pytest.approx(sent[0] + 39 * period)
    facts = link.facts
    assert facts["late_ms_p50"] == pytest.approx(0.0, abs=1e-6)
    late = np.array(sent) - (sent[0] + period * np.arange(40))
    assert facts["late_ms_p99"] == pytest.approx(1e3 * np.percentile(late, 99))


def test_the_state_after_a_late_answer_keeps_its_distance_from_the_answer(monkeypatch):
    """Betaflight read the state before it late too, and its clock runs by the distance
    at which it reads two.
    """
    clock, link = Clock(), linked()
    monkeypatch.setattr(betaflight, "time", clock)
    link._tape.plays = False

    def answer(until):
        clock.now += 0.09
        return MOTORS.pack(4, *(1000.0,) * 16)

    link._await_motors = answer
    for states in range(3):
        link._steps = states
        link._pace()
        if states:
            assert link._sent - link._heard == pytest.approx(0.75 * link._period)
        assert link._read()


def test_a_process_is_halted_only_when_its_time_is_over(monkeypatch):
    sent = []
    monkeypatch.setattr(
        betaflight_process.ProcessGuard, "_kill", lambda self, what: sent.append(what)
    )
    monkeypatch.setattr(betaflight_process, "HALT", 0.03)
    guard = betaflight_process.ProcessGuard(0)
    assert not guard.wake(0.3)
    time.sleep(0.1)
    assert sent == []
    guard.wake(0.03)
    time.sleep(0.2)
    assert sent == [signal.SIGSTOP]
    assert guard.wake(0.3)
    guard.close()
    assert (sent, guard.halts) == ([signal.SIGSTOP, signal.SIGCONT], 1)


def test_it_is_asked_to_arm_takes_off_and_follows_from_halfway_up():
    link = linked()
    wanted, level, quaternion = [], (1500, 1500, 1000, 1500), (1.0, 0.0, 0.0, 0.0)
    goal = BaseGoal((1.0, 2.0, 9.0), (0.1, 0.2, 0.3), (0.4, 0.5, 0.6), 0.7)

    def note(position, velocity, attitude, goal, dt, *, flying):
        wanted.append((goal, flying))
        return AttitudeCommand(0.0, 0.0, 0.0, GRAVITY)

    link._control.command = note
    stand = link._filter.position = (0.0, 0.0, link._stand)
    switches = [
        link._channels(t, quaternion, goal)[:6]
        for t in (5.99, 6.0, 6.49, 6.51, 6.9, 7.01)
    ]
    assert switches == [
        (*level, arm, 2000) for arm in (1000, 2000, 2000, 2000, 1000, 2000)
    ]
    link._armed, link._armed_at = True, 7.0
    channels = link._channels(7.5, quaternion, goal)
    assert channels[4:] == (2000, 2000, *(1000,) * 10)
    assert wanted[-1] == (
        BaseGoal((1.0, 2.0, stand[2] + 0.2), (0.0, 0.0, 0.4), (0.0, 0.0, 0.0), 0.7),
        False,
    )
    link._channels(1000.0, quaternion, goal)
    assert wanted[-1][0] == BaseGoal(
        (1.0, 2.0, 9.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.7
    )
    link._filter.position = (0.0, 0.0, link._stand + 0.24)
    link._channels(8.0, quaternion, goal)
    assert wanted[-1][1]
    assert not link.following
    link._filter.position = (0.0, 0.0, link._stand + 0.26)
    link._channels(8.0, quaternion, goal)
    assert link.following
    link._channels(8.0, quaternion, goal)
    assert wanted[-1][0] == goal


def test_a_halt_is_no_silence():
    link = linked()
    link._tape.plays, link._silent_since = False, time.monotonic() - 100.0

    class Woken:
        halts = 1

        def wake(self, seconds: float = 0.0) -> bool:
            return True

    link._guard = Woken()
    link._pace()
    # 100 s ago it was halted; the silence begins now
    link._check_alive(time.monotonic())
    link._silent_since = time.monotonic() - 1.0
    with pytest.raises(LinkError, match=r"no motors for 0\.5 s"):
        link._check_alive(time.monotonic())
