"""Rigid-body plant compiled into machine code or straight-line Python."""

from __future__ import annotations

import math
from functools import cached_property
from typing import NamedTuple

from skyarm.algebra import Vec3
from skyarm.algebra.scalars import Scalar, data, floor, where
from skyarm.compile import Program, trace
from skyarm.compile.tracing.lower import repeat, repeat_while
from skyarm.compile.tracing.program import Flat as FlatFunction
from skyarm.compile.tracing.program import trace_loop
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.point_motion import PointMotion
from skyarm.dynamics.state import example_state
from skyarm.plant.interface import Flat, Truth, whole_steps
from skyarm.plant.joint_rate import joint_rate
from skyarm.plant.largest_step import (
    FRICTION_STEP,
    HELD_FRICTION_STEP,
    INTEGRATORS,
    STAGES,
    VERLET,
    divisions,
    largest_step,
    verlet_step,
)
from skyarm.plant.rigid_body import COUPLED_STEP, Moved, accelerate, after_impact, far_step
from skyarm.plant.surroundings import Surroundings
from skyarm.vehicle.vehicle_records import require_plant


def example_command(joints: int, rotors: int, tilts: int = 0) -> Command:
    """Command of zeros for tracing, with given numbers of rotors, joints and tilt angles."""
    return Command(rotor_speeds=(0.0,) * rotors, efforts=(0.0,) * joints, tilts=(0.0,) * tilts)


class Steps(NamedTuple):
    """Number of integration steps that a plant takes in an interval, near contacts and far from them.

    Attributes:
        near: steps. far: fewer steps of the plant's integrator while the coupled components are inactive; 0 for none.
        rounds: least number of the inactive components' own steps within one of those.
        verlet: True if active components use the Stoermer-Verlet method instead of the plant's integrator.
        most: times ``near``, of the steps in an interval in which something hits.
    """

    near: int
    far: int = 0
    rounds: int = 1
    verlet: bool = False
    most: int = 1


def hold(
    world: Truth, integrator: str, count: Steps, now: Moved, command: Command, around: Surroundings, seconds: Scalar
) -> Moved:
    """Integrate vehicle and contact states over an interval (s) with a constant command."""
    near = VERLET if count.verlet else integrator

    there, motion = around.with_coupled(now[1]), PointMotion(world.vehicle, now[0])
    steps: Scalar = float(count.near)
    if count.most > 1:
        memories, finer = there.hurry(motion, seconds)
        now, steps = (now[0], memories), -floor(-steps * finer)

    def step(both: Moved) -> Moved:
        return COUPLED_STEP[near](world, both[0], command, around.with_coupled(both[1]), seconds / steps)

    far: Scalar = count.far > 0 and there.far(motion, seconds)
    if far is False and count.most == 1:
        return repeat(count.near, step, now)

    def step_far(both: Moved) -> Moved:
        return far_step(integrator, world, both, command, around, seconds / count.far, count.rounds)

    now = repeat_while(count.near * count.most, where(far, 0.0, steps), step, now)
    if far is False:
        return now
    return repeat_while(count.far, where(far, float(count.far), 0.0), step_far, now)


class RigidBodyPlant:
    """Simulated vehicle by this library's own rigid-body dynamics, compiled once per interval length.

    Args:
        world: true vehicle and gravity. A planar model is refused: no real body has its inertia.
        around: surroundings of one period as an example; their structural zeros are folded away.
        integrator: "rk4" takes one step per call, more where joint friction is stiff; "euler" takes ``physics_step``;
            both divide their step where the surroundings state a largest one. "rk4_staged", which other plants tell
            from "rk4", is "rk4" here.
        physics_step: s.
    """

    def __init__(
        self, world: Truth, around: Surroundings, integrator: str = "rk4", physics_step: float = 0.001
    ) -> None:
        require_plant(world.vehicle)
        if integrator not in INTEGRATORS:
            raise ValueError(f"integrator = {integrator!r}: must be one of {list(INTEGRATORS)}")
        self.vehicle = world.vehicle
        self._world, self.around, self._integrator, self._physics_step = world, around, integrator, physics_step
        sizes = world.vehicle.sizes
        self._examples = (example_state(*sizes), example_command(*sizes), around)
        self._programs: dict[float, FlatFunction] = {}
        euler = integrator == "euler"
        self._largest = largest_step(around, euler=euler)
        self._largest_far = largest_step(around, coupled=False, euler=euler)
        self._rate = joint_rate(world.vehicle)
        self._verlet = None if euler else verlet_step(around)

    @cached_property
    def _accelerometer(self) -> Program:
        return trace(self._reading, *self._examples)

    def _reading(self, state: State, command: Command, around: Surroundings) -> Vec3:
        base, _ = accelerate(self._world, state, command, around)
        # without rotors, drag and wind nothing pushes: the reading is a structural zero
        return Vec3(*(data(c) for c in base.linear))

    def substeps(self, seconds: float) -> Steps:
        """Number of integration steps that the plant takes in an interval of ``seconds``."""
        most = 1
        if self._integrator != "euler":  # whose step is said
            most = max((self.around.components[i].most_hit_steps for i in self.around.coupled), default=1)
        near, far = (self._count(seconds, largest) for largest in (self._largest, self._largest_far))
        if near == far:
            return Steps(near, most=most)
        rounds = math.ceil(near / far)
        if self._verlet is not None:
            verlet_steps = max(divisions(seconds, self._verlet), math.ceil(seconds * self._rate / HELD_FRICTION_STEP))
            if verlet_steps < near * STAGES:
                return Steps(verlet_steps, far, rounds, verlet=True, most=most)
        return Steps(near, far, rounds, most=most)

    def _count(self, seconds: float, largest: float | None) -> int:
        if self._integrator != "euler":
            return max(1, math.ceil(seconds * (self._rate / FRICTION_STEP)), divisions(seconds, largest))
        return whole_steps(seconds, self._physics_step) * divisions(self._physics_step, largest)

    def advance(self, state: Flat, command: Flat, around: Flat, seconds: float) -> tuple[float, ...]:
        """Vehicle state, then contact states, after ``seconds`` with a constant command."""
        if seconds not in self._programs:

            def interval(
                _: tuple[()], __: tuple[()], inputs: tuple[State, Command, Surroundings], ___: tuple[Scalar, ...]
            ) -> tuple[tuple[()], Moved]:
                state, command, around = inputs
                now, count = (state, around.coupled_memories()), self.substeps(seconds)
                return (), hold(self._world, self._integrator, count, now, command, around, seconds)

            self._programs[seconds] = trace_loop(interval, (), (), self._examples, loops=True).stepper()
        return self._programs[seconds]((*state, *command, *around))

    @cached_property
    def _impact(self) -> Program:
        def impact(state: State, around: Surroundings) -> State:
            return after_impact(self.vehicle, state, around)

        return trace(impact, self._examples[0], self.around)

    def after_impact(self, state: Flat, around: Flat) -> tuple[float, ...]:
        """Vehicle state right after the impulse of a grasp or of a joint that gets stuck."""
        return self._impact.flat((*state, *around))

    def specific_force(self, state: Flat, command: Flat, around: Flat) -> tuple[float, float, float]:
        """Proper acceleration of the base origin, base axes, m/s^2."""
        x, y, z = self._accelerometer.flat((*state, *command, *around))
        return x, y, z
