"""Controllers: a control law's step function, its constants and its initial internal
state.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any, TypeVar

from skyarm.algebra import Quaternion, Scalar, Scalars
from skyarm.algebra.scalars import logical_and, where
from skyarm.dynamics.actuators import Command
from skyarm.records.coerce import RecordError
from skyarm.records.field_rules import accept_fields, require_fields
from skyarm.records.files import errors_as
from skyarm.records.immutable import field_if_any, immutable
from skyarm.records.leaves import Dataclass, Tree, is_record
from skyarm.vehicle import Vehicle

Memory = TypeVar("Memory")

LawOptions = Mapping[str, Any]
"""Options of a control law by name, from a file or a call, not yet checked."""

OptionRanges = Mapping[str, tuple[float | tuple[float, ...], float, float]]
"""Default, least and largest value of each option of a control law."""

Law = Callable[..., tuple[Any, Command]]
"""Signature of a control law: step(memory, measurement, reference, dt, *, par) ->
(memory, command)."""


class ControllerError(ValueError):
    """Error: invalid description of a controller."""


@immutable
class Controller:
    """Control law as a step function, with its constants and its initial internal
    state.

    Attributes:
        name: name of the law. law: step function. memory: initial internal state.
        par: its constants: a frozen record with at least ``model``
            (:class:`skyarm.control.model.Model`) and ``mixer``
            (:class:`skyarm.dynamics.actuators.Mixer`), so that the model can be varied
            whatever the law.
        margin: distance of an attitude (quaternion) to where the law is not defined,
            negative beyond; None if it is defined everywhere.
        limit: text that describes that place.
        compiled: the law is traceable, so that machine code, C and other engines can be
            made of it; a law that is not is called with floats.
        keeps_tip: the law takes the joints from their references to keep the tip on its
            own.
        sees: names of the sensors whose pictures the law receives, in this order, as
            ``measurement.images``.
    """

    name: str
    law: Law
    par: Any
    memory: Any = ()
    margin: Callable[[Quaternion], Scalar] | None = None
    limit: str = ""
    compiled: bool = True
    keeps_tip: bool = False
    sees: tuple[str, ...] = field_if_any(default=())

    def __post_init__(self) -> None:
        with errors_as(ControllerError, of=RecordError):
            accept_fields(self, "controller")
            # vehicles are checked where they are made
            require_fields(_whole(self.par), "controller", (Vehicle,))
            require_fields(self.memory, "controller.memory", (Vehicle,))

    def require_compiled(self, what: str) -> None:
        """Raise an error, naming the feature ``what``, if an autopilot flies, or
        the law sees pictures or cannot be traced.

        Raises:
            ControllerError: the law sees pictures or cannot be traced, or a program of
                its own flies the base.
        """
        if (autopilot := autopilot_of(self)) is not None:
            raise ControllerError(
                f"autopilot {autopilot.name!r}: flies alone and at its own pace, {what}"
                " needs a law"
            )
        if self.sees:
            raise ControllerError(
                f"controller '{self.name}': sees {', '.join(self.sees)}, {what} has no"
                " pictures; fly it by skyarm.run or a Session"
            )
        self.require_traceable(what)

    def require_traceable(self, what: str) -> None:
        """Raise an error, naming the feature ``what``, if the control law cannot be
        traced.

        Raises:
            ControllerError: the law cannot be traced.
        """
        if not self.compiled:
            raise ControllerError(
                f"controller '{self.name}': its law cannot be traced, {what} needs a"
                " traceable law"
            )


def _whole(par: Any) -> Any:
    """Constants of nested law layers with the outermost model and mixer filled in at
    every level.
    """
    inner = getattr(par, "inner", None)
    if inner is None or getattr(inner, "model", par) is not None:
        return par
    # inside a layer both are None, so that a changed model is one number for all
    # layers; the check of fields would refuse None
    filled = replace(inner, model=par.model, mixer=par.mixer)
    return replace(par, inner=_whole(filled))


def layers(record: Any) -> Iterator[Any]:
    """Constants or internal states of a law's layers, the outermost first, and at last
    of the law itself.
    """
    yield record
    if is_record(inner := getattr(record, "inner", None)):
        yield from layers(inner)


def innermost(record: Any) -> Any:
    """Constants or internal state of the control law inside all layers such as safety
    or servos.

    Layers share model and mixer, which stand with the outermost and are None in what
    this gives.
    """
    *_, own = layers(record)
    return own


def with_innermost(record: Any, own: Tree) -> Any:
    """Replace the constants (or internal state) of the control law inside all layers
    such as safety or servos.
    """
    inner = getattr(record, "inner", None)
    return (
        replace(record, inner=with_innermost(inner, own)) if is_record(inner) else own
    )


def with_applied_command(memory: Any, sent: Command) -> Any:
    """Internal state of a law, with its stored commands replaced by the applied ones if
    it stores any.

    A law that observes or integrates must know the applied command, not the desired
    one. It keeps them in a field ``sent`` of its memory: one :class:`Command`, or a
    tuple of them with the newest last. Whoever alters a command on its way (saturation,
    slew, fallback) writes the changed one there; a law without the field is left as it
    is.

    A law that integrates has a field ``applied`` too, in which it writes
    :func:`all_applied`: here the actuators whose command was changed become 0, and the
    law's integrators stand still for them in the next period.
    """
    commands = _stored_commands(memory)
    if not commands:
        return memory
    # older commands are those that were applied already: only the newest was altered
    kept = (*commands[:-1], sent) if isinstance(memory.sent, tuple) else sent
    updated = replace(memory, sent=kept)
    if not hasattr(memory, "applied"):
        return updated
    desired = commands[-1]
    # all rotors together, because each one bears part of every torque and of the thrust
    rotors: Scalar = True
    for a, b in zip(desired.rotor_speeds, sent.rotor_speeds, strict=True):
        rotors = logical_and(rotors, logical_and(a <= b, a >= b))
    joints = (
        logical_and(a <= b, a >= b)
        for a, b in zip(desired.efforts, sent.efforts, strict=True)
    )
    flags = tuple(where(same, 1.0, 0.0) for same in (rotors, *joints))
    return replace(updated, applied=flags)


def _stored_commands(memory: Any) -> tuple[Command, ...]:
    """Commands that a law's internal state stores, the newest last; empty if none."""
    stored = getattr(memory, "sent", ())
    commands = stored if isinstance(stored, tuple) else (stored,)
    # a user's law may use the name for something else
    return commands if all(isinstance(each, Command) for each in commands) else ()


