"""PX4 in the loop, against its stand-in: take-off, hand-over, set points, faults of the
program, and its end.
"""

from __future__ import annotations

import contextlib
import dataclasses
import socket
import struct
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from px4_flights import (
    QUIET,
    READINGS,
    Fixed,
    free_instance,
    make_program,
    record_of,
    scenario_of,
)

from skyarm.links import mavlink
from skyarm.links.autopilots import px4, px4_ports
from skyarm.links.autopilots.autopilot import BaseGoal, LinkError, SensedInstant
from skyarm.links.autopilots.flight import PilotedSession, planned_scenario
from skyarm.links.autopilots.px4 import PX4Link
from skyarm.links.autopilots.px4_ports import open_ports
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.simulate.session import open_session

TOLD: list[tuple[float, float]] = []
"""What the session last begun has told of its take-off."""

GOAL = BaseGoal((0.5, -0.3, 1.5), (0.1, 0.2, 0.3), (0.4, 0.5, 0.6), 0.7)


@pytest.fixture(autouse=True)
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    """A stand-in estimates at once and answers at once: one second of estimates is
    enough.
    """
    monkeypatch.setattr(px4, "SETTLED", 1)
    monkeypatch.setattr(px4, "STALL", 0.3)


@contextlib.contextmanager
def begun(folder: Path, fault: str = "", **options: object) -> Iterator[PilotedSession]:
    """Session of a hover under the stand-in with a fault; its process and ports are
    gone in the end.
    """
    program = make_program(folder, fault)
    TOLD.clear()
    scenario = scenario_of(
        folder, program=str(program), **{"climb": 0.3, "patience": 20.0, **options}
    )
    session = open_session(scenario, preparing=lambda *seconds: TOLD.append(seconds))
    assert isinstance(session, PilotedSession)
    link = session._link
    try:
        yield session
    finally:
        session.close()
        if isinstance(link, PX4Link) and link._child is not None:
            assert not link._child.running
            assert not link._child.folder.exists()
            assert link._udp is not None
            assert link._udp.fileno() == -1
            assert link._tcp is None or link._tcp.fileno() == -1


def test_the_stand_in_takes_off_and_hovers_where_the_reference_is(
    tmp_path: Path,
) -> None:
    with begun(tmp_path, duration=2.0, yaw=0.6) as session:
        log = session.run()
        assert log.status == "completed"
        assert len(log.time) == 2 * 250
        error = np.linalg.norm(log.position - log.position_reference, axis=1)
        assert error.max() < 0.12
        w, x, y, z = log.quaternion[-1]
        assert 2 * np.arctan2(z, w) == pytest.approx(0.6, abs=0.05)
        assert np.hypot(x, y) < 0.05
        facts = log.info["autopilot"]
        assert facts["steps"] - facts["answered"] == 4  # the stand-in's start
        assert (
            facts["lockstep_missed"]
            == facts["left_offboard"]
            == facts["failsafes"]
            == 0
        )
        assert facts["prepared_s"] == round(facts["prepared_s"])
        *rising, last = TOLD
        assert rising == [(float(second), 120.0) for second in range(1, len(TOLD))]
        assert last == (facts["prepared_s"],) * 2
        # the last period asks for nothing
        assert facts["steps"] == len(log.time) + 250 * facts["prepared_s"] - 1


