"""Drawn models, states and goals of the predictive laws, and their accelerations by
Pinocchio.
"""

from __future__ import annotations

import dataclasses

import numpy as np

import skyarm
from skyarm.algebra import Quaternion
from skyarm.control.blocks.prediction import Disturbance
from skyarm.control.laws.predictive.cost import StageGoal
from skyarm.control.model import Model
from skyarm.dynamics import State
from support.laws import scalars, vec
from support.vehicles import (
    PinocchioTwin,
    random_state,
    random_vehicle,
    rotation_matrix,
)

GRAVITY = 9.81
ROTORS = skyarm.load_vehicle("hummingbird_arm2_rotors").rotors


def belief(seed, joints=3):
    """Any arm with damped and dry joints under rotors that drag."""
    rng = np.random.default_rng(seed)
    vehicle = random_vehicle(rng, joints=joints)

    def rough(joint):
        damping, coulomb = float(rng.uniform(0.1, 0.5)), float(rng.uniform(0.1, 0.5))
        return dataclasses.replace(
            joint, damping=damping, coulomb=coulomb, coulomb_rate=0.7
        )

    links = tuple(
        dataclasses.replace(link, joint=rough(link.joint)) for link in vehicle.links
    )
    return Model(
        vehicle=dataclasses.replace(vehicle, links=links, rotors=ROTORS),
        gravity=GRAVITY,
    )


def drawn(seed, joints=3):
    rng = np.random.default_rng(seed + 50)
    r = random_state(rng, joints)
    state = State(
        position=vec(r.position),
        quaternion=Quaternion(*r.quaternion.tolist()),
        velocity=vec(r.velocity[:3]),
        rate=vec(r.velocity[3:6]),
        joints=tuple(r.joints.tolist()),
        joint_rates=tuple(r.velocity[6:].tolist()),
        rotor_speeds=tuple(rng.uniform(300.0, 700.0, len(ROTORS)).tolist()),
    )
    efforts = tuple(rng.normal(size=joints).tolist())
    unknown = Disturbance(
        force=vec(rng.normal(size=3)),
        torque=vec(rng.normal(size=3)),
        efforts=tuple(rng.normal(size=joints).tolist()),
    )
    return r, state, efforts, unknown


def rotor_wrench(speeds, v_B, w_B):
    """Force and torque about the base origin, rotor by rotor: thrust, drag torque, hub
    drag and rolling moment.
    """
    force, torque = np.zeros(3), np.zeros(3)
    for rotor, speed in zip(ROTORS, speeds, strict=True):
        place, axis = scalars(rotor.position), scalars(rotor.axis)
        wind = v_B + np.cross(w_B, place)
        across = wind - axis * (axis @ wind)
        thrust = float(rotor.thrust_coefficient) * speed**2 * axis
        pull = thrust - float(rotor.drag_coefficient) * speed * across
        torque += (
            np.cross(place, pull)
            - rotor.direction * float(rotor.moment_coefficient) * thrust
        )
        torque -= float(rotor.rolling_moment_coefficient) * speed * across
        force += pull
    return force, torque


def true_accelerations(model, r, speeds, efforts, unknown, dry_rates=None):
    R = rotation_matrix(r.quaternion)
    force, torque = rotor_wrench(speeds, R.T @ r.velocity[:3], r.velocity[3:6])
    damping = np.array([float(link.joint.damping) for link in model.vehicle.links])
    dry = np.array([float(link.joint.coulomb) for link in model.vehicle.links])
    dry = dry * np.tanh(
        (r.velocity[6:] if dry_rates is None else np.array(dry_rates)) / 0.7
    )
    pulled = (
        np.array(efforts) - damping * r.velocity[6:] - dry + np.array(unknown.efforts)
    )
    applied = np.concatenate(
        [R @ force + scalars(unknown.force), torque + scalars(unknown.torque), pulled]
    )
    return PinocchioTwin(model.vehicle).forward_dynamics(r, applied)


def goal_of(seed, joints):
    rng = np.random.default_rng(seed + 90)
    return StageGoal(
        position=vec(rng.normal(size=3)),
        velocity=vec(rng.normal(size=3)),
        yaw=float(rng.uniform(-3.0, 3.0)),
        joints=tuple(rng.normal(size=joints).tolist()),
        joint_rates=tuple(rng.normal(size=joints).tolist()),
        joint_accelerations=tuple(rng.normal(size=joints).tolist()),
        shift=vec(rng.normal(size=3)),
    )
