"""Interleaved timing: A B C A B C ..., so that whatever slows the machine down slows everyone down alike."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Contender:
    """Something that simulates.

    Attributes:
        name: short. what: in words. run: does a fixed piece of work and returns the seconds it simulated.
    """

    name: str
    what: str
    run: Callable[[], float]


@dataclass(frozen=True, slots=True)
class Score:
    """Simulated seconds per second of wall time: median over the rounds, and the same against the baseline.

    Attributes:
        ratio: median of the ratios within each round. low, high: their smallest and largest.
    """

    name: str
    what: str
    rate: float
    ratio: float
    low: float
    high: float


def contest(
    contenders: Sequence[Contender], rounds: int, progress: Callable[[str], None] = lambda _: None
) -> list[Score]:
    """Let everyone run in turn; the first is the baseline of the ratios. A first round that is not counted warms up."""
    rates: list[list[float]] = [[] for _ in contenders]
    for number in range(rounds + 1):
        for contender, found in zip(contenders, rates, strict=True):
            progress(contender.name)
            begin = time.perf_counter()
            seconds = contender.run()
            spent = time.perf_counter() - begin
            if number:
                found.append(seconds / spent)
    scores = []
    for contender, found in zip(contenders, rates, strict=True):
        ratios = [a / b for a, b in zip(found, rates[0], strict=True)]
        middle = statistics.median(ratios)
        scores.append(Score(contender.name, contender.what, statistics.median(found), middle, min(ratios), max(ratios)))
    return scores
