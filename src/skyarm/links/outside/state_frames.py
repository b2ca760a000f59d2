"""Vehicle state as estimated by its autopilot, and its transformation into a scenario's
world.

Axes here are forward, left, up and north, west, up (:mod:`skyarm.algebra.frames` brings
those of the wire into them). A scenario's world differs from the autopilot's local
frame by a shift and a turn about the vertical.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

from skyarm.algebra import ZERO3_DATA, Quaternion, Vec3
from skyarm.control.blocks.geometric import yaw_of
from skyarm.links.joint_port import JointReading
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit
from skyarm.sensing.measurement import Measurement


@immutable
class AutopilotState:
    """State estimate of an autopilot (pose, velocities, specific force) at a time of
    its own clock.
    """

    time: Annotated[float, Unit("s", "time of the estimate, the autopilot's clock")]
    position: Annotated[Vec3, Unit("m", "position of the base: north, west, up")]
    quaternion: Annotated[
        Quaternion,
        Unit("", "attitude w x y z, base (forward, left, up) to north, west, up"),
    ]
    velocity: Annotated[Vec3, Unit("m/s", "velocity of the base: north, west, up")]
    rate: Annotated[Vec3, Unit("rad/s", "angular velocity, base axes")]
    specific_force: Annotated[
        Vec3 | None,
        Unit("m/s^2", "accelerometer reading, base axes; None where it is not sent"),
    ] = None


def is_whole(state: AutopilotState) -> bool:
    """True if all numbers of an estimate are finite, and its quaternion has unit
    length.
    """
    numbers = (
        state.time,
        *state.position,
        *state.quaternion,
        *state.velocity,
        *state.rate,
    )
    return (
        all(map(math.isfinite, numbers))
        # the length of a quaternion in single precision errs by less than this
        and abs(sum(c * c for c in state.quaternion) - 1.0) < 1e-2
    )


@immutable
class WorldFrame:
    """Transformation from an autopilot's local frame to the world: p_world = R_z(turn)
    (p_local - origin) + start.
    """

    origin: Annotated[
        Vec3,
        Unit(
            "m", "place of the origin in the autopilot's local frame: north, west, up"
        ),
    ] = ZERO3_DATA
    start: Annotated[
        Vec3, Unit("m", "place of the origin in the scenario's world, world axes")
    ] = ZERO3_DATA
    turn: Annotated[
        float, Unit("rad", "yaw from the autopilot's local frame to the world")
    ] = 0.0

    @classmethod
    def at_start(
        cls, state: AutopilotState, position: Sequence[float], yaw: float
    ) -> WorldFrame:
        """Transformation that places the vehicle's present state at a position (m) and
        heading (rad) in the world.
        """
        x, y, z = map(float, position)
        return cls(
            origin=state.position,
            start=Vec3(x, y, z),
            turn=yaw - float(yaw_of(state.quaternion)),
        )

    def measurement(
        self, state: AutopilotState, arm: JointReading, time: float, rotors: int = 0
    ) -> Measurement:
        """Measurement for the control law in the scenario's world at a time (s) since
        its start; rotor speeds are zero.

        Without an accelerometer the specific force is three zeros: no reading.
        """
        turned = Quaternion(
            math.cos(0.5 * self.turn), 0.0, 0.0, math.sin(0.5 * self.turn)
        )
        R = turned.rotation()
        return Measurement(
            time=time,
            position=_floats(R.apply(state.position - self.origin) + self.start),
            quaternion=(turned * state.quaternion).normalized(),
            velocity=_floats(R.apply(state.velocity)),
            rate=state.rate,
            specific_force=(
                ZERO3_DATA
                if state.specific_force is None
                else _floats(state.specific_force)
            ),
            joints=arm.joints,
            joint_rates=arm.joint_rates,
            rotor_speeds=(0.0,) * rotors,
        )


def _floats(v: Vec3) -> Vec3:
    return Vec3(*map(float, v))
