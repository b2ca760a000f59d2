"""Derivatives of a whole episode on JAX: any metric of the final carry by every parameter."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from skyarm.compile.jax.jax_engine import Array, JaxKernel, joined
from skyarm.compile.machine_code import missing_extra
from skyarm.records.leaves import shaped_like

try:
    import jax
    import jax.numpy as jnp
    from jax import lax
except ImportError as error:  # pragma: no cover  (the library is there when this is tested)
    raise missing_extra("jax") from error


def gradient(kernel: JaxKernel, metric: Callable[[Any], Any]) -> Callable[..., tuple[Array, Array]]:
    """Differentiate a metric of the final carry by every parameter, lane by lane, in reverse mode.

    Each step is computed again on the way back, so that memory holds one carry per step and not every operation.
    Call :func:`skyarm.compile.jax.jax_engine.configure_cpu` first: without its flags XLA takes minutes to compile this.
    Where the metric has a kink (a limit just reached) the slope is that of one side.

    Args:
        kernel: the stepped program.
        metric: takes the carry's record of one lane, returns a scalar, by functions of :mod:`skyarm.scalars`.

    Returns:
        a function of (carry, parameters, rows, *, seed, episodes, start), as :meth:`JaxKernel.run` takes them, that
        returns the metric (lanes,) and its slopes (parameters, lanes), in the order of the leaves.
    """

    def of_lane(carry: Any) -> Any:
        return jnp.asarray(metric(shaped_like(kernel.loop.result[0], tuple(carry))), kernel.dtype)

    def total(p: Any, c: Any, *rest: Any) -> Any:
        following, _ = kernel.block(c, p, *rest)
        values = jax.vmap(of_lane)(following.T)
        return jnp.sum(values), values  # lanes do not meet, so the sum's slopes are those of each

    def all_blocks(c: Any, p: Any, r: Any, words: Any, keys: Any, start: Any) -> Any:
        def block(args: Any) -> Any:
            c, p, keys = args
            (_, values), slopes = jax.value_and_grad(total, has_aux=True)(p, c, r, words, keys, start)
            return values, slopes

        return lax.map(block, (c, p, keys))

    compiled = jax.jit(all_blocks)

    def slope(
        carry: Array, parameters: Array, rows: Array, *, seed: int = 0, episodes: Any = None, start: int = 0
    ) -> tuple[Array, Array]:
        lanes = carry.shape[1]
        (job,) = kernel.placed(carry, parameters, rows, seed, episodes)
        values, slopes = compiled(*job, np.uint32(start))
        return np.asarray(values).reshape(-1)[:lanes], joined(np.asarray(slopes))[:, :lanes]

    return slope
