"""Grasps as equality constraints of MuJoCo: ``connect`` for a ball grasp, ``weld`` for
a fixed one.

A constraint of MuJoCo is soft. With its impedance d, its residual r, velocity v and
acceleration a, and the sum A of both bodies' inverse weights, its force is

    f = -(k r + b v + a) / R,
    R = A (1 - d) / d,    k = stiffness / d,    b = damping / d

for a ``solref`` of (-stiffness, -damping). That is a spring of K = stiffness / (A (1 -
d)), the same K as that of 1 / ((1 - d) tc^2 zeta^2 A) of a positive one, a damper of
D = damping / (A (1 - d)), and an inertia 1 / R against relative acceleration. At the
least d that MuJoCo takes this inertia is a ten-thousandth of the bodies' own: the
constraint has the stiffness and the damping of the grasp.

The rotation of a weld has the residual s sin(angle / 2), with s its ``torquescale``,
and in place of A the sum A_r of inverse weights in rotation. Its stiffness is s^2 / 4 K
A / A_r: s = 2 radius sqrt(A_r / A) makes it K radius^2, and the damping D radius^2.

Where this ends: inverse weights are those of the configuration of zeros. K and D hold
in any other one, since MuJoCo makes R of the same A, but 1 / R is another share of the
inertia there. A negative ``solref`` is not clamped at two steps, so the plant's step
has to be stable with the spring. A spring acts on both bodies at the object's place, a
constraint on each at its own; the two are apart by the stretch.

Source: MuJoCo documentation, Computation, "Constraint model", and Modeling, "Solver
parameters"; MuJoCo 4.0.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from skyarm.algebra import Scalar
from skyarm.dynamics.point_motion import PointMotion
from skyarm.plant.surroundings import Together, coupled_places
from skyarm.records.arrays import Array
from skyarm.records.leaves import leaves, rebuild
from skyarm.vehicle import Vehicle

if TYPE_CHECKING:
    from skyarm.world.contact.closed_contact import ClosedContact
    from skyarm.world.contact.contact_memory import ContactMemory

IMPEDANCE = 1e-4
"""Impedance d of the constraints, the least that MuJoCo takes."""

RIGID = 0.9999
"""Impedance of the ties of followers, the largest that MuJoCo takes: the tie leaves the
rest of 1e-4 of what a contact or grasp would accelerate a follower against its leader.
Without both the force is exact (:class:`skyarm.plant.mujoco_loads.Coupling`)."""

TORQUE_SCALE = 10
"""Index of the torque scale of a weld among its data."""


def closed_contacts(around: Together) -> list[tuple[ClosedContact, ContactMemory]]:
    """Contact model whose grasps the plant closes, or whose forces it finds, with its
    internal state; else empty.
    """
    return [
        pair  # type: ignore[misc]
        for pair in zip(around.components, around.memories, strict=True)
        if getattr(pair[1], "constraints", ()) or getattr(pair[0], "geoms", False)
    ]


def object_forces(around: Together, motions: Sequence[PointMotion]) -> list[Scalar]:
    """Force (N, world axes) and torque (N m, about its centre of mass, its axes) on
    each object of a closed contact.
    """
    numbers = list[Scalar]()
    for contact, memory in closed_contacts(around):
        loads = contact.on_carriers(
            memory,
            motions[0],
            contact.meetings(memory, motions[0]),
            around.each[0].time,
        )
        # the objects come first among the movable bodies
        for each, body, (force, torque) in zip(
            contact.objects, memory.carried, loads, strict=False
        ):
            R = body.attitude.rotation()
            numbers += [*force, *R.apply_T(torque - R.apply(each.com).cross(force))]
    return numbers


class Welds:
    """Objects and constraints of grasps in a MuJoCo model.

    Args:
        spec: specification with the vehicles' trees, to which objects and constraints
            are added.
        vehicles: vehicles of the trees. prefixes: of the names in each tree.
        around: surroundings with a closed contact model, whose numbers of objects and
            grasps become those of MuJoCo.

    Attributes:
        poses, moving, forces: indices of the objects' poses and velocities, and of the
            constraints' forces, among the numbers of the coupled memories.
    """

    def __init__(
        self,
        spec: mujoco.MjSpec,
        vehicles: Sequence[Vehicle],
        prefixes: Sequence[str],
        around: Together,
    ) -> None:
        # each number replaced by its index tells where it stands in a flat row
        numbered = rebuild(around.coupled_memories(), map(float, count()))
        ((contact, ours),) = closed_contacts(around.with_coupled(numbered))
        self._grasps = contact.grasps
        objects = contact.objects
        first = around.each[0]
        bodies = ours.carried[: len(objects)]
        poses = tuple((each.position, each.attitude) for each in bodies)
        moving = tuple((each.velocity, each.rate) for each in bodies)
        forces = ours.constraints, ours.touches
        parts = poses, moving, forces, ours.turns
        self.poses, self.moving, self.forces, self._turns = (
            np.array(leaves(part), dtype=int) for part in parts
        )
        self._places = np.array(coupled_places(around))
        self._time = len(leaves((first.components, first.memories)))
        off = mujoco.mjtDisableBit
        # a warm start would outlive a call
        # constraints are off in a model without grasps (build_spec)
        spec.option.disableflags += int(off.mjDSBL_WARMSTART) - int(
            off.mjDSBL_CONSTRAINT
        )
        # no early stop: the force has to be that of the spring and the damper
        spec.option.tolerance = 0.0
        coms = {each.name: each.com for each in objects}
        at = dict[str, mujoco.MjsBody]()
        for each in objects:
            at[each.name] = body = spec.worldbody.add_body(
                name=f"object {each.name}", mass=each.mass
            )
            body.add_freejoint(align=mujoco.mjtAlignFree.mjALIGNFREE_FALSE)
            # of a flat body a + b = c up to rounding, and MuJoCo refuses a + b < c
            body.inertia = np.minimum([*each.moments], 0.5 * sum(each.moments))
            body.explicitinertial = True
            body.ipos = np.zeros(3)
            body.iquat = [1.0, 0.0, 0.0, 0.0]
        kinds = {"ball": mujoco.mjtEq.mjEQ_CONNECT, "fixed": mujoco.mjtEq.mjEQ_WELD}
        for i, grasp in enumerate(self._grasps):
            agent = around.names.index(grasp.agent or around.names[0])
            name = f"grasp {i}"
            frame = prefixes[agent] + vehicles[agent].frame(grasp.frame or None).name
            at[grasp.body].add_site(name=name, pos=[*(grasp.place - coms[grasp.body])])
            constraint = spec.add_equality(
                type=kinds[grasp.kind], objtype=mujoco.mjtObj.mjOBJ_SITE
            )
            constraint.name1, constraint.name2 = frame, name
            constraint.solimp[:2] = IMPEDANCE
        for vehicle, prefix in zip(vehicles, prefixes, strict=True):
            for follower in vehicle.followers:
                leader = vehicle.links[follower.leader].joint.name
                tie = spec.add_equality(
                    type=mujoco.mjtEq.mjEQ_JOINT,
                    name1=prefix + follower.link.joint.name,
                    name2=prefix + leader,
                )
                tie.data[:2] = float(follower.offset), float(follower.ratio)
                tie.solimp[:2] = RIGID

    def bind(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Set the stiffness of the constraints in the compiled model, in whose data the
        other methods work.
        """
        self._model = model
        self._data = data
        # behind the grasps stand the ties of followers
        count = len(self._grasps)
        self._sites = model.eq_obj2id[:count]
        # begin() turns these sites: MuJoCo must not take them for their bodies' frames
        model.site_sameframe[self._sites] = 0
        self._bodies = model.site_bodyid[self._sites]
        A, turning = (
            model.body_invweight0[self._bodies]
            + model.body_invweight0[model.site_bodyid[model.eq_obj1id[:count]]]
        ).T
        K, D, radius, self._release = (
            np.array(
                [
                    (each.stiffness, each.damping, each.radius, each.release)
                    for each in self._grasps
                ],
                dtype=float,
            )
            .reshape(-1, 4)
            .T
        )
        model.eq_solref[:count] = -(1.0 - IMPEDANCE) * (A * (K, D)).T
        model.eq_data[:count, TORQUE_SCALE] = 2.0 * radius * np.sqrt(turning / A)

    def begin(self, around: Array) -> None:
        """Set constraints and objects at the beginning of a control period.

        Args:
            around: numbers of the surroundings; forces of constraints among them become
                zero, since MuJoCo exerts them.
        """
        memory = around[self._places]
        # or the force would act twice, by MuJoCo and by our equations
        around[self._places[self.forces]] = 0.0
        count = len(self._sites)
        self._data.eq_active[:count] = around[self._time] < self._release
        fixed = self._sites[self._model.eq_type[:count] == mujoco.mjtEq.mjEQ_WELD]
        for site, turn in zip(
            fixed, memory[self._turns].reshape(-1, 3, 3), strict=True
        ):
            # ``turn`` leads from the body to the frame, a site's attitude back to its
            # body
            mujoco.mju_mat2Quat(self._model.site_quat[site], turn.T.ravel())
        self.put(memory)

    def put(self, memory: Array) -> None:
        """Write the objects' states, given the numbers of the coupled memories, into
        MuJoCo's data.
        """
        # from the front: of no objects there is no last number
        data = self._data
        data.qpos[len(data.qpos) - len(self.poses) :] = memory[self.poses]
        data.qvel[len(data.qvel) - len(self.moving) :] = memory[self.moving]

    def wrenches(self) -> list[float]:
        """Torque (N m) and force (N) of each constraint on its object at the grasp,
        world axes, from MuJoCo's rows.
        """
        model = self._model
        data = self._data
        numbers = list[float]()
        generalized = np.zeros(self._model.nv)
        for i, (site, body) in enumerate(zip(self._sites, self._bodies, strict=True)):
            # of one constraint alone: on a free body J^T f is its force and torque
            mujoco.mj_mulJacTVec(
                model,
                data,
                generalized,
                np.where(data.efc_id == i, data.efc_force, 0.0),
            )
            force, torque = generalized[model.body_dofadr[body] :][:6].reshape(2, 3)
            lever = data.site_xpos[site] - data.xpos[body]
            # MuJoCo gives the torque about the body's origin in the body's axes
            numbers += [
                *(data.xmat[body].reshape(3, 3) @ torque - np.cross(lever, force)),
                *force,
            ]
        return numbers
