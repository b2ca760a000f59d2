"""Why each episode of a batch ended, from the states they were left in.

The same conditions as :class:`skyarm.simulate.monitor.Monitor`, on arrays of lanes.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.dynamics import State
from skyarm.simulate.monitor import FAR, LOST, lowest_point
from skyarm.simulate.paths import with_numbers
from skyarm.simulate.scenario import Scenario

Array = npt.NDArray[Any]

STATUSES = ("completed", "diverged", "joint_limit", "controller_undefined", "ground")

SLACK = 1e-5
"""m, rad or 1: how far inside a limit a lane may be that machine code, which rounds otherwise, found outside."""


def endings(scenario: Scenario, values: Mapping[str, Array], state: State, goals: Array, ended: Array) -> Array:
    """Status of each lane, one of ``STATUSES``.

    Args:
        scenario: of the batch.
        values: path -> (lanes,), its varied numbers.
        state: last one of each lane, its scalars (lanes,).
        goals: (lanes, 3) position of the held reference at that time, m.
        ended: True where the lane stopped before its time. A lane that flew to the end is looked at once more, as a
            single run does after its last step.
    """
    # how it started and where it was meant to be do not tell why it ended
    kept = {path: column for path, column in values.items() if not path.startswith(("initial.", "reference."))}
    varied = with_numbers(scenario, kept)
    with np.errstate(all="ignore"):
        found = np.where(ended, 1, 0)  # a command that is not finite leaves a sound state behind
        for slack, lanes in ((SLACK, ended), (0.0, np.ones_like(ended, dtype=bool))):
            for status, broken in reversed(_conditions(varied, state, goals, slack)):
                found = np.where(lanes & broken, STATUSES.index(status), found)
    return np.array(STATUSES)[found]


def _conditions(scenario: Scenario, state: State, goals: Array, slack: float) -> list[tuple[str, Array]]:
    """(status, True where it holds) in the order in which the first one that holds is the cause."""
    lanes = len(goals)
    # written so that NaN is not sound
    sound = np.ones(lanes, dtype=bool)
    for value in state.quaternion:
        sound &= np.abs(value) < 2.0
    for value in (*state.velocity, *state.rate, *state.joints, *state.joint_rates, *state.rotor_speeds):
        sound &= np.abs(value) < FAR
    for value, wanted in zip(state.position, goals.T, strict=True):
        sound &= np.abs(value - wanted) < LOST
    past = np.zeros(lanes, dtype=bool)
    for value, link in zip(state.joints, scenario.world.vehicle.links, strict=True):
        past |= (value < link.joint.lower + slack) | (value > link.joint.upper - slack)
    found = [("diverged", ~sound), ("joint_limit", past)]
    if scenario.controller.margin is not None:
        found.append(("controller_undefined", np.asarray(scenario.controller.margin(state.quaternion)) < slack))
    if scenario.ground:
        found.append(("ground", np.asarray(lowest_point(scenario.world.vehicle, state)) < slack))
    return found
