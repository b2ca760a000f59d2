"""How late commands act, found from the measured rotor speeds.

A rotor that follows its commands k periods late turns, at every instant, as its model did k periods before. The speeds
of the model are kept for the longest delay that is looked for; the delay whose speeds were nearest to the measured ones
lately is believed once it is clearly nearer than the one believed so far. No matter whether commands are late on their
way out or measurements late on their way in: what counts is when a command is seen to act.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

LONGEST = 12
"""Control periods: no longer delay is looked for."""

MEMORY = 0.5
"""s: time over which differences count."""

LEAST = 10
"""Measurements before anything is believed."""

CLEAR = 0.25
"""Share of the believed delay's mean square at which another one is believed instead."""

NOTICED = 0.5
"""rad/s: root mean square below which the believed delay is good enough."""


@dataclass(frozen=True, slots=True)
class Lateness:
    """What is remembered of commands and rotors.

    Attributes:
        modelled: (LONGEST + 1, rotors) speeds of rotors that obey at once, rad/s; row k is of k periods ago.
        squares: (LONGEST + 1,) forgotten sums of squared differences from the measured speeds, one a delay.
        weight: the same sum of ones. count: measurements. periods: delay that is believed.
    """

    modelled: Array
    squares: Array
    weight: float = 0.0
    count: int = 0
    periods: int = 0


def first_lateness(speeds: Array) -> Lateness:
    """What is believed at the first measurement: no delay."""
    return Lateness(np.tile(speeds, (LONGEST + 1, 1)), np.zeros(LONGEST + 1))


def compared(before: Lateness, modelled: Array, measured: Array | None, dt: float) -> Lateness:
    """The same after ``dt`` s.

    Args:
        before: one period earlier.
        modelled: (rotors,) speeds now of rotors that obeyed the commands so far at once.
        measured: (rotors,) speeds; None if they are those of the measurement before, which tell nothing.
        dt: s.
    """
    rows = np.vstack([modelled, before.modelled[:-1]])
    if measured is None:
        return dataclasses.replace(before, modelled=rows)
    kept = np.exp(-dt / MEMORY)
    squares = kept * before.squares + np.mean((rows - measured) ** 2, axis=1)
    found = Lateness(rows, squares, kept * before.weight + 1.0, before.count + 1, before.periods)
    now = squares[found.periods]
    best = int(np.argmin(squares))
    if found.count < LEAST or not now > NOTICED**2 * found.weight or not squares[best] < CLEAR * now:
        return found
    return dataclasses.replace(found, periods=best)
