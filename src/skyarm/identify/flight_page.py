"""Page of a measured flight: its channels, notes, clock, and the vehicle parameters
that it can identify.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from shlex import quote

from skyarm.cli.output import bar, give, tell
from skyarm.flight_data.clocks import clock_offset
from skyarm.flight_data.flight_data import (
    PAUSE,
    FlightData,
    format_name,
    load_flight,
    parts_of,
    split_path,
)
from skyarm.flight_data.quantities import QUANTITIES
from skyarm.identify.information import ExpectedNumber, expected_numbers
from skyarm.identify.isolate_fault import find_faults
from skyarm.identify.log_checks import REFUSED, LogFault, channel_gaps
from skyarm.identify.measured_motion import joints_in_order
from skyarm.records.files import printable
from skyarm.records.files.names import picture_file
from skyarm.records.text_tables import shown_number
from skyarm.vehicle import Vehicle
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.view.pages import Facts, Line, heading, table_of


def excited_numbers(
    flight: FlightData, start: Vehicle, faults: Sequence[LogFault]
) -> Sequence[ExpectedNumber]:
    """Accuracy that a flight allows for each parameter of a vehicle; empty if a fault
    makes the flight unusable.

    Raises:
        ValueError: one line: a flight that is too short or does not fit the vehicle.
    """
    if any(each.severity == REFUSED for each in faults):
        return ()
    return expected_numbers([flight], start)


def excitation_facts(
    start: Vehicle, faults: Sequence[LogFault], numbers: Sequence[ExpectedNumber]
) -> Facts:
    """Faults and excited parameters of a measured flight as plain data."""
    return {
        "start": start.name,
        "faults": [{**asdict(each), "words": each.words} for each in faults],
        "excitation": [
            {
                **asdict(each),
                "title": each.title,
                "excited": each.is_excited,
                "verdict": each.verdict,
            }
            for each in numbers
        ],
    }


def fault_line(fault: LogFault) -> str:
    """Fault of a measured flight as one line of text, without its file."""
    return printable(
        f"{fault.severity}: {fault.channel}: {fault.finding}; {fault.remedy}"
    )


def excitation_lines(numbers: Sequence[ExpectedNumber]) -> list[str]:
    """Text lines with the expected 95 % interval of each parameter."""
    titles = [f"{each.title}:" for each in numbers]
    widths = max(map(len, titles)), max(len(each.verdict) for each in numbers)
    rows = zip(titles, numbers, strict=True)
    return [
        f"{title:{widths[0]}} {each.verdict:{widths[1]}} {each.name}"
        for title, each in rows
    ]


SHOWN = 12
"""Number of unused columns that are listed."""


NEEDED = "nothing can be identified without it"

MISSING = {
    **dict.fromkeys(("gyro", "accelerometer", "rotor_commands"), NEEDED),
    "quaternion": "without it no drag, no check of the clocks, and wider intervals",
}
"""Quantity -> loss in identification if a log lacks it."""


def flight_facts(flight: FlightData) -> Facts:
    """Facts of a measured flight as plain data: format, duration, channels, notes and
    clock.
    """
    channels = []
    parts = parts_of(flight)
    listed = {
        name: words
        for name, words in flight.facts.items()
        if name.startswith("flight #")
    }
    # a format that tells its flights apart knows better than pauses do
    if not listed and len(parts) > 1:
        listed = {
            f"flight #{k + 1}": f"{begin:.4g} to {end:.4g} s"
            for k, (begin, end) in enumerate(parts)
        }
    logged = {
        "rotor_commands" if name == "rotor_speed_commands" else name for name in flight
    }
    for name in flight:
        channel, quantity = flight[name], QUANTITIES[name]
        gaps = channel_gaps(name, channel)
        channels.append(
            {
                "quantity": name,
                "source": channel.source,
                "columns": channel.values.shape[1],
                "unit": quantity.unit,
                "meaning": quantity.meaning,
                "rate_hz": channel.rate,
                "begin_s": float(channel.time[0]) if channel.time.size else None,
                "end_s": float(channel.time[-1]) if channel.time.size else None,
                "gaps": len(gaps),
                "longest_gap_s": max((long for _, long in gaps), default=0.0),
            }
        )
    return {
        "flight": flight.name,
        "file": flight.file,
        "format": format_name(flight.file),
        "duration_s": flight.duration,
        "flights": len(parts),
        "choices": listed,
        "channels": channels,
        "notes": list(flight.notes),
        "clock": _clock_words(flight),
        "missing": {
            name: words for name, words in MISSING.items() if name not in logged
        },
        "facts": dict(flight.facts),
        "unused": list(flight.unused),
    }


def _clock_words(flight: FlightData) -> str:
    """Text on the offset between the clocks of two channels, or on why that offset is
    unknown.
    """
    try:
        return clock_offset(flight).words
    except ValueError as error:
        return f"unknown: {error}"


def flight_sheet(facts: Facts) -> Iterator[Line]:
    """Yield the tables of a flight: channels, clock, notes."""
    rows = []
    for each in facts["channels"]:
        gaps = (
            f"{each['gaps']}, to {each['longest_gap_s']:.3g} s"
            if each["gaps"]
            else "none"
        )
        span = (
            ""
            if each["begin_s"] is None
            else f"{each['begin_s']:.4g} to {each['end_s']:.4g}"
        )
        name = each["quantity"] + (
            f" ({each['columns']})" if QUANTITIES[each["quantity"]].width == 0 else ""
        )
        rows.append(
            (
                name,
                each["unit"],
                each["source"],
                shown_number(each["rate_hz"], 4),
                span,
                gaps,
            )
        )
    title = f"{facts['flight']}: {facts['format']}, {facts['duration_s']:.4g} s"
    yield table_of(
        ("channel", "unit", "source", "rate, Hz", "time, s", "gaps"),
        rows,
        left=3,
        title=title,
    )
    lines = [f"clock: {facts['clock']}", *(f"note: {each}" for each in facts["notes"])]
    lines += [f"missing: {name}: {words}" for name, words in facts["missing"].items()]
    if facts["flights"] > 1:
        lines.append(
            f"flights: {facts['flights']}, with pauses of more than {PAUSE:g} s between"
            " them; all are read"
        )
    file = split_path(facts["file"])[0]
    for name, words in facts["choices"].items():
        lines.append(
            f"{name}: {words}: skyarm show {quote(file + name.removeprefix('flight '))}"
        )
    if facts["unused"]:
        more = (
            f" and {len(facts['unused']) - SHOWN} more"
            if len(facts["unused"]) > SHOWN
            else ""
        )
        lines.append(f"not read: {', '.join(facts['unused'][:SHOWN])}{more}")
    yield "\n".join(map(printable, lines))


AXES = {3: "xyz", 4: "wxyz"}
"""Number of columns of a channel of vectors or quaternions -> their names."""


def _columns(name: str, flight: FlightData) -> tuple[str, ...]:
    """Names of the columns of a channel: joints, axes, or numbers from 1 on."""
    count = flight[name].values.shape[1]
    return flight[name].names or tuple(
        AXES.get(QUANTITIES[name].width, map(str, range(1, count + 1)))
    )


def _draw(flight: FlightData, file: str) -> None:
    """Write a picture of the channels of a flight to a file."""
    from skyarm.view.figures.channels_figure import channels_figure
    from skyarm.view.figures.style import save_picture

    target = picture_file(file, "--out")
    every = {
        name: (
            QUANTITIES[name].unit,
            _columns(name, flight),
            flight[name].time,
            flight[name].values,
        )
        for name in flight
    }
    give(drawing=save_picture(channels_figure(every), target))
    tell(f"drawing: {target}")


def show_flight(
    name: str, columns: str | None, vehicle: str | None, drawing: str | None = None
) -> None:
    """Print the page of a measured flight, with its faults and excitation for a start
    vehicle; or draw its channels.

    Args:
        name: path of the flight.
        columns: path of the mapping of its columns.
        vehicle: file or name of the start vehicle.
        drawing: path of a picture of the channels, in place of the page.

    Raises:
        ValueError: one line, after the channels: of what is too short, or does not fit
            the vehicle, none is excited.
    """
    if drawing is not None:
        return _draw(load_flight(name, columns), drawing)
    start = None if vehicle is None else load_vehicle(vehicle)
    with bar(Path(name).name) as advance:
        advance(last="read")
        flight = load_flight(name, columns)
        facts = flight_facts(flight)
        if start is not None:
            advance(last="look for faults")
            flight = joints_in_order(flight, start)
            faults = find_faults(flight, start)
    give(facts)
    mapped = "" if columns is None else f" --columns {quote(columns)}"
    for part in flight_sheet(facts):
        tell(part, "")
    if start is None:
        if NEEDED not in facts["missing"].values():
            tell(f"next: skyarm show {quote(name)}{mapped} --vehicle VEHICLE")
        return None
    for fault in faults:
        tell(fault_line(fault), "")
    with bar(Path(name).name) as advance:
        advance(last="excitation")
        numbers = excited_numbers(flight, start, faults)
    give(excitation_facts(start, faults, numbers))
    if numbers:
        tell(heading(f"excitation of {start.name}: expected 95 % intervals"), "")
        tell("\n".join(excitation_lines(numbers)), "")
        tell(
            f"next: skyarm identify flights {quote(name)}{mapped} --vehicle"
            f" {quote(vehicle or '')} --known mass=KG"
        )
    else:
        tell("excitation: is shown of a flight without refused faults", "")
