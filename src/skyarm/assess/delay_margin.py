"""The delay that a scenario's loop bears in hover, against the one that is believed."""

from __future__ import annotations

import math

from skyarm.actuation import AllocationError
from skyarm.assess.finding import NOTE, OK, WARNING, Finding
from skyarm.compile.machine_code import NoMachineCodeError
from skyarm.control.controller import ControllerError
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.stability.hover_delay import ENOUGH, HoverDelay, hover_delay

QUESTION = "delay margin"


def delay_margin(scenario: Scenario) -> list[Finding]:
    """Dead time that the loop bears in hover beyond its own, beside the delay that is believed."""
    try:
        found = hover_delay(scenario)
    except (ScenarioError, ControllerError, AllocationError, NoMachineCodeError) as error:
        return [Finding(question=QUESTION, level=NOTE, text=f"not known: {error}")]
    law = scenario.controller.name
    if not found.margin > 0.0:
        return [
            Finding(
                question=QUESTION,
                level=WARNING,
                text=f"the loop of {law} is unstable in hover as it is",
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
            text=_sentence(law, found),
            field="" if level == OK else "controller",
            value=found.margin if math.isfinite(found.margin) else math.nan,
            limit=ENOUGH * found.believed,
            unit="s",
            remedy=""
            if level == OK
            else f"below {ENOUGH:g} times the believed delay: softer gains, faster motors or a shorter delay; "
            "skyarm margins shows which loop is short of it",
        )
    ]


def _sentence(law: str, found: HoverDelay) -> str:
    """What is borne, from when on it swings, what is believed."""
    if math.isinf(found.margin):
        borne = "more than 100 ms"
    else:
        swings = "" if math.isinf(found.swings) else f" (flights swing from {1e3 * found.swings:.3g} ms on)"
        borne = f"{1e3 * found.margin:.3g} ms{swings}"
    return f"{law} in hover bears {borne} of further delay; {1e3 * found.believed:.3g} ms are believed"
