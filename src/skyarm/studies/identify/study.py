"""Identification studies: flights, the cells that were measured of them, parameters, choices; read from TOML files.

A file has ``schema = 1``, ``name``, ``title``, ``seed`` and these tables::

    [loss]          width, knee: of the logarithms (skyarm.studies.identify.candidates.losses)
    [search]        population, generations: of the differential evolution
    [tables.NAME]   tables of a scenario file, to be laid over flights; an empty table takes a field away
    [[flights]]     name, scenario (of the library, or a path beside the file), over = [NAMES of tables],
                    cells = { NAME = "0.019", or { measured = "0.55", metric = "gust_peak_x" } }: a number in text,
                    whose digits give its precision; the metric is the name if left out
    [groups]        NAME = ["FLIGHT/CELL", ...]: patterns of cells; "!" in front takes away again
    [[parameters]]  name, words, unit, low, high, step, scale ("linear" or "log"),
                    targets = [{ flights = [patterns], path, factor (1), offset (0), when = { CHOICE = "OPTION" } }]
    [[choices]]     name, words, options = [{ name, words, sets = [{ flights, path, value, when }],
                    tables = [{ flights, table = NAME }] }]
    [fit]           free = [parameters], choices = { CHOICE = "OPTION" }
    [[ladder]]      name, adds = [parameters and choices of the fit]
    [[rivals]]      name, words, adds = [parameters], choices, without = [names it replaces on top of the fit]
    [[predictions]] name, words, free, choices, seen = GROUP, unseen = [GROUPS]

A setting that is not named leaves the flight as its scenario has it. Every error is one line: file, field, value, what
is allowed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, TypeVar

from skyarm.log.metrics.metric_catalogue import metric_names
from skyarm.records.files import Fields, all_wrong_words, one_line, read_toml, shown, unreadable
from skyarm.records.read_table import record_from
from skyarm.scenario.numbers import number_at, with_numbers
from skyarm.scenario.scenario_file import LIBRARY, list_scenarios, scenario_from

Settings = Mapping[str, Any]
"""Parameter -> number, choice -> option. What is not named stays as the flights' scenarios have it."""

Record = TypeVar("Record")

LARGEST_SEED = 2**32 - 1

LARGEST_SEARCH = 100_000
"""Candidates of a generation, and generations."""

FINEST = 1e-6
"""Least resolution of a parameter, of its range: single precision tells no more values apart."""


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
        return any(fnmatchcase(flight, str(pattern)) for pattern in self)


class Options(dict[str, str]):
    """Choice -> option."""

    @classmethod
    def from_table(cls, value: Any, at: str) -> Options:
        """Check the value of a file."""
        return cls(Fields(value, at).table)


@dataclass(frozen=True, slots=True)
class Cell:
    """One measured number.

    Attributes:
        flight: of which. name: as tables call it. metric: of :mod:`skyarm.log.metrics.metric_catalogue`.
        measured: the number. half: half a unit of its last digit: that much of a difference is rounding.
    """

    flight: str
    name: str
    metric: str
    measured: float
    half: float


@dataclass(frozen=True, slots=True)
class Flight:
    """One flight: a scenario as plain tables, whose windows are those of its metrics.

    Attributes:
        name: of the flight. document: the tables. folder: of the vehicles' files that they name.
    """

    name: str
    document: Mapping[str, Any]
    folder: Path = Path()


