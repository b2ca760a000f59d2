"""Where a vehicle's numbers stand in MuJoCo's: states and generalised forces in both orders."""

from __future__ import annotations

from collections.abc import Sequence
from operator import itemgetter
from typing import Any

from skyarm.algebra import Quaternion, Vec3
from skyarm.dynamics.state import State
from skyarm.plant.loads import applied_force
from skyarm.plant.mujoco_model import joint_addresses
from skyarm.plant.surroundings import Around
from skyarm.vehicle.vehicle_records import Vehicle


class Layout:
    """Orders of a vehicle's numbers: ours, and MuJoCo's [qpos, qvel, rotor speeds], joints depth first.

    Attributes:
        nq, nv, rotors: how many numbers of each kind. end: of all three.
        to_mujoco, to_ours: a state's numbers in the other order, as tuples.
    """

    def __init__(self, vehicle: Vehicle, model: Any) -> None:
        self.vehicle = vehicle
        self.nq, self.nv, self.rotors = int(model.nq), int(model.nv), len(vehicle.rotors)
        self.end = self.nq + self.nv + self.rotors
        q, v = joint_addresses(vehicle, model)
        self._dofs = v
        # ours is position, quaternion, velocity, rate, joints, joint rates, rotor speeds
        moving, speeds = (self.nq + i for i in range(6)), range(self.nq + self.nv, self.end)
        self._ours = (*range(7), *moving, *q, *(self.nq + i for i in v), *speeds)
        self._theirs = tuple(sorted(range(len(self._ours)), key=self._ours.__getitem__))
        self.to_mujoco: Any = itemgetter(*self._theirs)
        self.to_ours: Any = itemgetter(*self._ours)

    def state(self, x: Sequence[Any]) -> State:
        """State record from numbers in MuJoCo's order."""
        ours, n = self.to_ours(x), self.vehicle.n
        return State(
            position=Vec3.of(ours[0:3]),
            quaternion=Quaternion.of(ours[3:7]),
            velocity=Vec3.of(ours[7:10]),
            rate=Vec3.of(ours[10:13]),
            joints=tuple(ours[13 : 13 + n]),
            joint_rates=tuple(ours[13 + n : 13 + 2 * n]),
            rotor_speeds=tuple(ours[13 + 2 * n :]),
        )

    def accelerations(self, qacc: Sequence[Any]) -> tuple[Vec3, Vec3, tuple[Any, ...]]:
        """Of the base (world axes), of its turning (base axes) and of the joints, from MuJoCo's."""
        return Vec3.of(qacc[0:3]), Vec3.of(qacc[3:6]), tuple(qacc[i] for i in self._dofs)

    def generalized_forces(
        self, state: State, setpoints: Sequence[Any], around: Around, commands: Sequence[Any] = ()
    ) -> list[Any]:
        """What acts on a state but gravity, in MuJoCo's order.

        The dual of a free joint's velocity is the force at the base origin in world axes and the torque in base axes.
        """
        force, torques = applied_force(self.vehicle, state, state.rotor_speeds, setpoints, around, commands)
        generalized: list[Any] = [*state.quaternion.rotation().apply(force.force), *force.torque, *torques]
        place = [*range(6), *self._dofs]
        return [generalized[i] for i in sorted(range(self.nv), key=place.__getitem__)]
