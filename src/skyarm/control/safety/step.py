"""One period under guard, but for the law's own step: what it is asked before, and what is sent after."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from skyarm.actuation import Command
from skyarm.algebra import ZERO3, Vec3
from skyarm.compile import leaves, rebuild
from skyarm.control.geometric import yaw_of
from skyarm.control.safety.fence import fenced, within_efforts
from skyarm.control.safety.governor import governed_base, governed_joints
from skyarm.control.safety.memory import Guarded, GuardMemory, blend
from skyarm.control.safety.recovery import base_stiffness, recover
from skyarm.control.safety.saturation import reachable, slewed
from skyarm.control.safety.trust import doubted
from skyarm.dynamics.measurement import Measurement
from skyarm.reference import Reference
from skyarm.scalars import absolute, where


@dataclass(frozen=True, kw_only=True, slots=True)
class Asked:
    """What a law is asked.

    Attributes:
        reference: governed. ramping: 1 for each joint whose reference is on its way.
        joints: rad or m, where the governed references stood one period ago.
    """

    reference: Reference
    ramping: tuple[Any, ...]
    joints: tuple[Any, ...]


def asked(par: Guarded, memory: GuardMemory, measurement: Measurement, reference: Reference, dt: Any) -> Asked:
    """The governed reference."""
    limits = par.limits
    joints = _kept(memory.started > 0.5, memory.joints, measurement.joints)
    base = governed_base(
        reference,
        measurement,
        limits=limits,
        stiffness=limits.stiffness,
        damping=limits.damping,
        gravity=par.model.gravity,
    )
    governed, ramping = governed_joints(
        base, joints, memory.ramping, limits.joint_slew, limits.joint_step, dt, model=par.model, limits=limits
    )
    return Asked(reference=governed, ramping=ramping, joints=joints)


def decided(
    par: Guarded, memory: GuardMemory, measurement: Measurement, was: Asked, wished: Command, failed: Any, dt: Any
) -> GuardMemory:
    """The memory after a step, with what is sent and whether the law is given up; the law's own memory as it was.

    Args:
        par: constants.
        memory: before the step.
        measurement: now.
        was: asked of the law.
        wished: by the law.
        failed: whether what it gave cannot be used.
        dt: s.
    """
    doubt = doubted(par.limits, memory.doubt, measurement, was.joints, failed, dt)
    given_up, before = doubt.given_up > 0.5, memory.doubt.given_up > 0.5
    hold, yaw = _place(before, memory, measurement)
    arm = _kept(before, memory.arm, measurement.joints)
    hovering = _hold_reference(par, measurement, hold, yaw, arm, dt)
    rescue = recover(par.recovery, par.model, par.mixer, measurement, hovering)
    return GuardMemory(
        inner=memory.inner,
        started=memory.started * 0.0 + 1.0,
        joints=_kept(given_up, measurement.joints, was.reference.joints),
        ramping=_kept(given_up, (0.0,) * len(was.joints), was.ramping),
        arm=hovering.joints,
        sent=limited(par, memory, measurement, blend(given_up, rescue, wished), dt),
        doubt=doubt,
        hold=hold,
        yaw=yaw,
    )


def _kept(condition: Any, a: tuple[Any, ...], b: tuple[Any, ...]) -> tuple[Any, ...]:
    return tuple(where(condition, x, y) for x, y in zip(a, b, strict=True))


def _place(before: Any, memory: GuardMemory, measurement: Measurement) -> tuple[Vec3, Any]:
    """Where the recovery hovers and its heading: as found while the law flew, as kept since it was given up."""
    hold = Vec3(*_kept(before, tuple(memory.hold), tuple(measurement.position)))
    return hold, where(before, memory.yaw, yaw_of(measurement.quaternion))


def _hold_reference(par: Guarded, measurement: Measurement, hold: Vec3, yaw: Any, arm: Any, dt: Any) -> Reference:
    """What the recovery is asked: to hover, and to stow the arm."""
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
    base = governed_base(
        wanted, measurement, limits=par.limits, stiffness=stiffness, damping=damping, gravity=par.model.gravity
    )
    speeds = par.recovery.stow_speed
    return governed_joints(base, arm, still, speeds, still, dt, model=par.model, limits=par.limits)[0]


def limited(par: Guarded, memory: GuardMemory, measurement: Measurement, command: Command, dt: Any) -> Command:
    """What is sent in place of a command."""
    limits = par.limits
    held = within_efforts(limits, command.efforts)
    if held:
        held = within_efforts(limits, fenced(par.model, limits, measurement, held))
    turning = reachable(par.model, par.mixer, command.rotor_speeds)
    near = slewed(
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
