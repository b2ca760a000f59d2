"""Tuning of the laws' gains: one procedure and one budget for every law.

    python -m skyarm.experiments.tuning [LAW ...]    writes skyarm/control/tuned.toml, laws that are not named stay

Candidates are factors on the gains a law's maker takes by itself, one per path of :data:`skyarm.control.tuned.KNOBS`:
256 points of a Sobol sequence, log-uniform in [1/12, 12]; then eight rounds of 64 points from the normal distribution,
in logarithms, of the 16 best candidates so far (cross-entropy method, Rubinstein 1999; spread at least 0.05). The
first candidate is the untouched law.

Cost of a candidate: the mean over its flights of ln(e + 0.1 mm), with e = mean base error + 0.3 m (the arm's length)
times mean joint error over the window, against the continuous reference (the tool follows from both and from the tilt,
which the wind and not the law decides); the flights are Cases 1 to 3, Case 3 in wind and Case 2 in the gust, each with
perfect sensors and with noise and one period of delay (two seeds). A noisy flight adds (jitter - 15 rad/s) / 15 rad/s
where rotor commands change by more from period to period. A flight that ends early counts as e = 10 m. Case 3
is flown twice more with two further periods of delay: each time a candidate ends early, or is off by more than 0.2 m or
0.2 rad in the mean, costs 1. The logarithm makes each flight count by its ratio of improvement, whatever its size.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import NormalDist

import numpy as np
import numpy.typing as npt

from skyarm.control.registry import make_controller
from skyarm.control.tuned import KNOBS
from skyarm.experiments.tuning_flights import FLIGHTS, SENSING, Course, Score
from skyarm.files import write_atomically
from skyarm.simulate.scenario_file import load_scenario
from skyarm.sweep.sobol import BITS, sobol

Array = npt.NDArray[np.float64]

REACH = 12.0
SPREAD = 0.05
"""Least standard deviation of a factor's logarithm."""
SEEDS = (1, 2)
LATE_SEEDS = (3, 4)
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


@dataclass(frozen=True, kw_only=True, slots=True)
class Budget:
    """Candidates of the first round and of each of the later ones, and how many of the best lead on."""

    first: int = 256
    later: int = 64
    rounds: int = 8
    elite: int = 16


@dataclass(frozen=True, slots=True)
class Tuned:
    """What tuning found: factors by path, cost of the untouched law and of the best, candidates flown."""

    factors: dict[str, float]
    before: float
    after: float
    candidates: int


def points(count: int, dimensions: int, start: int) -> Array:
    """Sobol points (count, dimensions) in (0, 1), from number ``start`` on."""
    numbers = np.arange(start, start + count)
    columns = [(sobol(numbers, k).astype(float) + 0.5) / 2.0**BITS for k in range(dimensions)]
    return np.stack(columns, axis=1)


def normal(uniforms: Array) -> Array:
    """Standard normal numbers by the inverse of their distribution."""
    inverse = np.vectorize(NormalDist().inv_cdf, otypes=[float])
    drawn: Array = inverse(uniforms)
    return drawn


def tune(law: str, budget: Budget | None = None, *, threads: int = 1) -> Tuned:
    """Tune a law's gains on the paper's vehicle.

    Args:
        law: a key of ``KNOBS``.
        budget: how many candidates.
        threads: results do not depend on it.
    """
    budget = budget or Budget()
    paths = KNOBS[law]
    judge = Judge(law, paths, threads)
    box = math.log(REACH)
    logs = (2.0 * points(budget.first, len(paths), 1) - 1.0) * box
    logs[0] = 0.0
    costs = judge.costs(logs)
    before = float(costs[0])
    for _ in range(budget.rounds):
        best = logs[np.argsort(costs, kind="stable")[: budget.elite]]
        spread = np.maximum(best.std(axis=0), SPREAD)
        drawn = normal(points(budget.later, len(paths), 1 + len(logs)))
        near = np.clip(best.mean(axis=0) + spread * drawn, -box, box)
        logs, costs = np.vstack([logs, near]), np.concatenate([costs, judge.costs(near)])
    center = logs[int(costs.argmin())]
    factors = {path: round(float(math.exp(value)), 4) for path, value in zip(paths, center, strict=True)}
    return Tuned(factors, before, float(costs.min()), len(logs))


