"""Arms on position servos up to 20 % off those of a nominal one: on a bench, and in
flights that excite them.
"""

from __future__ import annotations

import dataclasses
import math
from functools import partial
from pathlib import Path

import numpy as np
from planted_vehicles import plant_numbers

import skyarm
from skyarm.dynamics.actuators.servo import PositionServo
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.flight_data.own_log import measured_flight
from skyarm.identify.identified_parts import vehicle_with
from skyarm.reference import Constant, Product, Sine, Sum, Trajectory
from skyarm.scenario.scenario_record import Delays, NamedSensor
from skyarm.sensing.sensor_kinds import Encoders, Imu
from skyarm.studies.tune.excitation import EASE, of_vehicle
from skyarm.vehicle.vehicle_records import MountedDrive

ARM = skyarm.load_vehicle("hummingbird_arm2_rotors")
STIFFNESS, DAMPING, ARMATURE, COULOMB = 4.0, 0.2, 1e-3, 0.01
"""N m/rad, N m s/rad, kg m^2, N m: a small geared servo, a tenth of a second from rest
to rest."""


def multisine(amplitude, low, high, count, seed):
    """Sines of random phases between two frequencies, Hz, that fade in from rest."""
    draw = np.random.default_rng(seed)
    rows = np.linspace(low, high, count)
    size = amplitude * math.sqrt(2.0 / count)
    sines = (
        Sine(
            amplitude=size * math.sqrt(low / f),
            frequency_hz=float(f),
            phase=float(draw.uniform(-3.0, 3.0)),
        )
        for f in rows
    )
    return Product(Sum(tuple(sines)), EASE)


def on_servos(vehicle):
    """The vehicle with a position servo on every joint."""
    joints = (
        dataclasses.replace(
            link.joint,
            damping=0.0,
            armature=ARMATURE,
            coulomb=COULOMB,
            coulomb_rate=0.1,
        )
        for link in vehicle.links
    )
    links = tuple(
        dataclasses.replace(link, joint=joint)
        for link, joint in zip(vehicle.links, joints, strict=True)
    )
    servo = PositionServo(
        stiffness=STIFFNESS, damping=DAMPING, inertia=ARMATURE, latency=0.003
    )
    drives = tuple(MountedDrive(name=link.joint.name, drive=servo) for link in links)
    return dataclasses.replace(vehicle, name="servo_arm", links=links, drives=drives)


NOMINAL = on_servos(ARM)


ONE = dataclasses.replace(
    NOMINAL,
    name="bench",
    links=NOMINAL.links[:1],
    drives=NOMINAL.drives[:1],
    frames=(),
    end_effector="",
)
"""The first joint alone."""


def servo_numbers(seed, vehicle=NOMINAL, off=0.2):
    """Numbers of the servos, by name."""
    draw, numbers = np.random.default_rng([seed, 77]), {}
    for link in vehicle.links:
        drive = f"drives.{link.joint.name}"
        numbers[f"{drive}.stiffness"] = STIFFNESS * draw.uniform(1.0 - off, 1.0 + off)
        numbers[f"{drive}.damping"] = DAMPING * draw.uniform(1.0 - off, 1.0 + off)
        numbers[f"{drive}.latency"] = draw.uniform(0.0, 0.012)
        numbers[f"links.{link.name}.joint.coulomb"] = COULOMB * draw.uniform(0.0, 3.0)
        numbers[f"links.{link.name}.joint.armature"] = ARMATURE * draw.uniform(
            1.0 - off, 1.0 + off
        )
    return numbers


def _with_given_setpoints(memory, seen, wanted, dt, *, par, inner):
    """A law whose joints are commanded by the reference's positions."""
    memory, command = inner(memory, seen, wanted, dt, par=par)
    return memory, dataclasses.replace(command, efforts=wanted.joints)


def planted_numbers(seed):
    """Numbers of a vehicle on servos, by name; the delay among them."""
    others = {
        name: value
        for name, value in plant_numbers(seed).items()
        if not name.endswith("damping")
    }
    return {**others, **servo_numbers(seed)}


