"""Position control for an autopilot in angle mode, which takes roll, pitch, yaw rate
and thrust.

Axes are the project's: world z up, body x forward, y left; roll, pitch and yaw are the
angles of the rotations about x, y and z in the order z, y, x. A positive pitch lowers
the nose.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Sequence
from typing import Annotated

from skyarm.algebra import ZERO3_DATA, Quaternion, Vec3
from skyarm.control.blocks.geometric import yaw_of
from skyarm.links.autopilots.autopilot import BaseGoal
from skyarm.records.immutable import immutable, positional
from skyarm.records.units import Unit

Vector = tuple[float, float, float]


@immutable
class AngleGains:
    """Gains and limits of a position controller around an autopilot in angle mode.

    Attributes:
        position, velocity, integral: gains of the errors of position and velocity, and
            of the position error's integral.
        height: factor of the three for the vertical, where no attitude has to turn
            first.
        yaw: yaw rate per yaw error. tilt: largest angle of the thrust from the
            vertical.
        reach: largest position error that is acted upon; drift: largest acceleration of
            the integral.
    """

    # position, velocity and integral together: closed-loop poles at -2 and -1.5 +- 0.9j
    position: Annotated[float, Unit("1/s^2", "acceleration per position error")] = 9.0
    velocity: Annotated[float, Unit("1/s", "acceleration per velocity error")] = 5.0
    integral: Annotated[
        float, Unit("1/s^3", "rate of acceleration per position error: integral gain")
    ] = 6.0
    height: Annotated[
        float, Unit("", "factor of the three gains above, for the vertical")
    ] = 1.3
    yaw: Annotated[float, Unit("1/s", "yaw rate per yaw error")] = 2.0
    tilt: Annotated[
        float, Unit("rad", "largest angle of the thrust from the vertical")
    ] = 0.45
    reach: Annotated[
        float,
        Unit(
            "m",
            "largest position error that is corrected; longer ones are shortened to it",
        ),
    ] = 0.5
    drift: Annotated[
        float, Unit("m/s^2", "largest acceleration of the integral part", bound=True)
    ] = 3.0

    def slow_down(self, factor: float) -> AngleGains:
        """Gains of a position controller whose bandwidth is reduced by a factor below
        1; the yaw gain is unchanged.
        """
        return dataclasses.replace(
            self,
            # K_p, K_v and K_i have the units 1/s^2, 1/s and 1/s^3: closed-loop poles
            # that all shrink by one factor need these powers of it
            position=self.position * factor**2,
            velocity=self.velocity * factor,
            integral=self.integral * factor**3,
        )


@positional
class AttitudeCommand:
    """Set point of an autopilot in angle mode: roll, pitch (rad), yaw rate (rad/s) and
    thrust per mass (m/s^2).
    """

    roll: float
    pitch: float
    yaw_rate: float
    thrust: float


class MotionFilter:
    """Position and velocity from motion capture and the accelerometer, by an observer
    with two equal poles.

    p' = v + 2 w (p_m - p), v' = R f - g e_z + w^2 (p_m - p): positions correct what the
    specific force f predicts, so that the velocity does not lag. A constant
    accelerometer error b leaves a velocity error of 2 b / w.

    Source: Franklin, Powell, Emami-Naeini 2019, Feedback Control of Dynamic Systems,
    chapter 7 (full-order estimator).

    Args:
        pole: w, rad/s.
        gravity: m/s^2.
    """

    def __init__(self, gravity: float, pole: float = 8.0) -> None:
        self._gravity, self._pole = gravity, pole
        self.position = self.velocity = ZERO3_DATA
        self._begun = False

    def predict(
        self, quaternion: Sequence[float], specific_force: Sequence[float], dt: float
    ) -> None:
        """Predict position and velocity after ``dt`` from measured attitude (wxyz) and
        specific force (base axes).
        """
        x, y, z = rotate(quaternion, specific_force)
        push = Vec3(x, y, z - self._gravity)
        self.position += (self.velocity + push * (0.5 * dt)) * dt
        self.velocity += push * dt

    def correct(self, measured: Sequence[float], dt: float) -> None:
        """Correct position and velocity by a position measured ``dt`` after the last;
        the first one sets them.
        """
        if not self._begun:
            self.position = Vec3(*measured)
            self.velocity = ZERO3_DATA
            self._begun = True
            return
        # poles of the sampled observer at exp(-w dt), twice: exact for any dt
        keep = math.exp(-self._pole * dt)
        first, second = 1.0 - keep * keep, (1.0 - keep) ** 2 / dt
        error = Vec3(*measured) - self.position
        self.position += error * first
        self.velocity += error * second


class AngleControl:
    """Position and velocity PID with acceleration feedforward; outputs roll, pitch, yaw
    rate and thrust.

    a = a_r + K_p (p_r - p) + K_v (v_r - v) + K_i integral(p_r - p) is the desired
    acceleration and t = a + g e_z the desired specific thrust. Its direction gives roll
    and pitch at the present yaw, its component along the present thrust axis the
    thrust.

    Source: Lee, Leok, McClamroch 2010, Geometric tracking control of a quadrotor UAV on
    SE(3), eq. (12), (15) and (19), with roll and pitch in place of the desired
    attitude.
    """

    def __init__(self, gains: AngleGains, gravity: float) -> None:
        self._gains, self._gravity = gains, gravity
        self.integral: Vector = (0.0, 0.0, 0.0)

    def command(
        self,
        position: Iterable[float],
        velocity: Iterable[float],
        quaternion: Sequence[float],
        goal: BaseGoal,
        dt: float,
        *,
        flying: bool,
    ) -> AttitudeCommand:
        """Attitude set point that tracks a set point of the base; the error is
        integrated only while ``flying``.
        """
        gains = self._gains
        error = [a - b for a, b in zip(goal.position, position, strict=True)]
        size = math.hypot(*error)
        if size > gains.reach:
            error = [each * gains.reach / size for each in error]
        slip = [a - b for a, b in zip(goal.velocity, velocity, strict=True)]
        scale = (1.0, 1.0, gains.height)
        # on the stand the error is no fault of the loop: its integral would wind up
        if flying:
            self.integral = _shorten(
                [
                    each + dt * gains.integral * factor * part
                    for each, factor, part in zip(
                        self.integral, scale, error, strict=True
                    )
                ],
                gains.drift,
            )
        rows = zip(goal.acceleration, error, slip, self.integral, scale, strict=True)
        x, y, z = (
            a + s * (gains.position * e + gains.velocity * v) + i
            for a, e, v, i, s in rows
        )
        # thrust stays above zero, since its direction gives the attitude, and bounded,
        # so that a large height error leaves rotor signal for the attitude
        z = min(max(z + self._gravity, 0.2 * self._gravity), 2.0 * self._gravity)
        # the horizontal part gives way and not the vertical one, so that height is held
        level, most = math.hypot(x, y), z * math.tan(gains.tilt)
        if level > most:
            x, y = x * most / level, y * most / level
        up = rotate(quaternion, (0.0, 0.0, 1.0))
        now = float(yaw_of(Quaternion(*quaternion)))
        roll, pitch = angles_of((x, y, z), now)
        turn = math.remainder(goal.yaw - now, math.tau)
        return AttitudeCommand(
            # the thrust is along body z, so its part along the present axis is what the
            # command can give until the attitude has turned; rotors cannot pull
            roll,
            pitch,
            gains.yaw * turn,
            max(x * up[0] + y * up[1] + z * up[2], 0.0),
        )


def angles_of(thrust: Sequence[float], yaw: float) -> tuple[float, float]:
    """Roll and pitch (rad) at a yaw for which the body's z axis points along a vector
    of the world.
    """
    x, y, z = thrust
    size = math.hypot(x, y, z)
    forward = (math.cos(yaw) * x + math.sin(yaw) * y) / size
    left = (math.cos(yaw) * y - math.sin(yaw) * x) / size
    # rounding may bring the sine beyond 1
    return math.asin(min(max(-left, -1.0), 1.0)), math.atan2(forward, z / size)


def rotate(quaternion: Sequence[float], vector: Sequence[float]) -> Vector:
    """Rotate a vector from base axes to world axes by a unit quaternion."""
    w, x, y, z = quaternion
    a, b, c = vector
    # v + w t + q x t with t = 2 q x v, shorter than a matrix
    p, q, r = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return (
        a + w * p + y * r - z * q,
        b + w * q + z * p - x * r,
        c + w * r + x * q - y * p,
    )


def _shorten(vector: Sequence[float], most: float) -> Vector:
    size = math.hypot(*vector)
    x, y, z = (each * min(1.0, most / size) if size > 0.0 else 0.0 for each in vector)
    return x, y, z
