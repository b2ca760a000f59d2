"""What is short of margin and why, as records: causes, remedies, and the explanation that they make up."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from skyarm.tune.front import Required
from skyarm.tune.loop_edges import Edges

WORTH = 1.1
"""Gain in margins from which on a cause is named."""

THRUST = 1.5
"""Largest thrust over that of a hover: below, wind and turns leave too little for torques."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Cause:
    """What costs margin: the part, what of it, the loop without it, and by what factor the margins grow then.

    What the plant has otherwise than believed is a cause whatever it costs: not all of it shows in a hover.
    """

    part: str
    words: str
    without: Edges | None
    relief: float


@dataclass(frozen=True, kw_only=True, slots=True)
class Remedy:
    """A change of one group of gains.

    Attributes:
        part: the group. share: of its bandwidth. after: the loop then. meets: whether that is enough.
        relief: factor by which the margins grow.
        gains: path of the controller -> number.
    """

    part: str
    share: float
    after: Edges
    meets: bool
    relief: float
    gains: Mapping[str, float]


@dataclass(frozen=True, kw_only=True, slots=True)
class Explanation:
    """Of a loop: its margins now, what is required, causes and remedies, the best first.

    ``now`` is None where no hover settles at all.
    """

    now: Edges | None
    required: Required
    thrust_margin: float
    causes: tuple[Cause, ...]
    remedies: tuple[Remedy, ...]

    @property
    def short(self) -> bool:
        """Whether anything is short of what is required."""
        low = self.thrust_margin < THRUST
        return low or self.now is None or self.now.shortness(self.required) > 1.0

    @property
    def parts(self) -> tuple[str, ...]:
        """Parts that are named, the one that costs most first: causes, then the gains that help most."""
        best = [remedy.part for remedy in self.remedies[:1]] if self.short else []
        return tuple(dict.fromkeys([*(cause.part for cause in self.causes), *best]))
