"""MuJoCo plant: MuJoCo's rigid-body dynamics with this library's rotors, wind and joint
drives.

Only the length of a step where joint friction is stiff comes from our own mass matrix
(:mod:`skyarm.plant.joint_rate`).
"""

from __future__ import annotations

import math
import threading
import warnings
from collections.abc import Sequence
from itertools import chain
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from skyarm.algebra import Scalar, Scalars
from skyarm.compile import Program, trace
from skyarm.compile.llvm.lane_stepper import Quick
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.state import State, example_state
from skyarm.plant.interface import Flat, Truth, example_command, whole_steps
from skyarm.plant.joint_rate import (
    HELD_TOUCH_STEP,
    TOUCH_STEP,
    joint_rate,
    stop_numbers,
    touch_steps,
)
from skyarm.plant.largest_step import (
    FRICTION_STEP,
    HELD_FRICTION_STEP,
    divisions,
    largest_step,
    require_integrator,
)
from skyarm.plant.loads import (
    before_euler_step,
    changes_inertia,
    follow_commands,
    held_frictions,
    rigid_loads,
    with_equivalent_rotors,
)
from skyarm.plant.mujoco_layout import Layout
from skyarm.plant.mujoco_loads import Coupling, Loads
from skyarm.plant.mujoco_model import add_vehicle, body_name, build_spec
from skyarm.plant.mujoco_stages import StagedRungeKutta
from skyarm.plant.mujoco_welds import Welds, closed_contacts
from skyarm.plant.surroundings import Surroundings, Together, coupled_places, several
from skyarm.records.arrays import Array, field_views
from skyarm.records.leaves import Tree, as_data, leaves
from skyarm.vehicle import BASE, Vehicle
from skyarm.vehicle.vehicle_records import require_plant

if TYPE_CHECKING:
    from skyarm.world.contact.closed_contact import ClosedContact

LARGEST_FRICTION_STEP = {"rk4": HELD_FRICTION_STEP, "rk4_staged": FRICTION_STEP}
"""Integrator -> largest product of friction's decay rate and a step."""


