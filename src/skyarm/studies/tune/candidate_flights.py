"""Flights of gain candidates through perturbed plants, and their scores."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from skyarm.log.metrics.windows import Window, Windows
from skyarm.records.arrays import AnyArray, Array, Columns, IntArray, Mask, doubles
from skyarm.records.immutable import immutable, positional
from skyarm.records.leaves import parts
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_record import Scenario
from skyarm.studies.compare.perturbed_plants import arm_length, hardest
from skyarm.studies.flights import Rows, Work, WorkRunner
from skyarm.studies.trial.table import values_of
from skyarm.studies.tune.excitation import KINDS, Plants
from skyarm.studies.tune.law_knobs import GainKnob

LARGEST_TILT = math.radians(80.0)
"""Tilt (rad) above which a flight counts as lost, even if it recovers."""

LOST = 100.0
"""Error (m) assigned to a lost flight."""

LIMITED, JITTER, TILT = "rotor_saturation", "rotor_jitter", "tilt_max"
"""Metrics: fraction of control periods with a rotor at its limit; RMS change of a rotor
command per period, rad/s; largest tilt, rad."""

OWN = len(KINDS)
"""Index of the kind of motion that is the scenario's own."""

EVERY = 4
"""Number of plants of which the last flies the scenario's own motion; no multiple of
the other kinds, which stay balanced."""

LATEST, LOOKED_AT = 10.0, 5.0
"""Latest start and duration (s) of the scored interval; later errors are left to the
final check."""


@immutable
class CandidateResults:
    """Errors and control effort of tuning flights, as arrays (gain candidates,
    perturbed plants).

    Attributes:
        error: m, of what the law tracks: of the tip; a law that does not track the tip
            on its own is charged the mean of the tip's error and of base error plus arm
            length times joint error; without a tip the latter. Of two windows, before
            and in the gust, the geometric mean: each counts by its ratio of
            improvement.
        tip, base: m, mean distances in the first window from the continuous reference;
            the tip's is that of the base where there is none.
        jitter: rad/s, RMS change of a rotor command per period. effort: N m or N, RMS
            of all joint efforts.
        lost: ended early, or tilted by more than 80 degrees.
        saturated: share of periods with a rotor at its limit, as the metric
            ``rotor_saturation``; NaN if not measured.
        pull: N, RMS error of the pull between the members of a team; zero of one
            vehicle.
        kinds: (plants,) kind of motion of each.
    """

    error: Array
    tip: Array
    base: Array
    pull: Array
    jitter: Array
    effort: Array
    lost: Mask
    saturated: Array
    kinds: IntArray


def shorten(own: Scenario) -> Scenario:
    """Scenario with a flight shortened for the gain search, to the first seconds of its
    steady window.

    Args:
        own: flight as :func:`skyarm.studies.tune.excitation.tuning_flight` makes it.
    """
    steady = Windows().of_flight(own.duration, own.windows).steady
    start = min(steady.start, LATEST)
    stop = min(steady.stop, start + LOOKED_AT)
    # rounding of the product must not add a period
    periods = math.ceil(stop * own.rates.control - 1e-9)
    return replace(
        own,
        duration=periods / own.rates.control,
        windows=Windows(steady=Window(start, stop)),
    )


def with_own(plants: Plants) -> Plants:
    """Perturbed plants, every fourth of which flies the scenario's own reference, the
    others a random one.
    """
    kinds = plants.kinds.copy()
    kinds[EVERY - 1 :: EVERY] = OWN
    return replace(plants, kinds=kinds)


LANES = 300
"""Approximate number of flights of a work; a round consists of some works, which
processes share."""


