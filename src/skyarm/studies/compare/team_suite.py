"""Benchmark of the laws of a team: two vehicles with arms carry a bar under conditions
that trouble them.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

from skyarm.log.metrics.metric_catalogue import TEAMS
from skyarm.records.arrays import Columns
from skyarm.records.files import PathLike, file_name, must_be_one_of, shown
from skyarm.records.files.names import read_named
from skyarm.records.immutable import immutable
from skyarm.records.leaves import field_names
from skyarm.records.registry import find
from skyarm.scenario.scenario_file import LIBRARY, load_scenario, scenario_from
from skyarm.scenario.scenario_record import Scenario
from skyarm.studies.compare.cell_flights import CellFlights, Document, Record
from skyarm.studies.compare.entrants import Entrant
from skyarm.studies.compare.run_suite import Pngs, Refused, SummarySuite
from skyarm.studies.compare.suite import Case, library_rows
from skyarm.studies.compare.team_conditions import ROWS, CarryingTeam, TeamCondition
from skyarm.studies.trial.table import COLUMNS, report_of
from skyarm.studies.trial.trial import NOISE, NOISY, with_entries
from skyarm.view.pages import Report, Section, table_of

TEAM, FLOWN = "team-suite", "two_carry_a_bar"

LAWS: Mapping[str, Record] = {row.pop("name"): row for row in library_rows("team_laws")}
"""Law of a team -> entries of the scenario's file in place of its own."""


@immutable(slots=False)
class TeamFlights(CellFlights):
    """Flights of one law of a team under one condition.

    Attributes:
        given: name or path of the scenario.
    """

    condition: TeamCondition
    given: PathLike = FLOWN

    further_metrics = (*TEAMS, "joint_saturation")

    def scenario(self) -> Scenario:
        """Scenario with the entries of law and condition, without noise and delays of
        its own.
        """
        document, folder = read_named(
            file_name(self.given, "scenario"), "scenario", LIBRARY
        )
        given = team_of(scenario_from(document, folder), str(self.given))
        law = self.entrant.law
        tables: Document = {"plant": {"kind": self.plant}}
        if self.condition.noisy:
            # of the carried body
            measured = {
                "position_noise": NOISE.position,
                "attitude_noise": NOISE.attitude,
            }
            tables |= {**NOISY, "team": measured}
        changed = with_entries(under_law(without_noise(document), law), tables)
        changed = self.condition.change_document(changed, given)
        late = self.condition.change_path(scenario_from(changed, folder), given.last)
        return dataclasses.replace(late, seed=self.seed)

    def values(self, scenario: Scenario) -> Columns:
        """Numbers of the flights, the same for every law: parameter path -> values
        (flights,).
        """
        if not self.condition.vary:
            return {}
        return self.condition.columns(
            scenario, team_of(load_scenario(self.given), str(self.given)), self.seed
        )


def without_noise(document: Record) -> Document:
    """Scenario file without sensors, delays, and noise and age of the body's motion:
    those are of the conditions.
    """

    def without_words(table: Record) -> Document:
        return {
            key: entry
            for key, entry in table.items()
            if key not in ("sensors", "delays")
        }

    team = {
        key: entry
        for key, entry in document["team"].items()
        if not key.endswith("_noise") and key != "pose_age"
    }
    agents = {name: without_words(table) for name, table in document["agents"].items()}
    return without_words(document) | {"agents": agents, "team": team}


def under_law(document: Document, law: str) -> Document:
    """Scenario file under a law of the suite; the law of the file keeps the options of
    the file.
    """
    if document["team"]["law"] == law:
        return document
    entries = dict(LAWS[law])
    # entries that the other law has no option for are left out
    options = field_names(find("team", law)) or ()
    team = {
        key: entry for key, entry in document["team"].items() if key in options
    } | entries.pop("team")
    own = {
        name: entries
        for name, table in document["agents"].items()
        if "controller" in table
    }
    return with_entries(document | {"team": team}, {**entries, "agents": own})


