"""Objects of a world on the plant, with a vehicle that is far away or limp, and what becomes of them."""

from __future__ import annotations

import dataclasses

import numpy as np

from skyarm.algebra import Vec3
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.plant.interface import Truth, flat
from skyarm.plant.surroundings import Surroundings, places_in
from skyarm.records.leaves import leaves
from standing_vehicles import GRAVITY, at_rest, limp

BIRD = limp()
AWAY = at_rest(BIRD, (5.0, 5.0, 50.0))
POSE = 13
"""Numbers of an object in a memory: place of its centre of mass, attitude, velocity, angular velocity."""


class Scene:
    """A plant whose contact has one structure; its numbers may be others from flight to flight.

    Args:
        contact: as an example; its largest step is that of all flights.
        vehicle, state: a limp one far away, if left out.
        memory: of the contact at the start; its own first one, if left out.
    """

    def __init__(
        self, contact, *, vehicle=BIRD, state=AWAY, gravity=GRAVITY, kind=RigidBodyPlant, integrator="rk4", memory=None
    ):
        self.vehicle, self.state, self._memory = vehicle, state, memory
        self.around = self._around(contact)
        self._plant = kind(Truth(vehicle=vehicle, gravity=gravity), self.around, integrator, 0.001)
        self._shape = [type(each) for each in leaves(self.around)]

    def _around(self, contact):
        memory = contact.start(0.005, ()) if self._memory is None else self._memory
        return Surroundings(components=(contact,), memories=(memory,))

    @property
    def grip(self):
        """Of the only gripper, at the start."""
        return self._memory.grips[0]

    def fly(self, contact, seconds, *, step=0.005):
        """States of the vehicle (N, numbers) and of the objects (N, objects, 13), one every ``step`` seconds."""
        around = self._around(contact)
        assert len(leaves(around)) == len(self._shape), "of the same structure"
        x, told = flat(self.state), list(leaves(around))
        places, vehicles, objects = places_in(around), [], []
        held = around.memories[0]
        bristles = len(leaves((held.finer, held.clock, held.bristles)))
        command = (0.0,) * (len(self.vehicle.rotors) + self.vehicle.n)
        for _ in range(round(seconds / step)):
            found = self._plant.advance(x, command, told, step)
            x, memory = found[: len(x)], found[len(x) :]
            for place, value in zip(places, memory, strict=True):
                told[place] = value
            vehicles.append(x)
            objects.append(np.reshape(memory[bristles:][: POSE * len(contact.objects)], (-1, POSE)))
        return np.array(vehicles), np.array(objects)


def with_object(contact, **numbers):
    """The contact with other numbers of its first object."""
    return dataclasses.replace(
        contact, objects=(dataclasses.replace(contact.objects[0], **numbers), *contact.objects[1:])
    )  # fmt: skip


def with_ground(contact, angles=None, **numbers):
    """The contact with another material, or other angles, of its first surface."""
    ground = contact.surfaces[0]
    ground = dataclasses.replace(ground, material=dataclasses.replace(ground.material, **numbers))
    ground = dataclasses.replace(ground, angles=Vec3(*angles)) if angles else ground
    return dataclasses.replace(contact, surfaces=(ground, *contact.surfaces[1:]))


def energy(rows, body, gravity=0.0):
    """Kinetic and potential energy (N,) of an object, J, from its numbers (N, 13)."""
    moments = np.array([float(each) for each in body.moments])
    turning = 0.5 * (moments * rows[:, 10:13] ** 2).sum(axis=1)
    return 0.5 * float(body.mass) * (rows[:, 7:10] ** 2).sum(axis=1) + turning + float(body.mass) * gravity * rows[:, 2]
