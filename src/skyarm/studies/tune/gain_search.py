"""Gain search: random scatter about a centre, then parallel CMA-ES runs with low to
high weight on control effort.

One covariance matrix adaptation (Hansen, Ostermeier 2001; the package ``cmaes``) for
each weight of :data:`skyarm.studies.tune.candidate_flights.WEIGHTS`; all of them ask at
once, so that their candidates fly in one batch, and all learn from one archive: each
begins at the best candidate of its weight so far, and twice more on the way.

A round's candidates follow from the seed and the scores before it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from skyarm.compile.machine_code import missing_extra
from skyarm.records.arrays import Array
from skyarm.records.immutable import immutable
from skyarm.studies.sweep.sobol import BITS, DIMENSIONS, sobol
from skyarm.studies.tune.candidate_flights import WEIGHTS, Scores
from skyarm.studies.tune.law_knobs import LARGEST_FACTOR, GainKnob

try:
    from cmaes import CMA
except (
    ImportError
) as error:  # pragma: no cover  (the library is there when this is tested)
    raise missing_extra("tune") from error

BOX = math.log(LARGEST_FACTOR)

STEPS = (0.4, 0.25, 0.15)
"""Initial standard deviations of the logarithms of the factors in CMA-ES, and after its
restarts, chosen: each restart begins nearer to the best candidate so far."""

LINE = 24
"""Number of initial candidates with one common bandwidth factor for the whole loop,
chosen."""

REACHES = (0.15, 0.3, 0.6)
"""Sizes of the initial scatter about the start and known values, a third of it each, as
fractions of the box."""


@immutable
class Effort:
    """Size of a gain search: numbers of candidates, rounds and perturbed plants.

    Attributes:
        scatter: candidates of the first round. population: population of each CMA-ES in
            each round.
        rounds: number of rounds.
        plants: plants that each candidate flies. first_plants: plants that one of the
            scatter flies.
    """

    scatter: int = 240
    population: int = 10
    rounds: int = 28
    plants: int = 24
    first_plants: int = 8

    @property
    def candidates(self) -> int:
        """Total number of gain candidates of the search."""
        return self.scatter + self.rounds * self.population * len(WEIGHTS)

    def scale(self, candidates: int, plants: int) -> Effort:
        """Search size scaled to about a given number of candidates, each flown on a
        given number of plants.
        """
        share = candidates / self.candidates
        # at least eight points beside the line, and two rounds; both chosen
        scatter = max(LINE + 8, round(self.scatter * share))
        rounds = max(
            2, round((candidates - scatter) / (self.population * len(WEIGHTS)))
        )
        first_plants = min(plants, self.first_plants)
        return replace(
            self,
            scatter=scatter,
            rounds=rounds,
            plants=plants,
            first_plants=first_plants,
        )


Judge = Callable[[int, Array, int], Scores]
"""(number of the round, logarithms of factors (candidates, knobs), plants) -> scores,
margins not looked at."""

Shortness = Callable[[Array], Array]
"""Function from logarithms of factors (candidates, knobs) to the cost of violated
margins (candidates,)."""

NOT_LOOKED_AT = 3.0
"""Cost of margins that were not evaluated because other candidates were better
without."""


def search(
    knobs: Sequence[GainKnob],
    effort: Effort,
    judge: Judge,
    *,
    seed: int,
    starts: Array | None = None,
) -> tuple[Array, list[Scores]]:
    """Search for gains from low to high control effort; returns all candidates and
    their scores.

    Args:
        knobs: tunable gains.
        effort: size of the search.
        judge: scores of a round's candidates.
        seed: key of the search.
        starts: (starts, knobs) the first candidates; factors of one if left out.

    Returns:
        logarithms of the factors of every candidate (candidates, knobs), the starts
        first; scores by round.
    """
    asked = scatter(knobs, effort.scatter, seed, starts)
    rounds = [judge(0, asked, effort.first_plants)]
    logs = asked
    strategies = []
    begins = {1 + i * effort.rounds // len(STEPS): step for i, step in enumerate(STEPS)}
    for number in range(1, effort.rounds + 1):
        if number in begins:
            step = begins[number]
            strategies = [
                _strategy(
                    _best(logs, rounds, weight),
                    step,
                    effort.population,
                    # a seed for each strategy and restart
                    seed + 1000 * number + i,
                    _bounds(knobs),
                )
                for i, weight in enumerate(WEIGHTS)
            ]
        asked = np.array(
            [each.ask() for each in strategies for _ in range(effort.population)]
        )
        scores = judge(number, asked, effort.plants)
        for i, (strategy, weight) in enumerate(zip(strategies, WEIGHTS, strict=True)):
            mine = slice(i * effort.population, (i + 1) * effort.population)
            strategy.tell(
                list(zip(asked[mine], scores.cost(weight)[mine].tolist(), strict=True))
            )
        logs = np.vstack([logs, asked])
        rounds.append(scores)
    return logs, rounds


def with_margins(
    scores: Scores,
    asked: Array,
    groups: Sequence[tuple[float, slice, int]],
    short: Shortness,
) -> Scores:
    """Scores with a penalty for missing stability margins, computed for the best
    candidates only.

    Args:
        scores: scores of a round, without margins.
        asked: candidates of the round.
        groups: (weight, candidates, number of the best ones that need margins).
        short: looks at the margins.
    """
    shortfalls = np.full(len(asked), np.nan)
    # margins change who leads: until every leader has its own
    while True:
        now = replace(scores, short=np.nan_to_num(shortfalls, nan=0.0))
        leading = [
            # of equal costs the earlier one leads
            which.start + np.argsort(now.cost(weight)[which], kind="stable")[:count]
            for weight, which, count in groups
        ]
        leaders = np.unique(np.concatenate(leading))
        missing = leaders[np.isnan(shortfalls[leaders])]
        if not len(missing):
            return replace(
                scores, short=np.where(np.isnan(shortfalls), NOT_LOOKED_AT, shortfalls)
            )
        shortfalls[missing] = short(asked[missing])


def costs(found: Sequence[Scores], weight: float) -> Array:
    """Costs of all gain candidates of a search, for a given weight of control
    activity.
    """
    return np.concatenate([scores.cost(weight) for scores in found])


def _best(logs: Array, rounds: Sequence[Scores], weight: float) -> Array:
    """Gain candidate of least cost, among those simulated on all plants if there are
    any.
    """
    every = costs(rounds, weight)
    # the scatter flew fewer plants, which flatters it
    first = len(rounds[0].error) if len(rounds) > 1 else 0
    best: Array = logs[first + int(every[first:].argmin())]
    return best


def scatter(
    knobs: Sequence[GainKnob], count: int, seed: int, starts: Array | None = None
) -> Array:
    """First gain candidates: initial gains, gains scaled by bandwidth, and Sobol points
    about the initial gains.

    The first start are the gains that were given. They may be off by any factor: where
    others are known, nothing is scattered about them; where none are, the line goes
    through them twice, by bandwidth and by one factor for all.
    """
    begin = np.zeros((1, len(knobs))) if starts is None else starts
    centres = begin[1:] if len(begin) > 1 else begin
    # 0.6 of the box to both sides, chosen
    speeds = np.linspace(-0.6, 0.6, LINE) * BOX
    # half: a stiffness, of exponent 2, takes the whole factor, and a damping its root
    line = speeds[:, None] * np.array([exponent(knob) for knob in knobs]) * 0.5
    if len(begin) == 1:
        # nobody knows which way these are off: every other point has one factor for all
        # gains alike
        line[::2] = speeds[::2, None]
    rest = max(count - len(begin) - LINE, 0)
    # a run of points for each seed; point 0 is a corner
    # those of the next seed begin 4096 further: more than a usual scatter has
    numbers = np.arange(1 + 4096 * seed, 1 + 4096 * seed + rest)
    # of knobs beyond Sobol's dimensions
    points = np.random.default_rng(seed).uniform(size=(rest, len(knobs)))
    for k in range(min(len(knobs), DIMENSIONS)):
        points[:, k] = (sobol(numbers, k).astype(float) + 0.5) / 2.0**BITS
    reach = np.array(REACHES)[np.arange(rest) % len(REACHES)]
    around = centres[np.arange(rest) // len(REACHES) % len(centres)] + (
        2.0 * points - 1.0
    ) * (BOX * reach[:, None])
    low, high = _bounds(knobs).T
    candidates: Array = np.clip(np.vstack([begin, line, around]), low, high)
    return candidates


def exponent(knob: GainKnob) -> float:
    """Exponent of a gain's scaling with loop bandwidth: 2 for a stiffness, 1 for a
    damping or a filter.
    """
    stiff = ("1/s^2", "N/m", "N m/rad")
    return 2.0 if knob.unit.startswith(stiff) else 1.0


def _bounds(knobs: Sequence[GainKnob]) -> Array:
    """Bounds on the logarithm of each gain factor (gains, 2): those of its numbers; a
    fraction stays at most one.
    """

    def bounds(knob: GainKnob) -> list[float]:
        low, high = min(knob.values), max(knob.values)
        most = (
            min(knob.most, 1.0)
            if knob.path.endswith("share") and high <= 1.0
            else knob.most
        )
        least = -math.log(low / knob.least) if knob.least > 0.0 else -BOX
        # a number at its bound keeps an interval of some width
        return [
            max(-BOX, least),
            (min(BOX, math.log(most / high)) if most < math.inf else BOX) + 1e-9,
        ]

    return np.array([bounds(knob) for knob in knobs])


def _strategy(
    mean: Array, step: float, population: int, seed: int, bounds: Array
) -> CMA:
    # CMA wants its mean within its bounds and not on one
    inside = np.clip(mean, bounds[:, 0] + 1e-6, bounds[:, 1] - 1e-6)
    return CMA(
        mean=inside,
        sigma=step,
        bounds=bounds,
        # numpy's generator takes 32 bits
        seed=seed % 2**32,
        population_size=population,
    )
