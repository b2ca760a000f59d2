"""Messages whose numbers are computed from a log's, against formulas written again with
NumPy and SciPy.
"""

from __future__ import annotations

import numpy as np
import pytest
from messages_by_rosbags import Rotation, by_rosbags, composed

import skyarm
from skyarm.log.ros.topics import FlightTopics
from skyarm.world.scene.vehicle_shapes import vehicle_shapes
from support.logs import drawn


@pytest.fixture(scope="module", params=["hummingbird_arm2_rotors", "tilted_hexarotor"])
def written(request, tmp_path_factory):
    """A vehicle, a drawn log of it at 40 Hz, of which every instant is written, and its
    messages.
    """
    vehicle = skyarm.load_vehicle(request.param)
    log = drawn(vehicle, count=12, rate=40)
    return (
        vehicle,
        log,
        by_rosbags(
            skyarm.save_log(log, tmp_path_factory.mktemp("drawn") / "drawn.mcap")
        )[0],
    )


def test_the_reference_has_a_frame_of_its_own(written):
    _, log, found = written
    for k, message in enumerate(found["/tf"][2]):
        R, p = composed(
            {t.child_frame_id: t for t in message.transforms}, "base_reference"
        )
        assert np.array_equal(p, log.position_reference[k])
        assert (
            np.abs(R - Rotation.from_euler("z", log.yaw_reference[k]).as_matrix()).max()
            < 1e-14
        )


def test_markers_have_the_shapes_sizes_and_places(written):
    vehicle, _, found = written
    # Marker.SPHERE, Marker.CYLINDER
    kinds = {"ellipsoid": 2, "sphere": 2, "capsule": 3, "cylinder": 3}
    shapes, markers = vehicle_shapes(vehicle), found["/vehicle"][2][0].markers
    assert (
        len({(marker.ns, marker.id) for marker in markers})
        == len(markers)
        == len(shapes)
    )
    for shape, marker in zip(shapes, markers, strict=True):
        assert (marker.ns, marker.type, marker.frame_locked) == (
            shape.name,
            kinds[shape.kind],
            True,
        )
        assert marker.color.a > 0
        scale = np.array([marker.scale.x, marker.scale.y, marker.scale.z])
        across = 2 * shape.size[0]
        wanted = {
            "ellipsoid": [2 * half for half in shape.size],
            "sphere": [across] * 3,
        }.get(shape.kind, [across, across, shape.size[-1]])
        assert np.allclose(scale, wanted, rtol=1e-15)
        q = marker.pose.orientation
        R = Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix()
        assert np.abs(R - shape.rotation).max() < 1e-14
        assert np.array_equal(
            [marker.pose.position.x, marker.pose.position.y, marker.pose.position.z],
            shape.position,
        )


@pytest.mark.parametrize(
    ("rate", "fast", "slow"), [(40, 1, 1), (200, 1, 4), (500, 2, 10), (1000, 5, 20)]
)
def test_viewers_get_the_base_at_about_200_hz_and_frames_at_about_50(rate, fast, slow):
    log = drawn(skyarm.load_vehicle("hummingbird"), count=2, rate=rate)
    every = {topic.name: topic.every for topic in FlightTopics(log).topics}
    assert (every["/skyarm/flight"], every["/odom"], every["/tf"]) == (1, fast, slow)


MESSAGES = {
    "sensor_msgs/Imu": {"rate": "xyz", "specific_force": "xyz"},
    "geometry_msgs/PoseStamped": {"position": "xyz", "quaternion": "wxyz"},
    "geometry_msgs/PointStamped": {"position": "xyz"},
    "geometry_msgs/WrenchStamped": {"force": "xyz", "torque": "xyz"},
    "nav_msgs/Odometry": {
        "position": "xyz",
        "quaternion": "wxyz",
        "velocity": "xyz",
        "rate": "xyz",
    },
    "skyarm_msgs/Reading": {"heading": ""},
}
"""Message of ROS -> fields of a reading and their axes."""


@pytest.mark.parametrize("kind", MESSAGES)
def test_a_reading_is_the_message_that_ros_has_for_its_fields(kind):
    fields = {"time": None, **MESSAGES[kind]}
    described = {
        name: {"unit": "", "meaning": "", "axes": list(axes) if axes else None}
        for name, axes in fields.items()
    }
    log = drawn(skyarm.load_vehicle("hummingbird"), count=2)
    log.info["received"] = {
        "readings.own": {"fields": described, "every": 1, "late": 0, "frame": None}
    }
    kinds = {topic.name: topic.kind for topic in FlightTopics(log).topics}
    assert kinds["/sensors/own"] == kind