@immutable
class TeamSuite(SummarySuite[TeamFlights]):
    """Benchmark of several laws of a team.

    Attributes:
        laws: names. rows: names of conditions, in order. seeds: flights of each
            condition with chance.
        scenario: name or path of the scenario.
        seed: seed of draws and noise. plant: kind of plant.
    """

    laws: Sequence[str] = tuple(LAWS)
    rows: Sequence[str] = tuple(ROWS)
    scenario: PathLike = FLOWN
    seeds: int = 8
    seed: int = 0
    plant: str = "rigid_body"

    name, file, folder = TEAM, "team", "out/team"
    settings = ("seeds", "seed", "plant")

    def plan_cells(self) -> tuple[list[TeamFlights], Refused]:
        """All flights of the benchmark, and why conditions, or laws under them, do not
        fly.

        Raises:
            ValueError: a name of none, a scenario without a team whose grasps close in
                flight, or nothing to fly.
        """
        for chosen, there in ((self.laws, LAWS), (self.rows, ROWS)):
            for name in chosen:
                if name not in there:
                    raise ValueError(
                        f"{TEAM}: {shown(name)}: {must_be_one_of(there, name)}"
                    )
        if str(self.scenario).endswith(".npz"):
            raise ValueError(
                f"{self.scenario}: must be a scenario (.toml), whose conditions {TEAM}"
                " changes, not a log"
            )
        own = load_scenario(self.scenario)
        given = team_of(own, str(self.scenario))
        case = Case(name=own.name)
        planned = list[TeamFlights]()
        refused = dict[str, str]()
        for name in self.rows:
            row = {"episodes": self.seeds, **ROWS[name]}
            # a condition may be of some laws, or of a plant, alone
            laws = row.pop("laws", tuple(LAWS))
            plant = row.pop("plant", self.plant)
            condition = TeamCondition(**row)
            if why := condition.refusal(given.team):
                refused[name] = why
                continue
            flown = [law for law in laws if law in self.laws]
            if not flown:
                refused[name] = f"is of {', '.join(laws)} alone"
            for law in flown:
                cell = TeamFlights(
                    entrant=Entrant(name=law, law=law),
                    case=case,
                    condition=condition,
                    plant=plant,
                    seed=self.seed,
                    given=self.scenario,
                )
                # only a user's scenario may not fit; the shipped one is built when it
                # flies
                if why := "" if self.scenario == FLOWN else unfit(cell):
                    refused[f"{name} {law}"] = why
                else:
                    planned.append(cell)
        if not planned:
            raise ValueError(
                f"{TEAM}: {'; '.join(f'{name} {why}' for name, why in refused.items())}"
            )
        return planned, refused

    def report(self, found: Record, pictures: Pngs = None) -> Report:
        """Report of the benchmark with one table: a row per condition and law."""
        # rows of a scenario of the user's own bear a title without the shipped numbers
        word = "title" if self.scenario == FLOWN else "own"
        rows = []
        for row, cases in found["summaries"].items():
            title = ROWS[row].get(word, ROWS[row]["title"])
            # a suite of a team flies one scenario, which is its only case
            ((case, laws),) = cases.items()
            rows += [
                [
                    title,
                    law,
                    f"{each['success']} of {each['episodes']}",
                    *(column.text(each["metrics"]) for column in COLUMNS["team"]),
                ]
                for law, each in laws.items()
            ]
        notes = [
            f"not flown: {name} {why}"
            for name, why in found.get("not_flown", {}).items()
        ]
        table = table_of(
            ["condition", "law", "placed", *(each.head for each in COLUMNS["team"])],
            rows,
            left=2,
        )
        return report_of(
            f"Laws of a team, {case} on {found['plant']}",
            f"{found['seeds']} flights, seed {found['seed']}",
            [
                Section(
                    name="Flights that came to their end", notes=notes, tables=[table]
                )
            ],
        )


def team_of(scenario: Scenario, name: str) -> CarryingTeam:
    """Team of a scenario whose grasps close in flight.

    Args:
        scenario: scenario of a file.
        name: name of the file, in messages.

    Raises:
        ValueError: one line; it has no such team.
    """
    if scenario.team is None or scenario.world is None:
        raise ValueError(
            f"{name}: team: must be stated for {TEAM}, whose laws share a load"
        )
    given = CarryingTeam(scenario=scenario, team=scenario.team, contact=scenario.world)
    if not any(each.closes for each in given.grasps.values()):
        at = f"world.grasps.close of {shown(scenario.team.object)}"
        raise ValueError(
            f"{name}: {at}: must be above 0 in one of them for {TEAM}, whose members"
            " take hold in flight"
        )
    return given


def unfit(flights: TeamFlights) -> str:
    """Reason why the scenario of a user cannot be that of a law under a condition;
    empty if it can.
    """
    try:
        flights.scenario()
    except ValueError as error:
        return str(error)
    return ""
