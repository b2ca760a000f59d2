"""Other simulators with the same vehicle: their plant only, no controller, no rotors, which is in their favour."""

from __future__ import annotations

import importlib.util
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from skyarm.bench.timing import Contender
from skyarm.vehicle.vehicle_records import Vehicle

STEP = 1e-3
"""s, semi-implicit Euler."""


def spec(vehicle: Vehicle, integrator: str = "euler") -> Any:
    """The vehicle for MuJoCo, with nothing that pushes but gravity."""
    from skyarm.plant.mujoco_model import build_spec

    return build_spec(vehicle, 9.81, timestep=STEP, integrator=integrator)


def mujoco_rollout(vehicle: Vehicle, threads: int, steps: int = 500, integrator: str = "euler") -> Contender:
    """MuJoCo's own batch engine on all cores."""
    import mujoco
    from mujoco.rollout import Rollout

    model = spec(vehicle, integrator).compile()
    data = [mujoco.MjData(model) for _ in range(threads)]
    size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    start = np.zeros(size)
    mujoco.mj_getState(model, data[0], start, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    batch = 8 * threads
    engine = Rollout(nthread=threads)
    states = np.zeros((batch, steps, size))

    def run() -> float:
        engine.rollout(model, data, np.tile(start, (batch, 1)), nstep=steps, state=states)
        return batch * steps * STEP

    name = "mujoco.rollout" if integrator == "euler" else f"mujoco.rollout {integrator}"
    return Contender(name, f"plant only, {integrator} 1 ms, {threads} threads", run)


def mujoco_step(vehicle: Vehicle, steps: int = 2000) -> Contender:
    """One thread inside MuJoCo's C loop."""
    import mujoco

    model = spec(vehicle).compile()
    data = mujoco.MjData(model)

    def run() -> float:
        mujoco.mj_resetData(model, data)
        mujoco.mj_step(model, data, nstep=steps)
        return steps * STEP

    return Contender("mj_step", "plant only, Euler 1 ms, one core, loop in C", run)


def pinocchio(vehicle: Vehicle, calls: int = 4000) -> list[Contender]:
    """Pinocchio's forward dynamics alone, called from Python, as if a call were a step of 1 ms."""
    if importlib.util.find_spec("pinocchio") is None:
        return []
    import pinocchio as pin

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "vehicle.xml"
        described = spec(vehicle)
        described.compile()
        path.write_text(described.to_xml())
        model = pin.buildModelFromMJCF(str(path))
    data = model.createData()
    q, v, tau = pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv)

    def run() -> float:
        for _ in range(calls):
            pin.aba(model, data, q, v, tau)
        return calls * STEP

    return [Contender("pinocchio aba", "forward dynamics only, one core, a call from Python each 1 ms", run)]
