"""Code that several calls of one function share: written once, with the bits of the
function written out.
"""

from __future__ import annotations

import dataclasses
import re
import tomllib

import numpy as np
import pytest
from programs_random import bits, random_function, same_bits

import skyarm
from skyarm.algebra.scalars import sin, where
from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.llvm_loop import assembly
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing import lower as room
from skyarm.compile.tracing.lower import compiled_once, operations, repeat
from skyarm.compile.tracing.program import trace_loop
from skyarm.simulate.engine import EpisodeCode
from support.teams import TEAMS


@pytest.fixture(autouse=True)
def _cache(tmp_path, monkeypatch):
    monkeypatch.setenv("SKYARM_CACHE", str(tmp_path))
    monkeypatch.setattr(room, "WRITTEN_OUT", 0)


def functions(loop):
    """Number of shared functions in the machine code of a program."""
    return assembly(loop, Lanes(1), logging=True).count("define internal void @shared")


def traced(step, *, loops=True, carry=(0.0, 0.0), parameters=(0.0,), row=(0.0,)):
    return trace_loop(step, carry, parameters, row, loops=loops)


def wave(x):
    """Function of a nested record: numbers, a text, a constant output and an input that
    passes through.
    """
    (a, b), name, c = x
    return (
        (sin(a) * b + c, 0.0),
        name,
        repeat(3, lambda y: (y[0] * 0.5 + a,), (b,))[0],
        a,
    )


def twice(carry, parameters, row, draws):
    """Two calls of one function, the second with the result of the first, and one
    inside a loop.
    """
    (first, zero), _, other, same = compiled_once(
        "wave", wave, ((carry[0], carry[1]), "x", parameters[0])
    )
    (second, _), *_ = compiled_once("wave", wave, ((first, carry[0]), "x", row[0]))
    last = repeat(
        5,
        lambda y: (compiled_once("wave", wave, ((y[0], row[0]), "x", carry[1]))[2],),
        (other,),
    )[0]
    return (second, last + zero), (same, first)


def test_shared_code_has_the_bits_of_the_function_written_out():
    shared, plain = (traced(twice, loops=kept) for kept in (True, False))
    assert functions(shared) == 1
    assert functions(plain) == 0
    rng = np.random.default_rng(3)
    carry, parameters, rows = (
        rng.normal(size=(2, 9)),
        rng.normal(size=(1, 9)),
        rng.normal(size=(4, 1)),
    )
    flown = [
        Kernel(loop, Lanes(4), logging=True).run(carry, parameters, rows)
        for loop in (shared, plain)
    ]
    assert same_bits(flown[0][0], flown[1][0])
    assert same_bits(flown[0][1], flown[1][1])
    a, v, k, g = rng.normal(size=4).tolist()
    direct = twice((a, v), (k,), (g,), ())
    assert bits(shared.stepper()((a, v, k, g))) == bits((*direct[0], *direct[1]))


@pytest.mark.parametrize("seed", range(4))
def test_shared_code_of_a_random_function_has_the_bits_of_python_floats(seed):
    function, ends = random_function(np.random.default_rng(seed), length=10), 2

    def step(carry, parameters, row, draws):
        once = compiled_once(
            "f", lambda x: tuple(function(*x)[-ends:]), (*carry, *parameters, *row)
        )
        return (
            tuple(
                compiled_once(
                    "f",
                    lambda x: tuple(function(*x)[-ends:]),
                    (*once, *parameters, *row),
                )
            ),
            (),
        )

    loop = traced(step)
    rng = np.random.default_rng(seed)
    for point in rng.normal(size=(10, 4)).tolist():
        direct = step(tuple(point[:2]), (point[2],), (point[3],), ())
        expected = bits(direct[0])
        assert bits(loop.stepper()(tuple(point))) == expected
        now = Kernel(loop, Lanes(1)).run(
            np.array(point[:2])[:, None], np.array([[point[2]]]), np.array([[point[3]]])
        )
        assert bits(tuple(now[0][:, 0].tolist())) == expected


