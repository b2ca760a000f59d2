"""Axes of the quantities in messages of ROS, by the frames that these name or
number.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

from skyarm.flight_data.columns_file import QuantitySource
from skyarm.flight_data.raw_tables import RawTable
from skyarm.records.immutable import positional

IMU, PX4 = "sensor_msgs/msg/Imu", "px4_msgs/"
"""Type of the messages of inertial units, and beginning of the types of PX4's
messages."""

NED, FRD, BODY_FRD = 1, 2, 3
"""Axes of PX4's odometry: north, east, down; forward, right, down of a place on the
ground; those of the base."""

NAMES: Mapping[float, str] = {
    0: "unknown",
    NED: "NED",
    FRD: "FRD",
    BODY_FRD: "the base's FRD",
}
"""Number of the axes -> their name."""

BEFORE_2022 = {0: NED, 1: FRD, 2: 0, 3: BODY_FRD}
"""Numbers of the axes in ``local_frame`` and ``velocity_frame`` of PX4's older
odometry -> those of today; its 2 names other axes, which are not known."""

DOWN = re.compile(r"(.*[/_])?(ned|frd|aircraft)", re.IGNORECASE)
"""Pattern of the names of frames whose z axis points down."""

WORLDS = re.compile(r"(.*/)?(map|world|odom|earth)", re.IGNORECASE)
"""Pattern of the names of frames that do not move with the base (REP 105)."""


@positional
class MessageAxes:
    """Axes of the quantities in messages, by the frames that these name.

    Attributes:
        kinds: types of the messages of each topic.
        tables: numbers of each topic.
        frames: frame and child frame of the messages of each topic.
        turned: topics of inertial units that fixed transforms turn.
        notes: sentences on what is left out, extended here.
    """

    kinds: Mapping[str, str]
    tables: Mapping[str, RawTable]
    frames: Mapping[str, tuple[str, str]]
    turned: frozenset[str]
    notes: list[str]

    def of(self, name: str, source: QuantitySource) -> QuantitySource | None:
        """Source of a quantity in the axes of its messages; None, with a note, where
        these are not known.
        """
        topic = source.topic
        table = self.tables[source.topic]
        parent, child = self.frames[topic]
        if self.kinds[topic].startswith(PX4):
            return self._of_px4(name, source, table)
        # an inertial unit names the frame of its own readings, not of a parent; one
        # that fixed transforms turn is in the base's axes thereafter
        if self.kinds[topic] == IMU:
            parent, child = "", "" if topic in self.turned else parent
        # a twist in the world's axes
        if child and (child == parent or WORLDS.fullmatch(child)):
            if name == "gyro":
                self.notes.append(
                    f"gyro: of {topic} is left out: its rates are in the axes of the"
                    " world."
                )
                return None
            child = ""
            source = replace(source, frame="") if name == "velocity" else source
        in_world, in_base = (
            DOWN.fullmatch(each) is not None for each in (parent, child)
        )
        if name == "quaternion" and in_world != in_base and not (parent and child):
            self.notes.append(
                f"quaternion: of {topic} is left out: {parent or child} tells one of"
                " its two axes; a columns.toml may."
            )
            return None
        return replace(
            source,
            frame="FRD" if in_base and source.frame else source.frame,
            world="NED" if in_world else source.world,
        )

    def _of_px4(
        self, name: str, source: QuantitySource, table: RawTable
    ) -> QuantitySource | None:
        """Source of a quantity of PX4, by the numbers of the axes in its odometry."""
        axes = self._numbers(table)
        # a message without such numbers is in the axes that its type defines
        if name not in axes or not axes["position"]:
            return source
        worlds = [
            self._numbers(each)["position"]
            for topic, each in self.tables.items()
            if topic in self.kinds
        ]
        # these messages are in north, east, down by their definition
        others = {
            "px4_msgs/msg/VehicleLocalPosition",
            "px4_msgs/msg/VehicleAttitude",
        } & {*self.kinds.values()}
        pose = next(
            (
                each
                for each in (NED, FRD)
                if {each} in worlds or (others and each == NED)
            ),
            0,
        )
        # without a pose any world does
        world = {pose} if pose else axes["velocity"] - {BODY_FRD, 0}
        if name == "velocity" and axes[name] == {BODY_FRD}:
            return replace(source, frame="FRD")
        if axes[name] == world:
            return source
        listed, flown = (
            ", ".join(NAMES.get(each, NAMES[0]) for each in sorted(some))
            for some in (axes[name], world or {0})
        )
        self.notes.append(
            f"{name}: of {source.topic} is left out: it is in {listed}, the flight in"
            f" {flown} axes."
        )
        return None

    @staticmethod
    def _numbers(table: RawTable) -> dict[str, set[float]]:
        """Numbers of the axes of position, attitude and velocity in a table of PX4."""
        is_old, found = table.has("local_frame"), dict[str, set[float]]()
        for name, column in (
            ("position", "local_frame" if is_old else "pose_frame"),
            (
                "velocity",
                "velocity_frame",
            ),
        ):
            stated = (
                {*table.numbers(column).tolist()} if table.has(column) else set[float]()
            )
            found[name] = (
                {BEFORE_2022.get(int(each), 0) for each in stated} if is_old else stated
            )
        return {
            "quaternion": found["position"],
            **found,
            # of a message that does not number them they are those of its pose
            "velocity": found["velocity"] or found["position"],
        }
