"""Computation stages of a control period, each a pure function of dataclasses over any
scalar type.

Every engine flies these and no others: Python floats and MuJoCo's plant stage by stage,
machine code and JAX as one traced program (:func:`skyarm.simulate.period.make_period`).
"""

from __future__ import annotations

import functools
from collections.abc import Collection, Sequence
from dataclasses import replace
from itertools import zip_longest
from typing import TYPE_CHECKING, cast

from skyarm import dynamics
from skyarm.algebra import ZERO3, Motion, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import absolute, data, logical_and, maximum, same, where
from skyarm.compile.tracing.lower import compiled_once
from skyarm.control.controller import learns_load, part_of
from skyarm.control.law_checks import bound_by, checked_law
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.actuators.load_limits import largest_load
from skyarm.dynamics.actuators.rotor import least_raised
from skyarm.dynamics.actuators.tilting import with_rest
from skyarm.dynamics.point_motion import PointMotion
from skyarm.plant.loads import rigid_loads
from skyarm.plant.rigid_body import accelerate_one
from skyarm.plant.surroundings import Memories, Surroundings, Together, motions_of
from skyarm.records.immutable import immutable
from skyarm.records.leaves import (
    Tree,
    blend,
    is_leaf,
    is_record,
    leaves,
    parts,
    rebuild,
)
from skyarm.reference import Reference
from skyarm.reference.preview import samples
from skyarm.scenario.scenario_checks import tip_sensor
from skyarm.scenario.scenario_record import Scenario
from skyarm.sensing.estimate.estimator import FULL_STATE
from skyarm.sensing.measurement import Measurement
from skyarm.sensing.sensor import NO_PUSH, Push, specific_force_at
from skyarm.sensing.sensor_kinds import ForceReading, SwitchReading
from skyarm.simulate.check_endings import both_hold, healthy
from skyarm.simulate.command_delay import (
    command_delay,
    command_in_force,
    drives_after,
    joined_parts,
    rotor_and_joint_delays,
)
from skyarm.simulate.draws import draw_plan
from skyarm.simulate.loop_state import (
    AgentLoop,
    GivenRows,
    InputRow,
    LoopState,
    SensorState,
)
from skyarm.simulate.pictures import images_of
from skyarm.simulate.reference_clock import Waits, due
from skyarm.vehicle import BASE, Body, Frame, Vehicle
from skyarm.world import Component, Wrench, effectiveness_at

if TYPE_CHECKING:
    from skyarm.world.contact import Contact, ContactMemory
    from skyarm.world.team import Borne, TeamMemory

Given = tuple[Tree, Measurement, Reference, Command | None, Scalar | None]
"""Inputs of a decision: state of the law, measurement, reference; command from outside
and what it replaces."""


@immutable
class Readings:
    """Sensor and estimator results of a control period: internal states, logged
    readings, law's measurement.
    """

    sensors: tuple[SensorState, ...]
    estimate: Tree
    readings: tuple[tuple[str, Tree], ...]
    measurement: Measurement


