"""Vehicle file of an identification: the whole vehicle, with comments on values,
intervals and flights.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from skyarm.identify.identified_numbers import GIVEN, Identified, IdentifiedNumber
from skyarm.identify.identified_parts import IdentifiedSurroundings, surroundings_with
from skyarm.identify.unknowns import DRAG_HEIGHT, THRUST
from skyarm.records.files import number, one_line, shown
from skyarm.vehicle import Vehicle
from skyarm.vehicle.vehicle_text import vehicle_text

AXES = ("x", "y", "z", "xx", "yy", "zz", "xy", "xz", "yz")
"""Suffixes of parameters that are components of one field."""

CURVE = "rotors.thrust_table"
"""Name of a parameter field: the thrust curve."""

VOLTAGE = "voltage"
"""Known number that is not estimated: voltage (V) at which the start vehicle's thrust
holds."""

POSITION = "rotors.position"
"""Field with the height at which hub drag acts."""

IDENTIFIED_BY = "Identified by skyarm"
"""Prefix of the first comment of an identified vehicle file."""

SUFFIX = "_identified"
"""Suffix of an identified vehicle's name."""


def identified_file(
    found: Identified,
    start: Vehicle,
    flights: Sequence[str],
    known: Mapping[str, float],
) -> str:
    """TOML text of the identified vehicle.

    Args:
        found: vehicle and numbers.
        start: vehicle before, whose sources are kept for what is not identified.
        flights: names of the files that the numbers come from.
        known: numbers that were given, by name.
    """
    comments, sources = dict[str, str](), dict(start.sources)
    at = f"identified from {', '.join(flights)} ({found.seconds:.3g} s)"
    for field, numbers in _by_field(found).items():
        comments[field] = "\n".join(map(_words, numbers))
        if any(each.is_known for each in numbers):
            shared = field.startswith("rotors.") and field != POSITION
            sources[
                field.replace("rotors.", "rotor_defaults.", 1) if shared else field
            ] = at
    # the base has what the links leave of the total mass, which no row of the table
    # says
    if float(found.vehicle.base.mass) != float(start.base.mass):
        comments["base.mass"] = "what the links leave of the total mass, which is given"
    for name in known:
        field = _field(name)
        comments[field] = "\n".join(
            [
                *comments.get(field, "").splitlines(),
                f"given: {name} = {known[name]:.6g}",
            ]
        )
    whole = dataclasses.replace(
        found.vehicle, name=identified_name(start.name), sources=tuple(sources.items())
    )
    return vehicle_text(whole, _head(found, start, flights), comments)


def identified_name(start: str) -> str:
    """Name of an identified vehicle, derived from the name of the start vehicle."""
    return start if start.endswith(SUFFIX) else f"{start}{SUFFIX}"


def _head(identified: Identified, start: Vehicle, flights: Sequence[str]) -> list[str]:
    """Comment lines at the beginning of an identified vehicle's file."""
    about = identified.surroundings
    lines = [
        (
            f"{IDENTIFIED_BY} from {len(flights)}"
            f" flight{'s' if len(flights) > 1 else ''}, {identified.seconds:.3g} s:"
        ),
        *(f"  {each}" for each in flights),
        (
            f"Start vehicle: {start.name}. Behind each number its 95 % interval; what"
            " the flights do not show is the"
        ),
        "start's.",
        GIVEN,
    ]
    if not identified.settled:
        lines.append(
            "THE SEARCH DID NOT SETTLE: do not rely on these numbers; intervals hold"
            " its last moves alone."
        )
    around = {
        each.name: each
        for each in identified.numbers
        if is_around(each.name) and each.is_known
    }
    if around:
        lines.append("Not part of a vehicle, but of its computer, sensors and battery:")
        lines += [f"  {name} = {_value(each)}" for name, each in around.items()]
    if "delay" in around:
        lines.append(f"In a scenario: [delays] command = {max(about.delay, 0.0):.4g}")
    return lines


