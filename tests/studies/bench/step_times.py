"""Duration of a single control step, called alone as on board."""

from __future__ import annotations

import dataclasses
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.lane_stepper import Stepper
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.program import trace_loop
from skyarm.records.leaves import leaves
from skyarm.scenario.scenario_record import Scenario, first_state
from skyarm.sensing.measurement import measurement_of
from skyarm.simulate.inputs import episode_inputs
from skyarm.simulate.loop import run_in_python

Array = NDArray[np.float64]


def compiled_step_time(scenario: Scenario, calls: int) -> dict[str, float]:
    """Microseconds of one control step as machine code, from Python's clock to Python's
    clock.
    """
    controller, inputs = scenario.controller, episode_inputs(scenario)
    state = first_state(scenario)
    force = type(state.velocity)(0.0, 0.0, scenario.plant.gravity)
    reading = measurement_of(state, force)
    period = 1.0 / scenario.rates.control

    def control(memory: Any, _parameters: Any, row: Any, _uniforms: Any) -> Any:
        return controller.law(memory, row[0], row[1], period, par=controller.par)

    loop = trace_loop(
        control, controller.memory, (), (reading, inputs.reference_example)
    )
    memory = np.array(leaves(controller.memory), dtype=float)
    compiled = Stepper(Kernel(loop, Lanes(1, contract=True), logging=True), memory)
    compiled.row[:] = [*leaves(reading), *inputs.held_leaves[0]]
    clock, spent = time.perf_counter_ns, np.empty(calls)
    for k in range(calls):
        begin = clock()
        compiled.step()
        spent[k] = clock() - begin
    return _percentiles(spent)


def flown_step_time(scenario: Scenario) -> dict[str, float]:
    """Microseconds of one control step of a law that is called with floats, all through
    a flight.

    The first step, which makes machine code, is left out.
    """
    return _percentiles(1e9 * flown_step_times(scenario)[1:])


def flown_step_times(scenario: Scenario) -> Array:
    """Seconds of each control step of a flight."""
    controller, clock = scenario.controller, time.perf_counter_ns
    spent: list[int] = []

    def timed_law(memory: Any, *arguments: Any, **constants: Any) -> Any:
        begin = clock()
        found = controller.law(memory, *arguments, **constants)
        spent.append(clock() - begin)
        return found

    called = dataclasses.replace(controller, law=timed_law, compiled=False)
    run_in_python(dataclasses.replace(scenario, controller=called))
    return 1e-9 * np.array(spent, dtype=float)


def _percentiles(nanoseconds: Any) -> dict[str, float]:
    p50, p99 = (float(value) / 1e3 for value in np.percentile(nanoseconds, (50, 99)))
    return {"p50_us": p50, "p99_us": p99}
