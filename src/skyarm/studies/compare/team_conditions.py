"""Conditions of the team suite: entries and numbers in which each differs from the
scenario file of any team.

What is wrong with one member is wrong with the last one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import field, replace
from typing import TYPE_CHECKING

import numpy as np

from skyarm.records.arrays import AnyArray as Array
from skyarm.records.arrays import Columns
from skyarm.records.immutable import immutable
from skyarm.reference.signals import Constant, Shifted, Signal, with_signals
from skyarm.scenario.scenario_record import Scenario
from skyarm.studies.compare.cell_flights import Document, Record
from skyarm.studies.compare.suite import Condition, library_rows
from skyarm.studies.sweep.design import Design, values
from skyarm.studies.sweep.distributions import distribution_from
from skyarm.studies.trial.trial import with_entries

if TYPE_CHECKING:
    from skyarm.world.contact.contact import Contact
    from skyarm.world.contact.free_object import FreeObject
    from skyarm.world.contact.grasp import Grasp
    from skyarm.world.team.team import Team

ROWS: Mapping[str, Record] = {row["name"]: row for row in library_rows("team_rows")}
"""Condition -> its fields; left out, its flights are those of the suite, and all laws
fly it."""

BEGIN = 5.0 / 17.0
"""Part of the time from the lift until the body stands, after which wind rises and a
member is lost: at 8 s of the shipped scenario."""

DAMPING = math.sqrt(0.96)
"""Factor on the damping of a grasp whose stiffness is another, beside the root of that
factor: the shipped 15 N s/m are rounded up from 0.6 sqrt(0.06 kg 10 000 N/m)."""


@immutable
class TeamCondition(Condition):
    """Condition of the team suite.

    Attributes:
        own: title for scenarios of users, where it is another.
        tables: entries of the scenario's file in place of its own; a table for a list
            goes into each of its tables.
        last: entries of the last member's table.
        off: distance by which its grasp is farther from the middle of all grasps than
            the team supposes, m.
        late: time by which its path is late, s.
        rotor: effectiveness of its first rotor.
        lost: true if its grasp opens in flight.
        stiffness: factor on the stiffness of all grasps.
        wind: force on each vehicle along world x and y, N.
        vary: numbers of each flight: "masses", "off", "stiffness", "wind", "rotor" ->
            distribution, as in a study.
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
        if "kind" in self.tables.get("world", {}).get("grasps", {}) and kinds != {
            "ball"
        }:
            return f"takes ball grasps, not {' and '.join(sorted(kinds))}"
        if "off" in self.vary and "cable" in kinds:
            return "takes arms: paths at cables are planned before the flight"
        return ""

    def change_document(self, document: Document, given: CarryingTeam) -> Document:
        """Scenario file with the entries of the condition in place of its own.

        Args:
            document: tables of the file.
            given: team that it describes.
        """
        changed = with_entries(document, self.tables)
        world = changed["world"]
        own = changed["agents"][given.last]
        entries: Document = {
            "agents": {given.last: {**self.last}},
            "world": {},
            "team": {},
        }
        if self.stiffness != 1.0 or self.lost:
            entries["world"]["grasps"] = [
                self._grasp(each, given) for each in world["grasps"]
            ]
        if "masses" in self.vary:
            # the lightest body fixes the integration steps; the team supposes that of
            # the file
            # to a microgram: the product has digits that nobody stated
            least = {
                "mass": round(
                    float(given.body.mass) * self.vary["masses"]["uniform"][0], 9
                )
            }
            named = given.body.name
            entries["world"]["objects"] = [
                b | (least if b["name"] == named else {}) for b in world["objects"]
            ]
            entries["team"]["mass"] = float(given.team.mass)
        if self.off:
            stated = {
                each["agent"]: each for each in document["team"].get("members", [])
            }
            entries["team"]["members"] = [
                {"agent": each.agent, "place": [*map(float, each.place)]}
                | stated.get(each.agent, {})
                for each in given.team.members
            ]
            # to a nanometre, as the place is written into a scenario file
            supposed = given.places[-1] - self.off * given.outward
            entries["team"]["members"][-1]["place"] = np.round(supposed, 9).tolist()
        if self.wind:
            # the wind sets in over 0.5 s, chosen
            ramp = {"kind": "ramp", "start": given.onset, "duration": 0.5}
            push = {
                "kind": "disturbance",
                "force": [
                    *(ramp | {"height": f} if f else 0.0 for f in self.wind),
                    0.0,
                ],
            }
            entries["environment"] = {
                "forces": [*changed.get("environment", {}).get("forces", []), push]
            }
        if self.rotor != 1.0:
            rotor = given.scenario.agents[given.last].plant.vehicle.rotors[0].name
            fault = {"rotor": rotor, "effectiveness": self.rotor}
            entries["agents"][given.last]["faults"] = [*own.get("faults", []), fault]
        return with_entries(changed, entries)

    def _grasp(self, entry: Record, given: CarryingTeam) -> Document:
        """Table of a grasp with the stiffness of the condition, and with the time at
        which the last member's opens.
        """
        changed = dict(entry)
        own = given.grasps.get(entry["agent"])
        if own is None or entry["body"] != own.body:
            return changed
        if self.stiffness != 1.0:
            changed["stiffness"] = float(own.stiffness) * self.stiffness
            # three digits, as the number is written into a scenario file
            changed["damping"] = float(
                f"{float(own.damping) * DAMPING * math.sqrt(self.stiffness):.3g}"
            )
        return changed | (
            {"release": given.onset} if self.lost and own.agent == given.last else {}
        )

    def change_path(self, scenario: Scenario, last: str) -> Scenario:
        """Scenario in which the path of a named member is late."""
        if not self.late:
            return scenario

        def later(signal: Signal) -> Signal:
            # a constant is the same at any time
            return (
                signal if isinstance(signal, Constant) else Shifted(signal, self.late)
            )

        agent = scenario.agents[last]
        agent = replace(agent, reference=with_signals(agent.reference, later))
        return replace(scenario, agents={**scenario.agents, last: agent})

    def columns(self, scenario: Scenario, given: CarryingTeam, seed: int) -> Columns:
        """Numbers of the flights, the same for every law: parameter path -> values
        (flights,).

        Args:
            scenario: scenario of the condition.
            given: the team before its changes.
            seed: seed of the draws.
        """
        name = given.body.name
        agents = scenario.agents
        last = f"agents.{given.last}"
        # a draw for each vehicle and the body, and for each axis of the wind; else one,
        # whose name ends with the underscore
        several = {"masses": [*agents, name], "wind": ["x", "y"]}
        spread = {
            f"{each}_{part}": table
            for each, table in self.vary.items()
            for part in several.get(each, [""])
        }
        vary = {path: distribution_from(table, path) for path, table in spread.items()}
        draws = Design(vary=vary, episodes=self.episodes, seed=seed)
        drawn = values(draws, np.arange(self.episodes))
        found = Columns()
        if "masses" in self.vary:
            found[f"world.objects.{name}.mass"] = (
                float(given.body.mass) * drawn[f"masses_{name}"]
            )
            for agent in agents:
                vehicle = agents[agent].plant.vehicle
                at = f"agents.{agent}.plant.vehicle"
                bodies = {"base": vehicle.base} | {
                    f"links.{link.name}.body": link.body for link in vehicle.links
                }
                found |= {
                    f"{at}.{path}.mass": float(b.mass) * drawn[f"masses_{agent}"]
                    for path, b in bodies.items()
                }
        if "off" in self.vary:
            for k in np.flatnonzero(given.outward):
                off = given.outward[k] * drawn["off_"]
                found[f"team.members.{len(given.places) - 1}.place.{'xyz'[k]}"] = (
                    given.places[-1][k] + off
                )
                found |= {
                    # the ramp in the member's path, from the true place of its grasp to
                    # the supposed
                    f"{last}.reference.tip.{axis}.place.{k}.signals.1.height": off
                    for axis in "xyz"
                }
        if "stiffness" in self.vary:
            factor = drawn["stiffness_"]
            for i, own in enumerate(given.contact.grasps):
                if own.body == name:
                    found[f"world.grasps.{i}.stiffness"] = float(own.stiffness) * factor
                    found[f"world.grasps.{i}.damping"] = (
                        float(own.damping) * DAMPING * np.sqrt(factor)
                    )
        if "wind" in self.vary:
            at = f"environment.forces.{len(scenario.environment.forces) - 1}.force"
            found |= {f"{at}.{axis}.height": drawn[f"wind_{axis}"] for axis in "xy"}
        if "rotor" in self.vary:
            number = len(agents[given.last].faults) - 1
            found[f"{last}.environment.faults.{number}.effectiveness"] = drawn["rotor_"]
        return found


