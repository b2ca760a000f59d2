"""A node of ROS 2 against cyclonedds's own types and encoder, and against Fast DDS
where it is.
"""

import errno
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import skyarm
from skyarm.links.ros import RosError, open_node
from skyarm.links.ros.live_flight import fly_live
from skyarm.log.ros.message_bytes import decode, encode
from skyarm.log.ros.messages import DEFINITIONS, fields

pytest.importorskip("cyclonedds", reason="needs the extra 'ros'")

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float64, int32, sequence, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from skyarm.links.ros.ros2_node import Ros2Node, _bind_to_loopback

DOMAIN = 2 + 2 * (os.getpid() % 48)

NUMBERS = "std_msgs/Float64MultiArray"


@dataclass
class Dimension(IdlStruct, typename="std_msgs::msg::dds_::MultiArrayDimension_"):
    label: str
    size: uint32
    stride: uint32


@dataclass
class Layout(IdlStruct, typename="std_msgs::msg::dds_::MultiArrayLayout_"):
    dim: sequence[Dimension]
    data_offset: uint32


@dataclass
class Numbers(IdlStruct, typename="std_msgs::msg::dds_::Float64MultiArray_"):
    layout: Layout
    data: sequence[float64]


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class Clock(IdlStruct, typename="rosgraph_msgs::msg::dds_::Clock_"):
    clock: Time


def wait_until(happened: Callable[[], object], seconds: float = 10.0) -> None:
    until = time.monotonic() + seconds
    while not happened():
        assert time.monotonic() < until
        time.sleep(0.01)


@pytest.fixture
def node():
    found = Ros2Node(DOMAIN)
    yield found
    found.close()


def test_messages_go_both_ways_through_types_of_another_hand(node):
    """In one process and domain: the other participant has types and an encoder that
    are not ours.
    """
    other = DomainParticipant(DOMAIN)
    topics = [
        Topic(other, f"rt/{name}", Numbers)
        for name in ("skyarm/applied", "skyarm/command")
    ]
    reader = DataReader(
        other,
        topics[0],
        qos=Qos(Policy.Reliability.Reliable(1000), Policy.History.KeepAll),
    )
    writer = DataWriter(other, topics[1])
    node.advertise("/skyarm/applied", NUMBERS)
    node.subscribe("/skyarm/command", NUMBERS)
    wait_until(lambda: node.subscribers("/skyarm/applied") == 1)
    values = {
        "data": np.array([1.5, -2.5]),
        "layout": {"dim": [{"label": "rotors", "size": 2}], "data_offset": 1},
    }
    for _ in range(20):
        node.send(
            "/skyarm/applied", encode(NUMBERS, DEFINITIONS, values, 1)[0].tobytes()
        )
    found: list[Numbers] = []
    wait_until(lambda: found.extend(reader.take(100)) or len(found) == 20)
    assert found[-1] == Numbers(Layout([Dimension("rotors", 2, 0)], 1), [1.5, -2.5])
    writer.write(Numbers(Layout([], 0), [3.0]))
    writer.write(Numbers(Layout([Dimension("a", 1, 2)], 4), [4.0, 5.0]))
    heard: list[bytes] = []
    wait_until(lambda: heard.extend(node.take("/skyarm/command")) or len(heard) == 2)
    read = [decode(NUMBERS, DEFINITIONS, each) for each in heard]
    assert read[0] == {"layout": {"dim": [], "data_offset": 0}, "data": [3.0]}
    assert read[1] == {
        "layout": {"dim": [{"label": "a", "size": 1, "stride": 2}], "data_offset": 4},
        "data": [4.0, 5.0],
    }


def test_a_latched_message_goes_to_whoever_comes_later(node):
    node.advertise("/tf_static", NUMBERS, latched=True)
    for value in (1.0, 2.0):
        node.send(
            "/tf_static",
            encode(NUMBERS, DEFINITIONS, {"data": np.array([value])}, 1)[0].tobytes(),
        )
    other = DomainParticipant(DOMAIN)
    qos = Qos(Policy.Reliability.Reliable(1000), Policy.Durability.TransientLocal)
    reader = DataReader(other, Topic(other, "rt/tf_static", Numbers), qos=qos)
    found: list[Numbers] = []
    wait_until(lambda: found.extend(reader.take(10)) or found)
    assert [each.data for each in found] == [[2.0]]


@pytest.mark.parametrize("kind", sorted({*DEFINITIONS} - {"skyarm_msgs/Reading"}))
def test_every_type_has_the_name_and_the_bytes_of_ros_2(node, kind):
    package, _, name = kind.partition("/")
    made = node._types.of(kind)
    assert made.__idl_typename__.replace(".", "::") == f"{package}::msg::dds_::{name}_"
    whole = encode(kind, DEFINITIONS, {}, 1)[0].tobytes()
    made.__idl__.populate()
    # cyclonedds's own decoder takes it to the end
    read = made.__idl__.deserialize(whole)
    assert bytes(made.__idl__.serialize(read, use_version_2=False)) == whole


