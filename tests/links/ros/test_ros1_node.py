"""A node of ROS 1 against a stand-in master and plain sockets; and against rosmaster and rospy where they are."""

from __future__ import annotations

import contextlib
import os
import shutil
import socket
import struct
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from skyarm.links.ros import RosError, open_node
from skyarm.links.ros.node import Inbox
from skyarm.links.ros.ros1_connections import MOST_CONNECTIONS, Identity, Subscription, read_header
from skyarm.links.ros.ros1_node import Ros1Node
from skyarm.log.ros.message_bytes import decode, encode
from skyarm.log.ros.messages import ROS1_DEFINITIONS, checksum
from support.peers import Talker, asked, exactly, framed, header, master, subscribe

ODOMETRY, NUMBERS = "nav_msgs/Odometry", "std_msgs/Float64MultiArray"
SUMS = {kind: checksum(kind, ROS1_DEFINITIONS) for kind in (ODOMETRY, NUMBERS)}


def wait_until(happened: Callable[[], object], seconds: float = 10.0) -> None:
    """Wait for something that another thread or process does."""
    until = time.monotonic() + seconds
    while not happened():
        assert time.monotonic() < until
        time.sleep(0.01)


@pytest.fixture
def hub():
    with master() as found:
        yield found


@pytest.fixture
def node(hub):
    found = Ros1Node(hub.address, "127.0.0.1")
    try:
        yield found
    finally:
        found.close()
    assert not [each for each in threading.enumerate() if each.name.startswith("ros1")]


def test_a_subscriber_gets_every_message_in_order(hub, node):
    node.advertise("/odom", ODOMETRY)
    assert hub.kinds == {"/odom": ODOMETRY}
    connection, answer = subscribe(hub.publishers["/odom"][0], "/odom", ODOMETRY, SUMS[ODOMETRY])
    with connection:
        assert (answer["type"], answer["md5sum"], answer["latching"]) == (ODOMETRY, SUMS[ODOMETRY], "0")
        assert "geometry_msgs/PoseWithCovariance pose" in answer["message_definition"]
        wait_until(lambda: node.subscribers("/odom") == 1)
        sent = [struct.pack("<I", k) * (k + 1) for k in range(50)]
        for each in sent:
            node.send("/odom", each)
        assert [framed(connection) for _ in sent] == sent
    wait_until(lambda: node.send("/odom", b"gone") or node.subscribers("/odom") == 0)


def test_a_latched_message_goes_to_whoever_comes_later(hub, node):
    node.advertise("/tf_static", NUMBERS, latched=True)
    node.send("/tf_static", b"first")
    node.send("/tf_static", b"last")
    for _ in range(2):
        connection, answer = subscribe(node.address, "/tf_static", NUMBERS, "*")
        with connection:
            assert answer["latching"] == "1"
            assert framed(connection) == b"last"


def test_what_waits_is_sent_before_the_node_closes(hub, node):
    node.advertise("/odom", ODOMETRY)
    connection, _ = subscribe(node.address, "/odom", ODOMETRY, SUMS[ODOMETRY])
    with connection:
        wait_until(lambda: node.subscribers("/odom") == 1)
        node.send("/odom", b"the end")
        node.close()
        assert framed(connection) == b"the end"
        assert connection.recv(1) == b""
    assert hub.publishers["/odom"] == []


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"topic": "/odom", "type": NUMBERS, "md5sum": SUMS[NUMBERS]}, "type of /odom is nav_msgs/Odometry"),
        ({"topic": "/odom", "type": ODOMETRY, "md5sum": "0" * 32}, "md5sum of /odom"),
        ({"topic": "/other", "type": ODOMETRY, "md5sum": SUMS[ODOMETRY]}, "not published here"),
    ],
)
def test_a_subscriber_of_another_type_is_told_so(node, fields, words):
    node.advertise("/odom", ODOMETRY)
    _, host, port = asked(node.address, "requestTopic", "/test", "/odom", [["TCPROS"]])[2]
    with socket.create_connection((host, port), timeout=5.0) as connection:
        connection.sendall(header(callerid="/test", **fields))
        assert words.encode() in framed(connection)
        assert connection.recv(1) == b""


