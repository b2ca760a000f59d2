"""Parallel simulation of all flights that reproduce Barakou et al. 2026, also with varied settings."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass, field
from typing import Any

from skyarm.paper.flights import Flight, Metrics, flights, fly, metrics
from skyarm.paper.inferred_settings import INFERRED, PREDICTED, measure_inferred, settings_in, shipped_evidence
from skyarm.paper.published import Record
from skyarm.paper.variations import variation, variations
from skyarm.records.immutable import immutable
from skyarm.simulate import Log
from skyarm.simulate.workers import Progress
from skyarm.simulate.workers import workers as spread

Sensitivity = dict[str, dict[str, dict[str, dict[str, Metrics]]]]
"""group -> value -> case -> controller -> metrics."""


@immutable(kw_only=False)
class Job:
    """One flight to simulate, described by plain values that can be sent to another process.

    Attributes:
        flight: case, law and plant. group, value: of a variation. kind, settings: inferred or predicted settings.
    """

    flight: Flight
    group: str = ""
    value: str = ""
    kind: str = ""
    settings: tuple[tuple[str, Any], ...] = ()

    @property
    def label(self) -> str:
        """Description of one flight for a progress bar."""
        words = f"{self.flight.case} {self.flight.controller} {self.flight.plant}"
        more = [f"{self.group} {self.value}" if self.group else "", self.kind and f"{self.kind} settings"]
        return ", ".join([words, *filter(None, more)])


@dataclass(slots=True)
class Campaign:
    """Results of all flights that reproduce Barakou et al. 2026: logs and metrics.

    Attributes:
        logs: plant -> case -> law -> log of the paper's flights. sensitivity: metrics under variations.
        found: kind -> (case, law, plant) -> metrics under inferred settings.
    """

    logs: dict[str, dict[str, dict[str, Log]]] = field(default_factory=dict)
    sensitivity: Sensitivity = field(default_factory=dict)
    found: dict[str, dict[tuple[str, str, str], Metrics]] = field(default_factory=dict)

    def metrics_by_cell(self) -> dict[tuple[str, str, str], Metrics]:
        """Metrics of the flights with published settings: (case, controller, plant) -> metrics."""
        return {
            (case, controller, plant): metrics(case, log)
            for plant, cases in self.logs.items()
            for case, controllers in cases.items()
            for controller, log in controllers.items()
        }

    def all_logs(self) -> list[Log]:
        """Flight logs of all cases of Barakou et al. 2026."""
        return [log for cases in self.logs.values() for pair in cases.values() for log in pair.values()]

    def keep(self, job: Job, result: Any) -> None:
        """Store the result of one simulated flight."""
        case, law, plant = job.flight.case, job.flight.controller, job.flight.plant
        if job.kind:
            self.found.setdefault(job.kind, {})[case, law, plant] = result
        elif job.group:
            self.sensitivity.setdefault(job.group, {}).setdefault(job.value, {}).setdefault(case, {})[law] = result
        else:
            self.logs.setdefault(plant, {}).setdefault(case, {})[law] = result


def perform(job: Job) -> Log | Metrics:
    """Simulate one flight; returns its log, or its metrics if settings are changed."""
    if job.kind:
        return measure_inferred(job.flight, dict(job.settings))
    if not job.group:
        return fly(job.flight)
    return metrics(job.flight.case, fly(job.flight, variation(job.group, job.value).change))


def inferred_jobs(plants: Sequence[str], evidence: Record) -> list[Job]:
    """Flights to simulate with inferred settings, and with settings predicted from some cases."""
    return [
        Job(flight, kind=kind, settings=tuple(settings_in(evidence, kind).items()))
        for kind, flown in ((INFERRED, plants), (PREDICTED, plants[:1]))
        for flight in flights(flown)
    ]


def run_campaign(
    plants: Sequence[str],
    *,
    sensitivity: bool = True,
    evidence: Record | None = None,
    inferred: bool = True,
    workers: int = 1,
    progress: Progress | None = None,
) -> Campaign:
    """Simulate all flights of the reproduction; results do not depend on the number of workers.

    Args:
        plants: "rigid_body", "mujoco" or both; variations are flown on the first.
        sensitivity: fly the variations too.
        evidence: with the inferred settings; the package's own if left out.
        inferred: fly them.
        workers: processes; 1 flies in this one.
        progress: called after every episode.
    """
    chosen, campaign = variations() if sensitivity else [], Campaign()
    jobs = [Job(flight) for flight in flights(plants)]
    jobs += [
        Job(flight, each.group, each.value)
        for each in chosen
        if each.change is not None
        for flight in flights(plants[:1])
        if flight.case in each.cases
    ]
    jobs += inferred_jobs(plants, evidence or shipped_evidence()) if inferred else []
    # in the order of the report, whichever flies first
    campaign.sensitivity = {each.group: {} for each in chosen}
    for each in chosen:
        campaign.sensitivity[each.group][each.value] = {}
    for job, result in _perform_all(jobs, workers, progress).items():
        campaign.keep(job, result)
    for each in chosen:
        for case in each.cases if each.change is None else ():
            for law, log in campaign.logs[plants[0]][case].items():
                campaign.keep(Job(Flight(case, law, plants[0]), each.group, each.value), metrics(case, log))
    return campaign


def _perform_all(jobs: Sequence[Job], workers: int, progress: Progress | None) -> dict[Job, Any]:
    """Simulate flights, in parallel if there are several workers; results in the given order."""
    done: dict[Job, Any] = {}

    def note(job: Job, result: Any) -> None:
        done[job] = result
        if progress is not None:
            progress(len(done), len(jobs), job.label)

    if workers <= 1:
        for job in jobs:
            note(job, perform(job))
        return done
    with spread(workers) as submit:
        futures = {submit(perform, job): job for job in jobs}
        for future in as_completed(futures):
            note(futures[future], future.result())
    return {job: done[job] for job in jobs}
