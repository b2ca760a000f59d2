"""Computation stages of a control period, each a pure function of dataclasses over any scalar type.

Every engine flies these and no others: Python floats and MuJoCo's plant stage by stage, machine code and JAX as one
traced program (:func:`skyarm.simulate.period.make_period`).
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence
from typing import cast

from skyarm.algebra import ZERO3, Vec3
from skyarm.algebra.scalars import Scalar, absolute, data, logical_and, maximum, mul, same, where
from skyarm.control.controller import learns_load
from skyarm.control.law_checks import checked_law
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.actuators.tilting import with_rest
from skyarm.dynamics.point_motion import PointMotion
from skyarm.plant.loads import rigid_loads, wind_at
from skyarm.plant.surroundings import Memories, Surroundings
from skyarm.records.immutable import immutable
from skyarm.records.leaves import Tree, blend, is_leaf, leaves, parts, rebuild
from skyarm.reference import Reference
from skyarm.reference.preview import samples
from skyarm.scenario.scenario_checks import tip_sensor
from skyarm.scenario.scenario_record import Scenario
from skyarm.sensing.estimate.estimator import FULL_STATE
from skyarm.sensing.measurement import Measurement
from skyarm.sensing.sensor import NO_PUSH, Push
from skyarm.sensing.sensor_kinds import ForceReading, SwitchReading
from skyarm.simulate.check_endings import healthy
from skyarm.simulate.command_delay import (
    command_delay,
    command_in_force,
    joined_parts,
    mean_efforts,
    rotor_and_joint_delays,
)
from skyarm.simulate.draws import Draws, draw_plan
from skyarm.simulate.loop_state import InputRow, LoopState, SensorState
from skyarm.simulate.reference_clock import Waits, due
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Frame, Vehicle
from skyarm.world import Component, WindSample, effectiveness_at


@immutable
class Readings:
    """Sensor and estimator results of a control period: internal states, logged readings, law's measurement."""

    sensors: tuple[SensorState, ...]
    estimate: Tree
    readings: tuple[tuple[str, Tree], ...]
    measurement: Measurement


