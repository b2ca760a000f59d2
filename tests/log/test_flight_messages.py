"""A flight as messages: two readers that share no code with us read all of them, and
find the log's numbers.
"""

from __future__ import annotations

import warnings
from collections import defaultdict

import numpy as np
import pytest
from messages_by_rosbags import Rotation, by_rosbags, composed, rosbags

import skyarm
from skyarm.world.scene.vehicle_shapes import body_poses
from support.cases import sampled
from support.logs import drawn, flown

mcap_reader = pytest.importorskip("mcap.reader", reason="needs the extra 'test'")
mcap_ros2 = pytest.importorskip("mcap_ros2.decoder", reason="needs the extra 'test'")

EACH = {"/clock", "/skyarm/flight"}
"""Topics of every control period."""

FAST = {"/odom", "/joint_states"}
ONCE = {"/tf_static", "/vehicle"}


@pytest.fixture(scope="module")
def read(tmp_path_factory):
    return by_rosbags(
        skyarm.save_log(flown(), tmp_path_factory.mktemp("read") / "flight.mcap")
    )


def table(messages, path: str) -> np.ndarray:
    """A field of every message, (N, ...): ``pose.position.xyz``."""
    *names, last = path.split(".")

    def of(message):
        for name in names:
            message = getattr(message, name)
        if last in ("xyz", "wxyz"):
            return [getattr(message, axis) for axis in last]
        return getattr(message, last)

    return np.array([of(message) for message in messages])