class CandidateFlights:
    """Flights of many gain candidates on perturbed plants.

    Gains that are good on drawn motions alone may be worse on the user's flight. The
    scenario's own motion is therefore one more kind; its reference may be of any shape,
    so that the plants that fly it are works of their own.

    Args:
        scenario: flight as :func:`skyarm.studies.tune.excitation.tuning_flight` made
            it. knobs: gains of its law.
        plants: plants to fly.
        runner: flies them; results do not depend on it.
        own: along the scenario's own motion, as :func:`shorten` made it; the plants are
            those of :func:`with_own`.
        seed: seed of the noise; each plant has its own, which all candidates share.
        gust: the flight has a window of a gust.
        saturation: measure it.
    """

    word = "controller"
    """First word of the parameter paths of the gains."""

    def __init__(
        self,
        scenario: Scenario,
        knobs: Sequence[GainKnob],
        plants: Plants,
        runner: WorkRunner,
        *,
        own: Scenario | None = None,
        seed: int = 0,
        gust: bool = False,
        saturation: bool = False,
    ) -> None:
        self.knobs = tuple(knobs)
        self.plants = plants
        self._runner = runner
        # the scenario's own reference has none of the numbers of drawn motions
        still = _without_motions(plants)
        self._own = (
            None
            if own is None
            else CandidateFlights(own, knobs, still, runner, seed=seed)
        )
        self._windows = ("", "gust_") if gust else ("",)
        self._work = Work(
            label="",
            scenario=scenario,
            stiffest=self._stiffest(scenario),
            metrics=self._metrics(scenario, saturation),
            seed=seed,
            # twice as fast; in 30 s off by 5 micrometres at most (docs/performance.md)
            precision="single",
        )

    def _stiffest(self, scenario: Scenario) -> Scenario:
        """Scenario that fixes the integration steps of all plants."""
        return with_numbers(scenario, hardest(scenario, self.plants.values))

    def _metrics(self, scenario: Scenario, saturation: bool) -> tuple[str, ...]:
        """Metrics of the flights."""
        vehicle = scenario.agent.vehicle
        self._arm = arm_length(vehicle)
        self._has_tip = bool(vehicle.end_effector)
        self._keeps_tip = scenario.agent.controller.keeps_tip
        # a servo receives setpoints: its torque is its own
        self._efforts = tuple(
            f"tau{i + 1}_rms"
            for i, setpoint in enumerate(scenario.agent.commands_setpoints)
            if not setpoint
        )
        self._errors = (
            ("position", "joint", "ee") if self._has_tip else ("position", "joint")
        )
        metrics = [
            _error(window, each) for window in self._windows for each in self._errors
        ]
        metrics += [LIMITED] if saturation else []
        return (*metrics, JITTER, TILT, *self._efforts)

    def fly(
        self,
        stage: str,
        logs: Array,
        plants: int | None = None,
        others: Plants | None = None,
    ) -> CandidateResults:
        """Simulate every gain candidate on the first perturbed plants, up to a given
        number.

        Args:
            stage: begins the labels of the works.
            logs: (candidates, knobs) logarithms of factors.
            plants: number of plants; all if left out.
            others: plants in place of its own plants, with the same numbers.
        """
        flown = self.plants if others is None else others
        flown = flown.select(np.arange(flown.count)[:plants])
        if self._own is None:
            works = self._works(stage, logs, flown)
            return self._results(len(logs), flown, self._runner.rows(works))
        mine = flown.kinds == OWN
        drawn = flown.select(np.flatnonzero(~mine))
        own = flown.select(np.flatnonzero(mine))
        works = self._works(stage, logs, drawn)
        further = self._own._works(f"{stage}.own", logs, _without_motions(own))
        rows = self._runner.rows([*works, *further])
        one = rows[: len(works)]
        other = rows[len(works) :]
        return _join(
            mine,
            self._results(len(logs), drawn, one),
            self._own._results(len(logs), own, other),
        )

    def _works(self, stage: str, logs: Array, plants: Plants) -> list[Work]:
        """Work items for every gain candidate on every plant, split independently of
        the number of workers.
        """
        each = plants.count
        pieces = np.array_split(
            np.exp(logs), max(1, min(len(logs), round(len(logs) * each / LANES)))
        )
        works = []
        for i, piece in enumerate(pieces):
            values: Columns = {}
            for knob, column in zip(self.knobs, piece.T, strict=True):
                factors = np.repeat(column, each)
                values |= {
                    f"{self.word}.{'.'.join(place)}": factors * number
                    for place, number in knob.numbers
                }
            values |= {
                path: np.tile(numbers, len(piece))
                for path, numbers in plants.values.items()
            }
            episodes = np.tile(np.arange(each), len(piece))
            label = f"{stage}.{i + 1}"
            works.append(
                replace(self._work, label=label, columns=values, episodes=episodes)
            )
        return works

    def _results(
        self, count: int, plants: Plants, rows: Sequence[Rows]
    ) -> CandidateResults:
        """Errors and control effort of some gain candidates, from their result rows."""

        def column(name: str) -> AnyArray:
            return np.concatenate([each[name] for each in rows]).reshape(
                count, plants.count
            )

        # a flight that ended before the window has NaN there
        metrics = {name: doubles(column(name)) for name in self._work.metrics}
        # of several vehicles the largest counts
        tilt, jitter = (
            np.max(values_of(metrics, name), axis=0) for name in (TILT, JITTER)
        )
        limited = values_of(metrics, LIMITED)
        # not ">=": a tilt that is no number is of a lost flight
        lost = (column("status") != "completed") | ~(tilt < LARGEST_TILT)
        return CandidateResults(
            **self._errors_of(metrics, lost),
            # what is missing counts as much as a lost flight
            jitter=np.nan_to_num(jitter, nan=LOST, posinf=LOST),
            lost=lost,
            saturated=(
                # a flight that ended before the window counts as limited all along
                np.nan_to_num(np.max(limited, axis=0), nan=1.0)
                if limited
                else np.full(lost.shape, np.nan)
            ),
            kinds=plants.kinds,
        )

    def _errors_of(self, metrics: Mapping[str, Array], lost: Mask) -> dict[str, Array]:
        """Errors, pull and effort of the results (candidates, plants), by name."""
        parts = [
            {name: metrics[_error(window, name)] for name in self._errors}
            for window in self._windows
        ]
        product = np.prod([self._tracking_error(part) for part in parts], axis=0)
        base = parts[0]["position"]
        none = np.zeros(lost.shape)
        squares = sum((metrics[name] ** 2 for name in self._efforts), none)
        return {
            # geometric mean of the windows, in which their ratios count alike
            "error": penalize(product ** (1.0 / len(parts)), lost),
            "tip": penalize(parts[0].get("ee", base), lost),
            "base": penalize(base, lost),
            "pull": none,
            "effort": np.nan_to_num(np.sqrt(squares), nan=LOST),
        }

    def _tracking_error(self, errors: Mapping[str, Array]) -> Array:
        """Mean error of the tracked quantity in one time window."""
        # a joint's error at the length of the arm, m
        posture = errors["position"] + self._arm * errors["joint"]
        if self._keeps_tip:
            return errors["ee"]
        # one half each, chosen
        return 0.5 * (errors["ee"] + posture) if self._has_tip else posture


