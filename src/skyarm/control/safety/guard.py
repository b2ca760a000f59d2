"""A law under guard: reference governor, law, doubt, recovery and command limits around any controller."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

from skyarm.actuation import Command
from skyarm.control.controller import Controller, ControllerError, Law, informed
from skyarm.control.model import Model
from skyarm.control.paper import default_gains, default_joint_gains
from skyarm.control.safety.limits import Limits, limits_for
from skyarm.control.safety.memory import Guarded, GuardMemory, blend, first_memory
from skyarm.control.safety.recovery import STOW_SPEEDS, Recovery, pose_of, stowed
from skyarm.control.safety.saturation import ranked
from skyarm.control.safety.step import asked, decided
from skyarm.control.safety.trust import finite, not_finite
from skyarm.dynamics.measurement import Measurement
from skyarm.files import shown
from skyarm.reference import Reference
from skyarm.scalars import logical_or

FAILURES = (ArithmeticError, ValueError, RuntimeError)
"""What numbers and solvers raise, numpy's LinAlgError among them; other exceptions are mistakes in a law's code."""


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

    A law that is not over scalars is guarded as well, in Python. Of its memory, which may be anything, nothing is
    looked at; an error of its numbers or its solver (``FAILURES``) gives it up; while the recovery flies it is not
    called.

    Args:
        controller: any law. Its own constants are then found under ``controller.inner``.
        limits: or some of their fields; the others are :func:`skyarm.control.safety.limits.limits_for`'s.
        stow: rad or m, pose of the arm when the law is given up; the middle of each joint's range if left out, zero for
            a joint without limits.

    Raises:
        ControllerError: no controller, one that is guarded already, or limits or a pose that do not fit.
    """
    if not isinstance(controller, Controller):
        raise ControllerError(f"controller = {shown(controller)}: must be a Controller")
    if isinstance(controller.par, Guarded):
        raise ControllerError(f"controller = {controller.name!r}: is guarded already")
    model: Model = controller.par.model
    links = model.vehicle.links
    recovery = Recovery(
        gains=default_gains(model),
        joint_gains=default_joint_gains("decoupled_pd", model),
        stow=tuple(stowed(link.joint) for link in links) if stow is None else pose_of(stow, links),
        stow_speed=tuple(STOW_SPEEDS[link.joint.kind] for link in links),
    )
    par = Guarded(
        model=model,
        mixer=ranked(model, controller.par.mixer),
        limits=_limits(controller, limits),
        recovery=recovery,
        inner=dataclasses.replace(controller.par, model=None, mixer=None),
    )
    return Controller(
        name=f"guarded_{controller.name}",
        law=_traced(controller) if controller.compiled else _called(controller),
        par=par,
        memory=first_memory(controller),
        compiled=controller.compiled,
    )


def _limits(controller: Controller, limits: Any) -> Limits:
    """Limits as given, checked, the rest by default."""
    if limits is None:
        return limits_for(controller)
    if isinstance(limits, Limits):
        return limits_for(
            controller, **{field.name: getattr(limits, field.name) for field in dataclasses.fields(Limits)}
        )
    if isinstance(limits, Mapping):
        return limits_for(controller, **limits)
    raise ControllerError(f"safety = {shown(limits)}: must be Limits or a mapping of some of their fields")


def _traced(controller: Controller) -> Law:
    """The step function of a guarded law over scalars."""
    inner, first, margin = controller.law, controller.memory, controller.margin

    def guarded_law(
        memory: GuardMemory, measurement: Measurement, reference: Reference, dt: Any, *, par: Guarded
    ) -> tuple[GuardMemory, Command]:
        """A law under guard: its reference governed, its commands limited, a recovery in its place if it fails."""
        was = asked(par, memory, measurement, reference, dt)
        following, wished = inner(memory.inner, measurement, was.reference, dt, par=_own(par))
        failed = logical_or(not_finite(wished), not_finite(following))
        if margin is not None:
            failed = logical_or(failed, margin(measurement.quaternion) < 0.0)
        new = decided(par, memory, measurement, was, wished, failed, dt)
        # the law starts anew when it comes back
        kept = blend(new.doubt.given_up > 0.5, first, following)
        new = dataclasses.replace(new, inner=informed(kept, new.sent))
        seen = finite(measurement)
        return blend(seen, new, memory), blend(seen, new.sent, memory.sent)

    return guarded_law


def _called(controller: Controller) -> Law:
    """The step function of a guarded law that is called with floats and keeps a memory of any kind."""
    inner, first, margin = controller.law, controller.memory, controller.margin

    def guarded_law(
        memory: GuardMemory, measurement: Measurement, reference: Reference, dt: float, *, par: Guarded
    ) -> tuple[GuardMemory, Command]:
        """A law under guard: its reference governed, its commands limited, a recovery in its place if it fails."""
        if not finite(measurement):
            return memory, memory.sent
        was = asked(par, memory, measurement, reference, dt)
        following, wished, failed = first, memory.sent, False
        # from its first memory a law may have much to prepare, in vain while the recovery flies
        if memory.doubt.given_up < 0.5:
            try:
                following, wished = inner(memory.inner, measurement, was.reference, dt, par=_own(par))
                failed = not finite(wished) or (margin is not None and margin(measurement.quaternion) < 0.0)
            except FAILURES:
                failed = True
        new = decided(par, memory, measurement, was, wished, failed, dt)
        kept = first if new.doubt.given_up > 0.5 else following
        return dataclasses.replace(new, inner=informed(kept, new.sent)), new.sent

    return guarded_law


def _own(par: Guarded) -> Any:
    """Constants of the law, with the belief of all."""
    return dataclasses.replace(par.inner, model=par.model, mixer=par.mixer)
