"""Where pressing meets the rest of the law: what it reads of a period, and what it gives back."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

from skyarm.actuation import Command
from skyarm.algebra import Vec3
from skyarm.control.blocks.disturbance import Disturbance
from skyarm.control.blocks.disturbance_observer import Observed, disturbance
from skyarm.control.blocks.filters import low_pass_share
from skyarm.control.blocks.select import vector_data
from skyarm.control.laws.centroidal.interaction import interact
from skyarm.control.laws.centroidal.interaction_records import InteractionMemory, wanted_of
from skyarm.control.laws.centroidal.parameters import CentroidalParameters
from skyarm.control.laws.centroidal.pressing import Pressing
from skyarm.control.laws.centroidal.surface_normal import leaning, slid
from skyarm.control.laws.centroidal.tip_force import levers
from skyarm.dynamics import State
from skyarm.dynamics.kinematics import frame_pose
from skyarm.scalars import absolute, divide, logical_and, maximum, where
from skyarm.scalars.taylor import Taylor
from skyarm.vehicle.vehicle_records import Vehicle

SLIDES = 0.01
"""m/s along the surface, from which on friction is at its cone and cannot be let go."""


def press(
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
        par: constants, with those of pressing.
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
    if par.interaction is None:
        raise AssertionError("pressing needs its constants")
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
        felt = memory.felt + (pushed - memory.felt) * low_pass_share(par.interaction.sensing, dt)
    memory, pressing = interact(
        par.interaction, memory, wanted, vehicle, disturbance(observed), then, into, load, dt, felt
    )
    lean = slid(
        memory.lean,
        wanted.normal,
        velocity,
        par.interaction.tilting,
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
