"""Flights without noise of a quadrotor and of one joint below it, whose states, commands and delays are all known."""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np

import skyarm
from skyarm.control.catalogue import make_controller, suitable_options
from skyarm.dynamics.actuators.servo import PositionServo
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.reference import Constant, Product, Ramp, Sine, Sum, Trajectory
from skyarm.scenario.controller_table import loop_facts
from skyarm.scenario.scenario_record import Delays, Rates
from skyarm.studies.tune.excitation import of_vehicle
from skyarm.vehicle.vehicle_records import MountedDrive

STEP, GRAVITY = 0.002, 9.81
"""s, between samples and between commands, and m/s^2."""

QUAD = skyarm.load_vehicle("hummingbird")
ARM = skyarm.load_vehicle("hummingbird_arm2_rotors")


def _one_joint():
    """The first joint of the arm alone, with friction and the reflected inertia of its motor."""
    joint = dataclasses.replace(ARM.links[0].joint, damping=0.01, coulomb=0.01, coulomb_rate=0.2, armature=1e-3)
    links = (dataclasses.replace(ARM.links[0], joint=joint),)
    return dataclasses.replace(ARM, name="one_joint", links=links, frames=(), end_effector="")


ONE = _one_joint()


def on_servo(**numbers):
    """One joint on a position servo, whose damping holds that of the joint."""
    (link,) = ONE.links
    link = dataclasses.replace(link, joint=dataclasses.replace(link.joint, damping=0.0))
    servo = PositionServo(**{"stiffness": 4.0, "damping": 0.2, "inertia": 1e-3, **numbers})
    return dataclasses.replace(ONE, links=(link,), drives=(MountedDrive(name=link.joint.name, drive=servo),))


def multisine(size, low, high, count, seed):
    """Sines of random phases between two frequencies, Hz, that grow from rest in half a second."""
    draw = np.random.default_rng(seed)
    sines = (
        Sine(amplitude=size * low / (f * count**0.5), frequency_hz=float(f), phase=float(draw.uniform(-3.0, 3.0)))
        for f in np.linspace(low, high, count)
    )
    return Product(Sum(tuple(sines)), Ramp(start=0.0, duration=0.5, height=1.0, shape="quintic"))


def path(vehicle, swing=0.8, pace=1.0):
    """Reference that excites every axis, and joints by a swing, rad; slower by a pace below 1."""
    size = 0.5
    return Trajectory(
        x=multisine(size, 0.4 * pace, 1.6 * pace, 5, 1),
        y=multisine(size, 0.45 * pace, 1.7 * pace, 5, 2),
        z=Sum((Constant(10.0), multisine(size, 0.3 * pace, 1.3 * pace, 5, 3))),
        yaw=multisine(size, 0.3 * pace, 1.0 * pace, 5, 4),
        joints=tuple(Sum((Constant(0.4), multisine(swing, 0.5, 2.5, 6, 5 + i))) for i in range(vehicle.n)),
    )


def unheard(base):
    """The centroidal law of a scenario without its accelerometer: the data stay those of noisier commands."""
    facts = suitable_options("centroidal", loop_facts(base.rates, base.delays))
    mode = "tip" if base.plant.vehicle.end_effector else "joint"
    return make_controller("centroidal", base.controller.par.model, mode=mode, accelerometer=(0.0, 0.0), **facts)


@cache
def flown(vehicle, duration, rotors=0.0, joints=0.0, swing=0.8, pace=1.0):
    """Log of a closed loop at 500 Hz whose commands reach rotors and joints late, s."""
    base = of_vehicle(dataclasses.replace(vehicle, drives=()))
    scenario = dataclasses.replace(
        base,
        controller=_by_setpoints(unheard(base)) if vehicle.drives else unheard(base),
        plant=dataclasses.replace(base.plant, vehicle=vehicle),
        reference=path(vehicle, swing, pace),
        duration=duration,
        rates=Rates(physics=10_000, control=500, reference=50),
        delays=Delays(measurement=0.002, rotors=rotors, joints=joints),
    )
    log = skyarm.run(scenario)
    assert log.info["status"] == "completed"
    return log


def _by_setpoints(controller):
    """The control law with the reference's positions as setpoints of the joints."""

    def law(memory, seen, wanted, dt, *, par, inner=controller.law):
        memory, command = inner(memory, seen, wanted, dt, par=par)
        return memory, dataclasses.replace(command, efforts=wanted.joints)

    return dataclasses.replace(controller, law=law)


def mean_forces(log, place=(0.0, 0.0, 0.0)):
    """Specific force (rows - 1, 3) at a place of the base, m/s^2, by what the velocity there gains over each period."""
    R = rotations(log.quaternion)
    velocity = log.velocity + np.einsum("kij,kj->ki", R, np.cross(log.rate, np.array(place)))
    gained = np.diff(velocity, axis=0) / np.diff(log.time)[:, None] + np.array([0.0, 0.0, GRAVITY])
    half = log.quaternion[1:] + log.quaternion[:-1]
    return np.einsum("kji,kj->ki", rotations(half / np.linalg.norm(half, axis=1, keepdims=True)), gained)


def rotations(quaternion):
    """Rotation matrices (N, 3, 3) of attitudes (N, 4), w x y z."""
    w, x, y, z = quaternion.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


NOISE = {
    "gyro": 2e-3,
    "accelerometer": 0.02,
    "position": 5e-4,
    "quaternion": 5e-4,
    "velocity": 5e-3,
    "joint_positions": 2e-4,
}
"""Standard deviations of good sensors, SI units."""


def measured(log, *, noise=0.0, place=(0.0, 0.0, 0.0), late=0.0, without=(), name="flight", seed=0, servo=False):
    """Flight as sensors measure it at every period; the mean specific force has the time of its middle.

    Args:
        log: of the simulation.
        noise: times that of good sensors.
        place: m, of the inertial unit.
        late: s, of the stamps of the pose.
        without: quantities that are left out.
        name: of the flight.
        seed: of the noise.
        servo: whether the joints' commands are setpoints.
    """
    draw, pose = np.random.default_rng(seed), ("position", "quaternion", "velocity")
    rows = {
        "gyro": log.rate,
        "accelerometer": np.concatenate([[[0.0, 0.0, GRAVITY]], mean_forces(log, place)]),
        "position": log.position,
        "quaternion": log.quaternion,
        "velocity": log.velocity,
        "rotor_speed_commands": log.rotor_commands,
    }
    if log.joints.shape[1]:
        rows |= {"joint_positions": log.joints, "joint_commands" if servo else "joint_efforts": log.efforts}
    channels = {}
    for each, values in rows.items():
        if each in without:
            continue
        size = noise * NOISE.get(each, 0.0) * (0.5 if each == "quaternion" else 1.0)
        noisy = values + size * draw.standard_normal(values.shape)
        if each == "quaternion":
            noisy = noisy / np.linalg.norm(noisy, axis=1, keepdims=True)
        shift = late if each in pose else -0.5 * STEP if each == "accelerometer" else 0.0
        channels[each] = Channel(time=log.time + shift, values=noisy, source=each)
    return FlightData(name=name, file=f"{name}.npz", channels=channels)
