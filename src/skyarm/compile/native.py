"""Machine code: assembly compiled by LLVM for this processor, kept in a cache of object files, run on threads.

Needs llvmlite, a core dependency. No C compiler is involved. The cache folder is ``SKYARM_CACHE`` if set, else the user's
cache folder; an entry that is damaged or of another processor is simply built again.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import sys
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.compile.llvm_loop import NAME, assembly
from skyarm.compile.llvm_text import Lanes
from skyarm.compile.loop import Loop
from skyarm.files import write_atomically

Array = npt.NDArray[Any]

SIGNATURE = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 5, *[ctypes.c_int64] * 6)


def _machine() -> Any:
    """A target machine of this processor; an engine takes the one it is made with for itself."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=_features(), opt=2, jit=True
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


def cache_folder() -> Path:
    """Where object files are kept."""
    named = os.environ.get("SKYARM_CACHE")
    if named:
        return Path(named)
    home = os.environ.get("LOCALAPPDATA") if sys.platform == "win32" else os.environ.get("XDG_CACHE_HOME")
    return Path(home) / "skyarm" if home else Path.home() / ".cache" / "skyarm"


class Kernel:
    """A stepped program as machine code.

    Args:
        loop: the program. lanes: vector shape; the processor's own if left out.
        logging: compile in the writing of the log.
    """

    def __init__(self, loop: Loop, lanes: Lanes | None = None, *, logging: bool = False) -> None:
        self.loop = loop
        self.lanes = lanes or Lanes(host_width())
        self.logging = logging
        self._engine = _compiled(assembly(loop, self.lanes, logging=logging))
        self._call = SIGNATURE(self._engine.get_function_address(NAME))

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
            carry: (carry, lanes). parameters: (parameters, lanes). rows: (steps, row).
            seed, episodes: keys of the random numbers; lane k is episode k if left out.
            start: number of the first step, for the random numbers.
            threads: lanes are shared out in blocks; results do not depend on it.
            every: log each so many steps.

        Returns:
            carry after the last row, and the log (entries, logged, lanes), empty without logging.
        """
        lanes, width = carry.shape[1], self.lanes.width
        padded = -(-lanes // width) * width
        c, p = self._padded(carry, self.loop.carry, padded), self._padded(parameters, self.loop.parameters, padded)
        r = np.ascontiguousarray(rows, dtype=self.dtype)
        if r.ndim != 2 or r.shape[1] != self.loop.row:
            raise ValueError(f"rows: shape {r.shape}, allowed (steps, {self.loop.row})")
        keys = np.zeros(1 + padded, dtype=np.uint64)
        keys[0] = seed
        numbers = np.arange(lanes) if episodes is None else np.asarray(episodes)
        keys[1 : 1 + lanes] = numbers
        entries = -(-r.shape[0] // every) if self.logging else 0
        log = np.zeros((entries, self.loop.logged, padded), dtype=self.dtype)
        pointers = [a.ctypes.data for a in (c, p, r, log, keys)]
        blocks = padded // width
        shares = np.linspace(0, blocks, min(threads, blocks) * 4 + 1 if threads > 1 else 2).astype(int)
        jobs = [(int(a), int(b)) for a, b in zip(shares[:-1], shares[1:], strict=True) if b > a]

        def work(job: tuple[int, int]) -> None:
            self._call(*pointers, *job, r.shape[0], start, padded, every)

        if threads > 1:
            with ThreadPoolExecutor(threads) as pool:
                list(pool.map(work, jobs))
        else:
            for job in jobs:
                work(job)
        return c[:, :lanes], log[:, :, :lanes]

    def _padded(self, values: Array, count: int, lanes: int) -> Array:
        """A contiguous copy with the last lane repeated up to whole vectors."""
        if values.ndim != 2 or values.shape[0] != count:
            raise ValueError(f"shape {values.shape}, allowed ({count}, lanes)")
        result = np.empty((count, lanes), dtype=self.dtype)
        result[:, : values.shape[1]] = values
        result[:, values.shape[1] :] = result[:, values.shape[1] - 1 : values.shape[1]]
        return result


def _compiled(text: str) -> Any:
    """Engine that holds the module's code, from the cache if it is there."""
    import llvmlite
    import llvmlite.binding as llvm

    machine = _machine()
    identity = "\n".join((text, llvmlite.__version__, machine.triple, llvm.get_host_cpu_name(), _features()))
    path = cache_folder() / f"{hashlib.sha256(identity.encode()).hexdigest()}.o"
    content = _cached(path)
    if content is None:
        module = llvm.parse_assembly(text)
        module.verify()
        builder = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=2))
        builder.getModulePassManager().run(module, builder)
        content = machine.emit_object(module)
        _keep(path, content)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _machine())
    engine.add_object_file(llvm.ObjectFileRef.from_data(content))
    engine.finalize_object()
    return engine


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
