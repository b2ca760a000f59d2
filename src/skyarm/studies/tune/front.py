"""Pareto front of tuning candidates from low to high control effort, and the rule that
selects the final gains.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from skyarm.records.immutable import immutable
from skyarm.studies.tune.candidate_flights import WEIGHTS, Scores, activity
from skyarm.studies.tune.gain_search import costs

POINTS = 16
"""Number of points of the front."""

WORTH = 1.05
"""Factor on the least error that meets the constraints, within which the calmest point
is picked."""

SATURATED = 0.05
"""Largest fraction of control periods with a rotor at its limit, median over the
plants."""

RULE = (
    "the calmest point that loses no plant, keeps its rotors below saturation, meets"
    f" the margins, and whose error is within {WORTH - 1.0:.0%} of the least of such"
    " points and not above that of gains known before, whose tip error it keeps within"
    " the same"
)


@immutable
class Required:
    """Required stability margins of tuned gains: delay (s), and gain as a factor."""

    delay: float
    gain: float


@immutable
class LoopMargins:
    """Stability margins of gains in hover: delay (s), and gain intervals; or the reason
    why none were computed.
    """

    delay: float
    rotors: tuple[float, float]
    joints: tuple[float, float]
    why_none: str = ""

    def meet(self, required: Required) -> bool:
        """True if the stability margins meet the required ones, or could not be
        computed.
        """
        return self.shortness(required) <= 1.0

    def shortness(self, required: Required) -> float:
        """Largest ratio of required to actual margin; above 1 the requirement is
        violated.
        """
        # nothing is held against gains of which no margin is known: plants judge them
        if self.why_none:
            return 0.0
        # no margin at all is no division by zero
        worst = required.delay / max(self.delay, 1e-9)
        for low, high in (self.rotors, self.joints):
            worst = max(
                worst,
                required.gain / high if high > 0.0 else math.inf,
                low * required.gain,
            )
        return worst


@immutable
class Point:
    """Set of gains on the Pareto front, with its scores on plants that the search did
    not use.

    Attributes:
        logs: (knobs,) logarithms of factors.
        error: m, 90 % quantile; the geometric mean of that in the gust and that along
            the scenario's own motion.
        tip: m, 90 % quantile along the latter. pull: N, of a team. jitter: rad/s.
            effort: N m. lost, saturated: shares.
        margins: margins in hover.
    """

    logs: tuple[float, ...]
    error: float
    tip: float
    jitter: float
    effort: float
    lost: float
    saturated: float
    margins: LoopMargins
    pull: float = 0.0

    @property
    def activity(self) -> float:
        """Control activity of these gains: ln(rotor jitter) + ln(joint effort)."""
        return float(activity(self.jitter, self.effort))


def finalists(found: Sequence[Scores], count: int) -> list[int]:
    """Indices of up to ``count`` candidates for the Pareto front, from low to high
    control effort.

    The cheapest of each weight, and between them those of the archive that nothing
    beats in both error and activity, as far apart in activity as may be. Only
    candidates that meet the margins count there.
    """
    error, lost, short, active = (
        np.concatenate([getattr(each, name) for each in found])
        for name in ("error", "lost", "short", "activity")
    )
    chosen = list(
        dict.fromkeys(int(costs(found, weight).argmin()) for weight in WEIGHTS)
    )
    fewest = lost + short <= (lost + short).min()
    # from calm to busy, each that errs less than all calmer ones is on the front
    order = np.flatnonzero(fewest)[np.argsort(active[fewest], kind="stable")]
    least = math.inf
    front = []
    for k in order:
        if error[k] < least:
            least = float(error[k])
            front.append(int(k))
    while len(chosen) < count:
        spare = [k for k in front if k not in chosen]
        if not spare:
            break
        chosen.append(
            max(spare, key=lambda k: min(abs(active[k] - active[c]) for c in chosen))
        )
    chosen.sort(key=lambda k: float(active[k]))
    return chosen


def pareto_front(points: Sequence[Point]) -> list[Point]:
    """Pareto front in error and control effort of the points with fewest lost plants,
    by rising control effort.
    """
    fewest = min(point.lost for point in points)
    left = sorted(
        (point for point in points if point.lost <= fewest),
        key=lambda point: (point.activity, point.error),
    )
    front: list[Point] = []
    for point in left:
        if not front or point.error < front[-1].error:
            front.append(point)
    return front


def front_of(
    starts: Sequence[Point], found: Sequence[Point], required: Required
) -> tuple[list[Point], int]:
    """Pareto front of tuned gains, and index of the selected gains, no worse than the
    initial ones.

    Where a start meets the constraints, the best of them is the measure: points whose
    error is above its own, or their tip's more than 5 % above, are not picked, though
    they stay on the front; where none is left, the start is picked. Else starts stay
    away: they are often calmer, and the rule would pick one for 5 % of the error.
    """

    def rank(point: Point) -> tuple[bool, float, float]:
        return (not is_allowed(point, required), point.lost, point.error)

    best = min(starts, key=rank)
    if is_allowed(best, required):
        allowed = [each for each in found if is_allowed(each, required)]
        fit = [
            each
            for each in allowed
            if each.error <= best.error and each.tip <= WORTH * best.tip
        ] or [best]
    else:
        fit = (
            [best, *found]
            if all(rank(best) <= rank(each) for each in found)
            else list(found)
        )
    picked = fit[pick(fit, required)]
    front = pareto_front([*found, picked])
    if picked not in front:
        # what beats it is not to be picked
        front = sorted(
            [*front, picked], key=lambda point: (point.activity, point.error)
        )
    return front, front.index(picked)


def pick(points: Sequence[Point], required: Required) -> int:
    """Index of the selected gains: least control effort among allowed ones, else least
    violation of the constraints.
    """
    allowed = [i for i, point in enumerate(points) if is_allowed(point, required)]
    if not allowed:

        def short(i: int) -> tuple[float, float, float]:
            # of equals, as where no hover settles, the one of least error
            return (
                points[i].lost,
                points[i].margins.shortness(required),
                points[i].error,
            )

        return min(range(len(points)), key=short)
    least = min(points[i].error for i in allowed)
    good = [i for i in allowed if points[i].error <= WORTH * least]
    return min(good, key=lambda i: points[i].activity)


def is_allowed(point: Point, required: Required) -> bool:
    """True if gains crash no plant, stay below rotor saturation and meet the required
    margins.
    """
    return (
        point.lost <= 0.0
        and not point.saturated > SATURATED
        and point.margins.meet(required)
    )
