"""Threads that wait for work of one kernel: a pool for each caller at a time, kept for the kernel's life."""

from __future__ import annotations

import _thread
import os
import weakref
from collections.abc import Callable
from queue import SimpleQueue

Work = Callable[[], object]


class ThreadPool:
    """Threads that call what they are given; nobody waits for them, and they end with the pool.

    A process may end without them. What they call holds all it needs and raises nothing.
    """

    def __init__(self) -> None:
        self._process = os.getpid()
        self._queue: SimpleQueue[Work | None] = SimpleQueue()
        self._size = 0
        weakref.finalize(self, self._queue.put, None)

    @property
    def lost(self) -> bool:
        """True in a process that was forked off: threads stay behind."""
        return self._process != os.getpid()

    def call(self, work: Work, count: int) -> None:
        """Have ``count`` threads call ``work``.

        Raises:
            RuntimeError: the system allows no more threads.
        """
        while self._size < count:
            # threading.Thread takes many steps to start, between which an interrupt may be raised; this is one
            _thread.start_new_thread(_serve, (self._queue,))
            self._size += 1
        for _ in range(count):
            self._queue.put(work)


def _serve(queue: SimpleQueue[Work | None]) -> None:
    """Call what comes until there is None, which is left to the next thread. Nothing is kept while waiting."""
    while (work := queue.get()) is not None:
        work()
        del work
    queue.put(None)


class ThreadPools:
    """Pools that no caller uses now."""

    def __init__(self) -> None:
        self._idle: list[ThreadPool] = []

    def take(self) -> ThreadPool:
        """A pool that is the caller's until he gives it back; if he never does, it ends by itself."""
        while self._idle:
            try:
                # one step: two callers never get the same
                pool = self._idle.pop()
            except IndexError:
                break
            if not pool.lost:
                return pool
        return ThreadPool()

    def give(self, pool: ThreadPool) -> None:
        """Hand back what was taken."""
        self._idle.append(pool)

    def close(self) -> None:
        """End the threads that no caller uses now, with their pools; callers to come get others."""
        self._idle.clear()
