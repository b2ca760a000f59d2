"""Gentle states and references of the published laws, and their formulas by NumPy."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.polynomial import Chebyshev
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.control.blocks.prediction import Disturbance
from skyarm.control.model import Model
from skyarm.reference import Reference
from skyarm.sensing.measurement import Measurement
from support.laws import make_law, pushes, scalars
from support.vehicles import RandomState

ARM = skyarm.load_vehicle("hummingbird_arm2_rotors").with_joints(effort_limit=np.inf)
MODEL = Model(vehicle=ARM, gravity=9.81)
DT = 0.005
UP = np.array([0.0, 0.0, 9.81])


def vec(values) -> Vec3:
    return Vec3(*(float(value) for value in values))


def rotation(state: RandomState):
    w, x, y, z = state.quaternion
    return Rotation.from_quat([x, y, z, w])


def gentle(seed: int, joints: int = 2) -> RandomState:
    """A state whose tilt is below 40 degrees: no rotor is asked for less than
    nothing.
    """
    rng = np.random.default_rng(seed)
    x, y, z, w = Rotation.from_euler(
        "ZYX", [rng.uniform(-3, 3), *rng.uniform(-0.3, 0.3, 2)]
    ).as_quat()
    return RandomState(
        position=0.02 * rng.normal(size=3),
        quaternion=np.array([w, x, y, z]),
        joints=rng.uniform(-0.5, 0.5, joints),
        velocity=np.concatenate(
            [
                0.05 * rng.normal(size=3),
                0.1 * rng.normal(size=3),
                0.3 * rng.normal(size=joints),
            ]
        ),
    )


def measured(state: RandomState, vehicle=ARM) -> Measurement:
    return Measurement(
        time=0.0,
        position=vec(state.position),
        quaternion=Quaternion(*state.quaternion.tolist()),
        velocity=vec(state.velocity[:3]),
        rate=vec(state.velocity[3:6]),
        specific_force=Vec3(0.0, 0.0, 9.81),
        joints=tuple(state.joints.tolist()),
        joint_rates=tuple(state.velocity[6:].tolist()),
        rotor_speeds=(480.0,) * len(vehicle.rotors),
    )


def wanted(seed: int) -> Reference:
    rng = np.random.default_rng(seed + 1000)
    return Reference(
        position=vec(0.02 * rng.normal(size=3)),
        velocity=vec(0.05 * rng.normal(size=3)),
        acceleration=vec(0.3 * rng.normal(size=3)),
        yaw=float(rng.uniform(-3, 3)),
        joints=tuple(rng.uniform(-0.5, 0.5, 2).tolist()),
        joint_rates=tuple(rng.normal(size=2).tolist()),
        joint_accelerations=tuple(rng.normal(size=2).tolist()),
    ).dense()


def soft(law: str, vehicle=ARM, **options):
    """The law with a heading loop too weak to clip a rotor."""
    controller = make_law(law, dataclasses.replace(MODEL, vehicle=vehicle), **options)
    gains = controller.par.gains
    weak = dataclasses.replace(
        gains, attitude=gains.attitude * 0.05, rate=gains.rate * 0.05
    )
    return dataclasses.replace(
        controller, par=dataclasses.replace(controller.par, gains=weak)
    )


def asked(controller, state, reference):
    """Body torque, thrust and joint efforts of a command that no limit has touched."""
    command = controller.law(
        controller.memory, measured(state), reference, DT, par=controller.par
    )[1]
    assert min(command.rotor_speeds) > 0.0
    return *pushes(ARM, command), scalars(command.efforts)


def pd_specific_force(controller, state, reference):
    gains, m = controller.par.gains, float(ARM.mass)
    kp, kv = np.array(tuple(gains.position)) / m, np.array(tuple(gains.velocity)) / m
    pull = kp * (np.array(tuple(reference.position)) - state.position)
    pull += kv * (np.array(tuple(reference.velocity)) - state.velocity[:3])
    return pull + np.array(tuple(reference.acceleration)) + UP


def joint_wish(controller, state, reference):
    gains = controller.par.joint_gains
    error = np.array(reference.joints) - state.joints
    drift = np.array(reference.joint_rates) - state.velocity[6:]
    return (
        np.array(gains.stiffness) * error
        + np.array(gains.damping) * drift
        + np.array(reference.joint_accelerations)
    )


def geometric_alpha(controller, state, reference, up):
    """Lee's law by NumPy: -J^-1 (KR e_R + Kw e_w) towards ``up``."""
    R = rotation(state).as_matrix()
    b3 = up / np.linalg.norm(up)
    b2 = np.cross(b3, [np.cos(reference.yaw), np.sin(reference.yaw), 0.0])
    b2 /= np.linalg.norm(b2)
    R_d = np.column_stack([np.cross(b2, b3), b2, b3])
    E = 0.5 * (R_d.T @ R - R.T @ R_d)
    e_R = np.array([E[2, 1], E[0, 2], E[1, 0]])
    gains = controller.par.gains
    torque = (
        np.array(tuple(gains.attitude)) * e_R
        + np.array(tuple(gains.rate)) * state.velocity[3:6]
    )
    J = controller.par.model.vehicle.base.inertia
    return -np.linalg.solve(
        np.array([list(r) for r in J.full().rows], dtype=float), torque
    )


SEEDS = range(12)
NOTHING = Disturbance(
    force=vec(np.zeros(3)), torque=vec(np.zeros(3)), efforts=(0.0, 0.0)
)
NODES = np.cos(np.pi * (np.arange(24) + 0.5) / 24) * 0.2
"""Chebyshev nodes on 0.4 s: interpolation differentiates smooth signals four times to
about 1e-8."""


def differentiated(values, order=4, share=1.0):
    """Derivatives at t = 0 of samples at ``share`` times NODES, by interpolation."""
    columns = np.asarray(values, dtype=float).reshape(len(NODES), -1).T
    fits = [
        Chebyshev.fit(share * NODES, column, 23, domain=[-0.2 * share, 0.2 * share])
        for column in columns
    ]
    return [
        np.array([fit.deriv(k)(0.0) if k else fit(0.0) for fit in fits])
        for k in range(order + 1)
    ]
