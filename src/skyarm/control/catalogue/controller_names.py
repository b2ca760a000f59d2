"""A controller by one name: a preset, a law with its defaults, or a law with its tuned gains; aliases, old names."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from skyarm.control.catalogue.law_entries import LAWS, canonical_law, make_controller, suitable_options
from skyarm.control.catalogue.presets import ALIASES as PRESET_ALIASES
from skyarm.control.catalogue.presets import PRESETS, canonical_preset, preset
from skyarm.control.catalogue.tuned_gains import make_tuned, tuned_factors
from skyarm.control.controller import Controller, ControllerError
from skyarm.control.model import Model
from skyarm.files import did_you_mean, nearest, shown
from skyarm.registry.plugins import law_of_file_key
from skyarm.registry.registrations import canonical
from skyarm.registry.shipped import ALIASES, TUNED

FILE_LIKE = re.compile(r"(?P<stem>.+?)(\.py:?|\.\w+:\w*|\.py:.*)")
"""Texts that were probably meant as FILE.py:make and are not of that form."""


def full_name(name: Any) -> Any:
    """The controller's own name where an alias or an old name is given; any other value as it is.

    Warns:
        OldNameWarning: the name is old; the warning says the new one.
    """
    if not isinstance(name, str):
        return name
    found = canonical_law(canonical_preset(name))
    if found == name and name.endswith(TUNED):
        return f"{canonical_law(name.removesuffix(TUNED))}{TUNED}"
    return found


def require_different(names: Sequence[str], field: str) -> None:
    """Refuse two names of one controller: an alias beside the own name, or two paths of one FILE.py:make.

    Raises:
        ControllerError: one line with the field and the two names.
    """
    seen: dict[str, str] = {}
    for name in names:
        key = law_of_file_key(full_name(name))
        if key in seen:
            alike = f"{shown(seen[key])} and {shown(name)} are one"
            raise ControllerError(
                f"{field} = {shown(list(names))}: must be a list of different presets or laws; {alike}"
            )
        seen[key] = name


def aliases(name: str) -> list[str]:
    """Other names that stay of a preset or a law."""
    return [alias for table in (PRESET_ALIASES, ALIASES["law"]) for alias, own in table.items() if own == name]


def is_named(name: Any) -> bool:
    """True if there is a controller of this name."""
    if not isinstance(name, str):
        return False
    return name in PRESETS or name in LAWS or (name.endswith(TUNED) and _is_tuned(name.removesuffix(TUNED)))


SEE = "skyarm list"
"""Shows the names of all presets and laws."""


def choices(name: Any) -> str:
    """Allowed names in place of one that is none, in words: the nearest, and where all are shown."""
    near = ", ".join(nearest(name, _every_name()))
    return f"a preset, a law or LAW{TUNED} ({near} ...; {SEE!r} shows all), or FILE.py:make on the command line"


def _every_name() -> tuple[str, ...]:
    return (*PRESETS, *PRESET_ALIASES, *LAWS, *(f"{law}{TUNED}" for law in tuned_factors()))


def meant(name: Any) -> str:
    """What an unknown name may have meant, as a message begins; empty where nothing is alike."""
    if isinstance(name, str) and (found := FILE_LIKE.fullmatch(name)):
        return f"a law of a file is FILE.py:make, its function named behind a colon, as {found['stem']}.py:make; "
    return did_you_mean(name, _every_name())


def make_named(name: str, model: Model, known: Mapping[str, Any] | None = None) -> Controller:
    """A controller by one name, with default options.

    Args:
        name: a key of ``PRESETS`` or ``LAWS``, or that of a tuned law and ``TUNED``; an alias or old name of one.
        model: what it believes.
        known: what a law may know of its loop (:func:`skyarm.control.catalogue.preset`).

    Raises:
        ControllerError: unknown name, or a controller that does not fit the model.
        AllocationError: the model's rotors do not span torque and thrust.
    """
    if not is_named(name):
        raise ControllerError(f"controller = {shown(name)}: {meant(name)}must be {choices(name)}")
    name = full_name(name)
    if name in PRESETS:
        return preset(name, model, known)
    law = name if name in LAWS else name.removesuffix(TUNED)
    make = make_controller if name in LAWS else make_tuned
    return make(law, model, **suitable_options(law, known or {}))


def _is_tuned(law: str) -> bool:
    """Whether a law, by any of its names, has tuned gains."""
    return canonical("law", law) in tuned_factors()
