"""Machine code: assembly compiled by LLVM for this processor, kept in a cache of object files, run on threads.

Needs llvmlite, a core dependency. No C compiler is involved. The cache folder is ``SKYARM_CACHE`` if set, else the
user's cache folder; an entry that is damaged or of another processor is simply built again.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache, partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.compile.llvm_loop import CALL, NAME, assembly
from skyarm.compile.llvm_text import Lanes
from skyarm.compile.loop import Loop
from skyarm.files import write_atomically

Array = npt.NDArray[Any]

SIGNATURE = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 5, *[ctypes.c_int64] * 6)
# keeps the interpreter's lock: giving it up and taking it again costs more than a step
QUICK = ctypes.PYFUNCTYPE(None, ctypes.c_void_p)


NO_MACHINE_CODE = (ImportError, OSError, RuntimeError)
"""What making a kernel raises where there is no llvmlite, or a processor that its LLVM does not know."""


def _machine(effort: int = 2) -> Any:
    """A target machine of this processor; an engine takes the one it is made with for itself."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=_features(), opt=effort, jit=True
    )


@lru_cache(maxsize=1)
def _features() -> str:
    import llvmlite.binding as llvm

    features = llvm.get_host_cpu_features().flatten()
    # without this LLVM cuts 512-bit vectors in two on processors that once slowed down for them
    return f"{features},-prefer-256-bit" if "+avx512f" in features else str(features)


def host_width(*, single: bool = False) -> int:
    """Lanes of a vector register of this processor."""
    features = _features()
    bits = 512 if "+avx512f" in features else 256 if "+avx" in features else 128
    return bits // (32 if single else 64)


def cache_folder() -> Path | None:
    """Where object files are kept; None for a user without a home."""
    named = os.environ.get("SKYARM_CACHE")
    if named:
        return Path(named)
    home = os.environ.get("LOCALAPPDATA") if sys.platform == "win32" else os.environ.get("XDG_CACHE_HOME")
    try:
        return Path(home) / "skyarm" if home else Path.home() / ".cache" / "skyarm"
    except RuntimeError:
        return None