@immutable(slots=False)
class CarryingTeam:
    """Team of a scenario before the changes of a condition."""

    scenario: Scenario
    team: Team
    contact: Contact

    @property
    def last(self) -> str:
        """Name of the last member."""
        return self.team.members[-1].agent

    @property
    def body(self) -> FreeObject:
        """Body that the team carries."""
        return next(
            each for each in self.contact.objects if each.name == self.team.object
        )

    @property
    def grasps(self) -> dict[str, Grasp]:
        """Grasps of the body by the names of their vehicles."""
        return {
            each.agent: each
            for each in self.contact.grasps
            if each.body == self.team.object
        }

    @property
    def places(self) -> Array:
        """Places (members, 3) of the grasps, m, axes of the body from its middle."""
        return np.array(
            [[*map(float, self.grasps[each.agent].place)] for each in self.team.members]
        )

    @property
    def outward(self) -> Array:
        """Horizontal unit vector (3,), axes of the body, from the middle of all grasps
        to the last member's.
        """
        off = (self.places[-1] - self.places.mean(axis=0)) * [1.0, 1.0, 0.0]
        size = np.linalg.norm(off)
        # a member in the middle of all has no way outward: along x
        return off / size if size > 1e-6 else np.array([1.0, 0.0, 0.0])

    @property
    def onset(self) -> float:
        """Time (s) at which wind rises, and at which a member is lost."""
        assert self.team.motion is not None
        lift = float(self.team.motion.lift)
        stop = min(float(self.team.motion.stop), self.scenario.duration)
        # to a millisecond, since the time is written into a scenario file
        return round(lift + (stop - lift) * BEGIN, 3)
