"""Vehicle guided by set points through an autopilot: origin of its local frame,
take-off, mode and arming.

An autopilot's local frame begins where its estimator began; the mean difference of its
place and ours at rest says where that is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

from skyarm.algebra.frames import to_our_axes
from skyarm.links import mavlink
from skyarm.links.autopilots.autopilot import BaseGoal, LinkError, Numbers
from skyarm.links.mavlink_messages import FieldValue
from skyarm.links.mavlink_vehicle import MODES, MavlinkVehicle

POSITION_MASK = 0b100_000_000_000
"""Mask of set points with position, velocity, acceleration and yaw; the yaw rate is
ignored."""

REPLY = 1.0
"""Time (s) after which a missing parameter is requested again."""

FEW = 8
"""Number of parameters that are requested at once; ArduPilot drops requests that its
queue cannot hold."""

ABSENCE = 3.0
"""Time (s) outside the mode for external set points after which the flight ends."""


class GuidedVehicle(MavlinkVehicle):
    """Vehicle that an autopilot flies under position set points from this program.

    Args:
        kind: MAVLink's number of the autopilot.
        carry: called with each frame to send.
        stated: parameters of the user.
        system: number of the autopilot; 0 for that of the first heartbeat.
        datagrams: True where whole frames arrive.

    Attributes:
        origin: origin of its local frame, less ours, m; None before it is known.
        away: departures from the mode for set points from outside.
    """

    def __init__(
        self,
        kind: int,
        carry: Callable[[bytes], None],
        stated: Iterable[tuple[str, float]] = (),
        *,
        system: int = 0,
        datagrams: bool = False,
    ) -> None:
        super().__init__({kind: MODES[kind]}, carry, system=system, datagrams=datagrams)
        self.numbers = MODES[kind]
        self.origin: tuple[float, ...] | None = None
        self.away, self._absent = 0, 0.0
        self._differences: list[tuple[float, ...]] = []
        self._unread = dict(stated)
        self._begun = math.inf
        self._requested_at = -math.inf

    def tell(self, name: str, **fields: FieldValue) -> None:
        """Send a MAVLink message.

        Raises:
            LinkError: a value that does not fit.
        """
        try:
            super().tell(name, **fields)
        except mavlink.MavlinkError as error:
            raise LinkError(
                f"a set point cannot be sent to {self.numbers.title}: {error}"
            ) from None

    def compare_place(self, ours: Numbers, still: bool) -> int:
        """Record the autopilot's reported position minus a given one; return the count
        of records while ``still``.
        """
        if self.place is None or not still:
            self._differences.clear()
        else:
            self._differences.append(
                tuple(a - b for a, b in zip(self.place, ours, strict=True))
            )
        return len(self._differences)

    def find_origin(self, last: int) -> None:
        """Set the origin of the autopilot's local frame to the mean of the last
        position differences.
        """
        rows = self._differences[-last:]
        self.origin = tuple(
            sum(column) / len(rows) for column in zip(*rows, strict=True)
        )

    def rise(self, height: float) -> float:
        """Height (m) of the vehicle above a height in the world; zero while its
        position or origin is unknown.
        """
        return (
            0.0
            if self.place is None or self.origin is None
            else self.place[2] - self.origin[2] - height
        )

    def send_goal(self, time: float, goal: BaseGoal) -> None:
        """Send a set point (position, velocity, acceleration, yaw) in the autopilot's
        local frame.
        """
        assert self.origin is not None
        x, y, z = to_our_axes(
            *(a + b for a, b in zip(goal.position, self.origin, strict=True))
        )
        vx, vy, vz = to_our_axes(*goal.velocity)
        ax, ay, az = to_our_axes(*goal.acceleration)
        self.tell_autopilot(
            "SET_POSITION_TARGET_LOCAL_NED",
            time_boot_ms=round(time * 1e3),
            # MAV_FRAME_LOCAL_NED
            coordinate_frame=1,
            type_mask=POSITION_MASK,
            x=x,
            y=y,
            z=z,
            vx=vx,
            vy=vy,
            vz=vz,
            afx=ax,
            afy=ay,
            afz=az,
            # yaw is positive to the left here and to the right on the wire
            yaw=-goal.yaw,
        )

    def has_parameters(self, time: float, patience: float) -> bool:
        """Request the user's parameters, a few at a time; True once the autopilot
        reported all of them as stated.

        Raises:
            LinkError: it has another value, or sends none of those requested within
                ``patience`` s.
        """
        title = self.numbers.title
        for name in self._unread.keys() & self.parameters.keys():
            # patience counts from the last answer: many parameters take many rounds
            self._begun = time
            stated, value = self._unread.pop(name), self.parameters[name]
            # the autopilot keeps single precision, so equal means equal to its rounding
            if not math.isclose(value, stated, rel_tol=1e-5, abs_tol=1e-6):
                raise LinkError(
                    f"controller.parameters.{name} = {stated:g}: must be what {title}"
                    f" takes; it has {value:g}"
                )
        if not self._unread:
            return True
        self._begun = min(self._begun, time)
        if time - self._begun > patience:
            name, stated = next(iter(self._unread.items()))
            raise LinkError(
                f"controller.parameters.{name} = {stated:g}: must be a parameter that"
                f" {title} knows"
            )
        if (
            time - self._requested_at >= REPLY
            or not self._requested & self._unread.keys()
        ):
            self._requested_at = time
            self._requested.clear()
            for name in list(self._unread)[:FEW]:
                self.request_parameter(name)
        return False

    def require_obedience(self, armed: bool, seconds: float) -> None:
        """Raise an error if the vehicle is disarmed or has left the mode for external
        set points for too long.

        Raises:
            LinkError: it is disarmed, or has left the mode for set points from outside
                and does not come back.
        """
        title, words = self.numbers.title, f": {self.said}" if self.said else ""
        if not armed:
            raise LinkError(f"{title} disarmed in flight{words}")
        if self.obeys:
            self._absent = 0.0
            return
        # a departure counts once, in its first period
        self.away += self._absent == 0.0
        self._absent += seconds
        if self._absent > ABSENCE:
            mode = self.numbers.main(self.mode)
            raise LinkError(
                f"{title} left {self.numbers.word} mode for its mode {mode}{words}"
            )
