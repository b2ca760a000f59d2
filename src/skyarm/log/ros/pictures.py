"""ROS topics of cameras and lidars, whose messages are made one picture at a time.

``/sensors/NAME/depth`` has depths in m (REP 118), ``segmentation`` numbers of bodies,
whose names stand once in ``labels``, and ``camera_info`` the intrinsics. A lidar has
``points``. All are in the frame ``NAME_optical_frame``, whose true pose has the topic
``pose``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from skyarm.log.flight_log import Log
from skyarm.log.flown_scenario import restore_written, written_scenario
from skyarm.log.log_columns import word
from skyarm.log.ros.message_bytes import Values, encode
from skyarm.log.ros.messages import DEFINITIONS
from skyarm.log.ros.scene import WORLD, Topic, nanoseconds, quaternion, xyz
from skyarm.records.arrays import AnyArray
from skyarm.records.files import shipped_tables
from skyarm.records.files.names import distinct
from skyarm.sensing.cameras.camera_kinds import RaySensor

IMAGE, LABELS, CLOUD, POSE = (
    "sensor_msgs/Image",
    "vision_msgs/LabelInfo",
    "sensor_msgs/PointCloud2",
    "geometry_msgs/PoseStamped",
)

FIELDS = shipped_tables(__file__)["fields"]
"""Fields of a point of a cloud."""

POINT = np.dtype([("xyz", "<f4", 3), ("segment", "<u4")])
"""Point of a cloud: place (m) and number of the body."""

MOST_BYTES = 255
"""Largest number of names whose numbers fit into a byte, of which vision_msgs reserves
the last."""


class PictureTopics:
    """ROS topics of one camera or lidar.

    Args:
        sensor: camera or lidar.
        name: its name, behind that of its vehicle if there are several.
        within: beginning of its topics, such as ``/left/``.
        called: its word in names of topics and frames.
        epoch: ns, time stamp of the start of the flight.

    Attributes:
        topics: the topics; the first is that of the picture.
    """

    def __init__(
        self, sensor: RaySensor, name: str, within: str, called: str, epoch: int
    ) -> None:
        self.name, self.sensor = name, sensor
        self._frame = f"{within}{called}{OPTICAL}".removeprefix("/")
        self._epoch, self._begun = epoch, False
        fields = FLAT if sensor.intrinsics() else ROUND
        self.topics = [
            Topic(f"{within}sensors/{called}/{last}", kind, int(kind != LABELS), values)
            for last, (kind, values) in fields.items()
        ]

    def messages(self, seen: Any) -> Iterator[tuple[int, Topic, bytes]]:
        """Yield time of arrival (ns), topic and bytes of each message of a picture.

        Args:
            seen: picture, a :class:`skyarm.simulate.eyes.RangeImage`.
        """
        stamp = nanoseconds(np.array(seen.time)) + self._epoch
        late = nanoseconds(np.array(self.sensor.latency))
        for topic in self.topics:
            if topic.every or not self._begun:
                frame = WORLD if topic.kind == POSE else self._frame
                header: Values = {"stamp": stamp, "frame_id": frame}
                fields = {"header": header, **topic.values(seen)}
                (data,) = encode(topic.kind, DEFINITIONS, fields, 1)
                yield int(stamp + late), topic, data.tobytes()
        self._begun = True

    def of_log(self, log: Log) -> Iterator[tuple[int, Topic, bytes]]:
        """Yield the messages of all pictures that arrive within a flight, one picture
        at a time.
        """
        for seen in log.frames(self.name):
            # the sum of both times is rounded, the log's own is not
            if seen.time + self.sensor.latency <= log.time[-1] + 1e-9:
                yield from self.messages(seen)


def cameras_of(log: Log) -> dict[str, Any]:
    """Named cameras and lidars of a vehicle from its log, by their words in names of
    topics.
    """
    agent = written_scenario(log.info).get("agent")
    # a damaged file may have anything in their places
    written = agent.get("sensors") if isinstance(agent, dict) else None
    sensors = restore_written(log.info, written) if written else ()
    cameras = [
        each
        for each in (sensors if isinstance(sensors, (tuple, list)) else ())
        if getattr(getattr(each, "sensor", None), "sees", False)
    ]
    words = distinct([word(each.name) for each in cameras])
    return dict(zip(words, cameras, strict=True))


def picture_topics(log: Log, epoch: int) -> list[PictureTopics]:
    """Make the ROS topics of all cameras and lidars of a flight.

    Args:
        log: log of the flight.
        epoch: ns, time stamp of the start of the flight.
    """
    several = len(log.agents) > 1
    return [
        PictureTopics(
            each.sensor,
            f"{agent}.{each.name}" if several else each.name,
            f"/{agent}/" if several else "/",
            called,
            epoch,
        )
        for agent, own in log.agents.items()
        for called, each in cameras_of(own).items()
    ]


OPTICAL = "_optical_frame"
"""End of the names of optical frames."""


def _depth(seen: Any) -> Values:
    return {"encoding": "32FC1", **_pixels(seen.depth.astype("<f4"))}


def _segmentation(seen: Any) -> Values:
    size = 1 if len(seen.names) <= MOST_BYTES else 2
    return {
        "encoding": f"{8 * size}UC1",
        **_pixels(seen.segment.astype(f"<u{size}")),
    }


def _labels(seen: Any) -> Values:
    names = enumerate(seen.names)
    return {"class_map": [{"class_id": i, "class_name": name} for i, name in names]}


def _intrinsics(seen: Any) -> Values:
    sensor = seen.camera.sensor
    fx, fy, cx, cy = sensor.intrinsics()
    height, width = sensor.shape
    K = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    return {
        "height": height,
        "width": width,
        # a pinhole has no distortion; messages state a model all the same, of five
        # zeros
        "distortion_model": "plumb_bob",
        "d": np.zeros(5),
        "k": K.ravel(),
        "r": np.eye(3).ravel(),
        "p": np.pad(K, ((0, 0), (0, 1))).ravel(),
    }


def _cloud(seen: Any) -> Values:
    points = np.empty(seen.depth.shape, POINT)
    points["xyz"], points["segment"] = seen.points(), seen.segment
    return {
        "fields": FIELDS,
        "point_step": POINT.itemsize,
        "is_dense": bool(np.isfinite(points["xyz"]).all()),
        **_pixels(points),
    }


def _pose(seen: Any) -> Values:
    at, turn = xyz(seen.position), quaternion(seen.quaternion)
    return {"pose": {"position": at, "orientation": turn}}


def _pixels(numbers: AnyArray) -> Values:
    """Sizes and bytes of the rows and columns of an image or a cloud."""
    height, width = numbers.shape
    step = numbers.strides[0]
    return {
        "height": height,
        "width": width,
        "step": step,
        "row_step": step,
        # bytes can be viewed only of numbers that lie together
        "data": np.ascontiguousarray(numbers).view(np.uint8).ravel(),
    }


Fields = Mapping[str, tuple[str, Callable[[Any], Values]]]
"""Last word of a topic -> type of its messages, and their fields of a picture, apart
from the header."""

FLAT: Fields = {
    "depth": (IMAGE, _depth),
    "segmentation": (IMAGE, _segmentation),
    "camera_info": ("sensor_msgs/CameraInfo", _intrinsics),
    "labels": (LABELS, _labels),
    "pose": (POSE, _pose),
}
"""Topics of a camera, whose pictures are in an image plane."""

ROUND: Fields = {"points": (CLOUD, _cloud), "pose": (POSE, _pose)}
"""Topics of a lidar."""
