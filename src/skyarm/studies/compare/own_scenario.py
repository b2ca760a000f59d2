"""Comparison of controllers on a user's scenario."""

from __future__ import annotations

import dataclasses
import math
import warnings
from collections.abc import Mapping, Sequence
from itertools import chain

from skyarm.control.catalogue import OWN, require_different
from skyarm.log.metrics.metric_catalogue import GRASPS, metric_words
from skyarm.log.team_log import WITHIN
from skyarm.records.files import PathLike
from skyarm.records.identity import identity
from skyarm.records.immutable import immutable
from skyarm.records.registry import names
from skyarm.scenario.controller_table import OwnOptionsWarning
from skyarm.scenario.in_flight import stretches
from skyarm.scenario.scenario_file import as_scenario
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.draws import draws_needed
from skyarm.studies.compare.cell_flights import CellFlights, Document, Record
from skyarm.studies.compare.comparison import title_of
from skyarm.studies.compare.entrants import Entrant
from skyarm.studies.compare.run_suite import Pngs, Refused, SummarySuite
from skyarm.studies.compare.suite import Case, Condition
from skyarm.studies.trial.table import COLUMNS, TableColumn, refusals, report_of
from skyarm.view.pages import Report, Section, table_of

LAWS = (OWN, "paper_pd", "paper_ct", "centroidal_tip")
"""Default laws."""

AS_GIVEN = "given"
"""Name of the only condition: sensors, delays, air and forces of the file."""


@immutable
class GivenFlights(CellFlights):
    """Flights of a scenario as with ``skyarm run FILE --laws LAW``, one per noise
    seed.
    """

    given: Scenario | PathLike

    def scenario(self) -> Scenario:
        """Scenario of the user, in which the compared controller replaces the
        scenario's own controller.
        """
        return dataclasses.replace(
            # planning has warned
            _under(self.given, self.entrant.law, quiet=True).with_kind(self.plant),
            seed=self.seed,
        )


def _under(scenario: Scenario | PathLike, law: str, *, quiet: bool) -> Scenario:
    """Scenario under a law; if quiet, without the warning that the scenario's own
    options are lost.
    """
    with warnings.catch_warnings():
        if quiet:
            warnings.simplefilter("ignore", OwnOptionsWarning)
        return as_scenario(scenario, law)


def has_chance(scenario: Scenario) -> bool:
    """True if two flights of a scenario differ: by noise, turbulence or other random
    parts.
    """
    return any(
        draws_needed(stretch.overrides.of(scenario)) for stretch in stretches(scenario)
    )


@immutable
class OwnScenario(SummarySuite[GivenFlights]):
    """Comparison of several controllers on one scenario of the user.

    Attributes:
        scenario: scenario, or its file, or the name of a shipped one.
        laws: controllers that fly, any controllers; "own" is the scenario's.
        plant: kind of plant; the scenario's if left out. seeds: flights of each law, if
            the scenario has noise or random parts; else one.
        seed: seed of the noise; the scenario's if left out.
    """

    scenario: Scenario | PathLike
    laws: Sequence[str] = LAWS
    plant: str | None = None
    seeds: int = 8
    seed: int | None = None

    file = "results"

    @property
    def options(self) -> Document:
        """Kind of plant and seed of the flights."""
        own = as_scenario(self.scenario)
        return {
            "seed": own.seed if self.seed is None else self.seed,
            "plant": self.plant or own.kind,
        }

    @property
    def name(self) -> str:  # type: ignore[override]
        """Name of the compared scenario, as in its file."""
        return as_scenario(self.scenario).name

    def plan_cells(self) -> tuple[list[GivenFlights], Refused]:
        """Flights of each controller, and reasons why usual laws do not fly; a law that
        is named must fly.

        Every vehicle of several flies the law. An autopilot that is named with the
        file's own options flies once.

        Raises:
            ScenarioError: no such scenario, or a law that is none.
            ControllerError: two names of one law.
        """
        require_different(self.laws, "--laws")
        options = self.options
        own = as_scenario(self.scenario).with_kind(options["plant"])
        options |= {
            "case": Case(name=own.name),
            "condition": Condition(
                name=AS_GIVEN, episodes=self.seeds if has_chance(own) else 1
            ),
            "given": self.scenario,
        }
        # of the usual laws none was asked for by its name
        usual = tuple(self.laws) == LAWS
        flown, same = list[str](), list[str]()
        refused = dict[str, str]()
        for name in self.laws:
            if name == OWN:
                continue
            try:
                # refuses a name of no law before the first flight; where the file's
                # own options fly beside, no warning says that they are lost
                under = _under(self.scenario, name, quiet=OWN in self.laws)
            # of the usual laws those fly that fit; a law that was named must
            except ValueError as error:
                if not usual:
                    raise
                refused[name] = str(error)
                continue
            if identity(own) == identity(under.with_kind(own.kind)):
                same.append(name)
            if not usual or name not in same:
                flown.append(name)
        twice = own.autopilot is not None and own.agent.controller.name in same
        if OWN in self.laws and not twice:
            flown.insert(0, OWN)
        entrants = [Entrant(name=name, law=name) for name in flown]
        return [GivenFlights(entrant=each, **options) for each in entrants], refused

    def report(self, found: Record, pictures: Pngs = None) -> Report:
        """Comparison report with one table: a row per controller and vehicle, means
        over completed flights.
        """
        (case, laws), *_ = found["summaries"][AS_GIVEN].items()
        of_agents = {law: _of_agents(each["metrics"]) for law, each in laws.items()}
        agents = dict.fromkeys(chain.from_iterable(of_agents.values()))
        # the table of one vehicle has no column of names
        several = len(agents) > 1
        columns = [
            *COLUMNS["own"],
            *(
                TableColumn(head=f"{each.words}, {each.unit}", metric=name)
                for name, each in GRASPS.items()
                if several
            ),
            *(
                TableColumn(
                    head=", ".join(filter(None, metric_words(name))),
                    metric=name,
                    # nobody knows the size of a user's metric: three digits of any
                    fine=math.inf,
                )
                for name in names("metric", shipped=False)
            ),
        ]
        rows = [
            [
                *((law, agent) if several else (law,)),
                f"{each['completed']} of {each['episodes']}",
                *(column.text(of_agents[law].get(agent, {})) for column in columns),
            ]
            for law, each in laws.items()
            for agent in agents
        ]
        endings = []
        for law, each in laws.items():
            endings += [
                f"{law}: {ending} ({count} of {each['episodes']})"
                for ending, count in each["endings"].items()
                if ending != "completed"
            ]
        first = ("law", "agent") if several else ("law",)
        table = table_of(
            [*first, "completed", *(each.head for each in columns)],
            rows,
            left=len(first),
        )
        notes = [*refusals(found), *endings]
        name = "Means over the flights that came to their end"
        return report_of(
            f"{title_of(list(laws))}, {case} on {found['plant']}",
            f"seed {found['seed']}",
            [Section(name=name, notes=notes, tables=[table])],
        )


def _of_agents(metrics: Record) -> Mapping[str, Document]:
    """Statistics of the metrics by the name of their vehicle, empty for the only
    one.
    """
    agents: dict[str, Document] = {}
    for full, each in metrics.items():
        agent, _, name = full.rpartition(WITHIN)
        agents.setdefault(agent, {})[name] = each
    return agents