@dataclass(frozen=True, kw_only=True, slots=True)
class Target:
    """Action of a parameter: ``factor * value + offset`` at a path of the flights whose name fits a pattern.

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
        name, words, unit: of the number. low, high: its range. step: its resolution; values are multiples from ``low``.
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
    """An alternative explanation: parameters to search and choices to make, alone or on top of the fit.

    Attributes:
        name, words: of the explanation. adds: its parameters. choices: choice -> option.
        without: names that it replaces when it is tried on top.
    """

    name: Name
    words: str = ""
    adds: Names = Names()
    choices: Options = field(default_factory=Options)
    without: Names = Names()


@dataclass(frozen=True, kw_only=True, slots=True)
class Prediction:
    """Out of sample: parameters fitted to some cells, judged on others that the search has not used."""

    name: Name
    words: str = ""
    free: Names = Names()
    choices: Options = field(default_factory=Options)
    seen: Name
    unseen: Names = Names()


@dataclass(frozen=True, kw_only=True, slots=True)
class IdentificationStudy:
    """Everything that an identification needs.

    Attributes:
        name: short. seed: of the search. width, knee: of the loss (:func:`skyarm.studies.identify.candidates.losses`).
        flights, cells: measured ones. groups: name -> cells by place. overlays: name -> table for scenarios.
        parameters, choices: what may vary. family: choice -> option of the fit. free: names of the fit.
        ladder, rivals, predictions: what is tried. rival_cells: group on which rivals are tried alone.
        population, generations: of the search.
        document: the file, plain; its digest is part of the study's identity.
    """

    name: str
    title: str
    seed: int
    width: float
    knee: float
    flights: tuple[Flight, ...]
    cells: tuple[Cell, ...]
    groups: Mapping[str, tuple[int, ...]]
    overlays: Mapping[str, Mapping[str, Any]]
    parameters: tuple[Parameter, ...]
    choices: tuple[Choice, ...]
    free: Names
    family: Options
    ladder: tuple[Rung, ...]
    rivals: tuple[Rival, ...]
    rival_cells: Names
    predictions: tuple[Prediction, ...]
    population: int
    generations: int
    document: Mapping[str, Any]

    def parameter(self, name: str) -> Parameter:
        """A parameter by its name."""
        return next(each for each in self.parameters if each.name == name)

    def choice(self, name: str) -> Choice:
        """A choice by its name."""
        return next(each for each in self.choices if each.name == name)

    def among(self, group: str) -> tuple[Cell, ...]:
        """Cells of a group; "" is all of them."""
        return tuple(self.cells[i] for i in self.groups[group]) if group else self.cells

    def flight(self, name: str) -> Flight:
        """A flight by its name."""
        return next(each for each in self.flights if each.name == name)

    def options_of(self, settings: Settings) -> list[Option]:
        """Options of the choices that settings name."""
        return [each.option(settings[each.name]) for each in self.choices if each.name in settings]

    def numbers(self, flight: str, settings: Settings) -> dict[str, Any]:
        """Path -> number of a flight under settings; a later entry of the study overrides an earlier one."""

        def acts(target: Target | Constant) -> bool:
            chosen = all(settings.get(choice) == option for choice, option in target.when.items())
            return chosen and target.flights.fit(flight)

        sets = [each for option in self.options_of(settings) for each in option.sets]
        found: dict[str, Any] = {str(each.path): each.value for each in sets if acts(each)}
        for parameter in self.parameters:
            if parameter.name in settings:
                value = settings[parameter.name]
                found |= {str(t.path): t.factor * value + t.offset for t in parameter.targets if acts(t)}
        return found

    def tables(self, flight: str, settings: Settings) -> dict[str, Any]:
        """The scenario of a flight as plain tables, with those of the options laid over it."""
        found = dict(self.flight(flight).document)
        for option in self.options_of(settings):
            for each in option.tables:
                if each.flights.fit(flight):
                    found = laid_over(found, self.overlays[each.table])
        return found


def laid_over(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Plain tables with others over them: tables merge, else the upper counts; an empty table takes a field away."""
    found = dict(below)
    for name, value in above.items():
        held = found.get(name)
        if value == {}:
            found.pop(name, None)
            continue
        found[name] = laid_over(held, value) if isinstance(held, Mapping) and isinstance(value, Mapping) else value
    return found


def read_identification(content: bytes, folder: Path, source: str) -> IdentificationStudy:
    """The study of a file.

    Args:
        content: of the file.
        folder: where its scenarios' paths start.
        source: its name, for messages.

    Raises:
        IdentificationError: one line with file, field, value and what is allowed.
    """
    try:
        with all_wrong_words():
            return _study(Fields(read_toml(content), ""), folder)
    except ValueError as error:
        raise IdentificationError(one_line(f"{source}: {error}")) from None


