"""Rotor speeds and joint torques that follow a reference exactly, at many instants at
once.

The vehicle is differentially flat but for the reaction of its arm: the force that the
base needs fixes where its z axis points, the heading the rest, their derivatives the
angular velocity and acceleration, and inverse dynamics the torques.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

import numpy as np

from skyarm import dynamics
from skyarm.algebra import ZERO3_DATA, Mat3, Vec3
from skyarm.dynamics.actuators.drive import friction
from skyarm.dynamics.actuators.mixer import make_mixer
from skyarm.dynamics.actuators.servo import Servo
from skyarm.dynamics.state import proper_acceleration
from skyarm.records.arrays import Array, doubles, stack_values
from skyarm.records.immutable import immutable, positional
from skyarm.vehicle import Vehicle

LEFT = 1e-3
"""Least fraction of its effort limit that a servo keeps at its speed limit."""

REACTIONS = 2
"""Number of iterations in which the reaction of the arm's motion changes the direction
of the base force: the attitude is then within 5e-4 rad of that after ten, with one
within 5e-3 (arms that swing at 1 Hz on the shipped vehicles)."""


@immutable
class MotionSamples:
    """Motion of base and joints at K instants, as arrays.

    Attributes:
        time: (K,) s, rising. acceleration: (3, K) of the base origin, world axes,
            m/s^2. yaw: (K,) rad.
        joints, rates, accelerations: (n, K) rad or m, and per s and s^2.
    """

    time: Array
    acceleration: Array
    yaw: Array
    joints: Array
    rates: Array
    accelerations: Array


@positional
class ActuatorDemand:
    """Squared rotor speeds and joint torques of a motion at K instants, as arrays.

    Attributes:
        time: (K,) s. squared: (rotors, K) (rad/s)^2, of the exact mixer without limits.
            efforts: (n, K) N m or N.
        joints, rates: (n, K) rad or m, and per s. tilt: (K,) rad, of the base's z axis
            off the vertical.
        turning: (K,) rad/s^2, angular acceleration of the base. rotation: (3, 3, K)
            R_WB.
    """

    time: Array
    squared: Array
    efforts: Array
    joints: Array
    rates: Array
    tilt: Array
    turning: Array
    rotation: Array

    def effort_limits(
        self, efforts: Array, servos: Iterable[tuple[int, Servo]]
    ) -> Array:
        """Effort limits (n, K) at the motion's rates: those of the joints (n, 1), or
        less where a servo gives less.

        Args:
            efforts: limits of the joints, N m or N.
            servos: each with the index of its joint.
        """
        limits = np.repeat(efforts, len(self.time), axis=1)
        for i, servo in servos:
            ends = map(doubles, servo.bounds(self.rates[i]))
            low, high = (np.broadcast_to(end, self.time.shape) for end in ends)
            # at its speed limit a servo gives nothing: a demand over that is infinite
            most = np.where(self.efforts[i] < 0.0, -low, high)
            limits[i] = np.minimum(limits[i], np.maximum(most, LEFT * limits[i]))
        return limits


def motion_of(reference: Any, time: Array) -> MotionSamples:
    """Motion of base and joints at K instants, from a reference trajectory sampled into
    arrays.
    """
    lanes = partial(stack_values, len(time))
    return MotionSamples(
        time=time,
        acceleration=lanes(reference.acceleration),
        yaw=lanes([reference.yaw])[0],
        joints=lanes(reference.joints),
        rates=lanes(reference.joint_rates),
        accelerations=lanes(reference.joint_accelerations),
    )


def demand_of_motion(
    vehicle: Vehicle,
    gravity: float,
    motion: MotionSamples,
    settled: Callable[[Array], Array] = np.asarray,
    rotation: Array | None = None,
) -> ActuatorDemand:
    """Rotor speeds and joint efforts that follow a motion exactly.

    Args:
        vehicle: rigid bodies, rotors and the joints' friction.
        gravity: m/s^2.
        motion: at instants near enough that attitude may be differentiated between
            them.
        settled: part of the force (3, K) that the attitude follows; all of it if left
            out.
        rotation: (3, 3, K) R_WB, if the attitude is known and follows no force.
    """
    a, yaw = motion.acceleration, motion.yaw
    q, qd, qdd = tuple(motion.joints), tuple(motion.rates), tuple(motion.accelerations)
    lanes = partial(stack_values, len(motion.time))
    needed = float(vehicle.mass) * (a + np.array([[0.0], [0.0], [gravity]]))
    # attitude and reaction depend on each other: a fixed-point iteration
    for _ in range(REACTIONS if rotation is None else 0):
        R = attitude(settled(needed), yaw)
        # the turning of the base is left out until the attitude is known
        base = proper_acceleration(_matrix(R), Vec3(*a), ZERO3_DATA, gravity)
        force, _ = dynamics.inverse_dynamics(vehicle, q, ZERO3_DATA, qd, base, qdd)
        needed = np.einsum("ijk,jk->ik", R, lanes(force.force))
    R = attitude(settled(needed), yaw) if rotation is None else rotation
    rate, turning = rates_of(R, motion.time)
    inverse = np.array(make_mixer(vehicle).inverse, dtype=float)
    base = proper_acceleration(_matrix(R), Vec3(*a), Vec3(*turning), gravity)
    force, efforts = dynamics.inverse_dynamics(vehicle, q, Vec3(*rate), qd, base, qdd)
    along_thrust = np.einsum(
        "ik,ik->k", R[:, 2], np.einsum("ijk,jk->ik", R, lanes(force.force))
    )
    squared = inverse @ np.vstack([lanes(force.torque), along_thrust[None]])
    resisting = lanes(
        [
            friction(joint, rate, rate)
            for joint, rate in zip(vehicle.joints, qd, strict=True)
        ]
    )
    return ActuatorDemand(
        motion.time,
        np.asarray(squared),
        lanes(efforts) + resisting,
        motion.joints,
        motion.rates,
        np.arctan2(np.hypot(R[0, 2], R[1, 2]), R[2, 2]),
        np.linalg.norm(turning, axis=0),
        R,
    )


def attitude(force: Array, yaw: Array) -> Array:
    """Attitude R_WB (3, 3, K) with z along the force and x along the heading
    (Mellinger, Kumar 2011).
    """
    length = np.linalg.norm(force, axis=0)
    # a square that overflows: no direction
    # no division by zero in free fall, whose attitude is arbitrary
    z = force / np.where(np.isinf(length), np.nan, np.maximum(length, 1e-12))
    heading = np.stack([np.cos(yaw), np.sin(yaw), np.zeros_like(yaw)])
    y = np.cross(z, heading, axis=0)
    # nor by zero where the force points along the heading
    y /= np.maximum(np.linalg.norm(y, axis=0), 1e-12)
    return np.stack([np.cross(y, z, axis=0), y, z], axis=1)


def rates_of(R: Array, time: Array) -> tuple[Array, Array]:
    """Angular velocity and acceleration (3, K) of attitudes (3, 3, K), base axes, by
    central differences.
    """
    # edge_order 2: of second order at the first and last instant, too
    dR = np.gradient(R, time, axis=2, edge_order=2)
    # R^T dR/dt is skew but for the error of the differences
    W = np.einsum("jik,jlk->ilk", R, dR)
    # the skew part alone: half the difference of each two entries
    rate = 0.5 * np.stack([W[2, 1] - W[1, 2], W[0, 2] - W[2, 0], W[1, 0] - W[0, 1]])
    return rate, np.gradient(rate, time, axis=1, edge_order=2)


def _matrix(R: Array) -> Mat3:
    return Mat3(*(Vec3(*(R[i, j] for j in range(3))) for i in range(3)))
