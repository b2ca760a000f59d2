"""Flights by which the gains of a law are judged that cannot be traced: one by one, in worker processes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.control.catalogue import make_controller, rescale
from skyarm.log.flight_log import Log
from skyarm.metrics.score import score
from skyarm.metrics.windows import Window, Windows
from skyarm.scenario.scenario_file import load_scenario
from skyarm.simulate.loop import run
from skyarm.simulate.workers import workers as spread
from skyarm.tune.trials import Score, Trial

Array = npt.NDArray[np.float64]

SCORED = ("position_error_mean_continuous", "joint_error_mean_continuous", "rotor_jitter_mean")
"""What a candidate is judged by, besides flying to its end."""


@dataclass(frozen=True, slots=True)
class Solo:
    """A flight of one candidate: its law, options of the law's maker, factors by path, the flight."""

    law: str
    options: Mapping[str, Any]
    factors: Mapping[str, float]
    trial: Trial

    def perform(self) -> tuple[float, float, float, bool]:
        """Fly it: the numbers of a :class:`Score`."""
        model = load_scenario(self.trial.case).controller.par.model
        plain = make_controller(self.law, model, **self.options)
        return scored(run(self.trial.scenario(rescale(plain, self.factors))), self.trial.window)


def scored(log: Log, window: Window) -> tuple[float, float, float, bool]:
    """The numbers of a :class:`Score` from a log."""
    position, joint, jitter = score(log, SCORED, Windows(steady=window)).values()
    return position, joint, jitter, log.status == "completed"


class Alone:
    """Candidates of a law that cannot be traced, one flight after the other on each of some processes.

    Args:
        law, options: what is made in each process; options can be pickled.
        workers: processes; 1 flies in this one. Results do not depend on it.
    """

    def __init__(self, law: str, options: Mapping[str, Any] | None = None, *, workers: int = 1) -> None:
        self.law, self.options, self.workers = law, dict(options or {}), workers

    def fly_all(self, trials: Sequence[Trial], factors: Mapping[str, Array]) -> list[Score]:
        """Fly all candidates in every trial."""
        rows = np.column_stack(list(factors.values())).tolist()
        solos = [Solo(self.law, self.options, dict(zip(factors, row, strict=True)), t) for t in trials for row in rows]
        flown = np.array(self._performed(solos)).reshape(len(trials), len(rows), 4)
        scores = []
        for each in flown:
            base, joint, jitter, completed = each.T
            scores.append(Score(base, joint, jitter, completed > 0.5))
        return scores

    def _performed(self, solos: Sequence[Solo]) -> list[tuple[float, float, float, bool]]:
        if self.workers <= 1:
            return [solo.perform() for solo in solos]
        with spread(self.workers) as submit:
            return [future.result() for future in [submit(solo.perform) for solo in solos]]
