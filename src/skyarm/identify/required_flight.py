"""Inverse dynamics of a reference: required attitude, rotor speeds and joint efforts,
without a closed loop.

Base position, heading and joints are given; thrust acts along the base's upright axis
and must carry the centre of mass, which gives the attitude (differential flatness;
Mellinger and Kumar 2011), in turns with what the moving arm adds to that centre's
acceleration. Inverse dynamics gives the wrench and the joints' efforts, and the
allocation of thrust and torques the rotors' speeds. Air drag is left out.
"""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np

from skyarm.algebra import Motion, Vec3
from skyarm.dynamics import inverse_dynamics
from skyarm.dynamics.actuators.drive import friction
from skyarm.dynamics.actuators.mixer import allocation_matrix
from skyarm.dynamics.actuators.motion_demand import attitude
from skyarm.dynamics.actuators.rotor import speed_of_push
from skyarm.dynamics.array_front import center_of_mass
from skyarm.dynamics.kinematics import link_poses
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.flight_data.quantities import GRAVITY
from skyarm.flight_data.series import columns_at
from skyarm.identify.logged_commands import time_constants
from skyarm.identify.multisines import BASE_AXES
from skyarm.identify.unknowns import USUAL_DELAY
from skyarm.records.arrays import Array, float_array, lengths, norm, stack_values
from skyarm.records.immutable import immutable
from skyarm.vehicle import BASE, Vehicle

TURNS = 4
"""Number of iterations of attitude and centre of mass; the arm moves the centre by
little of what gravity requires of the attitude."""


BLUR = 0.2
"""Averaging time (s) of the required force; a loop does not follow the jumps of jerk at
the ends of an envelope."""


@immutable(eq=False)
class RequiredFlight:
    """States, rotor speeds and joint efforts required to follow a motion exactly, at
    N + 1 evenly spaced instants.

    Attributes:
        period: s.
        position, velocity: (N + 1, 3) m, m/s, of the base origin, world axes.
        turned: (N + 1, 3, 3) base axes to world axes. rate: (N + 1, 3) rad/s, base
            axes.
        speeds: (N + 1, rotors) rad/s; 0 where a thrust below 0 would be needed.
        shares: (4, N + 1, rotors) of the speeds' squares for the force along z and the
            torques about x, y, z.
        joints, joint_rates, efforts: (N + 1, n).
    """

    period: float
    position: Array
    velocity: Array
    turned: Array
    rate: Array
    speeds: Array
    shares: Array
    joints: Array
    joint_rates: Array
    efforts: Array

    @property
    def tilt(self) -> Array:
        """Angle of thrust against the vertical (N + 1,), rad."""
        # rounding may leave a cosine beyond 1
        return np.arccos(np.clip(self.turned[:, 2, 2], -1.0, 1.0))

    def flight_data(self, vehicle: Vehicle, like: FlightData) -> FlightData:
        """Flight data as noise-free sensors would record them.

        Args:
            vehicle: vehicle whose rotors lag.
            like: flight whose sensors and commands these are, with their times from
                reading to reading.
        """
        from scipy.spatial.transform import Rotation

        ups, downs = time_constants(vehicle.rotors).T
        change = np.gradient(self.speeds, self.period, axis=0)
        times = self.period * np.arange(len(self.rate), dtype=float)
        states = {
            "gyro": self.rate,
            # only that there are readings counts
            "accelerometer": np.zeros_like(self.rate),
            "position": self.position,
            # SciPy puts w last
            "quaternion": np.roll(
                Rotation.from_matrix(self.turned).as_quat(), 1, axis=1
            ),
            "velocity": self.velocity,
            "joint_positions": self.joints,
        }
        commands = {
            # the inverse of the lag: a command leads the speed by rate times time
            # constant
            "rotor_speed_commands": (
                self.speeds + change * np.where(change > 0.0, ups, downs)
            ),
            "joint_efforts": self.efforts,
        }
        channels = dict[str, Channel]()
        # a command is logged that long before it acts
        for late, every in ((0.0, states), (USUAL_DELAY, commands)):
            for name, rows in every.items():
                if name in like and rows.size:
                    instants = np.arange(0.0, times[-1], 1.0 / like[name].rate)
                    values = columns_at(instants + late, times, rows)
                    channels[name] = Channel(
                        time=instants, values=values, source="required"
                    )
        return FlightData(name="required", file="required", channels=channels)


