"""The safety layer around any controller: reference governor, law, supervisor, recovery and command limits."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from skyarm.actuation import Command
from skyarm.control.blocks.default_gains import default_gains, default_joint_gains
from skyarm.control.controller import Controller, ControllerError, Law, with_applied_command
from skyarm.control.law_checks import LawError, check_controller, checked_law, wrong
from skyarm.control.model import Model
from skyarm.control.safety.command_limits import with_priorities
from skyarm.control.safety.limits import Limits, limits_for
from skyarm.control.safety.memory import SafetyMemory, SafetyParameters, blend_dense, first_memory
from skyarm.control.safety.recovery import STOW_SPEEDS, Recovery, pose_of, stowed
from skyarm.control.safety.step import arbitrate, govern
from skyarm.control.safety.supervisor import finite, not_finite
from skyarm.control.vectored_layer import VectoredParameters, law_inside, with_tilting
from skyarm.files import shown
from skyarm.records.coerce import RecordError
from skyarm.records.leaves import parts
from skyarm.reference import Reference
from skyarm.scalars import logical_or
from skyarm.sensors.measurement import Measurement

FAILURES = (ArithmeticError, ValueError, RuntimeError)
"""What numbers and solvers raise, numpy's LinAlgError among them; other exceptions are mistakes in a law's code."""


def with_safety_layer(
    controller: Controller, limits: Limits | Mapping[str, Any] | None = None, *, stow: tuple[float, ...] | None = None
) -> Controller:
    """Return the controller with the safety layer around it.

    In order, each period: the reference is governed (:mod:`skyarm.control.safety.governor`); the law steps on it; if
    it is given up (:mod:`skyarm.control.safety.supervisor`) the recovery flies in its place, the arm on its way to
    ``stow``; the joints are kept from their limits, efforts and rotor speeds brought within theirs, yaw given up
    first; changes from the last command are bounded; a number that is not finite becomes the last one sent. The law's
    memory gets the applied command (:func:`skyarm.control.controller.with_applied_command`).

    A law given up starts anew, from its first memory, after ``limits.calm`` seconds of calm flight; by default it does
    not come back. A measurement that is not finite changes nothing: the last command stands.

    A law that cannot be traced gets the layer as well, in Python. Of its memory, which may be anything, nothing is
    looked at; an error of its numbers or its solver (``FAILURES``, a record refused among them) gives it up; while the
    recovery flies it is not called.

    Args:
        controller: any law. Its own constants are then found under ``controller.inner``.
        limits: or some of their fields; the others are :func:`skyarm.control.safety.limits.limits_for`'s.
        stow: rad or m, pose of the arm when the law is given up; the middle of each joint's range if left out, zero for
            a joint without limits.

    Raises:
        ControllerError: no controller, one that has a safety layer already, or limits or a pose that do not fit.
    """
    if not isinstance(controller, Controller):
        raise ControllerError(f"controller = {shown(controller)}: must be a Controller")
    if isinstance(controller.par, SafetyParameters):
        raise ControllerError(f"controller = {controller.name!r}: has a safety layer already")
    check_controller(controller)
    if isinstance(controller.par, VectoredParameters):
        inside = with_safety_layer(law_inside(controller), limits, stow=stow)
        return with_tilting(inside, controller.par.model)
    if not hasattr(controller.par, "mixer"):
        raise wrong(controller, "has constants without a Mixer: par.mixer must be one for a law with a safety layer")
    model: Model = controller.par.model
    links = model.vehicle.links
    recovery = Recovery(
        gains=default_gains(model),
        joint_gains=default_joint_gains("decoupled_pd", model),
        stow=tuple(stowed(link.joint) for link in links) if stow is None else pose_of(stow, links),
        stow_speed=tuple(STOW_SPEEDS[link.joint.kind] for link in links),
    )
    par = SafetyParameters(
        model=model,
        mixer=with_priorities(model, controller.par.mixer),
        limits=_limits(controller, limits),
        recovery=recovery,
        inner=dataclasses.replace(controller.par, model=None, mixer=None),
    )
    return Controller(
        name=f"guarded_{controller.name}",
        law=_layer(controller),
        par=par,
        memory=first_memory(controller),
        compiled=controller.compiled,
    )


def _limits(controller: Controller, limits: Any) -> Limits:
    """Limits as given, checked, the rest by default."""
    if limits is None:
        return limits_for(controller)
    if isinstance(limits, Limits):
        return limits_for(controller, **parts(limits))
    if isinstance(limits, Mapping):
        return limits_for(controller, **limits)
    raise ControllerError(f"safety = {shown(limits)}: must be Limits or a mapping of some of their fields")


def _layer(controller: Controller) -> Law:
    """The step function with the safety layer; a partial function of the module, so that a record can be read back."""
    step = _traced_law if controller.compiled else _called_law
    return partial(step, inner=checked_law(controller), first=controller.memory, margin=controller.margin)


def _traced_law(
    memory: SafetyMemory,
    measurement: Measurement,
    reference: Reference,
    dt: Any,
    *,
    par: SafetyParameters,
    inner: Law,
    first: Any,
    margin: Callable[[Any], Any] | None,
) -> tuple[SafetyMemory, Command]:
    """A traceable law with the safety layer: reference governed, commands limited, a recovery in its place if it fails.

    ``inner`` is the law, ``first`` its first memory and ``margin`` its distance to where it is not defined.
    """
    governed = govern(par, memory, measurement, reference, dt)
    following, desired = inner(memory.inner, measurement, governed.reference, dt, par=_own(par))
    failed = logical_or(not_finite(desired), not_finite(following))
    if margin is not None:
        failed = logical_or(failed, margin(measurement.quaternion) < 0.0)
    new = arbitrate(par, memory, measurement, governed, desired, failed, dt)
    # the law starts anew when it comes back
    kept = blend_dense(new.confidence.given_up > 0.5, first, following)
    new = dataclasses.replace(new, inner=with_applied_command(kept, new.sent))
    seen = finite(measurement)
    return blend_dense(seen, new, memory), blend_dense(seen, new.sent, memory.sent)


def _called_law(
    memory: SafetyMemory,
    measurement: Measurement,
    reference: Reference,
    dt: float,
    *,
    par: SafetyParameters,
    inner: Law,
    first: Any,
    margin: Callable[[Any], Any] | None,
) -> tuple[SafetyMemory, Command]:
    """The same for a law that is called with floats and keeps a memory of any kind."""
    if not finite(measurement):
        return memory, memory.sent
    governed = govern(par, memory, measurement, reference, dt)
    following, desired, failed = first, memory.sent, False
    # from its first memory a law may have much to prepare, in vain while the recovery flies
    if memory.confidence.given_up < 0.5:
        try:
            following, desired = inner(memory.inner, measurement, governed.reference, dt, par=_own(par))
            failed = not finite(desired) or (margin is not None and margin(measurement.quaternion) < 0.0)
        except LawError as error:
            # a mistake in its code, but for a record that its numbers do not make
            if not isinstance(error.__cause__, RecordError):
                raise
            failed = True
        except FAILURES:
            failed = True
    new = arbitrate(par, memory, measurement, governed, desired, failed, dt)
    kept = first if new.confidence.given_up > 0.5 else following
    return dataclasses.replace(new, inner=with_applied_command(kept, new.sent)), new.sent


def _own(par: SafetyParameters) -> Any:
    """Constants of the law, with the belief of all."""
    return dataclasses.replace(par.inner, model=par.model, mixer=par.mixer)
