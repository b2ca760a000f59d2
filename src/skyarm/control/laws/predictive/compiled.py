"""A function of records as machine code on rows of their leaves."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.program import trace_loop

Array = npt.NDArray[np.float64]


class Compiled:
    """Machine code of a traceable function.

    Args:
        function: of records; returns a record.
        examples: a record of floats for each argument.
    """

    def __init__(self, function: Callable[..., Any], *examples: Any) -> None:
        def step(carry: Any, _par: Any, row: Any, _uniforms: Any) -> Any:
            return carry, function(*row)

        self.kernel = Kernel(trace_loop(step, (0.0,), (), examples), Lanes(1), logging=True)

    def __call__(self, *parts: Array) -> Array:
        """Leaves of the result for the leaves of each argument; for rows of them (T, leaves), rows."""
        rows = np.concatenate(parts, axis=-1)
        _, log = self.kernel.run(np.zeros((1, 1)), np.zeros((0, 1)), np.atleast_2d(rows))
        found = np.ascontiguousarray(log[:, :, 0])
        return found if rows.ndim > 1 else np.asarray(found[0])
