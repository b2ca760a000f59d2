"""MAVLink of a law to an autopilot: addresses, who is heard, what is believed, and what
goes out.
"""

import math
import random
import socket
import time

import numpy as np
import pytest

from links.outside.stand_in import version_1
from skyarm.algebra import Vec3
from skyarm.links import mavlink
from skyarm.links.outside import offboard_link
from skyarm.links.outside.offboard_link import (
    MODES,
    OffboardError,
    OffboardLink,
    parse_link,
)
from skyarm.links.outside.rate_commands import RateCommand

QUATERNION = (0.5, 0.5, -0.5, 0.5)


class Peer:
    """Autopilot's side by hand: sends what a test says, and shows what arrives."""

    def __init__(self, link, system=3):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(1.0)
        self.to, self.system, self.sequence = link._socket.getsockname(), system, 0
        self.link, self.parser = link, mavlink.Parser(datagrams=True)

    def say(self, name, component=1, **fields):
        self.sequence += 1
        frame = mavlink.pack(
            name,
            sequence=self.sequence,
            system=self.system,
            component=component,
            **fields,
        )
        self.socket.sendto(frame, self.to)
        self.link.wait(0.2)

    def heartbeat(self, **fields):
        self.say(
            "HEARTBEAT",
            **{
                "autopilot": 12,
                "type": 2,
                "base_mode": 128,
                "custom_mode": 4 << 16 | 3 << 24,
            }
            | fields,
        )

    def odometry(self, at, **fields):
        words = {
            "q": QUATERNION,
            "x": 1.0,
            "y": 2.0,
            "z": 3.0,
            "vx": 4.0,
            "vy": 5.0,
            "vz": 6.0,
            "frame_id": 1,
        }
        self.say(
            "ODOMETRY",
            **words | {"time_usec": round(1e6 * at), "child_frame_id": 1} | fields,
        )

    def heard(self):
        return self.parser.feed(self.socket.recv(4096))[0]


@pytest.fixture
def link():
    made = _free_link()
    yield made
    made.close()


def _free_link():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    return OffboardLink(f"mavlink://127.0.0.1:{port}")


@pytest.fixture
def peer(link):
    made = Peer(link)
    yield made
    made.socket.close()


@pytest.mark.parametrize(
    "url",
    [
        "",
        "14540",
        "udp://127.0.0.1:14540",
        "mavlink://127.0.0.1",
        "mavlink://:14540",
        "mavlink://h:1/x",
        "mavlink://h:99999",
    ],
)
def test_another_address_is_refused_in_one_line(url):
    with pytest.raises(OffboardError, match="must be mavlink://HOST:PORT") as error:
        parse_link(url)
    assert "\n" not in str(error.value)


def test_both_kinds_of_address():
    assert parse_link("mavlink://127.0.0.1:14540") == ("mavlink", "127.0.0.1", 14540)
    assert parse_link("mavlink-out://10.0.0.2:14580") == (
        "mavlink-out",
        "10.0.0.2",
        14580,
    )


def test_a_taken_port_is_one_line(link):
    port = link._socket.getsockname()[1]
    begun = time.monotonic()
    with pytest.raises(
        OffboardError,
        match=f"--link = 'mavlink://127.0.0.1:{port}': Address already in use",
    ):
        OffboardLink(f"mavlink://127.0.0.1:{port}", patience=0.3)
    assert 0.2 < time.monotonic() - begun < 2.0


def test_a_link_that_calls_sends_first():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        other.settimeout(1.0)
        link = OffboardLink(f"mavlink-out://127.0.0.1:{other.getsockname()[1]}")
        try:
            link.beat()
            found = mavlink.Parser(datagrams=True).feed(other.recv(4096))[0]
        finally:
            link.close()
    assert (found.name, found["type"]) == ("HEARTBEAT", 18)


