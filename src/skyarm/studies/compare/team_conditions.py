"""Conditions of the team suite: entries and numbers in which each differs from the scenario file of any team.

What is wrong with one member is wrong with the last one.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import field

import numpy as np

from skyarm.algebra import Vec3
from skyarm.records.arrays import AnyArray as Array
from skyarm.records.immutable import immutable
from skyarm.reference.signals import Constant, Shifted, Signal, with_signals
from skyarm.scenario.scenario_record import Scenario
from skyarm.studies.compare.cell_flights import Document, Record
from skyarm.studies.compare.suite import Condition, library_rows
from skyarm.studies.sweep.design import values
from skyarm.studies.sweep.distributions import distribution_from
from skyarm.studies.sweep.study import Study
from skyarm.world.team.team import Team

ROWS: Mapping[str, Record] = {row["name"]: row for row in library_rows("team_rows")}
"""Condition -> its fields; left out, its flights are those of the suite, and all laws fly it."""

BEGIN = 5.0 / 17.0
"""Part of the time from the lift until the body stands, after which wind rises and a member is lost: at 8 s of the
shipped scenario."""

DAMPING = math.sqrt(0.96)
"""Factor on the damping of a grasp whose stiffness is another, beside the root of that factor: the shipped 15 N s/m are
rounded up from 0.6 sqrt(0.06 kg 10 000 N/m)."""

AXES = ("x", "y", "z")


@immutable
class TeamCondition(Condition):
    """Condition of the team suite.

    Attributes:
        own: title for scenarios of users, where it is another.
        tables: entries of the scenario's file in place of its own; a table for a list goes into each of its tables.
        last: entries of the last member's table.
        off: distance by which its grasp is farther from the middle of all grasps than the team supposes, m.
        late: time by which its path is late, s.
        rotor: effectiveness of its first rotor.
        lost: true if its grasp opens in flight.
        stiffness: factor on the stiffness of all grasps.
        wind: force on each vehicle along world x and y, N.
        vary: numbers of each flight: "masses", "off", "stiffness", "wind", "rotor" -> distribution, as in a study.
    """

    own: str = ""
    tables: Document = field(default_factory=dict)
    last: Document = field(default_factory=dict)
    off: float = 0.0
    late: float = 0.0
    rotor: float = 1.0
    lost: bool = False
    stiffness: float = 1.0
    wind: tuple[float, ...] = ()
    vary: Document = field(default_factory=dict)

    def refusal(self, team: Team) -> str:
        """Reason why the condition does not apply to a team; empty if it does."""
        kinds = {str(each.kind) for each in team.members}
        if self.lost and len(team.members) < 3:
            return f"takes three members or more, not {len(team.members)}"
        if "kind" in self.tables.get("world", {}).get("grasps", {}) and kinds != {"ball"}:
            return f"takes ball grasps, not {' and '.join(sorted(kinds))}"
        if "off" in self.vary and "cable" in kinds:
            return "takes arms: paths at cables are planned before the flight"
        return ""

    def change_document(self, document: Document, given: Scenario) -> Document:
        """Scenario file with the entries of the condition in place of its own.

        Args:
            document: tables of the file.
            given: scenario that it describes.
        """
        team = given.team
        assert team is not None
        name, changed = team.members[-1].agent, with_entries(document, self.tables)
        changed = with_entries(changed, {"agents": {name: self.last}})
        if self.stiffness != 1.0 or self.lost:
            grasps = changed["world"]["grasps"]
            changed = with_entries(changed, {"world": {"grasps": [self._grasp(g, given) for g in grasps]}})
        if "masses" in self.vary:
            # the lightest body fixes the integration steps; the team supposes that of the file
            least = round(float(body_mass(given)) * self.vary["masses"]["uniform"][0], 9)
            bodies = [b | ({"mass": least} if b["name"] == team.object else {}) for b in changed["world"]["objects"]]
            changed = with_entries(changed, {"team": {"mass": float(team.mass)}, "world": {"objects": bodies}})
        if self.off:
            changed = with_entries(changed, {"team": {"members": self._members(document, given)}})
        if self.wind:
            push = [
                {"kind": "ramp", "start": onset(given), "duration": 0.5, "height": f} if f else 0.0 for f in self.wind
            ]
            own = changed.get("environment", {}).get("forces", [])
            forces = [*own, {"kind": "disturbance", "force": [*push, 0.0]}]
            changed = with_entries(changed, {"environment": {"forces": forces}})
        if self.rotor != 1.0:
            rotor = given.agents[name].plant.vehicle.rotors[0].name
            faults = [*changed["agents"][name].get("faults", []), {"rotor": rotor, "effectiveness": self.rotor}]
            changed = with_entries(changed, {"agents": {name: {"faults": faults}}})
        return changed

    def _grasp(self, entry: Record, given: Scenario) -> Document:
        """Entry of a grasp of the body with another stiffness, and of the last member's with its end."""
        team, changed = given.team, dict(entry)
        assert team is not None
        assert given.world is not None
        if entry["body"] != team.object:
            return changed
        (own,) = (g for g in given.world.grasps if (g.agent, g.body) == (entry["agent"], entry["body"]))
        if self.stiffness != 1.0:
            changed["stiffness"] = float(own.stiffness) * self.stiffness
            changed["damping"] = float(f"{float(own.damping) * DAMPING * math.sqrt(self.stiffness):.3g}")
        if self.lost and own.agent == team.members[-1].agent:
            changed["release"] = onset(given)
        return changed

    def _members(self, document: Record, given: Scenario) -> list[Document]:
        """Entries of all members, of which the last supposes its grasp nearer to the middle of all grasps."""
        team = given.team
        assert team is not None
        stated = {each["agent"]: each for each in document["team"].get("members", [])}
        entries = [{"agent": m.agent, "place": [*map(float, m.place)], **stated.get(m.agent, {})} for m in team.members]
        supposed = place_of_last(given) - outward(given) * self.off
        entries[-1]["place"] = [round(float(c), 9) for c in supposed]
        return entries

    def change_path(self, scenario: Scenario) -> Scenario:
        """Scenario in which the last member's path is late."""
        if not self.late or scenario.team is None:
            return scenario

        def later(signal: Signal) -> Signal:
            return signal if isinstance(signal, Constant) else Shifted(signal, self.late)

        name = scenario.team.members[-1].agent
        agent = scenario.agents[name]
        agent = dataclasses.replace(agent, reference=with_signals(agent.reference, later))
        return dataclasses.replace(scenario, agents={**scenario.agents, name: agent})

    def columns(self, scenario: Scenario, given: Scenario, seed: int) -> dict[str, Array]:
        """Numbers of the flights, the same for every law: parameter path -> values (flights,).

        Args:
            scenario: scenario of the condition.
            given: the scenario before its changes.
            seed: seed of the draws.
        """
        team = scenario.team
        assert team is not None
        several = {"masses": [*scenario.agents, team.object], "wind": [*AXES[:2]]}
        spread = {f"{name}_{each}": table for name, table in self.vary.items() for each in several.get(name, [""])}
        vary = {path: distribution_from(table, path) for path, table in spread.items()}
        study = Study(
            name=self.name, scenarios={}, vary=vary, derived={}, episodes=self.episodes, seed=seed, document={}
        )
        drawn, last = values(study, np.arange(study.episodes)), team.members[-1].agent
        found: dict[str, Array] = {}
        if "masses" in self.vary:
            found[f"world.objects.{team.object}.mass"] = float(body_mass(given)) * drawn[f"masses_{team.object}"]
            for name, agent in scenario.agents.items():
                vehicle, at = agent.plant.vehicle, f"agents.{name}.plant.vehicle"
                bodies = {"base": vehicle.base} | {f"links.{link.name}.body": link.body for link in vehicle.links}
                found |= {f"{at}.{path}.mass": float(b.mass) * drawn[f"masses_{name}"] for path, b in bodies.items()}
        if "off" in self.vary:
            off, tip = drawn["off_"], f"agents.{last}.reference.tip"
            for k, (place, u) in enumerate(zip(place_of_last(given), outward(given), strict=True)):
                if abs(u) > 1e-9:
                    found[f"team.members.{len(team.members) - 1}.place.{AXES[k]}"] = float(place) + u * off
                    found |= {f"{tip}.{axis}.place.{k}.signals.1.height": u * off for axis in AXES}
        if "stiffness" in self.vary and given.world is not None:
            factor = drawn["stiffness_"]
            for i, own in enumerate(given.world.grasps):
                if own.body == team.object:
                    found[f"world.grasps.{i}.stiffness"] = float(own.stiffness) * factor
                    found[f"world.grasps.{i}.damping"] = float(own.damping) * DAMPING * np.sqrt(factor)
        if "wind" in self.vary:
            at = f"environment.forces.{len(scenario.environment.forces) - 1}.force"
            found |= {f"{at}.{axis}.height": drawn[f"wind_{axis}"] for axis in AXES[:2]}
        if "rotor" in self.vary:
            number = len(scenario.agents[last].faults) - 1
            found[f"agents.{last}.environment.faults.{number}.effectiveness"] = drawn["rotor_"]
        return found


