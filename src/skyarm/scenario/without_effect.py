"""Warnings about parts of a scenario without effect on its flight: air, forces and
unread sensors.

They are found by evaluation along the reference, so that a registered part is judged as
a shipped one.
"""

from __future__ import annotations

from collections import UserDict
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from skyarm.algebra import ZERO3, Quaternion, Scalar, Vec3
from skyarm.control.controller import autopilot_of, senses_force
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.actuators.tilting import turn_rotors
from skyarm.dynamics.point_motion import PointMotion
from skyarm.plant.loads import applied_force
from skyarm.plant.surroundings import Surroundings
from skyarm.records.arrays import AnyArray
from skyarm.records.coerce import concrete
from skyarm.records.leaves import Tree, leaves, parts, rebuild
from skyarm.scenario.scenario_checks import tip_sensor
from skyarm.scenario.scenario_record import PLANTS, Scenario, first_state
from skyarm.sensing.estimate.estimator import FULL_STATE
from skyarm.sensing.measurement import measurement_of
from skyarm.sensing.sensor import NO_PUSH
from skyarm.world import NO_WIND, Component, WindSample
from skyarm.world.component import MOST_UNIFORMS

INSTANTS = 2000
"""Number of instants of the flight at which a part is tested for any effect."""

NOTHING = 1e-12
"""Size (N, N m, m/s) below which an effect counts as rounding."""

WEIGHT = Vec3(0.0, 0.0, 9.81)
"""Specific force (m/s^2) that sensors receive in the test for an effect."""

MOVING = Vec3(1.1, 0.7, 0.9)
"""Angular velocity (rad/s) of the test for an effect; generic, so that no drag vanishes
by symmetry."""

AIRS = {"xy": Vec3(0.8, 0.6, 0.0), "z": Vec3(0.0, 0.0, 1.0)}
"""World axes -> air velocity along them (m/s) of the test for an effect."""

UNKNOWN: Any = None
"""Placeholder for state, motion or time of a component that must not depend on it."""

LEVEL, TILTED = Quaternion(1.0, 0.0, 0.0, 0.0), Quaternion(0.9, 0.3, 0.3, 0.1)
"""Attitudes of the test for an effect: level, and tilted about no axis alone."""


class WithoutEffectWarning(UserWarning):
    """Warning about a part of a scenario that has no effect on the flight."""


def without_effect(scenario: Scenario) -> tuple[str, ...]:
    """Warnings about air, forces, shapes and sensors without effect on the flight;
    empty if each has one.

    A part that cannot be evaluated is not judged: the flight states its fault.
    """
    # lines of the only vehicle have no name before them
    if scenario.is_team:
        return tuple(
            f"{name}: {line}"
            for name in scenario.agents
            for line in without_effect(scenario.of(name))
        )
    lines: list[str] = []
    for judge in (_idle_components, _idle_shapes, _unread_readings):
        with suppress(Exception):
            lines += judge(scenario)
    return tuple(lines)


def _idle_components(scenario: Scenario) -> Iterator[str]:
    placed = {
        where: each
        for where, each in scenario.placed_components
        if where.startswith("environment.")
        and not (each == NO_WIND or each.coupled or each.rigid)
    }
    # other plants have forces of their own
    if not placed or scenario.kind not in PLANTS:
        return
    changing = " ".join(each.path for each in scenario.changes)
    # else it may feel air later
    settled = not ("environment.forces" in changing or "plant." in changing)
    parts = (NO_WIND, *placed.values())
    blind = _blind_axes(scenario, parts, LEVEL)
    cure = "rotors.drag_coefficient or drag.area" if "x" in blind else "drag.area[2]"
    for where, component in placed.items():
        with suppress(Exception):
            moved, acts = _effect(scenario, component, blind)
            if settled and (idle := moved & blind):
                axes = ", ".join(sorted(idle))
                undragged = idle <= _blind_axes(scenario, parts, TILTED)
                drag = (
                    "no drag: no" if undragged else "drag by its tilt alone: hardly any"
                )
                lacks = (
                    f"where {scenario.agent.vehicle.name!r} has {drag} effect of that"
                )
                yield f"{where}: moves the air along {axes}, {lacks}; {cure} of it?"
            elif not (acts or moved or "environment." in changing):
                yield (
                    f"{where}: moves no air and exerts no force along the reference;"
                    " its numbers and times?"
                )


