"""Real-time loop of a studio page, between its flights and its browser tabs."""

from __future__ import annotations

import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from queue import SimpleQueue
from typing import TYPE_CHECKING

from skyarm.view.studio.controls import HERTZ, literal

if TYPE_CHECKING:
    from skyarm.view.studio.picture import StudioStage
    from skyarm.view.studio.server import ViserServer

FRAME = 1.0 / 60.0
"""Time (s) between two pictures, the usual one of screens."""

IDLE = 0.1
"""Time (s) between two polls while no browser tab is open; the flight waits for one."""

Work = Callable[[], None]


class PageLoop(ABC):
    """Real-time loop of a page; requests of browser tabs are executed by the drawing
    thread between two frames.

    Args:
        server: server of viser.
        work: name of the thread for what takes longer than a picture may.
    """

    _picture: StudioStage

    def __init__(self, server: ViserServer, work: str) -> None:
        self._server = server
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix=work)
        self._orders: SimpleQueue[Work] = SimpleQueue()
        self._stopped = threading.Event()
        self._words = ""

    def stop(self) -> None:
        """End the real-time loop of the page."""
        self._stopped.set()

    def run(self) -> None:
        """Advance the flights and draw them, again and again, until :meth:`stop` is
        called.
        """
        last = time.perf_counter()
        slow = 0.0
        try:
            while not self._stopped.is_set():
                watched = bool(self._server.get_clients())
                now = time.perf_counter()
                self._handle_inputs()
                if watched:
                    self._advance(now - last)
                with self._server.atomic():
                    if watched:
                        self._draw()
                    if now - slow >= 1.0 / HERTZ:
                        slow = now
                        self._draw_slowly()
                # what passed unwatched is not made up for when a tab opens
                last = now
                self._stopped.wait(
                    max(0.0, (FRAME if watched else IDLE) - (time.perf_counter() - now))
                )
        finally:
            self._close()

    @abstractmethod
    def _advance(self, seconds: float) -> None:
        """Advance the flights by an elapsed wall-clock time (s)."""

    @abstractmethod
    def _draw(self) -> None:
        """Update the page's 3D picture."""

    @abstractmethod
    def _draw_slowly(self) -> None:
        """Update plots, status text and clock, at a lower rate than the 3D picture."""

    def _close(self) -> None:
        """Stop the background thread of the page."""
        self._worker.shutdown(wait=False, cancel_futures=True)

    def _handle_inputs(self) -> None:
        """Execute the queued inputs of the browser tabs; an invalid one is reported on
        the page.
        """
        # this thread alone takes orders, so one that is there stays there
        while not self._orders.empty():
            self._try(self._orders.get())

    def _try(self, work: Work) -> None:
        try:
            work()
        except (ValueError, OSError) as error:
            self._say(" ".join(str(error).split()))

    def _say(self, words: str) -> None:
        self._words = words

    def follow(self, follows: bool) -> None:
        """Make the camera follow the first vehicle, or stand still."""
        self._orders.put(lambda: setattr(self._picture, "follow", follows))

    def _with_report(self, lines: Sequence[str]) -> str:
        """Join the paragraphs of a status text, followed by the last report."""
        return "\n\n".join([*lines, *([literal(self._words)] if self._words else [])])