class _Quiet:
    """Context manager that suppresses MuJoCo's warnings.

    An episode's own checks report divergence. MuJoCo has one handler for all threads;
    the caller's comes back.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._inside = 0
        self._usual = None

    def __enter__(self) -> None:
        with self._lock:
            # threads nest: the first one in takes the caller's handler, the last gives
            # it back
            if self._inside == 0:
                self._usual = mujoco.get_mju_user_warning()
                mujoco.set_mju_user_warning(_ignore)
            self._inside += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._inside -= 1
            if self._inside == 0:
                mujoco.set_mju_user_warning(self._usual)


def _ignore(_message: str) -> None:
    pass


QUIET = _Quiet()


def _kind_of(contact: ClosedContact) -> type[Welds]:
    """Geoms for a contact model whose forces the plant finds, else welds alone."""
    if not contact.geoms:
        return Welds
    # made of contact, which flights without it do without
    from skyarm.plant.mujoco_geoms import Geoms

    return Geoms


def _with_loads_at_stages(
    integrator: str, vehicles: Sequence[Vehicle], around: Together
) -> str:
    """Integrator name, with "rk4" replaced by "rk4_staged" where forces are stiff.

    With its force held for a step h an undamped oscillator of frequency w grows by
    sqrt(1 + (w h)^2 / 2) each step of "rk4"; in "euler", which moves positions with the
    new velocities, it does not grow.
    """
    springs = any(
        link.joint.has_stops for each in vehicles for link in each.links
    ) or bool(around.coupled)
    springs = springs or any(
        drive.largest_step is not None for drive in around.drives_of_all
    )
    return "rk4_staged" if integrator == "rk4" and springs else integrator


Written = tuple[Flat | None, Flat | None]
"""State and surroundings last written for MuJoCo and the loads."""

NOTHING: Written = (None, None)


class MujocoPlant:
    """Simulated vehicle whose rigid bodies MuJoCo integrates; this library computes the
    forces.

    MuJoCo's own integrators hold forces for each physics step, which makes both methods
    of first order in it. With "rk4_staged" forces are evaluated at each stage, and the
    method is of fourth order. A spring whose force is held for a step of "rk4" gains
    energy, so "rk4" is "rk4_staged" where joints have stops, a drive states a largest
    step or there are coupled components. Grasps that the plant closes are constraints
    (:mod:`skyarm.plant.mujoco_welds`), which are solved at the stages alone. Not for
    two threads at once: each call works in the same MuJoCo data, though nothing in it
    outlives the call.

    Args:
        world: true vehicle and gravity, or those of several vehicles. A planar model is
            refused: no real body has its inertia.
        around: surroundings of one period as an example, of all vehicles or of the only
            one; their structural zeros are folded away.
        integrator: MuJoCo's "rk4" or (semi-implicit) "euler"; "rk4_staged" of
            :mod:`skyarm.plant.mujoco_stages`.
        physics_step: s; all but "euler" take shorter steps where joint friction would
            be stiff; all do where the surroundings state a largest step.
    """

    several = True
    """True of a plant that is made of several vehicles, too, as of
    :class:`skyarm.plant.compiled.RigidBodyPlant`."""

    def __init__(
        self,
        world: Truth | Sequence[Truth],
        around: Surroundings | Together,
        integrator: str = "rk4",
        physics_step: float = 0.001,
    ) -> None:
        self._worlds, around = several(world, around)
        vehicles = [each.vehicle for each in self._worlds]
        for vehicle in vehicles:
            require_plant(vehicle)
        require_integrator(integrator)
        self.vehicle = vehicles[0]
        integrator = _with_loads_at_stages(integrator, vehicles, around)
        # "euler" takes friction at the end of a step, which is stable for any step
        if integrator in LARGEST_FRICTION_STEP:
            rate = max(map(joint_rate, vehicles))
            physics_step /= max(
                1, math.ceil(rate * physics_step / LARGEST_FRICTION_STEP[integrator])
            )
        self._euler = integrator == "euler"
        physics_step /= divisions(physics_step, largest_step(around, euler=self._euler))
        loads = [
            [load for load, _ in rigid_loads(around.of(i))]
            for i in range(len(vehicles))
        ]
        # the first vehicle keeps its own names, so one alone is named as in its file
        prefixes = ("", *(f"{name}/" for name in around.names[1:]))
        spec = build_spec(
            vehicles[0],
            float(self._worlds[0].gravity),
            timestep=physics_step,
            integrator=integrator,
            loads=loads[0],
        )
        for vehicle, held, prefix in zip(
            vehicles[1:], loads[1:], prefixes[1:], strict=True
        ):
            add_vehicle(spec, vehicle, held, prefix)
        self._welds = [
            _kind_of(contact)(spec, vehicles, prefixes, around)
            for contact, _ in closed_contacts(around)
        ]
        with QUIET, warnings.catch_warnings():
            # of masses beyond measure, whose flight ends as diverged
            warnings.simplefilter("ignore")
            self.model = spec.compile()
        self._physics_step = physics_step
        self._rk4 = integrator == "rk4"
        self._data = mujoco.MjData(self.model)
        # views of MuJoCo's numbers: to ask its records for them costs a microsecond
        # each time
        self._layout = layout = Layout(self._worlds, self.model, prefixes)
        self._qpos = self._data.qpos[: layout.nq]
        self._qvel = self._data.qvel[: layout.nv]
        self._force = self._data.qfrc_applied
        for each in self._welds:
            each.bind(self.model, self._data)
        self._gravity = self.model.opt.gravity
        self._bases = self._views_of_bases(prefixes)
        commands = tuple(example_command(*each.sizes) for each in vehicles)
        x = tuple((0.0,) * size for size in (layout.nq, layout.nv, layout.driven))
        given: tuple[Tree, ...] = (*x, commands, around, physics_step)
        self._loads = program = Quick(self._forces_and_speeds, *given)
        # views of the program's inputs and outputs, which a step reads and writes
        *self._parts, self._commanded, self._around, _ = field_views(
            given, program.inputs
        )[0].values()
        self._pushed, self._turned, self._remembered, self._held = field_views(
            program.result, program.outputs
        )[0].values()
        self._coupled = [*coupled_places(around)]
        self._written = NOTHING
        # followers are held from step to step; without them nothing is
        self._forward = mujoco.mj_forward
        if any(each.followers for each in vehicles):
            self._forward = Coupling(layout, self._data).forward
        changes = any(changes_inertia(around.of(i)) for i in range(len(vehicles)))
        self._carried = (
            Loads(layout, self.model, self._data, around, prefixes) if changes else None
        )
        self._touch = self._program_of_touches(vehicles)
        self._staged: StagedRungeKutta | None = None
        if integrator == "rk4_staged":
            self._staged = StagedRungeKutta(
                layout, self.model, self._data, around, self._forward, self._welds
            )

    def _views_of_bases(self, prefixes: Sequence[str]) -> list[tuple[Array, Array]]:
        """Acceleration (6,) and rotation matrix (3, 3), world to base axes, of each
        base in MuJoCo's data.
        """
        views = []
        rows = zip(self._worlds, prefixes, self._layout.bases, strict=True)
        for world, prefix, at in rows:
            body = self.model.body(prefix + body_name(world.vehicle, BASE)).id
            R_WB = self._data.xmat[body].reshape(3, 3)
            # views, not copies: they follow MuJoCo's data
            views.append((self._data.qacc[at : at + 6], R_WB.T))
        return views

    def _program_of_touches(self, vehicles: Sequence[Vehicle]) -> Program | None:
        """Program for the number of steps that joints need at their stops in an
        interval (s); None without stops.
        """
        stops = [stop_numbers(each) for each in vehicles]
        largest = HELD_TOUCH_STEP if self._euler else TOUCH_STEP
        states = tuple(example_state(*each.sizes) for each in vehicles)

        def steps(now: Sequence[State], seconds: Scalar) -> Scalar:
            return touch_steps(
                [each.vehicle for each in self._worlds], stops, now, seconds, largest
            )

        return trace(steps, states, 0.0) if any(stops) else None

    def _forces_and_speeds(
        self,
        qpos: Scalars,
        qvel: Scalars,
        speeds: Scalars,
        commands: tuple[Command, ...],
        around: Together,
        dt: Scalar,
    ) -> tuple[Scalars, Scalars, Scalars, Scalars]:
        """Generalised forces for MuJoCo, and what an integration step of ``dt`` (s)
        changes besides.

        Returns:
            Forces; rotor and tilt states, then contact states, after the step; armature
            that the step adds to joints.
        """
        states = self._layout.states((*qpos, *qvel, *speeds))
        if self._euler:
            around = before_euler_step(self._worlds, states, around, dt)
        # in the stages of "rk4", MuJoCo's own, our forces are those of the step's start
        held = self._euler or self._rk4
        worlds, (equivalent,) = with_equivalent_rotors(
            self._worlds, (states,), commands, around, dt, held=held
        )
        forces = self._layout.generalized_forces(worlds, equivalent, commands, around)
        after = follow_commands(self._worlds, states, commands, around, dt)
        slopes = around.slopes(around.motions(self._worlds, states))
        driven = [
            number for each in after for number in (*each.rotor_speeds, *each.tilts)
        ]
        # implicit in Euler's step, as added armature, so that stiff friction is stable
        frictions: list[Scalar] = []
        if self._euler:
            for world, state in zip(worlds, states, strict=True):
                frictions += held_frictions(world.vehicle, state, dt)
        remembered = leaves(around.after_euler_step(slopes, dt))
        return as_data(
            (tuple(forces), tuple(driven), tuple(remembered), tuple(frictions))
        )

    def advance(
        self, state: Flat, command: Flat, around: Flat, seconds: float
    ) -> tuple[float, ...]:
        """Vehicle state, then contact states, after ``seconds`` (whole integration
        steps) with constant inputs.

        A diverged state stays diverged.
        """
        self._set(state, command, around)
        self._written = NOTHING
        count = whole_steps(seconds, self._physics_step)
        dt = self._physics_step
        if self._touch is not None:
            (touch,) = self._touch.flat((*state, seconds))
            # divided equally, so that the interval still ends at its end
            count, dt = (count, dt) if touch <= count else (int(touch), seconds / touch)
        self._loads.inputs[-1] = self.model.opt.timestep = dt
        if self._staged is not None:
            return self._in_stages(self._staged, state, command, around, count, dt)
        model, data, step, rk4 = self.model, self._data, self._loads.step, self._rk4
        qpos, qvel, speeds = self._parts
        force = self._force
        forces = self._pushed
        turned = self._turned
        forward = self._forward
        given, coupled, remembered = self._around, self._coupled, self._remembered
        armature = model.dof_armature
        # a copy: each step adds its own friction to these
        own = model.dof_armature.copy()
        joints = [*chain(*self._layout.joints)]
        try:
            with QUIET:
                for _ in range(count):
                    step()
                    force[:] = forces
                    if not rk4:
                        # friction of this step enters M, by which MuJoCo solves for it
                        # implicitly
                        armature[joints] = own[joints] + self._held
                    # mj_step without its checks: the monitor of the episode says what
                    # went wrong
                    forward(model, data)
                    if rk4:
                        # 4: of fourth order
                        mujoco.mj_RungeKutta(model, data, 4)
                    else:
                        mujoco.mj_Euler(model, data)
                    qpos[:] = self._qpos
                    qvel[:] = self._qvel
                    speeds[:] = turned
                    if coupled:
                        given[coupled] = remembered
        finally:
            # an interruption leaves the model as it was, too
            armature[:] = own
        ours = self._layout.to_ours(self._loads.inputs[: self._layout.end].tolist())
        return (*ours, *given[coupled].tolist()) if coupled else ours

    def _in_stages(
        self,
        staged: StagedRungeKutta,
        state: Flat,
        command: Flat,
        around: Flat,
        count: int,
        dt: float,
    ) -> tuple[float, ...]:
        """Vehicle and contact state after several Runge-Kutta steps with forces
        evaluated at each stage.
        """
        self._loads.step()
        with QUIET:
            # the step above made the forces with which the first stage begins
            memory = self._around[self._coupled]
            start = self._layout.to_mujoco(state)
            given = (*command, *around)
            x, coupled = staged.advance(
                start, memory.tolist(), self._pushed, given, count, dt
            )
        return (*self._layout.to_ours(x), *coupled)

    def _set(self, state: Flat, command: Flat, around: Flat) -> None:
        """Write vehicle state, command and environment inputs into MuJoCo's data.

        A step begins where the accelerometer was read: of the same tuples only the
        command is written again.
        """
        # identity, not equality: comparing all numbers would cost what is saved
        if state is self._written[0] and around is self._written[1]:
            self._commanded[:] = command
            return
        if self._carried is not None:
            self._carried.carry(around)
        self._written = (
            (state, around)
            # a list or an array may change under the same identity
            if type(state) is tuple and type(around) is tuple
            else NOTHING
        )
        x = self._layout.to_mujoco(state)
        nq = self._layout.nq
        self._qpos[:], self._qvel[:] = x[:nq], x[nq : nq + self._layout.nv]
        # the last input is the step, of which the caller knows
        self._loads.inputs[:-1] = (*x, *command, *around)
        for each in self._welds:
            each.begin(self._around)

    def after_impact(self, state: Flat, around: Flat) -> tuple[float, ...]:
        """Vehicle state right after the impulse of a grasp or of a joint that gets
        stuck.
        """
        if self._carried is None:
            # nothing changes inertia, so nothing hits
            return tuple(state)
        x = self._layout.to_mujoco(state)
        nq = self._layout.nq
        nv = self._layout.nv
        self._qpos[:] = x[:nq]
        with QUIET:
            velocities = self._carried.velocity_after(np.array(x[nq : nq + nv]), around)
        ours = self._layout.to_ours((*x[:nq], *velocities.tolist(), *x[nq + nv :]))
        self._written = NOTHING
        return ours

    def specific_force(
        self, state: Flat, command: Flat, around: Flat
    ) -> tuple[float, ...]:
        """Reading of an ideal accelerometer at each base origin, base axes, m/s^2:
        three numbers a vehicle.
        """
        self._solve(state, command, around)
        return tuple(
            value
            for at, R in self._bases
            for value in (R @ (at[:3] - self._gravity)).tolist()
        )

    def angular_acceleration(
        self, state: Flat, command: Flat, around: Flat
    ) -> tuple[float, ...]:
        """Angular acceleration of each base, base axes, rad/s^2: three numbers a
        vehicle.
        """
        self._solve(state, command, around)
        return tuple(value for at, _ in self._bases for value in at[3:].tolist())

    def _solve(self, state: Flat, command: Flat, around: Flat) -> None:
        """Let MuJoCo solve for the accelerations at a state."""
        self._set(state, command, around)
        # a step of 0 s: rotors and bristles of this instant
        self._loads.inputs[-1] = 0.0
        self._loads.step()
        self._force[:] = self._pushed
        with QUIET:
            self._forward(self.model, self._data)
