"""The pieces of an identification study's file: flights and cells, parameters, choices."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from decimal import Decimal
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from skyarm.files import Fields, read_toml, shown, unreadable
from skyarm.identify.records import Cell, Choice, Flight, Option, Parameter, Target, laid_over
from skyarm.scenario.scenario_file import LIBRARY, list_scenarios


def names_among(fields: Fields, name: str, allowed: list[str], what: str) -> tuple[str, ...]:
    """Names of a list, each one of those that are allowed, and none twice."""
    values = listed(fields, name, [])
    for value in values:
        if value not in allowed:
            raise ValueError(f"{fields.at(name)} = {shown(value)}: must be {what}: {', '.join(allowed) or 'none'}")
    require_once(fields.at(name), values)
    return tuple(values)


def listed(fields: Fields, name: str, *default: Any) -> list[Any]:
    """A list; a text alone would be taken letter by letter."""
    values = fields.take(name, *default)
    if not isinstance(values, list):
        raise ValueError(f"{fields.at(name)} = {shown(values)}: must be a list")
    return values


def require_once(at: str, names: Sequence[Any]) -> None:
    """Refuse a name that is there twice."""
    for i, name in enumerate(names):
        if name in names[:i]:
            raise ValueError(f"{at} = {shown(name)}: must be there once")


def text_of(fields: Fields, name: str, *default: Any) -> str:
    """A text; a name, which has no default, is not empty."""
    value = fields.take(name, *default)
    if not isinstance(value, str) or not (value or default):
        raise ValueError(f"{fields.at(name)} = {shown(value)}: must be text")
    return value


def whole(fields: Fields, name: str, low: int, high: int, *default: int) -> int:
    """A whole number."""
    value = fields.number(name, *default, low=float(low))
    if value != int(value) or value > high:
        raise ValueError(f"{fields.at(name)} = {shown(value)}: must be a whole number from {low} to {high}")
    return int(value)


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
    name, scenario = text_of(fields, "name"), fields.take("scenario")
    document, beside = _document(fields.at("scenario"), scenario, folder)
    for over in names_among(fields, "over", list(tables), "one of the tables"):
        document = laid_over(document, tables[over])
    cells = []
    for cell, value in table_of(fields, "cells").items():
        given = Fields(value if isinstance(value, dict) else {"measured": value}, f"{fields.where}.cells.{cell}")
        cells.append(_cell(name, cell, given))
    fields.done()
    return Flight(name, document, beside), cells


def _document(at: str, name: Any, folder: Path) -> tuple[dict[str, Any], Path]:
    """A scenario's tables, and the folder in which its vehicles' files lie."""
    if name in list_scenarios():
        return dict(read_toml((LIBRARY / f"{name}.toml").read_bytes())), Path()
    reason = unreadable(folder / name) if isinstance(name, str) else "no text"
    if reason:
        known = ", ".join(list_scenarios())
        raise ValueError(f"{at} = {shown(name)}: must be a file beside this one ({reason}), or one of {known}")
    try:
        return dict(read_toml((folder / name).read_bytes())), (folder / name).parent
    except ValueError as error:
        raise ValueError(f"{at} = {shown(name)}: {error}") from None


def _cell(flight: str, name: str, fields: Fields) -> Cell:
    text, metric = fields.take("measured"), fields.take("metric", name)
    fields.done()
    try:
        value = float(text) if isinstance(text, str) else math.nan
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or value == 0.0:
        raise ValueError(f"{fields.at('measured')} = {shown(text)}: must be a number other than 0, as text")
    # of the last digit that is written, whatever the notation: 0.0305, 3.05e-2
    last = Decimal(text).as_tuple().exponent
    return Cell(flight, name, str(metric), value, 0.5 * 10.0 ** int(last))


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
    """The choice and option under which a target acts; that they are there is looked at once all choices are read."""
    table = fields.take("when", {})
    if not isinstance(table, dict) or len(table) > 1 or not all(isinstance(each, str) for each in table.values()):
        raise ValueError(f"{fields.at('when')} = {shown(table)}: must be {{ CHOICE = OPTION }}")
    return next(iter(table.items())) if table else ()


def _flights_of(fields: Fields, names: list[str]) -> tuple[str, ...]:
    patterns = listed(fields, "flights")
    for pattern in patterns:
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
    step = fields.number("step", low=0.0, strict=True)
    if not (high - low) * FINEST <= step <= high - low:
        raise ValueError(
            f"{fields.at('step')} = {step!r}: must be from a millionth of high - low to all of it, {high - low:g}"
        )
    targets = tuple(
        Target(
            flights=_flights_of(each, names),
            path=text_of(each, "path"),
            factor=each.number("factor", 1.0),
            offset=each.number("offset", 0.0),
            when=_when(each),
        )
        for each in _checked(tables_of(fields, "targets"), OF_A_PARAMETER)
    )
    found = Parameter(
        name=text_of(fields, "name"),
        words=text_of(fields, "words", ""),
        unit=text_of(fields, "unit", ""),
        low=low,
        high=high,
        step=step,
        scale=scale,
        targets=targets,
    )
    fields.done()
    return found


FINEST = 1e-6
"""Least resolution of a parameter, of its range: single precision tells no more values apart."""

OF_A_PARAMETER, OF_AN_OPTION = ("flights", "path", "factor", "offset", "when"), ("flights", "path", "value", "when")
"""Fields of a target."""


def _checked(rows: list[Fields], words: Sequence[str]) -> list[Fields]:
    """Rows of targets: only fields that a target has."""
    for row in rows:
        for word in row.table:
            if word not in words:
                allowed = ", ".join(words)
                raise ValueError(f"{row.at(word)} = {shown(row.table[word])}: unknown field; allowed: {allowed}")
    return rows


def choice_of(fields: Fields, tables: Mapping[str, Any], names: list[str]) -> Choice:
    """Discrete alternatives."""
    options = []
    for each in tables_of(fields, "options"):
        sets = tuple(
            Target(
                flights=_flights_of(row, names),
                path=text_of(row, "path"),
                factor=0.0,
                offset=row.number("value"),
                when=_when(row),
            )
            for row in _checked(tables_of(each, "sets"), OF_AN_OPTION)
        )
        over = []
        for row in _checked(tables_of(each, "tables"), ("flights", "table")):
            (table,) = names_among(
                Fields({"table": [row.take("table")]}, row.where), "table", list(tables), "one of the tables"
            )
            over.append((_flights_of(row, names), tables[table]))
        words = text_of(each, "words", "")
        options.append(Option(name=text_of(each, "name"), words=words, sets=sets, tables=tuple(over)))
        each.done()
    found = Choice(name=text_of(fields, "name"), words=text_of(fields, "words", ""), options=tuple(options))
    if not options:
        raise ValueError(f"{fields.at('options')}: must have at least one, the first of which leaves all as it is")
    require_once(f"{fields.at('options')}.name", [option.name for option in options])
    fields.done()
    return found
