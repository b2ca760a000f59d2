"""Machine code called step by step: for one simulation in real time, many side by side,
or a single function.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.llvm.shared_steps import (
    START,
    SharedSteps,
    Workers,
    arguments_of,
)
from skyarm.compile.machine_code import NoMachineCodeError
from skyarm.compile.tracing.program import Loop, trace_call
from skyarm.records.arrays import AnyArray as Array
from skyarm.records.leaves import Tree, rebuild

ALONE = 8192
"""Number of SIMD lanes up to which one thread alone is faster than several."""


class LaneStepper:
    """Machine code that advances many simulations (SIMD lanes) by one step per call, in
    fixed arrays.

    Its threads are made at the first step that shares its lanes, kept from step to
    step, and made anew after a fork. :meth:`close` ends them.

    Args:
        kernel: machine code of one row a step; each step writes its log anew. lanes:
            number of lanes.
        seed: key of the random numbers; of a loop with own seeds, until :meth:`begin`
            gives others. threads: largest number of threads.

    Attributes:
        carry, parameters: (leaves, lanes) views that a step reads and writes in place.
            row: shared by all lanes.
        logged: (logged, lanes) view on what the last step logged; without logging it
            has no rows.
    """

    def __init__(
        self, kernel: Kernel, lanes: int, *, seed: int = 0, threads: int = 1
    ) -> None:
        width = kernel.lanes.width
        blocks = -(-lanes // width)
        stride = apart(blocks) * width
        loop = kernel.loop
        dtype = kernel.dtype
        self._kernel = kernel
        self._carry = np.zeros((loop.carry, stride), dtype)
        self._parameters = np.zeros((loop.parameters, stride), dtype)
        self._row = np.zeros((1, loop.row), dtype)
        self._log = np.zeros((1, loop.logged if kernel.logging else 0, stride), dtype)
        self.logged: Array = self._log[0, :, :lanes]
        # [seed, episode of every lane], and the seed of every lane where they have
        # their own
        self._keys = np.zeros(
            1 + stride * (2 if loop.own_seeds else 1), dtype=np.uint64
        )
        self._keys[0] = seed
        self._keys[1 + stride :] = seed
        self._seeds = self._keys[1 + stride :]
        self._tick = 0
        self.carry = self._carry[:, :lanes]
        self.parameters = self._parameters[:, :lanes]
        self.row = self._row[0]
        arrays = (self._carry, self._parameters, self._row, self._log, self._keys)
        self._arguments = arguments_of(arrays, blocks, stride)
        self._pointer = ctypes.c_void_p(self._arguments.ctypes.data)
        self._quick = kernel.quick
        self._arrays = arrays
        self._blocks = blocks
        self._shared: SharedSteps | None = None
        self._workers = Workers()
        self._threads = threads
        self._process = os.getpid()
        if threads > 1 and lanes > ALONE:
            self._shared = SharedSteps(
                kernel.machine, arrays, blocks=blocks, lanes=stride, threads=threads
            )

    def fill(self) -> None:
        """Copy the last lane into the unused elements of the last SIMD vector; call it
        after writing to the arrays.
        """
        lanes = self.carry.shape[1]
        last = self._blocks * self._kernel.lanes.width
        if lanes == last:
            return
        # a copy takes no more rounds of any loop than the lane that it copies
        for array in (self._carry, self._parameters):
            array[:, lanes:last] = array[:, lanes - 1 : lanes]

    def seed(self, seed: int) -> None:
        """Replace the seed of the random numbers."""
        self._keys[0] = seed

    def begin(
        self, where: Array, episodes: Array, seeds: Array | None = None, first: int = 0
    ) -> None:
        """Begin new episodes in some SIMD lanes: their random numbers restart with new
        keys.

        Args:
            where: (m,) numbers of the lanes.
            episodes: (m,) whole numbers of 32 bits.
            seeds: (m,) of these lanes, in a loop with own seeds.
            first: number of the next step.
        """
        # what the lane's count of steps is ahead of the common one, modulo 2^32
        ahead = (first - self._tick) % 2**32
        self._keys[1 + where] = episodes.astype(np.uint64) | np.uint64(ahead << 32)
        if seeds is not None:
            self._seeds[where] = seeds

    def step(self) -> None:
        """Advance all SIMD lanes by one step.

        What is raised meanwhile, as Ctrl-C raises it, comes through once every lane has
        made the step.
        """
        tick = self._tick
        self._tick = self._tick + 1
        if self._shared is None:
            self._arguments[START] = tick
            self._quick(self._pointer)
        else:
            if self._process != os.getpid():  # threads stay behind in a fork
                self._workers = Workers()
                self._process = os.getpid()
            self._shared.run(tick, self._workers, whole=True)

    def close(self) -> None:
        """Shut down the worker threads; the next step starts new ones."""
        self._workers = Workers()


def apart(blocks: int) -> int:
    """Memory stride between the arrays' rows, in SIMD vectors: at least ``blocks``, and
    no multiple of four.

    Numbers a multiple of 4 KiB apart share one set of the first cache, which holds
    eight to twelve of them: 1024 lanes of 32 bits took 40 us a step so, and take 28.
    """
    return blocks if blocks % 4 else blocks + 1


class Stepper:
    """Machine code that advances one simulation by one step per call, in about a
    microsecond.

    Args:
        kernel: machine code of width 1, with logging if outputs are needed.
        carry: first carry. parameters: constants. seed, episode: keys of the random
            numbers.

    Attributes:
        carry, parameters, row, output: arrays that a step reads and writes in place.
        clock: one number: index of the next step, for the random numbers; it stays
            unless it is written.
        step: function without arguments that advances by one step.
    """

    def __init__(
        self,
        kernel: Kernel,
        carry: Array,
        parameters: Array | None = None,
        *,
        seed: int = 0,
        episode: int = 0,
    ) -> None:
        if kernel.lanes.width != 1:
            raise ValueError(f"lanes.width = {kernel.lanes.width}: must be 1")
        loop = kernel.loop
        dtype = kernel.dtype
        self.carry = np.array(carry, dtype=dtype)
        self.parameters = np.array(
            () if parameters is None else parameters, dtype=dtype
        )
        for name, values, count in (
            ("carry", self.carry, loop.carry),
            ("parameters", self.parameters, loop.parameters),
        ):
            if values.shape != (count,):
                raise ValueError(f"{name}: shape {values.shape}, allowed ({count},)")
        self.row, self.output = np.zeros(loop.row, dtype), np.zeros(loop.logged, dtype)
        self._keys = np.array([seed, episode], dtype=np.uint64)
        arrays = (self.carry, self.parameters, self.row, self.output, self._keys)
        self._arguments = arguments_of(arrays, 1, 1)
        self.clock = self._arguments[START : START + 1]
        step = partial(kernel.quick, ctypes.c_void_p(self._arguments.ctypes.data))
        self._buffer = self._arguments.data  # written faster than the array
        # who keeps the function alone keeps its arrays and its machine code, too
        step.__dict__["needs"] = [kernel, (*arrays, self._arguments)]
        self.step: Callable[[], None] = step

    def read_tables(self, rows: Array, log: Array) -> None:
        """Set the arrays from which steps read their inputs and to which they write
        logs, one row per step.
        """
        if any(
            table.dtype != self.carry.dtype or not table.flags.c_contiguous
            for table in (rows, log)
        ):
            raise ValueError("tables: must be contiguous and of the kernel's numbers")
        # the machine code has bare addresses: "needs" keeps the arrays alive
        self.step.__dict__["needs"][2:] = rows, log
        self._arguments[2:4] = rows.ctypes.data, log.ctypes.data

    def fly(self, begin: int, end: int, start: int = 0) -> None:
        """Run the steps of rows ``begin`` to ``end`` of the input array; ``start``:
        step number of its first row.
        """
        buffer = self._buffer
        buffer[7], buffer[8], buffer[9] = begin, end, start
        self.step()


class Quick:
    """Compiled function with fixed input and output arrays: write ``inputs``, call
    ``step``, read ``outputs``.

    Both kinds of code give the same numbers to the last bit. Not for two threads at
    once.

    Args:
        function: takes records, returns one.
        examples: records whose leaves become the inputs, in order; their integers stay
            structure.

    Attributes:
        inputs, outputs: leaves of the arguments and of the result. step: function that
            evaluates.
        result: record that the function returns, as an example.
    """

    def __init__(self, function: Callable[..., Tree], *examples: Tree) -> None:
        loop = trace_call(function, *examples)
        self.inputs: Array
        self.outputs: Array
        self.step: Callable[[], None]
        self.result = loop.result[1]
        try:
            # what is called once a step is worth its making: all of LLVM's effort
            stepper = Stepper(Kernel(loop, Lanes(1), logging=True), np.zeros(0))
        except NoMachineCodeError:
            self.inputs = np.zeros(loop.row)
            self.outputs = np.zeros(loop.logged)
            self.step = self._in_python(loop)
        else:
            self.inputs = stepper.row
            self.outputs = stepper.output
            self.step = stepper.step

    def shaped(self) -> Any:
        """Output values as the dataclass that the compiled function returns."""
        return rebuild(self.result, self.outputs.tolist())

    def _in_python(self, loop: Loop) -> Callable[[], None]:
        program = loop.stepper()
        inputs = self.inputs
        outputs = self.outputs

        def step() -> None:
            outputs[:] = program(inputs.tolist())

        return step
