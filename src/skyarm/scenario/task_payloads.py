"""Instants of payloads that phases of a reference pick up and put down."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from skyarm.files import did_you_mean, shown
from skyarm.reference.task_records import TaskEvent

FIELD = {"pick": "pick", "place": "drop"}
"""Kind of a phase -> field of the payload."""

DONE = {"pick": "picks", "place": "places"}


def with_instants(tables: Any, events: Sequence[TaskEvent], control_rate: float) -> Any:
    """The tables of ``[[payloads]]`` with the instants at which phases pick and place them.

    Args:
        tables: as the file has them.
        events: of the phases.
        control_rate: Hz; instants are whole control periods.

    Raises:
        ValueError: one line: a payload that is not there, or one that has the instant from elsewhere.
    """
    if not events or not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        return tables  # nothing to add, or not what the reader of payloads takes
    found = [dict(table) for table in tables]
    named: dict[str, int] = {}
    for i, name in enumerate(table.get("name") for table in found):
        if isinstance(name, str) and named.setdefault(name, i) != i:
            raise ValueError(f"payloads[{i}].name = {shown(name)}: must differ from that of payloads[{named[name]}]")
    seen: dict[tuple[str, str], str] = {}
    for event in events:
        at = f"{event.where}.payload = {shown(event.payload)}"
        if event.payload not in named:
            near = did_you_mean(event.payload, named)
            there = ", ".join(named) or "none"
            raise ValueError(f"{at}: {near}must be the name of one of [[payloads]]; there are {there}")
        i, field = named[event.payload], FIELD[event.kind]
        if (event.payload, event.kind) in seen:
            before = f"{seen[event.payload, event.kind]} {DONE[event.kind]} it already"
            raise ValueError(f"{at}: must be the name of another payload: {before}")
        if event.kind == "pick" and (event.payload, "place") in seen:
            raise ValueError(f"{at}: must be picked before {seen[event.payload, 'place']} places it")
        seen[event.payload, event.kind] = event.where
        if field in found[i]:
            raise ValueError(
                f"payloads[{i}].{field} = {shown(found[i][field])}: must be left out, {event.where} says when"
            )
        found[i][field] = math.ceil(event.time * control_rate - 1e-9) / control_rate
    return found
