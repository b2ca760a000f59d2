"""Measure what joint torques in a log are worth: the table *Without torques* of docs/results_identification.md.

    python tests/studies/identify/measure_efforts.py

Identifies the paper's vehicle from two flights, each with and without the channel ``joint_efforts``: 25 s of the
shipped scenario ``hover_swing``, and a designed flight of 60 s.
"""

from __future__ import annotations

import dataclasses
import tempfile
import warnings
from collections.abc import Sequence
from pathlib import Path

import skyarm
from skyarm.flight_data.flight_data import FlightData
from skyarm.studies.identify.identified_numbers import Identified

VEHICLE = "hummingbird_arm2_rotors"
DESIGNED = Path(__file__).parents[2] / "data" / "designed_flight.toml"
FLIGHTS = {"hover_swing": ("hover_swing", 25.0), "designed": (str(DESIGNED), 60.0)}
"""Name of a flight -> scenario, and length in s."""

ROWS = ("base.com.x", "base.com.z", "links.link1.com.x", "links.link2.com.x", "rotors.time_constant_up")
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
    channels = {name: channel for name, channel in flight.channels.items() if name not in without}
    return skyarm.identify_flights([dataclasses.replace(flight, channels=channels)], skyarm.load_vehicle(VEHICLE))


def lines(name: str, found: Sequence[Identified]) -> list[str]:
    """Half-widths of the 95 % intervals, mm or ms, with and without the torques."""
    rows = [f"{name}: settled {', '.join(str(each.settled) for each in found)}"]
    for row in ROWS:
        halves = [1e3 * (each[row].high - each[row].low) / 2.0 for each in found]
        rows.append(f"{row:26} {' '.join(f'{half:8.4f}' for half in halves)}")
    return rows


def main() -> None:
    """Identify, and print the table."""
    for name, (scenario, seconds) in FLIGHTS.items():
        flight = log_of(scenario, seconds)
        print("\n".join(lines(name, [identified(flight), identified(flight, "joint_efforts")])), flush=True)


if __name__ == "__main__":
    main()