def test_a_link_that_calls_hears_only_whom_it_calls():
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger,
    ):
        other.bind(("127.0.0.1", 0))
        link = OffboardLink(f"mavlink-out://127.0.0.1:{other.getsockname()[1]}")
        frame = mavlink.pack(
            "HEARTBEAT", sequence=1, system=3, component=1, autopilot=12, type=2
        )
        try:
            link.beat()
            own = link._socket.getsockname()
            assert own[0] == "127.0.0.1"
            stranger.sendto(frame, own)
            link.wait(0.2)
            assert not link.has_autopilot
            other.sendto(frame, own)
            link.wait(0.2)
            assert link.has_autopilot
        finally:
            link.close()


def test_what_was_not_asked_for_is_not_kept(link, peer):
    peer.heartbeat()
    peer.say("PARAM_VALUE", param_id="OTHER", param_value=1.0, param_type=9)
    assert link.parameters == {}
    link.request_parameter("MPC_THR_HOVER")
    peer.say("PARAM_VALUE", param_id="MPC_THR_HOVER", param_value=0.5, param_type=9)
    assert link.parameters == {"MPC_THR_HOVER": 0.5}


def test_the_newest_round_trips_are_kept(link, peer, monkeypatch):
    peer.heartbeat()
    for _ in range(offboard_link.MOST_TIMES + 1):
        now = time.monotonic_ns()
        link._hear_time({"tc1": now, "ts1": now})
    assert len(link.round_trips) == offboard_link.MOST_TIMES


def test_an_estimate_comes_in_our_axes(link, peer):
    peer.heartbeat()
    assert link.has_autopilot
    assert link.armed
    peer.odometry(5.0, rollspeed=0.1, pitchspeed=0.2, yawspeed=0.3)
    state = link.take()
    assert (state.time, [*state.position], [*state.velocity]) == (
        5.0,
        [1.0, -2.0, -3.0],
        [4.0, -5.0, -6.0],
    )
    assert [*state.rate] == pytest.approx([0.1, -0.2, -0.3])
    assert [*state.quaternion] == pytest.approx([0.5, 0.5, 0.5, -0.5])
    assert state.specific_force is None
    assert link.take() is None  # once


