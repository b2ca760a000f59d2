"""Law of a team as the subject of a search: what its candidates fly, and how they are
scored.

The flight is the scenario's own. The plants are those of the conditions "noise",
"masses" and "misplaced" of the team suite (:mod:`skyarm.studies.compare.team_suite`) in
turn: as the scenario has them; every vehicle and the body heavier or lighter; the grasp
of each member 2 cm off. All have noise. At last the masses are drawn and a grasp is off
in the same flight.

Knobs are the options whose fields state an effect. The error of a flight is the
geometric mean of the body's error of position and of the RMS error of the pull: each
counts by its ratio of improvement. A team has no margins.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import fields, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from skyarm.algebra.scalars.philox import uniforms
from skyarm.log.metrics.metric_catalogue import row_names
from skyarm.records.arrays import Array, Columns, Mask
from skyarm.records.files import shown
from skyarm.records.leaves import Place, Tree, replace_at
from skyarm.records.registry.registrations import name_of
from skyarm.records.units import units
from skyarm.scenario.numbers import number_at, with_numbers
from skyarm.scenario.scenario_record import Scenario
from skyarm.studies.compare.perturbed_plants import Spread
from skyarm.studies.trial.trial import NOISE
from skyarm.studies.tune.candidate_flights import (
    JITTER,
    LIMITED,
    OWN,
    TILT,
    CandidateFlights,
    penalize,
)
from skyarm.studies.tune.excitation import Plants, with_noise
from skyarm.studies.tune.front import Required
from skyarm.studies.tune.hover_margins import HoverMargins
from skyarm.studies.tune.law_knobs import (
    Centred,
    GainKnob,
    KnobError,
    Knobs,
    centre,
    chosen_knobs,
)
from skyarm.studies.tune.subject import SearchSizes, Subject
from skyarm.view.pages import Facts

if TYPE_CHECKING:
    from skyarm.world.contact.contact import Contact
    from skyarm.world.team.team import Team

AS_IT_IS, MASSES, FIRST_OFF = 0, 1, OWN + 1
"""Kinds of plants: as the scenario has it, with other masses, and from the last one on
a grasp off, one a member.

