"""ArduPilot's link against a stand-in for its protocol, and against the program itself
where it is there.
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
import random
import shlex
import socket
import struct
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.links import mavlink
from skyarm.links.autopilots import ardupilot
from skyarm.links.autopilots.ardupilot import (
    SURPLUS,
    ArduPilot,
    ArduPilotLink,
    physics_line,
)
from skyarm.links.autopilots.autopilot import BaseGoal, LinkError, SensedInstant
from skyarm.links.autopilots.flight import planned_scenario
from skyarm.links.transcript import SENT, WORDS, rows_of
from skyarm.reference import hover
from skyarm.scenario.scenario_record import ScenarioError, first_state
from skyarm.simulate.session import open_session
from support import ardupilot_stand_in

SOURCE = str(Path(skyarm.__file__).parents[1])


def programmed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Path]:
    """Program that plays ArduPilot: function of a fault and its frame, which returns
    the file of its notes.
    """
    program = folder / "arducopter"
    script = Path(ardupilot_stand_in.__file__)
    program.write_text(
        f"#!/bin/sh\nexec {shlex.quote(sys.executable)} {shlex.quote(str(script))}"
        ' "$@"\n'
    )
    program.chmod(0o755)
    note = folder / "note.txt"
    monkeypatch.setenv("SKYARM_ARDUPILOT", str(program))
    monkeypatch.setenv("PYTHONPATH", SOURCE)
    monkeypatch.setenv("STAND_IN_NOTE", str(note))

    def choose(fault: str = "", frame: int = 300) -> Path:
        monkeypatch.setenv("STAND_IN_FAULT", fault)
        monkeypatch.setenv("STAND_IN_FRAME", str(frame))
        return note

    return choose


@pytest.fixture
def stand_in(tmp_path, monkeypatch):
    """Stand-in of one test."""
    return programmed(tmp_path, monkeypatch)


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """Log and transcript of a flight without a fault, whose process has ended."""
    folder = tmp_path_factory.mktemp("flown")
    with pytest.MonkeyPatch.context() as monkeypatch:
        note = programmed(folder, monkeypatch)()
        with closing(
            open_session(scenario(transcript=str(folder / "tape.gz")))
        ) as session:
            log = session.run()
    assert log.status == "completed", log.info["cause"]
    assert is_gone(note)
    return log, folder / "tape.gz"


def scenario(
    duration: float = 0.5, name: str = "case3", **options: object
) -> skyarm.Scenario:
    """Flight of the paper's vehicle under ArduPilot, with options of the autopilot."""
    found = dataclasses.replace(
        skyarm.load_scenario(name, controller="ardupilot"), duration=duration
    )
    par = found.controller.par
    changed = dataclasses.replace(
        par.autopilot, **{"patience": 2.0, "preparation": 30.0, **options}
    )
    controller = dataclasses.replace(
        found.controller, par=dataclasses.replace(par, autopilot=changed)
    )
    return dataclasses.replace(found, controller=controller)


def is_gone(note: Path) -> bool:
    """True if the stand-in's process has ended."""
    try:
        os.kill(int(note.read_text().splitlines()[0]), 0)
    except ProcessLookupError:
        return True
    return False


def arrays(log: skyarm.Log) -> dict[str, bytes]:
    """Bits of each array of a log."""
    found = {each.name: getattr(log, each.name) for each in dataclasses.fields(log)}
    return {
        name: value.tobytes()
        for name, value in found.items()
        if isinstance(value, np.ndarray)
    }


def test_it_takes_off_hands_over_and_follows_the_base_set_points(flown):
    log, _ = flown
    assert log.info["autopilot"]["name"] == "ardupilot"
    assert (
        log.info["autopilot"]["answered"]
        == log.info["autopilot"]["steps"]
        > 800 * (0.5 + 2.0)
    )
    assert np.abs(log.position - log.position_reference).max() < 0.15
    assert np.abs(log.rotor_commands).min() > 200.0


