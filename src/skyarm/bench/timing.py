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
        work_rate, work_ratio: the same per second of processor time of all threads, which other programs on the
            machine hardly disturb.
    """

    name: str
    what: str
    rate: float
    ratio: float
    low: float
    high: float
    work_rate: float
    work_ratio: float


def contest(
    contenders: Sequence[Contender], rounds: int, progress: Callable[[str], None] = lambda _: None
) -> list[Score]:
    """Let everyone run in turn; the first is the baseline of the ratios. A first round that is not counted warms up."""
    rates: list[list[float]] = [[] for _ in contenders]
    works: list[list[float]] = [[] for _ in contenders]
    for number in range(rounds + 1):
        for contender, rate, work in zip(contenders, rates, works, strict=True):
            progress(contender.name)
            begin, worked = time.perf_counter(), time.process_time()
            seconds = contender.run()
            spent, done = time.perf_counter() - begin, time.process_time() - worked
            if number:
                rate.append(seconds / spent)
                work.append(seconds / done)
    scores = []
    for contender, rate, work in zip(contenders, rates, works, strict=True):
        ratios = _against(rate, rates[0])
        score = Score(
            name=contender.name,
            what=contender.what,
            rate=statistics.median(rate),
            ratio=statistics.median(ratios),
            low=min(ratios),
            high=max(ratios),
            work_rate=statistics.median(work),
            work_ratio=statistics.median(_against(work, works[0])),
        )
        scores.append(score)
    return scores


def _against(rates: Sequence[float], baseline: Sequence[float]) -> list[float]:
    return [a / b for a, b in zip(rates, baseline, strict=True)]