def test_a_hexarotor_with_a_users_parameters_flies_and_refuses_a_second_connection(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PX4_PARAM_OF_THE_SHELL", "1")
    number, given = free_instance(), {"MPC_XY_P": 0.5, "MC_PITCH_P": 6.0}
    with begun(
        tmp_path,
        "twice:2",
        vehicle="hexarotor_arm6",
        instance=number,
        duration=0.5,
        parameters=given,
    ) as session:
        assert session._link._partner == ("127.0.0.1", 14580 + number)  # type: ignore[union-attr]
        environment = (
            Path(f"/proc/{session._link._child.pid}/environ").read_bytes().split(b"\0")
        )  # type: ignore[union-attr]
        assert session.run().status == "completed"
    assert b"PX4_PARAM_MPC_XY_P=0.5" in environment
    assert b"PX4_PARAM_MC_PITCH_P=6" in environment
    assert b"PX4_PARAM_CA_ROTOR_COUNT=6" in environment
    assert b"PX4_PARAM_OF_THE_SHELL=1" not in environment


RECORDED = Path(__file__).parents[2] / "data" / "links" / "px4_hover.transcript.gz"
"""Exchange with PX4 v1.17 (upstream commit 59ded6af): boot, take-off of 0.2 m, 2 s of
hover; written by record_px4.py."""

PREPARED, ANSWERED = 25, 6741
"""s from power-on to hand-over, and sensor messages that were answered, of that
session."""


def test_a_recorded_session_of_px4_is_reproduced_byte_for_byte(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(px4, "SETTLED", 5)
    scenario = dataclasses.replace(
        scenario_of(tmp_path, duration=2.0, climb=0.2, replayed=str(RECORDED)),
        sensors=QUIET,
    )
    log = open_session(scenario).run()
    assert log.status == "completed", log.info["cause"]
    facts = log.info["autopilot"]
    assert facts["prepared_s"] == PREPARED
    assert facts["steps"] == (PREPARED + 2) * 250 - 1
    assert facts["answered"] == ANSWERED
    assert np.linalg.norm(log.position - log.position_reference, axis=1).max() < 0.1
    # and to its end: one more period finds nothing recorded
    longer = open_session(dataclasses.replace(scenario, duration=2.1)).run()
    assert (longer.status, len(longer.time)) == ("autopilot", 2 * 250 + 1)
    assert longer.info["cause"] == "transcript: ends at 27 s, before the flight does"


FAULTS = {
    "boot": "ended while it started (INFO [init] the stand-in ends at once)",
    "deaf": "has not connected to port 456",
    "silent:1": "has not answered for 2 s",
    "stop:1": "has not answered for 2 s",
    "die:1": "closed the connection (the stand-in dies)",
    "close:1": "closed the connection",
    "restart:1": "closed the connection",
    "garbage:1": "bytes that are no MAVLink",
    "text:1": "bytes that are no MAVLink",
    "nan:1": "controls that are not from 0 to 1: [0.0, nan",
    "range:1": "controls that are not from 0 to 1: [0.0, 1.5",
    "future:1": "answered with the time 2000001 us before it was sent",
    "late:1": "has not answered for 2 s",
    "unlocked:1": "does not run in lockstep",
    "refuse": (
        "does not hover at the start after 6 s: Arming denied: the stand-in will not"
    ),
    "disarm:6": "disarmed in flight",
    "leave:6": "left offboard mode for its mode 4",
    "die:6": "closed the connection (the stand-in dies)",
}


NIGHTLY = {"stop:1", "restart:1", "close:1", "text:1", "die:6", "leave:6"}
"""Faults whose way to end is also that of another one, or of a test without a
program."""


@pytest.mark.parametrize(
    "fault",
    [
        pytest.param(each, marks=pytest.mark.thorough) if each in NIGHTLY else each
        for each in FAULTS
    ],
)
def test_a_fault_ends_the_flight_in_one_line_and_leaves_nothing(
    tmp_path: Path, fault: str
) -> None:
    patience = {"deaf": 1.0, "silent:1": 2.0, "stop:1": 2.0, "late:1": 2.0}.get(
        fault, 20.0
    )
    preparation = 6.0 if fault == "refuse" else 60.0
    with begun(
        tmp_path, fault, patience=patience, preparation=preparation, duration=30.0
    ) as session:
        log = session.run()
        assert log.status == "autopilot"
        cause = log.info["cause"]
        assert FAULTS[fault] in " ".join(cause.split())
        assert "\n" not in cause
        assert "\x1b" not in cause
        begin = float(fault.partition(":")[2] or 0)
        assert (
            log.time[-1] + log.info["autopilot"]["prepared_s"] >= begin - 0.01
            if len(log.time)
            else begin == 0
        )
        assert not session.step()  # and stays ended


def test_a_parameter_that_px4_does_not_have_is_refused(tmp_path: Path) -> None:
    with begun(tmp_path, "unknown", parameters={"NO_SUCH": 1.0}) as session:
        assert (
            session.log.info["cause"]
            == "controller.parameters.NO_SUCH = 1: must be a parameter that PX4 knows"
        )


@pytest.mark.parametrize(
    ("fault", "given", "words"),
    [
        (
            "",
            {"CA_ROTOR_COUNT": 4.5},
            "CA_ROTOR_COUNT = 4.5: must be what PX4 takes; it has 4",
        ),
        (
            "mute",
            {"MPC_XY_P": 1.5},
            "MPC_XY_P = 1.5: must be a parameter that PX4 knows",
        ),
    ],
)
def test_parameters_that_px4_has_otherwise_are_named_with_both_values(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    fault: str,
    given: dict[str, float],
    words: str,
) -> None:
    monkeypatch.setattr(px4, "REPLIES", 1.5)
    with begun(tmp_path, fault, parameters=given) as session:
        assert session.log.info["cause"] == f"controller.parameters.{words}"


def test_programs_that_cannot_be_are_refused_before_anything_starts(
    tmp_path: Path,
) -> None:
    program = make_program(tmp_path)
    plain = tmp_path / "text"
    plain.write_text("x", "utf-8")
    for path, words in (
        (tmp_path / "absent", "must be an executable file"),
        (plain, "must be an executable file"),
        (tmp_path, "must be an executable file"),
    ):
        with pytest.raises(ScenarioError, match=words):
            open_session(scenario_of(tmp_path, program=str(path)))
    (tmp_path / "etc").rmdir()
    with pytest.raises(ScenarioError, match="must have PX4's folder 'etc'"):
        open_session(scenario_of(tmp_path, program=str(program)))


def test_a_program_that_is_none_ends_as_a_result(tmp_path: Path) -> None:
    make_program(tmp_path).write_bytes(b"\x7fELF not a program")
    session = open_session(
        scenario_of(tmp_path, program=str(tmp_path / "px4"), patience=1.0)
    )
    assert session.log.status == "autopilot"
    assert "PX4 ended while it started" in session.log.info["cause"]


def test_px4_opens_the_onboard_link_only(tmp_path: Path) -> None:
    """Its start script takes the first script of links in the path, and its own folder
    comes last.
    """
    program = make_program(tmp_path)
    (tmp_path / "etc" / "px4-rc.mavlink").write_text(
        "mavlink start -u 18570\n", "utf-8"
    )
    program.write_text(
        '#!/bin/sh\nmavlink() { echo "$@"; }\nPATH="$PATH:$6"\n. px4-rc.mavlink\n',
        "utf-8",
    )
    number = free_instance()
    session = open_session(
        scenario_of(tmp_path, program=str(program), instance=number, patience=2.0)
    )
    links = f"start -u {14580 + number} -o {14540 + number} -m onboard -r 4000000"
    assert session.log.info["cause"] == f"PX4 ended while it started ({links})"


STREAM, DATAGRAM = socket.SOCK_STREAM, socket.SOCK_DGRAM


@pytest.mark.parametrize(
    ("kind", "first"), [(STREAM, 4560), (DATAGRAM, 14540), (DATAGRAM, 14580)]
)
def test_taken_ports_are_named(kind: int, first: int) -> None:
    number = free_instance()
    with socket.socket(socket.AF_INET, kind) as other:
        # after a flight of another test
        other.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, kind == STREAM)
        other.bind(("127.0.0.1", first + number))
        if kind == STREAM:
            other.listen(1)
        ports = f"TCP {4560 + number}, UDP {14540 + number}, {14580 + number}"
        with pytest.raises(
            LinkError, match=f"{ports} must be free for PX4: Address already in use"
        ):
            open_ports(number)
    with pytest.raises(ScenarioError, match="must be from 0 to 9"):
        open_ports(10)


def test_where_no_instance_is_free_all_ports_are_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(px4_ports, "INSTANCES", 2)
    with contextlib.ExitStack() as taken:
        for number in (0, 1):
            other = taken.enter_context(socket.socket(socket.AF_INET, DATAGRAM))
            with contextlib.suppress(OSError):  # a PX4 may fly beside the tests
                other.bind(("127.0.0.1", 14580 + number))
        with pytest.raises(
            LinkError,
            match="TCP 4560 to 4561, UDP 14540 to 14541, 14580 to 14581 must be free",
        ):
            open_ports(-1)


def test_an_instance_can_be_started_again_at_once() -> None:
    """The port of a connection that we closed first waits for a minute."""
    ports = open_ports(-1)
    with (
        ports.onboard,
        ports.listener,
        socket.create_connection(ports.listener.getsockname()) as program,
    ):
        ours = ports.listener.accept()[0]
        ours.close()
        assert program.recv(1) == b""
    again = open_ports(ports.instance)
    again.listener.close()
    again.onboard.close()


def test_any_instance_is_the_first_with_free_ports() -> None:
    first = open_ports(-1)
    second = open_ports(-1)
    try:
        assert first.instance < second.instance
        assert second.partner == ("127.0.0.1", 14580 + second.instance)
    finally:
        for each in (first, second):
            each.listener.close()
            each.onboard.close()


class Peer:
    """Plays PX4 without sockets: answers each sensor message, and says what it is given
    over the onboard port.
    """

    def __init__(self, folder: Path, scenario: Scenario | None = None) -> None:
        scenario = scenario or planned_scenario(scenario_of(folder))
        self.said, self.stamp, self.system = list[bytes](), 1, 5
        self.armed, self.first = False, b""
        self.tape = Fixed(self.answer)
        self.link = PX4Link(record_of(scenario), scenario, self.tape)
        self.parser = mavlink.Parser()

    def answer(self, channel: str) -> bytes:
        """Bytes that arrive over a channel."""
        if channel == "onboard":
            said, self.said = b"".join(self.said), []
            return said
        mode = 1 | 128 * self.armed
        first, self.first = self.first, b""
        return first + mavlink.pack(
            "HIL_ACTUATOR_CONTROLS",
            sequence=0,
            time_usec=self.stamp,
            flags=1,
            mode=mode,
        )

    def say(self, name: str, **fields: object) -> None:
        """Say something over the onboard port at the next step."""
        self.said.append(
            mavlink.pack(name, sequence=0, system=self.system, component=1, **fields)
        )  # type: ignore[arg-type]

    def fly(self, steps: int) -> dict[str, mavlink.Message]:
        """Exchange some readings; the last message of each name that the link sent over
        the onboard port.
        """
        self.tape.sent.clear()
        for _ in range(steps):
            t = (self.stamp - 1) * 1e-6 + 0.004
            self.stamp = round(t * 1e6) + 1
            fix = (t, 1.0, 2.0, 3.0, 0.0, 0.0, 0.0)
            self.link.exchange(SensedInstant(t, READINGS | {"gnss": fix}, ()), GOAL)
        sent = b"".join(
            data for channel, data in self.tape.sent if channel == "onboard"
        )
        return {m.name: m for m in self.parser.feed(sent)}

    def get_ready(self, steps: int = 600) -> None:
        """Report estimates whose origin is not ours until the link knows it."""
        self.fly(1)
        self.say("HEARTBEAT", type=2, autopilot=12)
        self.say("ESTIMATOR_STATUS", flags=7)
        # where we read 1, 2, 3: so 10, 20, 30 away
        self.say("LOCAL_POSITION_NED", x=11.0, y=-22.0, z=-33.0)
        self.fly(steps)


def test_set_points_are_north_east_down_about_the_origin_of_px4(tmp_path: Path) -> None:
    peer = Peer(tmp_path)
    peer.get_ready()
    sent = peer.fly(10)["SET_POSITION_TARGET_LOCAL_NED"]
    assert (
        sent["target_system"],
        sent["target_component"],
        sent["coordinate_frame"],
    ) == (5, 1, 1)
    place = [
        sent[f] for f in ("x", "y", "z", "vx", "vy", "vz", "afx", "afy", "afz", "yaw")
    ]
    expected = [
        0.5 + 10,
        -(-0.3 + 20),
        -(1.5 + 30),
        0.1,
        -0.2,
        -0.3,
        0.4,
        -0.5,
        -0.6,
        -0.7,
    ]
    assert place == pytest.approx(expected, rel=1e-6)
    # position, velocity, acceleration and yaw count; the yaw rate does not
    assert sent["type_mask"] == 0b100000000000


def test_offboard_mode_is_asked_for_and_then_arming_at_whole_seconds(
    tmp_path: Path,
) -> None:
    peer = Peer(tmp_path)
    peer.get_ready()
    asked = []
    for _ in range(1000):
        sent = peer.fly(1).get("COMMAND_LONG")
        if sent is not None:
            asked.append(
                (
                    peer.link._steps % 500,
                    sent["command"],
                    sent["param1"],
                    sent["param2"],
                )
            )
            assert sent["target_system"] == 5
    assert set(asked) == {(0, 176, 1, 6), (250, 400, 1, 0)}
    peer.armed = True
    peer.say("HEARTBEAT", type=2, autopilot=12, custom_mode=6 << 16)
    assert "COMMAND_LONG" not in peer.fly(1000)


def test_nothing_is_said_or_heard_over_the_onboard_port_before_px4_answers(
    tmp_path: Path,
) -> None:
    peer = Peer(tmp_path)
    heard = []

    def silent(channel: str) -> bytes:
        heard.append(channel)
        return b""

    peer.tape._answer = silent
    peer.fly(100)
    assert set(heard) == {"simulator"}
    assert {channel for channel, _ in peer.tape.sent} == {"simulator"}
    assert (peer.link.facts["answered"], peer.link.facts["lockstep_missed"]) == (0, 0)


def test_nothing_is_asked_before_the_estimates_are_valid(tmp_path: Path) -> None:
    peer = Peer(tmp_path)
    peer.fly(1)
    peer.say("HEARTBEAT", type=2, autopilot=12)
    peer.say("LOCAL_POSITION_NED", x=1.0, y=2.0, z=3.0)
    peer.say("ESTIMATOR_STATUS", flags=0b110)
    assert set(peer.fly(1500)) == {"HEARTBEAT"}


def test_the_flight_follows_once_it_is_armed_offboard_and_halfway_up(
    tmp_path: Path,
) -> None:
    peer = Peer(tmp_path)
    peer.get_ready()
    peer.armed = True
    peer.say("HEARTBEAT", type=2, autopilot=12, custom_mode=6 << 16)
    # the stand is 0.5 m below the start, half of it 0.25 m
    low, high = -(1.5 - 0.26 + 30), -(1.5 - 0.24 + 30)
    peer.say("LOCAL_POSITION_NED", x=10.5, y=-19.7, z=low)
    peer.fly(3)
    assert not peer.link.following
    peer.say("LOCAL_POSITION_NED", x=10.5, y=-19.7, z=high)
    peer.fly(3)
    assert peer.link.following
    peer.say("HEARTBEAT", type=2, autopilot=12, custom_mode=6 << 16, system_status=5)
    peer.fly(3)
    assert peer.link.facts["failsafes"] == 1


def test_a_flight_that_leaves_offboard_mode_ends_if_it_does_not_come_back(
    tmp_path: Path,
) -> None:
    peer = Peer(tmp_path)
    peer.get_ready()
    peer.armed = True
    peer.fly(1)
    peer.link.following = True
    peer.say("HEARTBEAT", type=2, autopilot=12, custom_mode=4 << 16)
    peer.fly(740)
    peer.say("HEARTBEAT", type=2, autopilot=12, custom_mode=6 << 16)
    peer.fly(5)
    peer.say("HEARTBEAT", type=2, autopilot=12, custom_mode=4 << 16)
    peer.fly(749)
    assert peer.link.facts["left_offboard"] == 2
    with pytest.raises(LinkError, match="PX4 left offboard mode for its mode 4"):
        peer.fly(3)


def test_words_of_another_system_are_not_heard(tmp_path: Path) -> None:
    peer = Peer(tmp_path)
    peer.get_ready()
    peer.system = 9
    peer.say("STATUSTEXT", severity=2, text="not yours")
    peer.say("HEARTBEAT", type=2, autopilot=12, custom_mode=6 << 16)
    peer.fly(2)
    assert peer.link.facts["said"] == ""
    assert peer.link._vehicle.mode == 0


def test_datagrams_of_another_sender_are_left_out(tmp_path: Path) -> None:
    peer = Peer(tmp_path)
    ports = open_ports(-1)
    ports.listener.close()
    peer.link._udp, peer.link._partner = ports.onboard, ports.partner
    address = ("127.0.0.1", 14540 + ports.instance)
    with (
        ports.onboard,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own,
    ):
        own.bind(ports.partner)
        other.sendto(b"other", address)
        own.sendto(b"own", address)
        assert peer.link._datagrams() == b"own"


NAMES = (
    "HEARTBEAT",
    "STATUSTEXT",
    "LOCAL_POSITION_NED",
    "ESTIMATOR_STATUS",
    "COMMAND_ACK",
    "HIL_ACTUATOR_CONTROLS",
)

ODD = (np.nan, np.inf, -np.inf, 1e38, -1.0, 0.5)


def fuzzed(random: np.random.Generator, sequence: int) -> bytes:
    """Random bytes, a frame with some bytes changed, or a frame of any bits or odd
    numbers with its right checksum.
    """
    kind, name = random.integers(5), NAMES[random.integers(len(NAMES))]
    if kind == 0:
        return random.bytes(random.integers(1, 300))
    if kind == 1:
        changed = bytearray(mavlink.pack(name, sequence=sequence, system=5))
        for _ in range(random.integers(1, 4)):
            changed[random.integers(len(changed))] = random.integers(256)
        return bytes(changed)
    if kind == 4:
        controls = random.choice(
            ODD if random.integers(4) == 0 else (0.0, 0.3, 1.0), 16
        ).tolist()
        stamp = int(random.integers(3))
        return mavlink.pack(
            "HIL_ACTUATOR_CONTROLS",
            sequence=sequence,
            time_usec=stamp,
            flags=1,
            controls=controls,
        )
    definition = mavlink.DEFINITIONS[name]
    payload = random.bytes(256)
    if kind == 3:
        payload = b"".join(struct.pack("<f", random.choice(ODD)) for _ in range(64))
    payload = payload[: definition.layout.size]
    body = (
        bytes((len(payload), 0, 0, sequence & 255, 5, 1))
        + definition.number.to_bytes(3, "little")
        + payload
    )
    return (
        b"\xfd" + body + mavlink.checksum(body + definition.check).to_bytes(2, "little")
    )


@pytest.mark.parametrize(
    "packets", [700, pytest.param(20_000, marks=pytest.mark.thorough)]
)
def test_fuzzed_packets_end_as_one_line_or_are_passed_over(
    tmp_path: Path, packets: int
) -> None:
    random = np.random.default_rng(7)
    scenario = planned_scenario(scenario_of(tmp_path))
    peer, ended, causes = Peer(tmp_path, scenario), 0, set[str]()
    peer.get_ready()
    for packet in range(packets):
        data = fuzzed(random, packet)
        if packet % 2:
            peer.said.append(data)
        else:
            peer.first = data
        try:
            peer.fly(1)
        except LinkError as error:
            assert "\n" not in str(error)
            causes.add(" ".join(str(error).split()[:4]))
            ended += 1
            peer = Peer(tmp_path, scenario)
            peer.get_ready(600 if ended % 100 == 0 else 1)
    assert packets / 200 < ended < packets / 2
    assert len(causes) >= 3


def test_px4_is_released_in_hold_only_and_failsafes_are_counted_when_they_begin(
    tmp_path: Path,
) -> None:
    peer = Peer(tmp_path)
    link, told = peer.link, {"autopilot": 12, "base_mode": 128}

    def hear(main: int, sub: int, status: int = 4) -> None:
        frame = mavlink.pack(
            "HEARTBEAT",
            sequence=0,
            system=5,
            component=1,
            custom_mode=main << 16 | sub << 24,
            system_status=status,
            **told,
        )
        for message in mavlink.Parser().feed(frame):
            link._hear(message)
        link._leave()

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link._udp:
        # offboard, take-off, return, landing
        for main, sub in ((6, 0), (4, 2), (4, 5), (4, 6)):
            hear(main, sub)
            assert not link.released
        hear(4, 3)
        assert link.released
    link.following = True
    for status in (4, 5, 5, 5, 4, 5):
        hear(4, 3, status)
    assert link.facts["failsafes"] == 2


def test_px4_is_asked_to_hold_and_to_keep_holding_soon_after_the_set_points_end(
    tmp_path: Path,
) -> None:
    peer = Peer(tmp_path)
    peer.get_ready()
    assert (peer.link.facts["steps"], peer.link.facts["answered"]) == (601, 601)
    peer.armed = True
    peer.link.release()
    sent = peer.fly(600)
    told, asked = sent["PARAM_SET"], sent["COMMAND_LONG"]
    assert (told["target_system"], told["target_component"], told["param_id"]) == (
        5,
        1,
        "COM_OF_LOSS_T",
    )
    assert (told["param_value"], told["param_type"]) == (pytest.approx(0.15), 9)
    assert (asked["command"], asked["target_component"]) == (176, 1)
    assert [asked[f"param{k}"] for k in (1, 2, 3)] == [1, 4, 3]


def test_other_messages_than_the_answer_do_not_make_it_wait_for_ever(
    tmp_path: Path,
) -> None:
    peer = Peer(tmp_path)
    ours, theirs = socket.socketpair()
    beat = mavlink.pack("HEARTBEAT", sequence=0, system=5, component=1)
    with ours, theirs:
        peer.link._tcp = ours
        theirs.sendall(beat)
        late = time.monotonic() - 0.01
        # what came while we were away is read
        assert peer.link._read(late, False) == beat
        theirs.sendall(beat)
        assert peer.link._read(late, True) == b""
