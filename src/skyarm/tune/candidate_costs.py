"""Cost of candidates of a law's gains: the flights that judge them, and what each flight costs.

The cost itself is defined in :mod:`skyarm.tune.procedure`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.control.catalogue import KNOBS, make_controller
from skyarm.control.controller import Controller
from skyarm.scenario.scenario_file import load_scenario
from skyarm.tune.one_law import Alone
from skyarm.tune.trials import Score, Together, Trial

Array = npt.NDArray[np.float64]

STEADY_BASE, STEADY_JOINT = 0.2, 0.2
"""m and rad: mean errors beyond these with a late measurement are a limit cycle or worse."""
QUIET = 15.0
"""rad/s: change of rotor commands per period that costs nothing."""
ARM = 0.3
"""m: length of the paper's arm, by which a joint error becomes a distance."""
LOST = 10.0
"""m: error that a flight which ended early is charged."""
FLOOR = 1e-4
"""m: improvements below this count no more."""


CASES: Mapping[str, float] = {"case1": 10.0, "case2": 10.0, "case3": 10.0, "case3_wind": 10.0, "case2_gust": 5.0}
"""Where the windows of the paper's cases begin, s."""

FULL = (
    *(Trial(case=case, start=start) for case, start in CASES.items()),
    *(Trial(case=case, start=start, sensing="noisy", seed=seed) for seed in (1, 2) for case, start in CASES.items()),
    *(Trial(case="case3", sensing="late", seed=seed) for seed in (3, 4)),
)
"""Flights of a candidate."""

SHORT = (
    # windows of two periods of the arm, and from before the gust on
    *(Trial(case="case3_wind", start=9.0, duration=13.0, sensing=sensing) for sensing in ("perfect", "noisy")),
    *(Trial(case="case2_gust", start=5.0, duration=13.0, sensing=sensing) for sensing in ("perfect", "noisy")),
    Trial(case="case3", start=9.0, duration=13.0, sensing="late"),
)
"""Flights of a candidate of a law that flies them one by one."""


OPTIONS: Mapping[str, Mapping[str, Any]] = {"nmpc": {"mode": "joints"}}
"""With what a law flies to be tuned, if not as its maker makes it."""


def untuned(law: str) -> Controller:
    """Return the law with its maker's own gains for the paper's vehicle."""
    return make_controller(law, load_scenario("case3").controller.par.model, **OPTIONS.get(law, {}))


class Judge:
    """Costs of a law's candidates.

    Args:
        law: a key of ``KNOBS``. trials: its flights. workers: see :func:`tune`.
    """

    def __init__(self, law: str, trials: Sequence[Trial] = FULL, workers: int = 1) -> None:
        self._paths, self._trials, self._flyer = KNOBS[law], tuple(trials), _flyer(law, workers)

    def costs(self, logs: Array) -> Array:
        """Cost of each row of logarithms of factors."""
        factors = {path: np.exp(column) for path, column in zip(self._paths, logs.T, strict=True)}
        total, count, lost = np.zeros(len(logs)), 0, np.zeros(len(logs))
        for trial, score in zip(self._trials, self._flyer.fly_all(self._trials, factors), strict=True):
            if trial.sensing == "late":
                survived = score.completed & (score.base < STEADY_BASE) & (score.joint < STEADY_JOINT)
                lost += np.where(survived, 0.0, 1.0)
            else:
                total, count = total + cost(score, noisy=trial.sensing == "noisy"), count + 1
        return total / count + lost


@lru_cache(maxsize=1)
def _flyer(law: str, workers: int) -> Together | Alone:
    """What flies a law's candidates; its machine code is kept for the next judge of the same law."""
    controller = untuned(law)
    if controller.compiled:
        return Together(controller, KNOBS[law], threads=workers)
    return Alone(law, OPTIONS.get(law), workers=workers)


def cost(score: Score, *, noisy: bool) -> Array:
    """Cost of one flight of each candidate."""
    error = np.where(score.completed, score.base + ARM * score.joint, LOST)
    error = np.minimum(np.nan_to_num(error, nan=LOST), LOST)
    found: Array = np.log(error + FLOOR)
    if noisy:
        jitter = np.nan_to_num(score.jitter, nan=0.0)
        found = found + np.maximum(jitter - QUIET, 0.0) / QUIET
    return found
