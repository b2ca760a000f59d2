"""The pieces of an identification study's file: flights and cells, parameters, choices."""

from __future__ import annotations

import math
from collections.abc import Mapping
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from skyarm.files import Fields, read_toml, shown
from skyarm.identify.records import Cell, Choice, Flight, Option, Parameter, Target, laid_over
from skyarm.scenario.scenario_file import LIBRARY, list_scenarios


def names_among(fields: Fields, name: str, allowed: list[str], what: str) -> tuple[str, ...]:
    """Names of a list, each one of those that are allowed."""
    values = fields.take(name, [])
    for value in values if isinstance(values, list) else [values]:
        if value not in allowed:
            raise ValueError(f"{fields.at(name)} = {shown(value)}: must be {what}: {', '.join(allowed)}")
    return tuple(values)


def table_of(top: Fields, name: str) -> dict[str, Any]:
    """A table of names, {} if it is left out."""
    return Fields(top.take(name, {}), top.at(name)).table


def tables_of(top: Fields, name: str) -> list[Fields]:
    """A list of tables, each with its number in messages."""
    entries = top.take(name, [])
    if not isinstance(entries, list):
        raise ValueError(f"{top.at(name)} = {shown(entries)}: must be a list of tables")
    return [Fields(entry, f"{top.at(name)}[{i}]") for i, entry in enumerate(entries)]


def flight_and_cells(fields: Fields, tables: Mapping[str, Any], folder: Path) -> tuple[Flight, list[Cell]]:
    """A flight and what was measured of it."""
    name, scenario = str(fields.take("name")), fields.take("scenario")
    document = _document(fields.at("scenario"), scenario, folder)
    for over in names_among(fields, "over", list(tables), "one of the tables"):
        document = laid_over(document, tables[over])
    cells = []
    for cell, value in table_of(fields, "cells").items():
        given = Fields(value if isinstance(value, dict) else {"measured": value}, f"{fields.where}.cells.{cell}")
        cells.append(_cell(name, cell, given))
    fields.done()
    return Flight(name, document), cells


def _document(at: str, name: Any, folder: Path) -> dict[str, Any]:
    if name in list_scenarios():
        return dict(read_toml((LIBRARY / f"{name}.toml").read_bytes()))
    if not isinstance(name, str) or not (folder / name).is_file():
        raise ValueError(
            f"{at} = {shown(name)}: must be a file beside this one, or one of {', '.join(list_scenarios())}"
        )
    return dict(read_toml((folder / name).read_bytes()))


def _cell(flight: str, name: str, fields: Fields) -> Cell:
    text, metric = fields.take("measured"), fields.take("metric", name)
    fields.done()
    try:
        value = float(text) if isinstance(text, str) else math.nan
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or value == 0.0:
        raise ValueError(f"{fields.at('measured')} = {shown(text)}: must be a number other than 0, as text")
    decimals = len(text.partition(".")[2])
    return Cell(flight, name, str(metric), value, 0.5 * 10.0**-decimals)


def cells_of_group(at: str, patterns: Any, cells: list[Cell]) -> tuple[int, ...]:
    """Places of the cells that patterns fit; a pattern with "!" takes away what came before it."""
    chosen: list[int] = []
    for pattern in patterns if isinstance(patterns, list) else [patterns]:
        text = str(pattern)
        fits = [i for i, c in enumerate(cells) if fnmatchcase(f"{c.flight}/{c.name}", text.removeprefix("!"))]
        if not fits:
            raise ValueError(f"{at} = {shown(pattern)}: must fit a cell, as FLIGHT/CELL")
        chosen = [i for i in chosen if i not in fits] if text.startswith("!") else [*chosen, *fits]
    return tuple(sorted(set(chosen)))


def groups_of(fields: Fields, name: str, groups: Mapping[str, Any]) -> tuple[str, ...]:
    """Names of groups."""
    return names_among(fields, name, list(groups), "one of the groups")


def _when(fields: Fields) -> tuple[str, str] | tuple[()]:
    table = fields.take("when", {})
    if not isinstance(table, dict) or len(table) > 1:
        raise ValueError(f"{fields.at('when')} = {shown(table)}: must be {{ CHOICE = OPTION }}")
    return next(iter(table.items())) if table else ()


def _flights_of(fields: Fields, names: list[str]) -> tuple[str, ...]:
    patterns = fields.take("flights")
    for pattern in patterns if isinstance(patterns, list) else [patterns]:
        if not isinstance(pattern, str) or not any(fnmatchcase(name, pattern) for name in names):
            raise ValueError(f"{fields.at('flights')} = {shown(pattern)}: must fit one of {', '.join(names)}")
    return tuple(patterns)


def parameter_of(fields: Fields, names: list[str]) -> Parameter:
    """A free number."""
    low, high = fields.number("low"), fields.number("high")
    scale = fields.choice("scale", ("linear", "log"), "linear")
    if not low < high or (scale == "log" and low <= 0.0):
        raise ValueError(
            f"{fields.at('high')} = {high!r}: must be above low = {low!r}, which is above 0 on a log scale"
        )
    targets = tuple(
        Target(
            flights=_flights_of(each, names),
            path=str(each.take("path")),
            factor=each.number("factor", 1.0),
            offset=each.number("offset", 0.0),
            when=_when(each),
        )
        for each in _checked(tables_of(fields, "targets"))
    )
    found = Parameter(
        name=str(fields.take("name")),
        words=str(fields.take("words", "")),
        unit=str(fields.take("unit", "")),
        low=low,
        high=high,
        step=fields.number("step", low=0.0, strict=True),
        scale=scale,
        targets=targets,
    )
    fields.done()
    return found


def _checked(rows: list[Fields]) -> list[Fields]:
    """Rows of targets: only fields that a target has."""
    for row in rows:
        for word in row.table:
            if word not in ("flights", "path", "factor", "offset", "value", "when"):
                raise ValueError(f"{row.at(word)} = {shown(row.table[word])}: unknown field")
    return rows


def choice_of(fields: Fields, tables: Mapping[str, Any], names: list[str]) -> Choice:
    """Discrete alternatives."""
    options = []
    for each in tables_of(fields, "options"):
        sets = tuple(
            Target(
                flights=_flights_of(row, names),
                path=str(row.take("path")),
                factor=0.0,
                offset=row.number("value"),
                when=_when(row),
            )
            for row in _checked(tables_of(each, "sets"))
        )
        over = []
        for row in tables_of(each, "tables"):
            (table,) = names_among(
                Fields({"table": [row.take("table")]}, row.where), "table", list(tables), "one of the tables"
            )
            over.append((_flights_of(row, names), tables[table]))
        words = str(each.take("words", ""))
        options.append(Option(name=str(each.take("name")), words=words, sets=sets, tables=tuple(over)))
        each.done()
    found = Choice(name=str(fields.take("name")), words=str(fields.take("words", "")), options=tuple(options))
    fields.done()
    return found
