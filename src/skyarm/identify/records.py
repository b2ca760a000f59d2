"""What an identification is about: flights, the cells that were measured of them, parameters and choices."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

Settings = Mapping[str, Any]
"""Parameter -> number, choice -> option. What is not named stays as the flights' scenarios have it."""


@dataclass(frozen=True, slots=True)
class Cell:
    """One measured number.

    Attributes:
        flight: of which. name: as tables call it. metric: of :mod:`skyarm.metrics.metric_catalogue`.
        measured: the number. half: half a unit of its last digit: that much of a difference is rounding.
    """

    flight: str
    name: str
    metric: str
    measured: float
    half: float


@dataclass(frozen=True, slots=True)
class Flight:
    """One flight: a scenario as plain tables, whose windows say when its metrics look.

    Attributes:
        name: of the flight. document: the tables. folder: where the vehicles' files lie that they name.
    """

    name: str
    document: Mapping[str, Any]
    folder: Path = Path()


@dataclass(frozen=True, kw_only=True, slots=True)
class Target:
    """Where a parameter acts: ``factor * value + offset`` at a path of those flights whose name fits a pattern.

    Attributes:
        flights: patterns. path: of :mod:`skyarm.scenario.numbers`.
        when: (choice, option): it acts only where the choice is taken so; empty acts always.
    """

    flights: tuple[str, ...]
    path: str
    factor: float = 1.0
    offset: float = 0.0
    when: tuple[str, str] | tuple[()] = ()

    def acts(self, flight: str, settings: Settings) -> bool:
        """Whether it acts on a flight."""
        chosen = not self.when or settings.get(self.when[0]) == self.when[1]
        return chosen and any(fnmatchcase(flight, pattern) for pattern in self.flights)


@dataclass(frozen=True, kw_only=True, slots=True)
class Parameter:
    """A free number.

    Attributes:
        name, words, unit: what it is. low, high: its range. step: its resolution; values are multiples from ``low`` on.
        scale: "linear", or "log": how the range is searched.
        targets: where it acts.
    """

    name: str
    words: str
    unit: str
    low: float
    high: float
    step: float
    scale: str = "linear"
    targets: tuple[Target, ...] = ()


@dataclass(frozen=True, kw_only=True, slots=True)
class Option:
    """One way to take a choice: constant numbers (as targets with a factor of 0), or tables laid over the scenario."""

    name: str
    words: str = ""
    sets: tuple[Target, ...] = ()
    tables: tuple[tuple[tuple[str, ...], Mapping[str, Any]], ...] = ()


@dataclass(frozen=True, kw_only=True, slots=True)
class Choice:
    """Discrete alternatives."""

    name: str
    words: str
    options: tuple[Option, ...]

    def option(self, name: str) -> Option:
        """An option by its name."""
        return next(each for each in self.options if each.name == name)


@dataclass(frozen=True, kw_only=True, slots=True)
class Rung:
    """A step of the ladder: what is set from here on."""

    name: str
    adds: tuple[str, ...]


@dataclass(frozen=True, kw_only=True, slots=True)
class Rival:
    """Another explanation: parameters to search and choices to take, alone or on top of what was found.

    Attributes:
        name, words: what it is. adds: its parameters. choices: choice -> option.
        without: names that it replaces when it is tried on top.
    """

    name: str
    words: str
    adds: tuple[str, ...] = ()
    choices: Mapping[str, str] = field(default_factory=dict)
    without: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True, slots=True)
class Prediction:
    """Out of sample: parameters found on some cells, judged on others they have not seen."""

    name: str
    words: str
    free: tuple[str, ...]
    choices: Mapping[str, str]
    seen: str
    unseen: tuple[str, ...]


@dataclass(frozen=True, kw_only=True, slots=True)
class IdentificationStudy:
    """Everything that an identification needs.

    Attributes:
        name: short. seed: of the search. width, knee: of the loss (:mod:`skyarm.identify.cell_loss`).
        flights, cells: what was measured. groups: name -> cells by place.
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
    parameters: tuple[Parameter, ...]
    choices: tuple[Choice, ...]
    free: tuple[str, ...]
    family: Mapping[str, str]
    ladder: tuple[Rung, ...]
    rivals: tuple[Rival, ...]
    rival_cells: tuple[str, ...]
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

    def numbers(self, flight: str, settings: Settings) -> dict[str, Any]:
        """Path -> number of a flight under settings; what stands later in the study wins."""
        found: dict[str, Any] = {}
        for choice in self.choices:
            if choice.name in settings:
                for target in choice.option(settings[choice.name]).sets:
                    if target.acts(flight, settings):
                        found[target.path] = target.offset
        for parameter in self.parameters:
            if parameter.name in settings:
                for target in parameter.targets:
                    if target.acts(flight, settings):
                        found[target.path] = target.factor * settings[parameter.name] + target.offset
        return found

    def tables(self, flight: str, settings: Settings) -> dict[str, Any]:
        """The scenario of a flight as plain tables, with those of the options laid over it."""
        found = dict(self.flight(flight).document)
        for choice in self.choices:
            if choice.name in settings:
                for patterns, table in choice.option(settings[choice.name]).tables:
                    if any(fnmatchcase(flight, pattern) for pattern in patterns):
                        found = laid_over(found, table)
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
