"""A function of numbers, called often: machine code, or straight-line Python where none can be made."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.compile.llvm_text import Lanes
from skyarm.compile.loop import Loop, trace_loop
from skyarm.compile.native import NO_MACHINE_CODE, Kernel, Stepper

Array = npt.NDArray[np.float64]


class Quick:
    """A traced function whose numbers lie in place: write ``inputs``, call ``step``, read ``outputs``.

    Both kinds of code give the same numbers to the last bit. Not for two threads at once.

    Args:
        function: takes records, returns one.
        examples: records whose leaves become the inputs, in order; their integers stay structure.

    Attributes:
        inputs, outputs: leaves of the arguments and of the result. step: evaluates.
    """

    def __init__(self, function: Callable[..., Any], *examples: Any) -> None:
        loop = trace_loop(lambda _carry, _parameters, row, _uniforms: ((), function(*row)), (), (), examples)
        self.inputs: Array
        self.outputs: Array
        self.step: Callable[[], None]
        try:
            # what is called once a step is worth its making: all of LLVM's effort
            stepper = Stepper(Kernel(loop, Lanes(1), logging=True), np.zeros(0))
        except NO_MACHINE_CODE:
            self.inputs, self.outputs = np.zeros(loop.row), np.zeros(loop.logged)
            self.step = self._in_python(loop)
        else:
            self.inputs, self.outputs, self.step = stepper.row, stepper.output, stepper.step

    def _in_python(self, loop: Loop) -> Callable[[], None]:
        program, inputs, outputs = loop.stepper(), self.inputs, self.outputs

        def step() -> None:
            outputs[:] = program(inputs.tolist())

        return step