def required_flight(vehicle: Vehicle, motion: Array, period: float) -> RequiredFlight:
    """Compute attitude, rotor speeds and joint efforts required for a motion of base
    and joints.

    Args:
        vehicle: rigid bodies and rotors.
        motion: (3, 4 + n, N + 1) value, first and second derivative of x, y, z, heading
            and joints.
        period: s, between its instants.
    """
    value, first, second = motion
    size = motion.shape[2]
    q, qd, qdd = (tuple(each[BASE_AXES:]) for each in (value, first, second))
    joints = value[BASE_AXES:].T
    # of the base at the origin and level, thus in its axes
    com = center_of_mass(vehicle, np.zeros(3), [1.0, 0.0, 0.0, 0.0], joints)
    linear = second[:3].T + np.array([0.0, 0.0, GRAVITY])
    needed = linear
    for _ in range(TURNS):
        turned = np.moveaxis(attitude(_smooth(needed, period).T, value[3]), 2, 0)
        moved = np.einsum("kij,kj->ki", turned, com)
        needed = linear + np.gradient(
            np.gradient(moved, period, axis=0), period, axis=0
        )
    skew = np.einsum("kji,kjl->kil", turned, np.gradient(turned, period, axis=0))
    rate = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)
    felt = np.einsum("kji,kj->ki", turned, linear)
    base = Motion(Vec3(*np.gradient(rate, period, axis=0).T), Vec3(*felt.T))
    force, torques = inverse_dynamics(vehicle, q, Vec3(*rate.T), qd, base, qdd)
    wrench = stack_values(size, (force.force.z, *force.torque))
    *moments, thrust = np.array(allocation_matrix(vehicle), dtype=float)
    # pinv: more than four rotors share a wrench by the least squares of their pushes
    shares = (
        wrench[:, :, None] * np.linalg.pinv(np.array([thrust, *moments])).T[:, None, :]
    )
    resisting = [
        friction(joint, x, x) for joint, x in zip(vehicle.joints, qd, strict=True)
    ]
    # rotors push one way: below 0 the design counts the rotor as too slow
    pushes = np.maximum(shares.sum(axis=0), 0.0)
    return RequiredFlight(
        period=period,
        position=value[:3].T,
        velocity=first[:3].T,
        turned=turned,
        rate=rate,
        speeds=stack_values(
            size,
            (
                speed_of_push(*each)
                for each in zip(vehicle.rotors, pushes.T, strict=True)
            ),
        ).T,
        shares=shares,
        joints=joints,
        joint_rates=first[BASE_AXES:].T,
        efforts=(stack_values(size, torques) + stack_values(size, resisting)).T,
    )


def _smooth(rows: Array, period: float) -> Array:
    """Smooth samples (N, 3) by a Hann window, with the end values continued beyond both
    ends.
    """
    half = max(1, round(0.5 * BLUR / period))
    # the window's ends are 0 and would widen it by nothing
    window = np.hanning(2 * half + 3)[1:-1]
    padded = np.concatenate(
        [np.repeat(rows[:1], half, axis=0), rows, np.repeat(rows[-1:], half, axis=0)]
    )
    return np.stack(
        [np.convolve(column, window / window.sum(), "valid") for column in padded.T],
        axis=1,
    )


def arm_clearance(vehicle: Vehicle, joints: Array) -> tuple[Array, Array]:
    """Least distance of the arm's moving points from rotors and base origin, and their
    least height, m.

    Points are tips of frames and origins of links on links. A rotor is a disc that
    reaches half way to the next one.

    Args:
        vehicle: rotors, links, frames.
        joints: (N, n) rad or m.

    Returns:
        Distances (N,), infinite without an arm, and heights (N,) against the base
        origin, base axes.
    """
    size = len(joints)
    poses = link_poses(vehicle, tuple(joints.T)) if vehicle.n else []
    points = [
        poses[link].p for link, each in enumerate(vehicle.moving) if each.parent != BASE
    ]
    points += [
        poses[each.link].apply(each.position)
        for each in vehicle.frames
        if each.link != BASE
    ]
    distance, height = np.full(size, math.inf), np.zeros(size)
    hubs = np.array([float_array(each.position) for each in vehicle.rotors])
    axes = np.array([float_array(each.axis) for each in vehicle.rotors])
    radius = _radius(hubs)
    for each in points:
        at = stack_values(size, each).T
        distance = np.minimum(distance, lengths(at))
        height = np.minimum(height, at[:, 2])
        for hub, axis in zip(hubs, axes, strict=True):
            off = at - hub
            along = off @ axis
            beside = lengths(off - along[:, None] * axis)
            distance = np.minimum(
                distance, np.hypot(along, np.maximum(beside - radius, 0.0))
            )
    return distance, height


def _radius(hubs: Array) -> float:
    """Half of the least distance between rotor hubs (rotors, 3) that do not share an
    axis, m.
    """
    offsets = [a - b for a, b in combinations(hubs, 2)]
    # 1 mm, because hubs on one axis differ by rounding in a drawing
    apart = [norm(each) for each in offsets if np.hypot(*each[:2]) > 1e-3]
    return 0.5 * min(apart, default=0.0)
