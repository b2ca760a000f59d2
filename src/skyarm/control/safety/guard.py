"""A law under guard: one step of reference governor, law, doubt, recovery and command limits."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from skyarm.actuation import Command, Mixer
from skyarm.algebra import ZERO3, Vec3
from skyarm.compile import leaves, rebuild
from skyarm.control.controller import Controller, ControllerError, informed
from skyarm.control.geometric import yaw_of
from skyarm.control.model import Model
from skyarm.control.paper import default_gains, default_joint_gains
from skyarm.control.safety.fence import fenced, within_efforts
from skyarm.control.safety.governor import governed_base, governed_joints
from skyarm.control.safety.limits import Limits, limits_for
from skyarm.control.safety.recovery import Recovery, base_stiffness, recover, stowed
from skyarm.control.safety.saturation import ranked, reachable, slewed
from skyarm.control.safety.trust import Doubt, doubted, finite
from skyarm.dynamics.measurement import Measurement
from skyarm.files import number, shown
from skyarm.reference import Reference
from skyarm.scalars import Scalar, absolute, logical_or, where
from skyarm.vehicle.records import Link

STOW_SPEEDS = {"revolute": 1.0, "prismatic": 0.1}
"""rad/s and m/s: the arm's way to its stowed pose hardly moves the base."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Guarded:
    """Constants of a guarded law: one belief for all, and the law's own constants without theirs.

    Attributes:
        model: belief. mixer: its rotors, with priorities where they allow them.
        limits: of what is asked and sent. recovery: what flies when the law is given up.
        inner: constants of the law; its model and mixer are those above, given to it at each call.
    """

    model: Model
    mixer: Mixer
    limits: Limits
    recovery: Recovery
    inner: Any


@dataclass(frozen=True, kw_only=True, slots=True)
class GuardMemory:
    """What a guarded law keeps.

    Attributes:
        inner: memory of the law.
        started: 0 before the first step.
        joints: rad or m, governed references of the law. ramping: 1 where one is on its way.
        arm: those of the recovery.
        sent: the last command.
        doubt: of the law. hold: m, where the recovery hovers. yaw: rad, its heading.
    """

    inner: Any
    started: Scalar
    joints: tuple[Scalar, ...]
    ramping: tuple[Scalar, ...]
    arm: tuple[Scalar, ...]
    sent: Command
    doubt: Doubt
    hold: Vec3
    yaw: Scalar


def guarded(
    controller: Controller, limits: Limits | Mapping[str, Any] | None = None, *, stow: tuple[float, ...] | None = None
) -> Controller:
    """The controller under guard.

    In order, each period: the reference is governed (:mod:`skyarm.control.safety.governor`); the law steps on it; if
    it is given up (:mod:`skyarm.control.safety.trust`) the recovery flies in its place, the arm on its way to ``stow``;
    the joints are kept from their limits, efforts and rotor speeds brought within theirs, yaw given up first; changes
    from the last command are bounded; a number that is not finite becomes the last one sent. The law's memory is told
    what was sent (:func:`skyarm.control.controller.informed`).

    A law given up starts anew, from its first memory, after ``limits.calm`` seconds of calm flight; by default it does
    not come back. A measurement that is not finite changes nothing: the last command stands.

    Args:
        controller: any law over scalars. Its own constants are then found under ``controller.inner``.
        limits: or some of their fields; the others are :func:`skyarm.control.safety.limits.limits_for`'s.
        stow: rad or m, pose of the arm when the law is given up; the middle of each joint's range if left out, zero for
            a joint without limits.

    Raises:
        ControllerError: limits or a pose that do not fit, a law that is not over scalars, or a controller that is
            guarded already.
    """
    controller.require_compiled("the safety layer")
    if isinstance(controller.par, Guarded):
        raise ControllerError(f"controller = {controller.name!r}: is guarded already")
    model: Model = controller.par.model
    chosen = limits if isinstance(limits, Limits) else limits_for(controller, **(limits or {}))
    links = model.vehicle.links
    pose = tuple(stowed(link.joint) for link in links) if stow is None else _pose(stow, links)
    recovery = Recovery(
        gains=default_gains(model),
        joint_gains=default_joint_gains("decoupled_pd", model),
        stow=pose,
        stow_speed=tuple(STOW_SPEEDS[link.joint.kind] for link in links),
    )
    par = Guarded(
        model=model,
        mixer=ranked(model, controller.par.mixer),
        limits=chosen,
        recovery=recovery,
        inner=dataclasses.replace(controller.par, model=None, mixer=None),
    )
    return Controller(name=f"guarded_{controller.name}", law=_law_of(controller), par=par, memory=_first(controller))


