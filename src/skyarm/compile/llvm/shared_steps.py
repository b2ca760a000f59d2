"""Parallel simulation of many SIMD lanes: work is cut into slices of milliseconds for
several threads.

Python handles signals between slices, and machine code lets other threads run.
"""

from __future__ import annotations

import _thread
import ctypes
import os
import weakref
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from queue import Empty, SimpleQueue
from time import perf_counter
from typing import Any

import numpy as np

from skyarm.records.arrays import AnyArray as Array
from skyarm.records.immutable import positional


def cores() -> int:
    """Number of processor cores that this process may use."""
    return (
        len(os.sched_getaffinity(0))
        if hasattr(os, "sched_getaffinity")
        else os.cpu_count() or 1
    )


SLICE = 0.003
"""Length (s) of the slice of work that a thread takes at a time. Each slice computes
anew what depends on parameters alone: 13 us of a quadrotor with a two-joint arm."""

GUESS = 2e-10
"""Estimated time (s) of one operation on a SIMD vector."""

SHARED = 5e-5
"""Least work (s) for which another thread is used, since waking one takes some 20
us."""

SHARES = 4
"""Least number of work groups per thread: some take longer than others."""

WAIT = 0.3
"""Time (s) after which a waiting caller checks for signals, on systems where a signal
does not end the wait."""

Arguments = ctypes.c_int64 * 12
"""Arguments of the machine code: five arrays, first and last block, begin, end, start,
lanes, logging interval."""


def arguments_of(arrays: Sequence[Array], blocks: int, lanes: int) -> Array:
    """Arguments, as of :data:`Arguments`, that step all blocks through the first row
    and log it.
    """
    addresses = [*map(_address, arrays)]
    return np.array([*addresses, 0, blocks, 0, 1, 0, lanes, 1], dtype=np.int64)


FIRST, BEGIN, START = 5, 7, 9
"""Indices among these arguments of the first block, of the first row (``begin``) and of
the number of that row's step."""


@positional
class Machine:
    """Machine code of a traced loop with its computing time per step.

    Attributes:
        call: takes :data:`Arguments`. engine: holds the code. pace: s that a thread
            takes for a step of one block.
    """

    call: Callable[[ctypes.Array[ctypes.c_int64]], None]
    engine: Any
    pace: float


Job = Callable[[], object]


class Workers:
    """Threads that take jobs from a queue, started as they are needed; they end with
    the last reference.

    An exception that a signal's handler raises within ``Thread.start`` or
    ``concurrent.futures``, which are Python, may leave a lock taken for ever; here the
    caller takes none but within functions of C, which no handler cuts in two.

    Attributes:
        count: number of threads.
    """

    def __init__(self) -> None:
        self._jobs: SimpleQueue[Job] = SimpleQueue()
        # of C, too: what is raised in a finaliser of Python is dropped
        self._end = weakref.ref(self, self._jobs.put)
        self.count = 0

    def start(self, threads: int) -> None:
        """Start worker threads until there are at least ``threads`` of them.

        Raises:
            RuntimeError: the system gives none.
        """
        while self.count < threads:
            try:
                _thread.start_new_thread(_work, (self._jobs, self._end))
            except RuntimeError:  # fewer do it as well
                if not self.count:
                    raise
                return
            self.count += 1

    def put(self, job: Callable[[], None]) -> None:
        """Queue a job for the next free worker thread."""
        self._jobs.put(job)


def _work(jobs: SimpleQueue[Job], end: weakref.ref[Workers]) -> None:
    """Worker thread: run queued jobs until the end marker, which is passed on to the
    next thread.
    """
    while (job := jobs.get()) is not end:
        job()
        del job  # what it holds is not kept while this waits
    jobs.put(end)


