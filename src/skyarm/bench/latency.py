"""How long one control step takes when it is asked for alone, as on board."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from skyarm.compile import leaves
from skyarm.compile.llvm_text import Lanes
from skyarm.compile.loop import trace_loop
from skyarm.compile.native import Kernel, Stepper
from skyarm.dynamics.measurement import measurement_of
from skyarm.simulate.inputs import episode_inputs, first_state
from skyarm.simulate.scenario import Scenario


def latency(scenario: Scenario, calls: int) -> dict[str, dict[str, float]]:
    """Microseconds of one control step from Python's clock to Python's clock: median, 99th percentile.

    The clock itself takes part; ``clock`` says how much.
    """
    controller, inputs = scenario.controller, episode_inputs(scenario)
    state = first_state(scenario)
    force = type(state.velocity)(0.0, 0.0, scenario.world.gravity)
    reading = measurement_of(state, force)
    period = 1.0 / scenario.rates.control

    def control(memory: Any, _parameters: Any, row: Any, _uniforms: Any) -> Any:
        return controller.law(memory, row[0], row[1], period, par=controller.par)

    loop = trace_loop(control, controller.memory, (), (reading, inputs.reference_example))
    memory = np.array(leaves(controller.memory), dtype=float)
    row = np.array([*leaves(reading), *inputs.held[0]], dtype=float)
    compiled = Stepper(Kernel(loop, Lanes(1, contract=True), logging=True), memory)
    compiled.row[:] = row
    python, values = loop.stepper(), (*memory.tolist(), *row.tolist())
    return {
        "clock": _percentiles(lambda: None, calls),
        "compiled": _percentiles(compiled.step, calls),
        "python": _percentiles(lambda: python(values), calls // 10),
    }


def _percentiles(call: Callable[[], Any], calls: int) -> dict[str, float]:
    clock = time.perf_counter_ns
    spent = np.empty(calls)
    for k in range(calls):
        begin = clock()
        call()
        spent[k] = clock() - begin
    p50, p99 = (float(value) / 1e3 for value in np.percentile(spent, (50, 99)))
    return {"p50_us": p50, "p99_us": p99}
