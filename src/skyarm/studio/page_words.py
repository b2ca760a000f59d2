"""What the page refuses before it opens, and how it shows words that are not its own."""

from __future__ import annotations

import re
from collections.abc import Sequence

from skyarm.files import must_be_one_of, shown
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.studio.controls import law_names
from skyarm.studio.fleet import MOST, load_fleet


def require_laws(source: str, laws: Sequence[str]) -> None:
    """Refuse a scenario or laws that cannot be flown, before a page is opened.

    Raises:
        ScenarioError: one line.
    """
    if len(laws) > MOST:
        raise ScenarioError(f"--controller = {shown(list(laws))}: must be at most {MOST} laws at once")
    prepared = load_fleet(source).prepared
    for law in laws:
        if law not in law_names():
            raise ScenarioError(f"--controller = {shown(law)}: {must_be_one_of(law_names(), law, 'skyarm list')}")
        prepared.under(law)


def literal(text: str) -> str:
    """Text from files and messages as a page's markdown shows it as it is: nothing in it is a link or code."""
    return re.sub(r"([\\`*\[\]<>{}!#|~$&])", r"\\\1", text)
