"""Checks of an identification study: names, ranges, and numbers that its flights can
have.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from inference.study import (
    Constant,
    IdentificationError,
    IdentificationStudy,
    Names,
    Options,
    Overlay,
    Parameter,
    Target,
    read_identification,
)
from skyarm.log.metrics.metric_catalogue import metric_names
from skyarm.records.files import one_line, shown
from skyarm.scenario.numbers import number_at, with_numbers
from skyarm.scenario.scenario_file import scenario_from

LARGEST_SEED = 2**32 - 1

LARGEST_SEARCH = 100_000
"""Candidates of a generation, and generations."""

FINEST = 1e-6
"""Least resolution of a parameter, of its range: single precision distinguishes no more
values."""

Reference = tuple[str, Sequence[str], Sequence[str] | None, str]
"""Field, names that it lists, names that it may, what those are; no two of the listed
names are alike."""


def checked_study(content: bytes, folder: Path, source: str) -> IdentificationStudy:
    """The study of a file, checked before anything flies.

    Raises:
        IdentificationError: one line with file, field, value and what is allowed.
    """
    study = read_identification(content, folder, source)
    try:
        _require_search(study)
        _require_consistent(study)
        _require_flyable(study)
    except ValueError as error:
        raise IdentificationError(one_line(f"{source}: {error}")) from None
    return study


def _require_search(study: IdentificationStudy) -> None:
    bounds = {
        "seed": (study.plan.seed, 0, LARGEST_SEED),
        "search.population": (study.plan.search.population, 4, LARGEST_SEARCH),
        "search.generations": (study.plan.search.generations, 0, LARGEST_SEARCH),
    }
    for at, (value, low, high) in bounds.items():
        if not low <= value <= high:
            raise ValueError(
                f"{at} = {value}: must be a whole number from {low} to {high}"
            )
    for at, loss in (
        ("loss.width", study.plan.loss.width),
        ("loss.knee", study.plan.loss.knee),
    ):
        if not loss > 0.0:
            raise ValueError(f"{at} = {loss!r}: must be above 0")


def _acting(
    study: IdentificationStudy,
) -> Iterator[tuple[str, Target | Constant | Overlay]]:
    """(field, target) of all that acts on flights."""
    for i, parameter in enumerate(study.plan.parameters):
        yield from (
            (f"parameters[{i}].targets[{j}]", each)
            for j, each in enumerate(parameter.targets)
        )
    for i, choice in enumerate(study.plan.choices):
        for j, option in enumerate(choice.options):
            at = f"choices[{i}].options[{j}]"
            yield from ((f"{at}.sets[{k}]", each) for k, each in enumerate(option.sets))
            yield from (
                (f"{at}.tables[{k}]", each) for k, each in enumerate(option.tables)
            )


def _require_consistent(study: IdentificationStudy) -> None:
    """Names are there once, what is referred to is there, and the ladder climbs to the
    fit.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    if not study.cells:
        raise ValueError("flights: must have cells, at least one")
    _require_meant(study)
    for at, names, allowed, what in _references(study):
        for k, name in enumerate(names):
            if allowed is not None and name not in allowed:
                raise ValueError(
                    f"{at} = {shown(name)}: must be {what}:"
                    f" {', '.join(allowed) or 'none'}"
                )
            if name in names[:k]:
                raise ValueError(f"{at} = {shown(name)}: must be there once")
    options = {
        str(choice.name): [str(option.name) for option in choice.options]
        for choice in study.plan.choices
    }
    for at, taken in _taken_options(study):
        for choice_name, option_name in taken.items():
            if option_name not in options.get(choice_name, []):
                there = ", ".join(options.get(choice_name, options)) or "none"
                raise ValueError(
                    f"{at}.{choice_name} = {shown(option_name)}: must be one of {there}"
                )


def _require_meant(study: IdentificationStudy) -> None:
    """Every search has something to find, every choice an option, every range a width,
    every pattern a flight.
    """
    for at, free in (
        ("fit", study.plan.fit.free),
        *((f"predictions[{i}]", p.free) for i, p in enumerate(study.plan.predictions)),
    ):
        if not free:
            raise ValueError(f"{at}.free = []: must have at least one parameter")
    for i, choice in enumerate(study.plan.choices):
        if not choice.options:
            raise ValueError(
                f"choices[{i}].options: must have at least one, the first of which"
                " leaves all as it is"
            )
    for i, parameter in enumerate(study.plan.parameters):
        _require_range(f"parameters[{i}]", parameter)
    flights = [flight.name for flight in study.flights]
    for at, target in _acting(study):
        for pattern in target.flights:
            if not any(map(Names((pattern,)).fit, flights)):
                raise ValueError(
                    f"{at}.flights = {shown(pattern)}: must fit one of"
                    f" {', '.join(flights)}"
                )


