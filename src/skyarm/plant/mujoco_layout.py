"""Conversion of states and generalised forces between the library's order and
MuJoCo's.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice
from operator import itemgetter
from typing import Any, Protocol, TypeVar

from skyarm.algebra import Scalar, Scalars, Vec3
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.kinematics import every_joint, every_rate
from skyarm.dynamics.state import State, example_state
from skyarm.plant.interface import Truth
from skyarm.plant.loads import applied_force
from skyarm.plant.mujoco_model import free_name, joint_addresses
from skyarm.plant.mujoco_welds import object_forces
from skyarm.plant.surroundings import Together
from skyarm.records.leaves import rebuild

Number = TypeVar("Number")


class Reordering(Protocol):
    """Type of functions that rearrange state variables between this library's order and
    MuJoCo's.
    """

    def __call__(self, numbers: Sequence[Number], /) -> tuple[Number, ...]:
        """Rearrange state variables between this library's order and MuJoCo's."""


class Layout:
    """Index maps between this library's and MuJoCo's orders of the state variables of
    all vehicles.

    Args:
        worlds: true vehicles and gravity. model: MuJoCo's, of a tree for each.
            prefixes: of the names in each tree.

    Attributes:
        nq, nv: count of MuJoCo's positions and velocities of the vehicles, before those
            of objects.
        end: count of all numbers.
        driven: count of rotor speeds and tilt angles together.
        bases: address of each vehicle's first velocity. dofs: addresses of its links'
            and followers' velocities.
        joints: those of its links alone.
        to_mujoco, to_ours: reordering of the states' numbers, as tuples.
    """

    def __init__(
        self, worlds: Sequence[Truth], model: Any, prefixes: Sequence[str] = ("",)
    ) -> None:
        self.worlds = tuple(worlds)
        self.vehicles = tuple(world.vehicle for world in worlds)
        self.nq, self.nv = (
            sum(size + len(each.moving) for each in self.vehicles) for size in (7, 6)
        )
        self.driven = sum(len(each.rotors) + len(each.tilts) for each in self.vehicles)
        self.end = self.nq + self.nv + self.driven
        self.bases = list[int]()
        self.dofs = list[list[int]]()
        ours = list[int]()
        whole = list[int]()
        first = self.nq + self.nv
        for vehicle, prefix in zip(self.vehicles, prefixes, strict=True):
            q, v = joint_addresses(vehicle, model, prefix)
            free = model.joint(prefix + free_name(vehicle))
            n = vehicle.n
            place, base = int(free.qposadr[0]), int(free.dofadr[0])
            count = len(vehicle.rotors) + len(vehicle.tilts)
            # ours is position, quaternion, velocity, rate, joints, joint rates, rotor
            # speeds, tilt angles
            pose, speeds = range(place, place + 7), range(first, first + count)
            moving = range(self.nq + base, self.nq + base + 6)
            ours += [*pose, *moving, *q[:n], *(self.nq + i for i in v[:n]), *speeds]
            whole += [*pose, *moving, *q, *(self.nq + i for i in v), *speeds]
            self.bases.append(base)
            self.dofs.append(v)
            first += count
        self.joints = [
            v[: vehicle.n] for vehicle, v in zip(self.vehicles, self.dofs, strict=True)
        ]
        self._theirs: Reordering = itemgetter(
            # the inverse of a permutation: sorting its indices by their targets
            *sorted(range(len(whole)), key=whole.__getitem__)
        )
        followed = any(each.followers for each in self.vehicles)
        self.to_mujoco: Reordering = self._with_followers if followed else self._theirs
        self.to_ours: Reordering = itemgetter(*ours)

    def _with_followers(self, numbers: Sequence[Any]) -> tuple[Any, ...]:
        """State variables in MuJoCo's order, including the follower joints."""
        given = iter(numbers)
        every = list[Any]()
        for vehicle in self.vehicles:
            n = vehicle.n
            driven = len(vehicle.rotors) + len(vehicle.tilts)
            # a base has 13: position, quaternion, velocity, rate
            base, joints, rates, speeds = (
                list(islice(given, count)) for count in (13, n, n, driven)
            )
            every += [
                *base,
                *every_joint(vehicle, joints),
                *every_rate(vehicle, rates),
                *speeds,
            ]
        return self._theirs(every)

    def states(self, x: Sequence[Scalar]) -> tuple[State, ...]:
        """Vehicle states in this library's order, from state variables in MuJoCo's
        order.
        """
        return rebuild(
            tuple(example_state(*each.sizes) for each in self.vehicles),
            self.to_ours(x),
        )

    def accelerations(self, qacc: Sequence[Scalar]) -> list[tuple[Vec3, Vec3, Scalars]]:
        """Accelerations of each base (world axes) and of its joints, from MuJoCo's
        generalised accelerations.
        """
        return [
            (
                Vec3(*qacc[at : at + 3]),
                Vec3(*qacc[at + 3 : at + 6]),
                tuple(qacc[i] for i in dofs),
            )
            for at, dofs in zip(self.bases, self.joints, strict=True)
        ]

    def generalized_forces(
        self,
        worlds: Sequence[Truth],
        states: Sequence[State],
        commands: Sequence[Command],
        around: Together,
    ) -> list[Scalar]:
        """Generalised forces at states without gravity, in MuJoCo's order: of the
        vehicles, then of held objects.

        The dual of a free joint's velocity is the force at the base origin in world
        axes and the torque in base axes.
        """
        generalized = list[Scalar]()
        place = list[int]()
        motions = around.motions(worlds, states)
        for i, (motion, command) in enumerate(zip(motions, commands, strict=True)):
            force, torques = applied_force(motion, command, around.of(i))
            # what acts on a follower acts on its leader already
            still = [0] * len(motion.vehicle.followers)
            generalized += [
                *motion.rotation.apply(force.force),
                *force.torque,
                *torques,
                *still,
            ]
            place += [*range(self.bases[i], self.bases[i] + 6), *self.dofs[i]]
        # the inverse of the permutation ``place``, as of ``_theirs``
        ordered = [
            generalized[i] for i in sorted(range(self.nv), key=place.__getitem__)
        ]
        return ordered + object_forces(around, motions)
