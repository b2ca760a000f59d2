"""A page that shows an episode which somebody else steps: the studio's picture and its guard, without sliders."""

from __future__ import annotations

import math
import secrets
import threading
import time
import webbrowser
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from skyarm.dynamics import State
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.loop_state import LoopState
from skyarm.view.studio.controls import literal
from skyarm.view.studio.picture import TRAIL, Picture
from skyarm.view.studio.server import LOOPBACK, Guard, StudioError, bound, close_server, open_server, require_viser
from skyarm.view.studio.sights import Sight, Watched, sight

FRAME = 1.0 / 30.0
"""s of wall time between two pictures."""

LONGEST_WAIT = 0.5
"""s of wall time: after a longer pause of whoever steps, the clock goes on from where the episode is."""


@dataclass(frozen=True, slots=True)
class Instant:
    """An episode at one instant, as a session shows it.

    Attributes:
        scenario: with the numbers of the episode. now: state of the loop. lost: why it ended early, in words.
    """

    scenario: Scenario
    now: LoopState
    lost: str = ""

    @property
    def tick(self) -> int:
        """Control periods flown."""
        ticks: Any = self.now.ticks
        return int(ticks)

    @property
    def time(self) -> float:
        """s of the episode."""
        return self.tick / self.scenario.rates.control

    @property
    def state(self) -> State:
        """Of the plant."""
        state: State = self.now.state
        return state

    @property
    def running(self) -> bool:
        """Whether it has not ended early."""
        return not self.lost


class WatchedEpisode(Watched):
    """An episode whose loop state is handed over now and then."""

    session: Instant

    def __init__(self, now: Instant) -> None:
        self.title = now.scenario.controller.name
        self.sights: list[Sight] = []
        self.see(now)

    def see(self, now: Instant) -> None:
        """Take over the latest state."""
        self.session = now
        first = now.tick - TRAIL * now.scenario.rates.control
        self.sights = [*(each for each in self.sights if each.tick >= first), sight(now)]

    @property
    def lost(self) -> str:
        """Why it ended early, in words; empty while it flies."""
        return self.session.lost


class EpisodePage:
    """A page on this machine's loopback that shows one episode after the other, at the pace of a clock.

    Args:
        title: of the page.
        port: 0 takes a free one.
        speed: s of an episode that pass in a second at most; ``inf`` waits for nothing.
        plain: without shadows, for browsers that draw in software.
        browser: whether the address is opened in the user's browser.
        clock, wait: s, and waiting for so many; of the wall if left out.

    Attributes:
        address: with the token that every tab must bear.

    Raises:
        StudioError: one line: the extra is missing, or the port is taken.
    """

    def __init__(
        self,
        title: str,
        *,
        port: int = 0,
        speed: float = 1.0,
        plain: bool = False,
        browser: bool = True,
        clock: Callable[[], float] = time.perf_counter,
        wait: Callable[[float], None] = time.sleep,
    ) -> None:
        require_viser()
        listening = bound(LOOPBACK[0], port)
        try:
            guard = Guard(LOOPBACK[0], int(listening.getsockname()[1]), secrets.token_hex(16))
            self._server: Any = open_server(listening, guard, title)
        except BaseException:
            listening.close()
            raise
        self.address, self._speed, self._clock, self._wait = guard.address(), speed, clock, wait
        self._server.gui.configure_theme(show_logo=False, show_share_button=False)
        self._words = self._server.gui.add_markdown("")
        self._picture = Picture(self._server, plain=plain)
        self._episode: WatchedEpisode | None = None
        self._drawn = self._shown = -math.inf
        if browser:
            threading.Thread(target=webbrowser.open, args=(self.address,), daemon=True).start()

    def begin(self, scenario: Scenario, now: LoopState) -> None:
        """Draw the first state of an episode.

        Raises:
            StudioError: the page is closed.
        """
        if self._server is None:
            raise StudioError("page: must be open; close() has closed it")
        first = Instant(scenario, now)
        self._episode = WatchedEpisode(first)
        with self._server.atomic():
            self._picture.build(scenario, [self._episode.title])
        self._began = self._clock() - first.time / self._speed
        self._shown = first.time
        self._draw(self._episode)

    def show(self, now: LoopState, lost: str = "") -> None:
        """Show the latest state, no sooner than its time has come and no more often than thirty times a second.

        Args:
            now: of the episode that was begun.
            lost: why it has ended early, in words; empty while it flies.

        Raises:
            StudioError: no episode was begun, or the page is closed.
        """
        episode = self._episode
        if episode is None or self._server is None:
            raise StudioError("show: must come after begin(), and before close()")
        instant = Instant(episode.session.scenario, now, lost)
        due = self._began + instant.time / self._speed - self._clock()
        if due < -LONGEST_WAIT:
            self._began -= due
        elif due > 0.0:
            self._wait(due)
        if lost or self._clock() - self._drawn >= FRAME:
            episode.see(instant)
            self._draw(episode)

    def close(self) -> None:
        """Close the page; a second time does nothing."""
        if self._server is not None:
            close_server(self._server)
            self._server = None

    def _draw(self, episode: WatchedEpisode) -> None:
        if episode.lost:
            self._picture.hurry()
        now = episode.session
        with self._server.atomic():
            self._picture.draw([episode], now.time - self._shown)
            ending = f", {literal(episode.lost)}" if episode.lost else ""
            part = "tip" if episode.vehicle.end_effector else "base"
            self._words.content = f"{now.time:.2f} s, {part} error {1e3 * episode.last.error:.1f} mm{ending}"
        self._shown, self._drawn = now.time, self._clock()
