"""Worlds: vehicles that stand, objects that lie, walls, boxes and winds.

- A vehicle on four skids, and what plants make of it while nothing drives it.
- Objects of a world on the plant, with a vehicle that is far away or limp, and what
  becomes of them.
- Scenario of a vehicle that presses on a wall with its tip.
- Scenario of the paper's vehicle that pushes a box along a table.
- A short flight in a world, shared by the tests of everything that draws: a tip presses
  on a wall that is turned.
- What a vehicle feels of one component of its surroundings, as one record: for tests of
  winds.
"""

from __future__ import annotations

import dataclasses
import functools
from typing import Any

import numpy as np

import skyarm
from skyarm.algebra import ZERO3, Quaternion, Sym3, Vec3
from skyarm.dynamics import State, frame_pose
from skyarm.dynamics.point_motion import PointMotion
from skyarm.log.flight_log import Log
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.plant.interface import Truth, flat
from skyarm.plant.surroundings import Surroundings
from skyarm.records.leaves import leaves, rebuild
from skyarm.scenario.scenario_file import scenario_from
from skyarm.scenario.scenario_record import trimmed_state
from skyarm.vehicle import Body, Vehicle
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.world import Component, WindSample
from skyarm.world.contact import Contact, ContactPoint, Material, Surface
from support.one_vehicle import places_in

SKIDS = tuple(
    ContactPoint(name=f"skid_{i}", body="base", position=Vec3(0.1 * x, 0.1 * y, -0.12))
    for i, (x, y) in enumerate(((1, 1), (1, -1), (-1, -1), (-1, 1)))
)
GRAVITY = 9.8


