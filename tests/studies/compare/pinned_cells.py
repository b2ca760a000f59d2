"""Digests of the cells of every suite: what each would fly, on five vehicles and three
teams, under every law.

``python tests/studies/compare/pinned_cells.py --write`` writes
``tests/data/suite_cells.json`` anew; with the name of a row in its place, such as
``envelope-suite/hexarotor_arm6/indi``, it prints the digest of each cell of it.

A cell is a scenario, columns of numbers, noise keys and metrics in windows
(:class:`skyarm.studies.flights.Work`). Nothing flies: two cells of one digest fly the
same, whatever describes them. Numbers count with nine digits, for processors whose
linear algebra rounds otherwise. Every law is there on two of the vehicles, the usual
ones on all.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from skyarm.records.plain import digest, plain
from skyarm.records.registry import names
from skyarm.studies.compare.comparison import SUITE, Comparison
from skyarm.studies.compare.contact_suite import CONTACT, ContactSuite
from skyarm.studies.compare.contact_tasks import LAWS as PRESSING
from skyarm.studies.compare.entrants import ENTRANTS
from skyarm.studies.compare.envelope import ENVELOPE, Envelope
from skyarm.studies.compare.envelope import LAWS as USUAL
from skyarm.studies.compare.run_suite import Suite
from skyarm.studies.compare.survive import LAWS as SIMPLER
from skyarm.studies.compare.survive import SURVIVE, SurviveSuite
from skyarm.studies.compare.team_suite import FLOWN, TEAM, TeamSuite
from skyarm.studies.compare.team_suite import LAWS as OF_TEAMS
from skyarm.studies.flights import Work

FILE = Path(__file__).resolve().parents[2] / "data" / "suite_cells.json"

VEHICLES = (
    *(
        "hummingbird_arm2_rotors",
        "hexarotor_arm6",
        "octo_coaxial_two_arms",
        "quadrotor_roll_arm2",
    ),
    "hexacopter680_flying_arm_2",
)
TEAMS = (FLOWN, "three_on_a_triangle", "two_hold_a_bar")
EVERY = tuple(dict.fromkeys((*USUAL, *SIMPLER, *names("law"))))


def rows() -> Iterator[tuple[str, Any]]:
    """Row of the file, and what makes its suite; the whole envelope and all of what
    laws survive have rows, too.
    """
    for name, entrant in ENTRANTS.items():
        yield f"{SUITE}/{name}", partial(Comparison, entrants={name: entrant})
    for k, law in enumerate(EVERY):
        for vehicle in (
            VEHICLES
            if law in ("centroidal_tip", "indi_tuned")
            else (VEHICLES[0], VEHICLES[1 + k % 4])
        ):
            yield (
                f"{ENVELOPE}/{vehicle}/{law}",
                partial(Envelope, laws=(law,), vehicle=vehicle, quick=True),
            )
            yield (
                f"{SURVIVE}/{vehicle}/{law}",
                partial(SurviveSuite, laws=(law,), vehicle=vehicle, quick=True),
            )
    for law in dict.fromkeys((*PRESSING, *names("law"))):
        yield f"{CONTACT}/{law}", partial(ContactSuite, laws=(law,), worlds=16)
    for team in TEAMS:
        for law in OF_TEAMS:
            yield f"{TEAM}/{team}/{law}", partial(TeamSuite, laws=(law,), scenario=team)
    yield f"{ENVELOPE}/whole", partial(Envelope, laws=USUAL)
    yield f"{SURVIVE}/whole", partial(SurviveSuite, laws=SIMPLER)


ROWS: Mapping[str, Any] = dict(rows())


LATER = {"Dryden": "least_airspeed"} | dict.fromkeys(
    ("ObjectWrench", "LeaderFollower", "Decentralised", "Team"), "com"
)
"""Class of a record -> field that it did not have yet when the digests were taken."""


LATER_METRICS = ("collision_force",)
"""Metrics that suites did not measure yet when the digests were taken."""


MOVED = {"skyarm.world.team.virtual_masses:Member": "skyarm.world.team.team:Member"}
"""Class of a record -> where it stood when the digests were taken."""


def short(data: Any) -> Any:
    """Plain data with numbers of nine digits, those below 1e-12 as none, without fields
    of ``LATER``.
    """
    match data:
        case dict():
            later = LATER.get(str(data.get("type")).rpartition(":")[2])
            return {name: short(each) for name, each in data.items() if name != later}
        case str() if data in MOVED:
            return MOVED[data]
        case list():
            return [short(each) for each in data]
        case float() if math.isfinite(data):
            return float(f"{data:.9g}") if abs(data) > 1e-12 else 0.0
    return data


SCENARIOS: dict[int, tuple[Any, str]] = {}
"""Digests of scenarios by address; flights of a trial share one."""


def of_scenario(scenario: Any) -> str:
    """Digest of all data of a scenario, titles included."""
    if id(scenario) not in SCENARIOS:
        SCENARIOS[id(scenario)] = scenario, digest(short(plain(scenario)))
    return SCENARIOS[id(scenario)][1]


def of_cell(work: Work) -> str:
    """Digest of all that the numbers of a cell's flights depend on but versions and
    code.
    """
    columns = {
        path: short(np.asarray(column).tolist())
        for path, column in (*work.columns.items(), *work.fixed.items())
    }
    facts = {
        "metrics": [each for each in work.metrics if each not in LATER_METRICS],
        "windows": short(plain(work.windows)),
        "alone": work.alone,
    }
    scenarios = [
        of_scenario(each) for each in (work.scenario, work.stiffest) if each is not None
    ]
    return digest(
        facts
        | {
            "scenarios": scenarios,
            "keys": work.episodes.tolist(),
            "columns": columns,
        }
    )


def cells(name: str) -> tuple[dict[str, str], dict[str, str]]:
    """Digest of each cell of a row by its label, and why others do not fly."""
    suite: Suite[Any] = ROWS[name]()
    try:
        planned, refused = suite.plan_cells()
    except ValueError as error:
        return {}, {"all": str(error)}
    return {each.label: of_cell(each.work()) for each in planned}, dict(refused)


def of_row(name: str) -> str:
    """Number of cells and of refusals of a row, and a digest of all."""
    flown, refused = cells(name)
    return (
        f"{len(flown)} {len(refused)}"
        f" {digest({'cells': flown, 'refused': refused})[:16]}"
    )


if __name__ == "__main__":
    if sys.argv[1:] == ["--write"]:
        FILE.write_text(
            json.dumps({name: of_row(name) for name in ROWS}, indent=1) + "\n", "utf-8"
        )
    elif sys.argv[1:] and sys.argv[1] in ROWS:
        print(json.dumps(cells(sys.argv[1]), indent=1))
    else:
        raise SystemExit(__doc__)
