"""A vehicle on four skids, and what plants make of it while nothing drives it."""

from __future__ import annotations

import dataclasses

import numpy as np

from skyarm.algebra import Vec3
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.plant.interface import Truth, flat
from skyarm.plant.surroundings import Surroundings, places_in
from skyarm.records.leaves import leaves, rebuild
from skyarm.scenario.scenario_record import trimmed_state
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.world.contact import Contact, ContactPoint, Material, Surface

SKIDS = tuple(
    ContactPoint(name=f"skid_{i}", body="base", position=Vec3(0.1 * x, 0.1 * y, -0.12))
    for i, (x, y) in enumerate(((1, 1), (1, -1), (-1, -1), (-1, 1)))
)
GRAVITY = 9.8


def limp(name: str = "hummingbird"):
    """The vehicle without air and without friction in its joints."""
    vehicle = load_vehicle(name)
    rotors = tuple(dataclasses.replace(r, drag_coefficient=0, rolling_moment_coefficient=0) for r in vehicle.rotors)
    links = tuple(
        dataclasses.replace(link, joint=dataclasses.replace(link.joint, damping=0.0, coulomb=0.0))
        for link in vehicle.links
    )
    return dataclasses.replace(vehicle, rotors=rotors, links=links)


def around(*surfaces, points=SKIDS, bristles=()):
    """Surroundings of one contact."""
    contact = Contact(surfaces=surfaces, points=points)
    memory = contact.start(0.005, ())
    if bristles:
        memory = dataclasses.replace(memory, bristles=bristles)
    return Surroundings(components=(contact,), memories=(memory,))


def ground(**numbers):
    angles = numbers.pop("angles", (0.0, 0.0, 0.0))
    return Surface(name="ground", angles=angles, material=Material(**numbers))


def at_rest(vehicle, position, joints=(), **fields):
    """A state without turning rotors."""
    state = trimmed_state(Truth(vehicle=vehicle, gravity=GRAVITY), Vec3(*position), 0.0, joints)
    return dataclasses.replace(state, rotor_speeds=(0.0,) * len(vehicle.rotors), **fields)


def fall(vehicle, state, surroundings, seconds, *, step=0.005, kind=RigidBodyPlant, gravity=GRAVITY, physics=0.001):
    """States (N, numbers) and coupled memories of a vehicle that nothing drives, one every ``step`` seconds."""
    plant = kind(Truth(vehicle=vehicle, gravity=gravity), surroundings, "rk4", physics)
    x, told, rows = flat(state), list(leaves(surroundings)), []
    command = (0.0,) * (len(vehicle.rotors) + vehicle.n)
    for _ in range(round(seconds / step)):
        after = plant.advance(x, command, told, step)
        x = after[: len(x)]
        for place, value in zip(places_in(surroundings), after[len(x) :], strict=True):
            told[place] = value
        rows.append(after)
    return np.array(rows)


def states(state, rows):
    """Rows as records."""
    return [rebuild(state, iter(row.tolist())) for row in rows]
