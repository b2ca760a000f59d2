"""Joint ports: the datagrams, who may command, and what a silence does."""

import math
import random
import socket
import struct
import time
from collections import deque

import pytest

from skyarm.links import joint_port
from skyarm.links.joint_port import (
    COMMAND,
    HELLO,
    STATE,
    JointPortError,
    JointServer,
    NoJoints,
    UdpJoints,
    pack,
    unpack,
)
from skyarm.links.outside.joint_links import open_joints
from skyarm.vehicle.vehicle_files import load_vehicle
from support.components import registry_kept


@pytest.fixture
def server():
    made = JointServer(0, 2)
    yield made
    made.close()


@pytest.fixture
def arm(server):
    made = UdpJoints("127.0.0.1", server.port, 2)
    yield made
    made.close()


def settle(condition, seconds=2.0):
    until = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < until
        time.sleep(0.005)
    return found


def test_a_datagram_keeps_its_numbers():
    assert unpack(pack(COMMAND, 2, 1.5, (0.25, -3.0)), 2) == (
        COMMAND,
        1.5,
        (0.25, -3.0),
    )
    assert unpack(pack(STATE, 1, 2.5, (1.0, 2.0)), 1) == (STATE, 2.5, (1.0, 2.0))
    assert len(pack(HELLO, 2, 0.0)) == 16


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"SKJ1",
        pack(COMMAND, 3, 0.0, (1.0, 2.0, 3.0)),
        pack(COMMAND, 2, 0.0, (1.0,)),
        pack(COMMAND, 2, 0.0, (1.0, float("nan"))),
        pack(COMMAND, 2, float("inf"), (1.0, 2.0)),
        pack(9, 2, 0.0),
        b"\xfd" * 40,
    ],
)
def test_anything_else_is_no_datagram(data):
    assert unpack(data, 2) is None


def test_states_come_and_setpoints_go(server, arm):
    assert server.exchange(1.0, (0.1, 0.2), (0.3, 0.4)) is None  # nobody has asked
    assert arm.read() is None
    settle(lambda: server.exchange(2.0, (0.1, 0.2), (0.3, 0.4)) is None and arm.read())
    server.exchange(3.0, (0.5, 0.6), (0.7, 0.8))
    server.exchange(4.0, (0.9, 1.0), (1.1, 1.2))
    found = settle(arm.read)
    assert (found.time, found.joints, found.joint_rates) == (
        4.0,
        (0.9, 1.0),
        (1.1, 1.2),
    )
    arm.send((5.0, 6.0), 3.5)
    assert settle(lambda: server.exchange(4.5, (0.0, 0.0), (0.0, 0.0))) == (5.0, 6.0)
    assert server.facts["commands"] == 1
    assert server.facts["age_p50_s"] == pytest.approx(1.0)


def test_a_released_arm_is_its_owners(server, arm):
    arm.send((5.0, 6.0), 0.0)
    settle(lambda: server.exchange(0.0, (0.0, 0.0), (0.0, 0.0)))
    arm.release()
    settle(lambda: server.exchange(0.0, (0.0, 0.0), (0.0, 0.0)) is None)


def test_a_silent_commander_loses_the_arm(server, arm, monkeypatch):
    monkeypatch.setattr(joint_port, "FRESH", 0.05)
    arm.send((5.0, 6.0), 0.0)
    settle(lambda: server.exchange(0.0, (0.0, 0.0), (0.0, 0.0)))
    time.sleep(0.06)
    assert server.exchange(0.0, (0.0, 0.0), (0.0, 0.0)) is None


def test_ages_are_told_by_their_median_and_their_99_percent(server):
    assert server.facts == {"commands": 0, "refused": 0}
    server._ages.extend(each / 1000.0 for each in reversed(range(201)))
    assert server.facts == {
        "commands": 0,
        "refused": 0,
        "age_p50_s": 0.1,
        "age_p99_s": 0.198,
    }


def test_a_second_commander_is_refused_while_the_first_is_there(server, arm):
    arm.send((5.0, 6.0), 0.0)
    settle(lambda: server.exchange(0.0, (0.0, 0.0), (0.0, 0.0)))
    other = UdpJoints("127.0.0.1", server.port, 2)
    try:
        other.send((7.0, 8.0), 0.0)
        settle(
            lambda: (
                server.exchange(0.0, (0.0, 0.0), (0.0, 0.0)),
                server.facts["refused"],
            )[1]
        )
        assert server.exchange(0.0, (0.0, 0.0), (0.0, 0.0)) == (5.0, 6.0)
    finally:
        other.close()


def test_a_new_commander_does_not_find_the_setpoints_of_the_last(
    server, arm, monkeypatch
):
    monkeypatch.setattr(joint_port, "FRESH", 0.05)
    arm.send((5.0, 6.0), 0.0)
    settle(lambda: server.exchange(0.0, (0.0, 0.0), (0.0, 0.0)))
    time.sleep(0.06)
    other = UdpJoints("127.0.0.1", server.port, 2)
    try:
        other.read()  # requests states
        time.sleep(0.02)
        assert server.exchange(0.0, (0.0, 0.0), (0.0, 0.0)) is None
        assert settle(other.read)
    finally:
        other.close()


def test_a_taken_port_is_one_line(server):
    with pytest.raises(
        JointPortError, match=f"UDP port {server.port} of the joints: must be free"
    ):
        JointServer(server.port, 2)


def test_the_port_is_on_the_loopback_alone(server):
    assert server._socket.getsockname()[0] == "127.0.0.1"