class Stages:
    """Computation stages of one control period of a scenario, whose parameter values may be traced.

    Args:
        scenario: scenario with concrete structure: rates, integrator, delays but for a varied one of the commands.
        command: command from outside, in place of the law's; None for the law's own.
        given: 1 where that command takes the law's place, 0 where the law decides, 2 where the command's rotor speeds
            alone take the place of the law's; None for always 1.
    """

    def __init__(self, scenario: Scenario, command: Command | None = None, given: Scalar | None = None) -> None:
        self.scenario, self._command, self._given = scenario, command, given
        self.period = 1.0 / scenario.rates.control
        self.components = scenario.components
        self.sensors = scenario.agent.all_sensors
        self.eventful = tuple(i for i, each in enumerate(self.components) if type(each).act is not Component.act)
        self.waits = Waits(scenario)
        self.draws: Draws = draw_plan(scenario)
        self._law = checked_law(scenario.agent.controller)
        model = scenario.agent.controller.par.model
        self._awaits_load = learns_load(scenario.agent.controller.par) and scenario.agent.reference.load is None
        self._estimator = scenario.agent.estimator.believing(model.vehicle, model.gravity)
        self.whole, self.late = command_delay(scenario)
        self.apart = rotor_and_joint_delays(scenario) if scenario.agent.delays.apart else None
        self.tip_sensor = tip_sensor(self.sensors, scenario.agent.plant.vehicle)
        # a perfect full state is the truth, which the log has; without an estimator it is the law's measurement
        noisy = [sigma for sigma in leaves(scenario.agent.noise) if type(sigma) is not float or sigma > 0.0]
        full = [FULL_STATE] if scenario.agent.has_estimator and noisy else []
        self.logged = (*full, *(each.name for each in scenario.agent.sensors))
        # named sensors are measured each so many control periods
        self._every = tuple(round(scenario.rates.control / s.frequency) if s.frequency else 1 for _, s in self.sensors)

    def alive(self, now: LoopState, reference: Reference) -> Scalar:
        """1.0 while the flight meets no termination condition, else 0.0."""
        fine = logical_and(now.alive > 0.5, healthy(self.scenario, now.agent.state, reference.position))
        sound = self.waits.is_sound(now.agent.clock)
        return where(fine if sound is True else logical_and(fine, sound), 1.0, 0.0)

    def surround(
        self,
        memories: Memories,
        drives: Memories,
        state: State,
        time: Scalar,
        uniforms: tuple[Scalar, ...],
        path_time: Scalar | tuple[()] = (),
    ) -> tuple[Memories, Surroundings]:
        """Advance wind, force, payload and contact models; return their states and the plant's inputs."""
        going = [
            component.advance(memory, time, self.period, state, draws)
            for component, memory, draws in zip(self.components, memories, self.draws.shares(uniforms)[1], strict=True)
        ]
        if self.eventful:
            motion = PointMotion(self.scenario.agent.plant.vehicle, state, gravity=self.scenario.agent.plant.gravity)
            # of a reference that waits, its own time
            waiting = time if isinstance(path_time, tuple) or not self.waits.guards else path_time
            for i in self.eventful:
                component = self.components[i]
                loads = getattr(component, "name", None) in self.waits.loads
                t = waiting if component.coupled or loads else time
                going[i] = component.act(going[i], t, self.period, motion)
        return tuple(going), self.surroundings(tuple(going), drives, time)

    def wind(self, around: Surroundings, state: State) -> WindSample:
        """Wind force on the base, air velocity, and logged numbers of the environment models."""
        return wind_at(around, self.scenario.agent.plant, state)

    def pushes(self, around: Surroundings, state: State) -> tuple[Push, ...]:
        """External wrench at each force sensor, in the order of the sensors; () without force sensors."""
        frames = [sensor.feels for _, sensor in self.sensors if sensor.feels is not None]
        if not frames:
            return ()
        vehicle, gravity = self.scenario.agent.plant.vehicle, self.scenario.agent.plant.gravity
        return tuple(push_at(vehicle.frame(frame or None), around, vehicle, state, gravity) for frame in frames)

    def surroundings(self, memories: Memories, drives: Memories, time: Scalar) -> Surroundings:
        """Inputs of the plant in one control period: wind, force and contact models, actuator faults, joint drives."""
        scenario = self.scenario
        return Surroundings(
            components=self.components,
            memories=memories,
            time=time,
            effectiveness=effectiveness_at(scenario.agent.faults, scenario.agent.plant.vehicle, time),
            drives=scenario.agent.all_drives,
            drive_memories=drives,
        )

    def acting(self, queue: Sequence[Command]) -> Command:
        """Delayed command from a queue of past commands; rotors and joints may have different delays."""
        if self.apart is None:
            return command_in_force(queue, self.whole)
        (rotors, _), (joints, _) = self.apart
        return joined_parts(command_in_force(queue, rotors), command_in_force(queue, joints))

    def law_reference(self, row: InputRow[Reference]) -> Reference:
        """Reference that the law receives: time-scaled where planned; the initial pose until tracking starts."""
        return joined_reference(self.scenario, row.told or row.reference, row.time)

    def sense(
        self, sensors: Sequence[SensorState], estimate: Tree, ticks: Scalar, state: State, force: Vec3, acting: Command,
        time: Scalar, uniforms: tuple[Scalar, ...], pushes: Sequence[Push] = (),
    ) -> Readings:  # fmt: skip
        """Evaluate sensors and estimator; return their states, the delayed readings and the law's measurement.

        The reading of a force sensor on the tip's link is added to the law's measurement.
        """
        going, arrived, (draws, _) = [], dict[str, Tree](), self.draws.shares(uniforms)
        feeling = [i for i, (_, sensor) in enumerate(self.sensors) if sensor.feels is not None]
        felt = dict(zip(feeling, pushes, strict=True))
        for i, ((name, sensor), now) in enumerate(zip(self.sensors, sensors, strict=True)):
            every = self._every[i]
            push = felt.get(i, NO_PUSH)
            memory, reading = sensor.take(now.memory, time, state, force, push, draws[i], every * self.period)
            last: Tree = ()
            if every > 1:
                now_due = due(ticks, every)
                memory, reading = blend(now_due, memory, now.memory), blend(now_due, reading, now.held)
                last = reading
            # until the first reading has arrived the estimator sees that one
            seen = (*(blend(ticks < 0.5, reading, old) for old in now.waiting), reading)
            going.append(SensorState(memory=memory, held=last, waiting=seen[1:]))
            arrived[name] = seen[0]
        memory, measurement = self._estimator.step(estimate, arrived, acting, self.period)
        if self.tip_sensor is not None:
            name, turned = self.tip_sensor
            pushed = cast("ForceReading", arrived[name])  # as says what the sensor senses
            measurement = dataclasses.replace(measurement, tip_force=tuple(turned.apply(pushed.force)))
        if self.waits.switches:
            # as says what these sensors sense
            switches = tuple(cast("SwitchReading", arrived[name]).closed for name in self.waits.switches)
            measurement = dataclasses.replace(measurement, switches=switches)
        logged = tuple((name, reading) for name, reading in arrived.items() if name in self.logged)
        return Readings(sensors=tuple(going), estimate=memory, readings=logged, measurement=measurement)

    def with_grasp(self, read: Readings, memories: Memories) -> Readings:
        """Sensor readings with the grasp signal of the grippers at the tip, for a law that estimates its load."""
        if not self._awaits_load:
            return read
        tip, each_memory = self.scenario.agent.plant.vehicle.end_effector, zip(self.components, memories, strict=True)
        reports = [report for each, memory in each_memory for report in each.holds(memory, tip)]
        holds = (functools.reduce(maximum, reports),) if reports else ()
        return dataclasses.replace(read, measurement=dataclasses.replace(read.measurement, holds=holds))

    def decide(
        self, memory: Tree, measurement: Measurement, reference: Reference, path_time: Scalar | tuple[()] = ()
    ) -> tuple[Tree, Command]:
        """Evaluate the law, or take the user's command in its place, which leaves the law's state unchanged."""
        if self._command is not None and self._given is None:
            return memory, with_rest(self.scenario.agent.plant.vehicle, self._command)
        following, command = self.apply_law(memory, measurement, reference, path_time)
        if self._command is None or self._given is None:
            return following, command
        own, joints_own = self._given < 0.5, absolute(self._given - 1.0) > 0.5
        speeds = blend(own, command.rotor_speeds, self._command.rotor_speeds)
        rest = blend(joints_own, command, self._command)
        return blend(joints_own, following, memory), dataclasses.replace(rest, rotor_speeds=speeds)

    def apply_law(
        self, memory: Tree, measurement: Measurement, reference: Reference, path_time: Scalar | tuple[()]
    ) -> tuple[Tree, Command]:
        """Evaluate the control law; return its next internal state and the command."""
        par = self.waits.with_task_loads(self.scenario.agent.controller.par, path_time)
        following, command = self._law(memory, measurement, reference, self.period, par=par)
        return following, with_rest(self.scenario.agent.plant.vehicle, command)

    def send(
        self, alive: Scalar, queue: Sequence[Command], command: Command
    ) -> tuple[Scalar, tuple[Command, ...], Command]:
        """Put a command into the delay queue; return 1.0 if finite, the queue, and the command that now acts."""
        going = alive > 0.5
        for value in (*command.rotor_speeds, *command.efforts, *command.tilts):
            going = logical_and(going, absolute(value) < float("inf"))
        moved = (*queue[1:], command)
        return where(going, 1.0, 0.0), moved, self.acting(moved)

    def drive(self, drives: Memories, before: Command, acting: Command, state: State) -> Memories:
        """Advance the joint drives by a control period, under the mean of the setpoints that act in it."""
        if not drives:
            return ()
        heard = mean_efforts(before, acting, self.late if self.apart is None else self.apart[1][1], self.period)
        rows = zip(self.scenario.agent.all_drives, drives, heard, state.joints, state.joint_rates, strict=True)
        return tuple(drive.advance(memory, u, q, qd, self.period) for drive, memory, u, q, qd in rows)

    def with_drives(self, around: Surroundings, drives: Memories) -> Surroundings:
        """Plant inputs of a control period with new states of the joint drives."""
        return dataclasses.replace(around, drive_memories=drives) if drives else around

    def advance_coupled(self, memories: Memories, coupled: Memories) -> Memories:
        """States of all wind, force and contact models; contact states are those that the plant integrated."""
        results = iter(coupled)
        return tuple(
            next(results) if each.coupled else memory for each, memory in zip(self.components, memories, strict=True)
        )


