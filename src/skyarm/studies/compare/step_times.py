"""Duration of a single control step, called alone as on board."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from skyarm.compile import leaves
from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.lane_stepper import Stepper
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.program import trace_loop
from skyarm.scenario.scenario_record import Scenario, first_state
from skyarm.sensing.measurement import measurement_of
from skyarm.simulate.inputs import episode_inputs
from skyarm.simulate.loop import run_in_python


def latency(scenario: Scenario, calls: int) -> dict[str, dict[str, float]]:
    """Microseconds of one control step from Python's clock to Python's clock: median, 99th percentile.

    The clock itself takes part; ``clock`` says how much.
    """
    controller, inputs = scenario.controller, episode_inputs(scenario)
    state = first_state(scenario)
    force = type(state.velocity)(0.0, 0.0, scenario.plant.gravity)
    reading = measurement_of(state, force)
    period = 1.0 / scenario.rates.control

    def control(memory: Any, _parameters: Any, row: Any, _uniforms: Any) -> Any:
        return controller.law(memory, row[0], row[1], period, par=controller.par)

    loop = trace_loop(control, controller.memory, (), (reading, inputs.reference_example))
    memory = np.array(leaves(controller.memory), dtype=float)
    row = np.array([*leaves(reading), *inputs.held_leaves[0]], dtype=float)
    compiled = Stepper(Kernel(loop, Lanes(1, contract=True), logging=True), memory)
    compiled.row[:] = row
    python, values = loop.stepper(), (*memory.tolist(), *row.tolist())
    return {
        "clock": _percentiles(lambda: None, calls),
        "compiled": _percentiles(compiled.step, calls),
        "python": _percentiles(lambda: python(values), calls // 10),
    }


def flown_latency(scenario: Scenario) -> dict[str, Any]:
    """Microseconds of one control step of a law that is called with floats, all through a flight.

    The first step, which makes machine code, is left out. ``solving``: of the steps in which the plan in the law's
    memory is a new one; None for a law without plans.
    """
    controller, clock = scenario.controller, time.perf_counter_ns
    spent: list[int] = []
    solved: list[bool] = []

    def timed_law(memory: Any, *arguments: Any, **constants: Any) -> Any:
        begin = clock()
        following, command = controller.law(memory, *arguments, **constants)
        spent.append(clock() - begin)
        solved.append(getattr(following, "plan", None) is not getattr(memory, "plan", None))
        return following, command

    called = dataclasses.replace(controller, law=timed_law, compiled=False)
    run_in_python(scenario.with_words(controller=called))
    every, solving = np.array(spent[1:], dtype=float), np.array(solved[1:], dtype=bool)
    return {**_spread(every), "solving": _spread(every[solving]) if solving.any() else None}


def _percentiles(call: Callable[[], Any], calls: int) -> dict[str, float]:
    clock = time.perf_counter_ns
    spent = np.empty(calls)
    for k in range(calls):
        begin = clock()
        call()
        spent[k] = clock() - begin
    return _spread(spent)


def _spread(nanoseconds: Any) -> dict[str, float]:
    p50, p99 = (float(value) / 1e3 for value in np.percentile(nanoseconds, (50, 99)))
    return {"p50_us": p50, "p99_us": p99}