class Stages:
    """Computation stages of one control period of a scenario, whose parameter values
    may be traced.

    Args:
        scenario: scenario with concrete structure: rates, integrator, delays but for a
            varied one of the commands.
        commands: command from outside for each vehicle, in place of its law's; empty
            for the laws' own.
        given: for each vehicle 1 where that command takes the law's place, 0 where the
            law decides, 2 where the command's rotor speeds alone take the place of the
            law's; empty for always 1.

    Attributes:
        agents: stages of each vehicle. own: environment models that each has for
            itself. shared: those of all.
    """

    def __init__(
        self,
        scenario: Scenario,
        commands: Sequence[Command] = (),
        given: Sequence[Scalar] = (),
    ) -> None:
        self.scenario = scenario
        self.period = scenario.rates.period
        self.worlds = tuple(each.plant for each in scenario.agents.values())
        self.own = tuple(map(scenario.own_components, scenario.agents.values()))
        self.shared = scenario.shared_components
        self.draws = draw_plan(scenario)
        # the motion of all vehicles costs operations: it is computed for models with
        # events alone
        self._eventful = any(
            map(_acts, (*self.shared, *(each for some in self.own for each in some)))
        )
        rows = zip_longest(scenario.agents, commands, given)
        self.agents = tuple(
            self._stages_of(name, command, mode) for name, command, mode in rows
        )

    def _stages_of(
        self, name: str, command: Command | None, given: Scalar | None
    ) -> AgentStages:
        """Stages of one vehicle, by its name."""
        return AgentStages(self.scenario.of(name), command, given)

    @property
    def agent(self) -> AgentStages:
        """Stages of the only vehicle."""
        (only,) = self.agents
        return only

    def lead(self, now: LoopState, given: GivenRows) -> tuple[InputRow[Reference], ...]:
        """Inputs of all vehicles in a control period, with references that wait
        evaluated at their clocks' times.
        """
        rows = zip(self.agents, now.agents, given, strict=True)
        return tuple(
            each.waits.lead(own.clock, now.ticks, row) for each, own, row in rows
        )

    def alive(self, now: LoopState, rows: Sequence[InputRow[Reference]]) -> Scalar:
        """1.0 while no vehicle meets a termination condition, else 0.0."""
        fine: Scalar = now.alive > 0.5
        for each, loop, row in zip(self.agents, now.agents, rows, strict=True):
            goal = row.reference.position
            fine = logical_and(
                fine, healthy(each.scenario, loop.state, goal, loop.images)
            )
            sound = each.waits.is_sound(loop.clock)
            # without guards the clock is sound for certain: no operation is added
            fine = both_hold(fine, sound)
        return where(fine, 1.0, 0.0)

    def surround(
        self, now: LoopState, rows: Sequence[InputRow[Reference]], uniforms: Scalars
    ) -> tuple[list[Memories], Memories, Together]:
        """Advance wind, force, payload and contact models.

        Returns:
            Internal states of each vehicle's own models and of the shared ones, and the
            plant's inputs.
        """
        draws = self.draws.shares(uniforms)
        time = rows[0].time
        first = now.agents[0].state
        own = list[list[Tree]]()
        for each, models, loop, numbers in zip(
            self.agents, self.own, now.agents, draws.components, strict=True
        ):
            memories = self._advance_models(
                models, loop.components, time, loop.state, numbers
            )
            # a battery is loaded by the command in force, as this period's arrives
            # later in it
            speeds = each.acting(loop.queue).rotor_speeds
            pairs = zip(models, memories, strict=True)
            own.append(
                [
                    model.supply(memory, self.period, loop.state, speeds)
                    for model, memory in pairs
                ]
            )
        # a model that all share stands at no vehicle; it is given the state of the
        # first
        shared = self._advance_models(
            self.shared, now.components, time, first, draws.shared
        )
        if self._eventful:
            motions = motions_of(
                self.worlds,
                [loop.state for loop in now.agents],
                tuple(self.scenario.agents),
            )
            for each, motion, row in zip(self.agents, motions, rows, strict=True):
                motion.task_time = each.waits.task_time(row)
                motion.time = time
                motion.solids = self.scenario.environment.solids
            for each, motion, models, memories in zip(
                self.agents, motions, self.own, own, strict=True
            ):
                self._act(models, memories, time, motion, each.waits.loads)
            self._act(self.shared, shared, time, motions[0], self.agents[0].waits.loads)
            self._direct(shared, now, time, motions[0])
        around = self.together(own, shared, [loop.drives for loop in now.agents], time)
        return [tuple(each) for each in own], tuple(shared), around

    def _advance_models(
        self,
        models: Sequence[Component[Tree]],
        memories: Memories,
        time: Scalar,
        state: State,
        draws: Sequence[Scalars],
    ) -> list[Tree]:
        """Internal states of environment models in the control period that begins."""
        rows = zip(models, memories, draws, strict=True)
        return [
            model.advance(memory, time, self.period, state, numbers)
            for model, memory, numbers in rows
        ]

    def _act(
        self,
        models: Sequence[Component[Tree]],
        memories: list[Tree],
        time: Scalar,
        motion: PointMotion,
        loads: Collection[str],
    ) -> None:
        """Apply the discrete events of environment models, such as a grasp, to their
        internal states.
        """
        for i, model in enumerate(models):
            if _acts(model):
                # of a reference that waits, its own time
                of_task = model.coupled or getattr(model, "name", None) in loads
                memories[i] = model.act(
                    memories[i],
                    motion.task_time if of_task else time,
                    self.period,
                    motion,
                )

    def _direct(
        self, shared: list[Tree], now: LoopState, time: Scalar, motion: PointMotion
    ) -> None:
        """Evaluate the law of a team, by the forces that they estimated one period
        before.
        """
        team = self.scenario.team
        for i, each in enumerate(self.shared):
            if each is team:
                # the contact model is the last of the shared ones
                # (Scenario.placed_shared)
                contact = cast("Contact", self.shared[-1])
                touching = cast("ContactMemory", shared[-1])
                rows = zip(motion.agents, now.agents, strict=True)
                borne = {
                    name: self._borne(name, loop, motion.agents[name], team.steers)
                    for name, loop in rows
                }
                memory = cast("TeamMemory", shared[i])
                shared[i] = team.direct(
                    memory, time, self.period, motion, contact, touching, borne
                )

    def _borne(
        self, name: str, loop: AgentLoop, motion: PointMotion, steers: bool
    ) -> Borne:
        """Load at a tip as the vehicle's law estimates it; limits alone, for logs,
        where the team steers by none.
        """
        found = part_of(loop.memory, "carrying")
        # a law without such an estimate has none of the carried body to hand on
        if is_record(found) and steers:
            return cast("Borne", found)
        from skyarm.world.team import NothingBorne

        model = self.scenario.agents[name].controller.par.model.vehicle
        return NothingBorne(
            limits=largest_load(PointMotion(model, loop.state, gravity=motion.gravity))
        )

    def law_references(
        self, rows: Sequence[InputRow[Reference]], shared: Memories
    ) -> list[Reference]:
        """Reference that each law receives, with the instructions of a team's law."""
        given = [
            each.law_reference(row) for each, row in zip(self.agents, rows, strict=True)
        ]
        team = self.scenario.team
        for model, memory in zip(self.shared, shared, strict=True):
            if model is team:
                instructions = team.instructions(cast("TeamMemory", memory))
                own = zip(self.scenario.agents, given, strict=True)
                given = [
                    (
                        replace(each, carry=instructions[name])
                        if name in instructions
                        else each
                    )
                    for name, each in own
                ]
        return given

    def together(
        self,
        own: Sequence[Sequence[Tree]],
        shared: Sequence[Tree],
        drives: Sequence[Memories],
        time: Scalar,
    ) -> Together:
        """Inputs of the plant in one control period: wind, force and contact models,
        actuator faults, joint drives.
        """
        rows = zip(self.scenario.agents.values(), self.own, own, drives, strict=True)
        each = tuple(
            Surroundings(
                components=models,
                memories=tuple(memories),
                time=time,
                effectiveness=effectiveness_at(agent.faults, agent.vehicle, time),
                drives=agent.all_drives,
                drive_memories=of_drives,
            )
            for agent, models, memories, of_drives in rows
        )
        return Together(each, tuple(self.scenario.agents), self.shared, tuple(shared))

    def surroundings(self, now: LoopState, time: Scalar) -> Together:
        """Inputs of the plant at a state of the loop, whose environment models are
        those of this period already.
        """
        own = [loop.components for loop in now.agents]
        drives = [loop.drives for loop in now.agents]
        return self.together(own, now.components, drives, time)

    def around(
        self, now: LoopState, time: Scalar
    ) -> list[tuple[Surroundings, PointMotion]]:
        """Surroundings and motion of each vehicle, in order, at a state of the loop."""
        around = self.surroundings(now, time)
        return [
            (around.of(i), motion) for i, motion in enumerate(self.motions(now, around))
        ]

    def motions(self, now: LoopState, around: Together) -> tuple[PointMotion, ...]:
        """Motion of each vehicle at a state of the loop, at the time at which the plant
        opens grasps.
        """
        motions = around.motions(self.worlds, [loop.state for loop in now.agents])
        for motion, own in zip(motions, around.each, strict=True):
            motion.task_time = own.time
        return motions


