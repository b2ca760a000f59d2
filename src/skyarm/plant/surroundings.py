"""Inputs of a plant over one control period: wind, forces, contacts, faults and joint
drives of all vehicles.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import reduce
from itertools import repeat
from typing import Any

from skyarm.algebra import ZERO3, Scalar, Vec3
from skyarm.algebra.scalars import logical_and, maximum, minimum
from skyarm.dynamics.actuators.drive import TORQUE_DRIVE, Drive
from skyarm.dynamics.actuators.tilting import turn_rotors
from skyarm.dynamics.point_motion import PointMotion
from skyarm.dynamics.state import State
from skyarm.plant.interface import Truth
from skyarm.records.files import must_be_one_of, shown
from skyarm.records.immutable import immutable, positional
from skyarm.records.leaves import Tree, leaves, rebuild
from skyarm.records.members import SOLE
from skyarm.vehicle import Rotor
from skyarm.world import Component, Effectiveness, Wrench

AnyComponent = Component[Any]
"""Environment model with an internal state of any type."""

Memories = tuple[Tree, ...]
"""Internal states of environment models or of joint drives, in order, each of its
model's type."""


@immutable
class Surroundings:
    """Environment models, actuator faults and joint drives of one vehicle, with their
    states, in one control period.

    Attributes:
        components: air and forces, in the order in which they add up. memories:
            internal states of the components.
        time: beginning of the period, s.
        effectiveness: share of the actuators that faults leave; None for whole ones.
        drives: drives of the joints, in order; empty where all take torques.
        drive_memories: internal states of the drives.
    """

    components: tuple[AnyComponent, ...] = ()
    memories: Memories = ()
    time: Scalar = 0.0
    effectiveness: Effectiveness | None = None
    drives: tuple[Drive, ...] = ()
    drive_memories: Memories = ()

    @property
    def models(self) -> Iterator[tuple[AnyComponent, Tree]]:
        """Environment models, each with its internal state."""
        return zip(self.components, self.memories, strict=True)

    def air_velocity(self, position_W: Vec3) -> Vec3:
        """Air velocity (m/s, world axes) at a position: sum of all wind models."""
        total = ZERO3
        for component, memory in self.models:
            total = total + component.velocity(memory, self.time, position_W)
        return total

    def wrenches(self, motion: PointMotion) -> list[Wrench]:
        """Forces and torques of all environment models on the vehicle's bodies.

        Raises:
            ValueError: one line: a model gives a wrench on a vehicle that does not
                exist.
        """
        wrenches: list[Wrench] = []
        for component, memory in self.models:
            given = component.wrenches(
                memory, self.time, motion, motion.state.rotor_speeds
            )
            # a vehicle without a name stands alone in a check, to which others are
            # unknown
            for agent in (
                {each.agent for each in given} - {"", *motion.agents}
                if motion.name
                else ()
            ):
                allowed = must_be_one_of(motion.agents, agent)
                raise ValueError(
                    f"{type(component).__name__}.wrenches: agent = {shown(agent)}:"
                    f" {allowed}"
                )
            wrenches += given
        return [each for each in wrenches if each.agent in ("", motion.name)]

    def rotor_commands(
        self, rotors: Sequence[Rotor], commands: Sequence[Scalar]
    ) -> Sequence[Scalar]:
        """Rotor speed commands (rad/s) limited by the battery."""
        for component, memory in self.models:
            commands = component.rotor_commands(memory, rotors, commands)
        return commands

    def effort(
        self, index: int, setpoint: Scalar, position: Scalar, rate: Scalar
    ) -> Scalar:
        """Effort (N m or N) of a joint's drive before its limit and joint friction."""
        if not self.drives:
            # a vehicle whose joints all take torques states no drives
            return TORQUE_DRIVE.effort((), setpoint, position, rate)
        return self.drives[index].effort(
            self.drive_memories[index], setpoint, position, rate
        )


