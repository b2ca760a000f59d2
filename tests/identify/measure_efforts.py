"""Measure what joint torques in a log are worth: the table *Without torques* of
docs/data/results_identification.md.

    python tests/identify/measure_efforts.py [--small]

Identifies the paper's vehicle from two flights, each with and without the channel
``joint_efforts``: 25 s of the shipped scenario ``hover_swing``, and a designed flight
of 60 s, of which the table shows half-widths of the intervals. Whether the searches
settled is told on the standard error.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import tempfile
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path

# the tests' own modules, when this is run as a program
sys.path.append(str(Path(__file__).parents[1]))

import skyarm
from skyarm.flight_data.flight_data import FlightData
from skyarm.identify.identified_numbers import Identified
from support.measured_tables import print_table, progress

VEHICLE = "hummingbird_arm2_rotors"
DESIGNED = Path(__file__).parents[1] / "data" / "designed_flight.toml"
FLIGHTS = {"hover_swing": ("hover_swing", 25.0), "designed": (str(DESIGNED), 60.0)}
"""Name of a flight -> scenario, and length in s."""

ROWS = (
    "base.com.x",
    "base.com.z",
    "links.link1.com.x",
    "links.link2.com.x",
    "rotors.time_constant_up",
)
"""Numbers of the table, all lengths and times."""


def log_of(scenario: str, seconds: float) -> FlightData:
    """Log of a simulated flight."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # sensors that only the log reads
        log = skyarm.run(skyarm.load_scenario(scenario, duration=seconds))
        skyarm.save_log(log, f"{folder}/flight.npz")
        return skyarm.load_flight(f"{folder}/flight.npz")


def identified(flight: FlightData, *without: str) -> Identified:
    """Result for a log without some of its channels."""
    channels = {
        name: channel
        for name, channel in flight.channels.items()
        if name not in without
    }
    return skyarm.identify_flights(
        [dataclasses.replace(flight, channels=channels)], skyarm.load_vehicle(VEHICLE)
    )


def ratio(value: float) -> str:
    """Two digits before the point, or one behind it."""
    return f"{value:.0f}" if value >= 9.95 else f"{value:.1f}"


def rows(found: Sequence[Identified]) -> Iterator[list[str]]:
    """Half-widths of the 95 % intervals, mm or ms, with and without the torques, and
    their ratio.
    """
    for row in ROWS:
        with_torques, without = (
            1e3 * (each[row].high - each[row].low) / 2.0 for each in found
        )
        unit = "ms" if "time" in row else "mm"
        yield [
            f"`{row}`",
            unit,
            f"{with_torques:.3f}",
            f"{without:.3f}",
            ratio(without / with_torques),
        ]


def main() -> None:
    """Identify, and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--small", action="store_true", help="a designed flight of 10 s alone"
    )
    small = parser.parse_args().small
    for name, (scenario, seconds) in FLIGHTS.items():
        if small and name != "designed":
            continue
        flight = log_of(scenario, 10.0 if small else seconds)
        found = [identified(flight), identified(flight, "joint_efforts")]
        progress(
            f"{name}: settled with torques {found[0].settled}, without"
            f" {found[1].settled}"
        )
    print_table(
        ("value", "unit", ">half-width with torques", ">without torques", ">ratio"),
        rows(found),
    )


if __name__ == "__main__":
    main()
