"""Rigid-body plant compiled into machine code or straight-line Python."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

from skyarm.algebra import Scalar, Vec3
from skyarm.algebra.scalars import (
    clip,
    data,
    divide,
    floor,
    logical_and,
    maximum,
    minimum,
    where,
)
from skyarm.compile import Program, trace
from skyarm.compile.tracing.lower import repeat, repeat_while
from skyarm.compile.tracing.program import Flat as FlatFunction
from skyarm.compile.tracing.program import trace_call
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.state import example_state
from skyarm.plant.interface import Flat, Truth, example_command, whole_steps
from skyarm.plant.joint_rate import (
    HELD_TOUCH_STEP,
    TOUCH_STEP,
    JointNumbers,
    friction_bound,
    joint_numbers,
    joint_rate,
    stop_numbers,
    touch_steps,
)
from skyarm.plant.largest_step import (
    FRICTION_STEP,
    STAGES,
    VERLET,
    VERLET_FRICTION_STEP,
    divisions,
    largest_step,
    require_integrator,
    verlet_step,
)
from skyarm.plant.rigid_body import (
    COUPLED_STEP,
    Moved,
    accelerate,
    after_impacts,
    far_step,
)
from skyarm.plant.surroundings import Surroundings, Together, several
from skyarm.records.coerce import concrete
from skyarm.vehicle import Vehicle
from skyarm.vehicle.vehicle_records import require_plant
from skyarm.world.component import MOST_STEPS


class Steps(NamedTuple):
    """Number of integration steps that a plant takes in an interval, near contacts and
    far from them.

    Attributes:
        near: steps. far: fewer steps of the plant's integrator while the coupled
            components are inactive; 0 for none.
        rounds: least number of the inactive components' own steps within one of those.
        verlet: True if active components use the Stoermer-Verlet method instead of the
            plant's integrator.
        most: times ``near``, of the steps in an interval in which something hits.
        calm: least number of steps while grasps act and no contact does; 0 if these are
            always ``near``.
        stops: of each vehicle, what more steps follow from where a joint may meet a
            stop; empty without stops.
        slack: least number of steps of a flight whose joint friction is slower; 0 if
            friction asks for no steps.
        mobile: of each vehicle, what the friction of a flight's own numbers is judged
            by; empty without ``slack``.
    """

    near: int
    far: int = 0
    rounds: int = 1
    verlet: bool = False
    most: int = 1
    calm: int = 0
    stops: tuple[JointNumbers, ...] = ()
    slack: int = 0
    mobile: tuple[JointNumbers, ...] = ()


def hold(
    worlds: Sequence[Truth],
    integrator: str,
    count: Steps,
    now: Moved,
    commands: Sequence[Command],
    around: Together,
    seconds: Scalar,
) -> Moved:
    """Integrate vehicle and contact states over an interval (s) with constant
    commands.

    Args:
        worlds: true vehicles and gravity.
        integrator: integrator's name.
        count: numbers of integration steps near contact, far from it and at stops.
        now: states, and memories of the coupled components.
        commands: command of each vehicle.
        around: surroundings of the period.
        seconds: s.
    """
    # one evaluation of the forces in a step in place of four
    near = VERLET if count.verlet else integrator

    there = around.with_coupled(now[1])
    motions = there.motions(worlds, now[0])
    steps = float(count.near)
    vehicles = [each.vehicle for each in worlds]
    usual: Scalar = steps
    if count.slack:
        rate = friction_bound(vehicles, count.mobile)
        # a constant one is in ``steps`` already
        if not concrete(rate):
            # the friction of this flight; a hit below needs as many times more steps as
            # it does in a flight alone
            step_rate = VERLET_FRICTION_STEP if count.verlet else FRICTION_STEP
            # less 1e-9: a quotient that is whole up to rounding takes no step more
            usual = clip(
                -floor(1e-9 - seconds * rate / step_rate), float(count.slack), steps
            )
    finer: Scalar = usual
    if count.most > 1:
        memories, more = there.hurry(motions, seconds)
        now = (now[0], memories)
        finer = -floor(-usual * more)
    if count.calm:
        largest = there.largest_calm_step(verlet=count.verlet)
        assert largest is not None
        fewer = clip(-floor(1e-9 - divide(seconds, largest)), float(count.calm), steps)
        finer = where(
            there.calm(motions, seconds),
            fewer if usual is steps else minimum(usual, fewer),
            finer,
        )
    touch: Scalar = 0.0
    if count.stops:
        # both take a stop's damping at one instant of the step: first order
        held = count.verlet or integrator == "euler"
        touch = touch_steps(
            vehicles,
            count.stops,
            now[0],
            seconds,
            HELD_TOUCH_STEP if held else TOUCH_STEP,
        )
        finer = maximum(finer, touch)

    def step(both: Moved) -> Moved:
        return COUPLED_STEP[near](
            worlds, both[0], commands, around.near(both[1]), seconds / finer
        )

    far: Scalar = count.far > 0 and there.far(motions, seconds)
    if far is False and finer is steps and not count.stops:
        return repeat(count.near, step, now)
    if far is not False:
        # a joint that may meet its stop needs more than the few steps far from contact
        far = logical_and(far, touch <= float(count.far))

    def step_far(both: Moved) -> Moved:
        return far_step(
            integrator,
            worlds,
            both,
            commands,
            around,
            seconds / count.far,
            count.rounds,
        )

    # a loop states its most rounds: what hits and stops may ever ask for
    most = max(count.near * count.most, MOST_STEPS if count.stops else 0)
    now = repeat_while(most, where(far, 0.0, finer), step, now)
    if far is False:
        return now
    return repeat_while(count.far, where(far, float(count.far), 0.0), step_far, now)


class RigidBodyPlant:
    """Simulated vehicles by this library's own rigid-body dynamics, compiled once per
    interval length.

    Args:
        world: true vehicle and gravity, or those of several vehicles. A planar model is
            refused: no real body has its inertia.
        around: surroundings of one period as an example, of all vehicles or of the only
            one; their structural zeros are folded away.
        integrator: "rk4" takes one step per call, more where joint friction is stiff;
            "euler" takes ``physics_step``; both divide their step where the
            surroundings state a largest one. "rk4_staged", which other plants tell from
            "rk4", is "rk4" here.
        physics_step: s.
    """

    several = True
    """True of a plant that is made of several vehicles, too; others are made of one,
    and of its surroundings alone."""

    def __init__(
        self,
        world: Truth | Sequence[Truth],
        around: Surroundings | Together,
        integrator: str = "rk4",
        physics_step: float = 0.001,
    ) -> None:
        self._worlds, self.around = several(world, around)
        for each in self._worlds:
            require_plant(each.vehicle)
        require_integrator(integrator)
        self._integrator, self._physics_step = integrator, physics_step
        sizes = [each.vehicle.sizes for each in self._worlds]
        states = tuple(example_state(*each) for each in sizes)
        commands = tuple(example_command(*each) for each in sizes)
        self._examples = (states, commands, self.around)
        self._programs: dict[float, FlatFunction] = {}
        euler = integrator == "euler"
        self._largest = largest_step(self.around, euler=euler)
        self._largest_far = largest_step(self.around, coupled=False, euler=euler)
        self._rate = max(joint_rate(each.vehicle) for each in self._worlds)
        stops = tuple(stop_numbers(each.vehicle) for each in self._worlds)
        self._stops = stops if any(stops) else ()
        # Euler's steps evaluate the forces once, too: nothing would be saved
        self._verlet = None if euler else verlet_step(self.around)

    @property
    def vehicle(self) -> Vehicle:
        """Vehicle, or the first of several."""
        return self._worlds[0].vehicle

    @cached_property
    def _accelerometer(self) -> Program:
        return trace(lambda *now: self._of_bases("linear", *now), *self._examples)

    @cached_property
    def _turning(self) -> Program:
        return trace(lambda *now: self._of_bases("angular", *now), *self._examples)

    def _of_bases(
        self,
        part: str,
        states: tuple[State, ...],
        commands: tuple[Command, ...],
        around: Together,
    ) -> tuple[Vec3, ...]:
        # without rotors, drag and wind nothing pushes: the reading is a structural zero
        accelerations = accelerate(self._worlds, states, commands, around)
        return tuple(Vec3(*map(data, getattr(base, part))) for base, _ in accelerations)

    def substeps(self, seconds: float) -> Steps:
        """Number of integration steps that the plant takes in an interval of
        ``seconds``.
        """
        count = self.steps_at_rest(seconds)._replace(stops=self._stops)
        slack = divisions(seconds, self._verlet if count.verlet else self._largest)
        # the step of "euler" is stated, so friction asks for no other count
        if self._integrator == "euler" or slack >= count.near:
            return count
        return count._replace(
            slack=slack,
            mobile=tuple(joint_numbers(each.vehicle) for each in self._worlds),
        )

    def steps_at_rest(self, seconds: float) -> Steps:
        """Number of integration steps in an interval of ``seconds``, of which joints'
        speeds at stops ask no more.
        """
        most = 1
        # the step of "euler" is stated by the scenario
        if self._integrator != "euler":
            most = max(
                (component.most_hit_steps for _, component, _ in self.around.coupled),
                default=1,
            )
        near, far = (
            self._count(seconds, largest)
            for largest in (self._largest, self._largest_far)
        )
        if near == far:
            return Steps(near, most=most)
        rounds = math.ceil(near / far)
        if self._verlet is not None:
            verlet_steps = max(
                divisions(seconds, self._verlet),
                math.ceil(seconds * self._rate / VERLET_FRICTION_STEP),
            )
            # compared by evaluations of the forces, which take most of the time
            if verlet_steps < near * STAGES:
                return Steps(
                    verlet_steps,
                    far,
                    rounds,
                    True,
                    most,
                    self._calm(seconds, verlet_steps, STAGES * far, verlet=True),
                )
        return Steps(
            near, far, rounds, False, most, self._calm(seconds, near, far, verlet=False)
        )

    def _calm(self, seconds: float, near: int, least: int, *, verlet: bool) -> int:
        """Least number of steps while grasps act and no contact does, ``least`` or
        more; 0 if that helps nothing.
        """
        largest = (
            None
            if self._integrator == "euler"
            else self.around.largest_calm_step(verlet=verlet)
        )
        if largest is None:
            return 0
        held = self._rate / (VERLET_FRICTION_STEP if verlet else FRICTION_STEP)
        fewest = max(
            math.ceil(seconds * held), divisions(seconds, self._largest_far), least
        )
        # a calm count that is no smaller would only add a branch to the program
        return fewest if max(fewest, divisions(seconds, float(largest))) < near else 0

    def _count(self, seconds: float, largest: float | None) -> int:
        # Euler's step is stated; the others divide a period as often as something needs
        if self._integrator != "euler":
            return max(
                1,
                math.ceil(seconds * (self._rate / FRICTION_STEP)),
                divisions(seconds, largest),
            )
        return whole_steps(seconds, self._physics_step) * divisions(
            self._physics_step, largest
        )

    def advance(
        self, state: Flat, command: Flat, around: Flat, seconds: float
    ) -> tuple[float, ...]:
        """Vehicle state, then contact states, after ``seconds`` with a constant
        command.
        """
        # the number of steps depends on the time: one program for each
        if seconds not in self._programs:

            def interval(
                states: tuple[State, ...],
                commands: tuple[Command, ...],
                around: Together,
            ) -> Moved:
                now = (states, around.coupled_memories())
                count = self.substeps(seconds)
                return hold(
                    self._worlds,
                    self._integrator,
                    count,
                    now,
                    commands,
                    around,
                    seconds,
                )

            self._programs[seconds] = trace_call(interval, *self._examples).stepper()
        return self._programs[seconds]((*state, *command, *around))

    @cached_property
    def _impact(self) -> Program:
        def impact(states: tuple[State, ...], around: Together) -> tuple[State, ...]:
            return after_impacts(self._worlds, states, around)

        return trace(impact, self._examples[0], self.around)

    def after_impact(self, state: Flat, around: Flat) -> tuple[float, ...]:
        """Vehicle state right after the impulse of a grasp or of a joint that gets
        stuck.
        """
        return self._impact.flat((*state, *around))

    def specific_force(
        self, state: Flat, command: Flat, around: Flat
    ) -> tuple[float, ...]:
        """Proper acceleration of each base origin, base axes, m/s^2: three numbers a
        vehicle.
        """
        return self._accelerometer.flat((*state, *command, *around))

    def angular_acceleration(
        self, state: Flat, command: Flat, around: Flat
    ) -> tuple[float, ...]:
        """Angular acceleration of each base, base axes, rad/s^2: three numbers a
        vehicle.
        """
        return self._turning.flat((*state, *command, *around))