def test_calls_of_other_constants_structure_or_keys_have_code_of_their_own():
    def step(carry, parameters, row, draws):
        a, b = carry

        def of(key, record, constants=()):
            return compiled_once(key, lambda x: (x[0] * x[1],), record, constants)[0]

        numbers = [
            of("k", (a, 2.0)),
            of("k", (b, 2.0)),
            of("k", (a, 3.0)),
            of("k", (a, 0.0)),
            of("k", (a, -0.0)),
        ]
        numbers += [
            of("k", (a, b)),
            of("k", (a, b, "text")),
            of("other", (a, b)),
            of("k", (a, b), (1.5,)),
        ]
        return (sum(numbers, 0.0), b), ()

    assert functions(traced(step)) == 8  # the second call alone is the first one's


def test_a_symbolic_constant_is_written_out_and_so_is_a_condition():
    def step(carry, parameters, row, draws):
        a, b = carry
        with_symbol = compiled_once("s", lambda x: (x[0] * row[0],), (a,), (row[0],))[0]
        truth = compiled_once("t", lambda x: (x[0] < x[1],), (a, b))[0]
        return (where(truth, with_symbol, b), b), ()

    loop = traced(step)
    assert functions(loop) == 0
    assert loop.stepper()((1.0, 2.0, 0.0, 3.0))[0] == 3.0


def test_shared_code_may_call_shared_code():
    def outer(x):
        inner = compiled_once("inner", lambda y: (sin(y[0]) + y[1],), (x[0], x[1]))[0]
        return (
            compiled_once("inner", lambda y: (sin(y[0]) + y[1],), (inner, x[0]))[0],
        )

    def step(carry, parameters, row, draws):
        once = compiled_once("outer", outer, carry)[0]
        return (compiled_once("outer", outer, (once, carry[0]))[0], once), ()

    shared, plain = (traced(step, loops=kept) for kept in (True, False))
    assert functions(shared) == 2
    carry = np.array([[0.3, -2.0], [1.1, 0.7]])
    runs = [
        Kernel(loop, Lanes(2)).run(carry, np.zeros((1, 2)), np.zeros((3, 1)))[0]
        for loop in (shared, plain)
    ]
    assert same_bits(*runs)


def test_operations_count_shared_code_as_often_as_it_runs():
    def step(carry, parameters, row, draws):
        def once(x):
            return compiled_once("sine", lambda y: (sin(y[0]) * y[1],), (x[0], row[0]))

        return (repeat(50, once, (carry[0],))[0], once(carry[1:])[0]), ()

    shared, plain = (
        operations(traced(step, loops=kept).program.nodes) for kept in (True, False)
    )
    assert shared == pytest.approx(plain, rel=0.1)
    assert operations(traced(step).program.nodes, written=True) < 0.1 * plain


def test_equal_vehicles_share_the_code_of_their_law_and_their_dynamics():
    one = skyarm.load_scenario("case3", duration=0.1)
    sizes = []
    for count in (1, 2, 3):
        team = (
            dataclasses.replace(one, agents={f"a{i}": one.agent for i in range(count)})
            if count > 1
            else one
        )
        text = assembly(EpisodeCode(team).loop, Lanes(1), logging=True)
        sizes.append((text.count("define internal void @shared"), len(text)))
    assert [functions for functions, _ in sizes] == [0, 2, 2]
    for safe in (False, True):
        tables = tomllib.loads((TEAMS / "bar.toml").read_text("utf-8"))
        tables["controller"] |= {"safety": True} if safe else {}
        text = assembly(
            EpisodeCode(skyarm.scenario_from(tables, TEAMS)).loop,
            Lanes(1),
            logging=True,
        )
        assert text.count("define internal void @shared") == 2, (
            "law with its safety layer, dynamics"
        )
    assert sizes[1][1] < 1.7 * sizes[0][1]
    assert sizes[2][1] < 2.35 * sizes[0][1]


