"""What an engine does when it is not told: no log, double precision; and threads that
change nothing.
"""

from __future__ import annotations

import numpy as np
import pytest

from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.program import trace_loop


@pytest.fixture(autouse=True)
def _cache(tmp_path, monkeypatch):
    monkeypatch.setenv("SKYARM_CACHE", str(tmp_path / "cache"))


def half(carry, par, row, draws):
    """x/2 + p, logged before it is stepped."""
    return (0.5 * carry[0] + par[0] + row[0],), (carry[0], row[0])


def halving():
    return trace_loop(half, (0.0,), (0.0,), (0.0,))


def expected(carry, parameters, rows):
    """Closed form of the recurrence by NumPy: x_n = x_0 / 2^n + sum_k (p + r_k) /
    2^(n - 1 - k).
    """
    n = len(rows)
    weights = 0.5 ** (n - 1.0 - np.arange(n))
    return carry * 0.5**n + weights.sum() * parameters + weights @ rows[:, 0]


CARRY, PARAMETERS, ROWS = (
    np.array([[0.1, 0.2, 0.3]]),
    np.array([[1.0, 2.0, 3.0]]),
    np.arange(6.0)[:, None] / 7.0,
)


def check_defaults(kernel):
    """Tolerance: six steps of one rounding each on numbers below ten, in double; single
    would be off by 1e-7.
    """
    final, log = kernel.run(CARRY, PARAMETERS, ROWS)
    assert final.dtype == log.dtype == np.float64
    np.testing.assert_allclose(
        final, expected(CARRY, PARAMETERS, ROWS), rtol=0, atol=2e-14
    )
    assert log.size == 0
    assert (log.shape[0], log.shape[2]) == (0, 3)


def check_logging(kernel):
    _, log = kernel.run(CARRY, PARAMETERS, ROWS)
    assert log.shape == (6, 2, 3)
    np.testing.assert_array_equal(log[0, 0], CARRY[0])
    np.testing.assert_array_equal(log[:, 1], np.repeat(ROWS, 3, axis=1))


def test_machine_code_keeps_no_log_unless_it_is_asked_to():
    check_defaults(Kernel(halving()))
    check_logging(Kernel(halving(), logging=True))


def test_jax_keeps_no_log_unless_it_is_asked_to():
    jax = pytest.importorskip("jax")
    from jax_kernel import JaxKernel

    with jax.enable_x64(True):
        check_defaults(JaxKernel(halving()))
        check_logging(JaxKernel(halving(), logging=True))


@pytest.mark.parametrize("width", [1, 4])
def test_more_threads_than_lanes_or_fewer_change_no_bit(width):
    kernel = Kernel(halving(), Lanes(width), logging=True)
    for lanes in (1, 2, 5, 13):
        carry, parameters = (
            np.linspace(-1.0, 1.0, lanes)[None],
            np.linspace(2.0, 3.0, lanes)[None],
        )
        alone = kernel.run(carry, parameters, ROWS)
        np.testing.assert_allclose(
            alone[0], expected(carry, parameters, ROWS), rtol=0, atol=2e-14
        )
        for threads in (2, 3, 8, 40):
            found = kernel.run(carry, parameters, ROWS, threads=threads)
            assert all(
                np.array_equal(a, b) for a, b in zip(found, alone, strict=True)
            ), (lanes, threads)