class Kernel:
    """A stepped program as machine code.

    Args:
        loop: the program. lanes: vector shape; the processor's own if left out.
        logging: compile in the writing of the log.
        effort: 2, or 0 for code that is made five times as fast and runs a third as fast; its numbers are the same.
    """

    def __init__(self, loop: Loop, lanes: Lanes | None = None, *, logging: bool = False, effort: int = 2) -> None:
        self.loop = loop
        self.lanes = lanes or Lanes(host_width())
        self.logging = logging
        self._engine = _compiled(assembly(loop, self.lanes, logging=logging), effort)
        self._call = SIGNATURE(self._engine.get_function_address(NAME))
        self.quick = QUICK(self._engine.get_function_address(CALL))

    @property
    def dtype(self) -> Any:
        """NumPy type of all numbers."""
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
        """Step all lanes through all rows.

        Args:
            carry: (carry, lanes).
            parameters: (parameters, lanes).
            rows: (steps, row), shared by all lanes.
            seed: key of the random numbers.
            episodes: (lanes,), the second key; lane k is episode k if left out.
            start: number of the first step, for the random numbers.
            threads: lanes are shared out in blocks; results do not depend on it.
            every: log each so many steps.

        Returns:
            carry after the last row, and the log (entries, logged, lanes), empty without logging.
        """
        lanes, width = carry.shape[1], self.lanes.width
        padded = -(-lanes // width) * width
        c = self._padded("carry", carry, (self.loop.carry, lanes), padded)
        p = self._padded("parameters", parameters, (self.loop.parameters, lanes), padded)
        r = np.ascontiguousarray(rows, dtype=self.dtype)
        if r.ndim != 2 or r.shape[1] != self.loop.row:
            raise ValueError(f"rows: shape {r.shape}, allowed (steps, {self.loop.row})")
        if every < 1:
            raise ValueError(f"every = {every}: must be at least 1")
        keys = _keys(seed, np.arange(lanes) if episodes is None else np.asarray(episodes), lanes, padded)
        entries = -(-r.shape[0] // every) if self.logging else 0
        log = np.zeros((entries, self.loop.logged, padded), dtype=self.dtype)
        pointers = [a.ctypes.data for a in (c, p, r, log, keys)]
        blocks = padded // width
        shares = np.linspace(0, blocks, min(threads, blocks) * 4 + 1 if threads > 1 else 2).astype(int)
        jobs = [(int(a), int(b)) for a, b in pairwise(shares) if b > a]

        def work(job: tuple[int, int]) -> None:
            self._call(*pointers, *job, r.shape[0], start, padded, every)

        if threads > 1:
            with ThreadPoolExecutor(threads) as pool:
                list(pool.map(work, jobs))
        else:
            for job in jobs:
                work(job)
        return c[:, :lanes], log[:, :, :lanes]

    def _padded(self, name: str, values: Array, shape: tuple[int, int], lanes: int) -> Array:
        """A contiguous copy with the last lane repeated up to whole vectors."""
        if values.shape != shape:
            raise ValueError(f"{name}: shape {values.shape}, allowed {shape}")
        result = np.empty((shape[0], lanes), dtype=self.dtype)
        result[:, : shape[1]] = values
        result[:, shape[1] :] = result[:, shape[1] - 1 : shape[1]]
        return result


class Stepper:
    """One lane, one step a call, for a control loop in real time: about a microsecond, no memory is taken.

    Args:
        kernel: of width 1, with logging if outputs are wanted.
        carry: first carry. parameters: constants.

    Attributes:
        carry, parameters, row, output: arrays that a step reads and writes in place.
        step: the function without arguments that makes one. Random numbers are those of step 0 of seed and episode 0.
    """

    def __init__(self, kernel: Kernel, carry: Array, parameters: Array | None = None) -> None:
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
        self._keys = np.zeros(2, dtype=np.uint64)
        pointers = [a.ctypes.data for a in (self.carry, self.parameters, self.row, self.output, self._keys)]
        # first block, last block, steps, first step, lanes, log every
        self._arguments = np.array([*pointers, 0, 1, 1, 0, 1, 1], dtype=np.int64)
        step = partial(kernel.quick, ctypes.c_void_p(self._arguments.ctypes.data))
        # who keeps the function alone keeps its arrays and its machine code, too
        step.__dict__["needs"] = (self, kernel)
        self.step: Callable[[], None] = step


def _keys(seed: int, episodes: Array, lanes: int, padded: int) -> Array:
    """[seed, episode of every lane] as the generator takes them."""
    if episodes.shape != (lanes,):
        raise ValueError(f"episodes: shape {episodes.shape}, allowed ({lanes},)")
    if lanes and (episodes.dtype.kind not in "iu" or episodes.min() < 0 or episodes.max() >= 2**32):
        raise ValueError("episodes: must be whole numbers from 0 to 2**32 - 1")
    keys = np.zeros(1 + padded, dtype=np.uint64)
    keys[0] = seed
    keys[1 : 1 + lanes] = episodes
    return keys


def _compiled(text: str, effort: int) -> Any:
    """Engine that holds the module's code, from the cache if it is there."""
    import llvmlite
    import llvmlite.binding as llvm

    triple, cpu = llvm.get_default_triple(), llvm.get_host_cpu_name()
    identity = "\n".join((text, llvmlite.__version__, triple, cpu, _features(), str(effort)))
    folder = cache_folder()
    path = folder / f"{hashlib.sha256(identity.encode()).hexdigest()}.o" if folder else None
    content = _cached(path) if path else None
    if content is None:
        content = build(text, effort)
        if path:
            _keep(path, content)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _machine())
    engine.add_object_file(llvm.ObjectFileRef.from_data(content))
    engine.finalize_object()
    return engine


def build(text: str, effort: int = 2) -> bytes:
    """Object code of a module for this processor."""
    import llvmlite.binding as llvm

    machine = _machine(effort)
    module = llvm.parse_assembly(text)
    module.verify()
    if effort:
        builder = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=effort))
        builder.getModulePassManager().run(module, builder)
    content: bytes = machine.emit_object(module)
    return content


def _cached(path: Path) -> bytes | None:
    """Object code of an entry whose checksum holds."""
    try:
        stored = path.read_bytes()
    except OSError:
        return None
    digest, content = stored[:32], stored[32:]
    return content if hashlib.sha256(content).digest() == digest else None


def _keep(path: Path, content: bytes) -> None:
    """Store an entry; a cache that cannot be written is no error."""
    try:
        write_atomically(path, hashlib.sha256(content).digest() + content)
    except OSError:
        return