POSES = ("position", "yaw", "joints", "tip")
"""Fields of a reference that a reference at rest keeps; its derivatives are zero."""

ASKED = (0, 5)
"""Indices of force and grip in the push of a reference."""


def joined_reference(scenario: Scenario, going: Reference, time: Scalar) -> Reference:
    """Reference for the law: the initial pose at rest until tracking starts, then the planned reference.

    Costs nothing where the law follows from the first instant. Structural numbers stay: they do not move.
    """
    if same(scenario.agent.tracking_start, 0):
        return going
    still, resting = scenario.agent.reference.at(0.0), time < scenario.agent.tracking_start
    resting_samples = tuple(n for value, _, _ in samples(still) for n in (value, 0.0, 0.0))
    values: list[Scalar] = []
    for name, moving in parts(going).items():
        rest, several = getattr(still, name), isinstance(moving, (Vec3, tuple))
        numbers = tuple(moving) if several else (moving,)
        if name in POSES:
            pose = tuple(rest) if several else (rest,)
        elif name == "ahead":
            pose = resting_samples * (len(numbers) // len(resting_samples))
        elif name == "push" and numbers:  # nothing is touched yet, and what is believed of it
            pose = tuple(0.0 if i in ASKED else value for i, value in enumerate(rest))
        else:
            pose = (0.0,) * len(numbers)
        values += [where(resting, a, b) for a, b in zip(pose, numbers, strict=True) if is_leaf(b)]
    return rebuild(going, iter(values))


def push_at(frame: Frame, around: Surroundings, vehicle: Vehicle, state: State, gravity: Scalar) -> Push:
    """External wrench at a sensor's frame, in the sensor's axes, by all loads on the sensor's link and links beyond.

    Of loads it is the weight: what it takes to accelerate them is not there. All components are data, also where
    nothing can push, because sensors keep them in their memories.

    Args:
        frame: frame of the vehicle.
        around: surroundings of the period.
        vehicle: vehicle of the plant.
        state: state of the plant.
        gravity: m/s^2.
    """
    motion, carried = PointMotion(vehicle, state, around.air_velocity), beyond(vehicle, frame.link)
    force, torque = ZERO3, ZERO3
    at = motion.position(frame.position, frame.link)
    for wrench in around.wrenches(motion, state.rotor_speeds):
        if wrench.body in carried:
            force = force + wrench.force_W
            torque = torque + wrench.torque_W + (motion.position(wrench.point, wrench.body) - at).cross(wrench.force_W)
    for payload, memory in rigid_loads(around):
        link, load = payload.body(vehicle, memory.held)
        if link in carried:
            weight = Vec3(0, 0, mul(-gravity, load.mass))
            force = force + weight
            torque = torque + (motion.position(load.com, link) - at).cross(weight)
    axes = [motion.to_world(axis, frame.link) for axis in (frame.rotation.column(k) for k in range(3))]
    return Push(
        force=Vec3(*(data(axis.dot(force)) for axis in axes)),
        torque=Vec3(*(data(axis.dot(torque)) for axis in axes)),
    )


def beyond(vehicle: Vehicle, link: int) -> set[int]:
    """Indices of a link and of all links that it carries; for the base, of all links."""
    links = {link}
    if link == BASE:
        return {BASE, *range(len(vehicle.moving))}
    for i, each in enumerate(vehicle.moving):
        if each.parent in links:
            links.add(i)
    return links
