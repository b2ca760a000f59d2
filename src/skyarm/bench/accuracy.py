"""How far each engine's closed loop strays from the same flight integrated by RK4 at 0.125 ms."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from skyarm.bench.engines import Flight, steps_of
from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.loop import run

REFERENCE_STEP = 0.125e-3


def accuracy(scenario: Scenario, duration: float) -> dict[str, float]:
    """Largest distance of the base from the reference flight, m, by engine."""
    short = dataclasses.replace(scenario, duration=duration)
    finest = _positions(Flight.of(short, lambda seconds: round(seconds / REFERENCE_STEP)), Lanes(1))
    found = {}
    for integrator in ("rk4", "euler"):
        one = dataclasses.replace(short, integrator=integrator)
        flight = Flight.of(one, steps_of(one))
        for mode, lanes in (
            ("f64 exact", Lanes(1)),
            ("f64", Lanes(1, contract=True)),
            ("f32", Lanes(1, single=True, contract=True)),
        ):
            found[f"{integrator} {mode}"] = _farthest(_positions(flight, lanes), finest)
        log = run(dataclasses.replace(one, plant="mujoco"))
        found[f"mujoco {integrator}, 1 ms, loads held a step"] = _farthest(log.position, finest)
    return found


def _positions(flight: Flight, lanes: Lanes) -> npt.NDArray[np.float64]:
    kernel = Kernel(flight.loop, lanes, logging=True)
    _, log = kernel.run(flight.carry[:, None], flight.parameters[:, None], flight.rows)
    return log[:, :3, 0].astype(float)


def _farthest(a: npt.NDArray[np.float64], b: npt.NDArray[np.float64]) -> float:
    return float(np.max(np.linalg.norm(a - b, axis=1)))
