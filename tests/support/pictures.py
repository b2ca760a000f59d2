"""Flights that the tests of films share, and what they need of this machine."""

from __future__ import annotations

import functools

import pytest

import skyarm
from skyarm.log.flight_log import Log
from skyarm.view.picture.offscreen import NoDisplayError, offscreen

SECONDS = 1.0


@functools.lru_cache(maxsize=8)
def flight(law: str = "paper_pd", scenario: str = "case3_wind") -> Log:
    """One second of a flight."""
    return skyarm.run(skyarm.load_scenario(scenario, controller=law, duration=SECONDS))


@functools.lru_cache(maxsize=1)
def why_no_pictures() -> str:
    """Why nothing can be drawn on this machine; empty where it can."""
    try:
        with offscreen():
            return ""
    except NoDisplayError as error:
        return str(error)


needs_display = pytest.mark.skipif(
    bool(why_no_pictures()), reason=why_no_pictures() or "EGL draws here"
)
