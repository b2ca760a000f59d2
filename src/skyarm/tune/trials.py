"""Flights by which gains are judged: the paper's cases, all candidates of a law at once, in machine code.

Errors are taken against the continuous reference. Perfect: no noise, no delay. Noisy: the bench's noise, and one
control period of delay. Late: noisy and two more periods that no law knows of.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from skyarm.compare.suite import DELAY, NOISE
from skyarm.control.controller import Controller
from skyarm.metrics.windows import Window, Windows
from skyarm.records.leaves import Place, part, walk
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import PERFECT_SENSORS, Delays, Scenario
from skyarm.simulate.batch import Batch

Array = npt.NDArray[np.float64]

LATENESS: Mapping[str, int] = {"perfect": 0, "noisy": 1, "late": 3}
"""Ages of the measurement, in the bench's delay."""

METRICS = ("position_error_mean_continuous", "joint_error_mean_continuous", "rotor_jitter_mean")


@dataclass(frozen=True, kw_only=True, slots=True)
class Trial:
    """One flight of every candidate.

    Attributes:
        case: shipped scenario. sensing: a key of ``LATENESS``. seed: of the noise, which all candidates share.
        start: of the window of means, s; it ends with the flight.
        duration: s.
    """

    case: str
    sensing: str = "perfect"
    seed: int = 0
    start: float = 10.0
    duration: float = 20.0

    def scenario(self, controller: Controller) -> Scenario:
        """The flight of a controller."""
        return dataclasses.replace(
            load_scenario(self.case, duration=self.duration),
            controller=controller,
            sensors=PERFECT_SENSORS if self.sensing == "perfect" else NOISE,
            delays=Delays(measurement=LATENESS[self.sensing] * DELAY),
            seed=self.seed,
        )

    @property
    def window(self) -> Window:
        """Of the means."""
        return Window(self.start, self.duration)


@dataclass(frozen=True, slots=True)
class Score:
    """Of each candidate: mean errors (m, rad), mean jitter (rad/s per period), whether it flew to the end."""

    base: Array
    joint: Array
    jitter: Array
    completed: npt.NDArray[np.bool_]


class Together:
    """Candidates of a traceable law, one lane each.

    Args:
        controller: the law with the gains that factors multiply.
        paths: constants that get a factor; each stands for all numbers below it.
        threads: results do not depend on it.
    """

    def __init__(self, controller: Controller, paths: Sequence[str] = (), *, threads: int = 1) -> None:
        self.controller, self.threads = controller, threads
        self.places: dict[str, dict[Place, float]] = {}
        for path in paths:
            place = tuple(path.split("."))
            below = walk(part(controller.par, place), place)
            self.places[path] = {at: number for at, number in below if isinstance(number, float)}
        self._batches: dict[Trial, Batch] = {}

    def fly(self, trial: Trial, factors: Mapping[str, Array], lanes: int = 1) -> Score:
        """Fly one candidate per lane.

        Args:
            trial: which flight.
            factors: path -> (lanes,).
            lanes: number of candidates where there are no paths.
        """
        batch = self._batch(dataclasses.replace(trial, seed=0))
        values = {
            ".".join(("controller", *place)): number * np.asarray(factors[path], dtype=float)
            for path, numbers in self.places.items()
            for place, number in numbers.items()
        }
        count = len(next(iter(values.values()))) if values else lanes
        # every lane draws the same noise
        found = batch.fly(values, seed=trial.seed, episodes=np.zeros(count, dtype=int), threads=self.threads)
        base, joint, jitter = (found.metrics[name] for name in METRICS)
        return Score(base, joint, jitter, found.completed)

    def fly_all(self, trials: Sequence[Trial], factors: Mapping[str, Array]) -> list[Score]:
        """Fly all candidates in every trial."""
        return [self.fly(trial, factors) for trial in trials]

    def _batch(self, trial: Trial) -> Batch:
        if trial not in self._batches:
            paths = [".".join(("controller", *place)) for numbers in self.places.values() for place in numbers]
            windows = Windows(steady=trial.window)
            self._batches[trial] = Batch(trial.scenario(self.controller), paths, metrics=METRICS, windows=windows)
        return self._batches[trial]
