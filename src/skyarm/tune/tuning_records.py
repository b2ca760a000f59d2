"""What is tuned, and what tuning found."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from skyarm.files import versions
from skyarm.records.identity import identity
from skyarm.scenario.scenario_record import Scenario
from skyarm.tune.front import Point, Required, is_allowed
from skyarm.tune.gain_search import Effort
from skyarm.tune.law_knobs import Knob
from skyarm.tune.motion_mix import KINDS
from skyarm.tune.plant_spread import Plants

UNSEEN = 100
"""Plants by which the front is judged: none of the search's."""

ASIDE = 200
"""Plants that the pick and the starts fly at last, along the path that is kept aside: nothing is chosen by them."""

PICKED = "pick"
"""Name of the pick among them."""


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What is tuned.

    Attributes:
        flight: that judges candidates. check: that judges the front; the same but for its motion. aside: the same along
            the path that is kept aside. own: that judges candidates along the scenario's own motion, where it has one.
        knobs: what may change. effort: how much is flown. seed: of plants, noise and search.
        label: of the law, as it was asked for.
    """

    flight: Scenario
    check: Scenario
    aside: Scenario
    knobs: tuple[Knob, ...]
    effort: Effort
    seed: int
    label: str
    own: Scenario | None = None
    unseen: int = UNSEEN

    def facts(self) -> dict[str, Any]:
        """Plain values on which all scores depend."""
        return {
            **{name: text for name, text in versions("cmaes").items() if name != "python"},
            "law": self.label,
            "flight": identity(self.flight),
            "motions": [*KINDS, *(["own"] if self.own else [])],
            **({"own": identity(self.own)} if self.own else {}),
            "knobs": [knob.path for knob in self.knobs],
            "seed": self.seed,
            "scatter": self.effort.scatter,
            "rounds": self.effort.rounds,
            "population": self.effort.population,
            "plants": self.effort.plants,
        }


@dataclass(frozen=True, kw_only=True, slots=True)
class Aside:
    """Scores on plants and a path by which nothing was chosen.

    Attributes:
        tip: m, 90 % quantile. jitter: rad/s, median. lost: share.
        meets: whether the gains met all constraints where the front was judged.
    """

    tip: float
    jitter: float
    lost: float
    meets: bool


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """What tuning found.

    Attributes:
        plan: what was tuned, its knobs about the gains that the search went about.
        before: the given gains, flown as the front was. points: from calm to stiff.
        picked: number of the pick among them. required: margins. plants: by which the search judged.
        aside: name -> scores of the pick and of every start on plants and a path by which nothing was chosen.
    """

    plan: Plan
    before: Point
    points: tuple[Point, ...]
    picked: int
    required: Required
    plants: Plants
    aside: dict[str, Aside]

    @property
    def pick(self) -> Point:
        """The point that the rule picks."""
        return self.points[self.picked]

    @property
    def meets(self) -> bool:
        """Whether the pick meets all constraints."""
        return is_allowed(self.pick, self.required)
