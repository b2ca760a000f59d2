"""Many lanes, one step a call, in place: for loops in Python that look at every step."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.shared_steps import SharedSteps

Array = npt.NDArray[Any]

ALONE = 8192
"""Lanes up to which one thread is done before another would have woken."""


class LaneStepper:
    """Steps all lanes of arrays that stay where they are.

    Its threads are those of the kernel's pool: made at the first step that shares its lanes, kept from step to step,
    made anew after a fork. :meth:`close` ends them, as does the end of the kernel.

    Args:
        kernel: of one row a step; what it logs of it is written anew by each. lanes: how many.
        seed: key of the random numbers; of a loop with own seeds, until :meth:`begin` gives others. threads: most that
            work.

    Attributes:
        carry, parameters: (leaves, lanes) views that a step reads and writes in place. row: shared by all lanes.
        logged: (logged, lanes) view on what the last step logged; without logging it has no rows.
    """

    def __init__(self, kernel: Kernel, lanes: int, *, seed: int = 0, threads: int = 1) -> None:
        width = kernel.lanes.width
        blocks = -(-lanes // width)
        stride = apart(blocks) * width
        loop, dtype = kernel.loop, kernel.dtype
        self._kernel = kernel
        self._carry = np.zeros((loop.carry, stride), dtype)
        self._parameters = np.zeros((loop.parameters, stride), dtype)
        self._row = np.zeros((1, loop.row), dtype)
        self._log = np.zeros((1, loop.logged if kernel.logging else 0, stride), dtype)
        self.logged: Array = self._log[0, :, :lanes]
        # [seed, episode of every lane], and the seed of every lane where they have their own
        self._keys = np.zeros(1 + stride * (2 if loop.own_seeds else 1), dtype=np.uint64)
        self._keys[0], self._keys[1 + stride :] = seed, seed
        self._seeds = self._keys[1 + stride :]
        self._tick = 0
        self.carry, self.parameters, self.row = self._carry[:, :lanes], self._parameters[:, :lanes], self._row[0]
        arrays = (self._carry, self._parameters, self._row, self._log, self._keys)
        # first block, last block, begin, end, start, lanes, log every
        pointers = [array.ctypes.data for array in arrays]
        self._arguments = np.array([*pointers, 0, blocks, 0, 1, 0, stride, 1], dtype=np.int64)
        self._pointer = ctypes.c_void_p(self._arguments.ctypes.data)
        self._quick = kernel.quick
        self._arrays, self._blocks = arrays, blocks
        self._shared: SharedSteps | None = None
        if threads > 1 and lanes > ALONE:
            self._shared = SharedSteps(kernel.machine, arrays, blocks=blocks, lanes=stride, threads=threads)

    def fill(self) -> None:
        """Lanes beyond the last, which vectors need, become like the last; to be called once numbers are set."""
        lanes, last = self.carry.shape[1], self._blocks * self._kernel.lanes.width
        if lanes == last:
            return
        for array in (self._carry, self._parameters):
            array[:, lanes:last] = array[:, lanes - 1 : lanes]

    def seed(self, seed: int) -> None:
        """Another key of the random numbers."""
        self._keys[0] = seed

    def begin(self, where: Array, episodes: Array, seeds: Array | None = None, first: int = 0) -> None:
        """Begin episodes: the random numbers of these lanes are keyed by them, and by steps counted from here.

        Args:
            where: (m,) numbers of the lanes.
            episodes: (m,) whole numbers of 32 bits.
            seeds: (m,) of these lanes, in a loop with own seeds.
            first: number of the next step.
        """
        ahead = (first - self._tick) % 2**32
        self._keys[1 + where] = episodes.astype(np.uint64) | np.uint64(ahead << 32)
        if seeds is not None:
            self._seeds[where] = seeds

    def step(self) -> None:
        """One step.

        What is raised meanwhile, as Ctrl-C raises it, comes through once every lane has made the step.
        """
        tick, self._tick = self._tick, self._tick + 1
        if self._shared is None:
            self._arguments[9] = tick
            self._quick(self._pointer)
        else:
            self._shared.run(tick, whole=True)

    def close(self) -> None:
        """End the threads; another step makes them again."""
        self._kernel.pools.close()


def apart(blocks: int) -> int:
    """Vectors from one number of a lane to its next in memory: at least ``blocks``, and no multiple of four.

    Numbers a multiple of 4 KiB apart share one set of the first cache, which holds eight to twelve of them: 1024 lanes
    of 32 bits took 40 us a step so, and take 28.
    """
    return blocks if blocks % 4 else blocks + 1
