"""Comparison of laws on a scenario or a suite, from Python."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from skyarm.records.files import PathLike
from skyarm.records.immutable import immutable
from skyarm.scenario.controller_table import is_gains_file
from skyarm.scenario.scenario_file import kind_of_file
from skyarm.scenario.scenario_record import Scenario
from skyarm.studies.compare.cell_flights import Document
from skyarm.studies.compare.comparison import SUITE, Comparison
from skyarm.studies.compare.contact_suite import CONTACT, ContactSuite
from skyarm.studies.compare.contact_tasks import OWN
from skyarm.studies.compare.entrants import chosen_entrants, chosen_laws
from skyarm.studies.compare.envelope import Envelope
from skyarm.studies.compare.own_scenario import OwnScenario
from skyarm.studies.compare.run_suite import Suite, fly_suite
from skyarm.studies.compare.suite_file import load_suite
from skyarm.studies.compare.survive import SurviveSuite
from skyarm.studies.compare.team_suite import TeamSuite
from skyarm.studies.flights.executor import Progress
from skyarm.view.pages import Report, section

SUITES: dict[str, type[Suite[Any]]] = {
    suite.name: suite
    for suite in (Comparison, Envelope, SurviveSuite, ContactSuite, TeamSuite)
}


@immutable
class ComparisonResults:
    """Results of a comparison of control laws on a scenario or on a suite of trials.

    Attributes:
        folder: folder of its files. document: content of its JSON file.
        report: report of its tables; ``markdown()`` of it is text.
    """

    folder: Path
    document: Document
    report: Report

    def _repr_html_(self) -> str:
        return section(
            self.report.title, "".join(each.html() for each in self.report.sections)
        )


def compare(
    what: Scenario | PathLike = SUITE,
    laws: Sequence[str] | None = None,
    out: PathLike = "out/compare",
    *,
    workers: int = 1,
    on: str | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> ComparisonResults:
    """Compare laws on a scenario or a suite, as ``skyarm compare`` does; a repeated
    call resumes a stopped comparison.

    Args:
        what: a scenario, the name or path of one, or "paper-suite", "envelope-suite",
            "survive-suite", "contact-suite", "team-suite", or the file of a suite.
        laws: names of controllers; the usual ones of the suite if left out.
        out: folder of the results.
        workers: threads or processes that fly; results do not depend on it.
        on: "local", "processes", "ray" or "ray:HOST:PORT"; for more cells than workers
            processes, if left out.
        progress: called with (done, all, the last).
        options: seed, plant; of a scenario seeds (noisy flights); of a suite fields of
            its class, such as quick.

    Raises:
        ValueError: one line. OSError: a file cannot be written.
    """
    names = [laws] if isinstance(laws, str) else laws
    suite = suite_of(what, names, "laws", **options)
    document = fly_suite(suite, out, workers=workers, on=on, progress=progress)
    return ComparisonResults(
        folder=Path(out), document=document, report=suite.report(document)
    )


def suite_of(
    what: Scenario | PathLike,
    names: Sequence[str] | None,
    field: str,
    /,
    **options: Any,
) -> Suite[Any]:
    """Comparison of laws on a scenario or on a suite of trials, before its flights are
    simulated.

    Args:
        what: a scenario, the name or path of one, a name of ``SUITES``, or the file of
            a suite.
        names: names of controllers; None for the usual ones of the comparison, or those
            of ``options``.
        field: field of the names, in messages.
        options: fields of the comparison.

    Raises:
        ValueError: one line: a name of no law, or two names of one.
    """
    kind = SUITES.get(str(what))
    file = (
        None
        if kind or isinstance(what, Scenario) or kind_of_file(str(what)) != "suite"
        else what
    )
    if names is not None and kind is Comparison:
        options["entrants"] = chosen_entrants(names, field)
    elif names is not None:
        # of an own scenario any controller flies; of a user's suite its scenarios' own
        # law and files of gains besides the registered laws
        of_suite = ("own", *filter(is_gains_file, names))
        # parts of the scenario's own law are names in the contact suite alone
        own = OWN if what == CONTACT else () if kind else of_suite if file else names
        options["laws"] = names if kind is TeamSuite else chosen_laws(names, field, own)
    if file:
        return load_suite(file, **options)
    return OwnScenario(scenario=what, **options) if kind is None else kind(**options)