@pytest.mark.skipif(sys.platform != "linux", reason="sockets are listed by Linux")
def test_sockets_receive_from_loopback_only(node):
    own = {
        os.readlink(f"/proc/self/fd/{each}")[8:-1]
        for each in os.listdir("/proc/self/fd")
        if is_socket(each)
    }
    rows = [
        line.split()
        for line in Path("/proc/self/net/udp").read_text("utf-8").splitlines()[1:]
    ]
    ports = {
        int(row[1].partition(":")[2], 16): row[1].partition(":")[0]
        for row in rows
        if row[9] in own
    }
    listening = {
        port: address
        for port, address in ports.items()
        if 7400 + 250 * DOMAIN <= port < 7650 + 250 * DOMAIN
    }
    assert listening
    shown = (
        subprocess.run(
            ["ss", "-uln"], capture_output=True, text=True, check=False
        ).stdout
        if which("ss")
        else ""
    )
    for port in listening if shown else ():
        assert f"%lo:{port}" in shown or f"127.0.0.1:{port}" in shown


class Refusing(socket.socket):
    def setsockopt(self, *_: object) -> None:
        raise PermissionError(errno.EPERM, "Operation not permitted")


@pytest.mark.skipif(sys.platform != "linux", reason="sockets are listed by Linux")
def test_sockets_that_cannot_be_kept_to_loopback_are_refused_in_one_line(monkeypatch):
    before = set(os.listdir("/proc/self/fd"))
    monkeypatch.setattr("skyarm.links.ros.ros2_node.socket.socket", Refusing)
    with pytest.raises(
        RosError,
        match=(
            r"^ROS 2: its sockets cannot be kept .* \(Operation not permitted\);"
            r" .*CYCLONE"
        ),
    ) as refused:
        Ros2Node(DOMAIN)
    assert refused.tb  # holds the node, whose sockets are closed all the same
    wait_until(
        lambda: (
            not [
                each
                for each in set(os.listdir("/proc/self/fd")) - before
                if is_socket(each)
            ]
        )
    )


@pytest.mark.skipif(sys.platform != "linux", reason="sockets are bound on Linux")
def test_a_descriptor_that_is_gone_or_is_no_internet_socket_is_left_alone(monkeypatch):
    left, right = socket.socketpair()
    with left, right, socket.socket() as other:
        gone = os.dup(left.fileno())
        os.close(gone)
        monkeypatch.setattr("skyarm.links.ros.ros2_node.socket.socket", Refusing)
        _bind_to_loopback([gone, left.fileno()])
        with pytest.raises(RosError, match="cannot be kept"):
            _bind_to_loopback([other.fileno()])


def is_socket(descriptor: str) -> bool:
    try:
        return os.readlink(f"/proc/self/fd/{descriptor}").startswith("socket:")
    except OSError:
        return False


def which(program: str) -> bool:
    return shutil.which(program) is not None


def test_nodes_come_and_go():
    for _ in range(3):
        Ros2Node(DOMAIN).close()


@pytest.mark.parametrize("text", ["x", "-1", "233", "1.5"])
def test_a_domain_that_cannot_be_is_one_line(monkeypatch, text):
    monkeypatch.setenv("ROS_DOMAIN_ID", text)
    with pytest.raises(
        RosError, match=r"ROS_DOMAIN_ID = .*: must be a whole number from 0 to 232"
    ):
        open_node(2)


def test_a_configuration_of_the_users_takes_the_place_of_ours(monkeypatch):
    monkeypatch.setenv(
        "CYCLONEDDS_URI", "<CycloneDDS><Domain><Nonsense/></Domain></CycloneDDS>"
    )
    with pytest.raises(RosError, match="cannot be joined"):
        Ros2Node(DOMAIN + 1)


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize(
    "number", [pytest.param(signal.SIGINT, marks=pytest.mark.thorough), signal.SIGTERM]
)
def test_a_signal_is_one_line_keeps_the_log_and_leaves_the_domain(
    node, tmp_path, number
):
    """The other participant has a type of its own; one that were not told would take 10
    s to miss the node.
    """
    reader = DataReader(
        participant := DomainParticipant(DOMAIN), Topic(participant, "rt/clock", Clock)
    )
    words = [
        sys.executable,
        "-m",
        "skyarm",
        "run",
        "case3",
        "--duration",
        "60",
        "--ros",
        "2",
        "--quiet",
    ]
    around = {**os.environ, "ROS_DOMAIN_ID": str(DOMAIN)}
    heard: list[Clock] = []
    with subprocess.Popen(
        words, cwd=tmp_path, env=around, stderr=subprocess.PIPE, text=True
    ) as process:

        def flies() -> bool:
            assert process.poll() is None
            heard.extend(reader.take(100))
            return len(heard) > 1

        wait_until(flies, 60.0)
        assert len(reader.get_matched_publications()) == 1
        os.kill(process.pid, number)
        _, errors = process.communicate(timeout=30.0)
    assert process.returncode == 128 + number
    assert errors.count("\n") == 1
    assert errors.startswith("skyarm: ")
    wait_until(lambda: not reader.get_matched_publications(), 5.0)
    folder = tmp_path / "out" / "run"
    log = skyarm.load_log(folder / "case3.npz")
    assert log.status == "running"
    assert log.time[-1] >= heard[-1].clock.sec + 1e-9 * heard[-1].clock.nanosec - 1e-9
    assert sorted(folder.iterdir()) == [folder / "case3.csv", folder / "case3.npz"]