def _references(study: IdentificationStudy) -> Iterator[Reference]:
    yield "flights.name", [each.name for each in study.flights], None, ""
    for table in ("parameters", "choices", "rivals", "predictions"):
        yield (
            f"{table}.name",
            [each.name for each in getattr(study.plan, table)],
            None,
            "",
        )
    parameters, choices = (
        [str(each.name) for each in some]
        for some in (study.plan.parameters, study.plan.choices)
    )
    settings, groups = [*parameters, *choices], list(study.groups)
    yield "parameters.name, choices.name", settings, None, ""
    for i, choice in enumerate(study.plan.choices):
        yield (
            f"choices[{i}].options.name",
            [option.name for option in choice.options],
            None,
            "",
        )
    yield "fit.free", study.plan.fit.free, parameters, "a parameter"
    for i, rival in enumerate(study.plan.rivals):
        yield f"rivals[{i}].adds", rival.adds, parameters, "a parameter"
        yield f"rivals[{i}].without", rival.without, settings, "a parameter or a choice"
    yield "rival_cells", study.plan.rival_cells, groups, "one of the groups"
    for i, each in enumerate(study.plan.predictions):
        yield f"predictions[{i}].free", each.free, parameters, "a parameter"
        yield f"predictions[{i}].seen", [each.seen], groups, "one of the groups"
        yield f"predictions[{i}].unseen", each.unseen, groups, "one of the groups"
    climbed = [name for rung in study.plan.ladder for name in rung.adds]
    yield (
        "ladder.adds",
        climbed,
        [*study.plan.fit.free, *study.plan.fit.choices],
        "of the fit",
    )
    for at, target in _acting(study):
        if isinstance(target, Overlay):
            yield (
                f"{at}.table",
                [target.table],
                list(study.plan.tables),
                "one of the tables",
            )


def _taken_options(study: IdentificationStudy) -> Iterator[tuple[str, Options]]:
    """(field, choice -> option) of all that takes options."""
    yield "fit.choices", study.plan.fit.choices
    yield from (
        (f"rivals[{i}].choices", each.choices)
        for i, each in enumerate(study.plan.rivals)
    )
    yield from (
        (f"predictions[{i}].choices", each.choices)
        for i, each in enumerate(study.plan.predictions)
    )
    yield from (
        (f"{at}.when", each.when)
        for at, each in _acting(study)
        if not isinstance(each, Overlay)
    )


def _require_range(at: str, parameter: Parameter) -> None:
    low, high, step = parameter.low, parameter.high, parameter.step
    if parameter.scale not in ("linear", "log"):
        raise ValueError(
            f"{at}.scale = {shown(parameter.scale)}: must be one of linear, log"
        )
    if not low < high or (parameter.scale == "log" and low <= 0.0):
        raise ValueError(
            f"{at}.high = {high!r}: must be above low = {low!r}, which is above 0"
            " on a log scale"
        )
    if not (high - low) * FINEST <= step <= high - low:
        raise ValueError(
            f"{at}.step = {step!r}: must be from a millionth of high - low to all of"
            f" it, {high - low:g}"
        )


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
                    metric_names(
                        [cell.metric],
                        scenario.agent.plant.vehicle.n,
                        scenario.agent.commands_setpoints,
                    )
            for at, target in _acting(study):
                where = f"{at}: flights.{flight.name}"
                if not isinstance(target, Overlay) and target.flights.fit(flight.name):
                    number_at(scenario, target.path)
        except ValueError as error:
            raise ValueError(f"{where}: {error}") from None


def require_searchable(study: IdentificationStudy) -> None:
    """The ends of every range are numbers that the flights can have, each alone, under
    the choices it is searched with.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    searched = [("fit", study.plan.fit.free, study.plan.fit.choices)]
    searched += [
        (f"rivals.{each.name}", each.adds, each.choices) for each in study.plan.rivals
    ]
    searched += [
        (f"predictions.{each.name}", each.free, each.choices)
        for each in study.plan.predictions
    ]
    for flight in study.flights:
        stated = scenario_from(flight.document, flight.folder)
        for searcher, free, choices in searched:
            tables = study.scenario_tables(flight.name, choices)
            scenario = (
                stated
                if tables == flight.document
                else scenario_from(tables, flight.folder)
            )
            for each in map(study.parameter, free):
                for end in (each.low, each.high):
                    try:
                        with_numbers(
                            scenario,
                            study.numbers(flight.name, {**choices, each.name: end}),
                        )
                    except ValueError as error:
                        where = (
                            f"{searcher}: {each.name} = {end:g}: flights.{flight.name}"
                        )
                        raise ValueError(f"{where}: {error}") from None
