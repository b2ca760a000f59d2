"""Flights of a comparison by controller, case and condition: their simulation, results
and statistics.

A law that can be traced flies all episodes of a cell as one batch; others, and every
law on MuJoCo's plant, fly one episode after the other, about a thousand times slower.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from skyarm.log.metrics.metric_catalogue import EFFORTS, GRASPS, row_names
from skyarm.log.metrics.shortfall import LARGEST_ERROR, TILTED
from skyarm.records.arrays import AnyArray as Array
from skyarm.records.arrays import Columns, Mask
from skyarm.records.immutable import immutable, positional
from skyarm.records.registry import names as registered
from skyarm.scenario.in_flight import is_traceable
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_record import Scenario
from skyarm.studies.compare.entrants import Entrant
from skyarm.studies.compare.perturbed_plants import draw, hardest
from skyarm.studies.compare.suite import Case, Condition
from skyarm.studies.flights import Rows, Work
from skyarm.studies.trial.facts import TrialSetting
from skyarm.studies.trial.table import spread, success_share, values_of
from skyarm.studies.trial.trial import Trial

JITTER, LIMITED = "rotor_jitter", "rotor_saturation"
"""Metrics that every table shows next to the tip error: RMS change of a rotor command
per control period (rad/s), and fraction of periods with a rotor at its limit."""

METRICS = (
    *(
        f"{what}_error_{how}_continuous"
        for what in ("position", "joint", "ee")
        for how in ("mean", "max")
    ),
    "gust_peak_x_continuous",
    "gust_ee_peak_x_continuous",
    "ee_error_last_mean_continuous",
    "ee_error_last_max_continuous",
    JITTER,
    LIMITED,
    "rate_rms",
    "tilt_max",
    "altitude_error_max_continuous",
)
"""Metrics of every flight, named as in :mod:`skyarm.log.metrics.metric_catalogue`; and
every joint's effort."""

ONE_BY_ONE = 8
"""Number of perturbed plants of a law whose flights fly one by one, each about a
thousand times as long as in a batch."""

Record = Mapping[str, Any]
"""Plain data of a results file."""

Document = dict[str, Any]
"""Plain data of a results file while it is written."""

NAMES = ("condition", "case", "law")
"""Columns of a row that identify a cell."""

FEW = 16
"""Number of episodes up to which full compiler optimisation takes longer than it
saves."""


@positional
class Cell:
    """Metrics of all episodes of one controller in one case under one condition.

    Attributes:
        metrics: columns by name; NaN where the episode ended before their window.
        status: "completed", or why it ended.
    """

    metrics: Mapping[str, Array]
    status: Array

    @classmethod
    def of_rows(cls, work: Work, rows: Rows) -> Cell:
        """Metrics and status from result rows, without the columns that identify the
        flights.
        """
        others = {"episode", "status", "end_time", *work.fixed, *work.columns}
        return cls(
            {name: column for name, column in rows.items() if name not in others},
            rows["status"],
        )

    @property
    def completed(self) -> Mask:
        """True for each episode that reached its planned end."""
        return np.asarray(self.status == "completed")

    @property
    def upright(self) -> Mask:
        """True for each episode in which the vehicle never tipped over."""
        return np.asarray(self.metrics["tilt_max"] <= TILTED)

    @property
    def tracked_to_end(self) -> Mask:
        """True for each completed, upright episode with a small mean tip error in its
        last seconds.
        """
        near = self.metrics["ee_error_last_mean_continuous"] <= LARGEST_ERROR
        return self.completed & self.upright & near