def with_entries(table: Record, entries: Record) -> Document:
    """Table of a file with entries in place of its own, tables key by key; a table for a list in each of its tables."""
    changed = dict(table)
    for key, entry in entries.items():
        match table.get(key), entry:
            case dict() as own, dict():
                changed[key] = with_entries(own, entry)
            case list() as own, dict():
                changed[key] = [with_entries(each, entry) for each in own]
            case _:
                changed[key] = entry
    return changed


def body_mass(scenario: Scenario) -> float:
    """Mass (kg) of the body that a team carries."""
    assert scenario.team is not None
    assert scenario.world is not None
    return next(float(each.mass) for each in scenario.world.objects if each.name == scenario.team.object)


def place_of_last(scenario: Scenario) -> Vec3:
    """Place (m, axes of the body from its middle) of the last member's grasp."""
    return _places(scenario)[-1]


def outward(scenario: Scenario) -> Vec3:
    """Horizontal unit vector, axes of the body, from the middle of all grasps to the last member's."""
    places = _places(scenario)
    x, y = (float(places[-1][k]) - sum(float(each[k]) for each in places) / len(places) for k in range(2))
    size = math.hypot(x, y)
    return Vec3(x / size, y / size, 0.0) if size > 1e-6 else Vec3(1.0, 0.0, 0.0)


def _places(scenario: Scenario) -> list[Vec3]:
    """Places of the grasps in the order of the members."""
    assert scenario.team is not None
    assert scenario.world is not None
    there = {each.agent: each.place for each in scenario.world.grasps if each.body == scenario.team.object}
    return [there[each.agent] for each in scenario.team.members]


def onset(scenario: Scenario) -> float:
    """Time (s) at which wind rises, and at which a member is lost."""
    assert scenario.team is not None
    assert scenario.team.motion is not None
    lift, stop = (float(each) for each in (scenario.team.motion.lift, scenario.team.motion.stop))
    return round(lift + (min(stop, scenario.duration) - lift) * BEGIN, 3)
