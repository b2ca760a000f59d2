"""One period of the safety layer without the law's own step: the governed reference before it, the command after it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from skyarm.actuation import Command
from skyarm.algebra import ZERO3, Vec3
from skyarm.compile import leaves, rebuild
from skyarm.control.blocks.geometric import yaw_of
from skyarm.control.safety.command_limits import limit_slew, reachable
from skyarm.control.safety.governor import govern_base, govern_joints
from skyarm.control.safety.joint_barrier import apply_joint_barrier, within_efforts
from skyarm.control.safety.memory import SafetyMemory, SafetyParameters, blend_dense
from skyarm.control.safety.recovery import base_stiffness, recover
from skyarm.control.safety.supervisor import update_confidence
from skyarm.reference import Reference
from skyarm.scalars import absolute, where
from skyarm.sensors.measurement import Measurement


@dataclass(frozen=True, kw_only=True, slots=True)
class Governed:
    """The governed reference of a law.

    Attributes:
        reference: governed. ramping: 1 for each joint whose reference is on its way.
        joints: rad or m, where the governed references stood one period ago.
    """

    reference: Reference
    ramping: tuple[Any, ...]
    joints: tuple[Any, ...]


def govern(
    par: SafetyParameters, memory: SafetyMemory, measurement: Measurement, reference: Reference, dt: Any
) -> Governed:
    """Return the governed reference."""
    limits = par.limits
    joints = _kept(memory.started > 0.5, memory.joints, measurement.joints)
    base = govern_base(
        reference,
        measurement,
        limits=limits,
        stiffness=limits.stiffness,
        damping=limits.damping,
        gravity=par.model.gravity,
    )
    reference, ramping = govern_joints(
        base, joints, memory.ramping, limits.joint_slew, limits.joint_step, dt, model=par.model, limits=limits
    )
    return Governed(reference=reference, ramping=ramping, joints=joints)


def arbitrate(
    par: SafetyParameters,
    memory: SafetyMemory,
    measurement: Measurement,
    governed: Governed,
    desired: Command,
    failed: Any,
    dt: Any,
) -> SafetyMemory:
    """Decide whether the law or the recovery flies; return the memory after the step, the law's own as it was.

    Args:
        par: constants.
        memory: before the step.
        measurement: now.
        governed: reference that the law was given.
        desired: command of the law.
        failed: whether the law's command or memory cannot be used.
        dt: s.
    """
    confidence = update_confidence(par.limits, memory.confidence, measurement, governed.joints, failed, dt)
    given_up, before = confidence.given_up > 0.5, memory.confidence.given_up > 0.5
    hold, yaw = _place(before, memory, measurement)
    arm = _kept(before, memory.arm, measurement.joints)
    hovering = _hold_reference(par, measurement, hold, yaw, arm, dt)
    rescue = recover(par.recovery, par.model, par.mixer, measurement, hovering)
    return SafetyMemory(
        inner=memory.inner,
        started=memory.started * 0.0 + 1.0,
        joints=_kept(given_up, measurement.joints, governed.reference.joints),
        ramping=_kept(given_up, (0.0,) * len(governed.joints), governed.ramping),
        arm=hovering.joints,
        sent=limit_command(par, memory, measurement, blend_dense(given_up, rescue, desired), dt),
        confidence=confidence,
        hold=hold,
        yaw=yaw,
    )


def _kept(condition: Any, a: tuple[Any, ...], b: tuple[Any, ...]) -> tuple[Any, ...]:
    return tuple(where(condition, x, y) for x, y in zip(a, b, strict=True))


def _place(before: Any, memory: SafetyMemory, measurement: Measurement) -> tuple[Vec3, Any]:
    """Where the recovery hovers and its heading: as found while the law flew, as kept since it was given up."""
    hold = Vec3(*_kept(before, tuple(memory.hold), tuple(measurement.position)))
    return hold, where(before, memory.yaw, yaw_of(measurement.quaternion))


def _hold_reference(
    par: SafetyParameters, measurement: Measurement, hold: Vec3, yaw: Any, arm: Any, dt: Any
) -> Reference:
    """Return the reference of the recovery: hover, and stow the arm."""
    still = (0.0,) * len(par.recovery.stow)
    wanted = Reference(
        position=hold,
        velocity=ZERO3,
        yaw=yaw,
        joints=par.recovery.stow,
        joint_rates=still,
        joint_accelerations=still,
        joint_jerks=still,
        joint_snaps=still,
    )
    stiffness, damping = base_stiffness(par.recovery, par.model.vehicle.mass)
    base = govern_base(
        wanted, measurement, limits=par.limits, stiffness=stiffness, damping=damping, gravity=par.model.gravity
    )
    speeds = par.recovery.stow_speed
    return govern_joints(base, arm, still, speeds, still, dt, model=par.model, limits=par.limits)[0]


def limit_command(
    par: SafetyParameters, memory: SafetyMemory, measurement: Measurement, command: Command, dt: Any
) -> Command:
    """Return the command within its limits."""
    limits = par.limits
    held = within_efforts(limits, command.efforts)
    if held:
        held = within_efforts(limits, apply_joint_barrier(par.model, limits, measurement, held))
    turning = reachable(par.model, par.mixer, command.rotor_speeds)
    near = limit_slew(
        Command(rotor_speeds=turning, efforts=held),
        memory.sent,
        memory.started,
        limits.rotor_slew,
        limits.effort_slew,
        dt,
    )
    return rebuild(
        memory.sent,
        (where(absolute(a) < float("inf"), a, b) for a, b in zip(leaves(near), leaves(memory.sent), strict=True)),
    )
