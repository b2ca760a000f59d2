"""Pictures of a report drawn small, and each figure once, where the test is not of what they look like."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import pytest

from skyarm.view.figures.style import image_bytes

DPI = 30.0


def draw_small(patch: pytest.MonkeyPatch, *modules: ModuleType) -> None:
    """Let modules that encode figures get small pictures; one that two of them encode is drawn for the first alone."""
    drawn: dict[int, tuple[Any, bytes]] = {}

    def small(figure: Any, kind: str = "png", **_: float) -> bytes:
        assert kind == "png"
        if id(figure) not in drawn:  # the figure is kept, so that no later one has its number
            drawn[id(figure)] = figure, image_bytes(figure, dpi=DPI)
        return drawn[id(figure)][1]

    for module in modules:
        patch.setattr(module, "image_bytes", small)
