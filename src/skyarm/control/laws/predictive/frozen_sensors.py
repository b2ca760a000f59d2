"""Sensors that say the same again: what they would say now is foreseen, and nothing is learnt from them.

A reading whose numbers are those of the one before, to the last bit, is no new one: a sensor that hangs, a link that
repeats itself, or one that is slower than the control. Taken for new it would say that the vehicle has stopped, and an
observer would learn the force that stops it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

PARTS = {"position": (1, 4), "quaternion": (4, 8), "velocity": (8, 11), "rate": (11, 14)}
"""Numbers of a measurement that one sensor says: first and end, in the order of its leaves."""

FIRST_JOINT = 17
"""Number of the first joint among a measurement's leaves."""

LONG = 3
"""Periods without news of a velocity after which the next news is taken over at once."""


@dataclass(frozen=True, slots=True)
class Fresh:
    """The last measurement, its leaves as they came, and periods since velocity and rate were both new."""

    reading: Array
    silent: int = 0


@dataclass(frozen=True, slots=True)
class Stuck:
    """What of a measurement is no news.

    Attributes:
        parts: keys of :data:`PARTS`, and "arm" where everything is the same.
        silent: periods since velocity and rate were both new. spoke_again: whether they are now, after long silence.
    """

    parts: tuple[str, ...]
    silent: int
    spoke_again: bool


def frozen(last: Fresh | None, reading: Array, joints: int) -> Stuck:
    """Compare a measurement with the one before.

    An arm at rest says the same for long, so that its readings count as old only where every other one is.
    """
    if last is None:
        return Stuck((), 0, False)
    same = [name for name, (a, b) in PARTS.items() if np.array_equal(reading[a:b], last.reading[a:b])]
    arm = slice(FIRST_JOINT, FIRST_JOINT + 2 * joints)
    if len(same) == len(PARTS) and np.array_equal(reading[arm], last.reading[arm]):
        same.append("arm")
    if "velocity" in same or "rate" in same:
        return Stuck(tuple(same), last.silent + 1, False)
    return Stuck(tuple(same), 0, last.silent >= LONG)


def filled(reading: Array, foreseen: Array, parts: tuple[str, ...], joints: int) -> Array:
    """A measurement with its old parts replaced by those of a foreseen state (the leaves of an estimate)."""
    found = reading.copy()
    for name in parts:
        # a state lists the same parts without the time before them and the specific force before the joints
        a, b, earlier = (*PARTS[name], 1) if name in PARTS else (FIRST_JOINT, FIRST_JOINT + 2 * joints, 4)
        found[a:b] = foreseen[a - earlier : b - earlier]
    return found


def taken_over(estimate: Array, before: Array, reading: Array, joints: int) -> Array:
    """An estimate with the measured velocities, and the disturbance as it was before they were missed."""
    found = estimate.copy()
    found[7:13] = reading[8:14]
    rates = 13 + joints
    found[rates : rates + joints] = reading[FIRST_JOINT + joints : FIRST_JOINT + 2 * joints]
    found[-6 - joints :] = before[-6 - joints :]
    return found
