"""Vehicles with arms whose numbers are up to 20 % off those of a nominal one, and flights that excite them."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np

import skyarm
from skyarm.flight_data.own_log import measured_flight
from skyarm.reference import Constant, Product, Sine, Sum, Trajectory
from skyarm.scenario.scenario_record import Delays, NamedSensor
from skyarm.sensing.sensor_kinds import Encoders, Imu
from skyarm.studies.identify.identified_parts import vehicle_with
from skyarm.studies.identify.unknowns import second_moments
from skyarm.studies.tune.excitation import EASE, of_vehicle

NOMINAL = skyarm.load_vehicle("hummingbird_arm2_rotors")
OFF = 0.2
DESIGNED = Path(__file__).parent / "data" / "designed_flight.toml"


def plant_numbers(seed):
    """Numbers of a vehicle, by name of the unknown; the delay among them, a whole number of milliseconds."""
    draw = np.random.default_rng(seed)
    rotor, base = NOMINAL.rotors[0], NOMINAL.base

    def off(value):
        return float(value) * draw.uniform(1.0 - OFF, 1.0 + OFF)

    of_rotors = ("thrust_coefficient", "moment_coefficient", "time_constant_up", "time_constant_down")
    numbers = {f"rotors.{name}": off(getattr(rotor, name)) for name in (*of_rotors, "drag_coefficient")}
    for axis, moment in zip("xyz", second_moments(base), strict=True):
        numbers[f"base.second_moment.{axis}"] = off(moment)
        numbers[f"base.com.{axis}"] = float(getattr(base.com, axis)) + draw.uniform(-0.005, 0.005)
    for link in NOMINAL.links:
        name = f"links.{link.name}"
        numbers[f"{name}.mass"], numbers[f"{name}.inertia"] = off(link.body.mass), off(1.0)
        numbers[f"{name}.com.z"] = off(link.body.com.z)
        numbers[f"{name}.joint.damping"] = off(link.joint.damping)
    numbers["delay"] = int(draw.integers(0, 10)) * 1e-3
    return numbers


def multisine(amplitude, low, high, count, seed):
    """Sines of random phases between two frequencies, Hz, that fade in from rest."""
    draw = np.random.default_rng(seed)
    rows = np.linspace(low, high, count)
    size = amplitude * math.sqrt(2.0 / count)
    sines = (
        Sine(amplitude=size * math.sqrt(low / f), frequency_hz=float(f), phase=float(draw.uniform(-3.0, 3.0)))
        for f in rows
    )
    return Product(Sum(tuple(sines)), EASE)


def fly_planted(seed, duration=60.0, more=None):
    """A planted vehicle's numbers, the vehicle, and its flight as its sensors measured it."""
    numbers = plant_numbers(seed) | (more or {})
    vehicle = vehicle_with(NOMINAL, numbers, checked=True)
    base = of_vehicle(NOMINAL)
    joints = tuple(
        Sum((Constant(0.3 * (i > 0)), multisine(0.5, 0.2 + 0.03 * i, 1.6 + 0.1 * i, 7, 5 + i)))
        for i in range(vehicle.n)
    )
    path = Trajectory(
        x=multisine(0.35, 0.2, 1.0, 6, 1),
        y=multisine(0.35, 0.23, 1.07, 6, 2),
        z=Sum((Constant(10.0), multisine(0.3, 0.3, 1.1, 5, 3))),
        yaw=multisine(0.5, 0.17, 0.8, 5, 4),
        joints=joints,
    )
    log = skyarm.run(
        dataclasses.replace(
            base,
            plant=dataclasses.replace(base.plant, vehicle=vehicle),
            reference=path,
            duration=duration,
            delays=Delays(measurement=0.005, command=numbers["delay"]),
            sensors=(NamedSensor(name="imu", sensor=Imu()), NamedSensor(name="encoders", sensor=Encoders())),
            seed=seed,
        )
    )
    return numbers, vehicle, measured_flight(log, Path(f"planted_{seed}.npz"))


def fly_designed(seed):
    """A planted vehicle's numbers, the vehicle, and its flight of a minute on the path designed for the nominal one."""
    numbers = plant_numbers(seed)
    vehicle = vehicle_with(NOMINAL, numbers, checked=True)
    designed = skyarm.load_scenario(str(DESIGNED))
    log = skyarm.run(
        dataclasses.replace(
            designed,
            plant=dataclasses.replace(designed.plant, vehicle=vehicle),
            delays=dataclasses.replace(designed.delays, command=numbers["delay"]),
            seed=seed,
        )
    )
    assert log.info["status"] == "completed"
    return numbers, vehicle, measured_flight(log, Path(f"designed_{seed}.npz"))


def weighed(vehicle):
    """The nominal vehicle with the total mass of a planted one, which a scale tells."""
    mass = NOMINAL.base.mass + vehicle.mass - NOMINAL.mass
    return dataclasses.replace(NOMINAL, base=dataclasses.replace(NOMINAL.base, mass=mass))
