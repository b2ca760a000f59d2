"""The tip gives way to a force from outside as a mass, a damper and a spring of one's choice: admittance.

Nothing of the law changes but the reference that it tracks: the whole of it is shifted by a virtual tip
(:mod:`skyarm.control.blocks.virtual_tip`), with its velocity and acceleration, which the force pushes that is observed
at the tip or told by a sensor (:mod:`skyarm.control.blocks.outside_force`). The law goes on to answer the force itself,
so that tip, arm and base stay on the shifted reference and what is felt outside are M, D and K alone, as far as the
loops reach. With a table ``rotation`` the torque about the tip is heard, too, and turns the tip of the reference
(:mod:`skyarm.control.laws.centroidal.tip_rotation`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skyarm.algebra import ZERO3, Vec3
from skyarm.control.blocks.disturbance import Disturbance
from skyarm.control.blocks.disturbance_observer import Observed, disturbance
from skyarm.control.blocks.filters import low_pass_share
from skyarm.control.blocks.outside_force import hear
from skyarm.control.blocks.select import vector_data
from skyarm.control.blocks.virtual_tip import moved_tip
from skyarm.control.laws.centroidal.admittance_records import AdmittanceGains, AdmittanceMemory, RotationMemory
from skyarm.control.laws.centroidal.pressing import Pressing
from skyarm.control.laws.centroidal.tip_force import TipLevers, levers, tip_force, without
from skyarm.control.laws.centroidal.tip_rotation import listen, turn
from skyarm.control.laws.centroidal.tip_wrench import tip_wrench
from skyarm.dynamics.kinematics import frame_pose, jacobian_columns
from skyarm.scalars import maximum, minimum, mul, where
from skyarm.scalars.taylor import Taylor
from skyarm.vehicle.vehicle_records import Vehicle


def give_way(
    gains: AdmittanceGains | None,
    memory: AdmittanceMemory | tuple[()],
    vehicle: Vehicle,
    observed: Observed,
    signals: list[Taylor],
    told: tuple[Any, ...],
    dt: Any,
    twisted: tuple[Any, ...] = (),
) -> tuple[AdmittanceMemory | tuple[()], list[Taylor]]:
    """One period: the memory, and the reference's signals with x, y and z shifted and, if it turns, joints moved.

    Args:
        gains: constants; None of a law that stands against forces.
        memory: one period earlier.
        vehicle: model.
        observed: of the observer, at the measurement's time.
        signals: of the reference, series in time.
        told: N, as a sensor tells it, axes of the tip; empty without one.
        dt: control period, s.
        twisted: N m, as a sensor tells it, axes of the tip; empty without one.
    """
    if gains is None or not isinstance(memory, AdmittanceMemory):
        return memory, signals
    at = levers(vehicle, observed.quaternion.rotation(), observed.joints)
    d = disturbance(observed)
    force, torque = _wrench(gains, vehicle, at, observed.joints, without(d, memory.hearing.bias))
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
    if gains.rotation is None:
        return tip_force(vehicle, gains.errors, at, rest), ZERO3
    turns = [column.angular for column in jacobian_columns(vehicle, vehicle.frame(), joints)]
    return tip_wrench(vehicle, gains.errors, at, turns, rest)


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
    quiet = memory.hearing.quiet
    if isinstance(memory.rotation, RotationMemory):
        quiet = minimum(quiet, memory.rotation.hearing.quiet)
    rest = where(quiet > gains.rest, 1.0, 0.0)
    return tuple(mul(each, rest) for each in free)