def of_drawn(flown: CandidateResults) -> CandidateResults:
    """Results of the plants that flew random reference motions, without the scenario's
    own motion.
    """
    which = flown.kinds != OWN
    return CandidateResults(
        **{name: table[..., which] for name, table in parts(flown).items()}
    )


def _without_motions(plants: Plants) -> Plants:
    values = {
        path: numbers
        for path, numbers in plants.values.items()
        if not path.startswith("reference.")
    }
    return replace(plants, values=values)


def _join(
    mine: Mask, drawn: CandidateResults, own: CandidateResults
) -> CandidateResults:
    """Merge flight results along random motions and along the scenario's own motion, in
    the order of the plants.
    """
    tables = {}
    for name, some in parts(drawn).items():
        tables[name] = np.empty((*some.shape[:-1], len(mine)), dtype=some.dtype)
        tables[name][..., ~mine], tables[name][..., mine] = some, getattr(own, name)
    return CandidateResults(**tables)


def _error(window: str, name: str) -> str:
    """Name of the metric of a quantity's mean error in a time window, against the
    continuous reference.
    """
    return f"{window}{name}_error_mean_continuous"


def penalize(error: Array, lost: Mask) -> Array:
    """Errors with the largest one for lost flights and for missing values."""
    return np.where(lost, LOST, np.minimum(np.nan_to_num(error, nan=LOST), LOST))


