"""Checks of the arguments of environments: counts, actions, options and seeds."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from skyarm.files import did_you_mean, shown
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.simulate.lane_numbers import require_count

MOST_LANES = 1_000_000
"""Episodes that fly together at most: some hundreds of numbers each, so that this asks for gigabytes already."""


def require_lanes(given: Any) -> int:
    """How many episodes fly together.

    Raises:
        ScenarioError: no whole number, none, or more than a machine holds.
    """
    count = require_count("num_envs", given)
    if count > MOST_LANES:
        raise ScenarioError(f"num_envs = {shown(given)}: must be a whole number, at most {MOST_LANES}")
    return count


def require_open(call: str, *, closed: bool) -> None:
    """Refuse a call of a closed environment.

    Raises:
        ScenarioError: one line with the call.
    """
    if closed:
        raise ScenarioError(f"{call}: must come before close(); this environment is closed, make another")


def require_options(given: Any, known: Sequence[str]) -> None:
    """Refuse options of a reset that there are not.

    Raises:
        ScenarioError: one line with the option and what is allowed.
    """
    if given is None:
        return
    allowed = f"must be a table of {', '.join(known)}" if known else "must be None or empty; there are no options"
    if not isinstance(given, Mapping):
        raise ScenarioError(f"options = {shown(given)}: {allowed}")
    for name in given:
        if name not in known:
            raise ScenarioError(f"options = {shown(dict(given))}: {allowed}")


def require_arguments(given: Mapping[str, Any], make: Callable[..., Any], *also: str) -> None:
    """Refuse arguments of an environment that its task does not take; ``also`` names those of the environment itself.

    Raises:
        ScenarioError: one line with the argument and those that there are.
    """
    known = [name for name in inspect.signature(make).parameters if name != "scenario"]
    known += also
    for name, value in given.items():
        if name not in known:
            meant = did_you_mean(name, known)
            raise ScenarioError(f"{name} = {shown(value)}: unknown argument; {meant}there are {', '.join(known)}")


KEYS = 2**32
"""How many keys the noise has; a larger seed counts as its rest."""


def seed_of(seed: Any, field: str = "seed") -> int:
    """A whole number that is not negative, as a key.

    Raises:
        ScenarioError: it is none.
    """
    if isinstance(seed, (bool, np.bool_)) or not isinstance(seed, (int, np.integer)) or seed < 0:
        raise ScenarioError(f"{field} = {shown(seed)}: must be a whole number, at least 0")
    return int(seed) % KEYS


def seeds_of(seed: int | Sequence[int | None] | None, lanes: int) -> list[int | None]:
    """The seed of each lane: seed + k of lane k, the k-th of a list, or None.

    Raises:
        ScenarioError: no such seed, or a list of another length.
    """
    if seed is None:
        return [None] * lanes
    if isinstance(seed, (list, tuple, np.ndarray)):
        if len(seed) != lanes:
            raise ScenarioError(f"seed: a list of {len(seed)}, must be one number, or one for each of {lanes} lanes")
        return [None if each is None else seed_of(each, f"seed[{k}]") for k, each in enumerate(seed)]
    first = seed_of(seed)
    return [(first + k) % KEYS for k in range(lanes)]
