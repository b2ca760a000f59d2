"""Launch stand: holds the vehicle level at a position until its rotors carry it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from skyarm.algebra import Quaternion, Scalar, Vec3
from skyarm.algebra.scalars import cos, maximum, minimum, sin, where
from skyarm.dynamics.point_motion import PointMotion
from skyarm.records.field_rules import checked
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit, positive
from skyarm.world.component import Force, NoMemory, Wrench


@immutable
@checked("launch_stand")
class LaunchStand(Force[NoMemory]):
    """Launch stand under the base origin: pushes up only, and holds position and
    attitude while it carries load.

    The upward force is N = m max(0, w^2 (z_0 - z) - 2 w v_z) below its top z_0, where
    the spring is critically damped with the vehicle on it. Sideways, and about each
    axis, spring and damper of the same frequency act, scaled by the share of the weight
    that the stand carries, N / (m g), at most 1: a vehicle that lifts is free.

    Attributes:
        place: place of the base origin where the stand begins to push; it rests g / w^2
            below.
        yaw: angle at which it holds the base.
        mass: mass of the vehicle.
        inertia: moment of its base, about any axis: the least of the three keeps the
            stand soft.
        frequency: w.
    """

    place: Annotated[
        Vec3,
        Unit(
            "m",
            "position of the base origin at which the stand begins to push, world axes",
        ),
    ]
    yaw: Annotated[Scalar, Unit("rad", "heading at which the stand holds the base")] = (
        0.0
    )
    mass: Annotated[Scalar, positive("kg", "mass of the vehicle on the stand")]
    inertia: Annotated[
        Scalar,
        positive(
            "kg m^2", "moment of inertia of the vehicle's base, the least of the three"
        ),
    ]
    frequency: Annotated[
        Scalar,
        positive("rad/s", "natural frequency of the vehicle on the stand's spring"),
    ] = 40.0
    gravity: Annotated[
        Scalar, positive("m/s^2", "gravitational acceleration, downwards")
    ] = 9.81

    @property
    def largest_step(self) -> float | None:  # type: ignore[override]
        """Longest integration step (s) for the launch stand: half a radian of its
        spring's natural oscillation.
        """
        return 0.5 / float(self.frequency)

    @property
    def rest(self) -> Vec3:
        """Position (m) of the base origin at which the launch stand carries the
        vehicle's whole weight.
        """
        sag = self.gravity / (self.frequency * self.frequency)
        return Vec3(self.place.x, self.place.y, self.place.z - sag)

    def wrenches(
        self,
        memory: NoMemory,
        t: Scalar,
        motion: PointMotion,
        rotor_speeds: Sequence[Scalar],
    ) -> Sequence[Wrench]:
        """Force and torque of the launch stand on the base, about the base origin."""
        state, w = motion.state, self.frequency
        gap = state.position - self.place
        v = state.velocity
        below = gap.z < 0.0
        # per mass, a critically damped spring that pushes and never pulls
        up = where(below, maximum(0.0, -w * w * gap.z - 2.0 * w * v.z), 0.0)
        # sideways it holds as far as it bears the weight
        share = minimum(up / self.gravity, 1.0)
        hold = share * self.mass
        force = Vec3(
            -hold * (w * w * gap.x + 2.0 * w * v.x),
            -hold * (w * w * gap.y + 2.0 * w * v.y),
            self.mass * up,
        )
        # rotation from the held attitude to the base's, base axes: twice the vector
        # part of a small quaternion
        back = Quaternion(cos(0.5 * self.yaw), 0.0, 0.0, -sin(0.5 * self.yaw))
        q = back * state.quaternion
        # q and -q are one attitude: the shorter way back
        sign = where(q[0] < 0.0, -2.0, 2.0)
        turn = Vec3(*(sign * q[i] for i in (1, 2, 3)))
        grip = share * self.inertia
        torque = motion.to_world(
            (turn * (w * w) + state.rate * (2.0 * w)) * (-1.0 * grip)
        )
        return (Wrench(force_W=force, torque_W=torque),)
