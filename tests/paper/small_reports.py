"""Small reports of the paper: few flights, small pictures, results that are made once.

- Small campaigns of the paper: the plain flights alone.
- Pictures of a report drawn small, and each figure once, where the test is not of what
  they look like.
- What takes seconds to make and is the same in every process of the tests: made by the
  first that asks for it.
"""

from __future__ import annotations

import fcntl
import os
import pickle
from collections.abc import Callable
from types import ModuleType
from typing import Any, TypeVar, cast

import pytest

from skyarm.paper.flights import metrics
from skyarm.paper.reproduce import Campaign, run_campaign
from skyarm.paper.variations import variations
from skyarm.view.figures.style import image_bytes


def few(plants: Any, **options: Any) -> Campaign:
    """The plain flights, and the variations that need no flight of their own."""
    campaign = run_campaign(plants, **options, sensitivity=False)
    logs = campaign.logs[plants[0]]
    numbers = {
        (case, law): metrics(case, log)
        for case, laws in logs.items()
        for law, log in laws.items()
    }
    for each in variations():
        for case in each.cases:
            for controller in ("CT", "PD"):
                values = campaign.sensitivity.setdefault(each.group, {}).setdefault(
                    each.value, {}
                )
                values.setdefault(case, {})[controller] = numbers[case, controller]
    return campaign


DPI = 30.0


def draw_small(patch: pytest.MonkeyPatch, *modules: ModuleType) -> None:
    """Let modules that encode figures get small pictures; one that two of them encode
    is drawn for the first alone.
    """
    drawn: dict[int, tuple[Any, bytes]] = {}

    def small(figure: Any, kind: str = "png", **_: float) -> bytes:
        assert kind == "png"
        # the figure is kept, so that no later one has its number
        if id(figure) not in drawn:
            drawn[id(figure)] = figure, image_bytes(figure, dpi=DPI)
        return drawn[id(figure)][1]

    for module in modules:
        patch.setattr(module, "image_bytes", small)


Made = TypeVar("Made")


def made_once(
    factory: pytest.TempPathFactory, name: str, make: Callable[[], Made]
) -> Made:
    """Return what ``make`` gives, or what another process of this run has from it; it
    must travel by pickle.

    A process that asks meanwhile waits: making it there too would take it as long, and
    a core.
    """
    own = factory.getbasetemp()
    shared = (
        own.parent if "PYTEST_XDIST_WORKER" in os.environ else own
    ) / f"made_once_{name}"
    with shared.open("a+b") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        file.seek(0)
        if content := file.read():
            return cast(Made, pickle.loads(content))
        made = make()
        file.write(pickle.dumps(made))
        return made
