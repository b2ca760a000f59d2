"""Pressing as a part of the law: one period of :mod:`skyarm.control.laws.centroidal.interaction` in a control step."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from skyarm.actuation import Command
from skyarm.algebra import Vec3
from skyarm.control.blocks.disturbance import Disturbance
from skyarm.control.blocks.disturbance_observer import Observed, disturbance
from skyarm.control.blocks.filters import low_pass_share
from skyarm.control.blocks.select import vector_data
from skyarm.control.laws.centroidal.interaction import (
    InteractionGains,
    InteractionMemory,
    Pressing,
    first_interaction,
    interact,
    leaning,
    rested,
    slid,
    wanted_of,
)
from skyarm.control.laws.centroidal.parameters import CentroidalParameters
from skyarm.control.laws.centroidal.part import Part, Step
from skyarm.control.laws.centroidal.tip_force import levers
from skyarm.dynamics import State
from skyarm.dynamics.kinematics import frame_pose
from skyarm.scalars import absolute, divide, logical_and, maximum, mul, where
from skyarm.scalars.taylor import Taylor
from skyarm.vehicle.vehicle_records import Vehicle

SLIDES = 0.01
"""m/s along the surface, from which on friction is at its cone and cannot be let go."""


@dataclass(frozen=True, kw_only=True, slots=True)
class PressingGains(InteractionGains, Part):
    """Constants of pressing."""

    def start(self, joints: int) -> InteractionMemory:
        """Memory of free flight."""
        return first_interaction(joints, self.senses)

    def adjust_reference(self, memory: InteractionMemory, step: Step) -> InteractionMemory:
        """Exchange the observed force for the wanted one; a surface is no load, no friction and no lag."""
        if not step.reference.push:
            return memory
        load, sent = step.memory.parts.load, step.memory.sent[-1]
        weight = mul(load.mass, step.par.model.gravity) if load else 0
        memory, step.pressing, step.unknown, step.force = press(
            self,
            step.par,
            memory,
            step.reference.push,
            step.signals,
            step.observed,
            sent,
            step.state,
            step.unknown,
            step.measurement.tip_force,
            step.dt,
            weight,
        )
        step.signals, step.external = step.pressing.shifted(step.signals), step.pressing.engaged
        step.isolate(rested(self, memory))
        return memory

    def learn(self, memory: InteractionMemory, step: Step) -> InteractionMemory:
        """Take the tip's distance from its reference along the normal."""
        if step.pressing is None or step.demand is None:
            return memory
        return dataclasses.replace(memory, gap=step.demand.gap)


def press(
    gains: InteractionGains,
    par: CentroidalParameters,
    memory: InteractionMemory,
    push: Sequence[Any],
    signals: Sequence[Taylor],
    observed: Observed,
    sent: Command,
    state: State,
    unknown: Disturbance,
    tip_force: tuple[Any, ...],
    dt: Any,
    weight: Any = 0,
) -> tuple[InteractionMemory, Pressing, Disturbance, Vec3]:
    """One period of pressing.

    Args:
        gains: constants.
        par: of the law.
        memory: of pressing.
        push: of the reference.
        signals: of the reference, series in time.
        observed: of the observer, at the measurement's time.
        sent: the last command.
        state: now.
        unknown: disturbance that the law would answer without a surface.
        tip_force: N, as a sensor tells it, axes of the tip; empty without one.
        dt: control period, s.
        weight: N, of the load that the tip is believed to hold: a sensor feels it, the surface does not.

    Returns:
        The memory, what the instant asks for, the disturbance that the law answers, and its force on the base as far as
        the observer tells it (N, world axes), which the posture follows.
    """
    vehicle = par.model.vehicle
    then = levers(vehicle, observed.quaternion.rotation(), observed.joints)
    now = levers(vehicle, state.quaternion.rotation(), state.joints)
    told = wanted_of(push).about_the_pivot(state.position + now.R.apply(now.tip))
    wanted = dataclasses.replace(told, normal=leaning(told.normal, memory.lean))
    moving = state.rate.cross(now.tip)
    for column, rate in zip(now.columns, state.joint_rates, strict=True):
        moving = moving + column * rate
    velocity = state.velocity + now.R.apply(moving)
    into = -wanted.normal.dot(velocity)
    led = Vec3(*(signal.derivative(1) for signal in signals[:3]))
    across = led - wanted.normal * wanted.normal.dot(led)
    slides: Any = across.dot(across) > SLIDES * SLIDES
    load = where(slides, 0.0, _load(vehicle, sent))
    felt = None
    if isinstance(memory.felt, Vec3) and tip_force:
        turned = then.R @ frame_pose(vehicle, vehicle.frame(), observed.joints).R
        pushed = turned.apply(Vec3(*tip_force)) + Vec3(0, 0, weight)
        felt = memory.felt + (pushed - memory.felt) * low_pass_share(gains.sensing, dt)
    memory, pressing = interact(gains, memory, wanted, vehicle, disturbance(observed), then, into, load, dt, felt)
    lean = slid(
        memory.lean,
        wanted.normal,
        velocity,
        gains.tilting,
        wanted.presses,
        logical_and(slides, memory.share > 1.0 - 1e-9),
        dt,
    )
    memory = dataclasses.replace(memory, lean=vector_data(lean))
    given = pressing.exchanged(unknown, then, now)
    return memory, pressing, given, observed.force + given.force - unknown.force


def _load(vehicle: Vehicle, sent: Command) -> Any:
    """The largest share of its limit that a joint's effort or a rotor's squared speed takes."""
    most: Any = 0.0
    for link, effort in zip(vehicle.links, sent.efforts, strict=True):
        limit = link.joint.effort_limit  # 0 is none
        most = maximum(most, where(limit > 0.0, divide(absolute(effort), limit), 0.0))
    for rotor, speed in zip(vehicle.rotors, sent.rotor_speeds, strict=True):
        share = divide(speed, rotor.max_speed)
        most = maximum(most, share * share)
    return most
