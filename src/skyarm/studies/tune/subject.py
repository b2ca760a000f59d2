"""Law that a search for gains tunes: its flights, scores and tables; here the law of
one vehicle.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from types import MappingProxyType

from skyarm.records.identity import identity
from skyarm.records.immutable import immutable
from skyarm.records.leaves import Place, Tree
from skyarm.scenario.scenario_record import Scenario
from skyarm.studies.tune.candidate_flights import CandidateFlights, shorten
from skyarm.studies.tune.excitation import KINDS, draw_plants, tuning_flight
from skyarm.studies.tune.front import POINTS
from skyarm.studies.tune.hover_margins import HoverMargins, required_margins
from skyarm.studies.tune.law_knobs import (
    Knobs,
    find_knobs,
    inner_place,
    with_catalogue_gains,
    with_constants,
)
from skyarm.view.pages import Facts


@immutable
class SearchSizes:
    """Sizes of a search: its usual numbers, and those of the stages after its rounds.

    Attributes:
        candidates, plants: usual numbers of sets of gains, and of perturbed plants that
            each flies.
        pool: plants for the leaders of the scatter, over those of the search.
        semifinalists, further: candidates that fly once more, and plants that they fly,
            since a few plants flatter.
        points: largest number of sets of the front. unseen: plants that judge it, none
            of which is in the search.
        aside: plants of the final check of the pick and the starts, by which nothing is
            chosen.
    """

    candidates: int = 1640
    plants: int = 24
    pool: int = 8
    semifinalists: int = 32
    further: int = 64
    points: int = POINTS
    unseen: int = 100
    aside: int = 200


class Subject:
    """Law of one vehicle that a search tunes, on drawn motions, with margins in hover;
    base class of the law of a team.

    Attributes:
        stages: sizes of a search. kinds: kinds of motion, or of disturbance.
        score_names: score of a set of gains -> its name in files. further: columns of a
            table beside the usual.
        has_gains_file: whether gains are written as a file for ``--laws``, else as
            scenarios.
        after: plants of the final check, in words. draw: draws perturbed plants; of
            mixed ones each has one kind.
        centred: flight with the search centred at known gains. under: scenario with
            other numbers of the law. flights: flies candidates. margins: their margins.
        required: margins that gains must have.
    """

    stages = SearchSizes()
    kinds: Sequence[str] = KINDS
    score_names: Mapping[str, str] = MappingProxyType(
        {"error": "error_m", "tip": "tip_m", "jitter": "jitter_rad_s"}
        | {name: name for name in ("effort", "lost", "saturated")}
    )
    has_gains_file = True
    after = "plants and a path that chose nothing"
    draw = staticmethod(draw_plants)
    centred = staticmethod(with_catalogue_gains)
    under = staticmethod(with_constants)
    flights: type[CandidateFlights] = CandidateFlights
    margins: type[HoverMargins] = HoverMargins
    required = staticmethod(required_margins)

    def label(self, scenario: Scenario, named: str | None = None) -> str:
        """Name of the law that is tuned; ``named`` is a law in place of the
        scenario's.
        """
        return named or scenario.agent.controller.name

    def title(self, scenario: Scenario) -> str:
        """Name of the vehicle, or of the scenario of a team, for titles."""
        return scenario.agent.vehicle.name

    def error(self, scenario: Scenario) -> str:
        """Column head of the position error: of the tip, or of the base if there is no
        tip.
        """
        return "tip error" if scenario.agent.vehicle.end_effector else "base error"

    def columns(self, scenario: Scenario) -> Collection[str]:
        """Groups of columns in the tables of results, beside those that all have."""
        return (
            ("margins", "effort", "joints")
            if scenario.agent.vehicle.n
            else ("margins",)
        )

    def scenes(self, scenario: Scenario, moves: bool) -> dict[str, Scenario]:
        """Scenarios of a plan by their names there; its own motion is flown, too, if it
        ``moves``.
        """
        flight = tuning_flight(scenario)
        own = tuning_flight(scenario, own_motion=True)
        scenes = {
            "flight": flight,
            "check": flight,
            "aside": tuning_flight(scenario, unseen=True),
        }
        # the search scores the first seconds of the own motion, the check all of it
        return scenes | ({"check": own, "own": shorten(own)} if moves else {})

    def constants(self, scenario: Scenario) -> tuple[Tree, Place]:
        """Record with the numbers of the law, and the place in it where the paths of
        gains begin.
        """
        return scenario.agent.controller.par, inner_place(scenario.agent.controller)

    def knobs(self, scenario: Scenario, chosen: Sequence[str] | None) -> Knobs:
        """Tunable gains of the law; all for None."""
        return find_knobs(
            scenario.agent.controller, scenario.agent.controller.name, chosen
        )

    def origin(self, scenario: Scenario) -> Facts:
        """Digests of what flew, as plain data."""
        vehicle = scenario.agent.vehicle
        model = scenario.agent.model.vehicle
        return {
            "vehicle": vehicle.name,
            "vehicle_digest": identity(vehicle),
            "belief_digest": identity(model),
        }


VEHICLE = Subject()
