"""Flights beyond the paper: its controllers and the centroidal law on its cases, with perfect state and with noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from skyarm.compare.cells import Cell, Flights, fly
from skyarm.compare.columns import BASE, JOINT, TOOL
from skyarm.compare.entrants import ENTRANTS, Entrant
from skyarm.compare.suite import CASES, PAPER_CASES, Condition, conditions
from skyarm.compare.summary import table
from skyarm.metrics.score import score
from skyarm.metrics.windows import Windows
from skyarm.paper.flights import STEADY, Flight
from skyarm.simulate import Log

LAWS = ("paper_pd", "paper_ct", "centroidal_joint", "centroidal_tip")
"""Entrants of the comparison, in order."""

HARDER = (*PAPER_CASES, "case3_wind_45", "case3_wind_side")
"""Cases of the comparison, in order."""

COLUMNS = ("perfect", "noisy")
"""Conditions of the comparison."""

WIND = "case3_wind"

EXACT = {"centroidal_joint": "centroidal_joint_stiff", "centroidal_tip": "centroidal_tip_stiff"}
"""Entrant -> the preset that it flies with perfect state."""

PAPERS = {"paper_pd": "PD", "paper_ct": "CT"}
"""Entrant -> the controller as the paper names it."""


@dataclass(frozen=True, slots=True)
class HarderJob:
    """One cell of the comparison, by names that travel to another process."""

    condition: str
    case: str
    entrant: str

    @property
    def plant(self) -> str:
        """That it flies on."""
        return "rigid_body"

    @property
    def label(self) -> str:
        """In words, for a progress bar."""
        return f"{self.case} {self.entrant} {self.condition}"


@dataclass(slots=True)
class Beyond:
    """What came out: cells by (condition, case, entrant), logs of the centroidal law in the wind by plant, preset."""

    cells: dict[tuple[str, str, str], Cell] = field(default_factory=dict)
    logs: dict[str, dict[str, Log]] = field(default_factory=dict)

    def summaries(self) -> dict[str, Any]:
        """By condition, case, entrant, as the comparison writes them."""
        return table(self.cells)


def laws() -> dict[str, Entrant]:
    """Who flies."""
    return {name: ENTRANTS[name] for name in LAWS}


def columns() -> dict[str, Condition]:
    """Under what."""
    every = conditions()
    return {name: every[name] for name in COLUMNS}


def planned(job: HarderJob) -> Flights:
    """The flights of a job, the very ones of the comparison."""
    return Flights(entrant=ENTRANTS[job.entrant], case=CASES[job.case], condition=conditions()[job.condition])


def beyond_jobs() -> list[HarderJob]:
    """Every cell that the report shows."""
    return [HarderJob(condition, case, name) for condition in COLUMNS for case in HARDER for name in LAWS]


def fly_harder(job: HarderJob) -> Cell:
    """Fly one."""
    return fly(planned(job))


def centroidal_flights(plants: Sequence[str]) -> list[Flight]:
    """The centroidal law in the wind with perfect state, for a log on each plant."""
    return [Flight(WIND, preset, plant) for plant in plants for preset in EXACT.values()]


def in_the_wind(beyond: Beyond, logs: Mapping[str, Mapping[str, Mapping[str, Log]]]) -> dict[str, dict[str, Log]]:
    """Plant -> entrant -> log of Case 3 in constant wind; ``logs`` are those of the paper's controllers."""
    return {
        plant: {
            **{name: logs[plant][WIND][controller] for name, controller in PAPERS.items()},
            **{name: exact[preset] for name, preset in EXACT.items()},
        }
        for plant, exact in beyond.logs.items()
    }


def errors(log: Log) -> dict[str, float]:
    """Base, joints and tip of a flight as the comparison counts them; NaN for one that ended before its time."""
    if log.status != "completed":
        return dict.fromkeys((BASE, JOINT, TOOL), float("nan"))
    return score(log, (BASE, JOINT, TOOL), Windows(steady=STEADY))
