"""Survive suite: flights lost under blows, failing sensors, wrong plants, hard landings and half turns, law by law.

All conditions of a trial fly as lanes of one batch.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from skyarm.control.controller import ControllerError
from skyarm.log.metrics.windows import LAST, Window, Windows
from skyarm.records.arrays import AnyArray as Array
from skyarm.records.arrays import Mask
from skyarm.records.files import versions
from skyarm.records.immutable import immutable
from skyarm.scenario.numbers import number_at
from skyarm.scenario.scenario_record import Scenario
from skyarm.studies.compare.cell_flights import TILTED, Cell, CellFlights, Document, Record
from skyarm.studies.compare.entrants import Entrant
from skyarm.studies.compare.envelope_setting import PAPER, Setting, setting_of
from skyarm.studies.compare.faulty_sensors import START
from skyarm.studies.compare.run_suite import Refused, Suite
from skyarm.studies.compare.suite import Case, Condition
from skyarm.studies.compare.survive_trials import CONDITIONS, TRIALS, SurviveCondition, Trial
from skyarm.view.pages import DASH, Report, Section, Table, number

SURVIVE = "survive-suite"

FLAGSHIP = "centroidal_tip"

LAWS = (
    FLAGSHIP,
    *("hybrid_computed_torque_tuned", "decoupled_pd_tuned", "indi_tuned"),
    *("kim2013_tuned", "guo2023_tuned", "li2024_tuned"),
)
"""Default laws: the flagship and simpler ones, which fit any vehicle."""

NOISES = 3
"""Number of noise seeds of each flight in a noisy trial."""

WORST, LAST_ERROR, LAST_TILT = "gust_ee_error_max_continuous", "ee_error_last_mean_continuous", "tilt_rms"
"""Metrics: largest tip error from the event on, mean tip error and RMS tilt of the last seconds."""

Lane = tuple[SurviveCondition, float, dict[str, float]]
"""Condition, its value and the numbers of a flight."""


@immutable(slots=False)
class SurviveFlights(CellFlights):
    """Flights of one law in one trial: all conditions that are numbers of one scenario, or one that is made before.

    Attributes:
        points: condition and value of each. vehicle: name or file. noises: noise seeds of each flight.
    """

    points: tuple[tuple[str, float], ...]
    vehicle: str = PAPER
    noises: int = 1

    further_metrics = (WORST, LAST_TILT)

    @property
    def trial(self) -> Trial:
        """Trial that flies."""
        return TRIALS[self.case.name]

    def scenario(self) -> Scenario:
        """Scenario that all flights have in common."""
        name, value = self.points[0]
        setting = setting_of(self.vehicle, plant=self.plant)
        built = self.trial.scenario(setting, self.entrant.law, self.plant, CONDITIONS[name], value)
        return dataclasses.replace(built, seed=self.seed)

    def lanes(self, scenario: Scenario) -> list[Lane]:
        """Condition, value and numbers of each flight, with every noise seed."""
        found = list[Lane]()
        for name, value in self.points:
            condition = CONDITIONS[name]
            numbers = [{}] if condition.sets else condition.flights(scenario, value)
            found += [(condition, value, each) for each in numbers for _ in range(self.noises)]
        return found

    def values(self, scenario: Scenario) -> dict[str, Array]:
        """Numbers of the flights: parameter path -> values (flights,); that of the scenario where none is stated."""
        lanes = [numbers for _, _, numbers in self.lanes(scenario)]
        usual = {path: number_at(scenario, path) for numbers in lanes for path in numbers}
        return {path: np.array([numbers.get(path, own) for numbers in lanes]) for path, own in usual.items()}

    def stiffest(self, values: Mapping[str, Array]) -> dict[str, float]:
        """Largest joint damping and dry friction among all flights, which require the shortest integration step."""
        worst = {path: float(column.max()) for path, column in values.items() if path.endswith(".coulomb")}
        return super().stiffest(values) | worst

    def episodes(self, scenario: Scenario) -> int:
        """Number of flights."""
        return len(self.lanes(scenario))


@immutable
class SurviveSuite(Suite[SurviveFlights]):
    """Benchmark that counts the conditions in which laws are lost.

    Attributes:
        laws: names, in order. conditions: names, in order. vehicle: name or file. seed: seed of the noise.
        plant: kind of plant. quick: one noise seed, and the hardest value of each condition only.
    """

    laws: tuple[str, ...] = LAWS
    conditions: tuple[str, ...] = tuple(CONDITIONS)
    vehicle: str = PAPER
    seed: int = 0
    plant: str = "rigid_body"
    quick: bool = False

    name, file, folder = SURVIVE, "survive", "out/survive"
    settings = ("vehicle", "seed", "plant", "quick")

    @property
    def setting(self) -> Setting:
        """Scales of the vehicle."""
        return setting_of(self.vehicle, plant=self.plant)

    def plan_cells(self) -> tuple[list[SurviveFlights], dict[str, str]]:
        """All flights of the suite, and reasons why a law is excluded."""
        cells, refused = list[SurviveFlights](), dict[str, str]()
        for law in self.laws:
            own = [flights for trial in TRIALS.values() for flights in self._flights(law, trial)]
            try:
                for each in own:
                    each.scenario()
                cells += own
            except ControllerError as error:
                refused[law] = str(error)
        return cells, refused

    def _flights(self, law: str, trial: Trial) -> list[SurviveFlights]:
        """Flights of a law in a trial: one batch of its numbers, and one for each value that is made before."""
        flown = [each for each in trial.conditions if each.name in self.conditions]
        points = {each.name: [(each.name, value) for value in self._values(each)] for each in flown}
        batches = [tuple(point for each in flown if not each.sets for point in points[each.name])]
        batches += [(point,) for each in flown if each.sets for point in points[each.name]]
        windows = Windows(steady=Window(trial.duration - LAST, trial.duration), gust=Window(START, trial.duration))
        return [
            SurviveFlights(
                entrant=Entrant(name=law, group="own", law=law),
                case=Case(name=trial.name, title=trial.name, scenario=self.vehicle, windows=windows),
                condition=Condition(
                    name="all" if len(batch) > 1 else f"{batch[0][0]}_{batch[0][1]:g}",
                    title=trial.name,
                    noisy=trial.noisy,
                    episodes=1,
                    cases=(trial.name,),
                ),
                plant=self.plant,
                seed=self.seed,
                points=batch,
                vehicle=self.vehicle,
                noises=1 if self.quick or not trial.noisy else NOISES,
            )
            for batch in batches
            if batch
        ]

    def _values(self, condition: SurviveCondition) -> tuple[float, ...]:
        return condition.values[-1:] if self.quick else condition.values

    def judge(self, todo: Sequence[SurviveFlights], cells: Sequence[Cell], refused: Refused) -> Document:
        """Evaluate the suite: flights, lost ones and largest tip error of every law at every value."""
        found: Document = {
            name: {"title": CONDITIONS[name].title, "unit": CONDITIONS[name].unit, "values": [], "laws": {}}
            for name in self.conditions
        }
        for flights, cell in zip(todo, cells, strict=True):
            lanes = flights.lanes(flights.scenario())
            for name, value in flights.points:
                own = np.array([condition.name == name and at == value for condition, at, _ in lanes])
                entry = found[name]
                if value not in entry["values"]:
                    entry["values"].append(value)
                entry["laws"].setdefault(flights.entrant.name, []).append(point_of(cell, own, CONDITIONS[name].near))
        laws = [law for law in self.laws if law not in refused]
        return {"laws": laws, "not_flown": dict(refused), "conditions": found}

    def report(self, found: Record, pictures: Mapping[str, bytes] | None = None) -> Report:
        """Report: flights that are lost and the largest tip error, law beside law."""
        return survive_report(found)


def lost(cell: Cell, near: float) -> Mask:
    """True for each flight that an ending ended, or that is tilted or away from its reference in its last seconds."""
    metrics = cell.metrics
    with np.errstate(invalid="ignore"):
        there = (metrics[LAST_ERROR] <= near) & (metrics[LAST_TILT] <= TILTED)
    return ~(cell.completed & there)


def point_of(cell: Cell, own: Mask, near: float) -> Document:
    """Result at one value as plain data: flights, lost ones, why, and the largest tip error (m) of the others."""
    gone = lost(cell, near) & own
    flown = cell.metrics[WORST][own & ~gone]
    endings = sorted({str(cell.status[k]) if not cell.completed[k] else "away" for k in np.flatnonzero(gone)})
    worst = float(flown.max()) if flown.size else None
    return {"of": int(own.sum()), "lost": int(gone.sum()), "endings": endings, "worst": worst}


def beaten(found: Record, law: str = FLAGSHIP) -> list[str]:
    """Conditions in which a law is lost more often than another law, with its name."""
    words = list[str]()
    for name, entry in found["conditions"].items():
        for k, value in enumerate(entry["values"]):
            counts = {each: points[k]["lost"] for each, points in entry["laws"].items()}
            better = [each for each, count in counts.items() if count < counts.get(law, 0)]
            if better:
                words.append(f"{name} {value:g} {entry['unit']}".strip() + f": {', '.join(better)}")
    return words


MEANING = (
    "A flight is lost where an ending ended it (it diverged, a joint passed its limit, a rotor or the base touched), "
    "or where in its last 5 s the tip was over 0.5 m off in the mean (0.1 m after turning round), or the tilt over 80 "
    "degrees. Cells: lost flights of all flights; largest tip error of the others from 2 s on, mm."
)


def survive_report(found: Record) -> Report:
    """Build the report of the survive suite's results."""
    laws = found["laws"]
    refused = [f"{law} does not fly: {why}" for law, why in found["not_flown"].items()]
    behind = [f"{law} is lost more often than another law: {'; '.join(rows)}" for law in laws if law == FLAGSHIP
              if (rows := beaten(found, law))]  # fmt: skip
    table = Table(head=["condition", *(f">{law}" for law in laws)], rows=survive_rows(found))
    return Report(
        title=f"What laws survive on {found['vehicle']}",
        facts=f"{len(laws)} laws, seed {found['seed']}, plant {found['plant']}; skyarm {versions()['skyarm']}",
        sections=[Section(name="Lost and flown", notes=[MEANING, *refused, *behind], tables=[table])],
    )


def survive_rows(found: Record) -> list[list[str]]:
    """Table rows: each value of each condition, one column per law, and the sum of all lost flights."""
    rows, total = list[list[str]](), dict.fromkeys(found["laws"], 0)
    for entry in found["conditions"].values():
        for k, value in enumerate(entry["values"]):
            points = {law: entry["laws"][law][k] if law in entry["laws"] else None for law in found["laws"]}
            amount = f" {value:g} {entry['unit']}".rstrip() if len(entry["values"]) > 1 or entry["unit"] else ""
            rows.append([entry["title"] + amount, *map(cell_text, points.values())])
            for law, point in points.items():
                total[law] += point["lost"] if point else 0
    return [*rows, ["lost in all", *map(str, total.values())]]


def cell_text(point: Record | None) -> str:
    """Table text of a result: lost flights of all, and the largest tip error (mm) of the others."""
    if point is None:
        return DASH
    if point["lost"] == point["of"]:
        return "lost"
    worst = number(point["worst"], 1e3)
    return f"{point['lost']} of {point['of']} lost; {worst}" if point["lost"] else worst
