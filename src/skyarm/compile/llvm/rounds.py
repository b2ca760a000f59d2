"""One call of a kernel, run in rounds of a fraction of a second by its caller and by helping threads.

Python looks at signals between rounds, when no thread is inside the arrays: an interrupt may be raised at any point
outside of ``step_lead`` and finds all of them idle. Who helps holds the arrays and the machine code for as long as it
might use them.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter, thread_time
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.compile.llvm.llvm_rounds import CLOSED, PLACES, SIZE, WAITING
from skyarm.compile.llvm.thread_pool import ThreadPools

Array = npt.NDArray[Any]

ROUND, FIRST, SLICE = 0.3, 0.02, 0.003
"""s: a round; the first one, whose speed is a guess; what a thread steps at a time, for which others may wait at the
end of a round. Each slice computes anew what depends on parameters alone: 13 us of a quadrotor with a two-joint arm."""

GUESS = 2e-10
"""s of an operation on a vector, before the kernel has been timed."""

TIMED = 0.005
"""s of the processor that a round must take for the kernel's speed to be taken from it."""

SHARED = 5e-5
"""s of work that are worth another thread, which takes some 20 us to wake."""

SHARES = 4
"""Groups of blocks for each thread, at least: some take longer than others."""

Control = ctypes.c_int64 * (SIZE // 8)
START, STATE, NEXT, LEFT = (PLACES[name] // 8 for name in ("start", "state", "next", "left"))


def _pause() -> int:
    """Address of the system's function that lets another thread run."""
    if sys.platform == "win32":
        function: Any = ctypes.windll.kernel32.SwitchToThread
    else:
        function = ctypes.CDLL(None).sched_yield
    return ctypes.cast(function, ctypes.c_void_p).value or 0


PAUSE = _pause()


@dataclass(slots=True)
class Pace:
    """s that one thread takes for a step of one block; a guess until it is measured.

    Attributes:
        clock: by the clock, on processors that others may use as well: how long rounds are. processor: by the
            processor's time: how long slices are, and what is worth another thread.
    """

    clock: float
    processor: float
    measured: bool = False

    def measure(self, clock: float, processor: float, work: int) -> None:
        """Note that one thread would have taken so long, s, for ``work`` steps of blocks."""
        if work > 0:
            # a thread that was held up once must not make the next rounds much shorter
            self.clock = min(max(clock / work, self.clock / 8.0), 8.0 * self.clock)
            self.processor = processor / work
            self.measured = True


class Rounds:
    """Steps of all blocks of lanes.

    Args:
        functions: step_lead and step_help. engine: holds their machine code.
        arrays: carry, parameters, rows, log and keys, in machine code's layout.
        blocks, lanes, start, every: as machine code takes them.
        pace: of the kernel. threads: most that work at a time.
    """

    def __init__(
        self,
        functions: tuple[Any, Any],
        engine: Any,
        arrays: Sequence[Array],
        *,
        blocks: int,
        lanes: int,
        start: int,
        every: int,
        pace: Pace,
        threads: int,
    ) -> None:
        self._lead, self._help = functions
        self._steps, self._pace = len(arrays[2]), pace
        group, span = sliced(blocks, self._steps, pace.processor, threads)
        groups = -(-blocks // group)
        self._reached = np.zeros(groups, dtype=np.int64)
        self._work = group * span
        whole = blocks * self._steps * pace.processor
        self._threads = max(1, min(threads, groups, int(whole / SHARED)))
        control = self._control = Control()
        control[:16] = [
            *(_address(array) for array in arrays),
            *(start, lanes, every, self._steps, blocks, group, groups, span),
            *(_address(self._reached), self._threads - 1, PAUSE),
        ]
        control[STATE] = CLOSED
        # what machine code reads and writes lives as long as whoever may call it
        self._needs = (arrays, engine)

    def begin(self, start: int) -> None:
        """Make the same work ready once more, from another number of its first step on."""
        self._control[START] = start
        self._control[LEFT] = 0
        self._reached[:] = 0

    def run(self, pools: ThreadPools) -> None:
        """Run all rounds. Whatever is raised leaves no thread at work."""
        if self._threads == 1:
            self.finish()
            return
        pool = pools.take()
        try:
            while not self._over():
                pool.call(self.help, self._threads - 1)
                self._round()
        finally:
            pools.give(pool)

    def finish(self) -> None:
        """Run what is left of the rounds alone."""
        # of a round that never was, slices are left too
        self._control[LEFT] = 0
        while not self._over():
            self._round()

    def help(self) -> None:
        """Work in the round that is on or about to begin."""
        self._help(self._control)

    def _over(self) -> bool:
        """Whether all groups are through; if not, the control is made ready for another round."""
        control = self._control
        if control[LEFT] > 0:
            # more slices were allowed than there were
            return True
        waiting = np.flatnonzero(self._reached < self._steps)
        if not waiting.size:
            return True
        length = ROUND if self._pace.measured else FIRST
        slices = length / (self._pace.clock * self._work) * self._threads
        control[NEXT] = int(waiting[0])
        control[LEFT] = max(self._threads, int(min(slices, 2.0**40)))
        control[STATE] = WAITING
        return False

    def _round(self) -> None:
        control = self._control
        allowed, used, begun = control[LEFT], thread_time(), perf_counter()
        self._lead(control)
        clock, processor = perf_counter() - begun, thread_time() - used
        if processor > TIMED:
            spent = allowed - max(0, control[LEFT])
            self._pace.measure(clock * self._threads, processor * self._threads, spent * self._work)


def sliced(blocks: int, steps: int, pace: float, threads: int) -> tuple[int, int]:
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
