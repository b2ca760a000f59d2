"""A function called often: machine code and Python give the same numbers, in place."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from skyarm.algebra import Vec3
from skyarm.algebra.scalars import cos, sqrt, where
from skyarm.compile import trace
from skyarm.compile.llvm import lane_stepper as quick
from skyarm.compile.llvm.lane_stepper import Quick
from skyarm.compile.machine_code import NoMachineCodeError


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
