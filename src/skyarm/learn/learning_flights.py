"""Random motions in random winds on perturbed plants: the flights from which the network of the compensator learns."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from skyarm.algebra import Vec3
from skyarm.compare.suite import NOISE
from skyarm.control.controller import Controller
from skyarm.environment import ForceWind, Gust, Payload
from skyarm.plant.interface import Truth
from skyarm.reference import Trajectory, circle, hover
from skyarm.reference.signals import Sine
from skyarm.scenario.scenario_record import Scenario
from skyarm.sensors.noise import SensorNoise
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.vehicle.vehicle_records import Vehicle


def random_scenario(rng: np.random.Generator, controller: Controller, duration: float, index: int) -> Scenario:
    """A flight of the perturbed truth on a random motion in random wind; odd ones have the bench's noise.

    Args:
        rng: gives all that is random.
        controller: that flies it.
        duration: s.
        index: number of the flight.
    """
    truth = _perturbed(rng, load_vehicle("hummingbird_arm2_rotors"))
    direction = rng.normal(size=3) * [1.0, 1.0, 0.3]
    force = direction / np.linalg.norm(direction) * rng.uniform(0.0, 3.0)
    gust = rng.normal(size=3) * [1.0, 1.0, 0.3]
    wind = ForceWind(
        force_W=Vec3(*force.tolist()),
        air_velocity_W=Vec3(*(force * rng.uniform(0.0, 1.5)).tolist()),
        gust=Gust(
            peak=Vec3(*(gust / np.linalg.norm(gust) * rng.uniform(0.0, 3.0)).tolist()),
            start=float(rng.uniform(0.2, 0.6) * duration),
            duration=float(rng.uniform(0.5, 3.0)),
        ),
    )
    return Scenario(
        name=f"learn {index}",
        duration=duration,
        world=Truth(vehicle=truth, gravity=9.8),
        controller=controller,
        trajectory=_motion(rng),
        wind=wind,
        sensors=NOISE if noisy(index) else SensorNoise(),
        seed=int(rng.integers(2**31)),
        ground=False,
    )


def noisy(index: int) -> bool:
    """Whether a flight's sensors are noisy: every second one's."""
    return index % 2 == 1


def _perturbed(rng: np.random.Generator, vehicle: Vehicle) -> Vehicle:
    """Masses and inertias +-20 %, thrust -10 to +5 %, joint damping 0 to 0.02, payload 0 to 100 g."""
    base = dataclasses.replace(vehicle.base, mass=vehicle.base.mass * rng.uniform(0.9, 1.2))
    links = tuple(
        dataclasses.replace(
            link, body=dataclasses.replace(link.body, mass=link.body.mass * float(rng.uniform(0.8, 1.2)))
        )
        for link in vehicle.links
    )
    thrust = float(rng.uniform(0.9, 1.05))
    rotors = tuple(
        dataclasses.replace(rotor, thrust_coefficient=rotor.thrust_coefficient * thrust) for rotor in vehicle.rotors
    )
    changed = dataclasses.replace(vehicle, base=base, links=links, rotors=rotors)
    changed = changed.with_joints(damping=float(rng.uniform(0.0, 0.02)))
    mass = float(rng.uniform(-0.1, 0.1))
    return Payload(mass=mass).held_by(changed) if mass > 0.0 else changed


def _motion(rng: np.random.Generator) -> Trajectory:
    """A circle or a hover, joints on sines."""
    joints = tuple(
        Sine(
            amplitude=float(rng.uniform(0.0, 0.5)),
            frequency_hz=float(rng.uniform(0.1, 0.8)),
            phase=float(rng.uniform(0.0, 2.0 * math.pi)),
        )
        for _ in range(2)
    )
    center = [0.0, 0.0, 2.0]
    if rng.uniform() < 0.3:
        return hover(center, joints=joints)
    return circle(
        radius=float(rng.uniform(0.1, 1.0)), frequency_hz=float(rng.uniform(-0.2, 0.2)), center=center, joints=joints
    )