def swing_on_bench(numbers, seed, duration=8.0, speed_limit=np.inf):
    """First joint of a base that is held, integrated by hand, as encoders of 4096 steps
    a turn measure it.

    A pendulum of the link below a level base: inertia q'' = stiffness (goal - q) -
    damping q' - friction - m g r sin q.
    """
    vehicle = vehicle_with(ONE, numbers, checked=True)
    servo, link, noise = (
        vehicle.drives[0].drive,
        vehicle.links[0],
        np.random.default_rng([seed, 5]),
    )
    reach, joint = -link.body.com.z, link.joint
    inertia = link.body.inertia.yy + link.body.mass * reach**2 + joint.armature
    weight, fine, period = link.body.mass * 9.81 * reach, 2.5e-4, 0.005
    time = np.arange(0.0, duration, period)
    phases = noise.uniform(-3.0, 3.0, 12)
    setpoints = 0.3 + 0.12 * np.sin(
        2.0 * np.pi * np.outer(time, np.linspace(0.2, 4.0, 12)) + phases
    ).sum(axis=1)
    heard = np.floor(
        (np.arange(round(duration / fine)) * fine - servo.latency) / period + 1e-9
    ).astype(int)
    targets, most = setpoints[np.maximum(heard, 0)].tolist(), speed_limit * fine
    q, v, goal, angles = targets[0], 0.0, targets[0], []

    def acceleration(q, v, goal):
        friction = joint.coulomb * math.tanh(v / joint.coulomb_rate)
        return (
            servo.stiffness * (goal - q)
            - servo.damping * v
            - friction
            - weight * math.sin(q)
        ) / inertia

    for k, target in enumerate(targets):
        if k % round(period / fine) == 0:
            angles.append(q)
        goal += min(max(target - goal, -most), most)
        middle = v + 0.5 * fine * acceleration(q, v, goal)
        v += fine * acceleration(q + 0.5 * fine * v, middle, goal)
        q += fine * middle
    tick = 2.0 * np.pi / 4096.0
    count = len(time)
    rows = {
        "gyro": noise.normal(scale=1e-3, size=(count, 3)),
        "accelerometer": (
            np.array([0.0, 0.0, 9.81]) + noise.normal(scale=0.01, size=(count, 3))
        ),
        "rotor_speed_commands": np.full((count, 4), 450.0),
        "joint_positions": tick * np.round(np.array(angles)[:, None] / tick),
        "joint_commands": setpoints[:, None],
    }
    channels = {
        name: Channel(time=time, values=values, source=name)
        for name, values in rows.items()
    }
    return FlightData(name=f"bench_{seed}", file="bench.npz", channels=channels)


def fly_servos(numbers, seed, duration=20.0, amplitude=0.4):
    """Flight of a planted vehicle on servos as its sensors measured it, and the
    vehicle.
    """
    vehicle = vehicle_with(NOMINAL, numbers, checked=True)
    base = of_vehicle(ARM)
    law = partial(_with_given_setpoints, inner=base.controller.law)
    path = Trajectory(
        x=multisine(0.3, 0.2, 0.9, 6, 1),
        y=multisine(0.3, 0.23, 0.95, 6, 2),
        z=Sum((Constant(10.0), multisine(0.3, 0.3, 1.1, 5, 3))),
        yaw=multisine(0.4, 0.17, 0.8, 5, 4),
        joints=tuple(
            Sum(
                (
                    Constant(0.3 * (i > 0)),
                    multisine(amplitude, 0.2 + 0.03 * i, 3.0 + 0.1 * i, 12, 5 + i),
                )
            )
            for i in range(vehicle.n)
        ),
    )
    log = skyarm.run(
        dataclasses.replace(
            base,
            controller=dataclasses.replace(base.controller, law=law),
            plant=dataclasses.replace(base.plant, vehicle=vehicle),
            reference=path,
            duration=duration,
            delays=Delays(measurement=0.005, command=numbers["delay"]),
            sensors=(
                NamedSensor(name="imu", sensor=Imu()),
                NamedSensor(name="encoders", sensor=Encoders()),
            ),
            seed=seed,
        )
    )
    return vehicle, measured_flight(log, Path(f"servos_{seed}.npz"))
