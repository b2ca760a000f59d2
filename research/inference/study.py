"""Identification studies: flights, the cells that were measured of them, parameters,
choices; read from TOML files.

A file has ``schema = 1``, ``name``, ``title``, ``seed`` and these tables::

    [loss]          width, knee: of the logarithms
                    (:func:`skyarm.paper.unstated_study.losses`)
    [search]        population, generations: of the differential evolution
    [tables.NAME]   tables of a scenario file, to be laid over flights; an empty table
                    takes a field away
    [[flights]]     name, scenario (of the library, or a path beside the file), over =
                    [NAMES of tables], cells = { NAME = "0.019", or { measured = "0.55",
                    metric = "gust_peak_x" } }: a number in text, whose digits give its
                    precision; the metric is the name if left out
    [groups]        NAME = ["FLIGHT/CELL", ...]: patterns of cells; "!" in front takes
                    away again
    [[parameters]]  name, words, unit, low, high, step, scale ("linear" or "log"),
                    targets = [{ flights = [patterns], path, factor (1), offset (0),
                    when = { CHOICE = "OPTION" } }]
    [[choices]]     name, words, options = [{ name, words, sets = [{ flights, path,
                    value, when }],
                    tables = [{ flights, table = NAME }] }]
    [fit]           free = [parameters], choices = { CHOICE = "OPTION" }
    [[ladder]]      name, adds = [parameters and choices of the fit]
    [[rivals]]      name, words, adds = [parameters], choices, without = [names it
                    replaces on top of the fit]
    [[predictions]] name, words, free, choices, seen = GROUP, unseen = [GROUPS]

A setting that is not named leaves the flight as its scenario has it. Every error is one
line: file, field, value, what is allowed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path
from typing import Any

from skyarm.paper.unstated_study import (
    PublishedNumber,
    fits,
    group_places,
    laid_over,
    numbers,
    scenario_tables,
    study_digest,
)
from skyarm.records.files import Fields, one_line, read_toml, shown, unreadable
from skyarm.records.read_table import record_from
from skyarm.scenario.scenario_file import LIBRARY, list_scenarios

Settings = Mapping[str, Any]
"""Parameter -> number, choice -> option. What is not named stays as the flights'
scenarios have it."""


class IdentificationError(ValueError):
    """An invalid identification study."""


class Name(str):
    """A text that is not empty."""

    __slots__ = ()

    @classmethod
    def from_table(cls, value: Any, at: str) -> Name:
        """Check the value of a file."""
        if not isinstance(value, str) or not value:
            raise ValueError(f"{at} = {shown(value)}: must be text")
        return cls(value)


class Names(tuple[str, ...]):
    """A list of names or patterns; a text alone would be taken letter by letter."""

    __slots__ = ()

    @classmethod
    def from_table(cls, value: Any, at: str) -> Names:
        """Check the value of a file."""
        if not isinstance(value, list):
            raise ValueError(f"{at} = {shown(value)}: must be a list")
        return cls(value)

    def fit(self, flight: str) -> bool:
        """True if one of the patterns fits a flight's name."""
        return fits(self, flight)


class Options(dict[str, str]):
    """Choice -> option."""

    @classmethod
    def from_table(cls, value: Any, at: str) -> Options:
        """Check the value of a file."""
        return cls(Fields(value, at).table)


class Overlays(dict[str, Mapping[str, Any]]):
    """Tables of a scenario file by name."""

    @classmethod
    def from_table(cls, value: Any, at: str) -> Overlays:
        """Check the value of a file."""
        return cls(
            {
                name: Fields(each, f"{at}.{name}").table
                for name, each in Fields(value, at).table.items()
            }
        )


@dataclass(frozen=True, slots=True)
class Flight:
    """One flight: a scenario as plain tables, whose windows are those of its metrics.

    Attributes:
        name: of the flight. document: the tables. folder: of the vehicles' files that
            they name.
    """

    name: str
    document: Mapping[str, Any]
    folder: Path = Path()


@dataclass(frozen=True, kw_only=True, slots=True)
class Target:
    """Action of a parameter: ``factor * value + offset`` at a path of the flights whose
    name fits a pattern.

    Attributes:
        flights: patterns. path: of :mod:`skyarm.scenario.numbers`.
        when: choice -> option under which it acts; empty acts always.
    """

    flights: Names
    path: Name
    factor: float = 1.0
    offset: float = 0.0
    when: Options = field(default_factory=Options)


@dataclass(frozen=True, kw_only=True, slots=True)
class Constant:
    """A number that an option sets, in the words of a :class:`Target`."""

    flights: Names
    path: Name
    value: float
    when: Options = field(default_factory=Options)