@immutable
class CellFlights:
    """Description of the flights of one controller in one case and condition.

    Attributes:
        entrant: controller. case, condition: case and condition of the flights. plant:
            kind of simulated plant.
        seed: seed of plants and noise.
    """

    entrant: Entrant
    case: Case
    condition: Condition
    plant: str = "rigid_body"
    seed: int = 0

    further_metrics: ClassVar[tuple[str, ...]] = ()
    """Metrics in addition to those that every comparison counts."""

    same_noise: ClassVar[bool] = False
    """True if all episodes have the noise of the first."""

    @property
    def name(self) -> tuple[str, str, str]:
        """Names of condition, case and controller of these flights."""
        return self.condition.name, self.case.name, self.entrant.name

    @property
    def label(self) -> str:
        """Unique name of these flights in a suite, for their result file and for
        progress output.
        """
        plant = "" if self.plant == "rigid_body" else f"_{self.plant}"
        return "__".join(self.name) + plant

    def work(self) -> Work:
        """Work item of these flights: scenario, perturbed parameters, noise keys and
        metrics.
        """
        scenario = self.scenario()
        values, count = self.values(scenario), self.episodes(scenario)
        names = dict(zip(NAMES, self.name, strict=True))
        return Work(
            label=self.label,
            scenario=scenario,
            columns=values,
            episodes=(
                np.zeros(count, dtype=int) if self.same_noise else np.arange(count)
            ),
            fixed={**names, "trial": self.trials(count)},
            metrics=self.metric_names(scenario.setpoints),
            windows=self.case.windows,
            seed=self.seed,
            stiffest=(
                with_numbers(scenario, stiff)
                if (stiff := hardest(scenario, values))
                else None
            ),
            effort=0 if count <= FEW else 2,
            alone=self.alone(scenario),
        )

    def scenario(self) -> Scenario:
        """Scenario that all flights have in common, before their perturbed parameters
        are set.
        """
        built = self.condition.apply(self.case.build())
        controller = self.entrant.controller(
            built.agent.model, noisy=self.condition.noisy
        )
        return dataclasses.replace(
            built.with_kind(self.plant).with_controller(controller), seed=self.seed
        )

    def values(self, scenario: Scenario) -> Columns:
        """Perturbed parameters of the flights: parameter path -> values (flights,)."""
        spread = self.condition.spread
        # drawn about the case as it is, whatever flies: every law meets the same plants
        return (
            draw(scenario, spread, self.episodes(scenario), seed=self.seed)
            if spread
            else {}
        )

    def alone(self, scenario: Scenario) -> bool:
        """True if the episodes are simulated one by one, not as a batch."""
        return self.plant != "rigid_body" or not is_traceable(scenario)

    @property
    def meets_perturbed_plants(self) -> bool:
        """True if every flight has its own perturbed plant."""
        return self.condition.spread is not None

    def episodes(self, scenario: Scenario) -> int:
        """Number of flights; perturbed ones are fewer if they cannot be simulated as a
        batch.
        """
        every = self.condition.episodes
        return (
            min(ONE_BY_ONE, every)
            if self.meets_perturbed_plants and self.alone(scenario)
            else every
        )

    def trials(self, count: int) -> Array:
        """Index of each flight (count,), which identifies its perturbed plant or noise
        seed.
        """
        return np.arange(count, dtype=float)

    def metric_names(self, setpoints: Mapping[str, Sequence[bool]]) -> tuple[str, ...]:
        """Names of the metrics to compute: common ones, joint torques, user-registered
        ones and those of the suite.

        Args:
            setpoints: for each vehicle and joint, whether its command is a setpoint of
                its drive: its torque is then not counted.
        """
        names = (
            *METRICS,
            EFFORTS,
            # stored rows and tables of one vehicle have no columns of its grasps
            *(GRASPS if len(setpoints) > 1 else ()),
            # sorted: columns of stored rows do not depend on who registered first
            *sorted(registered("metric", shipped=False)),
            *self.further_metrics,
        )
        return row_names(names, setpoints)


@immutable(slots=False)
class TrialFlights(CellFlights):
    """Flights of one controller in a trial at several values.

    Attributes:
        trial: the trial. setting: its vehicle. points: values that fly, SI.
    """

    trial: Trial
    setting: TrialSetting
    points: tuple[float, ...]

    def numbers(self, count: int) -> Columns:
        """Numbers of ``count`` flights at each value: parameter path -> values
        (flights,).
        """
        rows = [self.trial.numbers_of(self.setting, value) for value in self.points]
        return {path: np.repeat([row[path] for row in rows], count) for path in rows[0]}

    def trials(self, count: int) -> Array:
        """Value (count,) of each flight, SI."""
        return np.repeat(self.points, count // len(self.points))


SUCCESS_METRIC = "ee_error_last_max_continuous"
PLACED = "team_position_last"
SUCCESS_LIMIT = 0.020
"""Success criterion: the flight completes with the tip within 20 mm of its reference
throughout the last 5 s, or with the body of a team within 20 mm of its place at the
end."""


def summary(cell: Cell) -> Document:
    """Statistics of repeated flights: success rate, and mean, tail and confidence
    interval of each metric.

    Metrics are those of the episodes that flew to their end; null where none did. Peaks
    along an axis count by their size: of two flights that swing either way the mean is
    no small peak.
    """
    whole = cell.completed
    good = successes(cell)
    count = int(whole.size)
    return {
        "episodes": count,
        "completed": int(whole.sum()),
        "success": int(good.sum()),
        **success_share(good),
        "endings": {
            str(name): int((cell.status == name).sum())
            for name in np.unique(cell.status)
        },
        "metrics": {
            name: spread(magnitudes(name, values[whole]))
            for name, values in cell.metrics.items()
        },
    }


def magnitudes(name: str, values: Array) -> Array:
    """Values of a metric, absolute for signed peaks along an axis."""
    return np.abs(values) if "peak" in name else values


def successes(cell: Cell) -> Mask:
    """True for each flight that ended with the tip, of several vehicles every tip,
    within 20 mm of its reference.

    Where the place of a team's body is counted, that body within 20 mm of its place.
    """
    # a team's body has a place to be at; without one the tips are judged
    errors = values_of(cell.metrics, PLACED) or values_of(cell.metrics, SUCCESS_METRIC)
    # NaN of a flight that ended early is no success and no warning
    with np.errstate(invalid="ignore"):
        near: Mask = np.max(errors, axis=0) < SUCCESS_LIMIT
    return cell.completed & near


def table(cells: Mapping[tuple[str, str, str], Cell]) -> Document:
    """Nested dictionary of flight statistics by condition, case and controller."""
    summaries: Document = {}
    for (condition, case, entrant), cell in cells.items():
        summaries.setdefault(condition, {}).setdefault(case, {})[entrant] = summary(
            cell
        )
    return summaries
