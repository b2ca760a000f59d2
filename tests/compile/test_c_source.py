"""C99 text of a program gives the bits of the program: random ones, special values, any
flags.
"""

from __future__ import annotations

import ctypes
import math
import struct
import subprocess

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from operation_programs import (
    BINARY,
    COMPARE,
    INPUTS,
    SPECIAL,
    UNARY,
    bits,
    run,
    step,
    value,
)

from skyarm.algebra import scalars
from skyarm.algebra.scalars import floats
from skyarm.compile import Graph, trace
from skyarm.compile.c_source import Floats, make_struct
from skyarm.compile.tracing.lower import live, lower
from skyarm.compile.tracing.tracer import CONDITIONS, is_condition
from skyarm.records.immutable import immutable
from support.engines import (
    CAREFUL,
    CC,
    LIBM,
    c_function,
    library,
    needs_cc,
    object_file,
    undefined,
)

pytestmark = needs_cc
NO_CONTRACTION = ("-O1", "-ffp-contract=off")


def call(loaded, name, inputs, count, kind=ctypes.c_double):
    x, y = (kind * max(1, len(inputs)))(*inputs), (kind * max(1, count))()
    getattr(loaded, name)(x, y)
    return list(y)[:count]


def traced(steps, constants):
    return trace(lambda *x: run(steps, constants, x), *(0.5 for _ in range(INPUTS)))


program = st.tuples(
    st.lists(step, min_size=1, max_size=25),
    st.lists(value, min_size=2, max_size=2),
    st.lists(st.lists(value, min_size=INPUTS, max_size=INPUTS), min_size=1, max_size=4),
)


@settings(
    max_examples=8,
    deadline=None,
    suppress_health_check=list(HealthCheck),
    # to shrink is to compile hundreds of times
    phases=(Phase.explicit, Phase.reuse, Phase.generate),
)
@given(st.lists(program, min_size=20, max_size=30))
def test_random_programs_in_c_have_the_bits_of_their_functions(
    tmp_path_factory, programs
):
    """Many programs a compilation, as the compiler's start takes longest."""
    built = [traced(steps, constants) for steps, constants, _ in programs]
    text = "\n".join(c_function(each.lowered, f"p{i}") for i, each in enumerate(built))
    loaded = library(text, tmp_path_factory.mktemp("c"), NO_CONTRACTION)
    for i, (each, (steps, constants, lanes)) in enumerate(
        zip(built, programs, strict=True)
    ):
        for lane in lanes:
            expected = run(steps, constants, lane)
            found = each.record(call(loaded, f"p{i}", lane, len(each.outputs)))
            assert [bits(float(y)) for y in found] == [bits(float(y)) for y in expected]


def every_operation():
    steps = [("binary", name, 0, 1) for name in sorted(BINARY)] + [
        ("unary", name, 0) for name in sorted(UNARY)
    ]
    steps += [("compare", name, 0, 1) for name in sorted(COMPARE)]
    steps += [("logic", word, 1, 2) for word in ("and", "or", "not")] + [
        ("where", c, 0, 1) for c in range(8)
    ]
    return steps, [1.5, -0.0]


@pytest.mark.parametrize(
    "flags",
    [
        ("-O0",),
        ("-O2",),
        # the file switches contraction off
        ("-O3", "-march=native", "-ffp-contract=fast"),
    ],
    ids=" ".join,
)
def test_every_operation_at_all_special_values_has_the_bits_whatever_the_flags(
    tmp_path, flags
):
    steps, constants = every_operation()
    built = traced(steps, constants)
    loaded = library(c_function(built.lowered, "p"), tmp_path, flags)
    ordinary = [0.3, -2.7, 1e5, 3e-310, 700.0, -745.1, 1e300]
    for a in SPECIAL + ordinary:
        for b in SPECIAL + ordinary:
            expected = run(steps, constants, (a, b, 1.0))
            found = built.record(call(loaded, "p", (a, b, 1.0), len(built.outputs)))
            assert [bits(float(y)) for y in found] == [
                bits(float(y)) for y in expected
            ], (a, b)


FAST = (
    "-ffast-math",
    "-Ofast",
    "-ffinite-math-only",
    "-funsafe-math-optimizations",
    "-freciprocal-math",
)


