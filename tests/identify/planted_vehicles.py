"""Vehicles with arms whose numbers are up to 20 % off those of a nominal one, and
flights that excite them.

Vehicles whose motors and joint drives lag, for tests that find it again.
"""

from __future__ import annotations

import dataclasses
import warnings
from pathlib import Path

import numpy as np

import skyarm
from skyarm.dynamics.actuators.drive import LaggedTorque
from skyarm.flight_data.own_log import measured_flight
from skyarm.identify.identified_parts import vehicle_with
from skyarm.identify.unknowns import second_moments
from skyarm.scenario.scenario_record import JointDrive
from skyarm.scenario.without_effect import WithoutEffectWarning

NOMINAL = skyarm.load_vehicle("hummingbird_arm2_rotors")
OFF = 0.2
DESIGNED = Path(__file__).parents[1] / "data" / "designed_flight.toml"


def plant_numbers(seed):
    """Numbers of a vehicle, by name of the unknown; the delay among them, a whole
    number of milliseconds.
    """
    draw = np.random.default_rng(seed)
    rotor, base = NOMINAL.rotors[0], NOMINAL.base

    def off(value):
        return float(value) * draw.uniform(1.0 - OFF, 1.0 + OFF)

    of_rotors = (
        "thrust_coefficient",
        "moment_coefficient",
        "time_constant_up",
        "time_constant_down",
    )
    numbers = {
        f"rotors.{name}": off(getattr(rotor, name))
        for name in (*of_rotors, "drag_coefficient")
    }
    for axis, moment in zip("xyz", second_moments(base), strict=True):
        numbers[f"base.second_moment.{axis}"] = off(moment)
        numbers[f"base.com.{axis}"] = float(getattr(base.com, axis)) + draw.uniform(
            -0.005, 0.005
        )
    for link in NOMINAL.links:
        name = f"links.{link.name}"
        numbers[f"{name}.mass"], numbers[f"{name}.inertia"] = (
            off(link.body.mass),
            off(1.0),
        )
        numbers[f"{name}.com.z"] = off(link.body.com.z)
        numbers[f"{name}.joint.damping"] = off(link.joint.damping)
    numbers["delay"] = int(draw.integers(0, 10)) * 1e-3
    return numbers


def fly_designed(seed, duration=60.0, more=None):
    """A planted vehicle's numbers, the vehicle, and its flight on the path designed for
    the nominal one.
    """
    numbers = plant_numbers(seed) | (more or {})
    vehicle = vehicle_with(NOMINAL, numbers, checked=True)
    with warnings.catch_warnings():
        # its inertial unit is for the log
        warnings.simplefilter("ignore", WithoutEffectWarning)
        designed = skyarm.load_scenario(str(DESIGNED))
    log = skyarm.run(
        dataclasses.replace(
            designed,
            plant=dataclasses.replace(designed.plant, vehicle=vehicle),
            delays=dataclasses.replace(designed.delays, command=numbers["delay"]),
            duration=duration,
            seed=seed,
        )
    )
    assert log.info["status"] == "completed"
    return numbers, vehicle, measured_flight(log, Path(f"designed_{seed}.npz"))


def weighed(vehicle):
    """The nominal vehicle with the total mass of a planted one, which a scale tells."""
    mass = NOMINAL.base.mass + vehicle.mass - NOMINAL.mass
    return dataclasses.replace(
        NOMINAL, base=dataclasses.replace(NOMINAL.base, mass=mass)
    )


def with_slower_motors(vehicle, times):
    """The vehicle with the time constants of its motors so many times as long."""
    rotors = tuple(
        dataclasses.replace(
            each,
            time_constant_up=times * each.time_constant_up,
            time_constant_down=times * each.time_constant_down,
        )
        for each in vehicle.rotors
    )
    return dataclasses.replace(vehicle, rotors=rotors)


def lagging_drives(vehicle, lag):
    """A drive with a lag (s) for every joint; none where there is no lag."""
    return tuple(
        JointDrive(joint=link.joint.name, drive=LaggedTorque(time_constant=lag))
        for link in vehicle.links
        if lag
    )
