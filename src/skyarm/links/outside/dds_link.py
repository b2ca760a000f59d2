"""uXRCE-DDS connection of a control law to PX4: vehicle state in, motor set points and
modes out.

The agent makes DDS topics of what PX4's client sends:
:mod:`skyarm.links.outside.px4_topics`. Source: docs.px4.io, "uXRCE-DDS" and "Offboard
mode".
"""

from __future__ import annotations

import math
import re
import time

from skyarm.algebra.frames import to_our_attitude, to_our_axes
from skyarm.links.mavlink_vehicle import MODES, PX4_NUMBER, SET_MODE
from skyarm.links.outside.estimates import COMPONENT, Estimates
from skyarm.links.outside.offboard_link import OffboardError
from skyarm.links.outside.outside_law import MotorCommand, SetPoint
from skyarm.links.outside.px4_topics import (
    ALIVE,
    COMMAND,
    DEFINITIONS,
    IN,
    MOST_MOTORS,
    MOTORS,
    ODOMETRY,
    OUT,
    TYPES,
)
from skyarm.links.outside.state_frames import AutopilotState
from skyarm.links.ros.node import Content, RosError
from skyarm.links.ros.ros2_node import MOST_DOMAIN, Ros2Node
from skyarm.log.ros.message_bytes import MessageError, decode, encode
from skyarm.records.files import errors_as, shown

FORM = re.compile(r"dds://(\d{1,3})((?:/[A-Za-z_]\w*)*)/?", re.ASCII)
"""Pattern of a DDS address: domain, and namespace of PX4's topics."""

OURS = 1, COMPONENT
"""System and component number of this program."""

NED, FRD, BODY = 1, 2, 3
"""Frames of an odometry message: north-east-down; the same with another heading; base
axes, for velocities only."""


def parse_domain(url: str) -> tuple[int, str]:
    """Domain number and namespace of a link address such as ``dds://0`` or
    ``dds://0/px4_1``.

    Raises:
        OffboardError: another form.
    """
    match = FORM.fullmatch(url)
    if match is None or int(match[1]) > MOST_DOMAIN:
        raise OffboardError(
            f"--link = {shown(url)}: must be dds://DOMAIN or dds://DOMAIN/NAMESPACE,"
            f" with a domain from 0 to {MOST_DOMAIN}"
        )
    return int(match[1]), match[2]


