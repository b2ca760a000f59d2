"""Small campaigns of the paper: the plain flights alone."""

from __future__ import annotations

from typing import Any

from skyarm.studies.paper.flights import metrics
from skyarm.studies.paper.reproduce import Campaign, run_campaign
from skyarm.studies.paper.variations import variations


def few(plants: Any, **options: Any) -> Campaign:
    """The plain flights, and the variations that need no flight of their own."""
    campaign = run_campaign(plants, **options, sensitivity=False)
    logs = campaign.logs[plants[0]]
    numbers = {(case, law): metrics(case, log) for case, laws in logs.items() for law, log in laws.items()}
    for each in variations():
        for case in each.cases:
            for controller in ("CT", "PD"):
                values = campaign.sensitivity.setdefault(each.group, {}).setdefault(each.value, {})
                values.setdefault(case, {})[controller] = numbers[case, controller]
    return campaign
