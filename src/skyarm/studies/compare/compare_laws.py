"""Comparison of laws on a scenario or a suite, from Python."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from skyarm.control.catalogue import is_named, must_be_named, require_different
from skyarm.records.files import must_be_one_of, require_writable, shown
from skyarm.records.immutable import immutable
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.workers import Progress
from skyarm.studies.compare.comparison import SUITE, Comparison
from skyarm.studies.compare.contact_suite import CONTACT, ContactSuite
from skyarm.studies.compare.contact_tasks import OWN
from skyarm.studies.compare.entrants import ENTRANTS, own_entrant
from skyarm.studies.compare.envelope import ENVELOPE, Envelope
from skyarm.studies.compare.own_scenario import OwnScenario
from skyarm.studies.compare.run_suite import Document, Suite, fly_suite
from skyarm.view.pages import Report, section

SUITES: dict[str, Any] = {SUITE: Comparison, ENVELOPE: Envelope, CONTACT: ContactSuite}


@immutable
class ComparisonResults:
    """Results of a comparison.

    Attributes:
        folder: of its files. document: content of its JSON file. report: its tables; ``markdown()`` of it is text.
    """

    folder: Path
    document: Document
    report: Report

    def _repr_html_(self) -> str:
        return section(self.report.title, "".join(each.html() for each in self.report.sections))


def compare(
    what: Scenario | str | os.PathLike[str] = SUITE,
    laws: Sequence[str] | None = None,
    out: str | os.PathLike[str] = "out/compare",
    *,
    workers: int = 1,
    progress: Progress | None = None,
    **options: Any,
) -> ComparisonResults:
    """Compare laws on a scenario or on a suite of trials, as ``skyarm compare`` does; the same call continues.

    Args:
        what: a scenario, the name or path of one, or "paper-suite", "envelope-suite", "contact-suite".
        laws: names of controllers; the usual ones of the suite if left out.
        out: folder of the results.
        workers: threads; results do not depend on it.
        progress: called with (done, all, the last).
        options: seed, plant; of a scenario seeds (noisy flights); of a suite fields of its class, such as quick.

    Raises:
        ValueError: one line. OSError: a file cannot be written.
    """
    if laws is not None:
        require_different(laws, "laws")
        entrants = {name: ENTRANTS.get(name) or own_entrant(name) for name in laws}
        for name in laws:
            if what == SUITE and not entrants[name]:
                raise ValueError(f"laws = {shown(name)}: {must_be_one_of(ENTRANTS, name)}")
            if what != SUITE and name not in OWN and not is_named(name):
                raise ValueError(f"laws = {shown(name)}: {must_be_named(name)}")
        options |= {"entrants": entrants} if what == SUITE else {"laws": tuple(laws)}
    kind = SUITES.get(str(what))
    suite: Suite[Any] = OwnScenario(scenario=what, **options) if kind is None else kind(**options)
    document = fly_suite(suite, require_writable(out), threads=workers, progress=progress)
    return ComparisonResults(folder=Path(out), document=document, report=suite.report(document))
