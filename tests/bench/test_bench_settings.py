"""What a measurement says of its machine, and the precision JAX has while one is made."""

from __future__ import annotations

import os

import pytest

from skyarm.bench import engines as ours
from skyarm.bench import machine


@pytest.mark.skipif(not hasattr(os, "getloadavg"), reason="this system tells no load")
def test_the_load_of_the_last_minute_is_told_to_two_digits(monkeypatch):
    monkeypatch.setattr(os, "getloadavg", lambda: (1.23456, 7.0, 9.0))
    assert machine.describe()["load_before"] == 1.23


@pytest.mark.parametrize(("name", "double"), [("f64", True), ("f32", False)])
@pytest.mark.parametrize("before", [True, False])
def test_jax_computes_in_the_named_precision_and_then_as_before(name, double, before):
    jax = pytest.importorskip("jax")
    usual = jax.config.read("jax_enable_x64")
    try:
        jax.config.update("jax_enable_x64", before)
        with ours._precision(name):
            assert (jax.numpy.asarray([1.0]).dtype.itemsize == 8) == double
        assert jax.config.read("jax_enable_x64") == before
        with pytest.raises(RuntimeError, match="within"), ours._precision(name):
            raise RuntimeError("within")
        assert jax.config.read("jax_enable_x64") == before
    finally:
        jax.config.update("jax_enable_x64", usual)
