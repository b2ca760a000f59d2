"""Nothing is said against sound logs; damaged ones are named by channel and kind, or
give the right numbers.
"""

from __future__ import annotations

import pytest
from judged_flights import DAMAGED, NAMED, REPAIRED, SOUND, accusations, verdict

pytest.importorskip("scipy", reason="needs the extra 'identify'")

pytestmark = pytest.mark.thorough

ACCUSED: dict[str, str] = {}
"""Sound logs that are accused today, and of what."""

MISSED: dict[str, str] = {}
"""Damaged logs that are not told today, and what is said instead."""


def expected(names, failures):
    """Cases, those of which fail today marked."""
    return [
        (
            pytest.param(
                name, marks=pytest.mark.xfail(strict=True, reason=failures[name])
            )
            if name in failures
            else name
        )
        for name in names
    ]


@pytest.mark.parametrize("name", expected(SOUND, ACCUSED))
def test_nothing_is_said_against_a_sound_log(name):
    assert accusations(name) == []


@pytest.mark.parametrize("name", expected(DAMAGED, MISSED))
def test_a_damaged_log_is_named_or_gives_the_right_numbers(name):
    found, words = verdict(name)
    assert found in {NAMED, REPAIRED}, f"{found}: {words}"
