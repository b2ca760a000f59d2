"""Suites of users: trials that a file describes, each at several values, law beside
law.

A file begins with the table [suite] and has a table [[trials]] for each trial;
docs/suites.md says what its words mean.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from skyarm.control.catalogue import OWN
from skyarm.control.controller import ControllerError
from skyarm.log.metrics.metric_catalogue import (
    GROUPS,
    catalogue_names,
    is_torque,
    measures,
    metric_words,
    row_names,
)
from skyarm.log.metrics.windows import Windows
from skyarm.records.arrays import Columns, Mask
from skyarm.records.files import (
    Fields,
    PathLike,
    did_you_mean,
    errors_as,
    file_name,
    must_be_one_of,
    read_toml,
    require_file,
    shown,
)
from skyarm.records.files import number as number_of
from skyarm.records.files.fields import filled_list, whole_number
from skyarm.records.files.messages import nearest
from skyarm.records.files.names import is_result_name, require_kind
from skyarm.records.immutable import immutable
from skyarm.records.read_table import record_from
from skyarm.scenario.controller_table import controller_by_name, is_gains_file
from skyarm.scenario.numbers import require_apart
from skyarm.scenario.readers import require_plugins
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.studies.compare.cell_flights import (
    JITTER,
    Cell,
    Document,
    Record,
    TrialFlights,
)
from skyarm.studies.compare.entrants import Entrant, chosen_laws
from skyarm.studies.compare.own_scenario import has_chance
from skyarm.studies.compare.run_suite import Pngs, Refused, Suite
from skyarm.studies.compare.suite import Case, Condition
from skyarm.studies.flights import Work
from skyarm.studies.sweep.design import Design, values
from skyarm.studies.sweep.distributions import Distribution, distribution_from
from skyarm.studies.sweep.plan import fastest_plant
from skyarm.studies.trial.facts import (
    DURATION,
    PAPER,
    TrialSetting,
    setting_of,
    setting_of_scenario,
)
from skyarm.studies.trial.table import TableColumn, refusals, report_of, values_of
from skyarm.studies.trial.trial import MOTIONS, Trial
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.view.pages import Report, Section, Table, table_of

LAWS = ("paper_pd", "paper_ct", "centroidal_tip")
"""Laws of a suite that names none."""

METRICS = ("ee_error_mean_continuous", JITTER)
"""Metrics of a suite that names none: mean distance of the tip from its reference, and
the rotors' jitter."""

MOST = 10_000
"""Largest number of flights of a trial at one value."""


@immutable
class SuiteTrial(Trial):
    """Trial of a suite of the user.

    Attributes:
        flights: flights at each value, each with noise and draws of its own.
        duration: s; None for that of the scenario, or 20 in a hover.
        vary: path -> distribution of a number of each flight, the same for every law
            and value.
        success: metric -> largest value of a successful flight, which has to fly to its
            end in any case.
        windows: windows of the metrics.
    """

    flights: int = 1
    duration: float | None = None
    vary: Mapping[str, Distribution] = field(default_factory=dict)
    success: Mapping[str, float] = field(default_factory=dict)
    windows: Windows = Windows()

    @property
    def states_controller(self) -> bool:
        """True if the entries say something of a controller, of any vehicle."""
        agents = self.entries.get("agents")
        tables = [self.entries, *(agents.values() if isinstance(agents, dict) else ())]
        return any("controller" in table for table in tables if isinstance(table, dict))

    def setting(self, suite: FileSuite, law: str) -> TrialSetting:
        """Vehicle of the trial under a law, or the trial's scenario.

        Raises:
            ValueError: one line: a scenario or vehicle that cannot be, or a law that
                does not fit it.
        """
        if not self.file:
            duration = DURATION if self.duration is None else self.duration
            vehicle = suite.vehicle or PAPER
            own = None if law == OWN else law
            hover = setting_of(
                vehicle, duration, suite.plant, own, armed=False, at="vehicle"
            )
            # windows of every vehicle are alike: the paper's hover has those of its
            # case 3
            return replace(
                hover,
                document={
                    key: each
                    for key, each in hover.document.items()
                    if key != "windows"
                },
            )
        given = {
            "plant": suite.plant,
            "duration": self.duration,
            "controller": None if law == OWN else law,
        }
        given = {word: each for word, each in given.items() if each is not None}
        return setting_of_scenario(self.file, Path(suite.source).parent, given)