def _idle_shapes(scenario: Scenario) -> Iterator[str]:
    if scenario.agent.vehicle.shapes and not scenario.worlds:
        yield (
            "plant.vehicle: has shapes that touch nothing without a [world]; its"
            " surfaces?"
        )
    for contact in scenario.worlds:
        own = contact.of_agent(next(iter(scenario.agents)))
        if own.self_collision and all(each.other != "body" for each in own.body_pairs):
            yield (
                "world.self_collision: no two bodies of the vehicle have shapes, but"
                " neighbours; more shapes?"
            )


def _blind_axes(
    scenario: Scenario, parts: tuple[Component[Tree], ...], attitude: Quaternion
) -> set[str]:
    """World axes along which moving air changes no force on the vehicle; x and y only
    together, since it may yaw.

    No axis if a part cannot be evaluated: it may react to moving air.
    """
    vehicle = scenario.agent.vehicle
    blind = {*"xyz"}
    command = Command(rotor_speeds=(), efforts=vehicle.zeros)
    rates = (1.0,) * vehicle.n
    state = replace(
        first_state(scenario),
        quaternion=attitude,
        velocity=ZERO3,
        rate=MOVING,
        joint_rates=rates,
    )

    def forces(part: Component[Tree], air: Vec3) -> AnyArray:
        around = (WindSample(air_velocity_W=air), part)
        surroundings = Surroundings(
            components=around, memories=((), _begin(scenario, part))
        )
        motion = PointMotion(
            turn_rotors(vehicle, state.tilts), state, surroundings.air_velocity
        )
        return np.array(leaves(applied_force(motion, command, surroundings)))

    with suppress(Exception):
        for part in parts:
            calm = forces(part, ZERO3)
            for axes, air in AIRS.items():
                # in this form a NaN counts as a reaction
                if not np.abs(forces(part, air) - calm).max() < NOTHING:
                    blind -= {*axes}
        return blind
    return set()


def _begin(scenario: Scenario, component: Component[Tree], noise: float = 0.0) -> Tree:
    """Initial state of an environment model; for one with random numbers, all its
    values equal ``noise``.
    """
    # more are refused before the flight
    # start takes two numbers for each of a period; 0.5 is their mean
    draws = [0.5] * 2 * min(component.uniforms, MOST_UNIFORMS)
    memory = component.start(scenario.rates.period, draws)
    return rebuild(memory, [noise] * len(leaves(memory))) if draws else memory


