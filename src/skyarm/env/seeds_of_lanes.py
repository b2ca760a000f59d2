"""Seeds of environments as keys of the noise: Gymnasium's may be larger."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from skyarm.files import shown
from skyarm.scenario.scenario_record import ScenarioError

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