class SharedSteps:
    """Parallel stepping of all blocks of SIMD lanes by several threads.

    Args:
        machine: the code. arrays: carry, parameters, rows, log and keys, in machine
            code's layout.
        blocks, lanes, every: numbers of blocks, lanes and steps per log entry. threads:
            largest number of threads.
    """

    def __init__(
        self,
        machine: Machine,
        arrays: Sequence[Array],
        *,
        blocks: int,
        lanes: int,
        every: int = 1,
        threads: int = 1,
    ) -> None:
        self._machine = machine
        self._blocks = blocks
        self._steps = len(arrays[2])
        self._most = threads
        # whoever may still step holds arrays and machine code
        self._arrays = arrays
        self._fixed = (*map(_address, arrays), *(0,) * 5, lanes, every)

    def run(
        self, start: int, workers: Workers | None = None, *, whole: bool = False
    ) -> None:
        """Advance all blocks of SIMD lanes through all rows of the input array, on the
        given worker threads.

        What is raised meanwhile comes through within milliseconds, or, where the arrays
        are to be a ``whole``, once every lane has made its steps.

        Args:
            start: number of the first step.
            workers: threads; None steps in the caller's.
            whole: never leave some lanes a step ahead of others; needs threads.
        """
        pace = self._machine.pace
        group, span = slice_work(self._blocks, self._steps, pace, self._most)
        groups, given_up = deque(range(0, self._blocks, group)), list[bool]()

        def step() -> None:
            arguments = Arguments(*self._fixed)
            arguments[START] = start
            length = span
            with suppress(IndexError):  # no group is left
                while not given_up:
                    first = groups.popleft()
                    arguments[FIRST:BEGIN] = [first, min(first + group, self._blocks)]
                    length = self._step_group(arguments, length, span, given_up)

        # a whole needs another thread, which goes on where this one is interrupted
        shares = int(self._blocks * self._steps * pace / SHARED)
        threads = max(2 if whole else 1, min(self._most, len(groups), shares))
        if workers is None or threads == 1:
            step()
            return
        entered, left = list[bool](), list[bool]()
        failed, bell = list[BaseException](), SimpleQueue[bool]()

        def share() -> None:
            entered.append(True)
            try:
                step()
            except BaseException as error:
                failed.append(error)
                given_up.append(True)
            finally:
                left.append(True)
                bell.put(True)

        def finish() -> None:
            # who enters after the last group was taken, or after it was given up, steps
            # nothing
            while (groups and not given_up) or len(left) < len(entered):
                with suppress(Empty):
                    bell.get(timeout=WAIT)

        try:
            workers.start(threads)
            for _ in range(threads):
                workers.put(share)
            finish()
        except BaseException:
            if not (whole and workers.count):
                given_up.append(True)
            while True:  # however often this is interrupted, too
                with suppress(BaseException):
                    workers.put(share)
                    finish()
                    break
            raise
        if failed:
            raise failed[0]

    def _step_group(
        self,
        arguments: ctypes.Array[ctypes.c_int64],
        length: int,
        span: int,
        given_up: Sequence[bool],
    ) -> int:
        """Advance some blocks through all rows, in slices as long as the last ones'
        times allow.

        The ``span`` of a guessed pace counts what code skips where nothing is near.

        Args:
            arguments: of the machine code.
            length: steps of the first slice.
            span: steps of a slice after one that took too long.
            given_up: not empty once it has to end early.

        Returns:
            Steps of the next slice.
        """
        end = 0
        while end < self._steps and not given_up:
            begin = end
            end = min(begin + length, self._steps)
            arguments[BEGIN:START] = [begin, end]
            begun = perf_counter()
            self._machine.call(arguments)
            taken = perf_counter() - begun
            # doubled, such a slice takes half of SLICE at most
            if taken < SLICE / 4.0:
                length *= 2
            elif taken > SLICE:
                length = span
        return length


def slice_work(blocks: int, steps: int, pace: float, threads: int) -> tuple[int, int]:
    """Number of blocks and steps per call of machine code, so that a call takes a few
    milliseconds.
    """
    # one block's steps are cut evenly; blocks of few steps are taken together
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