Kinds have quantiles of their own: what a leader's grasp that is off costs, no options
of followers mend."""

OFF = 0.02
"""Distance (m) by which a grasp is off, along the line from the middle of all grasps,
outward or inward."""

CHANNEL = 31
"""Channel of the random generator, separate from those of plants, motions and noise."""

POSITION, PULL = "team_position_mean", "team_pull_rms"

WITHOUT = "they are of one vehicle, and the law of a team was tuned"
"""Reason why no margins are computed."""


def team_of(scenario: Scenario) -> Team:
    """Team of a scenario that has one."""
    return cast("Team", scenario.team)


def team_flight(scenario: Scenario) -> Scenario:
    """Scenario with noise where it has none, and with paths of tips whose grasps can be
    off.
    """
    team = team_of(scenario)
    agents = dict(scenario.agents)
    if not (team.position_noise or team.attitude_noise):
        team = replace(
            team, position_noise=NOISE.position, attitude_noise=NOISE.attitude
        )
    for member in team.members:
        own = agents[member.agent].reference
        if own.tip is not None and team.motion is not None:
            # stated, the true place gives the path a ramp, whose height can then vary
            path = replace(member, taken=member.taken or member.place).path(
                team.motion, team.take
            )
            tip = replace(own.tip, x=path.x, y=path.y, z=path.z)
            moved = replace(own, tip=tip)
            agents[member.agent] = replace(agents[member.agent], reference=moved)
    noisy = {name: with_noise(each) for name, each in agents.items()}
    return replace(scenario.with_kind("rigid_body"), agents=noisy, team=team)


def masses(scenario: Scenario) -> list[list[str]]:
    """Paths of the masses of each vehicle, and last of the body that the team
    carries.
    """
    own = [
        [
            f"agents.{name}.plant.vehicle.{body}.mass"
            for body in ("base", *(f"links.{i}.body" for i in range(each.n)))
        ]
        for name, each in scenario.vehicles.items()
    ]
    return [*own, [f"world.objects.{team_of(scenario).object}.mass"]]


def grasp_numbers(scenario: Scenario, member: int, along: Array) -> Columns:
    """Numbers of flights whose grasp is further from the middle of all than the team
    supposes.

    Args:
        scenario: flight as :func:`team_flight` makes it.
        member: number of the member.
        along: m, (flights,) how much further.
    """
    team = team_of(scenario)
    agent = team.members[member].agent
    # of equal masses, so that outward is from the middle of all grasps
    equal = team.with_masses([1.0] * len(team.members))
    outward = equal.outward([each.place for each in team.members])[member]
    held = enumerate(cast("Contact", scenario.world).grasps)
    grasp = next(
        i for i, each in held if (each.agent, each.body) == (agent, team.object)
    )
    values: Columns = {}
    for k, axis in enumerate("xyz"):
        # a tip takes hold where it is, and the team supposes another place; on a cable
        # the place itself is another
        tip = f"agents.{agent}.reference.tip"
        paths = [
            f"team.members.{member}.place.{axis}",
            # the ramp in the member's path, from the true place to the supposed one
            *(f"{tip}.{c}.place.{k}.signals.1.height" for c in "xyz"),
        ]
        on_cable = scenario.agents[agent].reference.tip is None
        for path in [f"world.grasps.{grasp}.place.{axis}"] if on_cable else paths:
            values[path] = number_at(scenario, path) + along * float(outward[k]) * (
                1.0 if on_cable else -1.0
            )
    return values


def draw_team_plants(
    scenario: Scenario, count: int, *, seed: int, mixed: bool = False
) -> Plants:
    """Draw perturbed plants: of ``mixed`` ones each is of one kind, else all have other
    masses and a grasp off.

    Args:
        scenario: flight as :func:`team_flight` makes it.
        count: plants; the first ones do not depend on it.
        seed: key.
        mixed: one kind after the other.
    """
    own = masses(scenario)
    members = len(team_of(scenario).members)
    spread = Spread()
    drawn = 2.0 * uniforms(seed, np.arange(count), CHANNEL, 0, len(own) + 1) - 1.0
    offs = [FIRST_OFF + i for i in range(members)]
    # resize repeats the kinds in turn
    kinds = np.resize([AS_IT_IS, MASSES, *offs] if mixed else offs, count)
    values: Columns = {}
    # the last column is of the grasps, below
    for paths, numbers in zip(own, drawn.T, strict=False):
        factor = 1.0 + spread.mass * numbers * ((kinds == MASSES) | (not mixed))
        values |= {path: number_at(scenario, path) * factor for path in paths}
    for i, kind in enumerate(offs):
        # only the sign is drawn: a grasp is off by OFF, outward or inward
        values |= grasp_numbers(
            scenario, i, OFF * np.sign(drawn[:, -1]) * (kinds == kind)
        )
    return Plants(spread=spread, eased=1.0, values=values, kinds=kinds)


def at_defaults(flight: Scenario, knobs: Knobs, label: str) -> Centred:
    """Flight with the search centred at the defaults of the law of its team."""
    usual: dict[str, Any] = {
        each.name: each.default for each in fields(team_of(flight))
    }
    # an option whose default is 0, or that has none, is searched around its given value
    numbers = [
        (float(usual[k.path]),) if _is_above_0(usual[k.path]) else k.values
        for k in knobs
    ]
    return centre(knobs, {label: numbers}, lambda moved: with_options(flight, moved))


def _is_above_0(value: object) -> bool:
    """True for an option that is a plain number above 0, which a factor can change."""
    return type(value) in (int, float) and float(cast("float", value)) > 0.0


def with_options(scenario: Scenario, numbers: Mapping[Place, float]) -> Scenario:
    """Scenario with other options of its team's law."""
    return replace(scenario, team=replace_at(team_of(scenario), numbers))


