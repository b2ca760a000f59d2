"""The rigid-body plant traced into straight-line programs."""

from __future__ import annotations

import math
from functools import cached_property

from skyarm.actuation import Command
from skyarm.algebra import Quaternion, Vec3
from skyarm.compile import Program, trace
from skyarm.dynamics import State
from skyarm.environment import WindSample
from skyarm.plant.interface import Flat, World, number, whole_steps
from skyarm.plant.rigid_body import INTEGRATORS, STEP, accelerate
from skyarm.plant.stiffness import friction_rate
from skyarm.vehicle.check import require_plant

FRICTION_STEP = 0.6
"""Largest product of friction's decay rate and an RK4 step (stable to 2.78; error 6e-4 of the fastest mode)."""


def example_state(joints: int, rotors: int) -> State:
    """A state with the right number of leaves; its values are not used."""
    return State(
        position=Vec3(0.0, 0.0, 0.0),
        quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
        velocity=Vec3(0.0, 0.0, 0.0),
        rate=Vec3(0.0, 0.0, 0.0),
        joints=(0.0,) * joints,
        joint_rates=(0.0,) * joints,
        rotor_speeds=(0.0,) * rotors,
    )


def example_command(joints: int, rotors: int) -> Command:
    """A command with the right number of leaves."""
    return Command(rotor_speeds=(0.0,) * rotors, efforts=(0.0,) * joints)


class RigidBodyPlant:
    """Our own multibody plant, one traced step program per step length.

    Args:
        world: true vehicle and gravity. A planar model is refused: no real body has its inertia.
        wind: a sample of the episode's wind; its structural zeros are folded away.
        integrator: "rk4" takes one step per call, more where joint friction is stiff; "euler" takes ``physics_step``.
        physics_step: s.
    """

    def __init__(self, world: World, wind: WindSample, integrator: str = "rk4", physics_step: float = 0.001) -> None:
        require_plant(world.vehicle)
        if integrator not in INTEGRATORS:
            raise ValueError(f"integrator = {integrator!r}: must be one of {list(INTEGRATORS)}")
        self.vehicle = world.vehicle
        self._world, self._wind, self._integrator, self._physics_step = world, wind, integrator, physics_step
        n, rotors = world.vehicle.n, len(world.vehicle.rotors)
        self._examples = (example_state(n, rotors), example_command(n, rotors), wind)
        self._steps: dict[float, Program] = {}
        self._per_second = friction_rate(world.vehicle) / FRICTION_STEP

    @cached_property
    def _accelerometer(self) -> Program:
        return trace(self._reading, *self._examples)

    def _reading(self, state: State, command: Command, wind: WindSample) -> Vec3:
        base, _ = accelerate(self._world, state, state.rotor_speeds, command.efforts, wind)
        # without rotors, drag and wind nothing pushes: the reading is a structural zero
        return Vec3(*(number(c) for c in base.linear))

    def _step(self, dt: float) -> Program:
        if dt not in self._steps:
            law = STEP[self._integrator]

            def step(state: State, command: Command, wind: WindSample) -> State:
                return law(self._world, state, command, wind, dt)

            self._steps[dt] = trace(step, *self._examples)
        return self._steps[dt]

    def substeps(self, seconds: float) -> int:
        """Integration steps that an interval is cut into."""
        if self._integrator == "rk4":
            return max(1, math.ceil(seconds * self._per_second))
        return whole_steps(seconds, self._physics_step)

    def advance(self, state: Flat, command: Flat, wind: Flat, seconds: float) -> tuple[float, ...]:
        """State after ``seconds`` of held command and wind."""
        inputs = (*command, *wind)
        rk4 = self._integrator == "rk4"
        count = self.substeps(seconds)
        step = self._step(seconds / count if rk4 else self._physics_step)
        x = tuple(state)
        for _ in range(count):
            x = step.flat((*x, *inputs))
        return x

    def specific_force(self, state: Flat, command: Flat, wind: Flat) -> tuple[float, float, float]:
        """Proper acceleration of the base origin, base axes, m/s^2."""
        x, y, z = self._accelerometer.flat((*state, *command, *wind))
        return x, y, z