@dataclass(frozen=True, kw_only=True, slots=True)
class Overlay:
    """A table that an option lays over scenarios, by its name."""

    flights: Names
    table: Name


@dataclass(frozen=True, kw_only=True, slots=True)
class Parameter:
    """A free number.

    Attributes:
        name, words, unit: of the number. low, high: its range. step: its resolution;
            values are multiples from ``low``.
        scale: "linear", or "log": how the range is searched.
        targets: where it acts.
    """

    name: Name
    words: str = ""
    unit: str = ""
    low: float
    high: float
    step: float
    scale: str = "linear"
    targets: tuple[Target, ...] = ()


@dataclass(frozen=True, kw_only=True, slots=True)
class Option:
    """One way to take a choice: constant numbers, or tables laid over the scenario."""

    name: Name
    words: str = ""
    sets: tuple[Constant, ...] = ()
    tables: tuple[Overlay, ...] = ()


@dataclass(frozen=True, kw_only=True, slots=True)
class Choice:
    """Discrete alternatives."""

    name: Name
    words: str = ""
    options: tuple[Option, ...]

    def option(self, name: str) -> Option:
        """An option by its name."""
        return next(each for each in self.options if each.name == name)


@dataclass(frozen=True, kw_only=True, slots=True)
class Rung:
    """A step of the ladder: what is set from here on."""

    name: Name
    adds: Names = Names()


@dataclass(frozen=True, kw_only=True, slots=True)
class Rival:
    """An alternative explanation: parameters to search and choices to make, alone or on
    top of the fit.

    Attributes:
        name, words: of the explanation. adds: its parameters. choices: choice ->
            option.
        without: names that it replaces when it is tried on top.
    """

    name: Name
    words: str = ""
    adds: Names = Names()
    choices: Options = field(default_factory=Options)
    without: Names = Names()


@dataclass(frozen=True, kw_only=True, slots=True)
class Prediction:
    """Out of sample: parameters fitted to some cells, judged on others that the search
    has not used.
    """

    name: Name
    words: str = ""
    free: Names = Names()
    choices: Options = field(default_factory=Options)
    seen: Name
    unseen: Names = Names()


@dataclass(frozen=True, kw_only=True, slots=True)
class Loss:
    """Width and knee of :func:`skyarm.paper.unstated_study.losses`."""

    width: float
    knee: float


@dataclass(frozen=True, kw_only=True, slots=True)
class Search:
    """Size of the differential evolution."""

    population: int
    generations: int


@dataclass(frozen=True, kw_only=True, slots=True)
class Fit:
    """Names of the free parameters, and the option of each choice."""

    free: Names = Names()
    choices: Options = field(default_factory=Options)


@dataclass(frozen=True, kw_only=True, slots=True)
class Plan:
    """The fields of a study's file that do not depend on its flights; see the
    module.
    """

    schema: int = 1
    name: Name
    title: str = ""
    seed: int = 0
    loss: Loss
    search: Search
    tables: Overlays = field(default_factory=Overlays)
    rival_cells: Names = Names()
    parameters: tuple[Parameter, ...] = ()
    choices: tuple[Choice, ...] = ()
    fit: Fit = field(default_factory=Fit)
    ladder: tuple[Rung, ...] = ()
    rivals: tuple[Rival, ...] = ()
    predictions: tuple[Prediction, ...] = ()


@dataclass(frozen=True, kw_only=True, slots=True)
class IdentificationStudy:
    """Everything that an identification needs.

    Attributes:
        plan: what is searched and tried.
        flights, cells: measured ones. groups: name -> cells by place.
        document: the file, plain; its digest is part of the study's identity.
    """

    plan: Plan
    flights: tuple[Flight, ...]
    cells: tuple[PublishedNumber, ...]
    groups: Mapping[str, tuple[int, ...]]
    document: Mapping[str, Any]

    @property
    def digest(self) -> str:
        """Digest of the study's file and of the scenarios of its flights, as plain
        tables.
        """
        return study_digest(
            self.document, {each.name: each.document for each in self.flights}
        )

    def parameter(self, name: str) -> Parameter:
        """A parameter by its name."""
        return next(each for each in self.plan.parameters if each.name == name)

    def choice(self, name: str) -> Choice:
        """A choice by its name."""
        return next(each for each in self.plan.choices if each.name == name)

    def among(self, group: str) -> tuple[PublishedNumber, ...]:
        """Cells of a group; "" is all of them."""
        return tuple(self.cells[i] for i in self.groups[group]) if group else self.cells

    def flight(self, name: str) -> Flight:
        """A flight by its name."""
        return next(each for each in self.flights if each.name == name)

    def numbers(self, flight: str, settings: Settings) -> dict[str, Any]:
        """Path -> number of a flight under settings; a later entry of the study
        overrides an earlier one.
        """
        return numbers(self.document, flight, settings)

    def scenario_tables(self, flight: str, settings: Settings) -> dict[str, Any]:
        """The scenario of a flight as plain tables, with those of the options laid over
        it.
        """
        return scenario_tables(
            self.document, self.flight(flight).document, flight, settings
        )


