"""A law ready to fly: step function, constants, first memory."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

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
        compiled: the law is over scalars, so that machine code, C and other engines can be made of it.
    """

    name: str
    law: Law
    par: Any
    memory: Any = ()
    margin: Callable[[Any], Any] | None = None
    limit: str = ""
    compiled: bool = True