@immutable(slots=False)
class FileFlights(TrialFlights):
    """Flights of one law in a trial of a suite of the user.

    Attributes:
        metrics: of the tables.
    """

    trial: SuiteTrial
    metrics: tuple[str, ...]

    @property
    def label(self) -> str:
        """File name of the stored results; includes the value if each is a scenario of
        its own.
        """
        if self.trial.numbers:
            return super().label
        value = self.points[0]
        short = f"{value:g}"
        # six digits may be those of two values, whose files would be one
        return f"{super().label}_{short if float(short) == value else repr(value)}"

    def scenario(self) -> Scenario:
        """Scenario of the trial at the first of these values."""
        return replace(
            self.trial.scenario(self.setting, self.points[0]), seed=self.seed
        )

    def values(self, scenario: Scenario) -> Columns:
        """Numbers of the flights: parameter path -> values (flights,)."""
        count = self.trial.flights
        drawn = values(
            Design(vary=self.trial.vary, episodes=count, seed=self.seed),
            np.arange(count),
        )
        return self.numbers(count) | {
            path: np.tile(column, len(self.points)) for path, column in drawn.items()
        }

    def episodes(self, scenario: Scenario) -> int:
        """Number of flights at all values."""
        return len(self.points) * self.trial.flights

    def metric_names(self, setpoints: Mapping[str, Sequence[bool]]) -> tuple[str, ...]:
        """Metrics of the tables, and those that judge."""
        return row_names(
            [*dict.fromkeys((*self.metrics, *self.trial.success))], setpoints
        )

    def work(self) -> Work:
        """Work item of these flights; each value meets the same noise and draws.

        Raises:
            ValueError: one line: a path of no number, or a number that cannot be.
        """
        work = super().work()
        with errors_as(ScenarioError, "vary: " if self.trial.vary else "numbers: "):
            require_apart(work.scenario, list(work.columns))
        ends = {
            path: (float(column.min()), float(column.max()))
            for path, column in work.columns.items()
        }
        keys = np.tile(np.arange(self.trial.flights), len(self.points))
        return replace(work, episodes=keys, stiffest=fastest_plant(work.scenario, ends))


