"""Playback clock of the studio: play, pause, speed, single steps, and jumps to any
instant.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

LONGEST_STRETCH = 0.25
"""Longest wall time (s) that is made up for; after a longer pause the flight continues
from where it was."""

SPEEDS = (0.25, 0.5, 1.0, 2.0, 4.0)
"""Speeds of playback, times real time, that the page offers."""


class Clock(ABC):
    """Playback clock that counts the periods of a simulation or replay.

    Attributes:
        tick: current period. furthest: latest one so far. playing: whether it runs.
            speed: times real time.
    """

    def __init__(self) -> None:
        self.tick = 0
        self.playing = True
        self.speed = 1.0
        self.furthest = 0
        self._due = 0.0

    @property
    @abstractmethod
    def rate(self) -> int:
        """Periods of the simulation or replay per second (Hz)."""

    @property
    @abstractmethod
    def steps(self) -> int:
        """Number of periods of the simulation or replay."""

    @property
    def time(self) -> float:
        """Current time, s."""
        return self.tick / self.rate

    @property
    def at_end(self) -> bool:
        """True if the playback clock is at the last period."""
        return self.tick == self.steps - 1

    @property
    def words(self) -> str:
        """Text with the playback clock's time, state (such as paused) and speed."""
        state = "at its end" if self.at_end else "playing" if self.playing else "paused"
        return f"{self.time:.2f} s, {state}, {self.speed:g}x"

    def advance(self, seconds: float) -> None:
        """Advance playback by an elapsed wall-clock time (s) times the chosen speed."""
        if not self.playing:
            return
        self._due += min(seconds, LONGEST_STRETCH) * self.speed * self.rate
        ticks = int(self._due)
        # the rest of a period is kept, so that no speed drifts by rounding
        self._due -= ticks
        self.go(self.tick + ticks)

    def go(self, tick: int) -> None:
        """Go forward or back to a given period; playback stops at the last one."""
        self.tick = min(max(tick, 0), self.steps - 1)
        self.furthest = max(self.furthest, self.tick)
        if self.at_end:
            self.playing = False

    def go_to_time(self, time: float) -> None:
        """Pause and go to a time (s) within those already shown."""
        self.playing = False
        self.go(min(round(time * self.rate), self.furthest))

    def step(self) -> None:
        """Pause and go forward by one period."""
        self.playing = False
        self.go(self.tick + 1)

    def reset(self) -> None:
        """Restart playback from the first period."""
        self.tick = self.furthest = 0
        self._due = 0.0
        self.playing = True