def test_it_starts_the_program_on_loopback_ports_of_its_own(stand_in):
    note = stand_in("garbage", 1)
    open_session(scenario()).close()
    words = note.read_text().splitlines()[1:]
    said = dict(zip(words[::2], words[1::2], strict=True))
    assert said["--model"] == "JSON:127.0.0.1"
    assert said["--sim-address"] == "127.0.0.1"
    assert said["--serial0"].startswith("tcpclient:127.0.0.1:")
    assert [said["--serial1"], said["--serial2"]] == ["none:1", "none:2"]
    assert said["--rate"] == "800"
    assert said["--home"] == "47.397742,8.545594,488,0"
    ports = [int(said["--sim-port-out"]), int(said["--serial0"].rsplit(":", 1)[1])]
    assert min(ports) > 1023
    assert "--speedup" not in said


def test_a_recorded_exchange_gives_the_flight_again_to_the_bit_without_a_program(
    flown, monkeypatch
):
    monkeypatch.delenv("SKYARM_ARDUPILOT", raising=False)
    first, tape = flown
    with closing(open_session(scenario(replayed=str(tape)))) as session:
        log = session.run()
    assert log.status == "completed"
    assert arrays(log) == arrays(first)


def test_two_flights_are_equal_to_the_bit_and_so_are_their_exchanges(
    flown, stand_in, tmp_path
):
    first, tape = flown
    stand_in()
    with closing(
        open_session(scenario(transcript=str(tmp_path / "tape.gz")))
    ) as session:
        assert arrays(session.run()) == arrays(first)
    rows, again = (list(rows_of(each))[1:] for each in (tape, tmp_path / "tape.gz"))
    assert [row for row in rows if row[1] == "physics"] == [
        row for row in again if row[1] == "physics"
    ]
    assert [row for row in rows if row[0] == SENT] == [
        row for row in again if row[0] == SENT
    ]


def test_what_it_is_told_is_sent_before_the_answer_of_the_same_frame(flown):
    rows = [[WORDS[what], channel] for what, channel, _ in list(rows_of(flown[1]))[1:]]
    told = [i for i, row in enumerate(rows) if row == ["sent", "mavlink"]]
    following = [next(row for row in rows[i:] if row[1] == "physics") for i in told]
    assert len(told) > 100
    assert following == [["sent", "physics"]] * len(told)


def test_another_flight_than_the_recorded_one_is_told(flown):
    with closing(open_session(scenario(replayed=str(flown[1]), climb=0.6))) as session:
        assert session.ended.status == "autopilot"
        assert "differ" in session.ended.cause


@pytest.mark.thorough
def test_a_packet_with_32_pulse_widths_gives_the_same_flight(flown, stand_in):
    stand_in("wide")
    with closing(open_session(scenario())) as session:
        assert arrays(session.run()) == arrays(flown[0])


@pytest.mark.parametrize(("fault", "repeated"), [("repeat", 1), ("lost", 2)])
def test_a_repeated_packet_is_answered_only_if_its_answer_was_lost(
    stand_in, fault, repeated
):
    stand_in(fault)
    with closing(open_session(scenario(preparation=1.0))) as session:
        assert session.ended.cause.startswith(
            "ArduPilot does not hover at the start after 1 s"
        )
        facts = session.log.info["autopilot"]
    assert facts["repeated"] == repeated
    assert facts["answered"] == facts["steps"] == 799


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("silence", "ArduPilot has not answered for 1 s"),
        ("exit", "ArduPilot ended (Fatal: out of luck)"),
        ("stillborn", "ArduPilot ended while it started (Unknown model"),
        ("closed", "ArduPilot closed the connection"),
        ("garbage", "23 bytes that are no packet of pulse widths"),
        ("magic", "40 bytes that are no packet of pulse widths"),
        ("restart", "ArduPilot started again: frame 0 came in place of frame 300"),
        ("skip", "ArduPilot skipped frames: frame 305 came in place of frame 300"),
        ("pulse", "motor 3 a pulse of 60000 us: must be 1000 to 2000"),
    ],
)
def test_a_fault_ends_the_flight_as_a_result_of_one_line(stand_in, fault, words):
    note = stand_in(fault)
    with closing(
        open_session(scenario(patience=1.0 if fault == "silence" else 5.0))
    ) as session:
        assert session.ended.status == "autopilot"
        assert words in session.ended.cause
        assert "\n" not in session.ended.cause
        log = session.log
    assert log.status == "autopilot"
    assert len(log.time) == (0 if fault == "stillborn" else pytest.approx(300, abs=20))
    assert is_gone(note)


