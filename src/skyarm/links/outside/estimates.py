"""Newest estimate of an autopilot and its answer to the mode that was requested, whichever protocol carries them."""

from __future__ import annotations

import math
import time

from skyarm.algebra import Vec3
from skyarm.links.mavlink_vehicle import SET_MODE
from skyarm.links.outside.state_frames import AutopilotState, is_whole

COMPONENT = 191
"""MAVLink's component number of an onboard computer, which is ours."""


class Estimates:
    """Part of a link that keeps the autopilot's newest state and its answer to the request for a mode.

    Attributes:
        state: newest estimate, None before the first; ``fresh`` is True until :meth:`take` has returned it.
        heard: s of the wall clock of the newest state.
        landed: True if the newest message says so.
        accepted, refused: True if the requested mode is taken; result of a refused request.
    """

    def __init__(self) -> None:
        self.state: AutopilotState | None = None
        self.fresh, self.landed, self.heard = False, True, -math.inf
        self.accepted, self.refused = False, 0
        self._requested_mode = False
        self._force: Vec3 | None = None

    def take(self) -> AutopilotState | None:
        """Newest estimate if it has come since the last call."""
        if not self.fresh:
            return None
        self.fresh = False
        return self.state

    def _await_answer(self) -> None:
        """Let the next answer to a mode count."""
        self._requested_mode, self.accepted, self.refused = True, False, 0

    def _keep(self, state: AutopilotState) -> None:
        """Keep an estimate of finite numbers that is newer than the last."""
        if is_whole(state) and (self.state is None or state.time > self.state.time):
            self.state, self.fresh, self.heard = state, True, time.monotonic()

    def _keep_force(self, force: Vec3) -> None:
        """Keep a finite specific force for the next estimates."""
        self._force = force if all(map(math.isfinite, force)) else self._force

    def _take_answer(self, command: int, result: int, to: tuple[int, int], ours: tuple[int, int]) -> None:
        """Take an answer to a command: to the mode, after our request, addressed to our system and component."""
        if command == SET_MODE and self._requested_mode and to == ours:
            self.accepted, self.refused = result == 0, result
