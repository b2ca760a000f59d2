"""When an episode ends before its time, and why."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from skyarm.algebra import Vec3
from skyarm.compile import trace
from skyarm.dynamics import State, link_poses
from skyarm.plant.compiled import example_state
from skyarm.scalars import Scalar, minimum
from skyarm.simulate.scenario import Scenario
from skyarm.vehicle.records import BASE, Vehicle

FAR = 1e4
"""A position (m), speed (m/s), rate (rad/s) or joint (rad) beyond this is divergence, long before numbers overflow."""


@dataclass(frozen=True, slots=True)
class Ending:
    """Why an episode stopped: status, cause in words, time in s."""

    status: str
    cause: str
    time: float


def lowest_point(vehicle: Vehicle, state: State) -> Scalar:
    """World height of the lowest of: base origin, rotor hubs, joints, named frames."""
    R = state.quaternion.rotation()
    poses = link_poses(vehicle, state.joints)
    points: list[Vec3] = [rotor.position for rotor in vehicle.rotors]
    points += [pose.p for pose in poses]
    points += [f.position if f.link == BASE else poses[f.link].apply(f.position) for f in vehicle.frames]
    lowest: Scalar = state.position.z
    for point in points:
        lowest = minimum(lowest, state.position.z + R.r2.dot(point))
    return lowest


class Monitor:
    """Checks each state of an episode."""

    def __init__(self, scenario: Scenario) -> None:
        vehicle = scenario.world.vehicle
        self._joints = [link.joint for link in vehicle.links]
        self._ground = scenario.ground
        controller = scenario.controller
        self._limit = controller.limit

        def observe(x: State) -> tuple[Scalar, Scalar]:
            margin = 1.0 if controller.margin is None else controller.margin(x.quaternion)
            return lowest_point(vehicle, x), margin

        self._observe = trace(observe, example_state(vehicle.n, len(vehicle.rotors)))

    def ending(self, time: float, x: Sequence[float]) -> Ending | None:
        """The ending this state means, or None."""
        largest = max(map(abs, x)) if all(map(math.isfinite, x)) else math.inf
        if not largest < FAR:
            what = "a state is not finite" if largest == math.inf else f"a state passed {FAR:g}"
            return Ending("diverged", what, time)
        for value, joint in zip(x[13:], self._joints, strict=False):
            if not joint.lower <= value <= joint.upper:
                limits = f"[{joint.lower:g}, {joint.upper:g}]"
                return Ending("joint_limit", f"joint '{joint.name}' at {value:.4g} passed {limits}", time)
        lowest, margin = self._observe.flat(x)
        if margin < 0.0:
            return Ending("controller_undefined", self._limit, time)
        if self._ground and lowest < 0.0:
            return Ending("ground", f"lowest point at z = {lowest:.4g} m", time)
        return None
