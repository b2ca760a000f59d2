"""Parallel simulation of many SIMD lanes: work is cut into slices of milliseconds for several threads.

Python handles signals between slices, and machine code lets other threads run.
"""

from __future__ import annotations

import ctypes
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future, wait
from contextlib import suppress
from typing import Any

from skyarm.records.arrays import AnyArray as Array
from skyarm.records.immutable import immutable

SLICE = 0.003
"""s that a thread steps at a time. Each slice computes anew what depends on parameters alone: 13 us of a quadrotor with
a two-joint arm."""

GUESS = 2e-10
"""s of an operation on a vector."""

SHARED = 5e-5
"""s of work that are worth another thread, which takes some 20 us to wake."""

SHARES = 4
"""Groups of blocks for each thread, at least: some take longer than others."""

WAIT = 0.3
"""s after which a caller that waits looks for signals, where a wait is not ended by them."""

Arguments = ctypes.c_int64 * 12
"""Of the machine code: five arrays, first and last block, begin, end, start, lanes, log every."""

FIRST, LAST, BEGIN, END, START = range(5, 10)


@immutable(kw_only=False)
class Machine:
    """Machine code of a traced loop with its computing time per step.

    Attributes:
        call: takes :data:`Arguments`. engine: holds the code. pace: s that a thread takes for a step of one block.
    """

    call: Callable[[Any], None]
    engine: Any
    pace: float


class SharedSteps:
    """Parallel stepping of all blocks of SIMD lanes by several threads.

    Args:
        machine: the code. arrays: carry, parameters, rows, log and keys, in machine code's layout.
        blocks, lanes, every: as machine code takes them. threads: most that work at a time.
    """

    def __init__(
        self, machine: Machine, arrays: Sequence[Array], *, blocks: int, lanes: int, every: int = 1, threads: int = 1
    ) -> None:
        self._machine, self._blocks, self._steps, self._most = machine, blocks, len(arrays[2]), threads
        # whoever may still step holds arrays and machine code
        self._arrays, self._fixed = arrays, (*map(_address, arrays), 0, 0, 0, 0, 0, lanes, every)

    def run(self, start: int, pool: Executor | None = None, *, whole: bool = False) -> None:
        """Step all blocks of lanes through all input rows, on the threads of a pool.

        What is raised meanwhile comes through within milliseconds, or, where the arrays are to be a ``whole``, once
        every lane has made its steps.

        Args:
            start: of the steps.
            pool: threads; None steps in the caller's.
            whole: never leave some lanes a step ahead of others; needs threads.
        """
        machine = self._machine
        group, span = slice_work(self._blocks, self._steps, machine.pace, self._most)
        groups, given_up = deque(range(0, self._blocks, group)), list[bool]()

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

        shares = int(self._blocks * self._steps * machine.pace / SHARED)
        threads = max(2 if whole else 1, min(self._most, len(groups), shares))
        if pool is None or threads == 1:
            step()
            return
        flying: list[Future[None]] = []
        try:
            flying += [pool.submit(step) for _ in range(threads)]
            while wait(flying, WAIT).not_done:
                pass
        except BaseException:
            if not whole:
                given_up.append(True)
            wait(flying)
            raise


def slice_work(blocks: int, steps: int, pace: float, threads: int) -> tuple[int, int]:
    """Number of blocks and steps per call of machine code, so that a call takes a few milliseconds."""
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
