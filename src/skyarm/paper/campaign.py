"""All flights of the reproduction, on as many processes as asked, with progress."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

from skyarm.compare.cells import Cell
from skyarm.compile.llvm.kernel import require_machine_code
from skyarm.paper.beyond_paper import Beyond, HarderJob, beyond_jobs, centroidal_flights, fly_harder
from skyarm.paper.flights import Flight, Metrics, flights, fly, metrics
from skyarm.paper.inferred_settings import InferredJob, inferred_jobs, shipped_evidence
from skyarm.paper.published import CONTROLLERS
from skyarm.paper.variations import Variation, variation, variations
from skyarm.simulate import Log
from skyarm.simulate.workers import workers as spread

Progress = Callable[[int, int, str], None]
"""Called with (jobs done, jobs in all, what was done last)."""

Sensitivity = dict[str, dict[str, dict[str, dict[str, Metrics]]]]
"""group -> value -> case -> controller -> metrics."""


@dataclass(slots=True)
class Effort:
    """What the flights took.

    Attributes:
        wall: s from the first take-off to the last landing, with the start of the processes.
        seconds: by plant, the s of each flight in its process: read, fly, measure.
    """

    wall: float = 0.0
    seconds: dict[str, list[float]] = field(default_factory=dict)

    def words(self) -> str:
        """One line for people."""
        plants = ", ".join(f"{len(each)} on {plant} {sum(each):.1f} s" for plant, each in self.seconds.items())
        count = sum(len(each) for each in self.seconds.values())
        return f"{count} flights in {self.wall:.1f} s; summed over processes: {plants}"


@dataclass(frozen=True, slots=True)
class Job:
    """One episode, plain (group and value empty) or under a variation."""

    flight: Flight
    group: str = ""
    value: str = ""

    @property
    def plant(self) -> str:
        """That it flies on."""
        return self.flight.plant

    @property
    def label(self) -> str:
        """In words, for a progress bar."""
        words = f"{self.flight.case} {self.flight.controller} {self.flight.plant}"
        return f"{words}, {self.group} {self.value}" if self.group else words


AnyJob = Job | HarderJob | InferredJob


@dataclass(slots=True)
class Campaign:
    """What came out: a log per flight, metrics per variation and under found settings, flights beyond the paper."""

    logs: dict[str, dict[str, dict[str, Log]]] = field(default_factory=dict)
    sensitivity: Sensitivity = field(default_factory=dict)
    effort: Effort = field(default_factory=Effort)
    beyond: Beyond = field(default_factory=Beyond)
    found: dict[str, dict[tuple[str, str, str], Metrics]] = field(default_factory=dict)

    def measured(self) -> dict[tuple[str, str, str], Metrics]:
        """Metrics by (case, controller, plant)."""
        return {
            (case, controller, plant): metrics(case, log)
            for plant, cases in self.logs.items()
            for case, controllers in cases.items()
            for controller, log in controllers.items()
        }

    def all_logs(self) -> list[Log]:
        """Every log."""
        return [log for cases in self.logs.values() for pair in cases.values() for log in pair.values()]

    def _file(self, group: str, value: str, flight: Flight, found: Metrics) -> None:
        cases = self.sensitivity.setdefault(group, {}).setdefault(value, {})
        cases.setdefault(flight.case, {})[flight.controller] = found


def perform(job: AnyJob) -> Log | Metrics | Cell:
    """Fly one job: the log of a plain flight, the metrics of a varied one, the cell of one of the comparison."""
    if isinstance(job, InferredJob):
        return job.perform()
    if isinstance(job, HarderJob):
        return fly_harder(job)
    if not job.group:
        return fly(job.flight)
    varied = variation(job.group, job.value)
    return varied.measure(job.flight.case, fly(job.flight, varied.change))


def _timed(work: Callable[[AnyJob], Any], job: AnyJob) -> tuple[Any, float]:
    """What a job gives and the seconds it takes."""
    begun = perf_counter()
    return work(job), perf_counter() - begun


def run_campaign(
    plants: Sequence[str],
    *,
    sensitivity: bool = True,
    beyond: bool = True,
    evidence: Mapping[str, Any] | None = None,
    inferred: bool = True,
    workers: int = 1,
    progress: Progress | None = None,
) -> Campaign:
    """Fly everything. Results do not depend on the number of workers.

    Args:
        plants: "rigid_body", "mujoco" or both; variations are flown on the first.
        sensitivity: fly the variations too.
        beyond: fly the centroidal law beside the paper's, on the comparison's cases, too.
        evidence: whose inferred settings fly; the package's own if left out.
        inferred: fly them.
        workers: processes; 1 flies in this one.
        progress: called after every episode.

    Raises:
        NoMachineCodeError: before any flight; those beyond the paper fly in batches.
    """
    if beyond:
        require_machine_code()
    plain = [Job(flight) for flight in flights(plants)]
    chosen = variations() if sensitivity else []
    varied = [
        Job(flight, each.group, each.value)
        for each in chosen
        if each.change is not None
        for flight in flights(plants[:1])
        if flight.case in each.cases
    ]
    exact = [Job(flight) for flight in centroidal_flights(plants)] if beyond else []
    harder = beyond_jobs() if beyond else []
    settled = inferred_jobs(plants, evidence or shipped_evidence()) if inferred else []
    campaign = Campaign()
    begun = perf_counter()
    done = _perform_all([*plain, *varied, *settled, *exact, *harder], workers, progress, campaign.effort)
    campaign.effort.wall = perf_counter() - begun
    for job in plain:
        cases = campaign.logs.setdefault(job.flight.plant, {}).setdefault(job.flight.case, {})
        cases[job.flight.controller] = done[job]
    for job in varied:
        campaign._file(job.group, job.value, job.flight, done[job])
    for job in exact:
        campaign.beyond.logs.setdefault(job.flight.plant, {})[job.flight.controller] = done[job]
    for one in settled:
        where = one.flight.case, one.flight.controller, one.flight.plant
        campaign.found.setdefault(one.kind, {})[where] = done[one]
    for cell in harder:
        campaign.beyond.cells[cell.condition, cell.case, cell.entrant] = done[cell]
    for each in chosen:
        if each.change is None:
            _measure_again(campaign, each, plants[0])
    order = {each.group: None for each in chosen}
    campaign.sensitivity = {
        group: {each.value: campaign.sensitivity[group][each.value] for each in chosen if each.group == group}
        for group in order
    }
    return campaign


def _measure_again(campaign: Campaign, varied: Variation, plant: str) -> None:
    """A variation that changes only how the plain flights are measured."""
    for case in varied.cases:
        for controller in CONTROLLERS:
            log = campaign.logs[plant][case][controller]
            campaign._file(varied.group, varied.value, Flight(case, controller, plant), varied.measure(case, log))


def _perform_all(
    jobs: Sequence[AnyJob], workers: int, progress: Progress | None, effort: Effort | None = None
) -> dict[AnyJob, Any]:
    done: dict[AnyJob, Any] = {}
    effort = effort or Effort()

    def note(job: AnyJob, timed: tuple[Any, float]) -> None:
        done[job], seconds = timed
        effort.seconds.setdefault(job.plant, []).append(seconds)
        if progress is not None:
            progress(len(done), len(jobs), job.label)

    if workers <= 1:
        for job in jobs:
            note(job, _timed(perform, job))
        return done
    with spread(workers) as submit:
        futures = {submit(_timed, perform, job): job for job in jobs}
        for future in as_completed(futures):
            note(futures[future], future.result())
    return done