@immutable
class FileSuite(Suite[FileFlights]):
    """Comparison of laws on the trials of a file.

    Attributes:
        title: one line. source: path of the file. trials: in order. laws: names; "own"
            is a scenario's.
        vehicle: name or file, of trials that hover; empty for the paper's. metrics: of
            the tables.
        seed: seed of noise and draws. plant: kind of plant.
    """

    title: str
    source: str
    trials: Sequence[SuiteTrial]
    laws: Sequence[str] = LAWS
    vehicle: str = ""
    metrics: tuple[str, ...] = METRICS
    seed: int = 0
    plant: str = "rigid_body"

    file = "suite"
    settings = ("vehicle", "seed", "plant")

    @property
    def name(self) -> str:  # type: ignore[override]
        """Name of the file."""
        return Path(self.source).stem

    @property
    def folder(self) -> str:  # type: ignore[override]
        """Usual folder of its results."""
        return f"out/{self.name}"

    def plan_cells(self) -> tuple[list[FileFlights], Refused]:
        """All flights of the suite, and why laws do not fly a trial.

        Raises:
            ValueError: one line with file and trial.
        """
        cells = list[FileFlights]()
        refused = dict[str, str]()
        if any(not trial.file for trial in self.trials):
            with errors_as(ValueError, f"{self.source}: "):
                # of all that hover: its fault is of no trial
                load_vehicle(self.vehicle or PAPER)
        for trial in self.trials:
            with errors_as(ValueError, f"{self.source}: trials[{trial.name}]: "):
                for law in self.laws:
                    try:
                        cells += self._cells(trial, law)
                    except ControllerError as error:
                        refused[f"{law} in {trial.name}"] = str(error)
        if not cells:
            raise ValueError(
                f"{self.source}:"
                f" {'; '.join(f'{name}: {why}' for name, why in refused.items())}"
            )
        return cells, refused

    def _cells(self, trial: SuiteTrial, law: str) -> list[FileFlights]:
        if law == OWN and not trial.file:
            raise ControllerError("flies trials with a scenario, whose own law it is")
        if law != OWN and trial.states_controller:
            raise ControllerError(
                "entries.controller is of the law 'own' alone; another law comes with"
                " its own gains"
            )
        # a file of gains is read, and refused, with its setting below
        if law != OWN and not is_gains_file(law):
            given = trial.setting(self, OWN).hover
            for name in given.agents:
                # refuses a law that does not fit the vehicle
                controller_by_name(given.of(name), law)
        setting = trial.setting(self, law)
        # without noise or draws all flights at a value would be one
        if not trial.vary and not has_chance(trial.built(setting, trial.values[0])):
            trial = replace(trial, flights=1)
        every = FileFlights(
            entrant=Entrant(name=law, law=law),
            case=Case(name=trial.name, windows=trial.windows),
            condition=Condition(
                name="noisy" if trial.noisy else "given",
                noisy=trial.noisy,
                episodes=trial.flights,
            ),
            plant=self.plant,
            seed=self.seed,
            trial=trial,
            setting=setting,
            points=trial.of(setting),
            metrics=self.metrics,
        )
        apart = (
            [every]
            if trial.numbers
            else [replace(every, points=(value,)) for value in every.points]
        )
        trial.windows.require_within(setting.duration)
        for each in apart:
            each.work()  # refuses here what cannot fly
        return apart

    def judge(
        self, flown: Sequence[tuple[FileFlights, Cell]], refused: Refused
    ) -> Document:
        """Evaluate the suite: of each trial, law and value the flights, successes and
        means of the metrics.
        """
        trials: Document = {}
        for flights, cell in flown:
            trial = flights.trial
            _, name, law = flights.name
            entry = trials.setdefault(
                name,
                {"title": trial.title, "unit": trial.unit, "values": {}, "laws": {}},
            )
            # a dict keeps the order: each cell adds its points once
            entry["values"] |= dict.fromkeys(flights.points)
            points = entry["laws"].setdefault(law, [])
            for first in range(0, len(flights.points) * trial.flights, trial.flights):
                rows = slice(first, first + trial.flights)
                points.append(_point(cell, rows, self.metrics, trial))
        for entry in trials.values():
            entry["values"] = list(map(float, entry["values"]))
        return {
            "title": self.title,
            "laws": list(self.laws),
            "not_flown": dict(refused),
            "trials": trials,
        }

    def report(self, found: Record, pictures: Pngs = None) -> Report:
        """Report with a section for each trial, and a table for each metric in it."""
        vehicle = (
            f"{found['vehicle'] or PAPER}, "
            if any(not trial.file for trial in self.trials)
            else ""
        )
        notes = [MEANING, *refusals(found)]
        tables = {
            name: [_table(entry, metric) for metric in self.metrics]
            for name, entry in found["trials"].items()
        }
        criteria = {
            trial.name: [_criterion(trial.success)]
            for trial in self.trials
            if trial.success
        }
        trials = [
            Section(
                title=found["trials"][name]["title"],
                notes=criteria.get(name, []),
                tables=each,
            )
            for name, each in tables.items()
        ]
        facts = f"{vehicle}{found['plant']}, seed {found['seed']}"
        return report_of(
            found["title"], facts, [Section(name="What flew", notes=notes), *trials]
        )


FINE = 0.1
"""Number below which three digits are shown: of joint torques and body rates two
decimals may be nothing."""

MEANING = (
    "Means over the flights that came to their end, behind the count of successes where"
    " some did not."
)


def _criterion(success: Mapping[str, float]) -> str:
    """Sentence with the largest values of the metrics of a successful flight."""
    limits = ((*metric_words(name), most) for name, most in success.items())
    texts = (
        f"{words} at most {most:g} {unit}".rstrip() for words, unit, most in limits
    )
    return f"Success: {', '.join(texts)}."


