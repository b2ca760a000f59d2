"""All flights of the reproduction, on as many processes as asked for, with progress."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

from skyarm.compare.cells import Cell, Flights
from skyarm.compare.cells import fly as fly_cell
from skyarm.compare.entrants import ENTRANTS
from skyarm.compare.run_suite import Progress
from skyarm.compare.suite import CASES, PAPER_CASES, conditions
from skyarm.compile.llvm.kernel import require_machine_code
from skyarm.paper.flights import Flight, Metrics, flights, fly, metrics
from skyarm.paper.inferred_settings import INFERRED, PREDICTED, measure_inferred, settings_in, shipped_evidence
from skyarm.paper.published import CONTROLLERS
from skyarm.paper.variations import Variation, variation, variations
from skyarm.simulate import Log
from skyarm.simulate.workers import workers as spread

Sensitivity = dict[str, dict[str, dict[str, dict[str, Metrics]]]]
"""group -> value -> case -> controller -> metrics."""

WIND = "case3_wind"
LAWS = ("paper_pd", "paper_ct", "centroidal_joint", "centroidal_tip")
"""Entrants of the comparison that fly beyond the paper, in order."""

HARDER = (*PAPER_CASES, "case3_wind_45", "case3_wind_side")
"""Cases of the comparison that they fly."""

COLUMNS = ("perfect", "noisy")
"""Conditions under which they do."""

EXACT = {"centroidal_joint": "centroidal_joint_stiff", "centroidal_tip": "centroidal_tip_stiff"}
"""Entrant -> the preset that it flies with perfect state."""


@dataclass(slots=True)
class Effort:
    """Time of the flights.

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
    """One flight, by values that travel to another process.

    Attributes:
        flight: case, law and plant; with ``condition`` the law is an entrant of the comparison.
        group, value: of a variation. condition: of the comparison. kind, settings: of found settings.
    """

    flight: Flight
    group: str = ""
    value: str = ""
    condition: str = ""
    kind: str = ""
    settings: tuple[tuple[str, Any], ...] = ()

    @property
    def label(self) -> str:
        """In words, for a progress bar."""
        words = f"{self.flight.case} {self.flight.controller} {self.flight.plant}"
        more = [
            f"{self.group} {self.value}" if self.group else "",
            self.condition,
            self.kind and f"{self.kind} settings",
        ]
        return ", ".join([words, *filter(None, more)])


@dataclass(slots=True)
class Campaign:
    """Everything that was flown.

    Attributes:
        logs: plant -> case -> law -> log of the paper's flights. sensitivity: metrics under variations.
        found: kind -> (case, law, plant) -> metrics under found settings.
        cells: (condition, case, entrant) -> flights beyond the paper.
        exact: plant -> preset -> log of the centroidal law in the wind.
        effort: time that it took.
    """

    logs: dict[str, dict[str, dict[str, Log]]] = field(default_factory=dict)
    sensitivity: Sensitivity = field(default_factory=dict)
    found: dict[str, dict[tuple[str, str, str], Metrics]] = field(default_factory=dict)
    cells: dict[tuple[str, str, str], Cell] = field(default_factory=dict)
    exact: dict[str, dict[str, Log]] = field(default_factory=dict)
    effort: Effort = field(default_factory=Effort)

    def measured(self) -> dict[tuple[str, str, str], Metrics]:
        """Metrics by (case, controller, plant)."""
        return {
            (case, controller, plant): metrics(case, log)
            for plant, cases in self.logs.items()
            for case, controllers in cases.items()
            for controller, log in controllers.items()
        }

    def all_logs(self) -> list[Log]:
        """Every log of the paper's flights."""
        return [log for cases in self.logs.values() for pair in cases.values() for log in pair.values()]

    def in_the_wind(self) -> dict[str, dict[str, Log]]:
        """Plant -> entrant -> log of Case 3 in constant wind, the paper's laws first."""
        named = {entrant: law for law, entrant in CONTROLLERS.items() if entrant in LAWS}
        return {
            plant: {
                **{name: self.logs[plant][WIND][named[name]] for name in LAWS if name in named},
                **{name: exact[preset] for name, preset in EXACT.items()},
            }
            for plant, exact in self.exact.items()
        }

    def keep(self, job: Job, result: Any) -> None:
        """File the result of a job."""
        case, law, plant = job.flight.case, job.flight.controller, job.flight.plant
        if job.condition:
            self.cells[job.condition, case, law] = result
        elif job.kind:
            self.found.setdefault(job.kind, {})[case, law, plant] = result
        elif job.group:
            self.sensitivity.setdefault(job.group, {}).setdefault(job.value, {}).setdefault(case, {})[law] = result
        elif law in EXACT.values():
            self.exact.setdefault(plant, {})[law] = result
        else:
            self.logs.setdefault(plant, {}).setdefault(case, {})[law] = result


