"""Newest state estimate of an autopilot and its answer to a mode request, for any
protocol.
"""

from __future__ import annotations

import math
import time

from skyarm.algebra import Vec3
from skyarm.links.mavlink_vehicle import SET_MODE
from skyarm.links.outside.state_frames import AutopilotState, is_whole

COMPONENT = 191
"""MAVLink's component number of this program, an onboard computer."""


class Estimates:
    """Storage of an autopilot's newest state estimate and of its answer to a mode
    request.

    Attributes:
        state: newest estimate, None before the first; ``fresh`` is True until
            :meth:`take` has returned it.
        heard, force_heard: s of the wall clock of the newest state, and of the newest
            accelerometer reading.
        landed: True if the newest message says so.
        accepted, refused: True if the requested mode is taken; result of a refused
            request.
    """

    accelerometer: str
    """Cure of an autopilot that sends no accelerometer reading."""

    def __init__(self) -> None:
        self.state: AutopilotState | None = None
        self.fresh, self.landed, self.heard = False, True, -math.inf
        self.accepted, self.refused = False, 0
        self._requested_mode = False
        self._force: Vec3 | None = None
        self.force_heard = -math.inf

    @property
    def hint(self) -> str:
        """Cause and cure of an autopilot's silence, as far as its messages show one;
        else empty.
        """
        return ""

    def take(self) -> AutopilotState | None:
        """Newest state estimate if it has arrived since the last call; else None."""
        if not self.fresh:
            return None
        self.fresh = False
        return self.state

    def _await_answer(self) -> None:
        """Expect an answer to a mode request, and forget earlier answers."""
        self._requested_mode, self.accepted, self.refused = True, False, 0

    def _keep(self, state: AutopilotState) -> None:
        """Store a state estimate if it is finite and newer than the last one."""
        # time must rise: UDP may deliver an older estimate after a newer one
        if is_whole(state) and (self.state is None or state.time > self.state.time):
            self.state, self.fresh, self.heard = state, True, time.monotonic()

    def _keep_force(self, force: Vec3) -> None:
        """Store a specific force for the state estimates that follow; three zeros are
        no reading.
        """
        # an autopilot without accelerometer data fills its message with zeros
        if all(map(math.isfinite, force)) and any(force):
            self._force, self.force_heard = force, time.monotonic()

    def _take_answer(
        self, command: int, result: int, to: tuple[int, int], ours: tuple[int, int]
    ) -> None:
        """Store the answer to our mode request, if it is addressed to our system and
        component.
        """
        if command == SET_MODE and self._requested_mode and to == ours:
            self.accepted, self.refused = result == 0, result