def test_disarming_in_flight_ends_it_with_the_autopilots_words(stand_in):
    note = stand_in("disarm")
    with closing(open_session(scenario())) as session:
        while session.step():
            pass
        assert session.ended.cause == "ArduPilot disarmed in flight: Crash: Disarming"
    assert is_gone(note)


def test_a_pause_of_ours_stops_the_program_and_changes_nothing(
    flown, stand_in, monkeypatch
):
    """ArduPilot repeats a packet each second of the pause; the stand-in stops at a
    frame that is answered twice.
    """
    monkeypatch.setattr(ardupilot, "REPEATED", 0.1)
    frame = flown[0].info["autopilot"]["answered"] - 200
    note, until = stand_in("impatient", frame), time.monotonic() + 20.0
    with closing(open_session(scenario())) as session:
        while session.log.info["autopilot"]["answered"] < frame:
            assert session.step()
        while not note.read_text().endswith("sent"):
            assert time.monotonic() < until
            time.sleep(0.01)
        time.sleep(0.1)
        log = session.run()
    assert log.status == "completed", log.info["cause"]
    assert log.info["autopilot"]["repeated"] == 3
    assert arrays(log) == arrays(flown[0])


def test_without_a_program_the_message_names_the_variable(monkeypatch):
    monkeypatch.delenv("SKYARM_ARDUPILOT", raising=False)
    monkeypatch.setenv("PATH", "/nowhere")
    with pytest.raises(ScenarioError, match="SKYARM_ARDUPILOT"):
        open_session(scenario())


@pytest.mark.parametrize(
    ("name", "value", "seconds", "cause"),
    [
        (
            "FOO",
            1.0,
            10.0,
            "controller.parameters.FOO = 1: must be a parameter that ArduPilot knows",
        ),
        (
            "LOG_DISARMED",
            0.75,
            10.0,
            (
                "controller.parameters.LOG_DISARMED = 0.75: must be what ArduPilot"
                " takes; it has 1"
            ),
        ),
        ("MOT_THST_HOVER", 0.3, 4.0, "ArduPilot does not hover at the start after 4 s"),
    ],
)
def test_stated_parameters_are_those_that_it_has(stand_in, name, value, seconds, cause):
    note = stand_in()
    with closing(
        open_session(
            scenario(preparation=seconds, climb=20.0, parameters=((name, value),))
        )
    ) as session:
        assert session.ended.cause == cause
    assert is_gone(note)


# The line of the physics


STATE = (
    1.5,
    -2.25,
    3.75,
    *np.roll(Rotation.from_euler("ZYX", [0.7, -0.3, 0.2]).as_quat(), 1),
    0.5,
    -0.6,
    0.7,
    9.0,
    9.0,
    9.0,
)
IMU = (12.0, 0.1, -0.2, 0.3, 1.0, -2.0, 9.5)


def test_the_line_has_the_state_in_axes_down_and_forward():
    """Rotation by half a turn about x on both sides of the matrix, as SciPy multiplies
    it.
    """
    found = json.loads(physics_line(12.5, IMU, STATE))
    flip = np.diag([1.0, -1.0, -1.0])
    assert found["timestamp"] == 12.5
    np.testing.assert_allclose(found["imu"]["gyro"], flip @ IMU[1:4], rtol=1e-8)
    np.testing.assert_allclose(found["imu"]["accel_body"], flip @ IMU[4:7], rtol=1e-8)
    np.testing.assert_array_equal(found["position"], flip @ STATE[:3])
    np.testing.assert_allclose(found["velocity"], flip @ STATE[7:10], rtol=1e-8)
    ours = Rotation.from_quat(np.roll(STATE[3:7], -1)).as_matrix()
    theirs = Rotation.from_quat(np.roll(found["quaternion"], -1)).as_matrix()
    np.testing.assert_allclose(theirs, flip @ ours @ flip, atol=1e-8)


