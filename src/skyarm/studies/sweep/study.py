"""Definition of a study: varied parameters of a scenario, their distributions, number
of episodes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from types import MappingProxyType
from typing import Any

from skyarm.log.metrics.windows import Windows
from skyarm.records.immutable import immutable
from skyarm.scenario.scenario_record import Scenario
from skyarm.studies.sweep.design import Design
from skyarm.studies.sweep.expressions import is_own_name

DESIGNS = ("random", "grid", "sobol")
PRECISIONS = ("double", "single", "bit_exact")

LARGEST_CHUNK, MOST_EPISODES = 2**20, 2**32
"""Largest number of episodes of one file, which is held in memory with about 300 bytes
each; and of a study, by the generator's 32 bits."""


class StudyError(ValueError):
    """Error of an invalid study, or of a folder that belongs to another study."""


@immutable(slots=False)
class Study(Design):
    """Definition of a parameter sweep: scenario, controllers, distributions, metrics
    and seed.

    Attributes:
        name: short name. title: one-line description. source: name of the study in
            messages.
        scenarios: label of the controller -> scenario it flies; all of them fly the
            same draws.
        chunk: episodes of one file.
        precision: "double", "single", or "bit_exact" (double without fused
            multiply-add: the same bits on every processor).
        metrics: names and groups of those in the rows. windows: windows of the metrics.
        success: metric -> largest value of a successful episode; it has to fly to its
            end in any case.
        document: the fields that the rows depend on, as plain values.
    """

    name: str
    title: str = ""
    source: str = "study"
    scenarios: Mapping[str, Scenario]
    chunk: int = 4096
    precision: str = "double"
    metrics: tuple[str, ...] = ("standard",)
    windows: Windows = Windows()
    success: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    document: Mapping[str, Any]

    @property
    def paths(self) -> tuple[str, ...]:
        """Paths of the varied parameters, in order, derived ones last."""
        return tuple(
            name for name in (*self.vary, *self.derived) if not is_own_name(name)
        )