class TeamCandidates(CandidateFlights):
    """Flights of options of a team's law on perturbed plants."""

    word = "team"

    def _stiffest(self, scenario: Scenario) -> Scenario:
        lightest = {
            path: number_at(scenario, path) * (1.0 - Spread().mass)
            for path in masses(scenario)[-1]
        }
        return with_numbers(scenario, lightest)

    def _metrics(self, scenario: Scenario, saturation: bool) -> tuple[str, ...]:
        return row_names((POSITION, PULL, JITTER, LIMITED, TILT), scenario.setpoints)

    def _errors_of(self, metrics: Mapping[str, Array], lost: Mask) -> dict[str, Array]:
        position, pull = (penalize(metrics[name], lost) for name in (POSITION, PULL))
        return {
            # geometric mean, in which ratios of metres and of newtons count alike
            "error": np.sqrt(position * pull),
            # the search has one set of names for vehicles and teams: what a team lacks
            # repeats the position, or counts nothing
            "tip": position,
            "base": position,
            "pull": pull,
            "effort": np.zeros(lost.shape),
        }


def no_required_margins(scenario: Scenario) -> Required:
    """Margins that every loop has."""
    return Required(delay=0.0, gain=1.0)


class NoMargins(HoverMargins):
    """Margins that are not required."""

    def __init__(self, *_: object) -> None:
        self._loops = None
        self._why_none = WITHOUT


class TeamSubject(Subject):
    """Law of a team, on the scenario's own motion."""

    score_names = MappingProxyType(
        {
            "error": "error",
            "tip": "position_m",
            "pull": "pull_n",
            "jitter": "jitter_rad_s",
        }
        | {name: name for name in ("lost", "saturated")}
    )
    kinds = ("noise", "masses", "misplaced")
    has_gains_file = False
    after = "plants that chose nothing, with masses and a grasp off at once"
    draw = staticmethod(draw_team_plants)
    centred = staticmethod(at_defaults)
    under = staticmethod(with_options)
    flights = TeamCandidates
    margins = NoMargins
    required = staticmethod(no_required_margins)

    stages = SearchSizes(
        candidates=234,
        plants=8,
        pool=2,
        semifinalists=12,
        further=16,
        points=8,
        unseen=24,
        aside=24,
    )

    def label(self, scenario: Scenario, named: str | None = None) -> str:
        """Name of the team's law."""
        return str(name_of("team", type(team_of(scenario))))

    def scenes(self, scenario: Scenario, moves: bool) -> dict[str, Scenario]:
        """The same flight in all stages."""
        return dict.fromkeys(("flight", "check", "aside"), team_flight(scenario))

    def title(self, scenario: Scenario) -> str:
        """Name of the scenario."""
        return scenario.name

    def error(self, scenario: Scenario) -> str:
        """Head of the column of the body's error."""
        return "position error"

    def columns(self, scenario: Scenario) -> Collection[str]:
        """The pull, and no margins."""
        return ("pull",)

    def constants(self, scenario: Scenario) -> tuple[Tree, Place]:
        """Law with its options."""
        return team_of(scenario), ()

    def knobs(self, scenario: Scenario, chosen: Sequence[str] | None) -> Knobs:
        """Options above zero whose fields state an effect."""
        team = team_of(scenario)
        knobs = tuple(
            GainKnob(
                path=name,
                unit=unit.unit,
                numbers=(((name,), float(value)),),
                least=max(unit.low, 0.0),
                most=unit.high,
            )
            for name, unit in units(type(team)).items()
            if unit.effect
            and not unit.fixed
            and _is_above_0(value := getattr(team, name))
        )
        if not knobs:
            words = "has no options to tune: none above 0 that states an effect"
            raise KnobError(f"team.law = {shown(self.label(scenario))}: {words}")
        return chosen_knobs(knobs, chosen)

    def origin(self, scenario: Scenario) -> Facts:
        """Nothing beside the digest of the flight."""
        return {}
