"""Vehicle that an autopilot guides along set points of ours: origin of its local frame, take-off, mode and arming.

An autopilot's local frame begins where its estimator began; the mean difference of its place and ours at rest says
where that is.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from skyarm.links import mavlink
from skyarm.links.autopilots.autopilot import Goal, LinkError, Numbers
from skyarm.links.mavlink_vehicle import MODES, MavlinkVehicle

POSITION_MASK = 0b100_000_000_000
"""Set points of position, velocity, acceleration and yaw; the yaw rate is ignored."""

ABSENCE = 3.0
"""s out of the mode for set points from outside, in flight, after which the flight is over."""


class GuidedVehicle(MavlinkVehicle):
    """Vehicle under one autopilot's guidance.

    Args:
        kind: MAVLink's number of the autopilot.
        carry: called with each frame to send.
        system: of the autopilot; 0 for that of the first heartbeat.
        datagrams: True where whole frames arrive.

    Attributes:
        origin: of its local frame, less ours, m; None before it is known.
        away: departures from the mode for set points from outside.
    """

    def __init__(self, kind: int, carry: Callable[[bytes], None], *, system: int = 0, datagrams: bool = False) -> None:
        super().__init__({kind: MODES[kind]}, carry, system=system, datagrams=datagrams)
        self.numbers = MODES[kind]
        self.origin: tuple[float, ...] | None = None
        self.away, self._absent = 0, 0.0
        self._differences: list[tuple[float, ...]] = []

    def tell(self, name: str, **fields: Any) -> None:
        """Send a message.

        Raises:
            LinkError: a value that does not fit.
        """
        try:
            super().tell(name, **fields)
        except mavlink.MavlinkError as error:
            raise LinkError(f"a set point cannot be sent to {self.numbers.title}: {error}") from None

    def compare_place(self, ours: Numbers, still: bool) -> int:
        """Take a difference of its place and ours; returns how many there are since it stands ``still``."""
        if self.place is None or not still:
            self._differences.clear()
        else:
            self._differences.append(tuple(a - b for a, b in zip(self.place, ours, strict=True)))
        return len(self._differences)

    def find_origin(self, last: int) -> None:
        """Set the origin to the mean of the last differences."""
        rows = self._differences[-last:]
        self.origin = tuple(sum(column) / len(rows) for column in zip(*rows, strict=True))

    def rise(self, height: float) -> float:
        """Height of its place over a height of ours, m; zero before both are known."""
        return 0.0 if self.place is None or self.origin is None else self.place[2] - self.origin[2] - height

    def send_goal(self, time: float, goal: Goal) -> None:
        """Send a set point of position, velocity, acceleration and yaw in its local frame."""
        assert self.origin is not None
        x, y, z = (a + b for a, b in zip(goal.position, self.origin, strict=True))
        vx, vy, vz = goal.velocity
        ax, ay, az = goal.acceleration
        self.tell_autopilot(
            "SET_POSITION_TARGET_LOCAL_NED", time_boot_ms=round(time * 1e3), coordinate_frame=1,
            type_mask=POSITION_MASK, x=x, y=-y, z=-z, vx=vx, vy=-vy, vz=-vz, afx=ax, afy=-ay, afz=-az, yaw=-goal.yaw,
        )  # fmt: skip

    @property
    def obeys(self) -> bool:
        """True in the mode for set points from outside."""
        return self.numbers.is_outside(self.mode)

    @property
    def holds(self) -> bool:
        """True in the mode that holds the place."""
        return self.numbers.is_hold(self.mode)

    def require_obedience(self, armed: bool, seconds: float) -> None:
        """Check, some seconds after the last time, that it flies on under our set points.

        Raises:
            LinkError: it is disarmed, or has left the mode for set points from outside and does not come back.
        """
        title, words = self.numbers.title, f": {self.said}" if self.said else ""
        if not armed:
            raise LinkError(f"{title} disarmed in flight{words}")
        if self.obeys:
            self._absent = 0.0
            return
        self.away += self._absent == 0.0
        self._absent += seconds
        if self._absent > ABSENCE:
            mode = self.numbers.main(self.mode)
            raise LinkError(f"{title} left {self.numbers.word} mode for its mode {mode}{words}")