def test_every_key_is_the_first_place_of_its_letters():
    """ArduPilot finds a section's and a key's letters wherever they come first, and
    reads behind the next two.
    """
    line = physics_line(3.25, IMU, STATE).decode().strip("\n")
    whole = json.loads(line)
    keys = [
        ("", "timestamp"),
        ("imu", "gyro"),
        ("imu", "accel_body"),
        ("", "position"),
        ("", "quaternion"),
        ("", "velocity"),
        ("", "no_time_sync"),
    ]
    for section, key in keys:
        start = line.index(section) + len(section) + 1
        behind = line[line.index(key, start) + len(key) + 2 :]
        expected = whole[section][key] if section else whole[key]
        assert json.JSONDecoder().raw_decode(behind)[0] == expected
    for absent in ("attitude", "airspeed", "windvane", "rng_"):
        assert absent not in line


@pytest.mark.parametrize("rate", [800, 900, 1000, 1024])
def test_its_clock_keeps_ours_to_the_microsecond(rate):
    """It adds whole microseconds of each difference, without what is left over."""
    for begin in (0, 900 * rate):
        clock, last = 0, 0.0
        for step in range(begin + 1, begin + 10 * rate + 1):
            stamp = round(step / rate * 1e6) * 1e-6 * (1.0 + SURPLUS)
            told = float(
                physics_line(stamp, IMU, STATE).partition(b",")[0].partition(b":")[2]
            )
            clock, last = int(clock + (told - last) * 1e6) if last else 0, told
        assert clock == round((begin + 10 * rate) / rate * 1e6) - round(
            (begin + 1) / rate * 1e6
        )


# Fuzzed packets


class Tap:
    """Tape that is fed by hand."""

    plays = True

    def __init__(self) -> None:
        self.packets: list[bytes] = [
            struct.pack("<HHI16H", 18458, 1200, 0, *[1000] * 16)
        ]
        self.stream = b""
        self.sent: list[mavlink.Message] = []

    def send(self, channel: str, data: bytes, send: object) -> None:
        """Take what is sent."""
        if channel == "mavlink":
            self.sent += mavlink.Parser().feed(data)

    def receive(self, channel: str, receive: object) -> bytes:
        """What is there for a channel."""
        return self.packets.pop() if channel == "physics" else self.stream


def test_a_packet_of_32_pulse_widths_is_taken_as_one_of_16():
    tap = Tap()
    link = ArduPilotLink(ArduPilot(), planned_scenario(scenario()), tap)
    tap.packets = [
        struct.pack("<HHI32H", 29569, 1, 1, *[1100, 1200, 1300, 1400], *[1000] * 28)
    ]
    signals = link.exchange(
        SensedInstant(1 / 800, {"imu": IMU}, STATE),
        BaseGoal((0.0, 0.0, 1.0), (0.0,) * 3, (0.0,) * 3, 0.0),
    )
    tap.packets = [
        struct.pack("<HHI16H", 18458, 1, 2, *[1100, 1200, 1300, 1400], *[1000] * 12)
    ]
    again = link.exchange(
        SensedInstant(2 / 800, {"imu": IMU}, STATE),
        BaseGoal((0.0, 0.0, 1.0), (0.0,) * 3, (0.0,) * 3, 0.0),
    )
    assert sorted(signals) == pytest.approx((0.1, 0.2, 0.3, 0.4))
    assert signals == again


@pytest.mark.parametrize(
    "packets", [2000, pytest.param(20_000, marks=pytest.mark.thorough)]
)
def test_fuzzed_packets_are_refused_or_taken(packets):
    """The oracle for what must be taken: a valid packet of which a byte changed only in
    rate or pulse widths.
    """
    rng = random.Random(20260)
    tap = Tap()
    link = ArduPilotLink(ArduPilot(), planned_scenario(scenario()), tap)
    goal = BaseGoal((0.0, 0.0, 1.0), (0.0,) * 3, (0.0,) * 3, 0.0)
    taken, frame = 0, 0
    for step in range(packets):
        packet = bytearray(struct.pack("<HHI16H", 18458, 800, frame + 1, *[1500] * 16))
        for _ in range(rng.randrange(3)):
            packet[rng.randrange(len(packet))] = rng.randrange(256)
        if rng.random() < 0.2:
            packet = bytearray(rng.randbytes(rng.randrange(100)))
        tap.packets = [bytes(packet)]
        tap.stream = rng.randbytes(rng.randrange(200)) if step % 7 == 0 else b""
        try:
            signals = link.exchange(
                SensedInstant(step / 800, {"imu": IMU}, STATE), goal
            )
        except LinkError as error:
            assert "\n" not in str(error)
            frame = link.facts["answered"]
            continue
        frame += 1
        taken += 1
        assert link.facts["answered"] == frame
        assert len(signals) == 4
        assert all(0.0 <= each <= 1.0 for each in signals)
        assert bytes(packet[:2]) == struct.pack("<H", 18458)
    assert 0.25 * packets < taken < 0.95 * packets