def with_correction(memory: Any, par: Any, own: Command, sent: Command) -> Any:
    """Internal state of a law inside any layers after its command ``own`` was corrected
    to ``sent``.

    A layer that converts commands has a method ``inside`` in its memory: constants of
    the layer and a command -> that command in the units of the law inside. Each stored
    command moves by the correction, so that without one none does, and flags that a
    layer has cleared stay cleared.
    """
    if is_record(inner := getattr(memory, "inner", None)):
        inside = getattr(memory, "inside", lambda _, command: command)
        within = with_correction(inner, par.own, inside(par, own), inside(par, sent))
        memory = replace(memory, inner=within)
    commands = _stored_commands(memory)
    if not commands:
        return memory
    following = with_applied_command(memory, _shifted(commands[-1], own, sent))
    if not hasattr(memory, "applied"):
        return following
    flags = zip(memory.applied, following.applied, strict=True)
    return replace(following, applied=tuple(before * now for before, now in flags))


def _shifted(stored: Command, own: Command, sent: Command) -> Command:
    """Stored command plus a correction, and the corrected command itself where it
    stores what the law commanded.
    """

    def shift(before: Scalars, old: Scalars, new: Scalars) -> Scalars:
        rows = zip(before, old, new, strict=True)
        return tuple(
            # equal by two comparisons, as == of a traced number is refused; there the
            # sum would round, so the corrected command itself is taken
            where(logical_and(a <= b, a >= b), c, a + (c - b))
            for a, b, c in rows
        )

    return replace(
        stored,
        rotor_speeds=shift(stored.rotor_speeds, own.rotor_speeds, sent.rotor_speeds),
        efforts=shift(stored.efforts, own.efforts, sent.efforts),
    )


def part_of(record: Tree, name: str) -> Any:
    """Constants or internal state of one part of a control law, such as "load"; None if
    the law has no such part.
    """
    own = innermost(record)
    return getattr(getattr(own, "parts", own), name, None)


def preview_leads(par: Dataclass) -> Scalars:
    """Lead times (s) of the future reference samples that a law, inside any layers,
    uses; empty without a preview.
    """
    return getattr(innermost(par), "preview", ())


def follows_plan(par: Dataclass) -> bool:
    """True if a law, inside any layers, follows the whole state of a plan."""
    return getattr(innermost(par), "mode", "") == "plan"


def presses(par: Dataclass) -> bool:
    """True if a law, inside any layers, controls contact forces that a reference
    requests.
    """
    return part_of(par, "interaction") is not None


def senses_force(par: Dataclass) -> bool:
    """True if a law, inside any layers, uses a force sensor at the tip."""
    parts = (part_of(par, part) for part in ("interaction", "admittance"))
    return any(getattr(part, "sensing", None) is not None for part in parts)


def learns_load(par: Dataclass) -> bool:
    """True if a law, inside any layers, estimates the load at the tip that a reference
    announces.
    """
    return hasattr(part_of(par, "load"), "limit")


def autopilot_of(controller: Controller) -> Any:
    """Autopilot program that flies the base in the law's place
    (:mod:`skyarm.links.autopilots`); None for a law.
    """
    return getattr(innermost(controller.par), "autopilot", None)


def all_applied(joints: int) -> tuple[float, ...]:
    """Initial flags, all 1, for the rotors together and for each joint: every command
    was applied as desired.

    A law whose memory has a field ``sent`` stores its command there, and the safety
    layer writes the applied one into it. A law that integrates also has a field
    ``applied`` and sets all its flags to 1 in each period; the layer sets those of
    altered commands to 0. Here an integral over the rotors stands still meanwhile::

        rotors, *joints = memory.applied  # flags of the last command
        integral = memory.integral + rotors * error * dt
        flags = all_applied(len(joints))
        memory = replace(memory, integral=integral, sent=command, applied=flags)

    The layer measures a law's default stiffness and damping with its first memory. If a
    law begins with lower gains, a method ``after_start`` of that memory returns the
    memory after that.
    """
    return (1.0,) * (1 + joints)
