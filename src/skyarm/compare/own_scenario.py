"""Laws side by side on a scenario of one's own, flown as its file describes it, on any plant."""

from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from skyarm.compare.cells import Cell, Flights
from skyarm.compare.columns import BASE, JOINT, TOOL
from skyarm.compare.comparison_tables import DASH, markdown, number, title_of
from skyarm.compare.entrants import Entrant
from skyarm.compare.fly_comparison import Progress, fly_all
from skyarm.compare.suite import Case, Condition
from skyarm.compare.summary import pairs, table
from skyarm.control.catalogue import require_different
from skyarm.files import write_atomically
from skyarm.registry import names
from skyarm.registry.plugins import identities
from skyarm.scenario.in_flight import stretches
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.draws import draws_needed
from skyarm.simulate.user_code import check_components, check_law

OWN = "own"
"""The scenario's own law, which flies first."""

LAWS = ("paper_pd", "paper_ct", "centroidal_tip")
"""What flies after it, where nobody chooses."""

AS_GIVEN = "given"
"""Name of the only condition: the file says sensors, delays, air and forces."""

COLUMNS: Sequence[tuple[str, str, float]] = (
    ("base, mm", BASE, 1e3),
    ("joints, mrad", JOINT, 1e3),
    ("tip, mm", TOOL, 1e3),
    ("rotor jitter, rad/s", "rotor_jitter", 1.0),
    ("largest tilt, deg", "tilt_max", 57.29577951308232),
)
"""Head, metric, factor from SI to the unit of the head; metrics of one's own follow in SI."""


@dataclass(frozen=True, kw_only=True)
class GivenFlights(Flights):
    """Flights of a scenario as ``skyarm run FILE --controller LAW`` flies it, one for each number of its noise.

    Attributes:
        controller: in place of the file's; None for its own.
    """

    controller: str | None = None

    @property
    def label(self) -> str:
        """Name of its file: a law may be called by the path of a file."""
        return re.sub(r"[^\w.() -]+", "-", super().label)

    def scenario(self) -> Scenario:
        """The scenario that every episode starts from."""
        found = load_scenario(self.case.scenario, plant=self.plant, controller=self.controller)
        return dataclasses.replace(found, seed=self.seed)


def own_flights(scenario: str, laws: Sequence[str] | None, *, plant: str, seeds: int, seed: int) -> list[GivenFlights]:
    """Cells of a comparison on a scenario.

    Args:
        scenario: file or name of a shipped one.
        laws: that fly after the scenario's own, any controllers; left out: :data:`LAWS`.
        plant: that flies.
        seeds: flights of each law, where the scenario has noise or chance in it; else one.
        seed: of the noise.

    Raises:
        ScenarioError: no such scenario, or a law that is none.
        ControllerError: two names of one law.
    """
    named = [law for law in (LAWS if laws is None else laws) if law != OWN]
    require_different(named, "--laws")
    own = load_scenario(scenario, plant=plant)
    case = Case(name=own.name, title=own.title, scenario=scenario)
    title = "the scenario as its file describes it"
    episodes = seeds if any(draws_needed(stretch.overrides.of(own)) for stretch in stretches(own)) else 1
    condition = Condition(name=AS_GIVEN, title=title, noisy=False, episodes=episodes, cases=(own.name,))
    chosen: dict[str, str | None] = {OWN: None, **{name: name for name in named}}
    found = [
        GivenFlights(
            entrant=Entrant(name=name, group="own", law=name),
            case=case,
            condition=condition,
            plant=plant,
            seed=seed,
            controller=controller,
        )
        for name, controller in chosen.items()
    ]
    for each in found:
        flown = each.scenario()
        check_components(flown)
        check_law(flown)
    return found


def fly_own(
    flights: Sequence[GivenFlights], folder: Path, *, threads: int = 1, progress: Progress | None = None
) -> dict[str, Any]:
    """Fly what is missing of a comparison, write results.json and tables.md, and return what the former holds."""
    cells: dict[tuple[str, str, str], Cell] = fly_all(flights, folder / "cells", threads=threads, progress=progress)
    first = flights[0]
    found: dict[str, Any] = {"schema": 1, "suite": first.case.name, "seed": first.seed, "plant": first.plant}
    found |= {"plugins": identities(), "summaries": table(cells), "paired": pairs(cells)}
    write_atomically(folder / "results.json", (json.dumps(found, indent=1, allow_nan=False) + "\n").encode())
    write_atomically(folder / "tables.md", own_report(found).encode())
    return found


def own_report(found: dict[str, Any]) -> str:
    """One table: a row per law, means over the flights that came to their end."""
    (case, laws), *_ = found["summaries"][AS_GIVEN].items()
    columns = [*COLUMNS, *((name, name, 1.0) for name in names("metric"))]
    rows = []
    for law, each in laws.items():
        cells = [_mean(each["metrics"].get(metric), factor) for _, metric, factor in columns]
        rows.append([law, f"{each['completed']} of {each['episodes']}", *cells])
    head = ["law", "completed", *(title for title, _, _ in columns)]
    return f"# {title_of(list(laws))}, {case} on {found['plant']}\n\n{markdown(head, rows)}\n"


def _mean(spread: dict[str, Any] | None, factor: float) -> str:
    return DASH if spread is None else number(spread["mean"] * factor)
