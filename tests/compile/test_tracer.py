"""The tracer shares and folds, refuses branches by file and line, and copes with long
programs.
"""

from __future__ import annotations

import dataclasses
import gc
import math
import sys
import weakref

import numpy as np
import pytest

from skyarm.algebra import Vec3, scalars
from skyarm.compile import Graph, TracedBranchError, trace
from skyarm.compile.tracing.program import trace_loop
from skyarm.compile.tracing.tracer import pause_collection


def line_of(function, offset):
    code = function.__code__
    return rf"{code.co_filename}:{code.co_firstlineno + offset}: "


def branch_if(x):
    if x > 0.0:
        return x
    return -x


def branch_max(x):
    return max(x, 0.0)


def branch_and(x):
    return scalars.where(x > 0.0 and x < 1.0, x, 0.0)


def branch_while(x):
    while x < 10.0:
        x = x * 2.0
    return x


def branch_vector(x):
    y = Vec3(x, 0.0, 0.0)
    return x if y == Vec3(0.0, 0.0, 0.0) else -x


def branch_equal(x):
    return 1.0 if x == 0.0 else x


def branch_nan(x):
    return x if x != x else 0.0  # noqa: PLR0124  the old test for NaN


@pytest.mark.parametrize(
    ("function", "offset"),
    [
        (branch_if, 1),
        (branch_max, 1),
        (branch_and, 1),
        (branch_while, 1),
        (branch_vector, 2),
        (branch_equal, 1),
        (branch_nan, 1),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_a_branch_on_a_traced_value_is_refused_with_file_and_line(function, offset):
    with pytest.raises(
        TracedBranchError, match=line_of(function, offset) + ".*traced value"
    ):
        trace(function, 1.0)


def use_math(x):
    return math.sin(x)


def use_round(x):
    return np.array([0.0]) + float(x)


@pytest.mark.parametrize("function", [use_math, use_round])
def test_a_traced_value_taken_for_a_float_is_refused_with_file_and_line(function):
    with pytest.raises(
        TracedBranchError, match=line_of(function, 1) + r"float\(\) of a traced value"
    ):
        trace(function, 1.0)


def test_a_value_of_another_trace_is_refused():
    kept = []
    trace(lambda x: kept.append(x) or x, 1.0)
    with pytest.raises(TypeError, match="another trace"):
        trace(lambda x: x + kept[0], 1.0)


def test_equal_expressions_are_computed_once():
    program = trace(
        lambda x, y: (
            scalars.sin(x + y) * x,
            scalars.sin(y + x) * x,
            x * scalars.sin(x + y),
        ),
        1.0,
        1.0,
    )
    assert program.operations() == {"add": 1, "sin": 1, "mul": 1}
    assert program(0.3, 0.4) == (math.sin(0.7) * 0.3,) * 3


def test_signs_share_their_product_and_their_sum():
    program = trace(
        lambda x, y: (
            (-x) * y,
            x * (-y),
            x * y,
            (-x) * (-y),
            x + (-y),
            x - y,
            scalars.neg(-x),
        ),
        1.0,
        1.0,
    )
    assert program.operations() == {"mul": 1, "neg": 1, "sub": 1}
    assert program(2.0, 3.0) == (-6.0, -6.0, 6.0, 6.0, -1.0, -1.0, 2.0)


def test_differences_are_not_commuted():
    program = trace(
        lambda x, y: (x - y, y - x, scalars.divide(x, y), scalars.divide(y, x)),
        1.0,
        1.0,
    )
    assert program(2.0, 4.0) == (-2.0, 2.0, 0.5, 2.0)
    assert sum(program.operations().values()) == 4


def test_constants_are_computed_while_tracing():
    program = trace(
        lambda x: x + scalars.sin(0.5) * 2.0 - scalars.divide(1.0, 0.0), 1.0
    )
    assert program.operations() == {"add": 1, "sub": 1}
    graph = Graph()
    assert graph.call("div", graph.constant(1.0), 0.0).value == math.inf
    assert graph.call("where", True, graph.input("a"), 2.0).op == "input"
    assert math.isnan(graph.call("sqrt", -1.0).value)
    assert [graph.call("lt", 1.0, b).value for b in (0.0, 1.0, 2.0)] == [
        False,
        False,
        True,
    ]
    assert [graph.call("le", 1.0, b).value for b in (0.0, 1.0, 2.0)] == [
        False,
        True,
        True,
    ]
    assert [graph.call(op, True, False).value for op in ("and", "or")] == [False, True]
    assert graph.call("not", True).value is False


def test_a_choice_between_two_equals_is_none():
    program = trace(
        lambda x, y: (scalars.where(x > y, x * y, y * x), scalars.where(x > y, x, y)),
        1.0,
        1.0,
    )
    assert program.operations() == {"mul": 1, "lt": 1, "where": 1}
    assert [program(2.0, y) for y in (3.0, 1.0)] == [(6.0, 3.0), (2.0, 2.0)]


def test_data_zeros_and_ones_are_not_folded():
    program = trace(lambda x: (x * 0.0, x * 1.0, x + 0.0), 1.0)
    assert program.operations() == {"mul": 2, "add": 1}
    assert math.isnan(program(math.inf)[0])
    assert math.copysign(1.0, program(-1.0)[0]) == -1.0
    assert math.copysign(1.0, program(-0.0)[2]) == 1.0


def test_zeros_of_both_signs_are_two_constants():
    program = trace(lambda x: (scalars.atan2(x, 0.0), scalars.atan2(x, -0.0)), 1.0)
    assert program(0.0) == (0.0, math.pi)


def test_unused_work_is_left_out():
    program = trace(lambda x, y: (scalars.exp(x) * 0.5, x + 1.0)[1], 1.0, 2.0)
    assert program.operations() == {"add": 1}
    assert program(1.0, math.nan) == 2.0


def test_a_numpy_constant_on_the_left_becomes_part_of_the_program():
    program = trace(
        lambda x: (np.float64(2.0) * x, np.float64(2.0) - x, np.float64(1.0) / x), 1.0
    )
    assert program(4.0) == (8.0, -2.0, 0.25)
    assert (
        trace(lambda x: scalars.where(np.float64(0.5) < x, 1.0, 0.0), 1.0)(0.7) == 1.0
    )


def test_twenty_thousand_operations_in_a_row_compile():
    count = 20_000
    assert count > 10 * sys.getrecursionlimit()

    def long(x):
        for i in range(count // 2):
            x = x * 0.999 + (0.001 if i % 2 else -0.001)
        return x

    program = trace(long, 1.0)
    assert sum(program.operations().values()) == count
    assert program(0.3) == long(0.3)


@pytest.mark.parametrize(
    ("function", "x"),
    [
        (lambda x: (scalars.divide(1.0, x), x + 1.0), 0.0),
        (lambda x: (scalars.divide(1.0, x), x + 1.0), -0.0),
        (lambda x: (1.0 / scalars.mul(x, 1.0), x + 1.0), 2.0),
        (lambda x: (scalars.sqrt(x), x + 1.0), -1.0),
        (lambda x: (scalars.log(x), scalars.exp(-x)), -1000.0),
        (lambda x: (scalars.sin(x), scalars.acos(x)), math.inf),
        (lambda x: (scalars.where(x > 0.0, scalars.sqrt(x), 0.0), x), -4.0),
        (lambda x: (scalars.floor(x), scalars.tanh(x)), math.nan),
    ],
)
def test_a_program_gives_inf_or_nan_where_python_would_raise(function, x):
    program = trace(function, 1.0)
    for _ in range(2):  # the second call finds the IEEE version ready
        assert np.array_equal(
            np.array(program(x)), np.array(function(x)), equal_nan=True
        )
        assert [math.copysign(1.0, y) for y in program(x) if not math.isnan(y)] == [
            math.copysign(1.0, y) for y in function(x) if not math.isnan(y)
        ]
    assert program.flat((0.5,)) == tuple(function(0.5))  # and goes back to the fast one


def test_a_raw_division_by_zero_in_a_program_is_ieee_too():
    program = trace(lambda x, y: x / y, 1.0, 1.0)
    assert program(1.0, 0.0) == math.inf
    assert program(-1.0, 0.0) == -math.inf
    assert math.isnan(program(0.0, 0.0))


def test_programs_without_inputs_or_operations_work():
    assert trace(lambda: (1.5, 2)).flat(()) == (1.5,)
    assert trace(lambda: (1.5, 2))() == (1.5, 2)
    assert trace(lambda x: x, 1.0)(7.0) == 7.0
    assert trace(lambda x: (x, 3, math.inf, -math.inf), 1.0)(7.0) == (
        7.0,
        3,
        math.inf,
        -math.inf,
    )
    assert math.isnan(trace(lambda x: (math.nan, x), 1.0)(7.0)[0])


@dataclasses.dataclass(frozen=True)
class Pair:
    first: object
    second: object


def test_an_integer_example_is_structure_and_folds():
    program = trace(lambda p: scalars.mul(p.first, p.second), Pair(0, 1.0))
    assert sum(program.operations().values()) == 0
    assert len(program.inputs) == 1
    assert program(Pair(0, 3.0)) == 0


@pytest.mark.parametrize(
    ("record", "where"),
    [
        (Pair(0.5, 3.0), r"arguments\[0\].first is 0.5, not 0"),
        (Pair(0.0, 3.0), r"arguments\[0\].first is 0.0, not 0"),
        (Pair(False, 3.0), r"arguments\[0\].first is False, not 0"),
        (Pair(1, 3.0), r"arguments\[0\].first is 1, not 0"),
        (Pair(0, 3), r"arguments\[0\].second is 3, not 1.0"),
        (Pair(0, (1.0, 2.0)), r"arguments\[0\].second is"),
        (Vec3(0, 1.0, 2.0), r"arguments\[0\] is Vec3"),
        ((0, 1.0), r"arguments\[0\] is \(0, 1.0\)"),
    ],
)
def test_a_swept_structural_zero_is_refused_with_its_place_as_it_needs_a_new_trace(
    record, where
):
    program = trace(lambda p: scalars.add(p.first, p.second), Pair(0, 1.0))
    with pytest.raises(ValueError, match=where + ".*trace again"):
        program(record)
    with pytest.raises(ValueError, match="unpack"):
        program.flat((1.0, 2.0))


def test_too_few_or_too_many_arguments_are_refused():
    program = trace(lambda x, y: x + y, 1.0, 1.0)
    for arguments in ((1.0,), (1.0, 2.0, 3.0)):
        with pytest.raises(ValueError, match="arguments is"):
            program(*arguments)


def test_a_truth_value_of_numpy_is_one():
    """A comparison of NumPy's scalars, as gains of a law often are, is folded before
    the tracer sees it.
    """
    program = trace(
        lambda x: scalars.where(
            scalars.logical_and(x > 0.0, np.float64(1.0) < np.float64(2.0)), 1.0, 2.0
        ),
        0.5,
    )
    assert (program.flat((0.5,)), program.flat((-0.5,))) == ((1.0,), (2.0,))
    constants = [node.value for node in program.nodes if node.op == "const"]
    assert all(type(value) in (bool, float) for value in constants)
    graph = Graph()
    assert graph.constant(np.bool_(True)) is graph.constant(True)
    assert graph.constant(np.float64(1.0)) is graph.constant(1.0)


def test_a_program_goes_as_soon_as_nobody_has_it_without_a_collection():
    for make in (
        lambda: trace(lambda x: x * x + 1.0, 2.0),
        lambda: trace(lambda x: x * x + 1.0, 2.0).lowered,
        lambda: trace_loop(lambda x, *_: (x * x, ()), 2.0, (), ()).program,
    ):
        with pause_collection():
            made = make()
            graph = weakref.ref(made.inputs[0].graph)
            assert graph() is not None
            del made
            assert graph() is None


def test_threads_that_trace_at_once_leave_the_garbage_collector_on():
    assert gc.isenabled()
    first, second = pause_collection(), pause_collection()
    first.__enter__()
    second.__enter__()
    first.__exit__(None, None, None)
    assert not gc.isenabled()
    second.__exit__(None, None, None)
    assert gc.isenabled()


@pytest.mark.parametrize("collects", [True, False])
def test_the_garbage_collector_rests_while_a_function_is_traced_and_no_longer(collects):
    def function(x):
        assert not gc.isenabled()
        return branch_if(x) if fails else x

    was = gc.isenabled()
    try:
        (gc.enable if collects else gc.disable)()
        fails = False
        trace(function, 1.0)
        assert gc.isenabled() is collects
        fails = True
        with pytest.raises(TracedBranchError):
            trace(function, 1.0)
        assert gc.isenabled() is collects
    finally:
        (gc.enable if was else gc.disable)()
