"""What a bench's folder holds the report of, where that is another bench."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from skyarm.compare.cells import Flights, chosen
from skyarm.compare.results import Bench
from skyarm.compare.suite import Condition


def replaced(bench: Bench, file: Path) -> list[str]:
    """What a stored report was made with and this bench is not: one piece of words each; nothing where they agree.

    Args:
        bench: what would fly.
        file: ``results.json`` of a bench; one that is not there or cannot be read says nothing.
    """
    try:
        stored = json.loads(file.read_bytes())
        return _differences(stored, bench)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return []


def _differences(stored: Mapping[str, Any], bench: Bench) -> list[str]:
    summaries = stored["summaries"]
    laws = {name for cases in summaries.values() for found in cases.values() for name in found}
    pieces = []
    if laws != set(bench.entrants):
        pieces.append(f"laws {_few(laws)}")
    if set(summaries) != set(bench.conditions):
        pieces.append(f"conditions {_few(summaries)}")
    pieces += [f"{name} {stored[name]}" for name in ("seed", "plant") if stored[name] != getattr(bench, name)]
    for name, cases in summaries.items():
        flown = max(each["episodes"] for found in cases.values() for each in found.values())
        if name in bench.conditions and flown != _most(bench, bench.conditions[name]):
            pieces.append(f"{name} of {flown} flights")
    return pieces


def _few(names: Any, limit: int = 4) -> str:
    listed = list(names)
    return ", ".join(sorted(listed)) if len(listed) <= limit else f"({len(listed)})"


def _most(bench: Bench, condition: Condition) -> int:
    """Flights of the law that flies most of them under a condition: those that fly one by one fly fewer."""
    most = 0
    for flights in chosen(
        bench.entrants, {condition.name: condition}, seed=bench.seed, plant=bench.plant, single=bench.single
    ):
        most = max(most, _episodes(flights))
        if most == condition.episodes:
            break
    return most


def _episodes(flights: Flights) -> int:
    return flights.episodes(flights.scenario())