# What it is told


class Talk:
    """Link whose other side is played by hand: mode, arming, flags of the estimator,
    place (north, west, up).
    """

    def __init__(self) -> None:
        self.tap, self.step, self.frame = Tap(), 0, 0
        self.link = ArduPilotLink(
            ArduPilot(climb=0.5), planned_scenario(scenario()), self.tap
        )
        self.mode, self.armed, self.flags, self.shift, self.system = (
            0,
            False,
            831,
            (2.0, -1.0, 3.0),
            1,
        )

    def fly(
        self, seconds: float, place: tuple[float, float, float], goal: BaseGoal
    ) -> list[mavlink.Message]:
        """Messages that the link sends in some seconds at a true place."""
        self.tap.sent.clear()
        for _ in range(round(seconds * 800)):
            self.step += 1
            self.frame += 1
            if self.step % 16 == 0:
                x, y, z = (a + b for a, b in zip(place, self.shift, strict=True))
                said = {
                    "HEARTBEAT": {
                        "autopilot": 3,
                        "custom_mode": self.mode,
                        "base_mode": 128 * self.armed,
                    },
                    "EKF_STATUS_REPORT": {"flags": self.flags},
                    "LOCAL_POSITION_NED": {"x": x, "y": -y, "z": -z},
                }
                self.tap.stream = b"".join(
                    mavlink.pack(
                        name, sequence=i, system=self.system, component=1, **fields
                    )
                    for i, (name, fields) in enumerate(said.items())
                )
            self.tap.packets = [
                struct.pack("<HHI16H", 18458, 800, self.frame, *[1500] * 16)
            ]
            self.link.exchange(
                SensedInstant(self.step / 800, {"imu": IMU}, (*place, *STATE[3:])), goal
            )
        return list(self.tap.sent)


START = first_state(scenario()).position
STAND = (float(START.x), float(START.y), float(START.z) - 0.5)
AIR = (STAND[0], STAND[1], STAND[2] + 0.5)
GOAL = BaseGoal((1.5, 2.5, 1.25), (0.1, 0.2, 0.3), (0.4, 0.5, 0.6), 0.7)


def commands(sent: list[mavlink.Message]) -> list[int]:
    """Numbers of the commands among messages."""
    return [message["command"] for message in sent if message.name == "COMMAND_LONG"]


def test_it_requests_mode_arming_and_take_off_one_by_one_and_then_sends_goals():
    talk = Talk()
    assert set(commands(talk.fly(2.5, STAND, GOAL))) <= {511}
    assert set(commands(talk.fly(2.0, STAND, GOAL))) == {176}
    talk.mode = 4
    talk.fly(0.6, STAND, GOAL)
    assert set(commands(talk.fly(2.0, STAND, GOAL))) == {400}
    talk.armed = True
    talk.fly(0.6, STAND, GOAL)
    sent = talk.fly(6.0, STAND, GOAL)
    assert set(commands(sent)) == {22}
    assert [
        message["param7"] for message in sent if message.name == "COMMAND_LONG"
    ] == [0.5]
    assert not talk.link.following
    sent = talk.fly(1.0, AIR, GOAL)
    assert talk.link.following
    goals = [
        message for message in sent if message.name == "SET_POSITION_TARGET_LOCAL_NED"
    ]
    assert len(goals) == 50
    told, north_east_down = goals[-1], np.array([1.0, -1.0, -1.0])
    expected = north_east_down * (np.array(GOAL.position) + talk.shift)
    assert [told[axis] for axis in "xyz"] == pytest.approx(expected, rel=1e-6)
    assert [told["v" + axis] for axis in "xyz"] == pytest.approx(
        north_east_down * GOAL.velocity, rel=1e-6
    )
    assert [told["af" + axis] for axis in "xyz"] == pytest.approx(
        north_east_down * GOAL.acceleration, rel=1e-6
    )
    assert told["yaw"] == pytest.approx(-0.7)
    assert (told["type_mask"], told["coordinate_frame"]) == (2048, 1)
    assert [message.name for message in sent].count("HEARTBEAT") == 1
    talk.mode = 9
    assert set(commands(talk.fly(1.0, AIR, GOAL))) == {176}
    assert talk.link.facts["left_guided"] == 1
    with pytest.raises(LinkError, match="ArduPilot left guided mode for its mode 9"):
        talk.fly(3.0, AIR, GOAL)


