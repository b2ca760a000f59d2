"""What the rivals that press share: an observer that only listens, the tip's force in it, touch and loss.

The observer is the one of ``ct_observer``; nothing that it holds is answered. The tip's force, its bias, touch and loss
are those of the centroidal law (:mod:`skyarm.control.laws.centroidal.interaction`), so that only what is done with them
differs.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.actuation import Command
from skyarm.algebra import Vec3
from skyarm.control.blocks.common import make_parameters, no_command
from skyarm.control.blocks.disturbance_observer import Observed, ObserverGains, disturbance, first_observed, observe
from skyarm.control.controller import Controller, ControllerError, Law
from skyarm.control.laws.centroidal.interaction import (
    InteractionGains,
    InteractionMemory,
    Pressing,
    first_interaction,
    interact,
    interaction_gains,
    wanted_of,
)
from skyarm.control.laws.centroidal.tip_force import TipLevers, levers
from skyarm.control.model import Model, Parameters
from skyarm.control.options import three, two
from skyarm.files import shown
from skyarm.records.units import Unit
from skyarm.reference import Reference
from skyarm.scalars import Scalar, where
from skyarm.sensors.measurement import Measurement

UNFILTERED = 1e6
"""rad/s: the observer takes the pose as measured."""


@dataclass(frozen=True, kw_only=True, slots=True)
class PressingParameters(Parameters):
    """Constants beside the paper's."""

    observer: ObserverGains
    interaction: InteractionGains


@dataclass(frozen=True, kw_only=True, slots=True)
class PressingMemory:
    """Memory of a rival that presses.

    Attributes:
        started: 0 before the first measurement. observed: of the observer. sent: the last command. interaction: of
            touch and loss.
    """

    started: Annotated[Scalar, Unit("", "0 before the first measurement, then 1")]
    observed: Observed
    sent: Command
    interaction: InteractionMemory


@dataclass(frozen=True, slots=True)
class Touch:
    """What a period knows of the contact.

    Attributes:
        at: levers of the tip, as measured. pressing: of the interaction. force: N, wanted. along: N, observed, of the
            surface along its normal, 0 where the tip does not touch. speed: m/s, with which the tip comes. into: m/s,
            of the tip into the surface.
    """

    at: TipLevers
    pressing: Pressing
    force: Any
    along: Any
    speed: Any
    into: Any


def listen(
    memory: PressingMemory, measurement: Measurement, reference: Reference, dt: Any, par: PressingParameters
) -> tuple[PressingMemory, Touch | None]:
    """One period of the observer and of touch and loss; no touch where the reference never asks for contact."""
    vehicle = par.model.vehicle
    # the modelled rotors begin where the real ones are
    speeds = zip(memory.observed.rotor_speeds, measurement.rotor_speeds, strict=True)
    before = dataclasses.replace(
        memory.observed, rotor_speeds=tuple(where(memory.started > 0.5, ours, theirs) for ours, theirs in speeds)
    )
    free = (1.0,) * (1 + vehicle.n)
    pushed = disturbance(before)
    observed, _ = observe(par.model, par.observer, before, measurement, memory.sent, pushed, memory.started, free, dt)
    after = dataclasses.replace(memory, started=memory.started * 0.0 + 1.0, observed=observed)
    if not reference.push:
        return after, None
    at = levers(vehicle, measurement.quaternion.rotation(), measurement.joints)
    wanted = wanted_of(reference.push[:5])
    moving = measurement.rate.cross(at.tip)
    for column, rate in zip(at.columns, measurement.joint_rates, strict=True):
        moving = moving + column * rate
    into = -wanted.normal.dot(measurement.velocity + at.R.apply(moving))
    held, pressing = interact(
        par.interaction, memory.interaction, wanted, vehicle, disturbance(observed), at, into, 0.0, dt
    )
    along = where(held.touching > 0.5, wanted.normal.dot(pressing.force), 0.0)
    touch = Touch(at=at, pressing=pressing, force=wanted.force, along=along, speed=wanted.speed, into=into)
    return dataclasses.replace(after, interaction=held), touch


def moved(reference: Reference, n: Vec3, shift: tuple[Any, Any, Any]) -> Reference:
    """The reference with the base's path moved along a normal (m, m/s, m/s^2)."""
    s, rate, acceleration = shift
    return dataclasses.replace(
        reference,
        position=reference.position + n * s,
        velocity=reference.velocity + n * rate,
        acceleration=reference.acceleration + n * acceleration,
    )


def pressing_controller(name: str, law: Law, model: Model, observer: Any, thresholds: Any, **gains: Any) -> Controller:
    """A law with the paper's constants, those of the observer, and those of touch and loss.

    Args:
        name: of the law.
        law: itself.
        model: what it believes.
        observer: bandwidths of force, torque and joint torques, rad/s.
        thresholds: N along the normal, above which the tip touches and below which it is lost.
        **gains: those of :func:`skyarm.control.blocks.common.make_parameters`.

    Raises:
        ControllerError: bandwidths or thresholds that are none, or a vehicle whose joints move no tip.
    """
    vehicle = model.vehicle
    if not vehicle.end_effector or not vehicle.n:
        raise ControllerError(f"model.vehicle = {vehicle.name!r}: must have joints that move an end_effector")
    force, torque, joints = three("observer", observer)
    interaction = interaction_gains(two("interaction", thresholds, zero=True), "tip", vehicle)
    if interaction is None:
        raise ControllerError(f"controller.interaction = {shown(thresholds)}: must be two forces above 0")
    heard = ObserverGains(force=force, torque=torque, joints=joints, pose=UNFILTERED)
    par = make_parameters(PressingParameters, model, observer=heard, interaction=interaction, **gains)
    return Controller(name=name, law=law, par=par, memory=first_pressing(model))


def first_pressing(model: Model) -> PressingMemory:
    """Nothing was sent and nothing is known."""
    vehicle = model.vehicle
    still = (0.0,) * len(vehicle.rotors)
    return PressingMemory(
        started=0.0,
        observed=first_observed(vehicle.n, still),
        sent=no_command(vehicle),
        interaction=first_interaction(vehicle.n),
    )
