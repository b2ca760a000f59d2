"""Vehicles and states of the plant tests, written by hand."""

from __future__ import annotations

import dataclasses

import numpy as np

from skyarm.algebra import Quaternion, Sym3, Vec3
from skyarm.dynamics import State
from skyarm.plant.surroundings import Surroundings
from skyarm.vehicle.linkage import BASE, Body, Joint, Link
from skyarm.vehicle.vehicle_records import BodyDrag, Frame, Rotor, Vehicle
from skyarm.world import Effectiveness, WindSample
from vehicles_random import random_vehicle

HOVER = 485.08
"""rad/s: 0.82103 kg at 9.8 m/s^2."""


def steady_wind(*wind: Vec3, effectiveness: Effectiveness | None = None, **named: Vec3) -> Surroundings:
    """Surroundings that never change: the force and the air of one sample."""
    return Surroundings(components=(WindSample(*wind, **named),), memories=((),), time=0, effectiveness=effectiveness)


WIND = steady_wind(Vec3(1.3, -0.7, 0.4), Vec3(0.02, -0.03, 0.05), Vec3(2.0, 1.0, -0.5))


def rotor(name: str, x: float, y: float, direction: int) -> Rotor:
    return Rotor(
        name=name,
        position=Vec3(x, y, 0.01),
        direction=direction,
        thrust_coefficient=8.54858e-6,
        moment_coefficient=0.016,
        drag_coefficient=8.06428e-5,
        rolling_moment_coefficient=1e-6,
        max_speed=838.0,
    )


ROTORS = (
    rotor("front", 0.17, 0.0, -1),
    rotor("left", 0.0, 0.17, 1),
    rotor("back", -0.17, 0.0, -1),
    rotor("right", 0.0, -0.17, 1),
)


def hummingbird_arm(**joint_fields: float) -> Vehicle:
    """0.73103 kg airframe and two links of 0.045 kg; link inertias are those of a rod 0.02 m thick."""
    fields = {"damping": 0.001} | joint_fields
    com = 4 * 0.009 * 0.01 / 0.73103
    steiner = 0.73103 * com * com
    base = Body(mass=0.73103, com=Vec3(0, 0, com), inertia=Sym3(0.0077174 - steiner, 0.0077174 - steiner, 0.0130804))
    limb = Body(mass=0.045, com=Vec3(0, 0, -0.075), inertia=Sym3(8.6e-5, 8.6e-5, 3e-6))
    shoulder = Joint(name="shoulder", position=Vec3(0, 0, -0.05), **fields)
    elbow = Joint(name="elbow", position=Vec3(0, 0, -0.15), **fields)
    return Vehicle(
        name="hummingbird_arm",
        base=base,
        links=(
            Link(name="upper", parent=BASE, joint=shoulder, body=limb),
            Link(name="lower", parent=0, joint=elbow, body=limb),
        ),
        rotors=ROTORS,
        frames=(Frame(name="tip", link=1, position=Vec3(0, 0, -0.15)),),
        end_effector="tip",
    )


def random_flyer(seed: int, joints: int) -> Vehicle:
    """Any tree of joints with friction and limits under four tilted rotors, with body drag."""
    rng = np.random.default_rng([7, seed, joints])
    vehicle = random_vehicle(rng, joints)
    links = tuple(
        dataclasses.replace(
            link,
            joint=dataclasses.replace(
                link.joint, damping=0.02, coulomb=0.01, coulomb_rate=0.5, effort_limit=float(rng.uniform(0.05, 0.5))
            ),
        )
        for link in vehicle.links
    )
    tilts = rng.normal(size=(4, 3)) * 0.2 + np.array([0.0, 0.0, 1.0])
    rotors = tuple(
        dataclasses.replace(each, axis=Vec3(*(tilt / np.linalg.norm(tilt)).tolist()))
        for each, tilt in zip(ROTORS, tilts, strict=True)
    )
    drag = BodyDrag(area=Vec3(0.01, 0.02, 0.03))
    return dataclasses.replace(vehicle, links=links, rotors=rotors, drag=drag)


def hovering(vehicle: Vehicle) -> State:
    """Level, arm bent and moving."""
    return State(
        position=Vec3(0.1, -0.2, 1.0),
        quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
        velocity=Vec3(0.0, 0.0, 0.0),
        rate=Vec3(0.0, 0.0, 0.0),
        joints=tuple(0.4 - 0.3 * i for i in range(vehicle.n)),
        joint_rates=tuple(0.5 + 0.2 * i for i in range(vehicle.n)),
        rotor_speeds=(HOVER,) * len(vehicle.rotors),
    )


def tumbling(vehicle: Vehicle, seed: int = 1) -> State:
    """Any attitude, several rad/s about every axis, joints whirling."""
    rng = np.random.default_rng([11, seed])
    q = rng.normal(size=4)
    q /= np.linalg.norm(q)
    rate = rng.normal(size=3)
    rate *= 4.0 / np.linalg.norm(rate)
    return State(
        position=Vec3(*rng.normal(size=3).tolist()),
        quaternion=Quaternion(*q.tolist()),
        velocity=Vec3(*rng.normal(size=3).tolist()),
        rate=Vec3(*rate.tolist()),
        joints=tuple(rng.uniform(-3.0, 3.0, size=vehicle.n).tolist()),
        joint_rates=tuple(
            (6.0 if link.joint.kind == "revolute" else 0.3) * float(sign)
            for link, sign in zip(vehicle.links, rng.choice([-1.0, 1.0], size=vehicle.n), strict=True)
        ),
        rotor_speeds=tuple(rng.uniform(100.0, 700.0, size=len(vehicle.rotors)).tolist()),
    )