def _acts(component: Component[Tree]) -> bool:
    """True if an environment model has discrete events at control instants, such as a
    grasp.
    """
    return type(component).act is not Component.act


class AgentStages:
    """Computation stages of one control period for one vehicle: sensors, law, delays
    and drives.

    Args:
        scenario: scenario of its flight alone.
        command: command from outside, in place of the law's; None for the law's own.
        given: as of :class:`Stages`; None for always 1.
    """

    def __init__(
        self,
        scenario: Scenario,
        command: Command | None = None,
        given: Scalar | None = None,
    ) -> None:
        self.scenario = scenario
        self._command = command
        self._given = given
        self.period = scenario.rates.period
        own = scenario.agent
        self.sensors = own.all_sensors
        self.waits = Waits(scenario)
        self._law = checked_law(own.controller)
        model = own.model
        self._awaits_load = (
            learns_load(own.controller.par) and own.reference.load is None
        )
        self._estimator = own.placed_estimator.believing(model.vehicle, model.gravity)
        self.whole, self.late = command_delay(scenario)
        self.apart = rotor_and_joint_delays(scenario) if own.delays.apart else None
        self.tip_sensor = tip_sensor(self.sensors, own.vehicle)
        # a perfect full state is the truth, which the log has; without an estimator it
        # is the law's measurement
        noisy = [
            sigma
            for sigma in leaves(own.noise)
            if type(sigma) is not float or sigma > 0.0
        ]
        full = [FULL_STATE] if own.has_estimator and noisy else []
        self.logged = (*full, *(name for name, _ in self.sensors[1:]))
        # named sensors are measured each so many control periods
        self._every = tuple(
            scenario.rates.periods_between(s.frequency) for _, s in self.sensors
        )
        self._models = scenario.components

    @property
    def arrival(self) -> Scalars:
        """Time (s) in the period at which commands take effect, of all actuators or of
        rotors and joints.
        """
        return (
            (self.late,) if self.apart is None else (self.apart[0][1], self.apart[1][1])
        )

    def pushes(
        self, around: Surroundings, motion: PointMotion, acting: Command
    ) -> tuple[Push, ...]:
        """External wrench at each force sensor, in the order of the sensors; () without
        force sensors.
        """
        frames = [
            sensor.feels for _, sensor in self.sensors if sensor.feels is not None
        ]
        # they take a forward dynamics more: only where a force sensor reads them
        loads = (
            load_wrenches(self.scenario.agent.plant.loads, around, motion, acting)
            if frames
            else ()
        )
        return tuple(
            push_at(motion.vehicle.frame(frame or None), around, motion, loads)
            for frame in frames
        )

    def acting(self, queue: Sequence[Command]) -> Command:
        """Delayed command from a queue of past commands; rotors and joints may have
        different delays.
        """
        if self.apart is None:
            return command_in_force(queue, self.whole)
        (rotors, _), (joints, _) = self.apart
        return joined_parts(
            command_in_force(queue, rotors), command_in_force(queue, joints)
        )

    def law_reference(self, row: InputRow[Reference]) -> Reference:
        """Reference that the law receives: time-scaled where planned; the initial pose
        until tracking starts.
        """
        return joined_reference(self.scenario, row.scaled or row.reference, row.time)

    def sense(
        self,
        own: AgentLoop,
        ticks: Scalar,
        base: Motion,
        acting: Command,
        time: Scalar,
        draws: Sequence[Scalars],
        pushes: Sequence[Push] = (),
    ) -> Readings:
        """Evaluate sensors and estimator; return their states, the delayed readings and
        the law's measurement.

        The reading of a force sensor on the tip's link is added to the law's
        measurement.
        """
        going = []
        arrived = dict[str, Tree]()
        state = own.state
        feeling = [
            i for i, (_, sensor) in enumerate(self.sensors) if sensor.feels is not None
        ]
        felt = dict(zip(feeling, pushes, strict=True))
        # in the order of Draws.shares, which deals out the random numbers by position
        for i, ((name, sensor), now) in enumerate(
            zip(self.sensors, own.sensors, strict=True)
        ):
            every = self._every[i]
            push = felt.get(i, NO_PUSH)
            force = specific_force_at(sensor.mounted_at, base, state.rate)
            memory, reading = sensor.take(
                now.memory, time, state, force, push, draws[i], every * self.period
            )
            last: Tree = ()
            if every > 1:
                now_due = due(ticks, every)
                memory = blend(now_due, memory, now.memory)
                reading = blend(now_due, reading, now.held)
                last = reading
            # until the first reading has arrived the estimator sees that one
            seen = (*(blend(ticks < 0.5, reading, old) for old in now.waiting), reading)
            going.append(SensorState(memory=memory, held=last, waiting=seen[1:]))
            arrived[name] = seen[0]
        memory, measurement = self._estimator.step(
            own.estimate, arrived, acting, self.period
        )
        if self.tip_sensor is not None:
            name, turned = self.tip_sensor
            # as says what the sensor senses
            pushed = cast("ForceReading", arrived[name])
            measurement = replace(
                measurement, tip_force=tuple(turned.apply(pushed.force))
            )
        if self.waits.switches:
            # as says what these sensors sense
            switches = tuple(
                cast("SwitchReading", arrived[name]).closed
                for name in self.waits.switches
            )
            measurement = replace(measurement, switches=switches)
        logged = tuple(
            (name, reading) for name, reading in arrived.items() if name in self.logged
        )
        return Readings(
            sensors=tuple(going),
            estimate=memory,
            readings=logged,
            measurement=measurement,
        )

    def with_grasp(self, read: Readings, memories: Memories) -> Readings:
        """Sensor readings with the grasp signal of the grippers at the tip, for a law
        that estimates its load.
        """
        if not self._awaits_load:
            return read
        tip = self.scenario.agent.vehicle.end_effector
        each_memory = zip(self._models, memories, strict=True)
        (name,) = self.scenario.agents
        reports = [
            report
            for each, memory in each_memory
            for report in each.holds(memory, tip, name)
        ]
        # several grippers may stand at one tip: it holds once any of them does
        holds = (functools.reduce(maximum, reports),) if reports else ()
        return replace(read, measurement=replace(read.measurement, holds=holds))

    def with_images(self, measurement: Measurement, own: AgentLoop) -> Measurement:
        """Measurement with the newest pictures that the law sees; the log has none."""
        images = images_of(self.scenario.agent.controller.sees, own.images)
        return replace(measurement, images=images) if images else measurement

    def decide(
        self,
        memory: Tree,
        measurement: Measurement,
        reference: Reference,
        path_time: Scalar | tuple[()] = (),
    ) -> tuple[Tree, Command]:
        """Evaluate the law, or take the user's command in its place, which leaves the
        law's state unchanged.
        """
        controller = self.scenario.agent.controller
        vehicle = self.scenario.agent.vehicle
        # always the user's: the law is not even traced, which shortens the program
        if self._command is not None and self._given is None:
            return memory, with_rest(vehicle, self._command)

        def choose(given: Given) -> tuple[Tree, Command]:
            memory, measurement, reference, outside, mode = given
            following, command = self.apply_law(
                memory, measurement, reference, path_time
            )
            if outside is None or mode is None:
                return following, command
            # modes of Engine.step: 0 the law, 1 a command, 2 rotor speeds beside the
            # law's joints
            own, joints_own = mode < 0.5, absolute(mode - 1.0) > 0.5
            speeds = blend(own, command.rotor_speeds, outside.rotor_speeds)
            rest = blend(joints_own, command, outside)
            return blend(joints_own, following, memory), replace(
                rest, rotor_speeds=speeds
            )

        given = memory, measurement, reference, self._command, self._given
        # what a payload adds at a path time is a traced number, no constant of shared
        # code
        loads_change = (
            self.waits.with_task_loads(controller.par, path_time) is not controller.par
        )
        if not self.scenario.others or not controller.compiled or loads_change:
            return choose(given)
        # laws of equal functions and constants share code, though partial made them
        # anew
        functions, constants = bound_by(controller.law)
        constants = (controller.par, controller.name, vehicle, *constants)
        return compiled_once((functions, self.period), choose, given, constants)

    def apply_law(
        self,
        memory: Tree,
        measurement: Measurement,
        reference: Reference,
        path_time: Scalar | tuple[()],
    ) -> tuple[Tree, Command]:
        """Evaluate the control law; return its next internal state and the command."""
        par = self.waits.with_task_loads(self.scenario.agent.controller.par, path_time)
        following, command = self._law(
            memory, measurement, reference, self.period, par=par
        )
        return following, with_rest(self.scenario.agent.vehicle, command)

    def send(
        self, alive: Scalar, queue: Sequence[Command], command: Command
    ) -> tuple[Scalar, tuple[Command, ...], Command]:
        """Put a command into the delay queue; return 1.0 if finite, the queue, and the
        command that now acts.
        """
        going = alive > 0.5
        # NaN compares false, so that this one comparison refuses it as it does infinity
        for value in leaves(command):
            going = logical_and(going, absolute(value) < float("inf"))
        # the log has what the law computed, motors do what they can
        rotors = self.scenario.agent.vehicle.rotors
        able = replace(command, rotor_speeds=least_raised(rotors, command.rotor_speeds))
        moved = (*queue[1:], able)
        return where(going, 1.0, 0.0), moved, self.acting(moved)

    def drive(
        self, drives: Memories, before: Command, acting: Command, state: State
    ) -> Memories:
        """Advance the joint drives by a control period, under the mean of the setpoints
        that act in it.
        """
        return drives_after(
            self.scenario.agent.all_drives,
            drives,
            before,
            acting,
            # of two delays that of the joints; drives turn no rotors
            self.arrival[-1],
            state,
            self.period,
        )


