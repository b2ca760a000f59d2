"""Who flies: laws with their gains, in the order of the tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from skyarm.compare.suite import DELAY
from skyarm.control.controller import Controller
from skyarm.control.model import Model
from skyarm.control.presets import PRESETS, preset
from skyarm.control.registry import LAWS, make_controller

NOTHING: Mapping[str, Any] = MappingProxyType({})


@dataclass(frozen=True, kw_only=True)
class Entrant:
    """A law as it enters the bench.

    Attributes:
        name: short name. group: "paper", "step" (the paper's law made better), "rival" or "exact".
        law: a preset or a law. options: of the law, whatever the condition. perfect, noisy: options for either kind.
    """

    name: str
    group: str
    law: str
    options: Mapping[str, Any] = field(default_factory=lambda: NOTHING)
    perfect: Mapping[str, Any] = field(default_factory=lambda: NOTHING)
    noisy: Mapping[str, Any] = field(default_factory=lambda: NOTHING)

    def controller(self, model: Model, *, noisy: bool) -> Controller:
        """The law with its belief; a law that can use a known delay is told of it."""
        if self.law in PRESETS:
            return preset(self.law, model)
        options = {**self.options, **(self.noisy if noisy else self.perfect)}
        if noisy and "delay" in LAWS[self.law].options():
            options["delay"] = DELAY
        return make_controller(self.law, model, **options)

    @property
    def title(self) -> str:
        """The law in one line."""
        return LAWS[PRESETS[self.law].law if self.law in PRESETS else self.law].title


ENTRANTS: Mapping[str, Entrant] = {
    each.name: each
    for each in (
        Entrant(name="paper_pd", group="paper", law="paper_pd"),
        Entrant(name="paper_ct", group="paper", law="paper_ct"),
    )
}
"""Everyone, in the order of the tables."""