def test_garbage_on_the_data_port_is_dropped_and_the_topic_lives(node):
    node.advertise("/odom", ODOMETRY)
    _, host, port = asked(node.address, "requestTopic", "/test", "/odom", [["TCPROS"]])[2]
    rng = np.random.default_rng(7)
    for content in (b"GET / HTTP/1.0\r\n\r\n", b"\xff" * 400, struct.pack("<I", 8) + b"\xff" * 8, rng.bytes(300), b""):
        with socket.create_connection((host, port), timeout=5.0) as connection:
            with contextlib.suppress(OSError):  # it may have broken off already
                connection.sendall(content)
                connection.shutdown(socket.SHUT_WR)
            with pytest.raises((AssertionError, ConnectionError)):  # it ends, without an answer
                exactly(connection, 1)
    connection, _ = subscribe(node.address, "/odom", ODOMETRY, "*")
    with connection:
        wait_until(lambda: node.subscribers("/odom") == 1)
        node.send("/odom", b"still here")
        assert framed(connection) == b"still here"


def test_a_subscriber_that_does_not_read_delays_nobody(node):
    node.advertise("/odom", ODOMETRY)
    slow, _ = subscribe(node.address, "/odom", ODOMETRY, "*")
    with slow:
        wait_until(lambda: node.subscribers("/odom") == 1)
        begun, count = time.monotonic(), 600
        for k in range(count):  # 60 MB, of which a hundred messages may wait and some are on their way
            node.send("/odom", struct.pack("<I", k) + bytes(100_000))
        assert time.monotonic() - begun < 2.0
        found = [0]
        while found[-1] < count - 1:
            found.append(struct.unpack("<I", framed(slow)[:4])[0])
    assert found[1:] == sorted(set(found[1:]))
    assert 100 <= len(found) < 400


def test_a_header_that_is_too_long_ends_the_connection_at_once(node):
    node.advertise("/odom", ODOMETRY)
    _, host, port = asked(node.address, "requestTopic", "/test", "/odom", [["TCPROS"]])[2]
    begun = time.monotonic()
    with socket.create_connection((host, port), timeout=5.0) as connection:
        connection.sendall(struct.pack("<I", 1 << 20))
        assert connection.recv(1) == b""
    assert time.monotonic() - begun < 1.5  # a header that is on its way may take 3 s


def test_messages_of_a_publisher_arrive(hub, node):
    node.subscribe("/skyarm/command", NUMBERS)
    talker = Talker(hub, "/skyarm/command", NUMBERS, SUMS[NUMBERS])
    with talker.accept() as connection:
        assert talker.asked["md5sum"] == SUMS[NUMBERS]
        data = encode(NUMBERS, ROS1_DEFINITIONS, {"data": np.array([1.0, 2.0])}, 1, packed=True)[0].tobytes()
        connection.sendall(2 * (struct.pack("<I", len(data)) + data))
        found: list[bytes] = []
        wait_until(lambda: found.extend(node.take("/skyarm/command")) or len(found) == 2)
        assert decode(NUMBERS, ROS1_DEFINITIONS, found[1], packed=True)["data"] == [1.0, 2.0]
        connection.sendall(struct.pack("<I", 1 << 30))  # no message is so long: the connection is given up
        assert connection.recv(1) == b""
    talker.close()
    assert node.take("/skyarm/command") == []


def test_a_publisher_that_is_there_before_is_found(hub):
    talker = Talker(hub, "/skyarm/command", NUMBERS, SUMS[NUMBERS])
    node = Ros1Node(hub.address, "127.0.0.1")
    node.subscribe("/skyarm/command", NUMBERS)
    with talker.accept():
        pass
    node.close()
    talker.close()
    assert hub.listeners["/skyarm/command"] == []


def test_publishers_that_are_none_are_left_alone(hub, node):
    node.subscribe("/skyarm/command", NUMBERS)
    for address in ("http://127.0.0.1:9", "nonsense", hub.address):
        assert asked(node.address, "publisherUpdate", "/master", "/skyarm/command", [address])[0] == 1
    assert node.take("/skyarm/command") == []


ANSWERS = [
    *([1, "", value] for value in (0, ["TCPROS", "127.0.0.1", 70000], ["TCPROS", "h", "x"], ["UDPROS", "h", 1])),
    *([1, "", ["TCPROS", "no such host.invalid", 9]], [1, ""], 7, "text", [0, "no", []]),
]


