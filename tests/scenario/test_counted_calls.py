"""Reading a scenario and replacing a number of it take no more function calls than they
did.

The counts of ``2806b03d`` are those of the library before the words of a file were
declared once.
"""

from __future__ import annotations

import json
from typing import Any

import counted_calls
from shipped_files import only_shipped

from skyarm.records import leaves

HELD: dict[str, Any] = json.loads(counted_calls.FILE.read_text("utf-8"))
LOWER = 0.95
"""Share of a pinned count below which the pin must be lowered."""
OTHERWISE = 1.05
"""Share of it that may be reached on another version of Python."""


def faults(found: dict[str, dict[str, int]], version: str) -> list[str]:
    """Counts above their pins, and those so far below that the pins must follow."""
    same = version == HELD["python"]
    lines = []
    for name, counts in found.items():
        for what, count in counts.items():
            pin = HELD["now"][name][what]
            if count > pin * (1.0 if same else OTHERWISE):
                lines.append(f"{name}: {count} {what}, must be at most {pin}")
            elif same and count < pin * LOWER:
                lines.append(
                    f"{name}: {count} {what}, well below {pin}: lower the pin"
                    " (counted_calls.py --write)"
                )
    return lines


def test_a_load_and_replaced_numbers_take_no_more_calls_than_they_did() -> None:
    with only_shipped():
        found = counted_calls.counts()
    assert found.keys() == HELD["now"].keys() >= HELD["2806b03d"].keys()
    assert faults(found, counted_calls.version()) == []


ASKED = {
    "load case3": 0.65,
    "plant.gravity": 0.10,
    "environment.wind.velocity.0": 0.10,
    "controller.gains.position.x": 0.20,
    "reference.base.radius": 0.20,
    "initial.position.x": 0.13,
}
"""Largest share of the calls of ``2806b03d``; a mass of the vehicle makes the vehicle
anew, as it did."""


def test_pinned_counts_are_below_the_shares_of_the_earlier_ones_that_were_asked() -> (
    None
):
    shares = {
        name: HELD["now"][name]["calls"] / HELD["2806b03d"][name]["calls"]
        for name in ASKED
    }
    assert {name: share for name, share in shares.items() if share > ASKED[name]} == {}


def test_counts_above_and_far_below_their_pins_are_named() -> None:
    def scaled(share: float) -> dict[str, dict[str, int]]:
        return {"seed": {"calls": round(share * HELD["now"]["seed"]["calls"])}}

    assert faults(HELD["now"], HELD["python"]) == []
    assert "must be at most" in faults(scaled(1.03), HELD["python"])[0]
    assert "lower the pin" in faults(scaled(0.9), HELD["python"])[0]
    assert faults(scaled(1.03), "another") == faults(scaled(0.9), "another") == []


def test_calls_of_the_package_are_counted_and_no_others() -> None:
    assert counted_calls.count(lambda: [leaves.is_leaf(each) for each in (1.0, 2)]) == {
        "calls": 2,
        "files": 1,
    }
    assert counted_calls.count(lambda: json.dumps([1.0])) == {"calls": 0, "files": 0}
