"""One name for a controller: a preset, a law with its defaults, or a law with its tuned gains."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from skyarm.control.controller import Controller, ControllerError
from skyarm.control.model import Model
from skyarm.control.presets import PRESETS, preset
from skyarm.control.registry import LAWS, make_controller, suited
from skyarm.control.tuned import tuned, tuned_factors
from skyarm.files import shown

TUNED = "_tuned"
"""Ending of a law's name that stands for its tuned gains."""


def is_named(name: Any) -> bool:
    """True if there is a controller of this name."""
    return isinstance(name, str) and (name in PRESETS or name in LAWS or name.removesuffix(TUNED) in _tuned(name))


def choices() -> str:
    """The names there are, in words."""
    without = ", ".join(law for law in LAWS if law not in tuned_factors())
    return (
        f"a preset ({', '.join(PRESETS)}), a law ({', '.join(LAWS)}), "
        f"or LAW{TUNED} for its tuned gains, which all laws have but {without}"
    )


def named(name: str, model: Model, known: Mapping[str, Any] | None = None) -> Controller:
    """A controller by one name, with default options.

    Args:
        name: a key of ``PRESETS`` or ``LAWS``, or that of a tuned law and ``TUNED``.
        model: what it believes.
        known: what a law may know of its loop (:func:`skyarm.control.presets.preset`).

    Raises:
        ControllerError: unknown name, or a controller that does not fit the model.
        AllocationError: the model's rotors do not span torque and thrust.
    """
    if not is_named(name):
        raise ControllerError(f"controller = {shown(name)}: must be {choices()}")
    if name in PRESETS:
        return preset(name, model, known)
    law = name if name in LAWS else name.removesuffix(TUNED)
    make = make_controller if name in LAWS else tuned
    return make(law, model, **suited(law, known or {}))


def _tuned(name: str) -> Mapping[str, Any]:
    """The tuned laws, if a name ends as theirs do."""
    return tuned_factors() if name.endswith(TUNED) else {}
