"""Machine code of traced programs: compiled by LLVM for this processor, cached on disk,
run on threads.

Needs llvmlite, a core dependency. No C compiler is involved. What is kept:
:mod:`skyarm.compile.llvm.object_cache`.
"""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from skyarm.compile.llvm import object_cache
from skyarm.compile.llvm.llvm_loop import CALL, assembly, split_by_row
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.llvm.shared_steps import GUESS, Machine, SharedSteps, Workers
from skyarm.compile.machine_code import llvm_needed, require_floor
from skyarm.compile.tracing.lower import operations
from skyarm.compile.tracing.program import Loop, trace_loop
from skyarm.compile.tracing.tracer import pause_collection
from skyarm.records.arrays import AnyArray as Array
from skyarm.records.immutable import positional

if TYPE_CHECKING:
    import llvmlite.binding as llvm

EFFORT = "SKYARM_EFFORT"
"""Name of the environment variable that limits LLVM's optimisation level; 0 suits many
short-lived programs."""

LARGE = 100_000
"""Number of written operations above which a program is compiled without optimisation,
which needs minutes without handling signals. A law with a nominal delay of half a
second has 300 000."""

PAYS = 150_000
"""Number of times that each written operation is executed, on average, from which full
optimisation pays: it takes 0.2 ms of compilation for an operation, and saves 1.3 ns
each time."""

SHARES = 3_000
"""Number of steps, for each equal vehicle beyond three, up to which these share the
code of a whole period. It saves 10 ms of compilation for a vehicle or more, and takes
up to 0.35 us longer in a step, as numbers go through memory: it pays up to 30 000
steps, and a flight may be repeated: the first repetition has code without it made
behind itself."""

FULL, ANEW = 2, 600.0
"""Full effort of the compiler; time (s) after which a compilation behind a command that
kept nothing is repeated."""

SIGNATURE = ctypes.CFUNCTYPE(None, ctypes.c_void_p)
# keeps the interpreter's lock: giving it up and taking it again costs more than a step
QUICK = ctypes.PYFUNCTYPE(None, ctypes.c_void_p)