def _effect(
    scenario: Scenario, component: Component[Tree], blind: set[str]
) -> tuple[set[str], bool]:
    """Axes along which an environment model moves the air, and True if it has other
    effects, along the reference.

    Turbulence moves the air along every axis: it counts only where the vehicle feels
    none. Of a component that looks at the motion, or at the time where instants are
    left out, an error says that it may act elsewhere.
    """
    period = scenario.rates.period
    every = max(1, scenario.steps // INSTANTS)
    memory = _begin(scenario, component, noise=float(len(blind) == 3))
    moved: set[str] = set()
    # random numbers are there for an effect
    acts = component.uniforms > 0
    speeds = first_state(scenario).rotor_speeds
    # an event shorter than the distance of the instants is met in its middle
    middles = [0.5 * (start + stop) for _, start, stop in component.events]
    for t in (*middles, *(k * period for k in range(0, scenario.steps, every))):
        if not component.uniforms:
            memory = component.act(
                component.advance(memory, t, every * period, UNKNOWN, ()),
                t,
                period,
                UNKNOWN,
            )
        air = component.velocity(memory, t, scenario.agent.reference.at(t).position)
        moved |= {
            axis for axis, speed in zip("xyz", air, strict=True) if abs(speed) > NOTHING
        }
        if not acts:
            pushes = component.wrenches(memory, t, UNKNOWN, speeds)
            acts = any(
                abs(c) > NOTHING
                for each in pushes
                for c in (*each.force_W, *each.torque_W)
            )
            acts = (
                acts
                or component.rotor_commands(
                    memory, scenario.agent.vehicle.rotors, speeds
                )
                is not speeds
            )
        # at any time
        still = {
            axis for axis, speed in zip("xyz", air, strict=True) if type(speed) is int
        }
        if (acts or moved) and moved | still >= blind:
            break
    # without an effect so far: one that needs time or motion raises, and is not judged
    if not (acts or moved or every == 1 or middles):
        component.wrenches(
            component.advance(memory, UNKNOWN, UNKNOWN, UNKNOWN, ()),
            UNKNOWN,
            UNKNOWN,
            speeds,
        )
        component.velocity(memory, UNKNOWN, ZERO3)
    return moved, acts


NOISE_OF_SENSORS = "the noise of [sensors.NAME] in its place?"

LATE_SENSORS = (
    "latency of [sensors.NAME] and delay_periods of [estimator] in its place?"
)


class _Readings(UserDict[str, object]):
    """Dictionary of sensor readings by name, which records the names that are looked
    up.
    """

    read: set[str]

    def __getitem__(self, name: str) -> object:
        self.read.add(name)
        return self.data[name]


def readings_at(scenario: Scenario, state: State, t: Scalar) -> dict[str, object]:
    """Readings of all sensors by name, for a vehicle without acceleration and random
    numbers of 0.5.
    """
    vehicle, period = scenario.agent.vehicle, scenario.rates.period
    readings: dict[str, object] = {FULL_STATE: measurement_of(state, WEIGHT)}
    for name, sensor in scenario.agent.all_sensors[1:]:
        middle = (0.5,) * sensor.uniforms(vehicle)
        readings[name] = sensor.take(
            sensor.start(vehicle), t, state, WEIGHT, NO_PUSH, middle, period
        )[1]
    return readings


def _unread_readings(scenario: Scenario) -> Iterator[str]:
    sensors = scenario.agent.all_sensors[1:]
    given = sensors or scenario.agent.has_estimator
    if not given or autopilot_of(scenario.agent.controller) is not None:
        return
    model, vehicle = scenario.agent.model, scenario.agent.vehicle
    state = first_state(scenario)
    readings = _Readings(readings_at(scenario, state, 0.0))
    readings.read = set()
    period = scenario.rates.period
    guards = scenario.agent.reference.guards
    estimator = scenario.agent.placed_estimator.believing(model.vehicle, model.gravity)
    command = Command(rotor_speeds=state.rotor_speeds, efforts=vehicle.zeros)
    estimator.step(estimator.start(model.vehicle), readings, command, period)
    used = readings.read | {
        name for guard in guards for name in (guard.closed, guard.open)
    }
    tip = tip_sensor(sensors, vehicle)
    if tip is not None and (
        senses_force(scenario.agent.controller.par)
        or any(guard.sensed for guard in guards)
    ):
        used.add(tip[0])
    if not estimator.reads_state or FULL_STATE not in used:
        for name, sigma in parts(scenario.agent.noise).items():
            if concrete(sigma) and sigma > 0.0:
                yield (
                    f"sensors.{name}: is of the full state, which the [estimator] does"
                    f" not read; {NOISE_OF_SENSORS}"
                )
        if scenario.agent.delays.measurement > 0.0:
            yield (
                "delays.measurement: is of the full state, which the [estimator] does"
                f" not read; {LATE_SENSORS}"
            )
    for name, _ in sensors:
        if name not in used:
            yield (
                f"sensors.{name}: only the log has its readings, the law does not; an"
                " [estimator] for it?"
            )
