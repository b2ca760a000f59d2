"""Law of a team as the subject of a search: what its candidates fly, and how they are scored.

The flight is the scenario's own. The plants are those of the conditions "noise", "masses" and "misplaced" of the team
suite (:mod:`skyarm.studies.compare.team_suite`) in turn: as the scenario has them; every vehicle and the body heavier
or lighter; a grasp 2 cm off. All have noise. At last the masses are drawn and a grasp is off in the same flight.

Knobs are the options whose fields state an effect. The error of a flight is the geometric mean of the body's error of
position and of the RMS error of the pull: each counts by its ratio of improvement. A team has no margins.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from types import MappingProxyType
from typing import Any, cast

import numpy as np

from skyarm.algebra import Vec3
from skyarm.algebra.scalars.philox import uniforms
from skyarm.log.metrics.metric_catalogue import catalogue_names, row_names
from skyarm.records.arrays import Array, IntArray, Mask
from skyarm.records.files import shown
from skyarm.records.leaves import Place, Tree, replace_at
from skyarm.records.members import Members
from skyarm.records.registry.registrations import name_of
from skyarm.records.units import units
from skyarm.scenario.numbers import number_at, with_numbers
from skyarm.scenario.scenario_record import Agent, Scenario
from skyarm.studies.compare.perturbed_plants import Spread
from skyarm.studies.compare.suite import NOISE
from skyarm.studies.flights import Crew
from skyarm.studies.tune.candidate_flights import LARGEST_TILT, LIMITED, LOST, CandidateFlights, Flown, penalize
from skyarm.studies.tune.excitation import Plants, with_noise
from skyarm.studies.tune.front import Required
from skyarm.studies.tune.hover_margins import HoverMargins
from skyarm.studies.tune.law_knobs import Centred, GainKnob, KnobError, Numbers, centre, chosen_knobs
from skyarm.studies.tune.subject import Stages, Subject
from skyarm.view.pages import Facts
from skyarm.world.team.team import Member, Team

MASSES, MISPLACED = 1, 2
"""Kinds of plants beside the first, which is as the scenario has it: plant k is of kind k modulo three."""

OFF = 0.02
"""Distance (m) by which a grasp is off, along the line from the middle of all grasps, outward or inward."""

CHANNEL = 31
"""Channel of the random generator, separate from those of plants, motions and noise."""

POSITION, PULL, JITTER, TILT = "team_position_mean", "team_pull_rms", "rotor_jitter", "tilt_max"

WITHOUT = "they are of one vehicle, and the law of a team was tuned"
"""Reason why no margins are computed."""


def team_of(scenario: Scenario) -> Team:
    """Team of a scenario that has one."""
    return cast("Team", scenario.team)


def team_flight(scenario: Scenario) -> Scenario:
    """Scenario with noise where it has none, and with paths of tips whose grasps can be off."""
    team = team_of(scenario)
    if not (team.position_noise or team.attitude_noise):
        team = dataclasses.replace(team, position_noise=NOISE.position, attitude_noise=NOISE.attitude)
    agents = tuple(with_noise(_movable(team, scenario, name)) for name in scenario.agents)
    members = dataclasses.replace(cast("Members[Agent]", scenario.agents), records=agents)
    return dataclasses.replace(scenario.with_kind("rigid_body"), agents=members, team=team)


def _movable(team: Team, scenario: Scenario, name: str) -> Agent:
    """Vehicle whose tip takes hold at a place that may be another than the supposed one."""
    agent, member = scenario.agents[name], _member(team, name)
    tip = agent.reference.tip
    if member is None or tip is None or team.motion is None:
        return agent
    taken = dataclasses.replace(member, taken=member.taken or member.place)
    path = taken.path(team.motion, team.take)
    tip = dataclasses.replace(tip, x=path.x, y=path.y, z=path.z)
    return dataclasses.replace(agent, reference=dataclasses.replace(agent.reference, tip=tip))


def _member(team: Team, name: str) -> Member | None:
    return next((each for each in team.members if each.agent == name), None)


def bodies(scenario: Scenario) -> dict[str, list[str]]:
    """Paths of the masses of each vehicle and, last, of the body that the team carries."""
    paths = {
        name: [
            f"agents.{name}.plant.vehicle.{body}.mass"
            for body in ("base", *(f"links.{i}.body" for i in range(vehicle.n)))
        ]
        for name, vehicle in scenario.vehicles.items()
    }
    return paths | {"": [f"world.objects.{team_of(scenario).object}.mass"]}


def misplaced(scenario: Scenario, member: int, along: Array) -> dict[str, Array]:
    """Numbers of flights whose grasp is further from the middle of all than the team supposes.

    Args:
        scenario: flight as :func:`team_flight` makes it.
        member: number of the member.
        along: m, (flights,) how much further.
    """
    team = team_of(scenario)
    own, paths = team.members[member], Vec3(0.0, 0.0, 0.0)
    for each in team.members:
        paths = paths + (own.place - each.place) * (1.0 / len(team.members))
    outward = paths * (1.0 / math.sqrt(float(paths.dot(paths))))
    values: dict[str, Array] = {}
    moves = scenario.agents[own.agent].reference.tip is not None
    grasp = next(i for i, each in enumerate(scenario.world.grasps) if each.agent == own.agent)  # type: ignore[union-attr]
    for k, axis in enumerate("xyz"):
        if abs(float(outward[k])) < 1e-9:
            continue
        step = along * float(outward[k])
        supposed = f"team.members.{member}.place.{axis}"
        if moves:  # the tip takes hold where it is, and the team supposes another place
            values[supposed] = number_at(scenario, supposed) - step
            for coordinate in "xyz":
                height = f"agents.{own.agent}.reference.tip.{coordinate}.place.{k}.signals.1.height"
                values[height] = number_at(scenario, height) - step
        else:
            held = f"world.grasps.{grasp}.place.{axis}"
            values[held] = number_at(scenario, held) + step
    return values


class TeamFlights(CandidateFlights):
    """Flights of options of a team's law on perturbed plants."""

    word = "team"

    def _stiffest(self, scenario: Scenario) -> Scenario:
        lightest = {path: number_at(scenario, path) * (1.0 - Spread().mass) for path in bodies(scenario)[""]}
        return with_numbers(scenario, lightest)

    def _metrics(self, scenario: Scenario, saturation: bool) -> tuple[str, ...]:
        return row_names((POSITION, PULL, JITTER, LIMITED, TILT), scenario.setpoints)

    def _flown(self, completed: Mask, table: Callable[[str], Array], kinds: IntArray) -> Flown:
        def largest(name: str) -> Array:
            """Metric of the vehicle that has the largest."""
            found: Array = np.max([table(each) for each in self._work.metrics if catalogue_names([each]) == {name}], 0)
            return found

        lost = ~completed | ~(largest(TILT) < LARGEST_TILT)
        position, pull = (penalize(table(name), lost) for name in (POSITION, PULL))
        return Flown(
            error=np.sqrt(position * pull),
            tip=position,
            base=position,
            pull=pull,
            jitter=np.nan_to_num(largest(JITTER), nan=LOST, posinf=LOST),
            effort=np.zeros(lost.shape),
            lost=lost,
            saturated=np.nan_to_num(largest(LIMITED), nan=1.0),
            kinds=kinds,
        )


