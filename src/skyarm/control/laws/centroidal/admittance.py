"""Admittance: the tip answers an external force as a mass, a damper and a spring.

Nothing of the law changes but the reference that it tracks: the whole of it is shifted by a virtual tip
(:mod:`skyarm.control.laws.centroidal.virtual_body`), with its velocity and acceleration, which the external force
drives, observed or measured (:mod:`skyarm.control.laws.centroidal.outside_force`). The law goes on to compensate the
force itself, so that tip, arm and base stay on the shifted reference and what is felt outside are M, D and K alone, as
far as the loops reach. A table ``rotation`` adds the torque about the tip, which turns the tip of the reference
(:mod:`skyarm.control.laws.centroidal.tip_rotation`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import Vec3
from skyarm.control.blocks.disturbance import Disturbance
from skyarm.control.blocks.disturbance_observer import Observed, disturbance
from skyarm.control.blocks.filters import low_pass_share
from skyarm.control.blocks.select import vector_data
from skyarm.control.controller import ControllerError
from skyarm.control.laws.centroidal.compliance_table import compliance_of, require_moderate, rotation_of
from skyarm.control.laws.centroidal.interaction import SENSING
from skyarm.control.laws.centroidal.joint_room import ends_of
from skyarm.control.laws.centroidal.outside_force import Hearing, HearingMemory, first_hearing, hear
from skyarm.control.laws.centroidal.part import Part, Step
from skyarm.control.laws.centroidal.tip_force import ForceErrors, TipLevers, levers, tip_wrench
from skyarm.control.laws.centroidal.tip_rotation import (
    RotationGains,
    RotationMemory,
    first_rotation,
    listen,
    require_turning,
    turn,
)
from skyarm.control.laws.centroidal.virtual_body import (
    AT_REST,
    Compliance,
    VirtualTip,
    moved_tip,
)
from skyarm.dynamics.kinematics import frame_pose, jacobian_columns
from skyarm.files import shown
from skyarm.records.units import Unit
from skyarm.scalars import Scalar, minimum, mul, where
from skyarm.scalars.taylor import Taylor
from skyarm.vehicle.vehicle_records import Vehicle


def give_way(
    gains: AdmittanceGains,
    memory: AdmittanceMemory,
    vehicle: Vehicle,
    observed: Observed,
    signals: Sequence[Taylor],
    told: tuple[Any, ...],
    dt: Any,
    twisted: tuple[Any, ...] = (),
) -> tuple[AdmittanceMemory, list[Taylor]]:
    """One period: the memory, and the reference's signals with x, y and z shifted and, if it turns, joints moved.

    Args:
        gains: constants.
        memory: one period earlier.
        vehicle: model.
        observed: of the observer, at the measurement's time.
        signals: of the reference, series in time.
        told: N, as a sensor tells it, axes of the tip; empty without one.
        dt: control period, s.
        twisted: N m, as a sensor tells it, axes of the tip; empty without one.
    """
    at = levers(vehicle, observed.quaternion.rotation(), observed.joints)
    d = disturbance(observed)
    force, torque = _wrench(gains, vehicle, at, observed.joints, d - memory.hearing.bias)
    rotation, heard, pulls = memory.rotation, None, None
    felt, counted = _told(gains, vehicle, at, observed.joints, memory.felt, memory.hearing.felt, told, force, dt)
    if gains.rotation is not None and isinstance(rotation, RotationMemory):
        own, known = rotation.felt, rotation.hearing.felt
        twist, torque = _told(gains, vehicle, at, observed.joints, own, known, twisted, torque, dt)
        before = (gains.hearing, memory.hearing)
        rotation, pulls = listen(gains.rotation, rotation, before, torque, counted, twist, dt)
        heard = rotation.hearing.heard
    hearing, outside = hear(gains.hearing, memory.hearing, d, force, counted, dt, felt, heard)
    tip, (place, velocity, acceleration) = moved_tip(gains.tip, memory.tip, outside, dt)
    if gains.rotation is not None and isinstance(rotation, RotationMemory) and pulls is not None:
        rotation, signals = turn(gains.rotation, rotation, vehicle, pulls, signals, dt)
    after = AdmittanceMemory(
        tip=tip,
        hearing=hearing,
        force=vector_data(counted),
        felt=memory.felt if felt is None else vector_data(felt),
        rotation=rotation,
    )
    moved = (
        signal + Taylor((p, v, mul(0.5, a), 0, 0))
        for signal, p, v, a in zip(signals[:3], place, velocity, acceleration, strict=True)
    )
    return after, [*moved, *signals[3:]]


def _wrench(
    gains: AdmittanceGains, vehicle: Vehicle, at: TipLevers, joints: Sequence[Any], rest: Disturbance
) -> tuple[Vec3, Vec3]:
    """Force and torque about the tip (N, N m, world axes) that the observer holds; no torque where none is heard."""
    columns = () if gains.rotation is None else jacobian_columns(vehicle, vehicle.frame(), joints)
    return tip_wrench(vehicle, gains.errors, at, [column.angular for column in columns], rest)


def _told(
    gains: AdmittanceGains,
    vehicle: Vehicle,
    at: TipLevers,
    joints: Sequence[Any],
    felt: Vec3 | tuple[()],
    bias: Vec3 | tuple[()],
    told: tuple[Any, ...],
    believed: Vec3,
    dt: Any,
) -> tuple[Vec3 | None, Vec3]:
    """What a sensor tells (filtered, axes of the tip; None without one), and what counts, world axes."""
    if gains.sensing is None or not isinstance(felt, Vec3) or not isinstance(bias, Vec3) or not told:
        return None, believed
    now = felt + (Vec3(*told) - felt) * low_pass_share(gains.sensing, dt)
    turned = at.R @ frame_pose(vehicle, vehicle.frame(), joints).R
    return now, turned.apply(now - bias)


@dataclass(frozen=True, kw_only=True, slots=True)
class AdmittanceGains(Part):
    """Constants of giving way."""

    tip: Compliance
    hearing: Hearing = Hearing()
    errors: ForceErrors = ForceErrors()
    rest: Annotated[Scalar, Unit("s", "after a force, from which on a law learns loads, friction and lag")] = 0.5
    sensing: Annotated[Scalar, Unit("rad/s", "filter of a force sensor")] | None = None
    rotation: RotationGains | None = None

    def __post_init__(self) -> None:
        require_moderate("controller.parts.admittance.tip", "mass", self.tip)

    @property
    def senses(self) -> bool:
        """Whether a force sensor tells the force: structure."""
        return self.sensing is not None

    @property
    def senses_torque(self) -> bool:
        """Whether it tells the torque, too."""
        return self.senses and self.rotation is not None

    def start(self, joints: int) -> AdmittanceMemory:
        """At rest on the reference, nothing known."""
        zero, sensor = Vec3(0.0, 0.0, 0.0), self.senses
        return AdmittanceMemory(
            tip=AT_REST,
            hearing=first_hearing(joints, sensor),
            force=zero,
            felt=zero if sensor else (),
            rotation=() if self.rotation is None else first_rotation(joints, sensor),
        )

    def adjust_reference(self, memory: AdmittanceMemory, step: Step) -> AdmittanceMemory:
        """Move the reference; nothing is adapted while a force from outside is in what is observed, and after it."""
        told = step.measurement
        memory, step.signals = give_way(
            self,
            memory,
            step.par.model.vehicle,
            step.observed,
            step.signals,
            told.tip_force,
            step.dt,
            told.tip_torque,
        )
        step.external = memory.hearing.heard
        step.isolate(self.rested(memory))
        return memory

    def rested(self, memory: AdmittanceMemory) -> Any:
        """1 where nothing of a force or torque from outside is left in what is observed, else 0."""
        quiet = memory.hearing.quiet
        if isinstance(memory.rotation, RotationMemory):
            quiet = minimum(quiet, memory.rotation.hearing.quiet)
        return where(quiet > self.rest, 1.0, 0.0)


@dataclass(frozen=True, kw_only=True, slots=True)
class AdmittanceMemory:
    """Memory of giving way."""

    tip: VirtualTip
    hearing: HearingMemory
    force: Annotated[Vec3, Unit("N", "at the tip, believed, world axes")]
    felt: Annotated[Vec3 | tuple[()], Unit("N", "by a sensor at the tip, filtered, axes of the tip")] = ()
    rotation: RotationMemory | tuple[()] = ()


def admittance_gains(
    table: Any, mode: str, vehicle: Vehicle, sensor: bool, lead: float, others: Mapping[str, bool]
) -> AdmittanceGains | None:
    """Constants of the option ``admittance``; None where it is left out.

    Args:
        table: mass, damping, stiffness; normal, threshold; rotation.
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
    lag = 1.0 / SENSING if sensor else lead
    tip, hearing = compliance_of(table, at, lag)
    turns, rotation = rotation_of(table, at, lag, tip.axes), None
    if turns is not None:
        require_turning(vehicle, at, table["rotation"], sensor)
        rotation = RotationGains(body=turns[0], threshold=turns[1], ends=ends_of(vehicle))
    gains = AdmittanceGains(tip=tip, hearing=hearing, rotation=rotation)
    return dataclasses.replace(gains, sensing=SENSING) if sensor else gains
