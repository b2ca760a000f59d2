"""What engines take from outside: widths, shapes, flags; and when a repetition is
written out.
"""

from __future__ import annotations

import os

import numpy as np
import pytest

from skyarm.algebra import scalars
from skyarm.compile import trace
from skyarm.compile.jax import jax_cpu
from skyarm.compile.llvm import kernel as native
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing import lower as repetition
from skyarm.compile.tracing.program import trace_loop


@pytest.mark.parametrize(
    ("features", "doubles"),
    [
        ("+sse2", 2),
        ("+sse2,+neon", 2),
        ("+sse4.2,+avx", 4),
        ("+avx,+avx2", 4),
        ("+avx,+avx2,+avx512f,-prefer-256-bit", 8),
    ],
)
def test_a_register_holds_as_many_lanes_as_the_processor_says(
    monkeypatch, features, doubles
):
    """128 bits without AVX, 256 with it, 512 with AVX-512F (Intel, Software Developer
    Manual 1, chapters 14, 15).
    """
    monkeypatch.setattr(native, "_features", lambda: features)
    assert native.host_width() == doubles
    assert native.host_width(single=True) == 2 * doubles


@pytest.mark.parametrize("shape", [(4, 2), (4, 0), (4,), (4, 1, 1), ()])
def test_rows_of_another_shape_are_refused_by_every_engine(
    monkeypatch, tmp_path, shape
):
    monkeypatch.setenv("SKYARM_CACHE", str(tmp_path))
    loop = trace_loop(
        lambda carry, p, row, u: ((carry[0] + row[0],), ()), (0.0,), (), (0.0,)
    )
    kernel = native.Kernel(loop, Lanes(1))
    with pytest.raises(ValueError, match=r"^rows: shape \(.*\), allowed \(steps, 1\)"):
        kernel.run(np.zeros((1, 3)), np.zeros((0, 3)), np.zeros(shape))


def test_minus_a_negative_is_a_sum():
    program = trace(lambda x, y: (x - (-y), x + y, y - (-x)), 1.0, 1.0)
    assert program.operations() == {"add": 1}
    assert program(2.0, 3.0) == (5.0, 5.0, 5.0)


@pytest.mark.parametrize(("most", "kept"), [(15, True), (16, False)])
def test_a_repetition_of_just_the_limit_is_written_out(monkeypatch, most, kept):
    """Four turns of one slot and three operations are sixteen, which may be written out
    where sixteen are allowed.
    """
    monkeypatch.setattr(repetition, "WRITTEN_OUT", most)

    def turn(x):
        return (scalars.sin(scalars.exp(scalars.cos(x[0]))),)

    loop = trace_loop(
        lambda carry, p, r, u: (repetition.repeat(4, turn, carry), ()),
        (0.5,),
        (),
        (),
        loops=True,
    )
    assert ("repeat" in {node.op for node in loop.program.nodes}) == kept


@pytest.mark.parametrize("value", ["7", "a=b,c"])
def test_a_flag_that_the_user_set_stays_whatever_its_value(monkeypatch, value):
    name = jax_cpu.EXTRA_OPTIONS.split("=", maxsplit=1)[0]
    monkeypatch.setattr(jax_cpu, "_has_started", lambda: False)
    monkeypatch.setenv("XLA_FLAGS", f"--xla_other=1 {name}={value}")
    assert jax_cpu.configure_extra_options()
    assert os.environ["XLA_FLAGS"].split() == ["--xla_other=1", f"{name}={value}"]
