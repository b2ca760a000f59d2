"""How many basic operations a vehicle's programs take, and how their size and compile time grow with its joints."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Sequence
from typing import Any

from skyarm import dynamics
from skyarm.algebra import Force, Motion, Vec3
from skyarm.compile import Program, trace
from skyarm.compile.llvm.kernel import build, host_width
from skyarm.compile.llvm.llvm_loop import assembly
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.repeat import operations
from skyarm.compile.tracing.stepped_loop import trace_loop
from skyarm.environment import WindSample
from skyarm.plant.compiled import example_command, example_state
from skyarm.plant.interface import Truth
from skyarm.plant.rigid_body import STEP, derivative
from skyarm.vehicle.vehicle_records import Vehicle


def basic(program: Program) -> int:
    """Operations with sin, exp ... written out."""
    return operations(program.lowered.nodes)


def counts(vehicle: Vehicle) -> dict[str, int]:
    """Operations of forward and inverse dynamics and of one step of the plant, in calm air.

    Dynamics count a sine as one operation, as hand counts do; the plant's steps count what is executed.
    """
    n, three = vehicle.n, Vec3(0.1, 0.2, 0.3)
    joints = (0.1,) * n

    def forward(q: Any, w: Any, qd: Any, f: Any, tau: Any) -> Any:
        return dynamics.forward_dynamics(vehicle, q, w, qd, Force(*f), tau)

    def inverse(q: Any, w: Any, qd: Any, a: Any, qdd: Any) -> Any:
        return dynamics.inverse_dynamics(vehicle, q, w, qd, Motion(*a), qdd)

    found = {
        "forward dynamics": operations(trace(forward, joints, three, joints, (three, three), joints).nodes),
        "inverse dynamics": operations(trace(inverse, joints, three, joints, (three, three), joints).nodes),
    }
    if vehicle.planar:
        return found
    world, air = Truth(vehicle=vehicle), WindSample()
    state, command = example_state(n, len(vehicle.rotors)), example_command(n, len(vehicle.rotors))
    found["equations of motion"] = basic(
        trace(lambda x, u: derivative(world, x, x.rotor_speeds, u.efforts, air), state, command)
    )
    for name in ("euler", "rk4"):
        found[f"{name} step"] = basic(
            trace(lambda x, u, name=name: STEP[name](world, x, u, air, 0.005), state, command)
        )
    return found


def chain(vehicle: Vehicle, joints: int) -> Vehicle:
    """A vehicle with an arm of that many joints: the links of the given one, over and over, in one chain."""
    links = []
    for i in range(joints):
        pattern = vehicle.links[i % vehicle.n]
        joint = dataclasses.replace(pattern.joint, name=f"joint{i}")
        links.append(dataclasses.replace(pattern, name=f"link{i}", parent=i - 1, joint=joint))
    return dataclasses.replace(vehicle, name=f"chain{joints}", links=tuple(links), frames=(), end_effector="")


def growth(vehicle: Vehicle, joints: Sequence[int]) -> list[dict[str, Any]]:
    """Operations, code size and compile time of an RK4 step for arms of so many joints."""
    found = []
    for n in joints:
        longer = chain(vehicle, n)
        world, air = Truth(vehicle=longer), WindSample()
        begin = time.perf_counter()

        def step(x: Any, _parameters: Any, u: Any, _draws: Any, world: Truth = world, air: Any = air) -> Any:
            return STEP["rk4"](world, x, u, air, 0.005), ()

        rotors = len(longer.rotors)
        loop = trace_loop(step, example_state(n, rotors), (), example_command(n, rotors), loops=True)
        traced = time.perf_counter()
        content = build(assembly(loop, Lanes(host_width(), contract=True), logging=False))
        found.append(
            {
                "joints": n,
                "operations": operations(loop.program.nodes),
                "code_kB": round(len(content) / 1024),
                "trace_s": traced - begin,
                "compile_s": time.perf_counter() - traced,
            }
        )
    return found