def _study(top: Fields, folder: Path) -> IdentificationStudy:
    document = dict(top.table)
    schema, title = top.take("schema", 1), top.take("title", "")
    if schema != 1 or isinstance(schema, bool):
        raise ValueError(f"schema = {shown(schema)}: must be 1")
    if not isinstance(title, str):
        raise ValueError(f"title = {shown(title)}: must be text")
    overlays = {name: Fields(each, f"tables.{name}").table for name, each in _table(top, "tables").items()}
    flights, cells = list[Flight](), list[Cell]()
    for fields in _tables(top, "flights"):
        flight = _flight(fields, overlays, folder)
        flights.append(flight)
        cells += _cells(fields, flight.name)
        fields.done()
    loss, search, fit = (Fields(_table(top, name), name) for name in ("loss", "search", "fit"))
    study = IdentificationStudy(
        name=Name.from_table(top.take("name"), "name"),
        title=title,
        seed=_whole(top, "seed", 0, LARGEST_SEED, 0),
        width=loss.number("width", low=0.0, strict=True),
        knee=loss.number("knee", low=0.0, strict=True),
        population=_whole(search, "population", 4, LARGEST_SEARCH),
        generations=_whole(search, "generations", 0, LARGEST_SEARCH),
        flights=tuple(flights),
        cells=tuple(cells),
        groups={name: _group(f"groups.{name}", each, cells) for name, each in _table(top, "groups").items()},
        overlays=overlays,
        parameters=_records(top, "parameters", Parameter),
        choices=_records(top, "choices", Choice),
        free=Names.from_table(fit.take("free", []), "fit.free"),
        family=Options.from_table(fit.take("choices", {}), "fit.choices"),
        ladder=_records(top, "ladder", Rung),
        rivals=_records(top, "rivals", Rival),
        rival_cells=Names.from_table(top.take("rival_cells", []), "rival_cells"),
        predictions=_records(top, "predictions", Prediction),
        document=document,
    )
    for fields in (loss, search, fit, top):
        fields.done()
    _require_consistent(study)
    _require_flyable(study)
    return study


def _whole(fields: Fields, name: str, low: int, high: int, *default: int) -> int:
    value = fields.number(name, *default, low=float(low))
    if value != int(value) or value > high:
        raise ValueError(f"{fields.at(name)} = {shown(value)}: must be a whole number from {low} to {high}")
    return int(value)


def _table(top: Fields, name: str) -> dict[str, Any]:
    """A table of names, {} if it is left out."""
    return Fields(top.take(name, {}), top.at(name)).table


def _tables(top: Fields, name: str) -> list[Fields]:
    """A list of tables, each with its number in messages."""
    entries = top.take(name, [])
    if not isinstance(entries, list):
        raise ValueError(f"{top.at(name)} = {shown(entries)}: must be a list of tables")
    return [Fields(entry, f"{top.at(name)}[{i}]") for i, entry in enumerate(entries)]


def _records(top: Fields, name: str, kind: type[Record]) -> tuple[Record, ...]:
    return tuple(record_from(kind, fields) for fields in _tables(top, name))


def _flight(fields: Fields, overlays: Mapping[str, Any], folder: Path) -> Flight:
    """A flight, its scenario's tables with others laid over them."""
    name, scenario = Name.from_table(fields.take("name"), fields.at("name")), fields.take("scenario")
    over = Names.from_table(fields.take("over", []), fields.at("over"))
    for each in over:
        if each not in overlays:
            raise ValueError(f"{fields.at('over')} = {shown(each)}: must be one of the tables: {', '.join(overlays)}")
    if scenario in list_scenarios():
        document, beside = dict(read_toml((LIBRARY / f"{scenario}.toml").read_bytes())), Path()
    else:
        at = f"{fields.at('scenario')} = {shown(scenario)}"
        reason = unreadable(folder / scenario) if isinstance(scenario, str) else "no text"
        if reason:
            known = ", ".join(list_scenarios())
            raise ValueError(f"{at}: must be a file beside this one ({reason}), or one of {known}")
        try:
            document, beside = dict(read_toml((folder / scenario).read_bytes())), (folder / scenario).parent
        except ValueError as error:
            raise ValueError(f"{at}: {error}") from None
    for each in over:
        document = laid_over(document, overlays[each])
    return Flight(name, document, beside)