def _pose(stow: Any, links: tuple[Link, ...]) -> tuple[float, ...]:
    """A pose within the joints' limits."""
    listed = stow if isinstance(stow, (str, bytes)) or not hasattr(stow, "__iter__") else list(stow)
    if not isinstance(listed, list) or len(listed) != len(links):
        raise ControllerError(f"safety.stow = {shown(listed)}: must be {len(links)} numbers, one per joint")
    found = []
    for i, (value, link) in enumerate(zip(listed, links, strict=True)):
        at, low, high = f"safety.stow[{i}]", float(link.joint.lower), float(link.joint.upper)
        try:
            held = number(value, at)
        except ValueError as error:
            raise ControllerError(str(error)) from None
        if not low <= held <= high:
            raise ControllerError(f"{at} = {value!r}: must be within the joint's limits, {low:g} to {high:g}")
        found.append(held)
    return tuple(found)


def _first(controller: Controller) -> GuardMemory:
    vehicle = controller.par.model.vehicle
    still = (0.0,) * vehicle.n
    return GuardMemory(
        inner=controller.memory,
        started=0.0,
        joints=still,
        ramping=still,
        arm=still,
        sent=Command(rotor_speeds=(0.0,) * len(vehicle.rotors), efforts=still),
        doubt=Doubt(given_up=0.0, outside=0.0, calm=0.0),
        hold=Vec3(0.0, 0.0, 0.0),
        yaw=0.0,
    )


def _law_of(controller: Controller) -> Any:
    """The step function of a guarded law."""
    inner, first, margin = controller.law, controller.memory, controller.margin

    def guarded_law(
        memory: GuardMemory, measurement: Measurement, reference: Reference, dt: Any, *, par: Guarded
    ) -> tuple[GuardMemory, Command]:
        """A law under guard: its reference governed, its commands limited, a recovery in its place if it fails."""
        joints = _kept(memory.started > 0.5, memory.joints, measurement.joints)
        asked, ramping = _law_reference(par, measurement, reference, joints, memory.ramping, dt)
        own = dataclasses.replace(par.inner, model=par.model, mixer=par.mixer)
        following, wished = inner(memory.inner, measurement, asked, dt, par=own)
        failed = logical_or(not_finite(wished), not_finite(following))
        if margin is not None:
            failed = logical_or(failed, margin(measurement.quaternion) < 0.0)
        doubt = doubted(par.limits, memory.doubt, measurement, joints, failed, dt)
        given_up, before = doubt.given_up > 0.5, memory.doubt.given_up > 0.5
        hold, yaw = _place(before, memory, measurement)
        arm = _kept(before, memory.arm, measurement.joints)
        hovering = _hold_reference(par, measurement, hold, yaw, arm, dt)
        rescue = recover(par.recovery, par.model, par.mixer, measurement, hovering)
        command = limited(par, memory, measurement, blend(given_up, rescue, wished), dt)
        new = GuardMemory(
            # the law starts anew when it comes back
            inner=informed(blend(given_up, first, following), command),
            started=memory.started * 0.0 + 1.0,
            joints=_kept(given_up, measurement.joints, asked.joints),
            ramping=_kept(given_up, (0.0,) * len(joints), ramping),
            arm=hovering.joints,
            sent=command,
            doubt=doubt,
            hold=hold,
            yaw=yaw,
        )
        return blend(finite(measurement), new, memory), command

    return guarded_law


def blend(condition: Any, new: Any, old: Any) -> Any:
    """``new`` where the condition holds, else ``old``, leaf by leaf."""
    dense_new, dense_old = _dense(new), _dense(old)
    return rebuild(
        dense_old, (where(condition, a, b) for a, b in zip(leaves(dense_new), leaves(dense_old), strict=True))
    )


def _dense(record: Any) -> Any:
    """A command with structural zeros as data, as a law with free joints sends them; other records as they are."""
    if not isinstance(record, Command):
        return record
    data = (tuple(float(v) if type(v) is int else v for v in row) for row in (record.rotor_speeds, record.efforts))
    return Command(**dict(zip(("rotor_speeds", "efforts"), data, strict=True)))


def not_finite(record: Any) -> Any:
    """True where any number of a record is infinite or NaN."""
    return where(finite(record), False, True)


def _kept(condition: Any, a: tuple[Any, ...], b: tuple[Any, ...]) -> tuple[Any, ...]:
    return tuple(where(condition, x, y) for x, y in zip(a, b, strict=True))


def _place(before: Any, memory: GuardMemory, measurement: Measurement) -> tuple[Vec3, Any]:
    """Where the recovery hovers and its heading: as found while the law flew, as kept since it was given up."""
    hold = Vec3(*_kept(before, tuple(memory.hold), tuple(measurement.position)))
    return hold, where(before, memory.yaw, yaw_of(measurement.quaternion))


def _law_reference(
    par: Guarded, measurement: Measurement, reference: Reference, joints: Any, ramping: Any, dt: Any
) -> tuple[Reference, tuple[Any, ...]]:
    """What the law is asked, and which joints' references are on their way."""
    limits = par.limits
    base = governed_base(
        reference,
        measurement,
        limits=limits,
        stiffness=limits.stiffness,
        damping=limits.damping,
        gravity=par.model.gravity,
    )
    return governed_joints(
        base, joints, ramping, limits.joint_slew, limits.joint_step, dt, model=par.model, limits=limits
    )


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