def test_publishers_with_any_answer_are_left_alone(hub, node):
    """An error in a thread of the node would fail the test."""
    node.subscribe("/skyarm/command", NUMBERS)
    for answer in ANSWERS:
        talker = Talker(hub, "/skyarm/command", NUMBERS, SUMS[NUMBERS], answer=answer)
        wait_until(lambda talker=talker: talker.calls)
        if "invalid" not in str(answer):
            with pytest.raises(RosError) as refused:
                node._find(hub.publishers["/skyarm/command"][-1], "/skyarm/command")
            assert "\n" not in str(refused.value)
        talker.close()
    wait_until(lambda: not [each for each in threading.enumerate() if each.name == "ros1 source"])
    assert node.take("/skyarm/command") == []


def test_garbage_on_the_api_port_is_silent(node, capfd):
    rng = np.random.default_rng(5)
    host, port = node._api.server_address
    post = b"POST / HTTP/1.0\r\nContent-Type: text/xml\r\nContent-Length: %d\r\n\r\n%s"
    bodies = [b"", b"<", b"<methodCall><methodName>getPid", b"\x00" * 99, rng.bytes(300)]
    for content in (*(post % (len(body), body) for body in bodies), rng.bytes(500), b"GET / HTTP/1.0\r\n\r\n", b""):
        with socket.create_connection((host, port), timeout=5.0) as connection, contextlib.suppress(OSError):
            connection.sendall(content)
            connection.shutdown(socket.SHUT_WR)
            while connection.recv(1000):
                pass
    assert asked(node.address, "getPid", "/test")[0] == 1
    assert capfd.readouterr() == ("", "")


def test_an_update_with_too_many_publishers_connects_to_some():
    go = threading.Event()

    def find(publisher: str, topic: str) -> tuple[str, int]:
        go.wait(20.0)
        raise OSError("nobody")

    subscription = Subscription(Identity("/test", "/skyarm/command", NUMBERS), Inbox(), find)
    subscription.update([f"http://127.0.0.1:{k}" for k in range(200)])
    count = len([each for each in threading.enumerate() if each.name == "ros1 source"])
    go.set()
    subscription.close()
    assert count == MOST_CONNECTIONS


@pytest.mark.parametrize("port", ["_listener", "_api"])
def test_callers_that_say_nothing_are_limited_and_others_come_in_again(node, port):
    node.advertise("/odom", ODOMETRY)
    held = getattr(node, port)
    place = (held if port == "_listener" else held.socket).getsockname()
    with contextlib.ExitStack() as opened:
        callers = [opened.enter_context(socket.create_connection(place, timeout=1.5)) for _ in range(70)]
        with contextlib.suppress(ConnectionResetError):
            assert callers[-1].recv(1) == b""  # at once; a caller in a place may be silent for 3 s
        callers[0].settimeout(0.05)
        with pytest.raises(TimeoutError):
            callers[0].recv(1)
    names = ("ros1 welcome", "process_request_thread")
    wait_until(lambda: not [each for each in threading.enumerate() if any(name in each.name for name in names)])
    connection, _ = subscribe(node.address, "/odom", ODOMETRY, "*")
    connection.close()


def test_a_topic_has_so_many_subscribers_at_most(node, monkeypatch):
    monkeypatch.setattr("skyarm.links.ros.ros1_connections.MOST_CONNECTIONS", 2)
    node.advertise("/odom", ODOMETRY)
    with contextlib.ExitStack() as opened:
        for count in (1, 2):
            opened.enter_context(subscribe(node.address, "/odom", ODOMETRY, "*")[0])
            wait_until(lambda count=count: node.subscribers("/odom") == count)
        _, host, port = asked(node.address, "requestTopic", "/test", "/odom", [["TCPROS"]])[2]
        with socket.create_connection((host, port), timeout=5.0) as connection:
            connection.sendall(header(callerid="/test", topic="/odom", type=ODOMETRY, md5sum="*"))
            assert connection.recv(1) == b""
        assert node.subscribers("/odom") == 2


def drip(connection: socket.socket, content: bytes) -> None:
    """Send a byte every 20 ms, then break off."""
    with contextlib.suppress(OSError):
        for k in range(len(content)):
            connection.sendall(content[k : k + 1])
            time.sleep(0.02)
    with contextlib.suppress(OSError):
        connection.shutdown(socket.SHUT_WR)


def test_a_header_that_drips_in_is_given_up(monkeypatch):
    monkeypatch.setattr("skyarm.links.ros.ros1_connections.PATIENCE", 0.3)
    left, right = socket.socketpair()
    with left, right:
        thread = threading.Thread(target=drip, args=(right, struct.pack("<I", 1000) + bytes(60)))
        thread.start()
        with pytest.raises(TimeoutError):
            read_header(left)
        thread.join()


