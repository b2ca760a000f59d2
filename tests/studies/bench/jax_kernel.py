"""Stepped programs on JAX: batches of lanes on a CPU or GPU, for comparison with
machine code.

The engine interprets the lowered program of
:func:`skyarm.compile.tracing.program.trace_loop` operation by operation; it does not
call the step on JAX's own tracers. Measured on the closed loop of a vehicle with a
two-joint arm (3600 operations, one CPU core, the flags of :func:`configure_cpu`): it
runs 1.4 times faster in double precision (2 to 3 without the flags, where XLA's own sin
and cos are slow) and as fast in single, tracing and compiling take as long, and the
formulas are those of every other engine, up to XLA's freedom to contract a * b + c.

Double precision is JAX's to allow: ``jax.config.update("jax_enable_x64", True)``, else
ask for ``single=True``.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import numpy.typing as npt
from jax import lax

from skyarm.compile.jax.jax_cpu import configure_extra_options
from skyarm.compile.jax.jax_operations import evaluate, uniforms
from skyarm.compile.tracing.program import Loop

Array = npt.NDArray[Any]


WIDE = "--xla_cpu_prefer_vector_width=512"
"""A preference that makes XLA compile a block of lanes as one SIMD loop; a jaxlib that
lacks it ends the process."""


def configure_cpu() -> None:
    """Set XLA's flags for stepped programs on a CPU; to be called before anything is
    computed with JAX.
    """
    if WIDE.split("=", maxsplit=1)[0] not in os.environ.get("XLA_FLAGS", ""):
        os.environ["XLA_FLAGS"] = f"{os.environ.get('XLA_FLAGS', '')} {WIDE}".strip()
    configure_extra_options()


CPU_LANES = 64
"""Lanes of a block on a CPU: its values fit the first caches. Measured best of 16 to
512."""


class JaxKernel:
    """A stepped program on JAX, with the arguments and results of
    :class:`skyarm.compile.llvm.kernel.Kernel`.

    Args:
        loop: the program.
        lanes_per_block: lanes that step together; blocks follow each other. If left out
            64 on a CPU, all on a GPU.
        single: 32-bit floats in place of 64-bit ones.
        logging: compile in the writing of the log.

    Raises:
        ValueError: double precision is requested and JAX does not allow it.
    """

    def __init__(
        self,
        loop: Loop,
        *,
        lanes_per_block: int | None = None,
        single: bool = False,
        logging: bool = False,
    ) -> None:
        self.loop, self._logged = loop, loop.logged if logging else 0
        self.dtype: Any = np.float32 if single else np.float64
        self._require_precision()
        on_processor = jax.default_backend() == "cpu"
        self._block = (
            CPU_LANES if lanes_per_block is None and on_processor else lanes_per_block
        )
        self._compiled: dict[Any, Any] = {}

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

        Arguments and results are those of
        :meth:`skyarm.compile.llvm.kernel.Kernel.run`.

        A number of lanes or rows that is new compiles anew. Threads are of no use on a
        GPU.
        """
        self._require_precision()
        lanes = carry.shape[1]
        block = min(self._block or lanes, lanes)
        count = -(-lanes // (block * threads)) * threads
        # whole blocks, the last lane repeated
        spread = np.minimum(np.arange(count * block), lanes - 1)
        numbers = np.arange(lanes) if episodes is None else np.asarray(episodes)
        if not 0 <= seed < 2**64 or np.any(numbers < 0) or np.any(numbers >= 2**32):
            raise ValueError(
                f"seed = {seed}, episodes: must be whole numbers below 2**64 and 2**32"
            )
        for name, given, shape in (
            ("carry", carry, (self.loop.carry, lanes)),
            ("parameters", parameters, (self.loop.parameters, lanes)),
            ("rows", rows, (len(rows), self.loop.row)),
        ):
            if np.shape(given) != shape:
                raise ValueError(f"{name}: shape {np.shape(given)}, allowed {shape}")

        def blocks(values: Array) -> Array:
            whole = (
                values[:, spread].astype(self.dtype).reshape(len(values), count, block)
            )
            return np.ascontiguousarray(np.moveaxis(whole, 1, 0))

        each = (
            blocks(carry),
            blocks(parameters),
            numbers[spread].astype(np.uint32).reshape(count, block),
        )
        words = np.array([seed & 0xFFFFFFFF, seed >> 32], dtype=np.uint32)
        # placed here, as JAX keeps its precision per thread
        shared = jax.device_put(
            (np.asarray(rows, dtype=self.dtype), words, np.uint32(start))
        )
        jobs = [
            jax.device_put([np.split(values, threads)[i] for values in each])
            for i in range(threads)
        ]
        fly = self._code((*jobs[0], *shared), every)

        def work(job: list[Any]) -> list[Array]:
            return [np.asarray(found) for found in fly(*job, *shared)]

        if threads > 1:
            with ThreadPoolExecutor(threads) as pool:
                parts = list(pool.map(work, jobs))
        else:
            parts = [work(jobs[0])]
        # (blocks, ..., lanes of a block) -> (..., lanes)
        final, log = (
            np.moveaxis(np.concatenate(part), 0, -2)
            for part in zip(*parts, strict=True)
        )
        return tuple(
            found.reshape(*found.shape[:-2], count * block)[..., :lanes]
            for found in (final, log)
        )  # type: ignore[return-value]

    def _code(self, job: tuple[Any, ...], every: int) -> Any:
        """Compiled code for arguments of these shapes; made here, as JAX keeps its
        precision per thread.
        """
        key = (every, *(np.shape(value) for value in job))
        if key not in self._compiled:
            self._compiled[key] = (
                jax.jit(partial(self._fly, every=every)).lower(*job).compile()
            )
        return self._compiled[key]

    def _require_precision(self) -> None:
        config: Any = jax.config
        if self.dtype == np.float64 and not config.read("jax_enable_x64"):
            raise ValueError(
                'JAX computes in 32 bits until jax.config.update("jax_enable_x64",'
                " True): set it, or pass single=True"
            )

    def _fly(
        self, c: Any, p: Any, keys: Any, r: Any, words: Any, start: Any, *, every: int
    ) -> Any:
        """All blocks, one after the other: carry (carry, block) and log (entries,
        logged, block) of each.
        """

        def block(of: tuple[Any, Any, Any]) -> tuple[Any, Any]:
            return self._fly_block(*of, r, words, start, every)

        return lax.map(block, (c, p, keys))

    def _fly_block(
        self, c: Any, p: Any, keys: Any, r: Any, words: Any, start: Any, every: int
    ) -> tuple[Any, Any]:
        step = jax.vmap(partial(self._step, words), in_axes=(0, 0, None, 0, None))

        def body(state: Any, at: Any) -> Any:
            (carry, log), (i, row) = state, at
            found = step(carry, tuple(p), tuple(row), keys, start + i)
            if self._logged:
                place = (i // np.uint32(every)).astype(np.int32)
                entry = jnp.stack(found[self.loop.carry :])
                kept = lax.select(i % np.uint32(every) == 0, entry, log[place])
                log = lax.dynamic_update_index_in_dim(log, kept, place, 0)
            return (tuple(found[: self.loop.carry]), log), None

        steps = r.shape[0]
        log = jnp.zeros(
            (-(-steps // every) if self._logged else 0, self._logged, keys.shape[0]),
            self.dtype,
        )
        (carry, log), _ = lax.scan(
            body, (tuple(c), log), (np.arange(steps, dtype=np.uint32), r)
        )
        return jnp.stack(carry), log

    def _step(
        self, words: Any, c: Any, p: Any, r: Any, episode: Any, step: Any
    ) -> list[Any]:
        """One step of one lane."""
        draws = (
            uniforms(words, episode, step, self.loop.uniforms, self.dtype)
            if self.loop.uniforms
            else []
        )
        return evaluate(self.loop.program, (*c, *p, *r, *draws), self.dtype)
