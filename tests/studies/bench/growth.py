"""Operations, code size and compile time of a step as a vehicle's arm grows."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Sequence
from typing import Any

from skyarm.compile.llvm.kernel import build, host_width
from skyarm.compile.llvm.llvm_loop import assembly
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.lower import operations
from skyarm.compile.tracing.program import trace_loop
from skyarm.plant.compiled import example_state
from skyarm.plant.interface import Truth, example_command
from skyarm.plant.rigid_body import COUPLED_STEP
from skyarm.vehicle.vehicle_records import Vehicle
from support.one_vehicle import after_step
from support.vehicles import steady_wind


def chain(vehicle: Vehicle, joints: int) -> Vehicle:
    """A vehicle with an arm of that many joints: the links of the given one, over and
    over, in one chain.
    """
    links = []
    for i in range(joints):
        pattern = vehicle.links[i % vehicle.n]
        joint = dataclasses.replace(pattern.joint, name=f"joint{i}")
        links.append(
            dataclasses.replace(pattern, name=f"link{i}", parent=i - 1, joint=joint)
        )
    return dataclasses.replace(
        vehicle, name=f"chain{joints}", links=tuple(links), frames=(), end_effector=""
    )


def growth(vehicle: Vehicle, joints: Sequence[int]) -> list[dict[str, Any]]:
    """Operations, code size and compile time of an RK4 step for arms of so many
    joints.
    """
    found = []
    for n in joints:
        longer = chain(vehicle, n)
        world, air = Truth(vehicle=longer), steady_wind()
        begin = time.perf_counter()

        def step(
            x: Any,
            _parameters: Any,
            u: Any,
            _draws: Any,
            world: Truth = world,
            air: Any = air,
        ) -> Any:
            return after_step(COUPLED_STEP["rk4"], world, x, u, air, 0.005)[0], ()

        rotors = len(longer.rotors)
        loop = trace_loop(
            step, example_state(n, rotors), (), example_command(n, rotors), loops=True
        )
        traced = time.perf_counter()
        content = build(
            assembly(loop, Lanes(host_width(), contract=True), logging=False)
        )
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