def idl(definitions) -> str:
    """Types in the language of OMG's IDL, as ROS 2 names them, in an order in which
    each follows what it is made of.
    """
    done: list[str] = []

    def text(kind: str) -> str:
        found, rows = "", []
        for name, of, length in fields(definitions[kind]):
            one = {
                "float64": "double",
                "float32": "float",
                "int32": "long",
                "uint32": "unsigned long",
            }.get(of, of)
            if of in definitions:
                if of not in done:
                    found += text(of)
                one = f"{of.replace('/', '::msg::dds_::')}_"
            rows.append(
                f"sequence<{one}> {name};"
                if length == 0
                else f"{one} {name}[{length}];"
                if length
                else f"{one} {name};"
            )
        done.append(kind)
        package, name = kind.split("/")
        struct = f"struct {name}_ {{ {' '.join(rows)} }};"
        return (
            f"{found}module {package} {{ module msg {{ module dds_ {{ {struct} }}; }};"
            " };\n"
        )

    return "".join(text(kind) for kind in definitions if kind not in done)


HEARD = (
    "nav_msgs/Odometry",
    "sensor_msgs/JointState",
    "tf2_msgs/TFMessage",
    "rosgraph_msgs/Clock",
    NUMBERS,
    "geometry_msgs/PoseStamped",
)


def needed(kind: str) -> set[str]:
    inner = {field.kind for field in fields(DEFINITIONS[kind])} & {*DEFINITIONS}
    return {kind}.union(*map(needed, inner))


@pytest.mark.thorough
@pytest.mark.skipif(
    not (which("fastddsgen") and which("g++")),
    reason="needs Fast DDS (Debian: libfastrtps-dev, fastddsgen)",
)
def test_fast_dds_sees_a_flight_and_gives_it_goals_and_commands(tmp_path):
    wanted = set().union(*map(needed, HEARD))
    text = idl({kind: text for kind, text in DEFINITIONS.items() if kind in wanted})
    (tmp_path / "Live.idl").write_text(text, encoding="utf-8")
    peer = Path(__file__).with_name("fast_dds_peer.cpp")
    for words in (
        ["fastddsgen", "-replace", "Live.idl"],
        [
            "g++",
            "-O0",
            "-I.",
            "-o",
            "peer",
            str(peer),
            "Live.cxx",
            "LivePubSubTypes.cxx",
            "-lfastrtps",
            "-lfastcdr",
        ],
    ):
        subprocess.run(
            words, cwd=tmp_path, check=True, capture_output=True, timeout=300
        )
    given = [
        str(DOMAIN),
        "4.5",
        "0.5",
        "-0.3",
        "1.4",
        "joint1",
        "0.2",
        *(["430"] * 4),
        "0",
        "0",
    ]
    told: list[str] = []
    with subprocess.Popen(
        ["./peer", *given], cwd=tmp_path, stdout=subprocess.PIPE, text=True
    ) as process:
        live = fly_live(
            skyarm.load_scenario("case3", duration=5.9),
            Ros2Node(DOMAIN),
            warn=told.append,
        )
        answer, _ = process.communicate(timeout=30)
    counts, pose, first, second, frames = answer.splitlines()
    heard = dict(zip(counts.split()[::2], map(int, counts.split()[1::2]), strict=True))
    assert heard["odom"] == heard["joint_states"] > 500
    assert abs(heard["clock"] - heard["odom"]) <= 2
    assert abs(heard["tf"] - heard["odom"] / 4) <= 2
    assert heard["tf_static"] == 1
    assert frames.startswith("5 fixed, 4 moving frames, ")
    last = round(float(frames.split()[-2]) * 200)
    log = live.log
    assert pose == "world base_link {:.9f} {:.9f} {:.9f}".format(*log.position[last])
    assert [first, second] == [
        f"joint{i + 1} {log.joints[last, i]:.9f}" for i in range(2)
    ]
    assert live.goals >= 1
    assert live.commanded >= 60
    assert (log.rotor_commands == 430.0).all(axis=1).sum() == live.commanded
    assert log.position_reference[-1] == pytest.approx((0.5, -0.3, 1.4), abs=1e-9)
    assert log.joints_reference[-1, 0] == pytest.approx(0.2, abs=1e-9)
    assert not told
