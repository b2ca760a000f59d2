"""Conversion of states and generalised forces between the library's order and MuJoCo's."""

from __future__ import annotations

from collections.abc import Sequence
from operator import itemgetter
from typing import Any, Protocol, TypeVar

from skyarm.algebra import Vec3
from skyarm.algebra.scalars import Scalar
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.kinematics import every_joint, every_rate
from skyarm.dynamics.state import State, example_state
from skyarm.plant.loads import applied_force
from skyarm.plant.mujoco_model import joint_addresses
from skyarm.plant.surroundings import Surroundings
from skyarm.records.leaves import rebuild
from skyarm.vehicle.vehicle_records import Vehicle

Number = TypeVar("Number")


class Reordering(Protocol):
    """Type of functions that rearrange state variables between this library's order and MuJoCo's."""

    def __call__(self, numbers: Sequence[Number], /) -> tuple[Number, ...]:
        """Rearrange state variables between this library's order and MuJoCo's."""


class Layout:
    """Index maps between this library's and MuJoCo's orders of the vehicle's state variables.

    Attributes:
        nq, nv, rotors, tilts: count of the numbers of each kind. end: count of all.
        driven: count of rotor speeds and tilt angles together.
        to_mujoco, to_ours: reordering of a state's numbers, as tuples.
    """

    def __init__(self, vehicle: Vehicle, model: Any) -> None:
        self.vehicle = vehicle
        self.nq, self.nv, self.rotors = int(model.nq), int(model.nv), len(vehicle.rotors)
        self.tilts = len(vehicle.tilts)
        self.driven = self.rotors + self.tilts
        self.end = self.nq + self.nv + self.driven
        q, v = joint_addresses(vehicle, model)
        self._every, n = v, vehicle.n
        self._dofs = v[:n]
        # ours is position, quaternion, velocity, rate, joints, joint rates, rotor speeds, tilt angles
        moving, speeds = range(self.nq, self.nq + 6), range(self.nq + self.nv, self.end)
        ours = (*range(7), *moving, *q[:n], *(self.nq + i for i in v[:n]), *speeds)
        whole = (*range(7), *moving, *q, *(self.nq + i for i in v), *speeds)
        self._theirs: Reordering = itemgetter(*sorted(range(len(whole)), key=whole.__getitem__))
        self.to_mujoco: Reordering = self._with_followers if vehicle.followers else self._theirs
        self.to_ours: Reordering = itemgetter(*ours)

    def _with_followers(self, numbers: Sequence[Any]) -> tuple[Any, ...]:
        """State variables in MuJoCo's order, including the follower joints."""
        n = self.vehicle.n
        joints = every_joint(self.vehicle, numbers[13 : 13 + n])
        rates = every_rate(self.vehicle, numbers[13 + n : 13 + 2 * n])
        return self._theirs((*numbers[:13], *joints, *rates, *numbers[13 + 2 * n :]))

    def state(self, x: Sequence[Scalar]) -> State:
        """Vehicle state in this library's order, from state variables in MuJoCo's order."""
        return rebuild(example_state(*self.vehicle.sizes), iter(self.to_ours(x)))

    def accelerations(self, qacc: Sequence[Scalar]) -> tuple[Vec3, Vec3, tuple[Scalar, ...]]:
        """Accelerations of base (world axes) and joints, from MuJoCo's generalised accelerations."""
        return Vec3(*qacc[0:3]), Vec3(*qacc[3:6]), tuple(qacc[i] for i in self._dofs)

    def generalized_forces(self, state: State, command: Command, around: Surroundings) -> list[Scalar]:
        """Generalised forces at a state without gravity, in MuJoCo's order.

        The dual of a free joint's velocity is the force at the base origin in world axes and the torque in base axes.
        """
        force, torques = applied_force(self.vehicle, state, command, around)
        generalized: list[Scalar] = [*state.quaternion.rotation().apply(force.force), *force.torque, *torques]
        # what acts on a follower acts on its leader already
        generalized += [0] * len(self.vehicle.followers)
        place = [*range(6), *self._every]
        return [generalized[i] for i in sorted(range(self.nv), key=place.__getitem__)]
