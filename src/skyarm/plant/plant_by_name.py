"""Plants by name."""

from __future__ import annotations

from typing import Any

from skyarm.plant.interface import Plant
from skyarm.registry import find


def make_plant(scenario: Any, around: Any) -> Plant:
    """The plant of a scenario; ``around`` is an example of what it is told of one period."""
    kind = find("plant", scenario.plant, "plant.kind")
    plant: Plant = kind(scenario.world, around, scenario.integrator, 1.0 / scenario.rates.physics)
    return plant