def test_a_vehicle_without_joints_needs_no_port():
    found = open_joints(None, load_vehicle("hummingbird"))
    assert isinstance(found, NoJoints)
    assert found.read().joints == ()


def fuzzed(rng, kind):
    """Datagram that is none for two joints: noise, cut, longer, a changed head, an odd
    number; or a STATE's.
    """
    whole = pack(
        kind,
        2,
        rng.uniform(0.0, 9.0),
        [rng.uniform(-9.0, 9.0) for _ in range(2 * kind)],
    )
    match rng.randrange(5):
        case 0:
            return rng.randbytes(rng.randrange(300))
        case 1:
            return whole[: rng.randrange(len(whole))]
        case 2:
            return whole + rng.randbytes(rng.randint(1, 100))
        case 3:
            place = rng.choice((0, 1, 2, 3, 5, 6, 7))  # all but the kind
            return (
                whole[:place]
                + bytes([whole[place] ^ rng.randint(1, 255)])
                + whole[place + 1 :]
            )
        case _:
            return (
                whole[:8]
                + struct.pack("<d", rng.choice((math.nan, math.inf, -math.inf)))
                + whole[16:]
            )


@pytest.mark.parametrize(
    "packets", [1000, pytest.param(20_000, marks=pytest.mark.thorough)]
)
def test_fuzzed_datagrams_change_nothing_and_hide_no_command(
    server, arm, monkeypatch, packets
):
    """Both ends: set points of the commander and states of the owner pass, all else
    does not.
    """
    monkeypatch.setattr(joint_port, "FRESH", 1e3)
    rng, expected, refused = random.Random(3), (0.5, 0.5), 0
    arm.send(expected, 0.0)
    settle(lambda: server.exchange(0.0, (0.0, 0.0), (0.0, 0.0)))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        for step in range(packets):
            if step % 5 == 0:
                expected = (rng.uniform(-1e9, 1e9), 1.0 / (step + 1))
                arm.send(expected, 0.0)
            else:
                sender = (
                    arm._socket.send,
                    lambda data: other.sendto(data, ("127.0.0.1", server.port)),
                )[step % 2]
                sender(
                    pack(COMMAND, 2, 0.0, (7.0, 7.0))
                    if step % 8 == 1 and step % 2
                    else fuzzed(rng, COMMAND)
                )
                refused += 1
            arm.read()
            server._socket.sendto(fuzzed(rng, STATE), arm._socket.getsockname())
            assert server.exchange(step, (0.1, 0.2), (0.3, step)) == expected
            assert server.facts["refused"] == refused
            found = arm.read()
            assert (found.time, found.joints, found.joint_rates) == (
                step,
                (0.1, 0.2),
                (0.3, step),
            )


def test_a_flood_of_datagrams_does_not_hold_the_owner_up(server, arm):
    # the usual one holds some 260
    server._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
    for _ in range(300):
        arm.send((1.0, 2.0), 0.0)
    server.exchange(0.0, (0.0, 0.0), (0.0, 0.0))
    assert server.facts["commands"] == 256
    assert server.exchange(0.0, (0.0, 0.0), (0.0, 0.0)) == (1.0, 2.0)
    assert server.facts["commands"] == 300


@pytest.mark.parametrize(
    ("url", "words"),
    [
        (None, "--joints: is missing, must be given for the 2 joints"),
        ("udp://127.0.0.1", "must be udp://HOST:PORT"),
        ("udp://127.0.0.1:99999", "must be udp://HOST:PORT"),
        ("tcp://127.0.0.1:5", "must be udp://HOST:PORT"),
        ("dynamixel:", "must be udp://HOST:PORT"),
        ("dynamixel:/dev/x?ids=1,2&speed=3", "'speed' must be one of"),
        ("dynamixel:/dev/x?ids=1,a", "must have numbers"),
        ("dynamixel:/dev/x?ids=1,1&torque=2", "ids must be 2 different numbers"),
        ("dynamixel:/dev/x?ids=1,2", "torque must be given"),
    ],
)
def test_an_address_that_does_not_fit_is_one_line(url, words):
    with pytest.raises(JointPortError) as error:
        open_joints(url, load_vehicle("hummingbird_arm2"))
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_a_users_function_makes_a_port(tmp_path):
    file = tmp_path / "own_arm.py"
    file.write_text(
        "from skyarm.links.joint_port import NoJoints\n\ndef make(vehicle):\n    found"
        " = NoJoints()\n    found.count = vehicle.n\n    return found\n\ndef"
        " wrong(vehicle):\n    return vehicle\n"
    )
    vehicle = load_vehicle("hummingbird_arm2")
    with registry_kept():
        assert open_joints(f"{file}:make", vehicle).count == 2
        for maker, words in (
            ("wrong", "wrong must return a JointLink"),
            ("none", "must have a function 'none'"),
        ):
            with pytest.raises(JointPortError, match=words):
                open_joints(f"{file}:{maker}", vehicle)


def test_the_newest_ages_are_kept_and_all_commands_counted(server, arm, monkeypatch):
    assert server._ages.maxlen == joint_port.MOST_AGES
    server._ages = deque(maxlen=3)
    for k in range(5):
        arm.send((0.0, 0.0), 0.0)
        settle(
            lambda k=k: (
                server.exchange(1.0, (0.0, 0.0), (0.0, 0.0)) is not None
                and server.facts["commands"] > k
            )
        )
    assert server.facts["commands"] == 5
    assert len(server._ages) == 3
