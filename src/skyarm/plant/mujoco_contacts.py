"""The third plant: MuJoCo's rigid bodies with MuJoCo's own contacts, under the same rotors, wind, drives and grasps.

Collisions, contact forces and the motion of the world's bodies are MuJoCo's; the formulas of
:mod:`skyarm.world.contact` are
not used. Steps are MuJoCo's semi-implicit Euler method, for which its contact solver is made.
"""

from __future__ import annotations

from itertools import accumulate, pairwise
from typing import Any

import mujoco
import numpy as np

from skyarm.compile import leaves
from skyarm.compile.llvm.lane_stepper import Quick
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.point_motion import PointMotion
from skyarm.plant.interface import Flat, Truth, number, whole_steps
from skyarm.plant.largest_step import divisions, largest_step
from skyarm.plant.loads import rotor_speeds_after, tilts_after
from skyarm.plant.mujoco import QUIET
from skyarm.plant.mujoco_layout import Layout
from skyarm.plant.mujoco_model import build_spec
from skyarm.plant.mujoco_world import POINT, UNMOVED, WorldBuilder, WorldPlaces
from skyarm.plant.surroundings import Around, Surroundings, after_euler_step, before_euler_step, places_in, slopes_of
from skyarm.vehicle.check import require_plant
from skyarm.world.contact.plant_contact import PlantContact

FELT = 9
"""Numbers of a pair: force and torque on the point, normal force, friction, depth."""


class FeltReader:
    """Reads the contacts of MuJoCo's last forward step.

    Args:
        model, data: MuJoCo's. contact: the world. places: where its shapes stand in the model.
    """

    def __init__(self, model: Any, data: Any, contact: PlantContact, places: WorldPlaces) -> None:
        self._model, self._data = model, data
        self._points = {geom: i for i, geom in enumerate(places.points)}
        self._surfaces = {geom: i for i, geom in enumerate(places.surfaces)}
        # a point is a tiny sphere whose skin touches before it
        self._early = [POINT if float(point.radius) < POINT else 0.0 for point in contact.points]
        self._rows = np.zeros((len(places.surfaces) * len(places.points), FELT))

    def read(self) -> Any:
        """Numbers of all pairs of a surface and a point, surface by surface; zeros of those that do not touch."""
        rows, data = self._rows, self._data
        rows[:] = 0.0
        push = np.zeros(6)
        for i in range(data.ncon):
            contact = data.contact[i]
            first, second = int(contact.geom1), int(contact.geom2)
            geom, other, sense = (first, second, -1.0) if first in self._points else (second, first, 1.0)
            if geom not in self._points or other not in self._surfaces:
                continue  # of two bodies of the world
            mujoco.mj_contactForce(self._model, data, i, push)
            point = self._points[geom]
            force = sense * contact.frame.reshape(3, 3).T @ push[:3]
            torque = np.cross(contact.pos - data.geom_xpos[geom], force)
            depth = max(-float(contact.dist) - self._early[point], 0.0)
            row = rows[self._surfaces[other] * len(self._points) + point]
            row[:] = (*force, *torque, push[0], np.hypot(push[1], push[2]), depth)
        return rows.ravel()


INTEGRATOR = "euler"
"""The only one of this plant."""