def test_a_function_that_passes_on_a_symbol_of_another_trace_is_refused():
    def step(carry, parameters, row, draws):
        return (compiled_once("p", lambda x: (x[0] * 2.0, row[0]), (carry[0],))), ()

    with pytest.raises(TypeError, match="pass it as an argument"):
        traced(step)


def test_a_function_may_return_more_than_it_takes():
    def many(x):
        return tuple(x[0] * float(k) for k in range(2, 40))

    def step(carry, parameters, row, draws):
        first, second = (
            compiled_once("m", many, (carry[0],)),
            compiled_once("m", many, (carry[1],)),
        )
        return (first[0], second[0]), (*first, *second)

    loop = traced(step)
    carry = np.random.default_rng(1).normal(size=(2, 8))
    _, log = Kernel(loop, Lanes(8), logging=True).run(
        carry, np.zeros((1, 8)), np.zeros((1, 1))
    )
    expected = np.concatenate(
        [np.outer(np.arange(2.0, 40.0), carry[i]) for i in range(2)]
    )
    np.testing.assert_array_equal(log[0], expected)
    assert "alloca [38 x" in assembly(loop, Lanes(1), logging=True)


def test_a_condition_among_the_arguments_is_written_out():
    def step(carry, parameters, row, draws):
        larger = compiled_once(
            "w",
            lambda x: (where(x[0], x[1], 2.0 * x[1]),),
            (carry[0] < carry[1], carry[0]),
        )[0]
        return (larger, carry[1]), ()

    loop = traced(step)
    assert functions(loop) == 0
    assert loop.stepper()((3.0, 2.0, 0.0, 0.0))[0] == 6.0
    assert (
        Kernel(loop, Lanes(1)).run(
            np.array([[3.0], [2.0]]), np.zeros((1, 1)), np.zeros((1, 1))
        )[0][0, 0]
        == 6.0
    )


def seldom(carry, parameters, row, draws):
    """Calls where a number is positive: before the steps, in a step, in a loop."""

    def call(a, b):
        function = lambda x: (sin(x[0]) * x[1], 1.0, x[1])  # noqa: E731
        return compiled_once("s", function, (a, b), only=(a > 0.0, (b, a, a)))

    fixed = call(parameters[0], parameters[0])
    first = call(carry[0], row[0])
    last = repeat(5, lambda y: (call(y[0], y[1])[0] - 0.1, y[0]), carry)
    return (first[0] + last[0], last[1]), (*fixed, *first)


@pytest.mark.parametrize("single", [False, True])
def test_a_call_that_a_lane_needs_changes_no_other(single):
    shared, plain = (traced(seldom, loops=kept) for kept in (True, False))
    rng = np.random.default_rng(8)
    for sign in (-1.0, 0.0, 1.0):
        drawn = rng.normal(size=(4, 13))
        drawn = np.abs(drawn) * sign if sign else drawn
        given = drawn[:2], drawn[2:3], drawn[3:, :6].T
        logs = [
            Kernel(loop, Lanes(4, single=single), logging=True).run(*given)
            for loop in (shared, plain)
        ]
        assert same_bits(logs[0][0], logs[1][0])
        assert same_bits(logs[0][1], logs[1][1])
        point = drawn[:, 0].tolist()
        direct = seldom(point[:2], point[2:3], point[3:], ())
        assert bits(shared.stepper()(point)) == bits((*direct[0], *direct[1]))


def test_a_call_that_no_lane_needs_is_jumped_over():
    text = assembly(traced(seldom), Lanes(4), logging=True)
    jumps = re.findall(
        r"br i1 %\w+, label %(r\d+), label %\1.exit\n\1:"
        r"(?:\n  (?:%\w+ = getelementptr|store).*)*\n  call void @shared1",
        text,
    )
    assert len(jumps) == text.count("call void @shared1") == 3