def read_surroundings(
    file: Path, flight: str = ""
) -> tuple[str, IdentifiedSurroundings, float]:
    """Read the identified delays and offsets from a results file, with the vehicle's
    name and the rotors' voltage (V).

    Args:
        file: file of all numbers.
        flight: name of one that was identified, whose thrust over that of the first one
            is in the surroundings, too.

    Returns:
        Name of the identified vehicle, surroundings, and V; 0 V for an identification
        without the battery's voltage.

    Raises:
        ValueError: one line: the file holds no such numbers.
    """
    try:
        document = json.loads(file.read_bytes())
    except (OSError, ValueError, RecursionError) as error:
        raise ValueError(one_line(f"{file}: must be a JSON file ({error})")) from None
    table, given = (
        document.get(name) if isinstance(document, dict) else None
        for name in ("surroundings", "known")
    )
    if not (isinstance(table, dict) and isinstance(given, dict)):
        raise ValueError(
            f"{file}: must hold 'surroundings' and 'known', as 'skyarm identify' writes"
            " them"
        )
    numbers = document.get("numbers", [])
    if not (
        isinstance(numbers, list) and all(isinstance(row, dict) for row in numbers)
    ):
        raise ValueError(f"{file}: must hold 'numbers', a list of tables")
    values = dict[str, float]()
    for each in dataclasses.fields(IdentifiedSurroundings):
        # a file that an earlier version wrote lacks newer fields
        value = table.get(each.name, each.default)
        name = f"{file}: surroundings.{each.name}"
        if not isinstance(each.default, tuple):
            values[each.name] = number(value, name)
        elif isinstance(value, (list, tuple)) and len(value) == len(each.default):
            values |= {
                f"{each.name}.{axis}": number(entry, name)
                for axis, entry in zip("xyz", value, strict=True)
            }
        else:
            raise ValueError(
                f"{name} = {shown(value)}: must be {len(each.default)} numbers"
            )
    own = [each for each in numbers if each.get("name") == f"{THRUST}{flight}"]
    if own and own[0].get("value") is not None:
        values["thrust"] = number(
            own[0]["value"], f"{file}: {THRUST}{flight}", low=0.0, strict=True
        )
    named = identified_name(str(document.get("start", "")))
    return (
        named,
        surroundings_with(values),
        number(given.get(VOLTAGE, 0.0), f"{file}: known.{VOLTAGE}", low=0.0),
    )


def is_around(name: str) -> bool:
    """True for a parameter of computer, sensors, battery or air, which is not part of a
    vehicle.
    """
    return name.partition(".")[0] in {
        each.name for each in dataclasses.fields(IdentifiedSurroundings)
    }


def _by_field(identified: Identified) -> dict[str, list[IdentifiedNumber]]:
    """Identified vehicle parameters by the field of the vehicle file that holds
    them.
    """
    fields: dict[str, list[IdentifiedNumber]] = {}
    for each in identified.numbers:
        if not is_around(each.name):
            fields.setdefault(_field(each.name), []).append(each)
    return fields


def _field(name: str) -> str:
    """Field of a vehicle file that holds a parameter of a given name."""
    if name.startswith(("rotors.thrust_at_", "rotors.rise_to_")):
        return CURVE
    if name == DRAG_HEIGHT:
        return POSITION
    if name.startswith("base.second_moment."):
        return "base.inertia"
    head, _, last = name.rpartition(".")
    return head if last in AXES else name


def _words(number: IdentifiedNumber) -> str:
    """Comment text on one identified parameter: its interval, or why it is unknown."""
    last = number.name.rpartition(".")[2]
    entry = (
        f"{last}: "
        if last in AXES or number.name.startswith("rotors.thrust_at_")
        else ""
    )
    entry = "z, of the hub drag: " if number.name == DRAG_HEIGHT else entry
    return f"{entry}{_value(number) if number.is_known else number.reason}"


def _value(number: IdentifiedNumber) -> str:
    unit = f" {number.unit}" if number.unit else ""
    return (
        f"{number.value:.4g} ({number.low:.4g} to {number.high:.4g}){unit}, start"
        f" {number.start:.4g}"
    )
