"""All records that ship are what they were, to the digit, and so are scenarios whose
numbers and parts are replaced.

Where this is meant to change: ``pinned_records.py --write`` in this folder.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Iterable
from typing import Any

import pinned_records
import pytest
from shipped_files import scenario

import skyarm

HELD: dict[str, Any] = json.loads(pinned_records.FILE.read_text("utf-8"))
RECORDS = pinned_records.records()
LATE = {
    "scenario examples/pick_and_place",
    *[name for name in RECORDS if name.startswith("law ")][1::3],
    *[name for name in RECORDS if name.startswith("law ")][2::3],
    *[
        name
        for name in RECORDS
        if name.startswith("paper ") and name.endswith("mujoco")
    ],
}
"""Records that only the thorough run reads."""

DIGESTS = ("identity", "data", "data of nine digits")


def differences(
    names: Iterable[str], digests: Callable[[Any], list[str]], several: slice
) -> list[str]:
    """Names of records, with what differs from the digests."""
    found = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name in names:
            pairs = zip(
                DIGESTS[several],
                digests(RECORDS[name]()),
                HELD["records"][name][several],
                strict=True,
            )
            what = [digest for digest, now, before in pairs if now != before]
            found += [f"{name}: {', '.join(what)}"] if what else []
    return found


def rounded(record: Any) -> list[str]:
    return [pinned_records.rounded_digest(record)]


def require_same(names: Iterable[str]) -> None:
    """Compare exactly where numbers round as where the digests were taken, else to nine
    digits.
    """
    exactly = pinned_records.machinery() == HELD["machinery"]
    found = (
        differences(names, pinned_records.digests, slice(2))
        if exactly
        else differences(names, rounded, slice(2, 3))
    )
    assert found == []


def test_records_are_what_they_were() -> None:
    require_same(RECORDS.keys() - LATE)


@pytest.mark.thorough
def test_long_planned_records_and_more_laws_are_what_they_were() -> None:
    require_same(LATE)


@pytest.mark.thorough
def test_records_are_what_they_were_to_nine_digits() -> None:
    assert differences(RECORDS, rounded, slice(2, 3)) == []


def test_every_record_has_its_digest() -> None:
    assert set(HELD["records"]) == set(RECORDS)


def test_a_digest_sees_the_last_digit_and_the_rounded_one_does_not() -> None:
    mass = 0.716
    first, other, third = (
        skyarm.with_numbers(scenario("case1"), {"plant.vehicle.base.mass": each})
        for each in (mass, mass * (1.0 + 4e-16), 0.717)
    )
    for a, b in zip(
        pinned_records.digests(first), pinned_records.digests(other), strict=True
    ):
        assert a != b
    assert rounded(first) == rounded(other) != rounded(third)