def test_a_velocity_in_body_axes_is_turned(link, peer):
    peer.heartbeat()
    peer.odometry(5.0, child_frame_id=12)
    w, x, y, z = QUATERNION
    R = np.array(
        [  # of the wire, body to north, east, down
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    north, east, down = R @ [4.0, 5.0, 6.0]
    assert [*link.take().velocity] == pytest.approx([north, -east, -down])


def test_an_attitude_carries_the_place_on(link, peer):
    peer.heartbeat()
    peer.odometry(5.0)
    link.take()
    names = dict(zip(("q1", "q2", "q3", "q4"), QUATERNION, strict=True))
    peer.say("ATTITUDE_QUATERNION", time_boot_ms=5008, rollspeed=1.0, **names)
    state = link.take()
    assert state.time == pytest.approx(5.008)
    assert [*state.position] == pytest.approx(
        [1.0 + 4.0 * 0.008, -2.0 - 5.0 * 0.008, -3.0 - 6.0 * 0.008]
    )
    assert state.rate.x == 1.0
    peer.odometry(5.012)  # only a place, while attitudes come
    assert link.take() is None
    # the place is too old for it
    peer.say("ATTITUDE_QUATERNION", time_boot_ms=5300, **names)
    assert link.take() is None


def test_the_accelerometer_goes_with_the_next_estimate(link, peer):
    peer.heartbeat()
    peer.say("HIGHRES_IMU", xacc=1.0, yacc=2.0, zacc=-9.0)
    peer.odometry(5.0)
    assert [*link.take().specific_force] == [1.0, -2.0, 9.0]
    heard = link.force_heard
    for fields in ({"xacc": math.nan}, {}):  # three zeros are no reading
        peer.say("HIGHRES_IMU", **fields)
    peer.odometry(5.1)
    assert [*link.take().specific_force] == [1.0, -2.0, 9.0]
    assert link.force_heard == heard  # and its age shows that nothing came since


@pytest.mark.parametrize(
    "fields",
    [
        {"x": math.nan},
        {"vy": math.inf},
        {"q": (0.0,) * 4},
        {"q": (2.0, 0.0, 0.0, 0.0)},
        {"rollspeed": math.nan},
    ],
)
def test_numbers_that_are_no_state_are_not_taken(link, peer, fields):
    peer.heartbeat()
    peer.odometry(5.0, **fields)
    assert link.take() is None
    peer.odometry(5.1)
    assert link.take() is not None


def test_an_older_estimate_is_not_taken(link, peer):
    peer.heartbeat()
    peer.odometry(5.0)
    assert link.take() is not None
    peer.odometry(4.9)
    assert link.take() is None


@pytest.mark.parametrize(
    ("attitude", "taken"),
    [((0.6, 0.0, 0.8, 0.0), True), ((0.5, 0.5, 0.5, -0.6), False)],
)
def test_a_quaternion_has_unit_length(link, peer, attitude, taken):
    peer.heartbeat()
    peer.odometry(2.0, q=attitude)
    assert (link.take() is not None) == taken


def test_an_estimate_of_the_same_instant_is_the_same(link, peer):
    peer.heartbeat()
    peer.odometry(at=2.0)
    link.fresh = False
    peer.odometry(at=2.0, x=9.0)
    assert not link.fresh
    assert link.state.position.x == pytest.approx(1.0)


def test_a_wait_that_is_over_reads_what_has_come(link, peer):
    peer.socket.sendto(
        mavlink.pack(
            "HEARTBEAT", sequence=0, system=3, component=1, autopilot=12, type=2
        ),
        peer.to,
    )
    link.wait(-1.0)
    assert link.modes is MODES[12]


def test_an_autopilot_that_begins_in_mavlink_1_is_answered_in_mavlink_2(link, peer):
    """PX4 and ArduPilot change to version 2 once they hear it, and wait for it."""
    assert link.hint == ""
    beat = mavlink.pack(
        "HEARTBEAT", sequence=0, system=3, autopilot=12, type=2, base_mode=128
    )
    peer.socket.sendto(version_1(beat), peer.to)
    link.wait(0.2)
    assert (link.has_autopilot, link.system, link.armed) == (True, 3, True)
    assert "only MAVLink 1 came: set MAV_PROTO_VER = 2" in link.hint
    link.beat()
    assert peer.socket.recv(4096)[0] == 0xFD
    peer.heartbeat()
    assert link.hint == ""


def test_only_the_first_autopilot_is_heard(link, peer):
    peer.heartbeat(autopilot=8)  # a ground station
    assert not link.has_autopilot
    peer.say("HEARTBEAT", component=100, autopilot=12)  # a camera
    assert not link.has_autopilot
    peer.odometry(1.0)
    assert link.take() is None
    peer.heartbeat()
    other = Peer(link, system=3)
    try:
        other.heartbeat(base_mode=0)
        other.odometry(9.0)
    finally:
        other.socket.close()
    assert link.armed
    assert link.take() is None


def test_a_set_point_has_rates_and_thrust_in_the_wires_axes(link, peer):
    peer.heartbeat()
    link.send(RateCommand(rates=Vec3(0.1, 0.2, 0.3), thrust=0.4))
    found = peer.heard()
    assert (found.name, found["type_mask"], found["target_system"], found.system) == (
        "SET_ATTITUDE_TARGET",
        128,
        3,
        3,
    )
    rates = [found[f"body_{axis}_rate"] for axis in ("roll", "pitch", "yaw")]
    assert [*rates, found["thrust"]] == pytest.approx([0.1, -0.2, -0.3, 0.4])


@pytest.mark.parametrize(
    ("number", "outside", "hold"), [(12, (6, 0), (4, 3)), (3, (4, 0), (17, 0))]
)
def test_modes_are_asked_for_by_the_autopilots_numbers(
    link, peer, number, outside, hold
):
    peer.heartbeat(autopilot=number)
    link.request_outside()
    found = peer.heard()
    assert (found["command"], found["param1"], found["param2"], found["param3"]) == (
        176,
        1.0,
        *outside,
    )
    link.request_hold()
    found = peer.heard()
    assert (found["param2"], found["param3"]) == hold
    assert link.modes is MODES[number]


def test_a_heartbeats_mode_is_recognised():
    px4, ardupilot = MODES[12], MODES[3]
    assert px4.is_outside(6 << 16)
    assert not px4.is_outside(4 << 16 | 3 << 24)
    assert px4.is_hold(4 << 16 | 3 << 24)
    assert ardupilot.is_outside(4)
    assert ardupilot.is_hold(17)


OURS = {"command": 176, "target_system": 3, "target_component": 191}


def test_an_answer_to_the_mode_says_whether_it_was_taken(link, peer):
    peer.heartbeat()
    link.request_outside()
    peer.say("COMMAND_ACK", **OURS | {"command": 511}, result=0)
    assert not link.accepted
    peer.say("COMMAND_ACK", **OURS, result=1)
    assert (link.accepted, link.refused) == (False, 1)
    peer.say("COMMAND_ACK", **OURS, result=0)
    assert link.accepted


@pytest.mark.parametrize(
    "other",
    [{"target_system": 255}, {"target_component": 190}, {"target_component": 0}],
)
def test_an_answer_to_another_program_is_none_to_us(link, peer, other):
    """A ground station asks for modes, too."""
    peer.heartbeat()
    link.request_outside()
    peer.say("COMMAND_ACK", **OURS | other, result=0)
    assert not link.accepted


def test_an_answer_before_the_request_is_none(link, peer):
    peer.heartbeat()
    peer.say("COMMAND_ACK", **OURS, result=0)
    assert not link.accepted


def test_lost_frames_are_the_autopilots_from_the_request_on(link, peer):
    """A simulator's frames, which the autopilot forwards, are numbered by others."""
    peer.heartbeat()
    peer.sequence += 5
    peer.heartbeat()
    link.request_outside()
    assert link.lost == 0
    for skipped, component, found in ((3, 1, 3), (0, 51, 3), (7, 51, 3)):
        peer.sequence += skipped
        peer.say("HEARTBEAT", component=component, autopilot=12)
        assert link.lost == found


def test_the_round_trip_is_timed_by_its_answer_only(link, peer):
    peer.heartbeat()
    link.beat()
    assert peer.heard().name == "HEARTBEAT"
    asked = peer.heard()
    peer.say("TIMESYNC", tc1=round(77.0e9), ts1=asked["ts1"])
    peer.say("TIMESYNC", tc1=round(99.0e9), ts1=1)  # an answer to something else
    assert len(link.round_trips) == 1
    assert 0.0 < link.round_trips[0] < 0.5


def test_streams_are_asked_for_by_interval(link, peer):
    peer.heartbeat()
    link.request_estimates(200.0)
    asked = {}
    for _ in range(6):
        found = peer.heard()
        asked[found["param1"]] = found["param2"]
    assert asked[331.0] == asked[31.0] == asked[105.0] == 2500.0
    assert asked[245.0] == 125000.0
    assert asked[0.0] == 50000.0  # heartbeats, which tell the mode


def test_ardupilot_is_asked_for_no_rate_that_it_refuses(link, peer):
    peer.heartbeat(autopilot=3)
    link.request_estimates(200.0)
    asked = {
        found["param1"]: found["param2"] for found in (peer.heard() for _ in range(6))
    }
    assert asked[31.0] == asked[32.0] == 4000.0


def test_garbage_leaves_the_link_as_it_was(link, peer):
    peer.heartbeat()
    peer.odometry(5.0)
    first = link.take()
    rng = random.Random(1)
    good = mavlink.pack(
        "ODOMETRY",
        sequence=1,
        system=3,
        time_usec=6_000_000,
        q=QUATERNION,
        child_frame_id=1,
    )
    for _ in range(2000):
        damaged = bytearray(good)
        for _ in range(rng.choice((1, 2, 3))):
            damaged[rng.randrange(len(damaged))] ^= rng.randint(1, 255)
        peer.socket.sendto(
            rng.choice([bytes(damaged), rng.randbytes(rng.randint(0, 300))]),
            link._socket.getsockname(),
        )
        link.wait(0.0)
    link.wait(0.2)
    assert link.state == first
    peer.odometry(1e6)
    assert link.take() is not None
