"""Identification studies from TOML files.

A file has ``schema = 1``, ``name``, ``title``, ``seed`` and these tables::

    [loss]          width, knee: of the logarithms (skyarm.identify.cell_loss)
    [search]        population, generations: of the differential evolution
    [tables.NAME]   tables of a scenario file, to be laid over flights; an empty table takes a field away
    [[flights]]     name, scenario (of the library, or a path beside the file), over = [NAMES of tables],
                    cells = { NAME = "0.019", or { measured = "0.55", metric = "gust_peak_x" } }: a number in text,
                    whose digits say how well it is known; the metric is the name if left out
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

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from skyarm.files import Fields, all_wrong_words, one_line, read_toml, shown
from skyarm.identify.records import IdentificationStudy, Prediction, Rival, Rung
from skyarm.identify.study_checks import require_consistent, require_flyable
from skyarm.identify.study_tables import (
    cells_of_group,
    choice_of,
    flight_and_cells,
    groups_of,
    names_among,
    parameter_of,
    table_of,
    tables_of,
    text_of,
    whole,
)


class IdentificationError(ValueError):
    """An identification study is wrong."""


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
    schema = top.take("schema", 1)
    if schema != 1 or isinstance(schema, bool):
        raise ValueError(f"schema = {shown(schema)}: must be 1")
    tables = {name: Fields(each, f"tables.{name}").table for name, each in table_of(top, "tables").items()}
    flights, cells = [], []
    for fields in tables_of(top, "flights"):
        flight, own = flight_and_cells(fields, tables, folder)
        flights.append(flight)
        cells += own
    names = [flight.name for flight in flights]
    parameters = [parameter_of(fields, names) for fields in tables_of(top, "parameters")]
    choices = [choice_of(fields, tables, names) for fields in tables_of(top, "choices")]
    known = _Known([p.name for p in parameters], {c.name: [o.name for o in c.options] for c in choices})
    patterns = table_of(top, "groups")
    groups = {name: cells_of_group(f"groups.{name}", each, cells) for name, each in patterns.items()}
    loss, search, fit = (Fields(table_of(top, name), name) for name in ("loss", "search", "fit"))
    study = IdentificationStudy(
        name=text_of(top, "name"),
        title=text_of(top, "title", ""),
        seed=whole(top, "seed", 0, LARGEST_SEED, 0),
        width=loss.number("width", low=0.0, strict=True),
        knee=loss.number("knee", low=0.0, strict=True),
        population=whole(search, "population", 4, LARGEST_SEARCH),
        generations=whole(search, "generations", 0, LARGEST_SEARCH),
        flights=tuple(flights),
        cells=tuple(cells),
        groups=groups,
        parameters=tuple(parameters),
        choices=tuple(choices),
        free=known.parameters_of(fit, "free"),
        family=known.choices_of(fit),
        ladder=tuple(_rung(fields, known) for fields in tables_of(top, "ladder")),
        rivals=tuple(_rival(fields, known) for fields in tables_of(top, "rivals")),
        rival_cells=groups_of(top, "rival_cells", groups),
        predictions=tuple(_prediction(fields, known, groups) for fields in tables_of(top, "predictions")),
        document=document,
    )
    for fields in (loss, search, fit, top):
        fields.done()
    require_consistent(study)
    require_flyable(study)
    return study


class _Known:
    """Names of parameters and choices, to refuse others."""

    def __init__(self, parameters: list[str], choices: Mapping[str, list[str]]) -> None:
        self.parameters, self.choices = parameters, choices

    def parameters_of(self, fields: Fields, name: str) -> tuple[str, ...]:
        return names_among(fields, name, self.parameters, "a parameter")

    def any_of(self, fields: Fields, name: str) -> tuple[str, ...]:
        return names_among(fields, name, [*self.parameters, *self.choices], "a parameter or a choice")

    def choices_of(self, fields: Fields) -> dict[str, str]:
        """choices = { CHOICE = OPTION }."""
        table = fields.take("choices", {})
        for name, option in Fields(table, fields.at("choices")).table.items():
            if not isinstance(option, str) or option not in self.choices.get(name, []):
                there = ", ".join(self.choices.get(name, self.choices))
                raise ValueError(f"{fields.at('choices')}.{name} = {shown(option)}: must be one of {there}")
        return dict(table)


LARGEST_SEED = 2**32 - 1

LARGEST_SEARCH = 100_000
"""Candidates of a generation, and generations."""


def _rung(fields: Fields, known: _Known) -> Rung:
    found = Rung(name=text_of(fields, "name"), adds=known.any_of(fields, "adds"))
    fields.done()
    return found


def _rival(fields: Fields, known: _Known) -> Rival:
    found = Rival(
        name=text_of(fields, "name"),
        words=text_of(fields, "words", ""),
        adds=known.parameters_of(fields, "adds"),
        choices=known.choices_of(fields),
        without=known.any_of(fields, "without"),
    )
    fields.done()
    return found


def _prediction(fields: Fields, known: _Known, groups: Mapping[str, Any]) -> Prediction:
    found = Prediction(
        name=text_of(fields, "name"),
        words=text_of(fields, "words", ""),
        free=known.parameters_of(fields, "free"),
        choices=known.choices_of(fields),
        seen=fields.choice("seen", tuple(groups)),
        unseen=groups_of(fields, "unseen", groups),
    )
    fields.done()
    return found
