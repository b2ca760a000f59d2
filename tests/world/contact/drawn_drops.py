"""Drops of drawn bodies on drawn floors, and the energy that each gains.

Bodies are shapes of a vehicle that nothing drives, or free objects. Run it to drop all
of them, or those whose numbers are given, and to print the worst.
"""

from __future__ import annotations

import dataclasses
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np

# the tests' own modules, when this is run as a program
sys.path.append(str(Path(__file__).parents[2]))

from skyarm.algebra import ZERO3, Quaternion, Sym3, Vec3
from skyarm.plant.surroundings import Surroundings
from skyarm.vehicle import BASE, Body, Vehicle
from skyarm.vehicle.vehicle_records import Collision
from skyarm.world.contact import Contact, FreeObject, Material, Surface
from skyarm.world.contact.free_object import uniform_moments
from support.worlds import BIRD, GRAVITY, Scene, at_rest, energy, fall, states

SEED, COUNT = 97, 200

HIGH, SECONDS = 0.5, 1.0
"""Height (m) above the floor's top from which bodies fall, and for how long (s)."""

KINDS = ("sphere", "capsule", "box", "cylinder", "hull")

LYING = (0.0, 0.5 * math.pi, 0.0)

FLOORS: tuple[dict[str, Any], ...] = (
    {},
    {"shape": "box", "size": (0.6, 0.4, 0.2), "position": (0.0, 0.0, -0.1)},
    {
        "shape": "capsule",
        "size": (0.1, 0.6),
        "angles": LYING,
        "position": (0.0, 0.0, -0.1),
    },
    {
        "shape": "cylinder",
        "size": (0.1, 0.6),
        "angles": LYING,
        "position": (0.0, 0.0, -0.1),
    },
    {"shape": "sphere", "size": (0.2,), "position": (0.0, 0.0, -0.2)},
)
"""Fields of surfaces whose top is at the origin."""


def drawn_body(kind: str, rng: np.random.Generator) -> tuple[dict[str, Any], Vec3]:
    """Fields of a shape of 5 to 30 cm, and its moments of inertia (kg m^2) with 1
    kg.
    """
    a, b, c = map(float, rng.uniform(0.05, 0.2, 3))
    if kind == "hull":
        corners = np.array([a, b, c]) * rng.uniform(-0.7, 0.7, (10, 3))
        size = (a, b, c)
        vertices = tuple(Vec3(*map(float, each)) for each in corners)
        return {"shape": kind, "vertices": vertices}, uniform_moments("box", size, 1.0)
    size = {"sphere": (a,), "box": (a, b, c)}.get(kind, (0.5 * a, 1.5 * b))
    return {"shape": kind, "size": size}, uniform_moments(kind, size, 1.0)


def gained(index: int) -> float:
    """Largest energy of a drop above that of its start, as a share of the weight times
    the height.
    """
    rng = np.random.default_rng((SEED, index))
    shape, moments = drawn_body(KINDS[index % len(KINDS)], rng)
    fields = FLOORS[index // len(KINDS) % len(FLOORS)]
    mass = float(rng.uniform(0.2, 2.0))
    moments = moments * mass
    material = Material(
        stiffness=float(rng.uniform(2e3, 2e4)),
        dissipation=float(rng.uniform(0.0, 2.0)),
        friction=float(rng.uniform(0.0, 1.0)),
    )
    ground = Surface(name="ground", material=material, **fields)
    at = Vec3(*map(float, 0.03 * rng.normal(size=2)), HIGH)
    turn = rng.normal(size=4)
    attitude = Quaternion(*map(float, turn / np.linalg.norm(turn)))
    spin = Vec3(*map(float, 3.0 * rng.normal(size=3)))
    if index % 2:
        angles = Vec3(*map(float, rng.uniform(-math.pi, math.pi, 3)))
        thing = FreeObject(
            name="it",
            mass=mass,
            inertia=moments,
            position=at,
            angles=angles,
            angular_velocity=spin,
            **shape,
        )
        contact = Contact(surfaces=(ground,), objects=(thing,))
        _, rows = Scene(contact).fly(contact, SECONDS)
        # the first row is after the first period, in free fall
        found = energy(rows[:, 0], thing, GRAVITY)
    else:
        vehicle = falling(shape, mass, moments)
        contact = Contact(surfaces=(ground,)).on({"": vehicle})
        memory = contact.start(0.005, ())
        around = Surroundings(components=(contact,), memories=(memory,))
        start = at_rest(vehicle, tuple(at), quaternion=attitude, rate=spin)
        rows = fall(vehicle, start, around, SECONDS)
        found = np.array(
            [
                0.5 * float(each.rate.dot(moments.hadamard(each.rate)))
                + 0.5 * mass * float(each.velocity.dot(each.velocity))
                + mass * GRAVITY * float(each.position.z)
                for each in states(start, rows)
            ]
        )
    return float(found.max() - found[0]) / (mass * GRAVITY * HIGH)


def falling(shape: dict[str, Any], mass: float, moments: Vec3) -> Vehicle:
    """Vehicle that nothing drives, with a shape on its base."""
    own = {"size": (), **shape}
    body = Body(mass=mass, com=ZERO3, inertia=Sym3(*moments, 0.0, 0.0, 0.0))
    part = Collision(name="it", link=BASE, position=ZERO3, **own)
    return dataclasses.replace(BIRD, base=body, collisions=(part,))


def main(names: list[str]) -> None:
    """Print what each drop gains, and the worst."""
    found = {}
    for index in map(int, names) if names else range(COUNT):
        found[index] = gained(index)
        kind = ("vehicle", "object")[index % 2], KINDS[index % len(KINDS)]
        floor = FLOORS[index // len(KINDS) % len(FLOORS)].get("shape", "plane")
        print(f"{index}: {' '.join(kind)} on {floor}: {found[index]:.2e}", flush=True)
    worst = max(found, key=found.__getitem__)
    above = sum(each > 1e-4 for each in found.values())
    print(f"worst {worst}: {found[worst]:.2e}; {above} of {len(found)} above 1e-4")


if __name__ == "__main__":
    main(sys.argv[1:])