def perform(job: Job) -> Log | Metrics | Cell:
    """Fly one job: the log of a plain flight, the cell of one of the comparison, the metrics of any other."""
    flight = job.flight
    if job.condition:
        return fly_cell(beyond_flights(job))
    if job.kind:
        return measure_inferred(flight, dict(job.settings))
    if not job.group:
        return fly(flight)
    varied = variation(job.group, job.value)
    return varied.measure(flight.case, fly(flight, varied.change))


def beyond_flights(job: Job) -> Flights:
    """The flights of a job beyond the paper, the very ones of the comparison."""
    entrant, case = ENTRANTS[job.flight.controller], CASES[job.flight.case]
    return Flights(entrant=entrant, case=case, condition=conditions()[job.condition])


def beyond_jobs(plants: Sequence[str]) -> list[Job]:
    """Flights beyond the paper: the centroidal law in the wind on each plant, and every cell that the report shows."""
    exact = [Job(Flight(WIND, preset, plant)) for plant in plants for preset in EXACT.values()]
    harder = [
        Job(Flight(case, name, "rigid_body"), condition=condition)
        for condition in COLUMNS
        for case in HARDER
        for name in LAWS
    ]
    return [*exact, *harder]


def inferred_jobs(plants: Sequence[str], evidence: Mapping[str, Any]) -> list[Job]:
    """Every flight of the paper with the inferred settings; with the predicted ones on the first plant."""
    return [
        Job(flight, kind=kind, settings=tuple(settings_in(evidence, kind).items()))
        for kind, flown in ((INFERRED, plants), (PREDICTED, plants[:1]))
        for flight in flights(flown)
    ]


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
        beyond: fly the centroidal law and the paper's on the comparison's cases, too.
        evidence: whose inferred settings fly; the package's own if left out.
        inferred: fly them.
        workers: processes; 1 flies in this one.
        progress: called after every episode.

    Raises:
        NoMachineCodeError: before any flight; those beyond the paper fly in batches.
    """
    if beyond:
        require_machine_code()
    chosen = variations() if sensitivity else []
    jobs = [Job(flight) for flight in flights(plants)]
    jobs += [
        Job(flight, each.group, each.value)
        for each in chosen
        if each.change is not None
        for flight in flights(plants[:1])
        if flight.case in each.cases
    ]
    jobs += inferred_jobs(plants, evidence or shipped_evidence()) if inferred else []
    jobs += beyond_jobs(plants) if beyond else []
    campaign = Campaign()
    begun = perf_counter()
    done = _perform_all(jobs, workers, progress, campaign.effort)
    campaign.effort.wall = perf_counter() - begun
    for job in jobs:
        campaign.keep(job, done[job])
    for each in chosen:
        if each.change is None:
            _measure_again(campaign, each, plants[0])
    groups = dict.fromkeys(each.group for each in chosen)
    campaign.sensitivity = {
        group: {each.value: campaign.sensitivity[group][each.value] for each in chosen if each.group == group}
        for group in groups
    }
    return campaign


def _measure_again(campaign: Campaign, varied: Variation, plant: str) -> None:
    """A variation that changes only how the plain flights are measured."""
    for case in varied.cases:
        for law, log in campaign.logs[plant][case].items():
            campaign.keep(Job(Flight(case, law, plant), varied.group, varied.value), varied.measure(case, log))


def _timed(work: Callable[[Job], Any], job: Job) -> tuple[Any, float]:
    """The result of a job and the seconds it takes."""
    begun = perf_counter()
    return work(job), perf_counter() - begun


def _perform_all(
    jobs: Sequence[Job], workers: int, progress: Progress | None, effort: Effort | None = None
) -> dict[Job, Any]:
    done: dict[Job, Any] = {}
    effort = effort or Effort()

    def note(job: Job, timed: tuple[Any, float]) -> None:
        done[job], seconds = timed
        effort.seconds.setdefault(job.flight.plant, []).append(seconds)
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