def limp(name: str = "hummingbird"):
    """The vehicle without air and without friction in its joints."""
    vehicle = load_vehicle(name)
    rotors = tuple(
        dataclasses.replace(r, drag_coefficient=0, rolling_moment_coefficient=0)
        for r in vehicle.rotors
    )
    links = tuple(
        dataclasses.replace(
            link, joint=dataclasses.replace(link.joint, damping=0.0, coulomb=0.0)
        )
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
    state = trimmed_state(
        Truth(vehicle=vehicle, gravity=GRAVITY), Vec3(*position), 0.0, joints
    )
    return dataclasses.replace(
        state, rotor_speeds=(0.0,) * len(vehicle.rotors), **fields
    )


def fall(
    vehicle,
    state,
    surroundings,
    seconds,
    *,
    step=0.005,
    kind=RigidBodyPlant,
    gravity=GRAVITY,
    physics=0.001,
):
    """States (N, numbers) and coupled memories of a vehicle that nothing drives, one
    every ``step`` seconds.
    """
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


BIRD = limp()
AWAY = at_rest(BIRD, (5.0, 5.0, 50.0))
POSE = 13
"""Numbers of an object in a memory: place of its centre of mass, attitude, velocity,
angular velocity."""


class Scene:
    """A plant whose contact has one structure; its numbers may be others from flight to
    flight.

    Args:
        contact: as an example; its largest step is that of all flights.
        vehicle, state: a limp one far away, if left out.
        memory: of the contact at the start; its own first one, if left out.
    """

    def __init__(
        self,
        contact,
        *,
        vehicle=BIRD,
        state=AWAY,
        gravity=GRAVITY,
        kind=RigidBodyPlant,
        integrator="rk4",
        memory=None,
    ):
        self.vehicle, self.state, self._memory = vehicle, state, memory
        self.around = self._around(contact)
        self._plant = kind(
            Truth(vehicle=vehicle, gravity=gravity), self.around, integrator, 0.001
        )
        self._shape = [type(each) for each in leaves(self.around)]

    def _around(self, contact):
        memory = contact.start(0.005, ()) if self._memory is None else self._memory
        return Surroundings(components=(contact,), memories=(memory,))

    @property
    def grip(self):
        """Of the only gripper, at the start."""
        return self._memory.grips[0]

    def fly(self, contact, seconds, *, step=0.005):
        """States of the vehicle (N, numbers) and of the objects (N, objects, 13), one
        every ``step`` seconds.
        """
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
            objects.append(
                np.reshape(memory[bristles:][: POSE * len(contact.objects)], (-1, POSE))
            )
        return np.array(vehicles), np.array(objects)


def with_object(contact, **numbers):
    """The contact with other numbers of its first object."""
    return dataclasses.replace(
        contact,
        objects=(
            dataclasses.replace(contact.objects[0], **numbers),
            *contact.objects[1:],
        ),
    )


def with_ground(contact, angles=None, **numbers):
    """The contact with another material, or other angles, of its first surface."""
    ground = contact.surfaces[0]
    ground = dataclasses.replace(
        ground, material=dataclasses.replace(ground.material, **numbers)
    )
    ground = dataclasses.replace(ground, angles=Vec3(*angles)) if angles else ground
    return dataclasses.replace(contact, surfaces=(ground, *contact.surfaces[1:]))


def energy(rows, body, gravity=0.0):
    """Kinetic and potential energy (N,) of an object, J, from its numbers (N, 13)."""
    moments = np.array([float(each) for each in body.moments])
    turning = 0.5 * (moments * rows[:, 10:13] ** 2).sum(axis=1)
    return (
        0.5 * float(body.mass) * (rows[:, 7:10] ** 2).sum(axis=1)
        + turning
        + float(body.mass) * gravity * rows[:, 2]
    )


NOISE = {
    "position": 1e-3,
    "velocity": 1e-2,
    "attitude": 2e-3,
    "rate": 1e-2,
    "joints": 1e-3,
    "joint_rates": 1e-2,
}
HEIGHT = 1.5


def before_a_wall(name, joints, force, duration=5.0, friction=None, **law):
    """A vehicle that comes to a wall 20 mm ahead of its tip; the wall ends between tip
    and base.
    """
    vehicle = skyarm.load_vehicle(name)
    tip = frame_pose(vehicle, vehicle.frame(), joints).p
    top = HEIGHT + 0.6 * float(tip.z)
    wall = {
        "name": "wall",
        "shape": "box",
        "size": [0.1, 2.0, top],
        "position": [float(tip.x) + 0.07, 0.0, 0.5 * top],
    } | ({} if friction is None else {"material": {"friction": friction}})
    return scenario_from(
        {
            "schema": 1,
            "name": "press",
            "duration": duration,
            "plant": {"vehicle": name},
            "controller": {"law": "centroidal", "mode": "tip"} | law,
            "sensors": NOISE,
            "delays": {"measurement": 0.005},
            "reference": {
                "base": {"kind": "signals", "z": HEIGHT},
                "joints": list(joints),
                "push": {
                    "force": {"kind": "constant", "value": force, "start": 0.2},
                    "normal": [-1.0, 0.0, 0.0],
                },
            },
            "world": {"surfaces": [wall]},
        }
    )


BEHIND = 0.06
"""m, from the tip to the box, 12 cm long."""

START, FRICTION = 0.2 + BEHIND + 0.06, 0.2
"""m, of the box's middle along x; between box and table."""


def beside_a_box(phases, duration=9.0, **law):
    """Document of a scenario: 250 g, 12 x 20 x 10 cm, on a table, the tip behind its
    middle.
    """
    return {
        "schema": 1,
        "name": "push_a_box",
        "duration": duration,
        "plant": {"vehicle": "hummingbird_arm2_rotors"},
        "model": {"vehicle": "hummingbird_arm2"},
        "controller": (
            {"law": "centroidal", "mode": "tip", "interaction": [0.3, 0.1]} | law
        ),
        "sensors": dict(NOISE),
        "delays": {"measurement": 0.005},
        "environment": {"wind": {"mode": "force_wind", "force": [0.1, 0.1, 0.0]}},
        "reference": {
            "tip": {
                "posture": [-0.45, -0.9],
                "path": {
                    "kind": "phases",
                    "position": [0.2, 0.0, 0.83],
                    "phases": phases,
                },
            }
        },
        "world": {
            "surfaces": [
                {
                    "name": "table",
                    "shape": "box",
                    "size": [1.4, 1.0, 0.05],
                    "position": [0.96, 0.0, 0.755],
                    "material": {"friction": FRICTION},
                }
            ],
            "objects": [
                {
                    "name": "box",
                    "size": [0.12, 0.2, 0.1],
                    "mass": 0.25,
                    "standing": True,
                    "position": [START, 0.0, 0.83],
                }
            ],
        },
    }


def by_force(distance=0.3, **until):
    """Phases that push with 1 N until the tip has moved that far, m."""
    guard = {"distance": distance, "on_timeout": "fail"} | until
    press = {"kind": "press", "force": 1.0, "normal": [-1.0, 0.0, 0.0], "until": guard}
    return [{"kind": "hold", "duration": 0.5}, press, {"kind": "retreat"}]


def by_place(distance=0.3):
    """Phases that lead the tip that far, m, against the box and on with it."""
    way = {"kind": "go_to", "position": [0.2 + distance, 0.0, 0.83], "duration": 4.0}
    back = {"kind": "go_to", "position": [0.15 + distance, 0.0, 0.83], "duration": 1.0}
    return [{"kind": "hold", "duration": 0.5}, way, back]


WALL_ANGLE = 0.2
"""rad, about z."""

DOCUMENT: dict[str, Any] = {
    "name": "touch",
    "duration": 1.2,
    "plant": {"vehicle": "hummingbird_arm2_rotors"},
    "model": {"vehicle": "hummingbird_arm2"},
    "controller": {"law": "centroidal", "mode": "tip", "interaction": [0.3, 0.1]},
    "reference": {
        "base": {"kind": "signals", "z": 1.0},
        "joints": [-0.45, -0.9],
        "push": {
            "force": {"kind": "constant", "value": 1.0, "start": 0.1},
            "normal": [-1.0, 0.0, 0.0],
            "speed": 0.2,
        },
    },
    "world": {
        "surfaces": [
            {"name": "ground", "position": [0.0, 0.0, -0.3]},
            {
                "name": "wall",
                "shape": "box",
                "size": [0.1, 2.0, 0.9],
                "position": [0.29, 0.0, 0.45],
                "angles": [0.0, 0.0, WALL_ANGLE],
            },
            {
                "name": "post",
                "shape": "cylinder",
                "size": [0.05, 1.0],
                "position": [0.0, 2.0, 0.5],
                "motion": [
                    {"kind": "sine", "amplitude": 0.3, "frequency_hz": 0.5},
                    0.0,
                    0.0,
                ],
            },
            {
                "name": "side",
                "position": [0.0, 3.0, 0.0],
                "angles": [1.5707963267948966, 0.0, 0.0],
            },
        ],
        "points": [
            {"name": "tip", "frame": "tip"},
            {
                "name": "skid",
                "body": "base",
                "position": [0.0, 0.1, -0.2],
                "radius": 0.02,
            },
        ],
        "objects": [
            {
                "name": "parcel",
                "mass": 0.1,
                "shape": "box",
                "size": [0.1, 0.2, 0.3],
                "position": [-1.0, 0.0, 1.0],
            }
        ],
    },
}


@functools.lru_cache(maxsize=1)
def touching() -> Log:
    """The flight: the tip meets the wall after half a second, a parcel falls beside
    it.
    """
    return skyarm.run(skyarm.scenario_from(DOCUMENT))


_ANYTHING = Vehicle(name="anything", base=Body(mass=1.0, inertia=Sym3.isotropic(0.01)))
_REST = State(
    position=ZERO3,
    quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
    velocity=ZERO3,
    rate=ZERO3,
    joints=(),
    joint_rates=(),
    rotor_speeds=(),
)


def wind(par: Component, t: Any, memory: Any = ()) -> WindSample:
    """Force on the base with its point, and velocity of the air at the origin, at time
    t (s; array or traced).
    """
    wrenches = par.wrenches(memory, t, PointMotion(_ANYTHING, _REST), ())
    assert len(wrenches) <= 1
    force, point = ZERO3, ZERO3
    for wrench in wrenches:
        assert wrench.body == BASE
        assert wrench.torque_W == ZERO3
        force, point = wrench.force_W, wrench.point
    return WindSample(force, point, par.velocity(memory, t, Vec3(3.0, -2.0, 7.0)))