def test_a_call_that_drips_in_is_given_up(node, monkeypatch):
    monkeypatch.setattr("skyarm.links.ros.ros1_node.PATIENCE", 0.3)
    begun = time.monotonic()
    with socket.create_connection(node._api.server_address, timeout=5.0) as connection:
        thread = threading.Thread(target=drip, args=(connection, b"POST / HTTP/1.0\r\n" + b"X: y\r\n" * 20))
        thread.start()
        with contextlib.suppress(ConnectionResetError):
            assert connection.recv(1) == b""
        taken = time.monotonic() - begun
        thread.join()
    assert taken < 1.5  # the whole takes 2.7 s


@pytest.mark.parametrize("length", ["70000", "9" * 40, "-1", "x", ""])
def test_a_call_whose_length_cannot_be_is_refused_at_once(node, length):
    with socket.create_connection(node._api.server_address, timeout=1.5) as connection:
        connection.sendall(f"POST / HTTP/1.0\r\nContent-Length: {length}\r\n\r\n".encode())
        assert b" 413 " in connection.recv(1000)


def test_the_api_answers_what_the_tools_of_ros_ask(hub, node):
    node.advertise("/odom", ODOMETRY)
    node.subscribe("/skyarm/command", NUMBERS)
    assert asked(node.address, "getPid", "/test") == [1, "", os.getpid()]
    assert asked(node.address, "getMasterUri", "/test")[2] == hub.address
    assert asked(node.address, "getPublications", "/test")[2] == [["/odom", ODOMETRY]]
    assert asked(node.address, "getSubscriptions", "/test")[2] == [["/skyarm/command", NUMBERS]]
    for method in ("getBusInfo", "getBusStats"):
        assert asked(node.address, method, "/test")[0] == 1
    assert asked(node.address, "requestTopic", "/test", "/odom", [["UDPROS"]])[0] == -1
    assert asked(node.address, "requestTopic", "/test", "/none", [["TCPROS"]])[0] == -1
    assert asked(node.address, "requestTopic", "/test")[0] == -1
    assert asked(node.address, "rm", "/test")[0] == -1
    assert node.end_reason == ""
    assert asked(node.address, "shutdown", "/master", "rosnode\nkill")[0] == 1
    assert node.end_reason == "ended by ROS (rosnode kill)"


def test_a_master_that_dies_is_noticed_and_close_does_not_wait_for_it(monkeypatch):
    monkeypatch.setattr("skyarm.links.ros.ros1_node.WATCH", 0.05)
    with master() as found:
        node = Ros1Node(found.address, "127.0.0.1")
        node.advertise("/odom", ODOMETRY)
    wait_until(lambda: node.problem)
    assert "does not answer" in node.problem
    assert "\n" not in node.problem
    begun = time.monotonic()
    node.close()
    assert time.monotonic() - begun < 2.0


def test_one_silence_of_the_master_is_no_loss(node, monkeypatch):
    silences = [RosError("nothing")]

    def answer(method: str, *_: object) -> int:
        if silences:
            raise silences.pop()
        looks.append(method)
        return 1

    looks: list[str] = []
    monkeypatch.setattr(node, "_ask", answer)
    wait_until(lambda: looks)
    assert node.problem == ""


@contextlib.contextmanager
def answering(content: bytes) -> Iterator[int]:
    """Port of another program, which answers every connection with the same bytes."""

    def serve() -> None:
        with contextlib.suppress(OSError):
            while True:
                connection, _ = server.accept()
                with connection:
                    connection.recv(1000)
                    connection.sendall(content)

    with socket.create_server(("127.0.0.1", 0)) as server:
        thread = threading.Thread(target=serve)
        thread.start()
        yield server.getsockname()[1]
        server.shutdown(socket.SHUT_RDWR)
    thread.join()


@pytest.mark.parametrize(
    "content",
    [b"", b"SSH-2.0-OpenSSH\r\n", b"HTTP/1.0 200 OK\r\n\r\n<html>no</html>", b"HTTP/1.0 404 Not Found\r\n\r\n"],
)
def test_another_program_at_the_masters_port_is_one_line(content):
    with answering(content) as port, pytest.raises(RosError) as refused:
        Ros1Node(f"http://127.0.0.1:{port}")
    assert "ROS 1 at http://127.0.0.1" in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("text", ["localhost", "http://", "http://localhost", "ftp://a:1", "http://a:b", "http://[::1"])