def test_its_origin_is_that_of_the_planned_stand_whatever_the_true_place():
    talk = Talk()
    talk.mode, talk.armed = 4, False
    talk.shift = (1.5, -1.0, 3.0)
    talk.fly(4.0, (STAND[0] + 0.5, STAND[1], STAND[2]), GOAL)
    np.testing.assert_allclose(talk.link._vehicle.origin, (2.0, -1.0, 3.0), atol=1e-6)


def test_its_origin_is_the_mean_of_the_later_half_at_rest():
    link = Talk().link
    vehicle, count = link._vehicle, math.ceil(ardupilot.SETTLED * 50.0 - 1e-9)
    link._ready, vehicle.place = True, (5.0, 6.0, 7.0)
    for k in range(count):
        assert vehicle.origin is None
        if k >= 0.49 * count:
            vehicle.place = (
                STAND[0] + 2.0 + 0.2 * (k % 2),
                STAND[1] - 1.0,
                STAND[2] + 3.0,
            )
        link._find_origin()
    np.testing.assert_allclose(vehicle.origin, (2.1, -1.0, 3.0), atol=0.2 / count)


@pytest.mark.parametrize("armed", [True, False])
def test_its_origin_is_looked_for_anew_after_a_moment_without_estimates_or_armed(armed):
    link = Talk().link
    link._ready, link._vehicle.place = True, STAND
    for _ in range(100):
        link._find_origin()
    link._ready, link._vehicle.armed = armed, armed
    link._find_origin()
    link._ready, link._vehicle.armed = True, False
    for _ in range(100):
        link._find_origin()
    assert link._vehicle.origin is None


def test_a_program_that_reads_nothing_ends_the_flight():
    link = Talk().link
    ours, theirs = socket.socketpair()
    with ours, theirs:
        link._tcp, link._record = ours, ArduPilot(patience=0.1)
        ours.setblocking(False)
        with pytest.raises(LinkError, match=r"ArduPilot has read nothing for 0\.1 s"):
            link._write(bytes(1 << 24))


def test_a_value_that_mavlink_cannot_carry_ends_the_flight_as_a_link():
    with pytest.raises(LinkError, match="a set point cannot be sent to ArduPilot"):
        Talk().link._vehicle.command(400, 1e300)


def test_bytes_of_another_program_do_not_become_the_partner(stand_in, monkeypatch):
    """The port calls nobody until it has had a packet of pulse widths."""
    link = Talk().link
    link._udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    link._udp.bind(("127.0.0.1", 0))
    link._udp.settimeout(0.2)
    link._frame = -1
    packet = struct.pack("<HHI16H", 18458, 800, 0, *[1000] * 16)
    with (
        closing(link._udp),
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as odd,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as right,
    ):
        odd.sendto(b"hello", link._udp.getsockname())
        right.sendto(packet, link._udp.getsockname())
        assert link._next_packet() == packet
        assert link._peer == ("127.0.0.1", right.getsockname()[1])


def test_a_failure_to_start_is_a_link_error_and_leaves_no_folder(
    stand_in, monkeypatch, tmp_path
):
    stand_in()

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(Path, "write_text", full)
    with closing(open_session(scenario())) as session:
        assert (
            session.ended.cause
            == "ArduPilot cannot be started: No space left on device"
        )
    assert not list(tmp_path.glob("skyarm_ardupilot_*"))


