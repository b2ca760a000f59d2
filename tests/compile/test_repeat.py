"""A repetition is a loop in machine code and in Python, and gives the bits of the lines
written out.
"""

from __future__ import annotations

import numpy as np
import pytest
from programs_random import bits, random_function, same_bits

from skyarm.algebra.scalars import sin, where
from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing import lower as room
from skyarm.compile.tracing.lower import operations, repeat, repeat_while
from skyarm.compile.tracing.program import trace_loop


@pytest.fixture(autouse=True)
def _cache(tmp_path, monkeypatch):
    monkeypatch.setenv("SKYARM_CACHE", str(tmp_path))
    monkeypatch.setattr(room, "WRITTEN_OUT", 0)


def swing(count, inner=1):
    """A pendulum: slots that swap places, a value from outside, a constant start, an
    end that is a start.
    """

    def step(carry, parameters, row, draws):
        outside = parameters[0] * row[0]

        def once(x):
            a, v, _old, kept, ticks = x
            v = repeat(inner, lambda w: (w[0] - 0.01 * sin(a) * outside,), (v,))[0]
            return (a + 0.01 * v, v, a, kept, where(v > 0.0, ticks + 1.0, ticks))

        a, v, old, kept, ticks = repeat(
            count, once, (carry[0], carry[1], 0.0, outside, 0.0)
        )
        b, w, *_ = repeat(count, once, (v, a, old, kept, ticks))
        return (a, w), (old, kept, ticks, b)

    return step


def traced(count, *, loops, inner=1):
    return trace_loop(swing(count, inner), (0.0, 0.0), (0.0,), (0.0,), loops=loops)


@pytest.mark.parametrize("count", [1, 2, 3, 50])
def test_a_loop_has_the_bits_of_the_lines_written_out(count):
    loops, plain = (traced(count, loops=kept) for kept in (True, False))
    rng = np.random.default_rng(3)
    carry, parameters, rows = (
        rng.normal(size=(2, 9)),
        rng.normal(size=(1, 9)),
        rng.normal(size=(7, 1)),
    )
    flown = [
        Kernel(loop, Lanes(4), logging=True).run(carry, parameters, rows)
        for loop in (loops, plain)
    ]
    assert same_bits(flown[0][0], flown[1][0])
    assert same_bits(flown[0][1], flown[1][1])
    for a, v, k, g in rng.normal(size=(20, 4)).tolist():
        direct = swing(count)((a, v), (k,), (g,), ())
        expected = bits((*direct[0], *direct[1]))
        assert bits(loops.stepper()((a, v, k, g))) == expected
        assert bits(plain.stepper()((a, v, k, g))) == expected


def test_a_loop_of_a_random_function_has_the_bits_of_python_floats():
    function = random_function(np.random.default_rng(77), length=10)
    ends = 3

    def step(carry, parameters, row, draws):
        return repeat(4, lambda x: function(*x, *parameters)[-ends:], carry), ()

    loop = trace_loop(step, (0.0,) * ends, (0.0,), (), loops=True)
    values = np.random.default_rng(1).normal(size=(ends + 1, 16))
    carry, _ = Kernel(loop, Lanes(8)).run(
        values[:ends], values[ends:], np.zeros((2, 0))
    )
    for k in range(16):
        x = tuple(values[:ends, k].tolist())
        for _ in range(2):
            x = step(x, (float(values[ends, k]),), (), ())[0]
        assert bits(carry[:, k]) == bits(x)


def test_rounds_that_differ_between_lanes_leave_each_lane_its_own():
    """Doubling n times; a call in which no lane asks for a round is counted in no
    round.
    """

    def step(carry, parameters, row, draws):
        return (
            repeat_while(
                3, row[0] * parameters[0], lambda x: (2.0 * x[0] + x[1], x[1]), carry
            ),
            (),
        )

    loops, plain = (
        trace_loop(step, (0.0, 0.0), (0.0,), (0.0,), loops=kept)
        for kept in (True, False)
    )
    counts = np.array([[0.0, 1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 0.0]])
    carry = np.stack([np.arange(1.0, 9.0), np.full(8, 0.5)])
    for rows in ([[1.0]], [[0.0]], [[0.0], [1.0], [0.0]]):
        done = counts[0] * (1.0 if [1.0] in rows else 0.0)
        expected = carry[0] * 2.0**done + 0.5 * (2.0**done - 1.0)
        for loop in (loops, plain):
            assert (
                Kernel(loop, Lanes(4)).run(carry, counts, np.array(rows))[0][0]
                == expected
            ).all()
        for x, n, end in zip(
            carry[0].tolist(), counts[0].tolist(), expected.tolist(), strict=True
        ):
            now = (x, 0.5)
            for row in rows:
                now = loops.stepper()((*now, n, *row))
            assert now[0] == end


def test_a_short_repetition_is_written_out(monkeypatch):
    monkeypatch.setattr(room, "WRITTEN_OUT", 10_000)
    short, long = (traced(count, loops=True).program.nodes for count in (5, 5000))
    assert "repeat" not in {node.op for node in short}
    assert "repeat" in {node.op for node in long}


def test_a_loop_keeps_its_program_short():
    sizes = [len(traced(count, loops=True).program.nodes) for count in (2, 500)]
    assert sizes[0] == sizes[1]
    assert len(traced(500, loops=False).program.nodes) > 100 * sizes[0]


def test_operations_count_a_body_as_often_as_it_runs():
    assert operations(traced(9, loops=True).program.nodes) - operations(
        traced(8, loops=True).program.nodes
    ) == (
        operations(traced(19, loops=True).program.nodes)
        - operations(traced(18, loops=True).program.nodes)
    )
    assert operations(traced(8, loops=True).program.nodes) == pytest.approx(
        operations(traced(8, loops=False).program.nodes), rel=0.1
    )


def test_a_loop_inside_a_loop_is_written_out():
    loops, plain = (traced(3, loops=kept, inner=2) for kept in (True, False))
    point = (0.3, -0.2, 1.5, 9.0)
    assert bits(loops.stepper()(point)) == bits(plain.stepper()(point))
    assert [node.op for node in loops.program.nodes].count("repeat") == 2


def test_a_record_that_changes_its_size_is_refused():
    with pytest.raises(
        ValueError, match="returns a record of 2 scalars, took one of 1"
    ):
        trace_loop(
            lambda c, p, r, u: (repeat(2, lambda x: (x[0], x[0]), c)[:1], ()),
            (0.0,),
            (),
            (),
            loops=True,
        )


def test_plain_floats_are_simply_repeated():
    assert repeat(10, lambda x: (x[0] * 2.0,), (1.0,)) == (1024.0,)
    assert repeat(0, lambda x: (x[0] * 2.0,), (1.0,)) == (1.0,)
