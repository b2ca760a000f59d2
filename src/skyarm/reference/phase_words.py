"""Phases of a task in words and numbers: which one is flown, which one failed and why."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.reference.phase_guard import Guard
from skyarm.reference.trajectory import Trajectory

Array = npt.NDArray[Any]

PASSED = 1e-6
"""s of the reference beyond a phase's end from which on the phase is done: at its end the reference may wait."""


def phase_numbers(trajectory: Trajectory, path_time: Any) -> Array:
    """Number of the phase that is flown at times of the reference (s); one more than the last once all are done."""
    ends = np.array([phase.end + PASSED for phase in trajectory.phases])
    return np.searchsorted(ends, np.asarray(path_time), side="left").astype(float)


def failure_words(trajectory: Trajectory, guard: Guard) -> str:
    """What a phase did not reach: "phase 2 'press': no contact of 0.5 N within 5 s"."""
    asked = []
    if guard.force is not None:
        asked.append(f"no contact of {float(guard.force):g} N")
    if guard.force_below is not None:
        asked.append(f"force not below {float(guard.force_below):g} N")
    if guard.closed:
        asked.append(f"switch '{guard.closed}' not closed")
    if guard.open:
        asked.append(f"switch '{guard.open}' not open")
    if guard.distance is not None:
        asked.append(f"not moved by {float(guard.distance):g} m")
    if guard.error is not None:
        asked.append(f"error not below {float(guard.error):g} m")
    named = trajectory.phases[guard.phase].name if guard.phase < len(trajectory.phases) else "guard"
    return f"phase {guard.phase} '{named}': {' or '.join(asked)} within {float(guard.timeout):g} s"
