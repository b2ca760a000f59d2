"""When an episode ends before its time, and why."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from skyarm.algebra import Vec3
from skyarm.compile import rebuild, trace
from skyarm.dynamics import State, link_poses
from skyarm.plant.compiled import example_state
from skyarm.scalars import Scalar, minimum
from skyarm.simulate.scenario import Scenario
from skyarm.vehicle.records import BASE, Vehicle

FAR = 1e4
"""A speed (m/s), rate (rad/s) or joint (rad or m) beyond this is divergence, long before numbers overflow."""

LOST = 1e3
"""m from the reference: no controller of an aerial robot means to be there."""


LONG = 2.0
"""A quaternion with a part beyond this has lost its unit length."""


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


def _names(vehicle: Vehicle) -> tuple[list[str], list[str]]:
    """Words for the leaves of a state and of a command, in order."""
    axes = [("position", "xyz"), ("quaternion", "wxyz"), ("velocity", "xyz"), ("rate", "xyz")]
    named = [f"{word}.{axis}" for word, letters in axes for axis in letters]
    joints = [link.joint.name for link in vehicle.links]
    named += [f"joint '{name}'" for name in joints] + [f"rate of joint '{name}'" for name in joints]
    rotors = [f"speed of rotor '{rotor.name}'" for rotor in vehicle.rotors]
    commands = [f"commanded {name}" for name in (*rotors, *(f"effort of joint '{name}'" for name in joints))]
    return named + rotors, commands


def apart(value: float, limit: float) -> tuple[str, str]:
    """Two different numbers with as many digits (at least four) as tell them apart."""
    for digits in range(4, 18):
        texts = f"{value:.{digits}g}", f"{limit:.{digits}g}"
        if texts[0] != texts[1]:
            return texts
    return repr(value), repr(limit)


class Monitor:
    """Checks states of an episode.

    Args:
        scenario: of the episode.
        often: trace what is computed of a state, which pays from a dozen states on.
    """

    def __init__(self, scenario: Scenario, *, often: bool = True) -> None:
        vehicle = scenario.world.vehicle
        self._joints = [link.joint for link in vehicle.links]
        self._names, self._commands = _names(vehicle)
        self._ground = scenario.ground
        controller = scenario.controller
        self._limit = controller.limit

        def observe(x: State) -> tuple[Scalar, Scalar]:
            margin = 1.0 if controller.margin is None else controller.margin(x.quaternion)
            return lowest_point(vehicle, x), margin

        example = example_state(vehicle.n, len(vehicle.rotors))
        self._observe: Callable[[Sequence[float]], tuple[Scalar, ...]]
        if often:
            self._observe = trace(observe, example).flat
        else:
            self._observe = lambda x: observe(rebuild(example, iter(x)))

    def refused(self, time: float, command: Sequence[float]) -> Ending | None:
        """The ending this command means, or None."""
        for name, value in zip(self._commands, command, strict=True):
            if not math.isfinite(value):
                return Ending("diverged", f"{name} is not finite", time)
        return None

    def ending(self, time: float, x: Sequence[float], goal: Sequence[float]) -> Ending | None:
        """The ending this state means, or None; ``goal`` is the held reference's position."""
        for name, value in zip(self._names, x, strict=True):
            if not math.isfinite(value):
                return Ending("diverged", f"{name} is not finite", time)
        for name, value in zip(self._names[3:7], x[3:7], strict=True):
            if not -LONG < value < LONG:
                return Ending("diverged", f"{name} passed {LONG:g}", time)
        for name, value in zip(self._names[7:], x[7:], strict=True):
            if not -FAR < value < FAR:
                return Ending("diverged", f"{name} passed {FAR:g}", time)
        for name, value, wanted in zip(self._names, x[:3], goal, strict=False):
            if not -LOST < value - wanted < LOST:
                return Ending("diverged", f"{name} is over {LOST:g} m from the reference", time)
        for value, joint in zip(x[13:], self._joints, strict=False):
            if not joint.lower <= value <= joint.upper:
                limit = float(joint.upper if value > joint.upper else joint.lower)
                return Ending("joint_limit", f"joint '{joint.name}' at {' passed '.join(apart(value, limit))}", time)
        lowest, margin = self._observe(x)
        if margin < 0.0:
            return Ending("controller_undefined", self._limit, time)
        if self._ground and lowest < 0.0:
            return Ending("ground", f"lowest point at z = {lowest:.4g} m", time)
        return None