def test_an_address_of_no_master_is_one_line(monkeypatch, text):
    monkeypatch.setenv("ROS_MASTER_URI", text)
    with pytest.raises(RosError, match=r"ROS_MASTER_URI = .*must be http://HOST:PORT"):
        open_node(1)


def test_a_host_that_is_not_ours_is_one_line(hub, monkeypatch):
    monkeypatch.setenv("ROS_IP", "203.0.113.7")
    with pytest.raises(RosError, match=r"no socket can be opened at '203.0.113.7'"):
        Ros1Node(hub.address)


def test_every_socket_is_on_loopback(node, hub):
    node.advertise("/odom", ODOMETRY)
    assert node.address.startswith("http://127.0.0.1:")
    assert asked(node.address, "requestTopic", "/t", "/odom", [["TCPROS"]])[2][1] == "127.0.0.1"
    assert node._listener.getsockname()[0] == node._api.server_address[0] == "127.0.0.1"


def test_another_version_is_one_line():
    with pytest.raises(RosError, match="must be 1 or 2"):
        open_node(3)


ROSPY = """
import sys, time, rospy
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from tf2_msgs.msg import TFMessage

found = {}
rospy.init_node("listener", disable_signals=True)
for topic, kind in (("/odom", Odometry), ("/joint_states", JointState), ("/tf", TFMessage), ("/tf_static", TFMessage),
                    ("/skyarm/applied", Float64MultiArray)):
    rospy.Subscriber(topic, kind, lambda message, topic=topic: found.setdefault(topic, []).append(message))
goal = rospy.Publisher("/skyarm/goal", PoseStamped, queue_size=1)
command = rospy.Publisher("/skyarm/command", Float64MultiArray, queue_size=1)
print("ready", flush=True)
while goal.get_num_connections() == 0 or len(found.get("/odom", ())) < 20:
    time.sleep(0.01)
pose = PoseStamped()
pose.pose.position.z, pose.pose.position.x, pose.pose.orientation.w = 1.2, 0.5, 1.0
goal.publish(pose)
begun = len(found["/odom"])
while len(found["/odom"]) < begun + 300:
    time.sleep(0.01)
for _ in range(20):
    command.publish(data=found["/skyarm/applied"][-1].data)
    time.sleep(0.01)
begun = len(found["/odom"])
while len(found["/odom"]) < begun + 20:
    time.sleep(0.01)
message = found["/odom"][-1]
print(message.child_frame_id, message.header.frame_id, message.pose.pose.position.x, len(found["/tf_static"]),
      found["/joint_states"][-1].name, len(found["/tf"]), flush=True)
"""

SYSTEM = Path("/usr/bin/python3")


@pytest.mark.thorough
@pytest.mark.skipif(shutil.which("rosmaster") is None, reason="needs rosmaster and rospy (Debian: python3-rospy)")
def test_rospy_sees_a_flight_and_gives_it_a_goal_and_commands(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    around = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    around |= {"ROS_MASTER_URI": f"http://127.0.0.1:{port}", "ROS_IP": "127.0.0.1", "ROS_HOME": str(tmp_path)}
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with subprocess.Popen([str(shutil.which("rosmaster")), "--core", "-p", str(port)], env=around, **quiet) as core:
        try:
            wait_until(lambda: listens(port), 20.0)
            told: list[str] = []
            flight = fly_a_while(f"http://127.0.0.1:{port}", told)
            words = [str(SYSTEM), "-c", ROSPY]
            with subprocess.Popen(words, env=around, stdout=subprocess.PIPE, text=True, cwd=tmp_path) as listener:
                assert listener.stdout is not None
                assert listener.stdout.readline() == "ready\n"
                live = flight()
                answer = listener.stdout.readline().split()
                listener.wait(timeout=20.0)
        finally:
            core.terminate()
    assert answer[:2] == ["base_link", "world"]
    assert answer[3] == "1"
    assert "['joint1'," in answer[4]
    assert live.goals == 1
    assert 10 <= live.commanded <= 120
    assert float(answer[2]) == pytest.approx(0.5, abs=0.4)
    assert not told


def listens(port: int) -> bool:
    with socket.socket() as trial:
        return trial.connect_ex(("127.0.0.1", port)) == 0


def fly_a_while(address: str, told: list[str]):
    """Flight of eight seconds under a master, to be begun by a call."""
    import skyarm
    from skyarm.links.ros.live_flight import fly_live

    scenario = skyarm.load_scenario("case3", duration=8.0)
    return lambda: fly_live(scenario, Ros1Node(address, "127.0.0.1"), 1, warn=told.append)
