"""Sheet of a measured flight: its channels, rates, gaps, clock and notes."""

from __future__ import annotations

from collections.abc import Iterator

from skyarm.flight_data.clocks import clock_offset
from skyarm.flight_data.flight_data import FlightData, format_name
from skyarm.flight_data.quantities import QUANTITIES
from skyarm.records.files import printable
from skyarm.records.text_tables import shown_number
from skyarm.studies.identify.log_checks import channel_gaps
from skyarm.view.pages import Facts, Line, table_of

SHOWN = 12
"""Number of unused columns that are listed."""


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
        "facts": dict(flight.facts),
        "unused": list(flight.unused),
    }


def _clock_words(flight: FlightData) -> str:
    """Text on the offset between the clocks of two channels, or on why that offset is unknown."""
    try:
        return clock_offset(flight).words
    except ValueError as error:
        return f"unknown: {error}"


def flight_sheet(facts: Facts) -> Iterator[Line]:
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
