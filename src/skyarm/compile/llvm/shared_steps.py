"""Steps of many lanes in slices of milliseconds, shared out to threads.

Python handles signals between slices, and machine code lets other threads run. Where several threads step, the caller
only waits: what is raised there, as Ctrl-C raises it, never comes between a slice and the note that it was made.
"""

from __future__ import annotations

import _thread
import ctypes
import os
import time
import weakref
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import Any

import numpy.typing as npt

Work = Callable[[], object]


class ThreadPool:
    """Daemon threads that call functions; they end with the pool.

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
        """Give the threads back to the pool."""
        self._idle.append(pool)

    def close(self) -> None:
        """End the threads that no caller uses now, with their pools; callers to come get others."""
        self._idle.clear()


Array = npt.NDArray[Any]

SLICE = 0.003
"""s that a thread steps at a time. Each slice computes anew what depends on parameters alone: 13 us of a quadrotor with
a two-joint arm."""

GUESS = 2e-10
"""s of an operation on a vector, before the kernel has been timed."""

TIMED = 0.005
"""s that a run must take for the kernel's speed to be taken from it."""

SHARED = 5e-5
"""s of work that are worth another thread, which takes some 20 us to wake."""

SHARES = 4
"""Groups of blocks for each thread, at least: some take longer than others."""

WAIT = 0.3
"""s after which a caller that waits looks for signals, where a wait is not ended by them."""

Arguments = ctypes.c_int64 * 12
"""Of the machine code: five arrays, first and last block, begin, end, start, lanes, log every."""

FIRST, LAST, BEGIN, END, START = range(5, 10)


@dataclass(slots=True)
class Machine:
    """A kernel's code for many lanes.

    Attributes:
        call: takes :data:`Arguments`. engine: holds the code. pools: threads.
        pace: s that a thread takes for a step of one block; a guess until it is measured.
    """

    call: Callable[[Any], None]
    engine: Any
    pools: ThreadPools
    pace: float

    def measure(self, seconds: float, work: int) -> None:
        """Learn the pace from the time of so many steps of blocks by one thread."""
        if seconds > TIMED and work:
            # a thread that was held up once must not change the slices much
            self.pace = min(max(seconds / work, self.pace / 8.0), 8.0 * self.pace)


class SharedSteps:
    """Steps of all blocks of lanes.

    Args:
        machine: the code. arrays: carry, parameters, rows, log and keys, in machine code's layout.
        blocks, lanes, every: as machine code takes them. threads: most that work at a time.
    """

    def __init__(
        self, machine: Machine, arrays: Sequence[Array], *, blocks: int, lanes: int, every: int = 1, threads: int = 1
    ) -> None:
        self._machine, self._blocks, self._steps = machine, blocks, len(arrays[2])
        self._most = threads
        # whoever may still step holds arrays and machine code
        self._arrays, self._fixed = arrays, (*map(_address, arrays), 0, 0, 0, 0, 0, lanes, every)

    def run(self, start: int, *, whole: bool = False) -> None:
        """Make all steps; ``start``: number of the first, for the random numbers.

        What is raised meanwhile comes through within milliseconds, or, where the arrays are to be a ``whole``, once
        every lane has made its steps.
        """
        machine, work = self._machine, self._blocks * self._steps
        group, span = slice_work(self._blocks, self._steps, machine.pace, self._most)
        groups = deque(range(0, self._blocks, group))
        count = len(groups)
        least = 2 if whole else 1  # the caller of a whole only waits
        threads = max(least, min(self._most, count, int(work * machine.pace / SHARED)))
        made, given_up = deque[int](), list[bool]()

        def step() -> None:
            arguments = Arguments(*self._fixed)
            arguments[START] = start
            with suppress(IndexError):  # no group is left
                while not given_up:
                    first = groups.popleft()
                    arguments[FIRST], arguments[LAST] = first, min(first + group, self._blocks)
                    for begin in range(0, self._steps, span):
                        if given_up:
                            return
                        arguments[BEGIN], arguments[END] = begin, min(begin + span, self._steps)
                        machine.call(arguments)
                    made.append(first)

        begun = time.perf_counter()
        if threads == 1:
            step()
        else:
            try:
                self._share(step, threads)
            except BaseException:
                if not whole:
                    given_up.append(True)
                    raise
                step()
                while len(made) < count:
                    time.sleep(SLICE)
                raise
        machine.measure((time.perf_counter() - begun) * threads, work)

    def _share(self, step: Callable[[], None], threads: int) -> None:
        """Run the threads' steps, and wait for all of them."""
        ended: SimpleQueue[None] = SimpleQueue()

        def step_and_tell() -> None:
            step()
            ended.put(None)

        pool = self._machine.pools.take()
        try:
            pool.call(step_and_tell, threads)
            while threads:
                with suppress(Empty):
                    ended.get(timeout=WAIT)
                    threads -= 1
        finally:
            self._machine.pools.give(pool)


def slice_work(blocks: int, steps: int, pace: float, threads: int) -> tuple[int, int]:
    """(blocks of a group, steps of a slice) that take one thread about ``SLICE``."""
    fit = max(1, int(SLICE / pace))
    if steps > fit:
        parts = -(-steps // fit)
        return 1, -(-steps // parts)
    steps = max(1, steps)
    shared = -(-blocks // (SHARES * threads)) if threads > 1 else blocks
    return max(1, min(fit // steps, shared)), steps


def _address(array: Array) -> int:
    address: int = array.__array_interface__["data"][0]
    return address
