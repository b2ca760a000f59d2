"""Definition of a study: varied parameters of a scenario, their distributions, number of episodes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from types import MappingProxyType
from typing import Any

from skyarm.log.metrics.windows import Windows
from skyarm.records.immutable import immutable
from skyarm.scenario.scenario_record import Scenario
from skyarm.studies.sweep.distributions import Distribution, Values, finite
from skyarm.studies.sweep.expressions import Expression, is_own_name

DESIGNS = ("random", "grid", "sobol")
PRECISIONS = ("double", "single", "bit_exact")

LARGEST_CHUNK, MOST_EPISODES = 2**20, 2**32
"""Largest number of episodes of one file, which is held in memory with about 300 bytes each; and of a study, by the
generator's 32 bits."""


class StudyError(ValueError):
    """Error of an invalid study, or of a folder that belongs to another study."""


@immutable(slots=False)
class Study:
    """Definition of a parameter sweep: scenario, controllers, distributions, metrics and seed.

    Attributes:
        name: short name. title: one-line description. source: name of the study in messages.
        scenarios: label of the controller -> scenario it flies; all of them fly the same draws.
        vary: dotted path -> its distribution, in the order of the file; or a name that is only derived from.
        derived: dotted path, or a name that is only written into the rows -> its expression of what stands before it.
        design: "random", "grid" or "sobol".
        episodes: number of episodes, numbered from 0. seed: seed of draws and noise. chunk: episodes of one file.
        precision: "double", "single", or "bit_exact" (double without fused multiply-add: the same bits on every
            processor).
        metrics: names and groups of those in the rows. windows: windows of the metrics.
        success: metric -> largest value of a successful episode; it has to fly to its end in any case.
        document: the fields that the rows depend on, as plain values.
    """

    name: str
    title: str = ""
    source: str = "study"
    scenarios: Mapping[str, Scenario]
    vary: Mapping[str, Distribution]
    design: str = "random"
    episodes: int
    seed: int = 0
    chunk: int = 4096
    precision: str = "double"
    metrics: tuple[str, ...] = ("standard",)
    windows: Windows = Windows()
    derived: Mapping[str, Expression] = field(default_factory=lambda: MappingProxyType({}))
    success: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    document: Mapping[str, Any]

    @property
    def paths(self) -> tuple[str, ...]:
        """Paths of the varied parameters, in order, derived ones last."""
        return tuple(name for name in (*self.vary, *self.derived) if not is_own_name(name))

    @property
    def axes(self) -> dict[str, Values]:
        """Discrete parameters whose values form the grid of a grid design, by path."""
        return finite(self.vary) if self.design == "grid" else {}

    @property
    def chunks(self) -> int:
        """Number of Parquet files, each with the flights of some thousand episodes."""
        return -(-self.episodes // self.chunk)

    def span(self, index: int) -> range:
        """Range of episode numbers of one chunk of the sweep."""
        return range(index * self.chunk, min((index + 1) * self.chunk, self.episodes))