class NoMargins(HoverMargins):
    """Margins that are not required."""

    def __init__(self) -> None:
        self._loops, self._why_none = None, WITHOUT


class TeamSubject(Subject):
    """Law of a team, on the scenario's own motion."""

    score_names = MappingProxyType(
        {"error": "error", "tip": "position_m", "pull": "pull_n", "jitter": "jitter_rad_s"}
        | {name: name for name in ("lost", "saturated")}
    )
    kinds = ("noise", "masses", "misplaced")
    has_gains_file = False
    after = "plants that chose nothing, with masses and a grasp off at once"

    stages = Stages(candidates=235, plants=9, pool=2, semifinalists=12, further=18, points=8, unseen=24, aside=24)

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

    def knobs(self, scenario: Scenario, chosen: Sequence[str] | None) -> tuple[GainKnob, ...]:
        """Options above zero whose fields state an effect."""
        team = team_of(scenario)
        knobs = tuple(
            GainKnob(path=name, unit=unit.unit, numbers=(((name,), value),), least=max(unit.low, 0.0), most=unit.high)
            for name, unit in units(type(team)).items()
            if unit.effect and (value := float(getattr(team, name))) > 0.0
        )
        if not knobs:
            words = "has no options to tune: none above 0 that states an effect"
            raise KnobError(f"team.law = {shown(self.label(scenario))}: {words}")
        return chosen_knobs(knobs, chosen)

    def under(self, scenario: Scenario, numbers: Mapping[Place, float]) -> Scenario:
        """Scenario with other options of its team's law."""
        return dataclasses.replace(scenario, team=replace_at(team_of(scenario), numbers))

    def centred(self, flight: Scenario, knobs: tuple[GainKnob, ...], label: str) -> Centred:
        """Flight with the defaults of the law."""
        usual: dict[str, Any] = {each.name: each.default for each in dataclasses.fields(team_of(flight))}
        numbers: Numbers = [(float(usual[knob.path]),) if usual[knob.path] else () for knob in knobs]
        return centre(knobs, {label: numbers}, lambda moved: self.under(flight, moved))

    def draw(self, scenario: Scenario, count: int, *, seed: int, mixed: bool) -> Plants:
        """Draw perturbed plants: as the scenario has them, with other masses, or with a grasp off; else with both."""
        own, members = bodies(scenario), len(team_of(scenario).members)
        drawn = 2.0 * uniforms(seed, np.arange(count), CHANNEL, 0, len(own) + 1) - 1.0
        kinds: IntArray = np.arange(count) % 3 if mixed else np.zeros(count, dtype=int)
        changed = [(kinds == kind) | (not mixed) for kind in (MASSES, MISPLACED)]
        spread, values = Spread(), dict[str, Array]()
        for i, paths in enumerate(own.values()):
            factor = 1.0 + spread.mass * drawn[:, i] * changed[0]
            values |= {path: number_at(scenario, path) * factor for path in paths}
        off = OFF * np.where(drawn[:, -1] < 0.0, -1.0, 1.0) * changed[1]
        turn = np.arange(count) // (3 if mixed else 1) % members
        for member in range(members):
            values |= misplaced(scenario, member, off * (turn == member))
        return Plants(spread=spread, eased=1.0, values=values, kinds=kinds)

    def flights(
        self, scenario: Scenario, knobs: Sequence[GainKnob], plants: Plants, crew: Crew, **options: Any
    ) -> CandidateFlights:
        """Flights of gain candidates."""
        return TeamFlights(scenario, knobs, plants, crew, **options)

    def margins(self, scenario: Scenario, knobs: Sequence[GainKnob], threads: int) -> HoverMargins:
        """No margins."""
        return NoMargins()

    def required(self, scenario: Scenario) -> Required:
        """No margins."""
        return Required(delay=0.0, gain=1.0)

    def origin(self, scenario: Scenario) -> Facts:
        """Nothing beside the digest of the flight."""
        return {}
