"""Start vehicles of the published flights in tests/data/flights, by data sheets and drawings."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import skyarm
from skyarm.algebra import Sym3, Vec3
from skyarm.flight_data.flight_data import load_flight

FLIGHTS = Path(__file__).parent / "data" / "flights"
CRAZYFLIE_LOG = FLIGHTS / "crazyflie" / "log15_from_20_to_23_s"
TREFOIL_LOG = FLIGHTS / "nanobench" / "B9_trefoil_medium_rep4_from_20_to_23_s.csv"
IRIS_LOG = FLIGHTS / "gazebo_iris" / "quadrotor_model_from_20_to_23_s.csv"

CCW, CW = 1, -1


def quadrotor(name, mass, inertia, places, **numbers):
    """Rigid quadrotor with rotors at (x, y, direction)."""
    base = skyarm.load_vehicle("hummingbird")
    one = dataclasses.replace(base.rotors[0], drag_coefficient=0.0, rolling_moment_coefficient=0.0, **numbers)
    rotors = tuple(
        dataclasses.replace(one, name=f"m{i + 1}", position=Vec3(x, y, 0.0), direction=way)
        for i, (x, y, way) in enumerate(places)
    )
    xx, yy, zz = inertia
    body = dataclasses.replace(base.base, mass=mass, inertia=Sym3(xx, yy, zz, 0.0, 0.0, 0.0))
    return dataclasses.replace(base, name=name, base=body, rotors=rotors)


def crazyflie():
    """Crazyflie 2.1 with markers; motors in the firmware's order, front right first."""
    arm = 0.0325
    return quadrotor(
        "crazyflie",
        0.032,
        (1.6e-5, 1.6e-5, 2.9e-5),
        ((arm, -arm, CCW), (-arm, -arm, CW), (-arm, arm, CCW), (arm, arm, CW)),
        thrust_coefficient=2.9e-8,
        moment_coefficient=0.006,
        time_constant_up=0.03,
        time_constant_down=0.04,
        max_speed=2500.0,
    )


def iris():
    """3DR Iris as PX4's Gazebo has it."""
    return quadrotor(
        "iris",
        1.535,
        (0.029125, 0.029125, 0.055225),
        ((0.13, -0.22, CCW), (-0.13, 0.20, CCW), (0.13, 0.22, CW), (-0.13, -0.20, CW)),
        thrust_coefficient=5.84e-6,
        moment_coefficient=0.06,
        time_constant_up=0.0125,
        time_constant_down=0.025,
        max_speed=1100.0,
    )


def logged(path):
    """A published flight whose file is named flight.csv."""
    return dataclasses.replace(load_flight(path), file="flight.csv")
