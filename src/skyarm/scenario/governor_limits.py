"""What a governed reference asks of the vehicle that a law believes in, as shares of what that vehicle can give."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt

from skyarm.actuation import make_mixer
from skyarm.actuation.motion_demand import Demand, Motion, attitude, demand_of_motion
from skyarm.actuation.servo import Servo
from skyarm.control.model import Model
from skyarm.dynamics import frame_pose
from skyarm.records.field_rules import accept_fields
from skyarm.records.units import Unit
from skyarm.reference.governor.pause import PathPause
from skyarm.scalars import Scalar

Array = npt.NDArray[Any]

MAY_BE_INFINITE = ("joint_speed", "pause_error", "pause_thrust")
"""Options of a governor that bound nothing where they are infinite."""

SETTLES = 0.08
"""s, twice: windows of the means that the attitude follows of the thrust's direction. A tilt that is to jump is reached
by the attitude loop of a vehicle of this size within about 0.15 s."""

LEFT = 1e-3
"""Share of its limit that a servo is taken to have left where its speed leaves it nothing."""


@dataclass(frozen=True, kw_only=True, slots=True)
class GovernorOptions:
    """What a governor keeps within, and how.

    Attributes:
        reserve: share of rotors and joints that is left to the control: it plans with the rest.
        tilt: rad, of the base. turning: rad/s^2, angular acceleration of the base.
        joint_speed: rad/s or m/s, of every joint; servos have limits of their own besides.
        fastest: ds/dt with which it may catch up once it has fallen behind; 1 never does.
        pause_error, pause_thrust, pause_acceleration: of a pause (:mod:`skyarm.reference.governor.pause`); infinite
            bounds never pause.
    """

    reserve: Annotated[float, Unit("", "share of rotors and joints that is left to the control", low=0.0)] = 0.2
    tilt: Annotated[float, Unit("rad", "of the base", low=0.0, strict=True)] = 0.6
    turning: Annotated[float, Unit("rad/s^2", "angular acceleration of the base", low=0.0, strict=True)] = 10.0
    joint_speed: Annotated[Scalar, Unit("rad/s or m/s", infinite=True)] = math.inf
    fastest: Annotated[float, Unit("", "ds/dt with which it may catch up", low=1.0)] = 1.0
    pause_error: Annotated[Scalar, Unit("m", "of the tip, in flight", infinite=True)] = math.inf
    pause_thrust: Annotated[Scalar, Unit("", "share of a rotor's largest", infinite=True)] = math.inf
    pause_acceleration: Annotated[float, Unit("1/s", "of the reference's time", low=0.0, strict=True)] = 0.5

    def __post_init__(self) -> None:
        accept_fields(self, "reference.governor")
        bounds = (("reserve", 0.9), ("tilt", 1.5), ("fastest", 2.0))
        for name in MAY_BE_INFINITE:
            if not getattr(self, name) > 0.0:
                raise ValueError(f"reference.governor.{name} = {getattr(self, name)!r}: must be above 0")
        for name, most in bounds:
            value = getattr(self, name)
            if value > most:
                raise ValueError(f"reference.governor.{name} = {value!r}: must be at most {most:g}")
        if 1.0 <= self.pause_thrust < math.inf:
            raise ValueError(f"reference.governor.pause_thrust = {self.pause_thrust!r}: must be below 1")

    @property
    def pause(self) -> PathPause | None:
        """The pause in flight; None where nothing bounds it."""
        found = PathPause(error=self.pause_error, thrust=self.pause_thrust, acceleration=self.pause_acceleration)
        return found if found.used else None


class Limits:
    """The limits of a believed vehicle, and demands as shares of them.

    Args:
        model: what the law believes. options: of the governor.
    """

    def __init__(self, model: Model, options: GovernorOptions) -> None:
        self._vehicle, self._gravity, self._options = model.vehicle, float(model.gravity), options
        mixer = make_mixer(model.vehicle)
        self._highest = np.array(mixer.highest, dtype=float)[:, None]
        # squared speeds that lift the weight without any torque
        weight = np.array([0.0, 0.0, 0.0, float(model.vehicle.mass) * self._gravity])
        lifting = np.array(mixer.inverse, dtype=float) @ weight
        self._hover = np.maximum(lifting[:, None], 1e-9 * self._highest)
        efforts = [float(link.joint.effort_limit) or math.inf for link in model.vehicle.links]
        self._efforts = np.array(efforts)[:, None]
        named = {each.name: each.drive for each in model.vehicle.drives}
        found = [(i, named.get(link.joint.name)) for i, link in enumerate(model.vehicle.links)]
        self._tip = model.vehicle.end_effector if model.vehicle.n else ""
        self._servos = [(i, drive) for i, drive in found if isinstance(drive, Servo)]
        for i, servo in self._servos:
            self._efforts[i] = min(float(self._efforts[i, 0]), float(servo.largest_effort()))

    def names(self) -> list[str]:
        """What each row of the shares is of."""
        rotors = [rotor.name for rotor in self._vehicle.rotors]
        joints = [link.joint.name for link in self._vehicle.links]
        return [
            *(f"most of rotor {name!r}" for name in rotors),
            *(f"least of rotor {name!r}" for name in rotors),
            *(f"effort of joint {name!r}" for name in joints),
            *(f"speed of joint {name!r}" for name in joints),
            "tilt",
            "angular acceleration",
        ]

    def shares(self, motion: Motion) -> Array:
        """(limits, K) what a motion asks for, over its limit: beyond 1 it is too much."""
        settled = self._settled(motion.time)
        demand = demand_of_motion(self._vehicle, self._gravity, motion, settled)
        found = self._shares(demand)
        if self._tip:
            # a law may hold the tip or the base: the vehicle must be able to do both
            motion = dataclasses.replace(motion, acceleration=motion.acceleration + self._shift(motion, settled))
            demand = demand_of_motion(self._vehicle, self._gravity, motion, settled)
            found = np.maximum(found, self._shares(demand))
        return found

    def _shift(self, motion: Motion, settled: Any) -> Array:
        """(3, K) m/s^2, by which a base that tilts accelerates besides for its tip to stay where a level one has it."""
        force = motion.acceleration + np.array([[0.0], [0.0], [self._gravity]])
        held = frame_pose(self._vehicle, self._vehicle.frame(self._tip), tuple(motion.joints)).p
        arm = np.stack([np.broadcast_to(np.asarray(c, dtype=float), len(motion.time)) for c in held])
        c, s = np.cos(motion.yaw), np.sin(motion.yaw)
        level = np.stack([c * arm[0] - s * arm[1], s * arm[0] + c * arm[1], arm[2]])
        off = level - np.einsum("ijk,jk->ik", attitude(settled(force), motion.yaw), arm)
        velocity = np.gradient(off, motion.time, axis=1, edge_order=2)
        return np.asarray(settled(np.gradient(velocity, motion.time, axis=1, edge_order=2)))

    def at_rest(self, motion: Motion) -> Array:
        """(limits, K) the same if it stood still where it is: what no slower motion can lessen."""
        nothing = np.zeros_like
        still = Motion(
            time=motion.time, acceleration=nothing(motion.acceleration), yaw=motion.yaw, joints=motion.joints,
            rates=nothing(motion.rates), accelerations=nothing(motion.accelerations),
        )  # fmt: skip
        # turned by nothing but the posture, which does not change
        demand = demand_of_motion(self._vehicle, self._gravity, still, _upright)
        return self._shares(demand)

    def _shares(self, demand: Demand) -> Array:
        most = 1.0 - float(self._options.reserve)
        up = demand.squared / (most * self._highest)
        # the least that a rotor is left with: the reserve's share of what it turns with in hover
        least = (self._hover - demand.squared) / (self._hover * most)
        efforts, speeds = np.repeat(self._efforts, len(demand.time), axis=1), np.full_like(demand.rates, math.inf)
        speeds[:] = float(self._options.joint_speed)
        still = np.zeros(len(demand.time))
        for i, servo in self._servos:
            low, high = (np.asarray(bound, dtype=float) + still for bound in servo.bounds(demand.rates[i]))
            given = np.where(demand.efforts[i] < 0.0, -low, high)
            efforts[i] = np.minimum(efforts[i], np.maximum(given, LEFT * efforts[i]))
            speeds[i] = np.minimum(speeds[i], float(servo.speed_limit))
        attitude = [demand.tilt / float(self._options.tilt), demand.turning / float(self._options.turning)]
        return np.vstack(
            [up, least, np.abs(demand.efforts) / (most * efforts), np.abs(demand.rates) / speeds, *attitude]
        )

    def _settled(self, time: Array) -> Any:
        """Means over two windows of SETTLES seconds: what the attitude follows of the force's direction."""
        step = float(time[1] - time[0]) if len(time) > 1 else SETTLES
        half = max(0, round(0.5 * SETTLES / step))

        def follow(force: Array) -> Array:
            for _ in range(2):
                force = _mean(force, half)
            return force

        return follow


def _upright(force: Array) -> Array:
    up = np.zeros_like(force)
    up[2] = 1.0
    return up


def _mean(rows: Array, half: int) -> Array:
    """Mean over 2 half + 1 neighbours; at the ends, of as many as there are on both sides."""
    if half == 0:
        return rows
    padded = np.concatenate([np.repeat(rows[:, :1], half, axis=1), rows, np.repeat(rows[:, -1:], half, axis=1)], axis=1)
    sums = np.cumsum(np.concatenate([np.zeros((len(rows), 1)), padded], axis=1), axis=1)
    width = 2 * half + 1
    return np.asarray((sums[:, width:] - sums[:, :-width]) / width)
