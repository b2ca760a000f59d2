"""Samples of logged rotor commands, apart from rows that repeat them or lie on straight lines between them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from skyarm.flight_data.flight_data import Channel
from skyarm.flight_data.series import values_at
from skyarm.records.arrays import Array

SLOWEST = 0.025
"""s, between commands of rotors: pulse widths come at 50 Hz at least, and slower ones are samples of faster ones."""

ROUNDED, NOUGHT = 2.5, 1e-9
"""Smallest second differences that rounding makes of a straight line; share of the largest one that is nought."""

EVEN, REGULAR = 0.1, 0.5
"""Share by which times between samples differ at most from their median, and share of those that do not."""


FEWEST = 20
"""Samples in a row that steps of a test hardly are."""


def command_samples(commands: Channel) -> Channel:
    """Rows at which a command was logged: of commands that were sampled up, held or on straight lines, one in several.

    Args:
        commands: of the rotors.

    Returns:
        The rows at even times at which any command changes, or bends; all rows if there are no such times.
    """
    steps = np.diff(commands.values, axis=0)
    bends = np.abs(np.diff(steps, axis=0))
    nought = NOUGHT * bends.max(axis=0, initial=0.0)
    straight = np.maximum(ROUNDED * np.where(bends > nought, bends, np.inf).min(axis=0, initial=np.inf), nought)
    for rows in (np.flatnonzero((steps != 0.0).any(axis=1)), np.flatnonzero((bends > straight).any(axis=1))):
        gaps = np.diff(rows)
        usual = float(np.median(gaps)) if len(gaps) >= FEWEST else 1.0
        if usual > 1.0 and np.mean(np.abs(gaps - usual) <= EVEN * usual) > REGULAR:
            kept = np.concatenate([[0], rows + 1])
            return replace(commands, time=commands.time[kept], values=commands.values[kept])
    return commands


def sampling_period(commands: Channel) -> float:
    """Time, s, between samples of commands that were logged too seldom to be held from one to the next; else 0."""
    rate = command_samples(commands).rate
    return 1.0 / rate if 0.0 < rate < 1.0 / SLOWEST else 0.0


def straight_lines(commands: Channel, time: Array) -> Array:
    """Commands (N, rotors) at given times (s), on straight lines between the samples."""
    return values_at(command_samples(commands), time)