def _cells(flight: Fields, name: str) -> Iterator[Cell]:
    """The measured numbers of a flight."""
    for cell, value in _table(flight, "cells").items():
        fields = Fields(value if isinstance(value, dict) else {"measured": value}, f"{flight.where}.cells.{cell}")
        text, metric = fields.take("measured"), fields.take("metric", cell)
        fields.done()
        try:
            measured = float(text) if isinstance(text, str) else math.nan
        except ValueError:
            measured = math.nan
        if not math.isfinite(measured) or measured == 0.0:
            raise ValueError(f"{fields.at('measured')} = {shown(text)}: must be a number other than 0, as text")
        # of the last digit that is written, whatever the notation: 0.0305, 3.05e-2
        last = Decimal(text).as_tuple().exponent
        yield Cell(name, cell, str(metric), measured, 0.5 * 10.0 ** int(last))


def _group(at: str, patterns: Any, cells: Sequence[Cell]) -> tuple[int, ...]:
    """Places of the cells that patterns fit; a pattern with "!" takes away what came before it."""
    chosen: list[int] = []
    for pattern in patterns if isinstance(patterns, list) else [patterns]:
        text = str(pattern)
        fits = [i for i, c in enumerate(cells) if fnmatchcase(f"{c.flight}/{c.name}", text.removeprefix("!"))]
        if not fits:
            raise ValueError(f"{at} = {shown(pattern)}: must fit a cell, as FLIGHT/CELL")
        chosen = [i for i in chosen if i not in fits] if text.startswith("!") else [*chosen, *fits]
    return tuple(sorted(set(chosen)))


def _acting(study: IdentificationStudy) -> Iterator[tuple[str, Target | Constant | Overlay]]:
    """(field, target) of all that acts on flights."""
    for i, parameter in enumerate(study.parameters):
        yield from ((f"parameters[{i}].targets[{j}]", each) for j, each in enumerate(parameter.targets))
    for i, choice in enumerate(study.choices):
        for j, option in enumerate(choice.options):
            at = f"choices[{i}].options[{j}]"
            yield from ((f"{at}.sets[{k}]", each) for k, each in enumerate(option.sets))
            yield from ((f"{at}.tables[{k}]", each) for k, each in enumerate(option.tables))


