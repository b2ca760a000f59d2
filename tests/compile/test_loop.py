"""A stepped program: what it keeps of the function it was traced from."""

from __future__ import annotations

import platform

import numpy as np
import pytest
from programs_random import bits, oscillator

from skyarm.algebra.scalars.elementary import COMPOSED
from skyarm.compile.llvm.llvm_loop import assembly
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.lower import lower
from skyarm.compile.tracing.program import trace_loop
from skyarm.compile.tracing.tracer import FOLD, Graph

BASIC = set(FOLD) - set(COMPOSED) | {"input", "const"}


def test_a_step_in_python_is_the_function_itself():
    loop = trace_loop(oscillator, (0.0, 0.0), (0.0,), (0.0,), ((0, 2),))
    step = loop.stepper()
    rng = np.random.default_rng(1)
    for x, v, k, f, a, b in rng.normal(size=(50, 6)).tolist():
        carry, log = oscillator((x, v), (k,), (f,), (a, b))
        assert bits(step((x, v, k, f, a, b))) == bits((*carry, *log))


def test_a_loop_counts_its_inputs_and_outputs():
    loop = trace_loop(oscillator, (0.0, 0.0), (0.0,), (0.0,), ((0, 2), (4, 1)))
    assert (loop.carry, loop.parameters, loop.row, loop.logged) == (2, 1, 1, 1)
    assert loop.uniforms == ((0, 2), (4, 1))
    assert len(loop.program.inputs) == 2 + 1 + 1 + 3


def test_a_carry_of_another_size_is_refused():
    with pytest.raises(
        ValueError, match="returns another carry than it takes: carry is "
    ):
        trace_loop(lambda c, p, r, u: ((c[0],), ()), (0.0, 0.0), (), ())


@pytest.mark.parametrize(
    ("first", "then"),
    [((0, 1.0), lambda c: (c[1] + 0.5, 1)), ((0.0, 1), lambda c: (1, c[0]))],
)
def test_a_carry_of_as_many_scalars_in_other_places_is_refused(first, then):
    """Else one state's numbers were handed to another: a law flew with them and no
    error.
    """
    with pytest.raises(ValueError, match=r"takes: carry\[0\] is "):
        trace_loop(lambda c, p, r, u: (then(c), ()), first, (), ())


def test_a_lowered_program_holds_basic_operations_only():
    graph = Graph()
    x, y = graph.input("x"), graph.input("y")
    outputs = [
        graph.call(name, x, y) if name == "atan2" else graph.call(name, x)
        for name in sorted(COMPOSED)
    ]
    program = lower([x, y], graph.nodes, outputs)
    assert {node.op for node in program.nodes} <= BASIC
    assert len(program.outputs) == len(COMPOSED)


def test_a_lowered_program_holds_nothing_that_its_outputs_do_not_need():
    graph = Graph()
    x = graph.input("x")
    graph.call("sin", x)
    program = lower([x], graph.nodes, [graph.call("sqrt", x)])
    assert [node.op for node in program.nodes] == ["input", "sqrt"]


def test_angles_shared_by_sine_and_cosine_are_reduced_once():
    graph = Graph()
    x = graph.input("x")
    sine, cosine = graph.call("sin", x), graph.call("cos", x)
    both, one = lower([x], graph.nodes, [sine, cosine]), lower([x], graph.nodes, [sine])
    assert len(both.nodes) - len(one.nodes) < 12


@pytest.mark.skipif(
    platform.machine() not in ("x86_64", "AMD64"), reason="reads instructions of x86"
)
def test_vectors_that_lie_on_the_stack_lie_on_whole_lines_of_the_cache():
    import llvmlite.binding as llvm

    def many(carry, parameters, row, uniforms):
        held = [carry[k] * carry[(k + 1) % 64] for k in range(64)]
        return tuple(sum(held[k:] + held[: k + 1]) for k in range(64)), ()

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    text = assembly(trace_loop(many, (0.5,) * 64, (), ()), Lanes(8), logging=False)
    machine = llvm.Target.from_triple("x86_64-unknown-linux-gnu").create_target_machine(
        cpu="skylake-avx512", opt=2
    )
    lines = machine.emit_assembly(llvm.parse_assembly(text)).splitlines()
    on_stack = [
        line.split()[0]
        for line in lines
        if "zmm" in line and "(%rsp)" in line and line.strip()[:4] == "vmov"
    ]
    assert len(on_stack) > 64
    assert set(on_stack) <= {"vmovaps", "vmovapd"}
