"""One call over every engine: floats, NumPy, JAX, CasADi and the tracer, each as lists of Python floats in and out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from scipy.differentiate import jacobian

ENGINES = ("floats", "numpy", "jax", "casadi", "trace")


def jax_doubles(allowed: bool = True) -> Any:
    """A context in which JAX computes in 64 bits, or in 32; newer versions have it under another name."""
    jax = pytest.importorskip("jax")
    return jax.enable_x64(allowed) if hasattr(jax, "enable_x64") else jax.experimental.enable_x64(allowed)


def evaluate(engine: str, function: Callable[..., Sequence[Any]], lanes: Sequence[Sequence[float]]) -> np.ndarray:
    """``function(*scalars) -> sequence of scalars`` at each lane; rows are lanes, columns outputs."""
    return {"floats": _floats, "numpy": _numpy, "jax": _jax, "casadi": _casadi, "trace": _trace}[engine](
        function, lanes
    )


def slopes(function: Callable[..., Sequence[Any]], point: Any, units: Any = 1.0) -> np.ndarray:
    """Jacobian of ``function(*scalars)`` on NumPy lanes, by SciPy's differences of eighth order.

    Args:
        function: as of :func:`evaluate`.
        point: where.
        units: of the scalars: ten times the first step.
    """

    def outputs(lanes: Any) -> Any:
        return np.array(np.broadcast_arrays(*function(*(lanes.T * units).T), lanes[0])[:-1])

    return jacobian(outputs, point / units, initial_step=0.1, order=8).df / units


def _floats(function: Any, lanes: Any) -> np.ndarray:
    return np.array([[float(out) for out in function(*map(float, lane))] for lane in lanes])


def _spread(outputs: Any, count: int) -> np.ndarray:
    return np.array([np.broadcast_to(np.asarray(out, dtype=float), (count,)) for out in outputs]).T


def _numpy(function: Any, lanes: Any) -> np.ndarray:
    columns = np.array(lanes, dtype=float).T
    return _spread(function(*columns), len(lanes))


def _jax(function: Any, lanes: Any) -> np.ndarray:
    jax = pytest.importorskip("jax")
    with jax_doubles():
        columns = [jax.numpy.asarray(column) for column in np.array(lanes, dtype=float).T]
        return _spread(function(*columns), len(lanes))


def _casadi(function: Any, lanes: Any) -> np.ndarray:
    import casadi

    inputs = [casadi.SX.sym(f"x{i}") for i in range(len(lanes[0]))]
    outputs = [casadi.SX(out) for out in function(*inputs)]
    compiled = casadi.Function("f", inputs, [casadi.vertcat(*outputs)])
    return np.array([np.array(compiled(*map(float, lane))).ravel() for lane in lanes])


def _trace(function: Any, lanes: Any) -> np.ndarray:
    from skyarm.compile import trace

    program = trace(lambda *scalars: tuple(function(*scalars)), *(0.5 for _ in lanes[0]))
    return np.array([[float(out) for out in program(*map(float, lane))] for lane in lanes])
