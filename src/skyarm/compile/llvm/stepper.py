"""One lane, one step a call, in place: control loops in real time."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.compile.llvm.kernel import Kernel

Array = npt.NDArray[Any]


class Stepper:
    """One lane, one step a call, for a control loop in real time: about a microsecond, no memory is taken.

    Args:
        kernel: of width 1, with logging if outputs are wanted.
        carry: first carry. parameters: constants. seed, episode: keys of the random numbers.

    Attributes:
        carry, parameters, row, output: arrays that a step reads and writes in place.
        clock: one number: which step comes next, for the random numbers; it stays unless it is written.
        step: the function without arguments that makes one.
    """

    def __init__(
        self, kernel: Kernel, carry: Array, parameters: Array | None = None, *, seed: int = 0, episode: int = 0
    ) -> None:
        if kernel.lanes.width != 1:
            raise ValueError(f"lanes.width = {kernel.lanes.width}: must be 1")
        loop, dtype = kernel.loop, kernel.dtype
        self.carry = np.array(carry, dtype=dtype)
        self.parameters = np.array(() if parameters is None else parameters, dtype=dtype)
        for name, values, count in (
            ("carry", self.carry, loop.carry),
            ("parameters", self.parameters, loop.parameters),
        ):
            if values.shape != (count,):
                raise ValueError(f"{name}: shape {values.shape}, allowed ({count},)")
        self.row, self.output = np.zeros(loop.row, dtype), np.zeros(loop.logged, dtype)
        self._keys = np.array([seed, episode], dtype=np.uint64)
        pointers = [a.ctypes.data for a in (self.carry, self.parameters, self.row, self.output, self._keys)]
        # first block, last block, begin, end, start, lanes, log every
        self._arguments = np.array([*pointers, 0, 1, 0, 1, 0, 1, 1], dtype=np.int64)
        self.clock = self._arguments[9:10]
        step = partial(kernel.quick, ctypes.c_void_p(self._arguments.ctypes.data))
        self._held = self._arguments.data  # written faster than the array
        self._tables: tuple[Array, ...] = ()
        # who keeps the function alone keeps its arrays and its machine code, too
        step.__dict__["needs"] = (self, kernel)
        self.step: Callable[[], None] = step

    def read_tables(self, rows: Array, log: Array) -> None:
        """Read rows from a table, and log into another, both (steps, numbers), in place of one row and output."""
        if any(table.dtype != self.carry.dtype or not table.flags.c_contiguous for table in (rows, log)):
            raise ValueError("tables: must be contiguous and of the kernel's numbers")
        self._tables = rows, log
        self._arguments[2:4] = rows.ctypes.data, log.ctypes.data

    def fly(self, begin: int, end: int, start: int = 0) -> None:
        """Step through some rows of the table; ``start``: number of the step of its first, for the random numbers."""
        held = self._held
        held[7], held[8], held[9] = begin, end, start
        self.step()
