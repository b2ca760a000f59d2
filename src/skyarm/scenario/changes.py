"""Changes in flight: what a scenario says is other from a control period on.

A change names a number by its path (:mod:`skyarm.scenario.numbers`) or a whole part of the scenario
(:mod:`skyarm.scenario.whole_parts`). What it does to a scenario is told in :mod:`skyarm.scenario.in_flight`.
"""

from __future__ import annotations

import math
import numbers
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.files import Fields, number, shown
from skyarm.records import coerce
from skyarm.records.coerce import RecordError
from skyarm.records.units import Unit
from skyarm.scenario.scenario_parts import ScenarioError

LATEST = 1e7
"""s: ten million control periods at 1 Hz."""

ALLOWED = "must be a number, text, true, false, a list or a table"


@dataclass(frozen=True, kw_only=True, slots=True)
class Change:
    """A change in flight takes hold in the first control period that does not begin before ``at``.

    Attributes:
        at: s.
        path: of a number, or of a part as a whole.
        value: the number, or what a scenario file would hold in the part's place: text, true or false, lists (held as
            tuples) or tables.
    """

    at: Annotated[float, Unit("s", low=0.0)]
    path: str
    value: Any

    def __post_init__(self) -> None:
        try:
            at = number(coerce.plain_number(self.at), "at", low=0.0)
            if at > LATEST:
                raise ScenarioError(f"at = {at!r}: must be at most {LATEST:g} s, beyond which no flight lasts")
            object.__setattr__(self, "at", at)
            if not isinstance(self.path, str) or not self.path:
                raise ScenarioError(f"path = {shown(self.path)}: must be text that is not empty")
            object.__setattr__(self, "value", _held("value", self.value))
        except ValueError as error:
            raise ScenarioError(str(error)) from None
        except RecursionError:
            raise ScenarioError("value: has too many lists or tables within each other") from None

    def tick(self, rate: int) -> int:
        """The control period that it takes hold in, at this control rate (Hz)."""
        k = math.floor(self.at * rate)
        # against the instants as the loop has them: k / rate
        while k / rate < self.at:
            k += 1
        return k

    @property
    def table(self) -> Any:
        """The value as a file's reader gives it: tuples are lists."""
        return _table(self.value)


def _held(field: str, value: Any) -> Any:
    """What a change holds: a number as a float, lists as tuples; whole numbers within them stay."""
    value = coerce.plain_number(value)
    if isinstance(value, (bool, str, Mapping, list, tuple)):
        return _held_within(field, value)
    if value is None or isinstance(value, (bytes, set, frozenset)):
        raise RecordError(f"{field} = {shown(value)}: {ALLOWED}")
    if isinstance(value, numbers.Real):
        return number(value, field)
    try:
        return coerce.number(field, value)  # lanes of a batch, nodes of a trace
    except RecordError:
        raise RecordError(f"{field} = {shown(value)}: {ALLOWED}") from None


def _held_within(field: str, value: Any) -> Any:
    value = coerce.plain_number(value)
    if isinstance(value, Mapping):
        if not all(isinstance(name, str) for name in value):
            raise RecordError(f"{field} = {shown(value)}: must have names that are texts")
        return {name: _held_within(f"{field}.{name}", each) for name, each in value.items()}
    if isinstance(value, (list, tuple)):
        return tuple(_held_within(f"{field}[{i}]", each) for i, each in enumerate(value))
    if isinstance(value, (bool, int, float, str)):
        return value
    raise RecordError(f"{field} = {shown(value)}: {ALLOWED}")


def _table(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _table(each) for name, each in value.items()}
    return [_table(each) for each in value] if isinstance(value, tuple) else value


def changes_from(tables: Any, where: str = "changes") -> tuple[Change, ...]:
    """Changes that a list of tables describes: { at, path, value }.

    Raises:
        ScenarioError: one line with field, value and what is allowed.
    """
    if not isinstance(tables, list):
        raise ScenarioError(f"{where} = {shown(tables)}: must be a list of tables")
    found = []
    for i, table in enumerate(tables):
        try:
            fields = Fields(table, f"{where}[{i}]")
            at, path, value = (fields.take(name) for name in ("at", "path", "value"))
            fields.done()
        except ValueError as error:
            raise ScenarioError(str(error)) from None
        try:
            found.append(Change(at=at, path=path, value=value))
        except ScenarioError as error:
            raise ScenarioError(f"{where}[{i}].{error}") from None
    return tuple(found)


def in_order(changes: Iterable[Change], rate: int) -> tuple[Change, ...]:
    """Changes as they take hold: by control period, those of one period in the order given."""
    return tuple(sorted(changes, key=lambda change: change.tick(rate)))


def without_law(changes: Iterable[Change]) -> tuple[Change, ...]:
    """The changes that are not of the controller: another law than the one they were meant for flies without them."""
    return tuple(each for each in changes if each.path.split(".", maxsplit=1)[0] != "controller")


def require_within(changes: Iterable[Change], steps: int, rate: int) -> None:
    """Refuse changes that take hold in no control period of a flight.

    Raises:
        ScenarioError: one line.
    """
    for i, change in enumerate(changes):
        if change.tick(rate) >= steps:
            last = (steps - 1) / rate
            raise ScenarioError(f"changes[{i}].at = {change.at!r}: must be at most {last:g} s, the last control period")