@pytest.mark.parametrize(
    ("flags", "system"), [(831 | 128, 1), (831 & ~16, 1), (831, 2)]
)
def test_it_waits_for_estimates_of_its_own_system(flags, system):
    """Flag 128: the position is taken as constant; 16: absolute position."""
    talk = Talk()
    talk.flags, talk.system = flags, system
    assert set(commands(talk.fly(6.0, STAND, GOAL))) <= {511}


def test_it_flies_at_another_heading_and_leaves_no_process_where_it_is_closed_early(
    stand_in,
):
    """Yaw is counter-clockwise here, the heading of ``--home`` clockwise."""
    note = stand_in()
    turned = dataclasses.replace(
        scenario(5.0), reference=hover((0.5, -0.25, 1.0), yaw=0.8, joints=(0.0, 0.0))
    )
    session = open_session(turned)
    for _ in range(20):
        assert session.step()
    state = session.log.quaternion[-1]
    assert not is_gone(note)
    session.close()
    session.close()
    assert is_gone(note)
    assert not session.step()
    words = note.read_text().splitlines()
    assert float(words[words.index("--home") + 1].split(",")[3]) == pytest.approx(
        360.0 - math.degrees(0.8), abs=1e-4
    )
    assert 2.0 * math.atan2(state[3], state[0]) == pytest.approx(0.8, abs=0.05)


def test_it_holds_its_place_in_real_time_for_a_program_outside(stand_in, monkeypatch):
    note = stand_in()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        monkeypatch.setattr(ardupilot, "JOINT_PORT", probe.getsockname()[1])
    with closing(open_session(scenario(0.3, outside=True))) as session:
        assert (session._link.released, session._link._vehicle.mode) == (True, 17)
        begin = time.monotonic()
        log = session.run()
    assert time.monotonic() - begin > 0.29
    assert log.status == "completed", log.info["cause"]
    words = note.read_text().splitlines()
    assert words[words.index("--serial1") + 1] == "udpclient:127.0.0.1:14540"


@pytest.mark.parametrize("outside", [False, True])
def test_only_a_program_outside_changes_how_ardupilot_takes_thrust_rates_and_silence(
    outside, tmp_path, monkeypatch
):
    """GUID_OPTIONS 8: thrust of a set point is a thrust, not a climb rate;
    GUID_TIMEOUT: s until it levels.
    """
    program, parameters = tmp_path / "arducopter", tmp_path / "parameters"
    copied = shlex.quote(str(parameters))
    program.write_text(
        f'#!/bin/sh\nwhile [ "$1" != --defaults ]; do shift; done\ncp "$2" {copied}\n'
    )
    program.chmod(0o755)
    monkeypatch.setenv("SKYARM_ARDUPILOT", str(program))
    with suppress(LinkError):  # it ends before it answers
        open_session(
            scenario(outside=outside, parameters=(("SCHED_LOOP_RATE", 300.0),))
        ).close()
    given = dict(line.split() for line in parameters.read_text().splitlines())
    assert given["SCHED_LOOP_RATE"] == "300"
    wanted = {
        "GUID_OPTIONS": "8",
        "GUID_TIMEOUT": "0.2",
        "SERIAL1_PROTOCOL": "2",
        "ATC_ANGLE_BOOST": "0",
    }
    wanted |= {"ATC_RAT_YAW_FLTE": "0"} | {
        f"ATC_ACCEL_{axis}_MAX": "0" for axis in "RPY"
    }
    assert {name: given.get(name) for name in wanted} == (
        wanted if outside else dict.fromkeys(wanted)
    )


# The program itself


@pytest.mark.thorough
@pytest.mark.skipif(
    "SKYARM_ARDUPILOT" not in os.environ,
    reason="needs ArduPilot's program, named by SKYARM_ARDUPILOT",
)
def test_two_flights_of_the_program_itself_are_equal_to_the_bit():
    logs = []
    for _ in range(2):
        with closing(
            open_session(scenario(5.0, patience=20.0, preparation=150.0))
        ) as session:
            logs.append(session.run())
    assert [log.status for log in logs] == ["completed"] * 2
    assert arrays(logs[0]) == arrays(logs[1])
    assert math.dist(logs[0].position[-1], logs[0].position_reference[-1]) < 0.15
    assert logs[0].info["autopilot"]["left_guided"] == 0
