"""Tuning of the laws' gains: one procedure, and one budget for every traceable law.

    python -m skyarm.tune.procedure [LAW ...]    writes control/tuned.toml; laws that are not named stay

Candidates are factors on the gains a law's maker takes by itself, one per path of
:data:`skyarm.control.catalogue.KNOBS`: 256 points of a Sobol sequence, log-uniform in [1/12, 12]; then eight rounds
of 64 points from the normal distribution, in logarithms, of the 16 best candidates so far (cross-entropy method,
Rubinstein 1999; spread at least 0.05). The first candidate is the untouched law.

Cost of a candidate: the mean over its flights of ln(e + 0.1 mm), with e = mean base error + 0.3 m (the arm's length)
times mean joint error over the window, against the continuous reference (the tool follows from both and from the tilt,
which the wind and not the law decides); the flights are Cases 1 to 3, Case 3 in wind and Case 2 in the gust, each with
perfect sensors and with noise and one period of delay (two seeds). A noisy flight adds (jitter - 15 rad/s) / 15 rad/s
where rotor commands change by more from period to period. A flight that ends early counts as e = 10 m. Case 3
is flown twice more with two further periods of delay: each time a candidate ends early, or is off by more than 0.2 m or
0.2 rad in the mean, costs 1. The logarithm makes each flight count by its ratio of improvement, whatever its size.

A law that cannot be traced (`nmpc`) takes a third of the flown time to compute where a batch of the others takes a
thousandth of it: 768 candidates in 17 flights of 20 s would be 20 hours of one core. It gets the same procedure on a
smaller budget, :data:`ONE_BY_ONE`: 24 + 3 x 8 candidates, factors in [1/3, 3], six of the best lead on, five flights of
13 s (Case 3 in wind and Case 2 in the gust with perfect and with noisy sensors, Case 3 late): a quarter of an hour of
one core. Its costs are of other flights than those of the other laws. It is judged in its mode "joints", which is what
the cost asks for; its weights of base position and tool keep their size, for only ratios of weights matter.
"""

from __future__ import annotations

import argparse
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import NormalDist

import numpy as np
import numpy.typing as npt

from skyarm.control import catalogue
from skyarm.control.catalogue import KNOBS
from skyarm.files import write_atomically
from skyarm.sweep.sobol import BITS, sobol
from skyarm.tune.candidate_costs import FULL, SHORT, Judge, untuned
from skyarm.tune.trials import Trial

Array = npt.NDArray[np.float64]

SPREAD = 0.05
"""Least standard deviation of a factor's logarithm."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Budget:
    """What may be spent.

    Attributes:
        first, later: candidates of the first round, and of each of the later ones. rounds: how many of those.
        elite: how many of the best lead on. reach: largest factor, and one over the smallest.
        trials: flights of each candidate.
    """

    first: int = 256
    later: int = 64
    rounds: int = 8
    elite: int = 16
    reach: float = 12.0
    trials: tuple[Trial, ...] = FULL


ONE_BY_ONE = Budget(first=24, later=8, rounds=3, elite=6, reach=3.0, trials=SHORT)
"""For a law that cannot be traced."""


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


def tune(law: str, budget: Budget | None = None, *, workers: int = 1) -> Tuned:
    """Tune a law's gains on the paper's vehicle.

    Args:
        law: a key of ``KNOBS``.
        budget: what may be spent; :func:`budget_of` the law if left out.
        workers: threads, or processes of a law that flies one by one; results do not depend on it.
    """
    budget = budget or budget_of(law)
    paths = KNOBS[law]
    judge = Judge(law, budget.trials, workers)
    box = math.log(budget.reach)
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


def budget_of(law: str) -> Budget:
    """The budget for every law, or the one for a law that flies one by one."""
    return Budget() if untuned(law).compiled else ONE_BY_ONE


def document(found: Mapping[str, Tuned], kept: Mapping[str, str]) -> str:
    """The file of tuned gains; ``kept`` are tables of laws as they stand."""
    head = (
        "# Factors on each law's own gains, found by one procedure on one budget but where noted\n"
        "# (skyarm/tune/procedure.py).\n"
        "# Written by: python -m skyarm.tune.procedure\nschema = 1\n"
    )
    tables = {**kept, **{law: _table(law, each) for law, each in found.items()}}
    return head + "".join(tables[law] for law in KNOBS if law in tables)


def _table(law: str, found: Tuned) -> str:
    lines = [f'"{path}" = {factor}' for path, factor in found.factors.items()]
    note = f"# cost {found.before:.3f} -> {found.after:.3f}, {found.candidates} candidates"
    if not untuned(law).compiled:
        note += ", on the smaller budget of laws that fly one by one: not comparable"
    return "\n".join(["", f"[law.{law}]  {note}", *lines, ""])


def existing(text: str) -> dict[str, str]:
    """The tables of a file of tuned gains, as text."""
    parts = text.split("\n[law.")[1:]
    return {part.split("]", 1)[0]: "\n[law." + part.rstrip("\n") + "\n" for part in parts}


def write(laws: Sequence[str], path: Path, *, budget: Budget | None = None, workers: int = 1) -> None:
    """Tune laws and write the file after each; laws that are not named stay as they are in it."""
    for law in laws:
        found = tune(law, budget, workers=workers)
        kept = existing(path.read_text(encoding="utf-8")) if path.exists() else {}
        write_atomically(path, document({law: found}, kept).encode())
        print(f"{law}: cost {found.before:.3f} -> {found.after:.3f}", flush=True)


def main() -> None:
    """Tune laws (all if none is named) into the package's file."""
    parser = argparse.ArgumentParser(description="Tune the gains of laws.")
    parser.add_argument("laws", nargs="*", metavar="LAW", help=f"all if none is named; of {', '.join(KNOBS)}")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="threads or processes")
    parser.add_argument("--file", type=Path, default=Path(catalogue.__file__).with_name("tuned.toml"))
    given = parser.parse_args()
    unknown = [law for law in given.laws if law not in KNOBS]
    if unknown:
        parser.error(f"{unknown[0]!r} has no gains to tune; there are {', '.join(KNOBS)}")
    write(given.laws or tuple(KNOBS), given.file, workers=given.workers)


if __name__ == "__main__":
    main()