class MujocoContactPlant:
    """MuJoCo moves the vehicle and the bodies of the world, and computes their contacts.

    Not for two threads at once: each call works in the same MuJoCo data, though nothing in it outlives the call.

    Args:
        world: true vehicle and gravity.
        around: surroundings of one period as an example, with one
        :class:`skyarm.world.contact.plant_contact.PlantContact`. integrator: "euler".
        physics_step: s; steps are shorter where the surroundings state a largest step.
    """

    def __init__(self, world: Truth, around: Around, integrator: str = INTEGRATOR, physics_step: float = 0.001) -> None:
        require_plant(world.vehicle)
        self.vehicle, self._world = world.vehicle, world
        self._place, self._contact = contact_in(around)
        if integrator != INTEGRATOR:
            raise ValueError(f"integrator = {integrator!r}: must be {INTEGRATOR!r}")
        self._step = physics_step / divisions(physics_step, largest_step(around, euler=True))
        alone = build_spec(world.vehicle, float(world.gravity), timestep=self._step, integrator=INTEGRATOR)
        self._layout = layout = Layout(world.vehicle, alone.compile())
        spec = build_spec(world.vehicle, float(world.gravity), timestep=self._step, integrator=INTEGRATOR)
        self.model, self._places = WorldBuilder(spec, world.vehicle, self._contact).compile(self._step)
        self._data = mujoco.MjData(self.model)
        self._to_base = self._data.xmat[1].reshape(3, 3).T
        self._gravity = self.model.opt.gravity
        self._felt = FeltReader(self.model, self._data, self._contact, self._places)
        self._prepare_program(around, layout)
        self._prepare_memory(around)

    def _prepare_program(self, around: Around, layout: Layout) -> None:
        """The loads as one program, and views of its numbers."""
        n = self.vehicle.n
        inputs = (0.0,) * layout.end, (0.0,) * layout.rotors, (0.0,) * n, (0.0,) * layout.tilts
        self._program = Quick(self._forces_and_speeds, *inputs, around)
        self._commanded = self._program.inputs[layout.end :][: layout.driven + n]
        self._around = self._program.inputs[layout.end + layout.driven + n :]
        ends = (0, layout.nq, layout.nq + layout.nv, layout.end)
        self._qpos, self._qvel, self._driven = (self._program.inputs[a:b] for a, b in pairwise(ends))
        moving, bodies = len(self._places.moving_positions), sum(map(len, self._places.velocities))
        counts = layout.nv, bodies, moving, moving, moving, layout.driven
        cuts = (*accumulate(counts, initial=0), len(self._program.outputs))
        parts = [self._program.outputs[a:b] for a, b in pairwise(cuts)]
        self._pushed, self._on_bodies = parts[:2]
        self._surfaces, self._driven_to, self._remembered = parts[2:5], *parts[5:]

    def _prepare_memory(self, around: Any) -> None:
        """Indices of the bodies' and the contact forces' numbers in the surroundings and in MuJoCo's."""
        self._coupled = np.array(places_in(around), dtype=int)
        memories = around.coupled_memories()
        before = sum(len(leaves(each)) for each in memories[: self._place])
        memory = memories[self._place]
        first = before + len(leaves((memory.clock, memory.bristles)))
        places, velocities = self._places.positions, self._places.velocities
        qpos, qvel = list[int](), list[int]()
        for held, q, v in zip(memory.carried, places, velocities, strict=True):
            qpos += range(first, first + len(q))
            qvel += range(first + len(q), first + len(q) + len(v))
            first += len(leaves(held))
        self._of_qpos, self._of_qvel = self._coupled[qpos], self._coupled[qvel]
        self._at_qpos = np.array([i for at in places for i in at], dtype=int)
        self._at_qvel = np.array([i for at in velocities for i in at], dtype=int)
        self._of_surfaces = np.array(self._places.moving_positions, dtype=int)
        self._at_surfaces = np.array(self._places.moving_velocities, dtype=int)
        start = before + len(leaves(memory)) - FELT * len(memory.felt)
        self._of_felt = self._coupled[start : start + FELT * len(memory.felt)]

    def _forces_and_speeds(self, x: Any, commanded: Any, setpoints: Any, angles: Any, around: Any) -> Any:
        """Forces without contacts, the places of moving surfaces, and the results of one step without motions."""
        state = self._layout.state(x)
        command = Command(rotor_speeds=commanded, efforts=setpoints, tilts=angles)
        around = self._without_touches(around)
        around = before_euler_step(self._world, state, state.rotor_speeds, around, self._step)
        forces = self._layout.generalized_forces(state, setpoints, around, commanded)
        slopes = slopes_of(self._world, state, state.rotor_speeds, around)
        motion = PointMotion(self.vehicle, state, around.air_velocity, gravity=self._world.gravity)
        memory = around.coupled_memories()[self._place]
        on_bodies = self._contact.efforts(memory, slopes[self._place], motion)
        moving = [surface.motion for surface in self._contact.surfaces if surface.moves]
        signals = [signal.derivatives(memory.clock[0]) for at in moving for signal in (at.x, at.y, at.z)]
        places, velocities, accelerations = ([each[order] for each in signals] for order in range(3))
        turned = rotor_speeds_after(self.vehicle, state, command, self._step, around)
        leaning = tilts_after(self.vehicle, state, command, self._step)
        memories = leaves(after_euler_step(around, slopes, self._step))
        surfaces = *places, *velocities, *accelerations
        return tuple(number(each) for each in (*forces, *on_bodies, *surfaces, *turned, *leaning, *memories))

    def _without_touches(self, around: Surroundings) -> Surroundings:
        """The surroundings without what the last period's contacts did."""
        memories = list(around.coupled_memories())
        memories[self._place] = self._contact.without_touches(memories[self._place])
        return around.with_coupled(memories)

    def advance(self, state: Flat, command: Flat, around: Flat, seconds: float) -> tuple[float, ...]:
        """State after ``seconds`` (whole physics steps), inputs held, then the coupled memories."""
        self._set(state, command, around)
        with QUIET:
            for _ in range(whole_steps(seconds, self._step)):
                self._forward()
                mujoco.mj_Euler(self.model, self._data)
                self._read_back()
            self._forward()
            self._around[self._of_felt] = self._felt.read()
        ours: tuple[float, ...] = self._layout.to_ours(self._program.inputs[: self._layout.end].tolist())
        return (*ours, *self._around[self._coupled].tolist())

    def _set(self, state: Flat, command: Flat, around: Flat) -> None:
        """Numbers of an instant to where the loads read them, and to MuJoCo's; its solver starts afresh."""
        x = self._layout.to_mujoco(state)
        self._program.inputs[:] = (*x, *command, *around)
        qpos, qvel = self._data.qpos, self._data.qvel
        qpos[: self._layout.nq], qvel[: self._layout.nv] = self._qpos, self._qvel
        qpos[self._at_qpos], qvel[self._at_qvel] = self._around[self._of_qpos], self._around[self._of_qvel]
        self._data.qacc_warmstart[:] = 0.0

    def _forward(self) -> None:
        """MuJoCo's accelerations under the loads of the present numbers."""
        self._program.step()
        data = self._data
        data.qfrc_applied[: self._layout.nv] = self._pushed
        data.qfrc_applied[self._at_qvel] = self._on_bodies
        if len(self._of_surfaces):
            at = self._at_surfaces
            place, velocity, acceleration = self._surfaces
            data.qpos[self._of_surfaces], data.qvel[at] = place, velocity
            data.qfrc_applied[at] = UNMOVED * acceleration
        mujoco.mj_forward(self.model, data)

    def _read_back(self) -> None:
        """Copy the result of a step to the arrays of the loads."""
        layout, qpos, qvel = self._layout, self._data.qpos, self._data.qvel
        self._qpos[:], self._qvel[:], self._driven[:] = qpos[: layout.nq], qvel[: layout.nv], self._driven_to
        self._around[self._coupled] = self._remembered
        self._around[self._of_qpos], self._around[self._of_qvel] = qpos[self._at_qpos], qvel[self._at_qvel]

    def specific_force(self, state: Flat, command: Flat, around: Flat) -> tuple[float, float, float]:
        """Proper acceleration of the base origin, base axes, m/s^2: the free joint's acceleration plus g."""
        self._set(state, command, around)
        with QUIET:
            self._forward()
        fx, fy, fz = (self._to_base @ (self._data.qacc[:3] - self._gravity)).tolist()
        return fx, fy, fz


def contact_in(around: Around) -> tuple[int, PlantContact]:
    """The contact of the surroundings, and its number among the coupled components.

    Raises:
        ValueError: there is none.
    """
    if isinstance(around, Surroundings):
        for place, i in enumerate(around.coupled):
            if isinstance(around.components[i], PlantContact):
                return place, around.components[i]  # type: ignore[return-value]
    raise ValueError("plant.kind = 'mujoco_contacts': must be another without a [world]")