class DdsLink(Estimates):
    """Connection to PX4 through a uXRCE-DDS agent, as an alternative to MAVLink.

    Args:
        url: ``dds://DOMAIN`` or ``dds://DOMAIN/NAMESPACE``.

    Attributes:
        title: name of the autopilot; empty before it has sent its mode.
        obeys, holds: True if its mode takes external set points; if it flies by itself.
    """

    accelerometer = "let its dds_topics.yaml publish sensor_combined"

    def __init__(self, url: str) -> None:
        super().__init__()
        domain, self._space = parse_domain(url)
        with errors_as(OffboardError, f"--link = {shown(url)}: ", RosError):
            self._node = Ros2Node(domain, TYPES)
        try:
            for topic, kind in OUT.items():
                self._node.subscribe(self._space + topic, kind)
            for topic, kind in IN.items():
                self._node.advertise(self._space + topic, kind)
        except BaseException:
            self._node.close()
            raise
        self.title = self.said = ""
        self.armed = self.obeys = self.holds = False
        self.beaten, self.lost = -math.inf, 0
        self.round_trips: tuple[float, ...] = ()
        self._readers = {
            "px4_msgs/VehicleOdometry": self._hear_odometry,
            "px4_msgs/SensorCombined": self._hear_inertial,
            "px4_msgs/VehicleControlMode": self._hear_mode,
            "px4_msgs/VehicleLandDetected": self._hear_landed,
            "px4_msgs/VehicleCommandAck": self._hear_answer,
        }

    @property
    def has_autopilot(self) -> bool:
        """True once PX4 has sent its mode and subscribes to the set points."""
        return bool(self.title) and all(
            self._node.subscribers(self._space + topic) for topic in IN
        )

    def wait(self, seconds: float) -> None:
        """Wait for messages, at most a given time (s), and read all that have
        arrived.
        """
        self._node.wait(seconds)
        for topic, kind in OUT.items():
            for data in self._node.take(self._space + topic):
                try:
                    message = decode(kind, DEFINITIONS, data)
                except MessageError:
                    # a message of another definition is no reason to end a flight
                    self.lost += 1
                    continue
                self._readers[kind](message)

    def beat(self) -> None:
        """Send no heartbeat, since each set point shows PX4 that this program is
        alive.
        """

    def request_estimates(self, rate: float) -> None:
        """Raise an error if several vehicles publish on PX4's topics; PX4 chooses the
        rates itself.

        Raises:
            OffboardError: more than one publishes its estimate.
        """
        topic = self._space + ODOMETRY
        count = self._node.publishers(topic)
        if count > 1:
            raise OffboardError(
                f"--link: {count} vehicles publish {topic}: must be one; add its"
                " namespace"
            )

    def request_outside(self) -> None:
        """Request the mode that takes external set points; ``accepted`` is True once
        PX4 agrees.
        """
        self._await_answer()
        self._set_mode(*MODES[PX4_NUMBER].outside)

    def request_hold(self) -> None:
        """Request PX4's mode that holds the position."""
        self._set_mode(*MODES[PX4_NUMBER].hold)

    def send(self, command: SetPoint) -> None:
        """Send motor thrusts, and the message that declares motors as the type of set
        point.
        """
        assert isinstance(command, MotorCommand)
        stamp = self._stamp()
        rest = (math.nan,) * (MOST_MOTORS - len(command.thrusts))  # stopped
        self._send(ALIVE, timestamp=stamp, direct_actuator=1)
        self._send(
            MOTORS,
            timestamp=stamp,
            timestamp_sample=stamp,
            control=(*map(float, command.thrusts), *rest),
        )

    def close(self) -> None:
        """Leave the DDS domain."""
        self._node.close()

    def _stamp(self) -> int:
        """Time stamp (us) for set points on PX4's clock; 0 before the first estimate,
        when PX4 uses its own time.
        """
        return (
            0
            if self.state is None
            # set points state PX4's own time, which goes on since its newest estimate
            # was heard
            else round(1e6 * (self.state.time + time.monotonic() - self.heard))
        )

    def _set_mode(self, main: int, sub: int) -> None:
        self._send(
            COMMAND,
            timestamp=self._stamp(),
            # the numbers are those of PX4's own modes (a flag of MAVLink)
            param1=1.0,
            param2=float(main),
            param3=float(sub),
            command=SET_MODE,
            source_system=OURS[0],
            source_component=OURS[1],
            from_external=1,
        )

    def _send(self, topic: str, **values: float | tuple[float, ...]) -> None:
        self._node.send(
            self._space + topic, encode(IN[topic], DEFINITIONS, values, 1)[0].tobytes()
        )

    def _hear_mode(self, m: Content) -> None:
        self.title = "PX4"
        self.obeys = bool(m["flag_control_offboard_enabled"])
        # the flag of autonomous flight alone: any mode that flies by itself counts
        self.holds = bool(m["flag_control_auto_enabled"]) and not self.obeys
        self.armed, self.beaten = bool(m["flag_armed"]), time.monotonic()

    def _hear_landed(self, m: Content) -> None:
        self.landed = bool(m["landed"])

    def _hear_answer(self, m: Content) -> None:
        self._take_answer(
            m["command"], m["result"], (m["target_system"], m["target_component"]), OURS
        )

    def _hear_inertial(self, m: Content) -> None:
        self._keep_force(to_our_axes(*m["accelerometer_m_s2"]))

    def _hear_odometry(self, m: Content) -> None:
        """Store an odometry estimate, if its coordinate frames are known."""
        frame, quaternion = m["velocity_frame"], to_our_attitude(*m["q"])
        velocity = to_our_axes(*m["velocity"])
        if frame == BODY:
            velocity = quaternion.rotation().apply(velocity)
        state = AutopilotState(
            time=1e-6 * m["timestamp_sample"],
            position=to_our_axes(*m["position"]),
            quaternion=quaternion,
            velocity=velocity,
            rate=to_our_axes(*m["angular_velocity"]),
            specific_force=self._force,
        )
        if m["pose_frame"] in (NED, FRD) and frame in (m["pose_frame"], BODY):
            self._keep(state)
