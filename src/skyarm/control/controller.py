"""A law ready to fly: step function, constants, first memory."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from skyarm.actuation import Command
from skyarm.scalars import logical_and, where

Law = Callable[..., tuple[Any, Any]]
"""step(memory, measurement, reference, dt, *, par) -> (memory, command)."""


class ControllerError(ValueError):
    """A controller's description is wrong."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Controller:
    """A law ready to fly.

    Attributes:
        name: of the law. law: the step function. memory: its first memory.
        par: its constants: a frozen record with at least ``model`` (:class:`skyarm.control.model.Model`) and ``mixer``
            (:class:`skyarm.actuation.Mixer`), so that beliefs can be varied whatever the law.
        margin: distance of an attitude (quaternion) to where the law is not defined, negative beyond; None if it is
            defined everywhere.
        limit: that place in words.
        compiled: the law is over scalars, so that machine code, C and other engines can be made of it; a law that is
            not is called with floats.
        keeps_tip: the law takes the joints from their references to keep the tip on its own.
    """

    name: str
    law: Law
    par: Any
    memory: Any = ()
    margin: Callable[[Any], Any] | None = None
    limit: str = ""
    compiled: bool = True
    keeps_tip: bool = False

    def require_compiled(self, what: str) -> None:
        """Refuse a law that cannot be traced for something that needs it traced.

        Raises:
            ControllerError: the law is not over scalars.
        """
        if not self.compiled:
            raise ControllerError(f"controller '{self.name}': its law is not over scalars, {what} needs one that is")


def informed(memory: Any, sent: Command) -> Any:
    """The memory with the command that was really sent, if the law keeps one.

    A law that observes or integrates must know what acted, not what it wished. It keeps its commands in a field
    ``sent`` of its memory: one :class:`Command`, or a tuple of them with the newest last. Whoever changes a command on
    its way (saturation, slew, fallback) writes the changed one there; a law without the field is left as it is.

    A law that integrates has a field ``obeyed`` too, in which it writes :func:`all_obeyed`: here the actuators whose
    command was changed become 0, and the law's integrators stand still for them in the next period.
    """
    kept = getattr(memory, "sent", None)
    if isinstance(kept, Command):
        wished, told = kept, dataclasses.replace(memory, sent=sent)
    elif isinstance(kept, tuple) and kept and all(isinstance(each, Command) for each in kept):
        wished, told = kept[-1], dataclasses.replace(memory, sent=(*kept[:-1], sent))
    else:
        return memory
    return dataclasses.replace(told, obeyed=_obeyed(wished, sent)) if hasattr(memory, "obeyed") else told


def all_obeyed(joints: int) -> tuple[float, ...]:
    """1 for the rotors together and 1 for each joint: every command was sent as wished."""
    return (1.0,) * (1 + joints)


def _obeyed(wished: Command, sent: Command) -> tuple[Any, ...]:
    """1 for the rotors, and for each joint, whose commands are the wished ones; else 0, as for a wish that is NaN."""
    rotors: Any = True
    for a, b in zip(wished.rotor_speeds, sent.rotor_speeds, strict=True):
        rotors = logical_and(rotors, logical_and(a <= b, a >= b))
    joints = (logical_and(a <= b, a >= b) for a, b in zip(wished.efforts, sent.efforts, strict=True))
    return tuple(where(same, 1.0, 0.0) for same in (rotors, *joints))