POSES = ("position", "yaw", "joints", "tip")
"""Fields of a reference that a reference at rest keeps; its derivatives are zero."""

ASKED = (0, 5)
"""Indices of force and grip in the push of a reference."""


def joined_reference(scenario: Scenario, going: Reference, time: Scalar) -> Reference:
    """Reference for the law: the initial pose at rest until tracking starts, then the
    planned reference.

    Costs nothing where the law follows from the first instant. Structural numbers stay:
    they do not move.
    """
    # an int 0 is structure; a float may be another in the next lane
    if same(scenario.agent.tracking_start, 0):
        return going
    still = scenario.agent.law_reference.at(0.0)
    resting = time < scenario.agent.tracking_start
    resting_samples = tuple(
        n for value, _, _ in samples(still) for n in (value, 0.0, 0.0)
    )
    values: list[Scalar] = []
    for name, moving in parts(going).items():
        rest = getattr(still, name)
        several = isinstance(moving, (Vec3, tuple))
        numbers = tuple(moving) if several else (moving,)
        if name in POSES:
            pose = tuple(rest) if several else (rest,)
        elif name == "ahead":
            pose = resting_samples * (len(numbers) // len(resting_samples))
        elif name == "turning":  # quaternion and rotor speeds, then their derivatives
            half = len(rest) // 2
            pose = (*rest[:half], *(0.0,) * half) * (len(numbers) // max(len(rest), 1))
        elif name == "push" and numbers:
            # nothing is touched yet, and what is believed of it
            pose = tuple(0.0 if i in ASKED else value for i, value in enumerate(rest))
        else:
            pose = (0.0,) * len(numbers)
        values += [
            where(resting, a, b)
            for a, b in zip(pose, numbers, strict=True)
            if is_leaf(b)
        ]
    return rebuild(going, values)


def load_wrenches(
    fixed: Sequence[tuple[int, Body]],
    around: Surroundings,
    motion: PointMotion,
    acting: Command,
) -> tuple[Wrench, ...]:
    """Wrench of each rigid load on its link: that of its weight and of its inertia, in
    a motion under a command.

    Loads are those of the flight and the ``fixed`` ones of the plant, by link.
    """
    vehicle = motion.vehicle
    loads = [
        *fixed,
        *(
            payload.body(vehicle, memory.held)
            for payload, memory in rigid_loads(around)
        ),
    ]
    if not loads:
        return ()
    base, joints = accelerate_one(motion, acting, around)
    forces = dynamics.load_forces(vehicle, loads, motion.state, base, joints)
    return tuple(
        Wrench(
            # the load pushes back with the opposite of the force that moves it
            force_W=-motion.to_world(each.force, link),
            torque_W=-motion.to_world(each.torque, link),
            body=link,
        )
        for (link, _), each in zip(loads, forces, strict=True)
    )


def push_at(
    frame: Frame,
    around: Surroundings,
    motion: PointMotion,
    loads: Sequence[Wrench] = (),
) -> Push:
    """External wrench at a sensor's frame, in the sensor's axes, by all loads on the
    sensor's link and links beyond.

    All components are data, also where nothing can push, because sensors keep them in
    their memories.

    Args:
        frame: frame of the vehicle.
        around: surroundings of the period.
        motion: motion of the vehicle.
        loads: wrenches of the rigid loads.
    """
    carried = beyond(motion.vehicle, frame.link)
    force, torque = ZERO3, ZERO3
    at = motion.position(frame.position, frame.link)
    for wrench in (*around.wrenches(motion), *loads):
        if wrench.body in carried:
            force = force + wrench.force_W
            torque = (
                torque
                + wrench.torque_W
                + (motion.position(wrench.point, wrench.body) - at).cross(
                    wrench.force_W
                )
            )
    axes = [
        motion.to_world(axis, frame.link)
        for axis in map(frame.rotation.column, range(3))
    ]
    return Push(
        force=Vec3(*(data(axis.dot(force)) for axis in axes)),
        torque=Vec3(*(data(axis.dot(torque)) for axis in axes)),
    )


def beyond(vehicle: Vehicle, link: int) -> set[int]:
    """Indices of a link and of all links that it carries; for the base, of all
    links.
    """
    # parents come before their children, so that one pass finds them all
    links = {link}
    if link == BASE:
        return {BASE, *range(len(vehicle.moving))}
    for i, each in enumerate(vehicle.moving):
        if each.parent in links:
            links.add(i)
    return links