QUANTILE = 0.9
"""Quantile of the error over the plants of each kind of motion, chosen; of up to ten
plants, as each kind has in a usual search, it is the largest error."""

WEIGHTS = (2.0, 0.7, 0.25, 0.1, 0.03)
"""Weights of the logarithms of jitter and effort against that of the error, from calm
to stiff."""

LOSS = 100.0
"""Weight of the fraction of lost plants; one of 16 costs more than error and jitter can
gain."""

SMALLEST = 1e-5
"""Error (m) and jitter (rad/s) below which improvements no longer count."""


@positional
class Scores:
    """Scores (candidates,) of gain candidates: errors, rotor jitter, joint effort,
    crashes, missing margin.

    Attributes:
        error, tip: m, 90 % quantiles over the plants, of kinds of motion the geometric
            mean. pull: N, likewise.
        jitter: rad/s, effort: N m, medians over the plants.
        lost: share of the plants. short: cost of falling short of the margins.
    """

    error: Array
    tip: Array
    pull: Array
    jitter: Array
    effort: Array
    lost: Array
    short: Array

    def part(self, which: slice | Sequence[int]) -> Scores:
        """Scores of a subset of the gain candidates."""
        return Scores(**{name: values[which] for name, values in parts(self).items()})

    def numbers(self, i: int, *names: str) -> dict[str, float]:
        """Some scores of one set of gains by their names."""
        return {name: float(getattr(self, name)[i]) for name in names}

    @property
    def activity(self) -> Array:
        """Control activity of each candidate: ln(rotor jitter) + ln(joint effort)."""
        return activity(self.jitter, self.effort)

    def cost(self, weight: float) -> Array:
        """Cost of gain candidates: ln error + weight (ln jitter + ln effort) +
        penalties for crashes and margins.

        Logarithms make every ratio of improvement count alike, whatever the vehicle's
        size.
        """
        return (
            np.log(self.error + SMALLEST)
            + weight * self.activity
            + LOSS * self.lost
            + self.short
        )


def activity(jitter: Array | float, effort: Array | float) -> Array:
    """Control activity ln(rotor jitter) + ln(joint effort), elementwise; the effort is
    left out if zero.
    """
    efforts = doubles(effort)
    return np.log(jitter + SMALLEST) + np.where(
        # zero is of a vehicle without joint torques, of which no ratio counts
        efforts > 0.0,
        np.log(efforts + SMALLEST),
        0.0,
    )


def scores(flown: CandidateResults) -> Scores:
    """Scores of gain candidates from their flights over all perturbed plants."""
    return Scores(
        error=_error_quantile(flown.error, flown.kinds),
        tip=_error_quantile(flown.tip, flown.kinds),
        pull=_error_quantile(flown.pull, flown.kinds),
        jitter=np.median(flown.jitter, axis=1),
        effort=np.median(flown.effort, axis=1),
        lost=flown.lost.mean(axis=1),
        short=np.zeros(len(flown.lost)),
    )


def _error_quantile(errors: Array, kinds: IntArray) -> Array:
    """90 % quantile of the error over plants per kind of motion, combined over kinds by
    geometric mean.

    One quantile over all would be that of the hardest kind alone.
    """
    # "higher": the error of a plant, where few plants leave gaps between quantiles
    each = [
        np.quantile(errors[:, kinds == kind], QUANTILE, axis=1, method="higher")
        for kind in np.unique(kinds)
    ]
    combined: Array = np.exp(
        np.mean([np.log(np.maximum(one, SMALLEST)) for one in each], axis=0)
    )
    return combined
