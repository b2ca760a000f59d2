"""What a comparison's folder holds the report of, where that is another comparison."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from skyarm.compare.cells import Cells, Flights, chosen
from skyarm.compare.comparison import Comparison
from skyarm.compare.suite import Condition
from skyarm.registry.plugins import identities


def replaced(comparison: Comparison, file: Path) -> list[str]:
    """What a stored report was made with and this comparison is not: one piece of words each; nothing where they agree.

    Args:
        comparison: what would fly.
        file: ``results.json`` of a comparison; one that is not there or cannot be read says nothing.
    """
    try:
        stored = json.loads(file.read_bytes())
        return _differences(stored, comparison)
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return []


def replaced_suite(file: Path, said: Sequence[str], asked: Any) -> list[str]:
    """The same of a suite: each of the attributes ``said`` of what is asked for that its record says otherwise."""
    try:
        stored = json.loads(file.read_bytes())
        return [f"{name} {stored[name]}" for name in said if stored[name] != getattr(asked, name)]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return []


def require_same_plugins(flown: Iterable[Flights], cells: Path) -> None:
    """Refuse to go on in a folder whose cells were flown with another version of a plugin that is loaded.

    Raises:
        ValueError: names the cell and the plugin.
    """
    now = identities()
    if not now:
        return
    held = Cells(cells)
    for flights in flown:
        for name, before in held.plugins(flights).items():
            if now.get(name, before) != before:
                raise ValueError(
                    f"plugin {name!r} = {now[name]}: must be {before} as in {cells / flights.label}.cell; choose "
                    f"another --out"
                )


def _differences(stored: Mapping[str, Any], comparison: Comparison) -> list[str]:
    summaries = stored["summaries"]
    laws = {name for cases in summaries.values() for found in cases.values() for name in found}
    pieces = []
    if laws != set(comparison.entrants):
        pieces.append(f"laws {_few(laws)}")
    if set(summaries) != set(comparison.conditions):
        pieces.append(f"conditions {_few(summaries)}")
    pieces += [f"{name} {stored[name]}" for name in ("seed", "plant") if stored[name] != getattr(comparison, name)]
    for name, cases in summaries.items():
        flown = max(each["episodes"] for found in cases.values() for each in found.values())
        if name in comparison.conditions and flown != _most(comparison, comparison.conditions[name]):
            pieces.append(f"{name} of {flown} flights")
    return pieces


def _few(names: Any, limit: int = 4) -> str:
    listed = list(names)
    return ", ".join(sorted(listed)) if len(listed) <= limit else f"({len(listed)})"


def _most(comparison: Comparison, condition: Condition) -> int:
    """Flights of the law that flies most of them under a condition: those that fly one by one fly fewer."""
    most = 0
    for flights in chosen(
        comparison.entrants,
        {condition.name: condition},
        seed=comparison.seed,
        plant=comparison.plant,
        one_by_one=comparison.one_by_one,
    ):
        most = max(most, _episodes(flights))
        if most == condition.episodes:
            break
    return most


def _episodes(flights: Flights) -> int:
    return flights.episodes(flights.scenario())
