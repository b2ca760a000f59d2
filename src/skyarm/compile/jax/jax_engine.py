"""Stepped programs on JAX: batches of lanes on a CPU or GPU, and derivatives of whole episodes.

The engine interprets the lowered program of :func:`skyarm.compile.tracing.stepped_loop.trace_loop` operation by
operation; it does not call the step on JAX's own tracers. Measured on the closed loop of a vehicle with a two-joint
arm (3600 operations, one CPU core, the flags of :mod:`skyarm.compile.jax.jax_cpu`): it runs 1.4 times faster in double
precision (2 to 3 without the flags, where XLA's own sin and cos are slow) and as fast in single, tracing and compiling
take as long, and the formulas are those of every other engine, up to XLA's freedom to contract a * b + c.

Double precision is JAX's to allow: ``jax.config.update("jax_enable_x64", True)``, else ask for ``single=True``.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.compile.jax.jax_cpu import CPU_FLAGS, JaxStartedError, configure_cpu
from skyarm.compile.jax.jax_operations import evaluate
from skyarm.compile.jax.jax_random import uniforms
from skyarm.compile.machine_code import missing_extra
from skyarm.compile.tracing.stepped_loop import Loop, trace_loop

try:
    import jax
    import jax.numpy as jnp
    from jax import lax
except ImportError as error:  # pragma: no cover  (the library is there when this is tested)
    raise missing_extra("jax") from error

Array = npt.NDArray[Any]

__all__ = ["CPU_FLAGS", "JaxKernel", "JaxStartedError", "configure_cpu", "jax_loop"]

CPU_LANES = 64
"""Lanes of a block on a CPU: its values fit the first caches. Measured best of 16 to 512."""


class JaxKernel:
    """A stepped program on JAX, with the arguments and results of :class:`skyarm.compile.llvm.kernel.Kernel`.

    Args:
        loop: the program.
        lanes_per_block: lanes that step together; blocks follow each other. If left out 64 on a CPU, all on a GPU.
        single: 32-bit floats in place of 64-bit ones.
        logging: compile in the writing of the log.
        device: of JAX; its default (the GPU where there is one) if left out.

    Raises:
        ValueError: double precision is wanted and JAX does not allow it.
    """

    def __init__(
        self,
        loop: Loop,
        *,
        lanes_per_block: int | None = None,
        single: bool = False,
        logging: bool = False,
        device: Any = None,
    ) -> None:
        self.loop = loop
        self.logging = logging
        self.dtype: Any = np.float32 if single else np.float64
        self._require_precision()
        self.device = jax.devices()[0] if device is None else device
        self.lanes_per_block = (
            CPU_LANES if lanes_per_block is None and self.device.platform == "cpu" else lanes_per_block
        )
        self._flown: dict[Any, Any] = {}

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

        Arguments and results are those of :meth:`skyarm.compile.llvm.kernel.Kernel.run`.

        A number of lanes or rows that is new compiles anew. Threads are of no use on a GPU.
        """
        lanes = carry.shape[1]
        jobs = [(*job, np.uint32(start)) for job in self.placed(carry, parameters, rows, seed, episodes, threads)]
        compiled = self._ready(jobs[0], every)

        def work(job: tuple[Any, ...]) -> list[Array]:
            return [np.asarray(one) for one in compiled(*job)]

        if threads > 1:
            with ThreadPoolExecutor(threads) as pool:
                parts = list(pool.map(work, jobs))
        else:
            parts = [work(jobs[0])]
        log = np.moveaxis(np.concatenate([part[1] for part in parts]), 0, 2)
        final = joined(np.concatenate([part[0] for part in parts]))
        return final[:, :lanes], log.reshape(*log.shape[:2], final.shape[1])[:, :, :lanes]

    def _ready(self, job: tuple[Any, ...], every: int) -> Any:
        """Compiled code for arguments of these shapes; made here, as JAX keeps its precision per thread."""
        key = (every, *(value.shape for value in job))
        if key not in self._flown:
            self._flown[key] = jax.jit(partial(self._fly, every=every)).lower(*job).compile()
        return self._flown[key]

    def _require_precision(self) -> None:
        config: Any = jax.config
        if self.dtype == np.float64 and not config.read("jax_enable_x64"):
            raise ValueError(
                'JAX computes in 32 bits until jax.config.update("jax_enable_x64", True): set it, or pass single=True'
            )

    def placed(
        self, carry: Array, parameters: Array, rows: Array, seed: int, episodes: Any, threads: int = 1
    ) -> list[Any]:
        """Arguments on the device, a set for each thread: lanes in whole blocks, the last lane repeated."""
        self._require_precision()
        lanes = carry.shape[1]
        block = min(self.lanes_per_block or lanes, lanes)
        count = -(-lanes // (block * threads)) * threads
        spread = np.minimum(np.arange(count * block), lanes - 1)
        numbers = np.arange(lanes) if episodes is None else np.asarray(episodes)
        if not 0 <= seed < 2**64 or np.any(numbers < 0) or np.any(numbers >= 2**32):
            raise ValueError(f"seed = {seed}, episodes: must be whole numbers below 2**64 and 2**32")

        def blocks(values: Array, expected: int, name: str) -> Array:
            if values.ndim != 2 or values.shape != (expected, lanes):
                raise ValueError(f"{name}: shape {values.shape}, allowed ({expected}, {lanes})")
            whole = values[:, spread].astype(self.dtype).reshape(expected, count, block)
            return np.ascontiguousarray(np.moveaxis(whole, 1, 0))

        c = blocks(carry, self.loop.carry, "carry")
        p = blocks(parameters, self.loop.parameters, "parameters")
        r = np.asarray(rows, dtype=self.dtype)
        if r.ndim != 2 or r.shape[1] != self.loop.row:
            raise ValueError(f"rows: shape {r.shape}, allowed (steps, {self.loop.row})")
        words = np.array([seed & 0xFFFFFFFF, seed >> 32], dtype=np.uint32)
        keys = numbers[spread].astype(np.uint32).reshape(count, block)
        parts = [slice(a, a + count // threads) for a in range(0, count, count // threads)]
        return [jax.device_put((c[part], p[part], r, words, keys[part]), self.device) for part in parts]

    def _fly(self, c: Any, p: Any, r: Any, words: Any, keys: Any, start: Any, *, every: int) -> Any:
        """All blocks, one after the other."""
        logged = self.loop.logged if self.logging else 0

        def block(args: Any) -> Any:
            c, p, keys = args
            return self.block(c, p, r, words, keys, start, every=every, logged=logged)

        return lax.map(block, (c, p, keys))

    def block(
        self, c: Any, p: Any, r: Any, words: Any, keys: Any, start: Any, every: int = 1, logged: int = 0
    ) -> tuple[Any, Any]:
        """One block of lanes through all rows; returns carry (carry, block) and log (entries, logged, block)."""
        steps, width = r.shape[0], keys.shape[0]
        each_lane = jax.vmap(partial(self._step, p_words=words), in_axes=(0, 0, None, 0, None))
        parameters = tuple(p)

        @partial(jax.checkpoint, prevent_cse=False)
        def advance(carry: Any, row: Any, step: Any) -> Any:
            out = each_lane(carry, parameters, tuple(row), keys, step)
            return tuple(out[: self.loop.carry]), tuple(out[self.loop.carry :])

        def body(state: Any, at: Any) -> Any:
            (carry, log), (i, row) = state, at
            following, entry = advance(carry, row, start + i)
            if logged:
                place = (i // np.uint32(every)).astype(np.int32)
                kept = lax.select(i % np.uint32(every) == 0, jnp.stack(entry), log[place])
                log = lax.dynamic_update_index_in_dim(log, kept, place, 0)
            return (following, log), None

        log = jnp.zeros((-(-steps // every) if logged else 0, logged, width), self.dtype)
        (carry, log), _ = lax.scan(body, (tuple(c), log), (np.arange(steps, dtype=np.uint32), r))
        return jnp.stack(carry), log

    def _step(self, c: Any, p: Any, r: Any, episode: Any, step: Any, *, p_words: Any) -> list[Any]:
        """One step of one lane."""
        draws = uniforms(p_words, episode, step, self.loop.uniforms, self.dtype) if self.loop.uniforms else []
        return evaluate(self.loop.program, (*c, *p, *r, *draws), self.dtype)


def joined(blocks: Array) -> Array:
    """(blocks, values, lanes of a block) as (values, lanes)."""
    return np.moveaxis(blocks, 0, 1).reshape(blocks.shape[1], -1)


def jax_loop(
    step: Callable[..., tuple[Any, Any]],
    carry: Any,
    parameters: Any,
    row: Any,
    uniforms: tuple[tuple[int, int], ...] = (),
    **options: Any,
) -> JaxKernel:
    """Trace step(carry, parameters, row, uniforms) -> (carry, log) and put it on JAX.

    Args:
        step: pure function of records.
        carry: example record.
        parameters: example record.
        row: example record.
        uniforms: (channel, count) of the numbers uniform in (0, 1) that a step draws.
        options: of :class:`JaxKernel`.
    """
    return JaxKernel(trace_loop(step, carry, parameters, row, uniforms), **options)
