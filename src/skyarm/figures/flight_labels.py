"""What flights are called in a legend: by their files, laws, scenarios ..., whichever tells them apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from skyarm.log.flight_log import Log

LONGEST = 40
"""Characters of a label."""


def flights_by_label(flights: Log | Sequence[Log] | Mapping[str, Log]) -> dict[str, Log]:
    """Words of the legend -> log, in the order given."""
    if isinstance(flights, Log):
        flights = [flights]
    if isinstance(flights, Mapping):
        return {shortened(str(label)): log for label, log in flights.items()}
    return dict(zip(flight_labels(flights), flights, strict=True))


def flight_labels(logs: Sequence[Log], files: Sequence[str] = ()) -> list[str]:
    """A label for each flight, each another one.

    Args:
        logs: of the flights.
        files: their paths, where they come from files.

    Returns:
        names of the files, or of the laws, or law and scenario, law and plant, law and seed, whichever tells all
        flights apart; at last numbers.
    """
    laws = [str(log.info.get("controller", "")) for log in logs]
    names = [Path(file).stem for file in files]
    choices = [names, laws]
    choices += [
        [f"{law}, {log.info.get(field, '')}" for law, log in zip(laws, logs, strict=True)]
        for field in ("scenario", "plant", "seed")
    ]
    choices.append([str(file) for file in files])
    for labels in choices:
        short = [shortened(label) for label in labels]
        if len(short) == len(logs) == len(set(short)):
            return short
    return [shortened(f"{i + 1}: {law}") for i, law in enumerate(laws)]


def shortened(text: str) -> str:
    """A label that is no longer than a legend bears, cut in its middle."""
    if len(text) <= LONGEST:
        return text
    half = (LONGEST - 1) // 2
    return f"{text[:half]}\N{HORIZONTAL ELLIPSIS}{text[-half:]}"


def ending_of(log: Log) -> str:
    """What a label says about a flight that ended before its time."""
    return "" if log.status == "completed" else f" ({log.status.replace('_', ' ')})"
