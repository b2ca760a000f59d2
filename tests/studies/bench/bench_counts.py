"""Operation counts of a vehicle's programs."""

from __future__ import annotations

from typing import Any

from skyarm import dynamics
from skyarm.algebra import Force, Motion, Vec3
from skyarm.compile import trace
from skyarm.compile.tracing.lower import operations
from skyarm.dynamics.actuators import Command
from skyarm.plant.compiled import example_state
from skyarm.plant.interface import Truth, example_command
from skyarm.plant.rigid_body import COUPLED_STEP
from skyarm.vehicle.vehicle_records import Vehicle
from support.one_vehicle import after_step, rate_of
from support.vehicles import steady_wind


def counts(vehicle: Vehicle) -> dict[str, int]:
    """Operations of forward and inverse dynamics and of one step of the plant, in calm
    air.

    Dynamics count a sine as one operation, as hand counts do; the plant's steps count
    what is executed.
    """
    n, three = vehicle.n, Vec3(0.1, 0.2, 0.3)
    joints = (0.1,) * n

    def forward(q: Any, w: Any, qd: Any, f: Any, tau: Any) -> Any:
        return dynamics.forward_dynamics(vehicle, q, w, qd, Force(*f), tau)

    def inverse(q: Any, w: Any, qd: Any, a: Any, qdd: Any) -> Any:
        return dynamics.inverse_dynamics(vehicle, q, w, qd, Motion(*a), qdd)

    found = {
        "forward dynamics": operations(
            trace(forward, joints, three, joints, (three, three), joints).nodes
        ),
        "inverse dynamics": operations(
            trace(inverse, joints, three, joints, (three, three), joints).nodes
        ),
    }
    if vehicle.planar:
        return found
    world, air = Truth(vehicle=vehicle), steady_wind()
    state, command = (
        example_state(n, len(vehicle.rotors)),
        example_command(n, len(vehicle.rotors)),
    )
    motion = trace(
        lambda x, u: rate_of(world, x, Command(efforts=u.efforts), air), state, command
    )
    found["equations of motion"] = operations(motion.lowered.nodes)
    for name in ("euler", "rk4"):
        step = trace(
            lambda x, u, name=name: after_step(
                COUPLED_STEP[name], world, x, u, air, 0.005
            )[0],
            state,
            command,
        )
        found[f"{name} step"] = operations(step.lowered.nodes)
    return found
