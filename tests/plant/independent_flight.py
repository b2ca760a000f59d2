"""The flight equations once more, in NumPy and straight from their definitions: an
oracle for loads and integrators.

Rigid bodies come from MuJoCo's forward dynamics; nothing here uses the library's
algebra, actuation or dynamics.
"""

from __future__ import annotations

import math

import numpy as np

from support.vehicles import MujocoTwin, RandomState, rotation_matrix


def array(v):
    return np.array([float(c) for c in v])


class Flight:
    """d/dt of [position, quaternion, velocity, rate, joints, joint rates, rotor speeds]
    under held command and wind.
    """

    def __init__(self, vehicle, gravity, wind):
        self.vehicle, self.gravity, self.n = vehicle, gravity, vehicle.n
        self.twin = MujocoTwin(vehicle)
        sample = wind.components[0]
        self.push_W, self.point_B, self.air_W = (
            array(v) for v in (sample.force_W, sample.point_B, sample.air_velocity_W)
        )

    def split(self, x):
        n = self.n
        ends = np.cumsum([3, 4, 3, 3, n, n])
        return np.split(np.asarray(x, dtype=float), ends)

    def loads(self, x, efforts):
        """Generalised force: world force at and body torque about the base origin, then
        joint torques.
        """
        _, q, v, w, _, joint_rates, speeds = self.split(x)
        R = rotation_matrix(q / np.linalg.norm(q))
        force_W, torque_W = self.push_W.copy(), np.cross(R @ self.point_B, self.push_W)
        air_B = R.T @ (v - self.air_W)
        drag = self.vehicle.drag
        force_W += R @ (
            -0.5
            * float(drag.air_density)
            * np.linalg.norm(air_B)
            * array(drag.area)
            * air_B
        )
        for rotor, W in zip(self.vehicle.rotors, speeds, strict=True):
            hub_W, n_W = R @ array(rotor.position), R @ array(rotor.axis)
            through_air = v + np.cross(R @ w, hub_W) - self.air_W
            across = through_air - (through_air @ n_W) * n_W
            thrust = rotor.thrust_coefficient * W**2
            pull = thrust * n_W - abs(W) * rotor.drag_coefficient * across
            force_W += pull
            torque_W += np.cross(hub_W, pull)
            torque_W -= rotor.direction * rotor.moment_coefficient * thrust * n_W
            torque_W -= abs(W) * rotor.rolling_moment_coefficient * across
        joints = []
        for link, effort, rate in zip(
            self.vehicle.links, efforts, joint_rates, strict=True
        ):
            j = link.joint
            drive = max(-j.effort_limit, min(j.effort_limit, effort))
            joints.append(
                drive - j.damping * rate - j.coulomb * math.tanh(rate / j.coulomb_rate)
            )
        return np.concatenate([force_W, R.T @ torque_W, joints])

    def acceleration(self, x, efforts):
        p, q, v, w, joints, joint_rates, _ = self.split(x)
        state = RandomState(
            p, q / np.linalg.norm(q), joints, np.concatenate([v, w, joint_rates])
        )
        return self.twin.forward_dynamics(state, self.loads(x, efforts), self.gravity)

    def derivative(self, x, commanded, efforts):
        _, (qw, qx, qy, qz), v, w, _, joint_rates, speeds = self.split(x)
        a = self.acceleration(x, efforts)
        turning = (
            0.5
            * np.array([[-qx, -qy, -qz], [qw, -qz, qy], [qz, qw, -qx], [-qy, qx, qw]])
            @ w
        )
        lag = []
        for rotor, W, wanted in zip(
            self.vehicle.rotors, speeds, commanded, strict=True
        ):
            target = min(wanted, rotor.max_speed)
            lag.append(
                (target - W)
                / (rotor.time_constant_up if target > W else rotor.time_constant_down)
            )
        return np.concatenate([v, turning, a[:6], joint_rates, a[6:], lag])

    def fly(self, x, commanded, efforts, seconds):
        """The end state by DOP853 (Hairer, Wanner) with error control near rounding."""
        from scipy.integrate import solve_ivp

        found = solve_ivp(
            lambda _, y: self.derivative(y, commanded, efforts),
            (0.0, seconds),
            np.array(x, dtype=float),
            method="DOP853",
            rtol=1e-12,
            atol=1e-12,
        )
        assert found.success
        return found.y[:, -1]
