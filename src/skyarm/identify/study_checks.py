"""What of an identification study could not be carried out, found before anything flies."""

from __future__ import annotations

from collections.abc import Sequence
from fnmatch import fnmatchcase
from typing import Any

from skyarm.files import shown
from skyarm.identify.records import IdentificationStudy
from skyarm.identify.study_tables import require_once
from skyarm.metrics.metric_catalogue import metric_names
from skyarm.scenario.numbers import number_at, with_numbers
from skyarm.scenario.scenario_file import scenario_from


def require_consistent(study: IdentificationStudy) -> None:
    """Names are there once, what is fitted is there, and the ladder climbs to the fit.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    if not study.cells:
        raise ValueError("flights: must have cells, at least one")
    once: dict[str, Sequence[Any]] = {
        "flights": study.flights,
        "parameters": study.parameters,
        "choices": study.choices,
        "rivals": study.rivals,
        "predictions": study.predictions,
    }
    for field, records in once.items():
        require_once(f"{field}.name", [each.name for each in records])
    both = [*(each.name for each in study.parameters), *(each.name for each in study.choices)]
    require_once("parameters.name, choices.name", both)
    options = {choice.name: [option.name for option in choice.options] for choice in study.choices}
    targets = [(f"parameters.{each.name}", target) for each in study.parameters for target in each.targets]
    targets += [(f"choices.{c.name}", target) for c in study.choices for o in c.options for target in o.sets]
    for where, target in targets:
        if target.when and target.when[1] not in options.get(target.when[0], []):
            there = ", ".join(options.get(target.when[0], options)) or "none"
            said = f"{where}.targets.when = {shown(dict([target.when]))}"
            raise ValueError(f"{said}: must be an option of a choice: {there}")
    fits = {"fit.free": study.free} | {f"predictions.{each.name}.free": each.free for each in study.predictions}
    for field, free in fits.items():
        if not free:
            raise ValueError(f"{field} = []: must have at least one parameter")
    fitted = (*study.free, *study.family)
    climbed = [name for rung in study.ladder for name in rung.adds]
    require_once("ladder.adds", climbed)
    for name in climbed:
        if name not in fitted:
            raise ValueError(f"ladder.adds = {shown(name)}: must be of the fit: {', '.join(fitted)}")


def require_flyable(study: IdentificationStudy) -> None:
    """Every flight reads, every metric is one, every path is there.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    paths = {f"parameters.{each.name}": each.targets for each in study.parameters}
    paths |= {f"choices.{c.name}": tuple(t for o in c.options for t in o.sets) for c in study.choices}
    for flight in study.flights:
        where = f"flights.{flight.name}"
        try:
            scenario = scenario_from(flight.document, flight.folder)
            for cell in study.cells:
                if cell.flight == flight.name:
                    metric_names([cell.metric], scenario.world.vehicle.n, scenario.told)
            for field, targets in paths.items():
                where = f"{field}: flights.{flight.name}"
                for target in targets:
                    if any(fnmatchcase(flight.name, pattern) for pattern in target.flights):
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
        for field, free, choices in searched:
            tables = study.tables(flight.name, choices)
            scenario = stated if tables == flight.document else scenario_from(tables, flight.folder)
            for each in map(study.parameter, free):
                for end in (each.low, each.high):
                    try:
                        with_numbers(scenario, study.numbers(flight.name, {**choices, each.name: end}))
                    except ValueError as error:
                        where = f"{field}: {each.name} = {end:g}: flights.{flight.name}"
                        raise ValueError(f"{where}: {error}") from None
