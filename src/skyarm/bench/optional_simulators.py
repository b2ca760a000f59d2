"""Simulators that need libraries of their own, where those are installed: crazyflow, MJX, RotorPy.

crazyflow and RotorPy fly a drone of their own without an arm, controller included (RotorPy: without); MJX is given our
vehicle, plant only.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from typing import Any

import numpy as np

from skyarm.bench.mujoco_pinocchio import STEP, spec
from skyarm.bench.timing import Contender
from skyarm.vehicle.vehicle_records import Vehicle


def installed(name: str) -> bool:
    """Whether a module can be imported, without doing it."""
    try:
        return importlib.util.find_spec(name) is not None
    except ModuleNotFoundError:
        return False


def guests(vehicle: Vehicle) -> list[Contender]:
    """All that are installed."""
    makers: dict[str, Callable[[], Contender]] = {
        "crazyflow": crazyflow,
        "mujoco.mjx": lambda: mjx(vehicle),
        "rotorpy": rotorpy,
    }
    return [make() for name, make in makers.items() if installed(name)]


def crazyflow(worlds: int = 4096, steps: int = 50) -> Contender:
    """crazyflow's closed loop: state controller at 100 Hz, physics at 500 Hz, f32, no arm."""
    from crazyflow.control import Control
    from crazyflow.sim import Sim

    sim: Any = Sim(n_worlds=worlds, n_drones=1, control=Control.state)
    wanted = np.zeros((worlds, 1, 16))
    wanted[..., 2], wanted[..., 12] = 1.0, 1.0  # 1 m up, level: position, velocity, acceleration, quaternion xyzw

    def run() -> float:
        sim.state_control(wanted)
        sim.step(steps)
        sim.data.states.pos.block_until_ready()
        return worlds * steps / float(sim.freq)

    return Contender(f"crazyflow {worlds}", f"closed loop of its own drone, no arm, 500 Hz, f32, {worlds} worlds", run)


def mjx(vehicle: Vehicle, worlds: int = 256, steps: int = 20) -> Contender:
    """MJX on the processor or GPU that JAX finds, f32."""
    import jax
    from mujoco import mjx as library

    model: Any = library.put_model(spec(vehicle).compile())
    start = library.make_data(model)

    def advance(data: Any) -> Any:
        return jax.lax.fori_loop(0, steps, lambda _, x: library.step(model, x), data)

    batch: Any = jax.jit(jax.vmap(advance))
    data = jax.vmap(lambda _: start)(np.arange(worlds))

    def run() -> float:
        batch(data).qpos.block_until_ready()
        return worlds * steps * STEP

    return Contender("mjx", f"plant only, Euler 1 ms, {worlds} worlds on {jax.devices()[0].platform}", run)


def rotorpy(steps: int = 100) -> Contender:
    """RotorPy's own quadrotor in hover, no arm and no controller, its adaptive integrator asked every 1 ms."""
    from rotorpy.vehicles.hummingbird_params import quad_params
    from rotorpy.vehicles.multirotor import Multirotor

    craft: Any = Multirotor(quad_params)
    hover = np.sqrt(quad_params["mass"] * 9.81 / (4.0 * quad_params["k_eta"]))
    control = {"cmd_motor_speeds": np.full(4, hover)}

    def run() -> float:
        state = craft.initial_state
        for _ in range(steps):
            state = craft.step(state, control, STEP)
        return steps * STEP

    return Contender("rotorpy", "plant of its own quadrotor, no arm, a call each 1 ms, one core", run)