def _point(
    cell: Cell, rows: slice, metrics: Sequence[str], trial: SuiteTrial
) -> Document:
    """Results of one law at one value; of several vehicles the largest of theirs."""
    flown = cell.completed[rows]
    wanted = (*metrics, *trial.success)
    numbers = {
        name: np.max([each[rows] for each in values_of(cell.metrics, name)], axis=0)
        for name in wanted
    }
    # NaN of a flight that ended early is no success and no warning
    with np.errstate(invalid="ignore"):
        good: Mask = np.all(
            [flown, *(numbers[name] <= most for name, most in trial.success.items())],
            axis=0,
        )
    means = {
        name: numbers[name][flown & np.isfinite(numbers[name])] for name in metrics
    }
    return {
        "flights": int(flown.size),
        "completed": int(flown.sum()),
        "success": int(good.sum()),
        "endings": sorted({str(status) for status in cell.status[rows][~flown]}),
        "means": {
            name: float(each.mean()) if each.size else None
            for name, each in means.items()
        },
    }


def _table(entry: Record, metric: str) -> Table:
    """Table of a metric in a trial: a row for each law, a column for each value."""
    words, unit = metric_words(metric)
    factor, unit, fine = (1e3, "mm", 0.0) if unit == "m" else (1.0, unit, FINE)
    column = TableColumn(
        head=f"{words}, {unit}" if unit else words,
        metric=metric,
        factor=factor,
        fine=fine,
    )
    values = (f"{value:g} {entry['unit']}".rstrip() for value in entry["values"])
    rows = [
        [law, *(_cell(each, column) for each in points)]
        for law, points in entry["laws"].items()
    ]
    return table_of(["law", *values], rows, title=column.head)


def _cell(point: Record, column: TableColumn) -> str:
    if not point["completed"]:
        return ", ".join(point["endings"])
    mean = column.cell(point["means"][column.metric])
    every = point["success"] == point["flights"]
    return mean if every else f"{point['success']} of {point['flights']}; {mean}"


def load_suite(path: PathLike, **options: Any) -> FileSuite:
    """Suite of a file.

    Args:
        path: path of the .toml file.
        options: fields of :class:`FileSuite` in place of the file's; ``only``: names of
            trials that fly.

    Raises:
        ValueError: one line, ``file: table.key = value: what is allowed``.
    """
    source = file_name(path, "suite")
    only = options.pop("only", None)
    require_file(source, f"suite = {shown(source)}")
    with errors_as(ValueError, f"{source}: "):
        document = read_toml(Path(source).read_bytes())
        require_kind(document, "suite")
        top = Fields(document, "")
        top.require_schema()
        require_plugins(top)
        table = top.inner("suite")
        given = top.take("trials", [])
        own = {
            "title": table.text("title", Path(source).stem),
            "laws": chosen_laws(_texts(table, "laws", LAWS), "suite.laws", (OWN,)),
            "vehicle": table.text("vehicle", ""),
            "metrics": tuple(
                _metric(each, "suite.metrics")
                for each in dict.fromkeys(_texts(table, "metrics", METRICS))
            ),
        }
        usual = {"flights": _flights(table, 1), "duration": _duration(table, None)}
        table.done()
        top.done()
        filled_list(given, "trials", "one or more tables [[trials]]")
        trials = [
            _trial(each, usual)
            for each in Fields(document, "", named=True).tables("trials")
        ]
        names = [trial.name for trial in trials]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(
                    f"trials[{name}].name = {shown(name)}: must differ from those of"
                    " other trials"
                )
        if own["vehicle"] and all(trial.file for trial in trials):
            raise ValueError(
                f"suite.vehicle = {shown(own['vehicle'])}: must be left out: every"
                " trial has a scenario"
            )
    for name in only or ():
        if name not in names:
            raise ValueError(f"--only = {shown(name)}: {must_be_one_of(names, name)}")
    chosen = [trial for trial in trials if only is None or trial.name in only]
    if options.get("vehicle") and all(trial.file for trial in chosen):
        raise ValueError(
            f"--vehicle = {shown(options['vehicle'])}: must be left out: every trial"
            " has a scenario"
        )
    return FileSuite(**own | {"source": source, "trials": chosen} | options)


def _texts(table: Fields, name: str, usual: tuple[str, ...]) -> tuple[str, ...]:
    """List of names in a field."""
    allowed = "a list of one or more names"
    given = filled_list(table.take(name, list(usual)), table.at(name), allowed)
    for each in given:
        if not isinstance(each, str):
            raise ValueError(f"{table.at(name)} = {shown(each)}: must be {allowed}")
    return tuple(given)


