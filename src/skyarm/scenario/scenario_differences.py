"""Differences of two scenarios, by parameter path."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from skyarm.log.log_differences import more_lines
from skyarm.records.files import shown
from skyarm.records.path_names import AGENTS, OF_AGENT, word_of
from skyarm.records.plain import Plain
from skyarm.records.words import EACH, slots
from skyarm.scenario.paths import matches
from skyarm.scenario.scenario_record import Scenario

ABSENT = "(none)"
"""Text in place of a value that only one of two scenarios has."""

FOR_PEOPLE = ("title", "sources", "notes", "type")
"""Names of a path that describe no part of a flight."""

FieldPath = tuple[str, ...]
"""Names of fields from the scenario inwards."""


def scenario_differences(a: object, b: object) -> dict[str, tuple[Plain, Plain]]:
    """Values that differ between two scenarios, as a dict from parameter path to pair
    of values.

    Args:
        a: plain data of a scenario (``log.info["scenario_record"]``); anything else
            counts as empty.
        b: plain data of the other scenario.
    """
    ours, theirs = (
        dict(_leaves(dict(each), ())) if isinstance(each, Mapping) else {}
        for each in (a, b)
    )
    differences = {}
    for names in {**ours, **theirs}:
        pair = ours.get(names, ABSENT), theirs.get(names, ABSENT)
        # to Python True and 1.0 are 1, to a program they are not
        if type(pair[0]) is not type(pair[1]) or pair[0] != pair[1]:
            differences[_path(names)] = pair
    return differences


def _leaves(data: Plain, names: FieldPath) -> Iterator[tuple[FieldPath, Plain]]:
    """Field path and value of each leaf of a scenario's plain data.

    Leaves are numbers, texts, flags, nulls, empty tables and lists; what is written for
    people alone is left out.
    """
    inner: Iterable[tuple[object, Plain]] = ()
    if isinstance(data, Mapping):
        inner = data.items()
    elif isinstance(data, list):
        inner = enumerate(data)
    if not inner:
        yield names, data
    for name, each in inner:
        # a class is told where it is a law, a plant or another kind of wind; elsewhere
        # it follows from the field
        if name not in FOR_PEOPLE or (
            name == "type" and isinstance(each, str) and _has_choice(names)
        ):
            yield from _leaves(each, (*names, str(name)))


def _has_choice(names: FieldPath) -> bool:
    """True for a field path, such as environment.wind, where values of several classes
    are allowed.
    """
    names = ("agent", *names[2:]) if names[:1] == (AGENTS,) else names
    return any(
        slot.word.kind
        and matches(names, (*slot.place, EACH) if slot.is_list else slot.place)
        for slot in slots(Scenario)
    )


def _path(names: FieldPath) -> str:
    """Parameter path of a value in a scenario's plain data; the field names joined by
    dots if no path exists.
    """
    if names[0] == AGENTS and len(names) > 2:
        own = _path(("agent", *names[2:])).removeprefix("agent.")
        return f"{OF_AGENT}{names[1]}.{own}"
    # longest place first, because a shorter one may contain it
    for slot in sorted(slots(Scenario), key=lambda slot: -len(slot.place)):
        head, tail = names[: len(slot.place)], names[len(slot.place) :]
        if matches(head, slot.place):
            number = next(
                (a for a, b in zip(head, slot.place, strict=True) if b == EACH), ""
            )
            return ".".join((slot.path.replace(EACH, number), *tail))
    return ".".join(names)


MOST_FIELDS = 20
"""Number of fields that a terminal shows; ``--json`` has all."""


def changed_field_lines(
    differences: Mapping[str, tuple[Plain, Plain]], laws: list[str]
) -> list[str]:
    """Text of the scenario fields in which two logs differ."""
    lines = ["the scenarios differ in"] if differences else []
    if any(word_of(path).startswith("controller.law.") for path in differences):
        lines.append("  controller: " + " and ".join(map(shown, laws)))
        differences = {
            path: pair
            for path, pair in differences.items()
            if not word_of(path).startswith("controller.")
        }
    lines += [
        f"  {path}: {shown(ours)} and {shown(theirs)}"
        for path, (ours, theirs) in differences.items()
    ][:MOST_FIELDS]
    return lines + more_lines(len(differences) - MOST_FIELDS, "fields")
