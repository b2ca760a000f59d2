"""Where the base must stand so that the tip is where a level base would carry it, although rotors must lean to push.

The arm takes back what its joints can of the lean: those next to the base turn against it. What is left, the base makes
good by standing aside: the whole of the tip's way for a lean about an axis about which no joint turns.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.algebra import Mat3, Vec3
from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.stepped_loop import trace_loop
from skyarm.control.blocks.geometric import desired_attitude
from skyarm.control.laws.predictive.cost import given_way
from skyarm.control.model import Model
from skyarm.dynamics import frame_pose
from skyarm.scalars import cos, sin
from skyarm.vehicle.vehicle_records import Vehicle

Array = npt.NDArray[np.float64]


def shift(vehicle: Vehicle, thrust: Vec3, yaw: Any, joints: tuple[Any, ...]) -> Vec3:
    """Way of the base, m, world axes.

    Args:
        vehicle: with a tip.
        thrust: direction in which the rotors must push, world axes.
        yaw: rad.
        joints: where the tip's place under a level base is told by them.
    """
    frame = vehicle.frame(vehicle.end_effector)
    leaning = desired_attitude(-thrust, yaw, Mat3.identity())
    up = leaning.apply_T(Vec3(0, 0, 1))
    arm = frame_pose(vehicle, frame, joints).p
    bent = frame_pose(vehicle, frame, given_way(vehicle, joints, Vec3(up.y, -up.x, 0))).p
    c, s = cos(yaw), sin(yaw)
    return Vec3(c * arm.x - s * arm.y, s * arm.x + c * arm.y, arm.z) - leaning.apply(bent)


class Stance:
    """:func:`shift` at every stage of a horizon as machine code; nothing in mode "joints" and without a tip."""

    def __init__(self, model: Model, mode: str) -> None:
        vehicle = model.vehicle
        self.kernel: Kernel | None = None
        if mode == "tool" and vehicle.end_effector:
            row = ((0.0,) * 3, (0.0,) * (1 + vehicle.n))

            def step(carry: Any, _par: Any, row: Any, _uniforms: Any) -> Any:
                thrust, (yaw, *joints) = row
                return carry, tuple(shift(vehicle, Vec3(*thrust), yaw, tuple(joints)))

            self.kernel = Kernel(trace_loop(step, (0.0,), (), row), Lanes(1), logging=True)

    def at(self, thrusts: Array, values: Array) -> Array:
        """Shifts (T, 3) for thrusts (T, 3) and signals (T, 4 + joints)."""
        if self.kernel is None:
            return np.zeros((len(values), 3))
        rows = np.hstack([thrusts, values[:, 3:]])
        _, log = self.kernel.run(np.zeros((1, 1)), np.zeros((0, 1)), rows)
        return np.ascontiguousarray(log[:, :, 0])
