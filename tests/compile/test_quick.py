"""A function called often: machine code and Python give the same numbers, in place."""

from __future__ import annotations

import math
import weakref
from typing import Any

import numpy as np
import pytest

from skyarm.algebra import Vec3
from skyarm.algebra.scalars import cos, sqrt, where
from skyarm.compile import trace
from skyarm.compile.llvm import lane_stepper as quick
from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.lane_stepper import Quick, Stepper
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.machine_code import NoMachineCodeError
from skyarm.compile.tracing.program import trace_loop
from skyarm.compile.tracing.tracer import pause_collection


def law(v: Vec3, pair: tuple[Any, Any]) -> tuple[Any, ...]:
    a, b = pair
    return v.dot(v), cos(a) / b, where(a < b, sqrt(b), -a), 2.5, v.x


EXAMPLES = (Vec3(0.0, 0.0, 0.0), (0.0, 0.0))
NUMBERS = [
    [0.1, -2.0, 3.5, 0.7, 1.9],
    [1e200, 1e200, 0.0, 5.0, 0.0],  # overflow and a division by zero
    [math.nan, 1.0, -0.0, -1.0, -4.0],
]


@pytest.fixture(params=["machine code", "python"])
def made(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Quick:
    if request.param == "python":

        def refuse(*_: Any, **__: Any) -> None:
            raise NoMachineCodeError

        monkeypatch.setattr(quick, "Kernel", refuse)
    return Quick(law, *EXAMPLES)


def test_it_gives_the_bits_of_the_traced_program(made: Quick) -> None:
    program = trace(law, *EXAMPLES)
    for numbers in NUMBERS:
        made.inputs[:] = numbers
        made.step()
        assert repr(made.outputs.tolist()) == repr(list(program.flat(numbers)))


def test_inputs_and_outputs_stay_where_they_are(made: Quick) -> None:
    inputs, outputs = made.inputs, made.outputs
    inputs[:] = NUMBERS[0]
    made.step()
    assert outputs[4] == 0.1
    inputs[0] = 7.0
    made.step()
    assert outputs[4] == 7.0
    assert np.array_equal(inputs, [7.0, *NUMBERS[0][1:]])


def test_a_step_keeps_what_it_needs_and_goes_with_its_last_reference() -> None:
    """Without a collection: its log, of a whole flight, would wait for one."""
    loop = trace_loop(lambda carry, _, row, __: (carry + row, carry), 1.0, (), 2.0)
    with pause_collection():
        kernel = Kernel(loop, Lanes(1), logging=True)
        stepper = Stepper(kernel, np.ones(1))
        rows, log = np.full((3, 1), 2.0), np.zeros((3, 1))
        stepper.read_tables(rows, log)
        kept = [weakref.ref(each) for each in (rows, log, stepper.carry, kernel)]
        step, carry = stepper.step, stepper.carry
        del stepper, rows, log, kernel
        assert all(each() is not None for each in kept)
        step()
        assert carry[0] == 3.0
        del step, carry
        assert all(each() is None for each in kept)