def _machine(effort: int = 2) -> llvm.TargetMachine:
    """Make an LLVM target machine for this processor."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=_features(), opt=min(effort, 1), jit=True
    )


@cache
@llvm_needed()
def _features() -> str:
    import llvmlite
    import llvmlite.binding as llvm

    require_floor(llvmlite.__version__)
    features = llvm.get_host_cpu_features().flatten()
    # without this LLVM cuts 512-bit vectors in two on processors that once slowed down
    # for them
    return f"{features},-prefer-256-bit" if "+avx512f" in features else str(features)


def host_width(*, single: bool = False) -> int:
    """Number of SIMD lanes that fit a vector register of this processor."""
    features = _features()
    bits = 512 if "+avx512f" in features else 256 if "+avx" in features else 128
    return bits // (32 if single else 64)


@positional
class Assembly:
    """Program in LLVM's language, from which machine code is made.

    Attributes:
        text: assembly. written: number of its operations. size: number that a step
            executes. effort: of the compiler.
    """

    text: str
    written: int
    size: int
    effort: int

    @staticmethod
    @pause_collection()
    def of(
        loop: Loop, lanes: Lanes, *, logging: bool = False, effort: int = 2
    ) -> Assembly:
        """Write a program in LLVM's language; the arguments are those of
        :class:`Kernel`.
        """
        written = operations(loop.program.nodes, written=True)
        size = operations(loop.program.nodes)
        effort = effort if written <= LARGE else 0
        return Assembly(assembly(loop, lanes, logging=logging), written, size, effort)

    def pays(self, steps: int, times: int = 1) -> bool:
        """True if full optimisation saves more time than it takes in ``steps`` steps,
        made ``times`` times.
        """
        return self.written <= LARGE and times * steps * self.size > PAYS * self.written


class Kernel:
    """Machine code of a traced loop that advances many simulations (SIMD lanes) at
    once.

    Args:
        loop: the program. lanes: vector shape; the processor's own if left out.
        logging: compile in the writing of the log.
        effort: 1 and above, or 0 for code that is made four times as fast and runs a
            third as fast; the same numbers. 0 for programs of more than ``LARGE``
            operations.
        ahead: compute what depends on a row of inputs alone once for all lanes, but at
            effort 0.
        written: the program in LLVM's language, if it is written already.
    """

    def __init__(
        self,
        loop: Loop,
        lanes: Lanes | None = None,
        *,
        logging: bool = False,
        effort: int = 2,
        ahead: bool = False,
        written: Assembly | None = None,
    ) -> None:
        self._ahead: Kernel | None = None
        if ahead and effort:
            first, loop = split_by_row(loop)
            self._ahead = Kernel(first, lanes, logging=True, effort=effort)
        self.loop = loop
        self.lanes = lanes or Lanes(host_width())
        self.logging = logging
        text = written or Assembly.of(loop, self.lanes, logging=logging, effort=effort)
        self.engine = _make_engine(text.text, text.effort)
        address = self.engine.get_function_address(CALL)
        self.quick = QUICK(address)
        self.machine = Machine(
            SIGNATURE(address), self.engine, GUESS * max(1, text.size)
        )

    @property
    def dtype(self) -> Any:
        """NumPy floating-point type of the arrays that the machine code reads and
        writes.
        """
        return np.float32 if self.lanes.single else np.float64

    def run(
        self,
        carry: Array,
        parameters: Array,
        rows: Array,
        *,
        seed: int = 0,
        episodes: Array | None = None,
        start: int = 0,
        threads: int = 1,
        every: int = 1,
    ) -> tuple[Array, Array]:
        """Advance all simulations (SIMD lanes) through all rows of the input array;
        returns final states and log.

        What is raised meanwhile, as Ctrl-C raises it, comes through within a fraction
        of a second; the arrays given are only read.

        Args:
            carry: (carry, lanes).
            parameters: (parameters, lanes).
            rows: (steps, row), shared by all lanes.
            seed: key of the random numbers.
            episodes: (lanes,), the second key; lane k is episode k if left out.
            start: number of the first step, for the random numbers.
            threads: largest number of threads; lanes are shared out in blocks, results
                do not depend on it.
            every: log each so many steps.

        Returns:
            carry after the last row, and the log (entries, logged, lanes), empty
            without logging.
        """
        lanes, width = carry.shape[1], self.lanes.width
        padded = -(-lanes // width) * width
        c = self._pad("carry", carry, (self.loop.carry, lanes), padded)
        p = self._pad("parameters", parameters, (self.loop.parameters, lanes), padded)
        # each row is a lane of the program ahead, whose log is what follows the row
        if self._ahead is not None:
            rows = np.hstack(
                [rows, self._ahead.run(rows.T, rows.T[:0], rows[:1, :0])[1][0].T]
            )
        # beyond the range of 32 bits a number becomes inf, which the flight then shows
        with np.errstate(over="ignore"):
            r = np.ascontiguousarray(rows, dtype=self.dtype)
        if r.ndim != 2 or r.shape[1] != self.loop.row:
            raise ValueError(f"rows: shape {r.shape}, allowed (steps, {self.loop.row})")
        if every < 1:
            raise ValueError(f"every = {every}: must be at least 1")
        keys = _keys(
            seed,
            np.arange(lanes) if episodes is None else np.asarray(episodes),
            lanes,
            padded,
        )
        entries = -(-r.shape[0] // every) if self.logging else 0
        log = np.zeros((entries, self.loop.logged, padded), dtype=self.dtype)
        arrays = (c, p, r, log, keys)
        blocks = padded // width
        steps = SharedSteps(
            self.machine,
            arrays,
            blocks=blocks,
            lanes=padded,
            every=every,
            threads=threads,
        )
        steps.run(start, Workers() if threads > 1 else None)
        return c[:, :lanes], log[:, :, :lanes]

    def _pad(
        self, name: str, values: Array, shape: tuple[int, int], lanes: int
    ) -> Array:
        """Contiguous copy of an array with its last column repeated to fill the last
        SIMD vector.
        """
        if values.shape != shape:
            raise ValueError(f"{name}: shape {values.shape}, allowed {shape}")
        result = np.empty((shape[0], lanes), dtype=self.dtype)
        # what 32 bits do not hold is infinite there, a limit that nothing reaches as
        # much as a state that diverges
        with np.errstate(over="ignore"):
            result[:, : shape[1]] = values
        result[:, shape[1] :] = result[:, shape[1] - 1 : shape[1]]
        return result


def _keys(seed: int, episodes: Array, lanes: int, padded: int) -> Array:
    """Keys of the random number generator for machine code: [seed, episode of each
    lane].
    """
    if episodes.shape != (lanes,):
        raise ValueError(f"episodes: shape {episodes.shape}, allowed ({lanes},)")
    if lanes and (
        episodes.dtype.kind not in "iu" or episodes.min() < 0 or episodes.max() >= 2**32
    ):
        raise ValueError("episodes: must be whole numbers from 0 to 2**32 - 1")
    # lanes that only fill up the last vector draw as episode 0 and are cut off
    keys = np.zeros(1 + padded, dtype=np.uint64)
    keys[0] = seed
    keys[1 : 1 + lanes] = episodes
    return keys


def _make_engine(text: str, effort: int) -> llvm.ExecutionEngine:
    """Make an LLVM engine from an assembly text, with its object code from the cache if
    possible.
    """
    effort = _allowed_effort(effort)
    # the cache has errors of its own, which say nothing of LLVM
    # fully optimised code, if there is some, serves any effort
    content = object_cache.load(_identity(text, _allowed_effort(FULL)))
    if content is None and effort < FULL:
        content = object_cache.load(_identity(text, effort))
    if content is None:
        content = build(text, effort)
        object_cache.store(_identity(text, effort), content)
    return _load_engine(content)


_behind = list["subprocess.Popen[bytes]"]()
"""Processes that were started and not waited for, which Python would complain of."""


def compile_behind(text: str) -> None:
    """Start a process that compiles a program at full effort for the cache, unless it
    is there.
    """
    if object_cache.load(_identity(text, FULL)) is None:
        work_behind(f"from {__name__} import keep; keep()", text)


def work_behind(command: str, text: str) -> None:
    """Start a process of lowest priority that fills the cache; within ten minutes it is
    not started anew.

    Args:
        command: its work in Python.
        text: its standard input.
    """
    name = f"begun\n{command}\n{text}"
    begun = object_cache.load(name)
    if _allowed_effort(FULL) < FULL or (
        begun is not None and time.time() < float(begun) + ANEW
    ):
        return
    object_cache.store(name, str(time.time()).encode())
    # the command has done its work: where no process can be started, nothing is lost
    with suppress(OSError), tempfile.TemporaryFile() as file:
        file.write(text.encode())
        file.seek(0)
        arguments = [
            sys.executable,
            # -P: no module of the current folder stands in for one of ours
            "-P",
            "-c",
            f"import os; getattr(os, 'nice', int)(19); {command}",
        ]
        quiet = subprocess.DEVNULL
        _behind.append(
            subprocess.Popen(
                arguments,
                # nothing waits until the process has read a file, as for a pipe
                stdin=file,
                stdout=quiet,
                stderr=quiet,
                # Ctrl-C ends the command in front alone
                start_new_session=True,
            )
        )


def keep() -> None:
    """Compile the assembly on standard input at full effort into the cache."""
    text = sys.stdin.read()
    object_cache.store(_identity(text, FULL), build(text, FULL))


def _allowed_effort(effort: int) -> int:
    return min(effort, int(os.environ.get(EFFORT) or effort))


def _identity(text: str, effort: int) -> str:
    """Text that identifies object code in the cache: assembly, versions, processor,
    optimisation level.
    """
    return f"{text}\n{processor()}\n{effort}"


@llvm_needed()
def processor() -> str:
    """Text that identifies this processor and the version of LLVM."""
    import llvmlite
    import llvmlite.binding as llvm

    triple, cpu = llvm.get_default_triple(), llvm.get_host_cpu_name()
    return "\n".join((llvmlite.__version__, triple, cpu, _features()))


@llvm_needed()
def _load_engine(content: bytes) -> llvm.ExecutionEngine:
    """Make an LLVM engine from compiled object code."""
    import llvmlite.binding as llvm

    # an engine is made of a module: an empty one, as the code comes as an object
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _machine())
    engine.add_object_file(llvm.ObjectFileRef.from_data(content))
    engine.finalize_object()
    return engine


@llvm_needed()
def build(text: str, effort: int = 2) -> bytes:
    """Compile an assembly text into object code for this processor.

    LLVM's passes over its own code are left out: the tracer has found common terms and
    constants already, and with them code is as fast and takes twice as long to make.
    """
    import llvmlite.binding as llvm

    machine = _machine(effort)
    module = llvm.parse_assembly(text)
    module.verify()
    content: bytes = machine.emit_object(module)
    return content


def require_machine_code() -> None:
    """Compile a minimal program; raises NoMachineCodeError if machine code is not
    available.

    Raises:
        NoMachineCodeError: with the cause and the remedy.
    """
    Kernel(trace_loop(lambda carry, *_: (carry, ()), 0.0, (), ()), Lanes(1), effort=0)
