"""The delay margin of a controller that was made, said once, with a warning where it is short."""

from __future__ import annotations

import math
from typing import Any

from skyarm.cli.lines import say
from skyarm.scenario.scenario_record import Scenario
from skyarm.stability.hover_delay import HoverDelay, hover_delay_if_known


def margin_said(scenario: Scenario, label: str) -> tuple[str, dict[str, Any]]:
    """The line on the delay margin of a scenario's law in hover, and the same for a machine.

    A margin that is too small is warned of on standard error.

    Args:
        scenario: in whose hover it is asked.
        label: of the law, in words.
    """
    found = hover_delay_if_known(scenario)
    if isinstance(found, str):
        return f"delay margin: not known: {found}", plain_margin(None)
    short = found.shortfall if found.margin > 0.0 else "no margin at all"
    if short:
        remedy = "softer gains or another law ('skyarm margins' shows which loop)"
        say(f"warning: {label}: delay margin: {short}{found.before}: {remedy}")
    return f"delay margin: {found.sentence(label)}", plain_margin(found)


def plain_margin(found: HoverDelay | None) -> dict[str, Any]:
    """A margin as plain data, s; null where it is not known, and beyond 0.1 s."""
    if found is None:
        return {"delay_margin_s": None, "delay_believed_s": None, "delay_margin_enough": None}
    margin = found.margin if math.isfinite(found.margin) else None
    return {
        "delay_margin_s": margin,
        "delay_believed_s": found.believed,
        "delay_margin_enough": found.enough,
    }