@positional
class Together:
    """Surroundings of all vehicles in one control period: those of each, and the
    environment models that all share.

    Attributes:
        each: surroundings of each vehicle, of the models that it has for itself. names:
            names of the vehicles.
        components: shared models. memories: internal states of these.
    """

    each: tuple[Surroundings, ...]
    names: tuple[str, ...] = (SOLE,)
    components: tuple[AnyComponent, ...] = ()
    memories: Memories = ()

    def of(self, index: int) -> Surroundings:
        """Surroundings of one vehicle: its own environment models, then those that all
        share.
        """
        own = self.each[index]
        if not self.components:
            return own
        components = (*own.components, *self.components)
        memories = (*own.memories, *self.memories)
        return replace(own, components=components, memories=memories)

    def motions(
        self,
        worlds: Sequence[Truth],
        states: Sequence[State],
        step: Scalar | None = None,
    ) -> tuple[PointMotion, ...]:
        """Motion of each vehicle, with those of the others; ``step`` (s) as of
        :class:`PointMotion`.
        """
        air = [self.of(i).air_velocity for i in range(len(self.each))]
        motions = motions_of(worlds, states, self.names, air, step)
        for motion, own in zip(motions, self.each, strict=True):
            if own.effectiveness is not None:
                motion.rotor_shares = own.effectiveness.rotors
        return motions

    @property
    def components_of_all(self) -> tuple[AnyComponent, ...]:
        """All environment models: those of each vehicle, then the shared ones."""
        return (
            *(component for own in self.each for component in own.components),
            *self.components,
        )

    @property
    def drives_of_all(self) -> tuple[Drive, ...]:
        """Joint drives of all vehicles."""
        return tuple(drive for own in self.each for drive in own.drives)

    @property
    def _every(self) -> tuple[tuple[int, AnyComponent, Tree], ...]:
        """Vehicle, model and internal state of all environment models; the vehicle of
        shared ones is the first.
        """
        lists = [(i, own.components, own.memories) for i, own in enumerate(self.each)]
        # a shared model finds every vehicle in motion.agents: any motion will do
        lists.append((0, self.components, self.memories))
        return tuple(
            (i, *pair)
            for i, some, states in lists
            for pair in zip(some, states, strict=True)
        )

    @property
    def coupled(self) -> tuple[tuple[int, AnyComponent, Tree], ...]:
        """Vehicle, model and internal state of the models that are integrated with the
        vehicles, such as contacts.
        """
        return tuple(each for each in self._every if each[1].coupled)

    def coupled_memories(self) -> Memories:
        """Internal states of the coupled models."""
        return tuple(memory for _, _, memory in self.coupled)

    def with_coupled(self, memories: Sequence[Tree]) -> Together:
        """Copy of the surroundings with other internal states of the coupled models."""
        if not self.coupled:
            return self
        given = iter(memories)

        def fill_in(components: Sequence[AnyComponent], before: Memories) -> Memories:
            return tuple(
                next(given) if c.coupled else m
                for c, m in zip(components, before, strict=True)
            )

        each = tuple(
            replace(own, memories=fill_in(own.components, own.memories))
            for own in self.each
        )
        return replace(
            self, each=each, memories=fill_in(self.components, self.memories)
        )

    def with_drives(self, drives: Sequence[Memories]) -> Together:
        """Copy of the surroundings with other internal states of each vehicle's joint
        drives.
        """
        rows = zip(self.each, drives, strict=True)
        return replace(
            self,
            each=tuple(
                replace(own, drive_memories=some) if some else own for own, some in rows
            ),
        )

    def without_coupled(self) -> Together:
        """Copy of the surroundings without the coupled models."""

        def rest(
            components: Sequence[AnyComponent], memories: Memories
        ) -> tuple[tuple[AnyComponent, ...], Memories]:
            pairs = [
                pair
                for pair in zip(components, memories, strict=True)
                if not pair[0].coupled
            ]
            return tuple(c for c, _ in pairs), tuple(m for _, m in pairs)

        left = [rest(own.components, own.memories) for own in self.each]
        each = tuple(
            replace(own, components=some, memories=states)
            for own, (some, states) in zip(self.each, left, strict=True)
        )
        components, memories = rest(self.components, self.memories)
        return replace(self, each=each, components=components, memories=memories)

    def slopes(self, motions: Sequence[PointMotion]) -> Memories:
        """Time derivatives of the coupled models' internal states."""
        time = self.each[0].time
        return tuple(
            c.slope(m, time, motions[i], motions[i].state.rotor_speeds)
            for i, c, m in self.coupled
        )

    def far(self, motions: Sequence[PointMotion], seconds: Scalar) -> Scalar:
        """True if no contact can occur within ``seconds``."""
        return _all(
            [c.far(memory, motions[i], seconds) for i, c, memory in self.coupled]
        )

    def calm(self, motions: Sequence[PointMotion], seconds: Scalar) -> Scalar:
        """True if no contact can occur within ``seconds``, but grasps may act."""
        return _all(
            [c.calm(memory, motions[i], seconds) for i, c, memory in self.coupled]
        )

    def largest_calm_step(self, *, verlet: bool) -> Scalar | None:
        """Longest stable integration step (s) of grasps alone; None if a coupled model
        states none.
        """
        steps = [
            c.largest_calm_verlet_step if verlet else c.largest_calm_step
            for _, c, _ in self.coupled
        ]
        stated = [step for step in steps if step is not None]
        # a model without a calm step is never calm, so nothing may be longer
        return reduce(minimum, stated) if stated and len(stated) == len(steps) else None

    def hurry(
        self, motions: Sequence[PointMotion], seconds: Scalar
    ) -> tuple[Memories, Scalar]:
        """Internal states of the coupled models, and number of integration substeps for
        the next ``seconds``.
        """
        pairs = [
            component.hurry(memory, motions[i], seconds)
            for i, component, memory in self.coupled
        ]
        finer: Scalar = 1.0
        for _, steps in pairs:
            finer = maximum(finer, steps)
        return tuple(memory for memory, _ in pairs), finer

    def near(self, memories: Memories) -> Together:
        """Copy of the surroundings with the coupled models' internal states before a
        step in which they may act.
        """
        there = self.with_coupled(memories)
        return self.with_coupled([c.near(memory) for _, c, memory in there.coupled])

    def alone(self, seconds: Scalar, rounds: int, gravity: Scalar) -> Memories:
        """Internal states of the coupled models after ``seconds`` without contact."""
        return tuple(
            component.alone(memory, seconds, rounds, gravity)
            for _, component, memory in self.coupled
        )

    def bend(self, slopes: Memories, dt: Scalar) -> Together:
        """Copy of the surroundings with the contact friction bristles advanced by
        ``dt`` (s).
        """
        going = zip(self.coupled, slopes, strict=True)
        return self.with_coupled(
            [
                component.before_euler_step(m, rate, dt)
                for (_, component, m), rate in going
            ]
        )

    def after_euler_step(self, slopes: Memories, dt: Scalar) -> Memories:
        """Internal states of the coupled models after a semi-implicit Euler step of
        ``dt`` (s).
        """
        going = zip(self.coupled, slopes, strict=True)
        return tuple(
            component.euler_step(memory, slope, dt)
            for (_, component, memory), slope in going
        )

    def drift(self, dt: Scalar) -> Together:
        """Copy of the surroundings with movable bodies advanced by ``dt`` (s) at
        constant velocities.
        """
        return self.with_coupled(
            [component.drift(memory, dt) for _, component, memory in self.coupled]
        )

    def push(
        self, felt: Together, motions: Sequence[PointMotion], dt: Scalar
    ) -> Together:
        """Copy of the surroundings with movable bodies accelerated for ``dt`` (s) by
        forces at other states.
        """
        time = self.each[0].time
        going = zip(self.coupled, felt.coupled_memories(), strict=True)
        return self.with_coupled(
            [
                component.push(
                    memory, time, motions[i], motions[i].state.rotor_speeds, dt, now
                )
                for (i, component, memory), now in going
            ]
        )