def _require_consistent(study: IdentificationStudy) -> None:
    """Names are there once, what is referred to is there, and the ladder climbs to the fit.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    if not study.cells:
        raise ValueError("flights: must have cells, at least one")
    _require_meant(study)
    for at, names, allowed, what in _references(study):
        for k, name in enumerate(names):
            if allowed is not None and name not in allowed:
                raise ValueError(f"{at} = {shown(name)}: must be {what}: {', '.join(allowed) or 'none'}")
            if name in names[:k]:
                raise ValueError(f"{at} = {shown(name)}: must be there once")
    options = {str(choice.name): [str(option.name) for option in choice.options] for choice in study.choices}
    for at, taken in _taken_options(study):
        for choice_name, option_name in taken.items():
            if option_name not in options.get(choice_name, []):
                there = ", ".join(options.get(choice_name, options)) or "none"
                raise ValueError(f"{at}.{choice_name} = {shown(option_name)}: must be one of {there}")


def _require_meant(study: IdentificationStudy) -> None:
    """Every search has something to find, every choice an option, every range a width, every pattern a flight."""
    for at, free in (("fit", study.free), *((f"predictions[{i}]", p.free) for i, p in enumerate(study.predictions))):
        if not free:
            raise ValueError(f"{at}.free = []: must have at least one parameter")
    for i, choice in enumerate(study.choices):
        if not choice.options:
            raise ValueError(f"choices[{i}].options: must have at least one, the first of which leaves all as it is")
    for i, parameter in enumerate(study.parameters):
        _require_range(f"parameters[{i}]", parameter)
    flights = [flight.name for flight in study.flights]
    for at, target in _acting(study):
        for pattern in target.flights:
            if not any(map(Names((pattern,)).fit, flights)):
                raise ValueError(f"{at}.flights = {shown(pattern)}: must fit one of {', '.join(flights)}")


Reference = tuple[str, Sequence[Any], Sequence[str] | None, str]
"""Field, names that it lists, names that it may, what those are; no two of the listed names are alike."""


def _references(study: IdentificationStudy) -> Iterator[Reference]:
    for table in ("flights", "parameters", "choices", "rivals", "predictions"):
        yield f"{table}.name", [each.name for each in getattr(study, table)], None, ""
    parameters, choices = ([str(each.name) for each in some] for some in (study.parameters, study.choices))
    settings, groups = [*parameters, *choices], list(study.groups)
    yield "parameters.name, choices.name", settings, None, ""
    for i, choice in enumerate(study.choices):
        yield f"choices[{i}].options.name", [option.name for option in choice.options], None, ""
    yield "fit.free", study.free, parameters, "a parameter"
    for i, rival in enumerate(study.rivals):
        yield f"rivals[{i}].adds", rival.adds, parameters, "a parameter"
        yield f"rivals[{i}].without", rival.without, settings, "a parameter or a choice"
    yield "rival_cells", study.rival_cells, groups, "one of the groups"
    for i, each in enumerate(study.predictions):
        yield f"predictions[{i}].free", each.free, parameters, "a parameter"
        yield f"predictions[{i}].seen", [each.seen], groups, "one of the groups"
        yield f"predictions[{i}].unseen", each.unseen, groups, "one of the groups"
    climbed = [name for rung in study.ladder for name in rung.adds]
    yield "ladder.adds", climbed, [*study.free, *study.family], "of the fit"
    for at, target in _acting(study):
        if isinstance(target, Overlay):
            yield f"{at}.table", [target.table], list(study.overlays), "one of the tables"


def _taken_options(study: IdentificationStudy) -> Iterator[tuple[str, Options]]:
    """(field, choice -> option) of all that takes options."""
    yield "fit.choices", study.family
    yield from ((f"rivals[{i}].choices", each.choices) for i, each in enumerate(study.rivals))
    yield from ((f"predictions[{i}].choices", each.choices) for i, each in enumerate(study.predictions))
    yield from ((f"{at}.when", each.when) for at, each in _acting(study) if not isinstance(each, Overlay))


def _require_range(at: str, parameter: Parameter) -> None:
    low, high, step = parameter.low, parameter.high, parameter.step
    if parameter.scale not in ("linear", "log"):
        raise ValueError(f"{at}.scale = {shown(parameter.scale)}: must be one of linear, log")
    if not low < high or (parameter.scale == "log" and low <= 0.0):
        raise ValueError(f"{at}.high = {high!r}: must be above low = {low!r}, which is above 0 on a log scale")
    if not (high - low) * FINEST <= step <= high - low:
        raise ValueError(f"{at}.step = {step!r}: must be from a millionth of high - low to all of it, {high - low:g}")


def _require_flyable(study: IdentificationStudy) -> None:
    """Every flight reads, every metric is one, every path is there.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    for flight in study.flights:
        where = f"flights.{flight.name}"
        try:
            scenario = scenario_from(flight.document, flight.folder)
            for cell in study.cells:
                if cell.flight == flight.name:
                    metric_names([cell.metric], scenario.plant.vehicle.n, scenario.commands_setpoints)
            for at, target in _acting(study):
                where = f"{at}: flights.{flight.name}"
                if not isinstance(target, Overlay) and target.flights.fit(flight.name):
                    number_at(scenario, target.path)
        except ValueError as error:
            raise ValueError(f"{where}: {error}") from None


def require_searchable(study: IdentificationStudy) -> None:
    """The ends of every range are numbers that the flights can have, each alone, under the choices it is searched with.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    searched = [("fit", study.free, study.family)]
    searched += [(f"rivals.{each.name}", each.adds, each.choices) for each in study.rivals]
    searched += [(f"predictions.{each.name}", each.free, each.choices) for each in study.predictions]
    for flight in study.flights:
        stated = scenario_from(flight.document, flight.folder)
        for searcher, free, choices in searched:
            tables = study.tables(flight.name, choices)
            scenario = stated if tables == flight.document else scenario_from(tables, flight.folder)
            for each in map(study.parameter, free):
                for end in (each.low, each.high):
                    try:
                        with_numbers(scenario, study.numbers(flight.name, {**choices, each.name: end}))
                    except ValueError as error:
                        where = f"{searcher}: {each.name} = {end:g}: flights.{flight.name}"
                        raise ValueError(f"{where}: {error}") from None
