"""A function of numbers, called often: machine code, or straight-line Python where none can be made."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.llvm.stepper import Stepper
from skyarm.compile.machine_code import NoMachineCodeError
from skyarm.compile.tracing.stepped_loop import Loop, trace_loop
from skyarm.records.leaves import rebuild

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
        self._result: Any = None
        loop = trace_loop(lambda _carry, _parameters, row, _uniforms: ((), function(*row)), (), (), examples)
        self.inputs: Array
        self.outputs: Array
        self.step: Callable[[], None]
        self._result = loop.result[1]
        try:
            # what is called once a step is worth its making: all of LLVM's effort
            stepper = Stepper(Kernel(loop, Lanes(1), logging=True), np.zeros(0))
        except NoMachineCodeError:
            self.inputs, self.outputs = np.zeros(loop.row), np.zeros(loop.logged)
            self.step = self._in_python(loop)
        else:
            self.inputs, self.outputs, self.step = stepper.row, stepper.output, stepper.step

    def shaped(self) -> Any:
        """The outputs as the record that the function returns."""
        return rebuild(self._result, iter(self.outputs.tolist()))

    def _in_python(self, loop: Loop) -> Callable[[], None]:
        program, inputs, outputs = loop.stepper(), self.inputs, self.outputs

        def step() -> None:
            outputs[:] = program(inputs.tolist())

        return step