def _metric(name: str, at: str) -> str:
    """Name of a single metric, no group; that a vehicle has it is checked where the
    flights are planned.
    """
    if name in GROUPS:
        raise ValueError(f"{at} = {shown(name)}: must be a metric, not a group of them")
    known = measures(0)
    (alone,) = catalogue_names([name])
    if alone not in known and not is_torque(alone):
        words = (
            f"{did_you_mean(alone, known)}must be a metric, such as"
            f" {', '.join(nearest(alone, known))}"
        )
        raise ValueError(f"{at} = {shown(name)}: {words}")
    return name


def _flights(table: Fields, usual: int) -> int:
    return whole_number(table.take("flights", usual), table.at("flights"), 1, MOST)


def _duration(table: Fields, usual: float | None) -> float | None:
    stated = table.take("duration", usual)
    return (
        None
        if stated is None
        else number_of(stated, table.at("duration"), low=0.0, strict=True)
    )


def _expressions(entry: object) -> Iterator[str]:
    """Expressions in an entry of a scenario file."""
    match entry:
        case dict():
            yield from chain.from_iterable(map(_expressions, entry.values()))
        case list():
            yield from chain.from_iterable(map(_expressions, entry))
        case str() if entry.startswith("="):
            yield entry


ELSEWHERE = {
    "duration": "duration of the trial",
    "seed": "--seed",
    "plant.kind": "--plant",
}
"""Entry of a scenario file -> what says it in a suite."""


def _trial(table: Fields, usual: Record) -> SuiteTrial:
    """Read one table of a suite."""
    name = table.text("name")
    file = table.text("scenario", "")
    if not is_result_name(name):
        raise ValueError(
            f"{table.at('name')} = {shown(name)}: must be the name of a file, of"
            " letters, digits, - or _"
        )
    numbers, vary = table.inner("numbers"), table.inner("vary")
    for path, expression in numbers.table.items():
        if not isinstance(expression, str):
            raise ValueError(
                f"{numbers.at(path)} = {shown(expression)}: must be an expression, as"
                ' "2 * value"'
            )
        if path in vary.table:
            raise ValueError(f"{vary.at(path)}: must not stand under numbers as well")
    if file:
        for word in ("base", "arm"):
            if table.states(word):
                raise ValueError(
                    f"{table.at(word)}: must be left out beside scenario, which has a"
                    " reference"
                )
    success, entries = table.inner("success"), table.inner("entries")
    for path, instead in ELSEWHERE.items():
        *within, word = path.split(".")
        given = entries.inner(within[0]) if within else entries
        if word in given.table:
            raise ValueError(
                f"{given.at(word)} = {shown(given.table[word])}: must be left out;"
                f" {instead} says it"
            )
    found = SuiteTrial(
        name=name,
        title=table.text("title", name),
        unit=table.text("unit", ""),
        values=tuple(table.numbers("values", [1.0])),
        share=table.text("share", "1"),
        file=file,
        base=(
            table.choice("base", tuple(MOTIONS["bases"]))
            if table.states("base")
            else ""
        ),
        arm=table.choice("arm", tuple(MOTIONS["arms"]), "still"),
        entries=entries.table,
        numbers=numbers.table,
        noisy=table.flag("noisy", False),
        flights=_flights(table, usual["flights"]),
        duration=_duration(table, usual["duration"]),
        vary={
            path: distribution_from(each, vary.at(path))
            for path, each in vary.table.items()
        },
        success={
            _metric(each, success.at(each)): success.number(each)
            for each in success.table
        },
        windows=record_from(Windows, table.inner("windows")),
    )
    table.done()
    if not found.values or len(set(found.values)) < len(found.values):
        raise ValueError(
            f"{table.at('values')} = {shown(list(found.values))}: must be one or more"
            " different numbers"
        )
    every = [*_expressions(found.entries), *found.numbers.values()]
    if len(found.values) > 1 and not any(
        re.search(r"\bvalue\b", each) for each in every
    ):
        words = (
            "must be one number: no expression names value, and all would fly the same"
        )
        raise ValueError(f"{table.at('values')} = {shown(list(found.values))}: {words}")
    return found
