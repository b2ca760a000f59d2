"""The tip gives way to a force from outside as a mass, a damper and a spring of one's choice: admittance.

Nothing of the law changes but the reference that it tracks: the whole of it is shifted by a virtual tip
(:mod:`skyarm.control.blocks.virtual_tip`), with its velocity and acceleration, which the force pushes that is observed
at the tip or told by a sensor (:mod:`skyarm.control.blocks.outside_force`). The law goes on to answer the force itself,
so that tip, arm and base stay on the shifted reference and what is felt outside are M, D and K alone, as far as the
loops reach.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import Vec3
from skyarm.control.blocks.compliance_table import compliance_of
from skyarm.control.blocks.disturbance_observer import Observed, disturbance
from skyarm.control.blocks.filters import low_pass_share
from skyarm.control.blocks.outside_force import Hearing, HearingMemory, first_hearing, hear
from skyarm.control.blocks.select import vector_data
from skyarm.control.blocks.virtual_tip import AT_REST, Compliance, VirtualTip, moved_tip
from skyarm.control.controller import ControllerError
from skyarm.control.laws.centroidal.interaction_records import SENSING
from skyarm.control.laws.centroidal.pressing import Pressing
from skyarm.control.laws.centroidal.tip_force import ForceErrors, levers, tip_force, without
from skyarm.dynamics.kinematics import frame_pose
from skyarm.files import shown
from skyarm.records.units import Unit
from skyarm.scalars import Scalar, maximum, mul, where
from skyarm.scalars.taylor import Taylor
from skyarm.vehicle.vehicle_records import Vehicle


@dataclass(frozen=True, kw_only=True, slots=True)
class AdmittanceGains:
    """Constants of giving way."""

    tip: Compliance
    hearing: Hearing = Hearing()
    errors: ForceErrors = ForceErrors()
    rest: Annotated[Scalar, Unit("s", "after a force, from which on a law learns loads, friction and lag")] = 0.5
    sensing: Annotated[Scalar, Unit("rad/s", "filter of a force sensor")] | None = None

    @property
    def senses(self) -> bool:
        """Whether a force sensor tells the force: structure."""
        return self.sensing is not None


@dataclass(frozen=True, kw_only=True, slots=True)
class AdmittanceMemory:
    """Memory of giving way."""

    tip: VirtualTip
    hearing: HearingMemory
    force: Annotated[Vec3, Unit("N", "at the tip, believed, world axes")]
    felt: Annotated[Vec3 | tuple[()], Unit("N", "by a sensor at the tip, filtered, axes of the tip")] = ()


def give_way(
    gains: AdmittanceGains | None,
    memory: AdmittanceMemory | tuple[()],
    vehicle: Vehicle,
    observed: Observed,
    signals: list[Taylor],
    told: tuple[Any, ...],
    dt: Any,
) -> tuple[AdmittanceMemory | tuple[()], list[Taylor]]:
    """One period: the memory, and the reference's signals with x, y and z shifted.

    Args:
        gains: constants; None of a law that stands against forces.
        memory: one period earlier.
        vehicle: model.
        observed: of the observer, at the measurement's time.
        signals: of the reference, series in time.
        told: N, as a sensor tells it, axes of the tip; empty without one.
        dt: control period, s.
    """
    if gains is None or not isinstance(memory, AdmittanceMemory):
        return memory, signals
    at = levers(vehicle, observed.quaternion.rotation(), observed.joints)
    d = disturbance(observed)
    force = counted = tip_force(vehicle, gains.errors, at, without(d, memory.hearing.bias))
    felt = None
    if isinstance(memory.felt, Vec3) and isinstance(memory.hearing.felt, Vec3) and told:
        felt = memory.felt + (Vec3(*told) - memory.felt) * low_pass_share(gains.sensing, dt)
        turned = at.R @ frame_pose(vehicle, vehicle.frame(), observed.joints).R
        counted = turned.apply(felt - memory.hearing.felt)
    hearing, outside = hear(gains.hearing, memory.hearing, d, force, counted, dt, felt)
    tip, (place, velocity, acceleration) = moved_tip(gains.tip, memory.tip, outside, dt)
    after = AdmittanceMemory(
        tip=tip,
        hearing=hearing,
        force=vector_data(counted),
        felt=memory.felt if felt is None else vector_data(felt),
    )
    moved = (
        signal + Taylor((p, v, mul(0.5, a), 0, 0))
        for signal, p, v, a in zip(signals[:3], place, velocity, acceleration, strict=True)
    )
    return after, [*moved, *signals[3:]]


def known_rate(memory: AdmittanceMemory | tuple[()], rate: Vec3) -> Vec3:
    """How an observed force changes, N/s; nothing is foretold of one from outside."""
    return rate * (1.0 - memory.hearing.heard) if isinstance(memory, AdmittanceMemory) else rate


def outside(memory: AdmittanceMemory | tuple[()], pressing: Pressing | None) -> Any:
    """1 while what the tip touches, or what pushes it, is in what is observed: no trend of the wind."""
    engaged = 0 if pressing is None else pressing.engaged
    return maximum(engaged, memory.hearing.heard) if isinstance(memory, AdmittanceMemory) else engaged


def unmoved(
    gains: AdmittanceGains | None, memory: AdmittanceMemory | tuple[()], free: Sequence[Any]
) -> tuple[Any, ...]:
    """Shares with which loads, friction and lag are learned: 0 while anything from outside is in what is observed."""
    if gains is None or not isinstance(memory, AdmittanceMemory):
        return tuple(free)
    rest = where(memory.hearing.quiet > gains.rest, 1.0, 0.0)
    return tuple(mul(each, rest) for each in free)


def admittance_gains(
    table: Any, mode: str, vehicle: Vehicle, sensor: bool, lead: float, others: Mapping[str, bool]
) -> AdmittanceGains | None:
    """Constants of the option ``admittance``; None where it is left out.

    Args:
        table: mass, damping, stiffness; normal, threshold.
        mode: of the law.
        vehicle: model.
        sensor: whether a force sensor tells the force.
        lead: s, by how long the observer is late.
        others: options that cannot fly beside it, and whether they are used.

    Raises:
        ControllerError: a table that is none, or a law without a tip to lead.
    """
    if table is None:
        return None
    at = "controller.admittance"
    if mode != "tip" or not vehicle.n:
        raise ControllerError(f"{at} = {shown(table)}: must be left out but in mode 'tip' with joints")
    for name, used in others.items():
        if used:
            raise ControllerError(f"{at} = {shown(table)}: must be left out beside {name}")
    tip, hearing = compliance_of(table, at, 1.0 / SENSING if sensor else lead)
    gains = AdmittanceGains(tip=tip, hearing=hearing)
    return dataclasses.replace(gains, sensing=SENSING) if sensor else gains


def first_admittance(joints: int, sensor: bool) -> AdmittanceMemory:
    """At rest on the reference, nothing known."""
    zero = Vec3(0.0, 0.0, 0.0)
    return AdmittanceMemory(tip=AT_REST, hearing=first_hearing(joints, sensor), force=zero, felt=zero if sensor else ())
