"""Identified parameters with 95 % intervals, and substitutes for parameters that the
flights cannot identify.

One list of shares of information says what is not in the data. Such a number is put
back to its start, and the others are fitted to that: what a flight does not show of a
vehicle is what was known before.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace

import numpy as np

from skyarm.identify.held_out_errors import HeldOut
from skyarm.identify.identified_parts import IdentifiedSurroundings
from skyarm.identify.unknowns import ACCELEROMETER, Reported, Unknown
from skyarm.identify.window_fit import NORMAL, WindowFit, at_least, variances_of
from skyarm.records.arrays import Array, Mask
from skyarm.records.immutable import immutable, positional
from skyarm.vehicle import Vehicle

NOT_SHOWN = "not in this data"
"""Reason for a parameter on which the flights give less information than the prior."""

APART = f"{NOT_SHOWN} apart from "
"""Prefix of the reason for a parameter known only together with another one, whose name
follows."""

GIVEN = "Total mass and rotor places are given; inertia scales with both."
"""Note on the given numbers: flights show forces per mass, and torques as these times
the distances of the rotors."""

SHOWN = 0.5
"""Least fraction of a parameter's information that the flights must give: as much as
was known before."""

LAGS = ("delay", "rotors.time_constant_up", "rotors.time_constant_down")
"""Parameters of the rotor response that commands below 40 Hz do not show."""


@immutable
class IdentifiedNumber:
    """Identified parameter with its 95 % interval.

    Attributes:
        name: name in a vehicle file, or in the vehicle's surroundings.
        unit: SI.
        value, low, high: estimate and interval, of data and what was known before.
        start: value before.
        data_share: share of its information that the flights give, 0 to 1.
        reason: why the flights do not show it, else empty.
        widened: times by which the interval is wider, as flights disagree.
    """

    name: str
    unit: str
    value: float
    low: float
    high: float
    start: float
    data_share: float
    reason: str = ""
    widened: float = 1.0

    @property
    def is_known(self) -> bool:
        """True if the flights identify the parameter."""
        return not self.reason


@immutable(eq=False)
class Identified:
    """Vehicle that was identified from flights.

    Attributes:
        numbers: each with its interval.
        correlation: (numbers, numbers) of their errors.
        vehicle: the start vehicle with the numbers that the flights show; the rest is
            the start's.
        surroundings: delays, places and offsets.
        explained: row -> share that the model explains, 0 to 1, of its variance in a
            window beyond a straight line and white noise.
        deviation: row -> standard deviation of its errors.
        settled: whether the search came to rest.
        seconds: duration of the flight that counted, s.
        period: s, between samples of the gyroscope.
        held_out: errors of predictions of other flights, if any were asked for.
        absent: channel that no flight has -> number -> times by which its interval is
            wider than with that channel.
        counted: whether any part of each flight of :func:`skyarm.identify_flights` was
            long enough to count.
        sampled: whether commands were taken as samples of a faster loop's, since held
            ones would act before they come.
    """

    numbers: tuple[IdentifiedNumber, ...]
    correlation: Array
    vehicle: Vehicle
    surroundings: IdentifiedSurroundings
    explained: Mapping[str, float]
    deviation: Mapping[str, float]
    settled: bool
    seconds: float
    searched: Mapping[str, float] = field(default_factory=dict)
    period: float = 0.0
    held_out: HeldOut | None = None
    absent: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    counted: tuple[bool, ...] = ()
    sampled: bool = False

    def __getitem__(self, name: str) -> IdentifiedNumber:
        """Identified parameter by its name.

        Raises:
            KeyError: there is none of this name.
        """
        for each in self.numbers:
            if each.name == name:
                return each
        raise KeyError(name)


@positional(eq=False)
class Scale:
    """Linearisation of the reported parameters about their estimates; of positive ones,
    of their logarithms.

    Attributes:
        reported: reported numbers.
        values, starts: estimates, and values before. positive: mask of the numbers
            whose logarithm is meant.
        rows: (reported, searched) slopes.
        before: (reported,) variances of what was known before.
    """

    reported: list[Reported]
    values: Array
    starts: Array
    positive: Mask
    rows: Array
    before: Array

    @property
    def off(self) -> Array:
        """Differences of the start values from the estimates, logarithmic for positive
        parameters.
        """
        # both branches are computed, so those of any sign get a ratio with a logarithm
        ratio = np.where(
            self.positive, self.starts / np.where(self.positive, self.values, 1.0), 1.0
        )
        return np.where(self.positive, np.log(ratio), self.starts - self.values)


def scale_of(
    found: WindowFit,
    unknowns: Sequence[Unknown],
    reported: Sequence[Reported],
    known: Mapping[str, float],
) -> Scale:
    """Linearise the reported parameters about an estimate, as functions of the searched
    ones, for given known ones.
    """
    place = {each.name: i for i, each in enumerate(unknowns)}
    shown = [each for each in reported if any(part in place for part in each.parts)]
    values = np.zeros(len(shown))
    starts = np.zeros(len(shown))
    positive = np.zeros(len(shown), dtype=bool)
    rows = np.zeros((len(shown), len(unknowns)))
    for k, each in enumerate(shown):
        for name in each.parts:
            if name not in place:
                values[k] += known[name]
                starts[k] += known[name]
                continue
            unknown = unknowns[place[name]]
            value = unknown.value(float(found.values[place[name]]))
            values[k] += value
            starts[k] += unknown.start
            positive[k] = unknown.positive
            rows[k, place[name]] = value if unknown.positive else 1.0
        if positive[k]:
            # slopes of the logarithm, by which positive numbers are reported
            rows[k] /= values[k]
    spreads = np.array([each.spread for each in unknowns])
    return Scale(shown, values, starts, positive, rows, rows**2 @ spreads**2)


def identified_numbers(
    found: WindowFit, scale: Scale, sample: float, flights: Sequence[str] = ()
) -> tuple[tuple[IdentifiedNumber, ...], Array]:
    """Identified parameters with intervals, and the correlations of their errors.

    Args:
        found: fit.
        scale: reported numbers.
        sample: s, between samples of the flights, of which half is the least that an
            accelerometer's delay is off.
        flights: name of the flight of each stretch; numbers on which flights disagree
            get wider intervals.
    """
    covariance = scale.rows @ found.covariance @ scale.rows.T
    before = scale.before
    # the larger of both: an interval is never narrower than by the curvature
    after = np.maximum(
        np.diag(covariance), np.diag(scale.rows @ found.curvature @ scale.rows.T)
    )
    wider = disagreement(found, scale, after, flights)
    # a number that few blocks tell is known as well as its interval is narrow; what the
    # data blur, as before
    halves = np.minimum(found.half_widths(scale.rows) * wider, NORMAL * np.sqrt(before))
    shares = 1.0 - (halves / NORMAL) ** 2 / before
    # whatever the fit says: a sensor that averages in silence is off by half a sample
    sampling = np.array(
        [0.5 * sample * (each.name == ACCELEROMETER) for each in scale.reported]
    )
    halves = np.hypot(halves, sampling)
    numbers = []
    for k, each in enumerate(scale.reported):
        value, half = float(scale.values[k]), float(halves[k])
        low, high = (
            (value * np.exp(-half), value * np.exp(half))
            if scale.positive[k]
            else (value - half, value + half)
        )
        numbers.append(
            IdentifiedNumber(
                name=each.name,
                unit=each.unit,
                value=value,
                low=float(low),
                high=float(high),
                start=float(scale.starts[k]),
                data_share=float(shares[k]),
                reason="" if shares[k] >= SHOWN else NOT_SHOWN,
                widened=float(wider[k]),
            )
        )
    deviations = np.sqrt(np.diag(covariance))
    return tuple(numbers), covariance / np.outer(deviations, deviations)


def disagreement(
    found: WindowFit, scale: Scale, after: Array, flights: Sequence[str]
) -> Array:
    """Birge ratio (parameters,), at least 1: spread of estimates between flights over
    that expected from noise.

    The ratio of Birge (1932), by which the Particle Data Group scales errors: the root
    of chi squared over its degrees of freedom, of the estimates of each flight alone,
    one linear step from the common one. Flights that do not show a number do not count.

    Args:
        found: fit of all flights.
        scale: reported numbers.
        after: (numbers,) variances by all flights.
        flights: name of the flight of each stretch.
    """
    ratio = np.ones(len(scale.rows))
    names = sorted(set(flights))
    if len(names) < 2:
        return ratio
    prior = found.prior_information
    # by what was known before, at the estimate of all
    pulled = -found.stretch_scores.sum(axis=0)
    off, variances = [], []
    for name in names:
        own = [k for k, each in enumerate(flights) if each == name]
        spread: Array = np.asarray(
            np.linalg.inv(
                at_least(found.stretch_information[own].sum(axis=0) + prior, prior)
            )
        )
        off.append(
            -scale.rows @ spread @ (found.stretch_scores[own].sum(axis=0) + pulled)
        )
        variances.append(variances_of(scale.rows, spread))
    # curvature counts white noise alone: the variance of each flight is taken to be
    # larger by the factor of all flights together
    noise = after / variances_of(scale.rows, found.curvature)
    variance = np.stack(variances) * noise
    weights = np.where(1.0 - variance / scale.before >= SHOWN, 1.0 / variance, 0.0)
    # a number that no flight shows has no weight, and its ratio is not used
    total = np.maximum(weights.sum(axis=0), 1e-300)
    freedom = (weights > 0.0).sum(axis=0) - 1
    mean = (weights * off).sum(axis=0) / total
    square = (weights * (np.stack(off) - mean) ** 2).sum(axis=0) / np.maximum(
        freedom, 1
    )
    return np.where(freedom > 0, np.maximum(np.sqrt(square), 1.0), ratio)


def bound_number(found: IdentifiedNumber, least: float) -> IdentifiedNumber:
    """Clip a parameter and its interval to a physical bound; unidentified if the whole
    interval lies beyond it.
    """
    if found.low >= least or found.reason:
        return found
    if found.high <= least:
        return replace(found, reason=NOT_SHOWN)
    return replace(found, low=least, value=max(found.value, least))


@positional(eq=False)
class Conditioned:
    """Estimate conditioned on the start values of parameters that the flights cannot
    identify.

    Attributes:
        values: (P,) searched values.
        replaced: places of the numbers that are at their starts.
        beside: place of a number that shows beside one of these only -> place of that
            one.
    """

    values: Array
    replaced: Sequence[int]
    beside: Mapping[int, int]


def condition_on_start(
    values: Array,
    spread: Array,
    rows: Array,
    off: Array,
    before: Array,
    shares: Array,
    groups: Sequence[Sequence[int]],
) -> Conditioned:
    """Reset unidentified parameters to their start values, and refit the others under
    this condition.

    What is known least is put back first. Of two numbers of which the flights show the
    ratio only, one thus stays at its start and the other keeps the ratio.

    Args:
        values: (P,) what was searched and found.
        spread: (P, P) covariance of its errors.
        rows: (numbers, P) slopes of the numbers.
        off: (numbers,) what their starts are off them.
        before: (numbers,) variances of what was known of them.
        shares: (numbers,) of their information that the flights give, as they are told.
        groups: places of the numbers that may be put back; those of the first group
            come first.
    """
    values, spread, off = values.copy(), spread.copy(), off.copy()
    first = spread.copy()
    # scaled so that each begins with the share that is reported of it
    correction = (
        (1.0 - shares) * before / np.maximum(variances_of(rows, spread), 1e-300)
    )
    replaced, beside = list[int](), dict[int, int]()
    for group in groups:
        left = [i for i in group if shares[i] < SHOWN]
        while left:
            now = [
                1.0 - correction[i] * float(rows[i] @ spread @ rows[i]) / before[i]
                for i in left
            ]
            # of those known alike the first, however they are rounded
            least = int(np.argmin(np.round(now, 6)))
            if now[least] >= SHOWN:
                break
            row, shift = rows[left[least]], off[left[least]]
            gain = spread @ row / float(row @ spread @ row)
            values += gain * shift
            off -= rows @ gain * shift
            spread -= np.outer(gain, row @ spread)
            replaced.append(left.pop(least))
        for i in left:
            sizes = [
                abs(float(rows[i] @ first @ rows[j]))
                / float(rows[j] @ first @ rows[j]) ** 0.5
                for j in replaced
            ]
            beside[i] = replaced[int(np.argmax(sizes))]
    return Conditioned(values, replaced, beside)


def at_starts(
    plain: Mapping[str, float],
    scale: Scale,
    replaced: Sequence[int],
    searched: Sequence[str],
    shown: Mapping[int, float],
    found: Mapping[str, float],
) -> dict[str, float]:
    """Parameter values by name; those that are shown and those reset to start values,
    also sums, are exactly these.

    Shown numbers and starts that no body has together are left as they were found.

    Args:
        plain: numbers, conditioned on the starts.
        scale: reported numbers.
        replaced: places of those that were put back.
        searched: names of the searched ones.
        shown: values that the table prints, by their places.
        found: numbers before they were conditioned.
    """
    place = {name: i for i, name in enumerate(searched)}
    sums = np.zeros((len(scale.reported), len(searched)))
    totals = np.zeros(len(scale.reported))
    for k, each in enumerate(scale.reported):
        given = sum(plain[part] for part in each.parts if part not in place)
        whole = (
            scale.starts[k]
            if k in replaced
            else sum(plain[part] for part in each.parts)
        )
        totals[k] = shown.get(k, whole) - given
        sums[k, [place[part] for part in each.parts if part in place]] = 1.0
    # not as many reported as searched numbers: none follow from the others alone
    if sums.shape[0] != sums.shape[1]:
        return dict(plain)
    solved = dict(zip(searched, np.linalg.solve(sums, totals).tolist(), strict=True))
    rising = set[str]()
    for k, each in enumerate(scale.reported):
        if scale.positive[k]:
            rising.update(each.parts)
    impossible = {name for name in rising & set(solved) if solved[name] <= 0.0}
    together = list[str]()
    for each in scale.reported:
        if impossible & {*each.parts}:
            together += each.parts
    return {**plain, **solved, **{name: found[name] for name in together}}
