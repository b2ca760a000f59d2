"""The paper's laws (80)-(103) once more, in NumPy arrays; rigid-body dynamics from
Pinocchio or from the 8x8 blocks.

Nothing of skyarm's control, mixer, algebra or tree dynamics is used here; the 8x8
arrays are the second oracle.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from support import euler_lagrange as el
from support.laws import Case, G

MASS = 0.716 + 0.04 + 0.04 + 0.01
INERTIA = np.diag([0.007, 0.007, 0.012])
KP, KV, KR, KW = 4.0, 2.2, np.array([0.7, 0.7, 0.035]), np.array([0.1, 0.1, 0.025])
ACCELERATION = np.array([350.0, 150.0]), np.array([12.0, 10.0])
TORQUE = np.array([1.0, 0.5]), np.array([0.04, 0.02])
KF, KM, ARM = 8.549e-6, 0.016, 0.17

ALLOCATION = np.array(
    [
        [0.0, ARM * KF, 0.0, -ARM * KF],
        [-ARM * KF, 0.0, ARM * KF, 0.0],
        [KM * KF, -KM * KF, KM * KF, -KM * KF],
        [KF, KF, KF, KF],
    ]
)
"""(97): rows torque x, y, z and thrust; rotors front cw, left ccw, back cw, right
ccw."""


def skew(v: Any) -> Any:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def attitude_error(R: Any, R_d: Any, near: float = 0.0175) -> Any:
    """(83) from SciPy's rotation vector: sine along the axis; ``near`` half a turn
    more, which is not the paper's.
    """
    vector = Rotation.from_matrix(R_d.T @ R).as_rotvec()
    angle = np.linalg.norm(vector)
    left = 2.0 * np.sin(0.5 * (np.pi - angle))
    return (
        (np.sin(angle) + max(near - left * left / near, 0.0))
        * vector
        / max(angle, 1e-300)
    )


def accelerations(
    case: Case, *, feedforward: bool = True, corrected: bool = False
) -> tuple[Any, Any]:
    """The wanted d2p/dt2 of the base origin (world) and alpha (body): (82)-(85)."""
    R = case.R
    down = (KP * (case.p - case.p_d) + KV * (case.v - case.v_d)) / MASS - np.array(
        [0.0, 0.0, G]
    )
    if feedforward:
        down = down - case.a_d
    b3 = -down / np.linalg.norm(down)
    b2 = np.cross(b3, [np.cos(case.yaw), np.sin(case.yaw), 0.0])
    b2 /= np.linalg.norm(b2)
    R_d = np.stack([np.cross(b2, b3), b2, b3], axis=1)
    e_R = attitude_error(R, R_d)
    w_d = np.array([0.0, 0.0, case.yaw_rate])
    e_w = case.w - (R.T @ R_d @ w_d if corrected else R_d.T @ R @ w_d)
    alpha = np.linalg.inv(INERTIA) @ (-KR * e_R - KW * e_w)
    return -down - np.array([0.0, 0.0, G]), alpha


def joint_pd(case: Case, gains: tuple[Any, Any]) -> Any:
    return gains[0] * (case.q_d - case.q) + gains[1] * (case.qd_d - case.qd)


def mixed(torque: Any, thrust: float) -> Any:
    """Squared rotor speeds before the clip at zero."""
    return np.linalg.pinv(ALLOCATION) @ np.array([*torque, thrust])


class Pinocchio:
    """Free flyer and two y joints built by hand; the links have I_yy only, as Table 1
    gives them.
    """

    def __init__(self, pin: Any) -> None:
        self.pin = pin
        model = pin.Model()
        model.gravity.linear = np.array([0.0, 0.0, -G])
        base = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
        model.appendBodyToJoint(
            base, pin.Inertia(0.716, np.zeros(3), INERTIA), pin.SE3.Identity()
        )
        rod = pin.Inertia(
            0.04, np.array([0.0, 0.0, -0.075]), np.diag([0.0, 7.5e-5, 0.0])
        )
        tip = pin.Inertia(0.01, np.array([0.0, 0.0, -0.15]), np.zeros((3, 3)))
        first = model.addJoint(base, pin.JointModelRY(), pin.SE3.Identity(), "joint1")
        model.appendBodyToJoint(first, rod, pin.SE3.Identity())
        elbow = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.15]))
        second = model.addJoint(first, pin.JointModelRY(), elbow, "joint2")
        for body in (rod, tip):
            model.appendBodyToJoint(second, body, pin.SE3.Identity())
        self.model, self.data = model, model.createData()

    def inverse_dynamics(
        self, case: Case, linear: Any, alpha: Any, qdd: Any
    ) -> tuple[Any, Any, Any]:
        """Force and torque on the base (body axes) and joint torques for d2p/dt2
        (world), alpha (body), qdd.
        """
        w, x, y, z = case.quaternion
        v_B = case.R.T @ case.v
        configuration = np.concatenate([case.p, [x, y, z, w], case.q])
        velocity = np.concatenate([v_B, case.w, case.qd])
        # the free flyer's velocity is v_B, whose derivative is R^T d2p/dt2 - w x v_B
        acceleration = np.concatenate(
            [case.R.T @ linear - np.cross(case.w, v_B), alpha, qdd]
        )
        tau = self.pin.rnea(
            self.model, self.data, configuration, velocity, acceleration
        )
        return tau[:3], tau[3:6], tau[6:]


def rate_matrix(angles: Any) -> Any:
    """Q of (3): w_B = Q [phi', theta', psi']; complex angles for its derivative."""
    phi, theta = angles[0], angles[1]
    return np.array(
        [
            [1.0, 0.0, -np.sin(theta)],
            [0.0, np.cos(phi), np.sin(phi) * np.cos(theta)],
            [0.0, -np.sin(phi), np.cos(phi) * np.cos(theta)],
        ]
    )


class Blocks:
    """M, velocity products and weight of the 8x8 form at a state, as they are and
    mapped to [v_W, w_B, joint rates].
    """

    def __init__(self, case: Case) -> None:
        Q = rate_matrix(case.euler)
        rates = np.linalg.solve(Q, case.w)
        Q_rate = rate_matrix(case.euler.astype(complex) + 1e-30j * rates).imag / 1e-30
        self.q = np.concatenate([case.p, case.euler, case.q])
        self.qd = np.concatenate([case.v, rates, case.qd])
        self.turning = np.concatenate(
            [np.zeros(3), -np.linalg.solve(Q, Q_rate @ rates), np.zeros(2)]
        )
        self.to_euler = np.eye(8)
        self.to_euler[3:6, 3:6] = np.linalg.inv(Q)
        self.M_euler = el.mass_matrix(self.q)
        self.C_qd = el.coriolis_matrix(self.q, self.qd) @ self.qd
        self.M = self.to_euler.T @ self.M_euler @ self.to_euler
        self.velocity_products = self.to_euler.T @ (
            self.C_qd + self.M_euler @ self.turning
        )
        self.weight = self.to_euler.T @ el.gravity_vector(self.q, G)
        reduced = el.gravity_vector(self.q, G, reduced=True)
        self.reduced_weight = np.concatenate(
            [[0.0, 0.0, MASS * G, 0.0, 0.0, 0.0], reduced[6:]]
        )


def ablated(
    case: Case, *, coriolis: bool, coupling: bool, full_gravity: bool, feedforward: bool
) -> tuple[Any, Any]:
    """Squared rotor speeds and joint torques of the body form with terms left out, from
    the blocks.
    """
    blocks = Blocks(case)
    linear, alpha = accelerations(case, feedforward=feedforward)
    qdd = joint_pd(case, ACCELERATION) + (case.qdd_d if feedforward else 0.0)
    M = blocks.M.copy()
    if not coupling:
        M[:6, 6:], M[6:, :6] = 0.0, 0.0  # M_t_eta, M_r_eta and their transposes
    tau = M @ np.concatenate([linear, alpha, qdd])
    tau += blocks.velocity_products if coriolis else 0.0
    tau += blocks.weight if full_gravity else blocks.reduced_weight
    return mixed(tau[3:6], tau[:3] @ case.R[:, 2]), tau[6:]


def ablated_euler(case: Case, *, coriolis: bool, feedforward: bool) -> tuple[Any, Any]:
    """The same of the paper's Euler form: M qdd with (95), less C qd."""
    blocks = Blocks(case)
    linear, alpha = accelerations(case, feedforward=feedforward)
    qdd = joint_pd(case, ACCELERATION) + (case.qdd_d if feedforward else 0.0)
    wanted = blocks.to_euler @ np.concatenate([linear, alpha, qdd]) + blocks.turning
    tau = (
        blocks.M_euler @ wanted
        + el.gravity_vector(blocks.q, G)
        + (blocks.C_qd if coriolis else 0.0)
    )
    torque = blocks.to_euler[3:6, 3:6].T @ tau[3:6]
    return mixed(torque, tau[:3] @ case.R[:, 2]), tau[6:]


def choices(*names: str) -> list[dict[str, bool]]:
    """Every way to take or leave the named terms."""
    return [
        dict(zip(names, taken, strict=True))
        for taken in itertools.product((True, False), repeat=len(names))
    ]