class Judge:
    """Costs of a law's candidates."""

    def __init__(self, law: str, paths: Sequence[str], threads: int = 1) -> None:
        controller = make_controller(law, load_scenario("case3").controller.par.model)
        self._courses = {name: Course(controller, paths, delay=delay) for name, (_, delay) in SENSING.items()}
        self._paths, self._threads = tuple(paths), threads

    def costs(self, logs: Array) -> Array:
        """Cost of each row of logarithms of factors."""
        factors = {path: np.exp(column) for path, column in zip(self._paths, logs.T, strict=True)}
        total, count = np.zeros(len(logs)), 0
        for sensing, seeds in (("perfect", (0,)), ("noisy", SEEDS)):
            for seed in seeds:
                for flight in FLIGHTS:
                    score = self._fly(sensing, flight, factors, seed)
                    total, count = total + cost(score, noisy=sensing == "noisy"), count + 1
        lost = np.zeros(len(logs))
        for seed in LATE_SEEDS:
            late = self._fly("late", "case3", factors, seed)
            survived = late.completed & (late.base < STEADY_BASE) & (late.joint < STEADY_JOINT)
            lost += np.where(survived, 0.0, 1.0)
        return total / count + lost

    def _fly(self, sensing: str, flight: str, factors: Mapping[str, Array], seed: int) -> Score:
        return self._courses[sensing].fly(
            FLIGHTS[flight], factors, noise=SENSING[sensing][0], seed=seed, threads=self._threads
        )


def cost(score: Score, *, noisy: bool) -> Array:
    """Cost of one flight of each candidate."""
    error = np.where(score.completed, score.base + ARM * score.joint, LOST)
    error = np.minimum(np.nan_to_num(error, nan=LOST), LOST)
    found: Array = np.log(error + FLOOR)
    if noisy:
        jitter = np.nan_to_num(score.jitter, nan=0.0)
        found = found + np.maximum(jitter - QUIET, 0.0) / QUIET
    return found


def document(found: Mapping[str, Tuned], kept: Mapping[str, str]) -> str:
    """The file of tuned gains; ``kept`` are tables of laws as they stand."""
    head = (
        "# Factors on each law's own gains, found by one procedure on one budget (skyarm/experiments/tuning.py).\n"
        "# Written by: python -m skyarm.experiments.tuning\nschema = 1\n"
    )
    tables = {**kept, **{law: _table(law, each) for law, each in found.items()}}
    return head + "".join(tables[law] for law in KNOBS if law in tables)


def _table(law: str, found: Tuned) -> str:
    lines = [f'"{path}" = {factor}' for path, factor in found.factors.items()]
    note = f"# cost {found.before:.3f} -> {found.after:.3f}, {found.candidates} candidates"
    return "\n".join(["", f"[law.{law}]  {note}", *lines, ""])


def existing(text: str) -> dict[str, str]:
    """The tables of a file of tuned gains, as text."""
    parts = text.split("\n[law.")[1:]
    return {part.split("]", 1)[0]: "\n[law." + part.rstrip("\n") + "\n" for part in parts}


def main(laws: Sequence[str], path: Path | None = None, budget: Budget | None = None) -> None:
    """Tune laws (all if none is named) and write the file."""
    from skyarm.control import tuned

    target = path or Path(tuned.__file__).with_name("tuned.toml")
    for law in laws or tuple(KNOBS):
        found = tune(law, budget)
        kept = existing(target.read_text(encoding="utf-8")) if target.exists() else {}
        write_atomically(target, document({law: found}, kept).encode())
        print(f"{law}: cost {found.before:.3f} -> {found.after:.3f}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
