"""Where in a scenario's records the number of a dotted path stands (:mod:`skyarm.simulate.paths`)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from skyarm.reference import Constant
from skyarm.simulate.scenario import Scenario, ScenarioError
from skyarm.simulate.vocabulary import Place, names, part

ROOTS: Mapping[str, Place] = {
    "plant": ("world",),
    "model": ("controller", "par", "model"),
    "controller": ("controller", "par"),
    "environment.wind": ("wind",),
    "environment.faults": ("faults",),
    "sensors": ("sensors",),
    "initial": ("initial",),
    "reference": ("trajectory",),
}

STRUCTURE = ("duration", "rates", "delays", "seed", "episode", "environment.ground", "plant.integrator", "plant.kind")
"""Fields of the file that shape an episode or key its noise; they are the same for all episodes of a batch."""

LATE = "delays.command"
"""It varies where the scenario says how long it gets (:class:`skyarm.simulate.scenario.Delays`)."""


def places_of(scenario: Scenario, path: str) -> tuple[Place, ...]:
    """Places of the scenario record at which the number of a path stands; all hold the same.

    Raises:
        ScenarioError: a field that does not exist (with those that do), or one that is structure.
    """
    if path == LATE and scenario.delays.longest_command is not None:
        return (("delays", "command"),)
    for field in STRUCTURE:
        if path == field or path.startswith(f"{field}."):
            raise ScenarioError(f"path = {path!r}: {field} is structure, the same for all episodes; fly two studies")
    for root, start in ROOTS.items():
        if path.startswith(f"{root}."):
            return _follow(scenario, path, start, path[len(root) + 1 :].split("."))
    raise ScenarioError(f"path = {path!r}: must start with one of {', '.join(ROOTS)}")


def _follow(scenario: Scenario, path: str, start: Place, words: list[str]) -> tuple[Place, ...]:
    places: Any = (start,)
    for word in words:
        if isinstance(places, tuple):
            options = names(part(scenario, places[0]))
            heads = places
        else:
            options, heads = places, (start,)
        if word not in options:
            raise ScenarioError(f"path = {path!r}: no {word!r} here; there are {', '.join(options) or 'no fields'}")
        places = _joined(heads, options[word])
        start = heads[0]
    if not isinstance(places, tuple):
        raise ScenarioError(f"path = {path!r}: must lead to a number; there are {', '.join(places)}")
    # a number of the file that is held as a signal
    return tuple((*at, "value") if isinstance(part(scenario, at), Constant) else at for at in places)


def _joined(heads: tuple[Place, ...], found: Any) -> Any:
    """Places seen from the scenario; a tree of more words is seen from the first head."""
    if isinstance(found, tuple):
        return tuple((*head, *tail) for head in heads for tail in found)
    return found
