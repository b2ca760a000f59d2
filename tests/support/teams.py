"""Teams of vehicles that hold bodies: scenarios of the tests, a law that does nothing,
and sums over all bodies.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.records.arrays import Array
from skyarm.scenario.scenario_record import Scenario
from skyarm.world.contact.contact import Contact

TEAMS = Path(__file__).parents[1] / "data" / "teams"

GRAVITY = 9.81


def team(name: str, **options: Any) -> Scenario:
    """Scenario of a team of the tests, by the name of its file."""
    return skyarm.load_scenario(TEAMS / f"{name}.toml", **options)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Constants:
    """Constants of a law of the tests, which needs no clocks."""

    model: skyarm.Model


def nothing(
    memory: Any, _measurement: Any, _reference: Any, _dt: Any, *, par: Any
) -> tuple[Any, Command]:
    """Law whose rotors stand still and whose joints get no effort."""
    vehicle = par.model.vehicle
    return memory, Command(
        rotor_speeds=(0.0,) * len(vehicle.rotors), efforts=(0.0,) * vehicle.n
    )


def with_law(scenario: Scenario, law: Any) -> Scenario:
    """Scenario whose vehicles are all under a law of the tests."""

    def under(agent: Any) -> Any:
        controller = agent.controller
        own = skyarm.Controller(
            name="of a test", law=law, par=Constants(model=controller.par.model)
        )
        return dataclasses.replace(agent, controller=own)

    return dataclasses.replace(
        scenario, agents={name: under(each) for name, each in scenario.agents.items()}
    )


def with_world(scenario: Scenario, **fields: Any) -> Scenario:
    """Scenario with fields of its world replaced."""
    world: Contact = dataclasses.replace(scenario.world, **fields)
    return dataclasses.replace(
        scenario, environment=dataclasses.replace(scenario.environment, world=world)
    )


def with_grasps(scenario: Scenario, **fields: Any) -> Scenario:
    """Scenario with fields of all its grasps replaced."""
    assert scenario.world is not None
    return with_world(
        scenario,
        grasps=tuple(
            dataclasses.replace(each, **fields) for each in scenario.world.grasps
        ),
    )


def adrift(
    scenario: Scenario, seed: int, speed: float = 0.5, turning: float = 1.0
) -> Scenario:
    """Scenario without gravity and with rotors off, whose vehicles begin with random
    velocities.
    """
    rng = np.random.default_rng(seed)

    def thrown(agent: Any) -> Any:
        vehicle, start = agent.plant.vehicle, agent.reference.at(0.0)
        state = State(
            position=Vec3(*(float(c) for c in start.position)),
            quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
            velocity=Vec3(*map(float, speed * rng.standard_normal(3))),
            rate=Vec3(*map(float, turning * rng.standard_normal(3))),
            joints=tuple(float(q) for q in start.joints),
            joint_rates=tuple(map(float, turning * rng.standard_normal(vehicle.n))),
            rotor_speeds=(0.0,) * len(vehicle.rotors),
        )
        return dataclasses.replace(
            agent, initial=state, plant=dataclasses.replace(agent.plant, gravity=0.0)
        )

    free = with_law(scenario, nothing)
    return dataclasses.replace(
        free, agents={name: thrown(each) for name, each in free.agents.items()}
    )


def rotations(quaternion: Array) -> Array:
    """Rotation matrices (N, 3, 3) of quaternions (N, 4) wxyz."""
    w, x, y, z = quaternion.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.array(rows).transpose(2, 0, 1)


@dataclasses.dataclass(frozen=True)
class Bodies:
    """Rigid bodies of a flight over time, each with its mass and its moments about its
    own axes.
    """

    mass: Mapping[str, float]
    moments: Mapping[str, Array]
    position: Mapping[str, Array]
    quaternion: Mapping[str, Array]
    velocity: Mapping[str, Array]
    rate: Mapping[str, Array]

    @property
    def momentum(self) -> tuple[Array, Array]:
        """Linear and angular momentum of all bodies about the origin, (N, 3) each."""
        linear, angular = 0.0, 0.0
        for name, mass in self.mass.items():
            p = mass * self.velocity[name]
            spin = np.einsum(
                "nij,nj->ni",
                rotations(self.quaternion[name]),
                self.moments[name] * self.rate[name],
            )
            linear, angular = (
                linear + p,
                angular + np.cross(self.position[name], p) + spin,
            )
        return np.asarray(linear), np.asarray(angular)

    @property
    def kinetic(self) -> Array:
        """Kinetic energy of all bodies, (N,), J."""
        total = 0.0
        for name, mass in self.mass.items():
            moving = 0.5 * mass * (self.velocity[name] ** 2).sum(axis=1)
            total = (
                total
                + moving
                + 0.5 * (self.moments[name] * self.rate[name] ** 2).sum(axis=1)
            )
        return np.asarray(total)


def bodies_of(scenario: Scenario, log: Any) -> Bodies:
    """Bodies of a flight of vehicles without arms, whose centre of mass is the base's
    origin, and of one object.
    """
    assert scenario.world is not None
    (thing,) = scenario.world.objects
    logs = dict(log.agents)
    bases = {name: each.plant.vehicle.base for name, each in scenario.agents.items()}
    own = {
        name: np.array([float(each.inertia.full()[i][i]) for i in range(3)])
        for name, each in bases.items()
    }
    return Bodies(
        mass={
            **{name: float(each.mass) for name, each in bases.items()},
            thing.name: float(thing.mass),
        },
        moments={**own, thing.name: np.array([float(c) for c in thing.moments])},
        position={
            **{name: each.position for name, each in logs.items()},
            thing.name: log.object_position,
        },
        quaternion={
            **{name: each.quaternion for name, each in logs.items()},
            thing.name: log.object_quaternion,
        },
        velocity={
            **{name: each.velocity for name, each in logs.items()},
            thing.name: log.object_velocity,
        },
        rate={
            **{name: each.rate for name, each in logs.items()},
            thing.name: log.object_rate,
        },
    )