def read_identification(
    content: bytes, folder: Path, source: str
) -> IdentificationStudy:
    """The study of a file.

    Args:
        content: of the file.
        folder: where its scenarios' paths start.
        source: its name, for messages.

    Raises:
        IdentificationError: one line with file, field, value and what is allowed.
    """
    try:
        return _study(Fields(read_toml(content), ""), folder)
    except ValueError as error:
        raise IdentificationError(one_line(f"{source}: {error}")) from None


def _study(top: Fields, folder: Path) -> IdentificationStudy:
    document, groups, entries = (
        dict(top.table),
        top.inner("groups"),
        top.tables("flights"),
    )
    plan = record_from(Plan, top)
    if plan.schema != 1:
        raise ValueError(f"schema = {plan.schema}: must be 1")
    flights, cells = list[Flight](), list[PublishedNumber]()
    for fields in entries:
        flights.append(_flight(fields, plan.tables, folder))
        cells += _cells(fields, flights[-1].name)
        fields.done()
    places = {
        name: _group(f"groups.{name}", each, cells)
        for name, each in groups.table.items()
    }
    return IdentificationStudy(
        plan=plan,
        flights=tuple(flights),
        cells=tuple(cells),
        groups=places,
        document=document,
    )


def _flight(fields: Fields, overlays: Mapping[str, Any], folder: Path) -> Flight:
    """A flight, its scenario's tables with others laid over them."""
    name, scenario = fields.text("name"), fields.take("scenario")
    over = Names.from_table(fields.take("over", []), fields.at("over"))
    for each in over:
        if each not in overlays:
            raise ValueError(
                f"{fields.at('over')} = {shown(each)}: must be one of the tables:"
                f" {', '.join(overlays)}"
            )
    file, beside = LIBRARY / f"{scenario}.toml", Path()
    if scenario not in list_scenarios():
        reason = (
            unreadable(folder / scenario) if isinstance(scenario, str) else "no text"
        )
        if reason:
            words = (
                f"must be a file beside this one ({reason}), or one of"
                f" {', '.join(list_scenarios())}"
            )
            raise ValueError(f"{fields.at('scenario')} = {shown(scenario)}: {words}")
        file, beside = folder / scenario, (folder / scenario).parent
    try:
        document = dict(read_toml(file.read_bytes()))
    except ValueError as error:
        raise ValueError(
            f"{fields.at('scenario')} = {shown(scenario)}: {error}"
        ) from None
    for each in over:
        document = laid_over(document, overlays[each])
    return Flight(name, document, beside)


def _cells(flight: Fields, name: str) -> Iterator[PublishedNumber]:
    """The measured numbers of a flight."""
    for cell, value in flight.inner("cells").table.items():
        fields = Fields(
            value if isinstance(value, dict) else {"measured": value},
            f"{flight.where}.cells.{cell}",
        )
        text, metric = fields.take("measured"), fields.take("metric", cell)
        fields.done()
        try:
            measured = float(text) if isinstance(text, str) else math.nan
        except ValueError:
            measured = math.nan
        if not math.isfinite(measured) or measured == 0.0:
            raise ValueError(
                f"{fields.at('measured')} = {shown(text)}: must be a number other than"
                " 0, as text"
            )
        # of the last digit that is written, whatever the notation: 0.0305, 3.05e-2
        last = Decimal(text).as_tuple().exponent
        yield PublishedNumber(
            name, cell, str(metric), measured, 0.5 * 10.0 ** int(last)
        )


def _group(
    at: str, patterns: Sequence[str], cells: Sequence[PublishedNumber]
) -> tuple[int, ...]:
    """Places of the cells of a group, each of whose patterns must fit one."""
    for pattern in patterns:
        if not group_places([pattern.removeprefix("!")], cells):
            raise ValueError(
                f"{at} = {shown(pattern)}: must fit a cell, as FLIGHT/CELL"
            )
    return group_places(patterns, cells)
