"""What the page refuses before it opens, and how it shows words that are not its own."""

from __future__ import annotations

import re
from collections.abc import Sequence

from skyarm.files import must_be_one_of, shown
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.studio.controls import law_names
from skyarm.studio.fleet import MOST, Fleet, load_fleet


def fleet_under(source: str, laws: Sequence[str]) -> Fleet:
    """The fleet of a scenario, refused before a page is opened where it or one of the laws cannot be flown.

    Raises:
        ScenarioError: one line.
    """
    if len(laws) > MOST:
        raise ScenarioError(f"--controller = {shown(list(laws))}: must be at most {MOST} laws at once")
    fleet = load_fleet(source)
    for law in laws:
        if law not in law_names():
            raise ScenarioError(f"--controller = {shown(law)}: {must_be_one_of(law_names(), law)}")
        fleet.prepared.under(law)
    return fleet


def literal(text: str) -> str:
    """Text from files and messages as a page's markdown shows it as it is: nothing in it is a link or code."""
    return re.sub(r"([\\`*\[\]<>{}!#|~$&])", r"\\\1", text)