def test_every_topic_has_its_rate_and_no_message_is_missing(read):
    log, (found, same) = flown(), read
    count = log.time.size
    for topic, (_, times, messages) in found.items():
        every = 1 if topic in EACH | FAST else 4
        wanted = 1 if topic in ONCE else -(-count // every)
        assert len(messages) == wanted, topic
        if topic not in ONCE:
            assert (np.array(times) == np.rint(log.time[::every] * 1e9)).all(), topic
    total = sum(len(messages) for _, _, messages in found.values())
    assert same == total


def test_the_state_is_the_logs(read):
    log, (found, _) = flown(), read
    odometry = found["/odom"][2]
    pose, twist = "pose.pose", "twist.twist"
    assert np.array_equal(table(odometry, f"{pose}.position.xyz"), log.position)
    R = Rotation.from_quat(log.quaternion[:, [1, 2, 3, 0]])
    turned = Rotation.from_quat(
        table(odometry, f"{pose}.orientation.wxyz")[:, [1, 2, 3, 0]]
    )
    assert (R * turned.inv()).magnitude().max() < 1e-15
    # of the frame child_frame_id, as nav_msgs/Odometry has it
    assert {(m.header.frame_id, m.child_frame_id) for m in odometry} == {
        ("world", "base_link")
    }
    assert (
        np.abs(
            table(odometry, f"{twist}.linear.xyz") - R.inv().apply(log.velocity)
        ).max()
        < 1e-14
    )
    assert np.array_equal(table(odometry, f"{twist}.angular.xyz"), log.rate)


def test_joints_are_the_logs_by_name(read):
    log, (found, _) = flown(), read
    for topic, names, fields in (
        (
            "/joint_states",
            ["joint1", "joint2"],
            {"position": "joints", "velocity": "joint_rates", "effort": "efforts"},
        ),
    ):
        kind, _, messages = found[topic]
        assert kind == "sensor_msgs/msg/JointState"
        assert all(message.name == names for message in messages)
        for field, array in fields.items():
            given = table(messages, field)
            assert np.array_equal(given, getattr(log, array)), (topic, field)


def test_references_and_tip_are_the_logs(read):
    log, (found, _) = flown(), read
    slow = slice(None, None, 4)
    for topic, path, wanted in (
        ("/reference/base", "pose.position.xyz", log.position_reference),
        ("/reference/tip", "point.xyz", log.tip_reference),
        ("/tip", "point.xyz", log.tip),
    ):
        assert np.array_equal(table(found[topic][2], path), wanted[slow]), (topic, path)
    yaw = np.stack(
        [
            np.cos(log.yaw_reference / 2),
            *np.zeros((2, log.time.size)),
            np.sin(log.yaw_reference / 2),
        ],
        1,
    )
    assert (
        np.abs(
            table(found["/reference/base"][2], "pose.orientation.wxyz") - yaw[slow]
        ).max()
        < 1e-15
    )


def test_every_number_of_the_log_stands_in_the_flights_own_messages(read):
    log, (found, _) = flown(), read
    messages = found["/skyarm/flight"][2]
    for column in skyarm.log.log_columns.columns(log):
        assert np.array_equal(table(messages, column.name), column.of(log)), column.name


@pytest.mark.parametrize("name", sampled(skyarm.list_vehicles(), 6))
def test_frames_lead_to_where_the_bodies_and_the_tip_are(name, tmp_path):
    vehicle = skyarm.load_vehicle(name)
    log = drawn(vehicle, count=9)
    found, same = by_rosbags(skyarm.save_log(log, tmp_path / "drawn.mcap"))
    assert same == sum(len(messages) for _, _, messages in found.values())
    links = [link.name for link in vehicle.links]
    for k, message in enumerate(found["/tf"][2]):
        tree = {
            t.child_frame_id: t
            for t in [*message.transforms, *found["/tf_static"][2][0].transforms]
        }
        poses = body_poses(
            vehicle, log.position[4 * k], log.quaternion[4 * k], log.joints[4 * k]
        )
        for i, link in enumerate(["base_link", *links], start=-1):
            R, p = composed(tree, link)
            assert np.abs(R - poses[i][0]).max() < 1e-14
            assert np.abs(p - poses[i][1]).max() < 1e-14
        for frame in vehicle.frames:
            R, p = composed(tree, frame.name)
            R_WB, p_WB = poses[frame.link]
            assert np.abs(p - p_WB - R_WB @ np.array(frame.position)).max() < 1e-14
            assert np.abs(R - R_WB @ np.array(frame.rotation)).max() < 1e-14
        for rotor in vehicle.rotors:
            child = next(
                n for n in tree if n == f"rotor_{rotor.name.removeprefix('rotor')}"
            )
            R, p = composed(tree, child)
            R_WB, p_WB = poses[-1]
            assert np.abs(p - p_WB - R_WB @ np.array(rotor.position)).max() < 1e-14
            assert np.abs(R[:, 2] - R_WB @ np.array(rotor.axis)).max() < 1e-14
    drawn_in = {marker.header.frame_id for marker in found["/vehicle"][2][0].markers}
    assert drawn_in == {"base_link", *links}


@pytest.mark.parametrize(
    ("rate", "fast", "slow"),
    [
        (200, 1, 4),
        (500, 2, 10),
        (1000, 5, 20),
        (250, 1, 5),
        (100, 1, 2),
        (40, 1, 1),
        (33.3, 1, 1),
    ],
)
@pytest.mark.parametrize("count", sampled([3, 0, 1, 1203], 4))
def test_other_control_rates_keep_their_order_and_lose_nothing(
    rate, fast, slow, count, tmp_path
):
    log = drawn(skyarm.load_vehicle("hummingbird_arm2"), count=count, rate=rate)
    path = skyarm.save_log(log, tmp_path / "drawn.mcap")
    with path.open("rb") as stream:
        reader = mcap_reader.make_reader(stream, validate_crcs=True)
        counts = defaultdict(int)
        last = 0
        for _, channel, message in reader.iter_messages(log_time_order=False):
            assert message.sequence == counts[channel.topic]
            counts[channel.topic] += 1
            assert message.log_time >= last
            last = message.log_time
        statistics = reader.get_summary().statistics
    for topic in EACH | FAST | {"/tf"}:
        every = 1 if topic in EACH else fast if topic in FAST else slow
        assert counts[topic] == -(-count // every), topic
    assert statistics.message_count == sum(counts.values())
    if count:
        assert (statistics.message_start_time, statistics.message_end_time) == (
            0,
            round(log.time[-1] * 1e9),
        )


# its new names are newer
@pytest.mark.filterwarnings("ignore:(start|end)_time is deprecated:DeprecationWarning")
def test_the_index_leads_to_the_messages_of_some_time_and_topic(tmp_path):
    log = flown()
    path = skyarm.save_log(log, tmp_path / "flight.mcap")
    with path.open("rb") as stream:
        reader = mcap_reader.make_reader(
            stream, validate_crcs=True, decoder_factories=[mcap_ros2.DecoderFactory()]
        )
        assert isinstance(reader, mcap_reader.SeekingReader)
        chosen = reader.iter_decoded_messages(
            topics=["/odom"], start_time=int(1.2e9), end_time=int(2.1e9)
        )
        found = [
            (each.message.log_time, each.decoded_message.pose.pose.position.x)
            for each in chosen
        ]
        rows = (log.time >= 1.2) & (log.time < 2.1)
        assert found == list(
            zip(np.rint(log.time[rows] * 1e9), log.position[rows, 0], strict=True)
        )
        attached = {each.name: each.data for each in reader.iter_attachments()}
        told = {each.name: each.metadata for each in reader.iter_metadata()}
        assert reader.get_header().profile == "ros2"
        chunks = reader.get_summary().chunk_indexes
    assert sorted(attached) == ["flight.npz", "info.json", "scenario.json"]
    assert told["skyarm"]["scenario"] == "case3_wind"
    assert told["skyarm"]["digest"] == log.info["digest"]
    assert len(chunks) == 2


def test_definitions_are_those_of_ros(tmp_path):
    from rosbags.typesys import Stores, get_typestore

    path = skyarm.save_log(flown(), tmp_path / "flight.mcap")
    store = get_typestore(Stores.ROS2_HUMBLE)
    with (
        path.open("rb") as stream,
        rosbags.AnyReader([path]) as reader,
        warnings.catch_warnings(),
    ):
        schemas = mcap_reader.make_reader(stream).get_summary().schemas.values()
        names = {schema.name for schema in schemas}
        assert {schema.encoding for schema in schemas} == {"ros2msg"}
        own = names - {"skyarm_msgs/msg/Flight"}
        assert len(own) == len(names) - 1 == 7
        for name in own:
            # the identity by which ROS 2 tells types apart
            assert reader.typestore.hash_rihs01(name) == store.hash_rihs01(name), name
