"""The delay that a scenario's loop bears in hover, against the one that is believed."""

from __future__ import annotations

import math

from skyarm.assess.finding import NOTE, OK, WARNING, Finding
from skyarm.scenario.scenario_record import Scenario
from skyarm.stability.hover_delay import hover_delay_if_known

QUESTION = "delay margin"


def delay_margin(scenario: Scenario) -> list[Finding]:
    """Dead time that the loop bears in hover beyond its own, beside the delay that is believed."""
    found = hover_delay_if_known(scenario)
    if isinstance(found, str):
        return [Finding(question=QUESTION, level=NOTE, text=f"not known: {found}")]
    text = found.sentence(scenario.controller.name)
    if not found.margin > 0.0:
        return [
            Finding(
                question=QUESTION,
                level=WARNING,
                text=text,
                field="controller",
                value=0.0,
                limit=0.0,
                unit="s",
                remedy="softer gains or another law: skyarm margins shows which loop is short of margin",
            )
        ]
    level = OK if found.enough else WARNING
    return [
        Finding(
            question=QUESTION,
            level=level,
            text=text,
            field="" if level == OK else "controller",
            value=found.margin if math.isfinite(found.margin) else math.nan,
            limit=found.needed,
            unit="s",
            remedy=""
            if level == OK
            else f"{found.shortfall}{found.before}: softer gains, faster motors or a shorter delay; "
            "skyarm margins shows which loop is short of it",
        )
    ]