@pytest.mark.parametrize("flag", [*FAST, "-D_M_FP_FAST"])
def test_a_build_that_would_lose_nan_or_rounding_ends_in_an_error_with_the_flag(
    tmp_path, flag
):
    steps, constants = every_operation()
    text = c_function(traced(steps, constants).lowered, "p")
    (tmp_path / "p.c").write_text(text)
    compiler = [CC, "-std=c99", "-O2", flag, "-c", "p.c", "-o", "p.o"]
    done = subprocess.run(
        compiler, cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode != 0
    assert (
        "compile without -ffast-math, -ffinite-math-only, -funsafe-math-optimizations"
        in done.stderr
    )


BITS = ("power_of_two", "exponent", "mantissa")


def bit_program():
    graph = Graph()
    x = graph.input("x")
    outputs = [graph.call(name, x) for name in BITS]
    return lower([x], live(outputs), outputs)


def test_powers_exponents_and_mantissas_are_exact_for_every_exponent_and_subnormals(
    tmp_path,
):
    loaded = library(c_function(bit_program(), "p"), tmp_path)
    # above, 2**k leaves the doubles and Python raises
    whole = [float(k) for k in range(-1200, 1024)]
    numbers = [math.ldexp(m, k) for k in range(-1074, 1024) for m in (1.0, -1.37)]
    for x in (*whole, *numbers, *SPECIAL):
        if 1024.0 <= x <= 1100.0:
            continue
        expected = [getattr(floats, name)(x) for name in BITS]
        assert [bits(y) for y in call(loaded, "p", [x], 3)] == [
            bits(y) for y in expected
        ], x


def test_a_power_beyond_the_doubles_is_infinite_and_of_no_number_is_nan(tmp_path):
    """Python's ldexp raises there; C must not run into an undefined conversion
    either.
    """
    checks = (
        "-fsanitize=undefined,float-cast-overflow",
        "-fsanitize-undefined-trap-on-error",
    )
    loaded = library(c_function(bit_program(), "p"), tmp_path, ("-O1", *checks))
    assert call(loaded, "p", [1030.0], 3)[0] == math.inf
    for x in (math.nan, math.inf, -math.inf, 1e300, -1e300):
        assert math.isnan(call(loaded, "p", [x], 3)[0])


def single_precision(lowered, inputs):
    """A lowered program node by node on NumPy's float32: IEEE arithmetic that shares no
    code with the C text.
    """
    f32 = np.float32
    table = {
        **{
            "add": np.add,
            "sub": np.subtract,
            "mul": np.multiply,
            "div": np.divide,
            "neg": np.negative,
            "abs": np.abs,
        },
        **{
            "sqrt": np.sqrt,
            "floor": np.floor,
            "copysign": np.copysign,
            "lt": np.less,
            "le": np.less_equal,
        },
        **{
            "and": np.logical_and,
            "or": np.logical_or,
            "not": np.logical_not,
            "where": np.where,
        },
        "power_of_two": lambda k: (
            np.ldexp(f32(1), np.int32(k)) if abs(k) < 1100 else f32(np.nan)
        ),
        "exponent": lambda x: (
            f32(np.frexp(x)[1] - 1) if np.isfinite(x) and x != 0 else f32(np.nan)
        ),
        "mantissa": lambda x: (
            f32(2) * np.frexp(x)[0] if np.isfinite(x) and x != 0 else f32(np.nan)
        ),
    }
    known = dict(
        zip((node.index for node in lowered.inputs), map(f32, inputs), strict=True)
    )
    with np.errstate(all="ignore"):
        for node in lowered.nodes:
            if node.op == "const":
                known[node.index] = (
                    node.value if isinstance(node.value, bool) else f32(node.value)
                )
            elif node.op != "input":
                known[node.index] = table[node.op](
                    *(known[arg.index] for arg in node.args)
                )
    return [float(known[node.index]) for node in lowered.outputs]


def test_single_precision_has_the_bits_of_float32_arithmetic(tmp_path):
    steps, constants = every_operation()
    built = traced(steps, constants)
    text = c_function(built.lowered, "p", single=True)
    assert "double" not in text
    loaded = library(text, tmp_path)
    rng = np.random.default_rng(3)
    ordinary = [0.3, -2.7, 88.5, -104.0, 1e-40, *rng.normal(size=5).tolist()]
    for a in SPECIAL + ordinary:
        for b in SPECIAL + ordinary:
            lane = [ctypes.c_float(v).value for v in (a, b, 1.0)]
            found = call(loaded, "p", lane, len(built.outputs), ctypes.c_float)
            assert [bits(y) for y in found] == [
                bits(y) for y in single_precision(built.lowered, lane)
            ], (a, b)


@pytest.mark.parametrize("single", [False, True])
def test_strict_warnings_find_nothing_and_only_libm_is_needed(tmp_path, single):
    built = traced(*every_operation())
    target = object_file(
        c_function(built.lowered, "p", single=single), tmp_path, ("-O2", *CAREFUL)
    )
    assert undefined(target) <= LIBM


def test_constants_conditions_and_inputs_may_be_outputs_and_inputs_may_be_unused(
    tmp_path,
):
    def function(a, b):
        return (
            a,
            2.5,
            a < b,
            math.inf,
            -math.inf,
            math.nan,
            -0.0,
            scalars.where(a < b, a < 0.5, b < 0.5),
        )

    built = trace(function, 0.5, 0.5)
    loaded = library(c_function(built.lowered, "p"), tmp_path, ("-O2", *CAREFUL))
    found = call(loaded, "p", [0.25, 1.0], 8)
    assert list(map(bits, found)) == list(
        map(bits, [0.25, 2.5, 1.0, math.inf, -math.inf, math.nan, -0.0, 1.0])
    )
    constant = trace(lambda a: (1.0,), 0.5)
    assert call(
        library(c_function(constant.lowered, "q"), tmp_path, name="constant"),
        "q",
        [0.0],
        1,
    ) == [1.0]


def test_outputs_may_overwrite_inputs(tmp_path):
    """Memory is updated in place: everything is read before anything is written."""
    swapped = trace(lambda a, b, c: (b, c, a), 0.5, 0.5, 0.5)
    loaded = library(c_function(swapped.lowered, "p"), tmp_path)
    place = (ctypes.c_double * 3)(1.0, 2.0, 3.0)
    loaded.p(place, place)
    assert list(place) == [2.0, 3.0, 1.0]


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_literal_reads_back_as_itself(x):
    text = Floats().literal(x)
    assert struct.pack("<d", float(text.strip("()"))) == struct.pack("<d", x)
    assert set(text) & set(".e"), (
        "an integer would make the arithmetic of C an integer's"
    )


@given(st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_a_single_literal_reads_back_as_itself(x):
    text = Floats(single=True).literal(x).strip("()")
    assert text.endswith("f")
    assert struct.pack("<f", float(text[:-1])) == struct.pack("<f", x)


def test_a_number_too_large_for_a_float_is_infinite():
    assert Floats(single=True).literal(1e300) == "(float)INFINITY"
    assert Floats(single=True).literal(-1e300) == "(-(float)INFINITY)"


def test_every_basic_operation_is_in_the_test_program():
    ops = {node.op for node in traced(*every_operation()).lowered.nodes}
    basic = (
        "add sub mul div neg lt le where and or not abs sqrt floor copysign"
        " power_of_two exponent mantissa"
    )
    assert set(basic.split()) <= ops
    assert ops >= CONDITIONS


@immutable
class Sent:
    """Commands of two periods."""

    efforts: tuple[tuple[float, ...], ...]
    speeds: tuple[tuple[float, ...], ...]


def test_rows_without_numbers_are_no_members_of_a_struct():
    """C99 knows no array without elements: the efforts of a vehicle without joints."""
    struct = make_struct(
        Sent(efforts=((), ()), speeds=((1.0, 2.0),)), ".".join, [True] * 2
    )
    assert [(member.name, member.shape) for member in struct.members] == [
        ("speeds", (1, 2))
    ]
    assert struct.places == ("speeds[0][0]", "speeds[0][1]")


def test_choices_within_choices_are_written_however_deep():
    def deep(c, y):
        found = c * y
        for k in range(1500):
            found = scalars.where(c > float(k), found, y)
        return found

    program = trace(deep, 0.0, 0.0)
    assert len(program.nodes) > 1500
    assert is_condition(program.nodes[-1]) is False
