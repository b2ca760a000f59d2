"""Page of a measured flight: its channels, notes and clock, and what it shows of a vehicle."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from rich.console import RenderableType

from skyarm.cli.output import Facts, bar, give, heading, is_document_wanted, plain, shown_number, table_of, tell
from skyarm.flight_data.clocks import clock_offset
from skyarm.flight_data.flight_data import FlightData, format_name, load_flight
from skyarm.flight_data.motion import joints_in_order
from skyarm.flight_data.quantities import QUANTITIES
from skyarm.records.files import printable
from skyarm.studies.identify.channel_scales import REFUSED
from skyarm.studies.identify.data_faults import Fault, channel_gaps, find_faults
from skyarm.studies.identify.information import ExpectedNumber, expected_numbers
from skyarm.studies.identify.stretches import stretches_of
from skyarm.vehicle.vehicle_files import load_vehicle


def show_flight(name: str, columns: str | None, vehicle: str | None) -> None:
    """Print the page of a flight, with its faults and excitation for a start vehicle.

    Args:
        name: path of the flight.
        columns: path of the mapping of its columns.
        vehicle: file or name of the start vehicle.

    Raises:
        ValueError: one line, after the channels: of what is too short, or does not fit the vehicle, none is excited.
    """
    start = None if vehicle is None else load_vehicle(vehicle)
    with bar(Path(name).name) as advance:
        advance(last="read")
        flight = load_flight(name, columns)
        facts = flight_facts(flight)
        faults: tuple[Fault, ...] = ()
        numbers: tuple[ExpectedNumber, ...] = ()
        none: ValueError | None = None
        if start is not None:
            advance(last="look for faults")
            flight = joints_in_order(flight, start)
            faults = find_faults(flight, start)
            if not any(each.severity == REFUSED for each in faults):
                advance(last="excitation")
                try:
                    numbers = expected_numbers(stretches_of(flight, start), start)
                except ValueError as error:
                    none = error
    if none is not None:
        if not is_document_wanted():
            for part in (*_sheet(facts), *map(_fault_line, faults)):
                tell(part, "")
        raise none
    give(facts)
    if start is not None:
        give(
            start=start.name,
            faults=[{**plain(each), "words": each.words} for each in faults],
            excitation=[
                {**plain(each), "title": each.title, "excited": each.is_excited, "verdict": each.verdict}
                for each in numbers
            ],
        )
    if is_document_wanted():
        return
    for part in (*_sheet(facts), *([] if start is None else _of_vehicle(start.name, faults, numbers))):
        tell(part, "")


def flight_facts(flight: FlightData) -> Facts:
    """Facts of a measured flight as plain data: format, duration, channels, notes and clock."""
    channels = []
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
        "channels": channels,
        "notes": list(flight.notes),
        "clock": _clock_words(flight),
        "facts": plain(flight.facts),
        "unused": list(flight.unused),
    }


def _clock_words(flight: FlightData) -> str:
    """Offset of the clocks of two channels in words, or why it is unknown."""
    try:
        return clock_offset(flight).words
    except ValueError as error:
        return f"unknown: {error}"


def _sheet(facts: Facts) -> Iterator[RenderableType]:
    """Yield the tables of a flight: channels, clock, notes."""
    rows = []
    for each in facts["channels"]:
        gaps = f"{each['gaps']}, to {each['longest_gap_s']:.3g} s" if each["gaps"] else "none"
        span = "" if each["begin_s"] is None else f"{each['begin_s']:.4g} to {each['end_s']:.4g}"
        name = each["quantity"] + (f" ({each['columns']})" if QUANTITIES[each["quantity"]].width == 0 else "")
        rows.append((name, each["unit"], each["source"], shown_number(each["rate_hz"], 4), span, gaps))
    title = f"{facts['flight']}: {facts['format']}, {facts['duration_s']:.4g} s"
    yield table_of(("channel", "unit", "source", "rate, Hz", "time, s", "gaps"), rows, left=3, title=title)
    lines = [f"clock: {facts['clock']}", *(f"note: {each}" for each in facts["notes"])]
    if facts["unused"]:
        more = f" and {len(facts['unused']) - SHOWN} more" if len(facts["unused"]) > SHOWN else ""
        lines.append(f"not read: {', '.join(facts['unused'][:SHOWN])}{more}")
    yield "\n".join(printable(each) for each in lines)


SHOWN = 12
"""Unused columns that are listed."""


def _fault_line(fault: Fault) -> str:
    return printable(f"{fault.severity}: {fault.channel}: {fault.finding}; {fault.remedy}")


def _of_vehicle(vehicle: str, faults: Sequence[Fault], numbers: Sequence[ExpectedNumber]) -> Iterator[RenderableType]:
    """Yield the faults of a flight and the table of what it excites."""
    yield from map(_fault_line, faults)
    if not numbers:
        yield "excitation: is shown of a flight without refused faults"
        return
    yield heading(f"excitation of {vehicle}: expected 95 % intervals")
    titles = [f"{each.title}:" for each in numbers]
    widths = max(map(len, titles)), max(len(each.verdict) for each in numbers)
    rows = zip(titles, numbers, strict=True)
    yield "\n".join(f"{title:{widths[0]}} {each.verdict:{widths[1]}} {each.name}" for title, each in rows)
