"""Slopes of quotients in JAX against the quotient rule by hand."""

from __future__ import annotations

import pytest

jax = pytest.importorskip("jax")


SLOPES = [(3.0, 4.0, (0.25, -0.1875)), (-1.0, 0.5, (2.0, 4.0)), (2.0, 0.0, (0.0, 0.0))]


@pytest.mark.parametrize(("a", "b", "slopes"), SLOPES)
def test_slopes_of_a_quotient_are_those_of_the_quotient_rule_and_zero_over_zero(
    a, b, slopes
):
    from skyarm.compile.jax.jax_operations import divide

    assert [float(slope) for slope in jax.grad(divide, (0, 1))(a, b)] == pytest.approx(
        slopes, rel=1e-6
    )