def _all(flags: Sequence[Scalar]) -> Scalar:
    """True if all flags are, also if there are none."""
    return reduce(logical_and, flags) if flags else True


def motions_of(
    worlds: Sequence[Truth],
    states: Sequence[State],
    names: Sequence[str],
    air: Sequence[Callable[[Vec3], Vec3] | None] = (),
    step: Scalar | None = None,
) -> tuple[PointMotion, ...]:
    """Motion of each vehicle with its rotors turned to their angles, with those of the
    others by name.

    Args:
        worlds: true vehicles and gravity.
        states: states of these.
        names: names of these.
        air: velocity of the air of each, as of :class:`PointMotion`; calm if left out.
        step: step (s) as of :class:`PointMotion`.
    """
    motions = tuple(
        PointMotion(
            turn_rotors(world.vehicle, state.tilts),
            state,
            wind,
            gravity=world.gravity,
            step=step,
            name=name,
        )
        for world, state, name, wind in zip(
            worlds, states, names, air or (None,) * len(names), strict=True
        )
    )
    agents = {each.name: each for each in motions}
    for each in motions:
        each.agents = agents
    return motions


def several(
    world: Truth | Sequence[Truth], around: Surroundings | Together
) -> tuple[tuple[Truth, ...], Together]:
    """True vehicles and their surroundings, of one vehicle or of several, as tuples of
    all.
    """
    worlds = (world,) if isinstance(world, Truth) else tuple(world)
    return worlds, around if isinstance(around, Together) else Together((around,))


def coupled_places(around: Together) -> tuple[int, ...]:
    """Indices of the coupled models' internal states among all numbers of the
    surroundings.
    """
    memories = around.coupled_memories()
    # these numbers alone differ between surroundings with zeros and with ones there
    both = (
        leaves(around.with_coupled(rebuild(memories, repeat(number))))
        for number in (0.0, 1.0)
    )
    return tuple(
        i for i, (zero, one) in enumerate(zip(*both, strict=True)) if zero is not one
    )
