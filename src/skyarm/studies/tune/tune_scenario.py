"""Gain tuning for a vehicle or a scenario, from Python: what is flown, and the search."""

from __future__ import annotations

from collections.abc import Sequence

from skyarm.records.files import PathLike
from skyarm.scenario.scenario_file import as_scenario, is_scenario
from skyarm.scenario.scenario_record import Scenario
from skyarm.studies.flights.executor import LOCAL, Progress, require_place
from skyarm.studies.tune import tuning
from skyarm.studies.tune.candidate_flights import shorten
from skyarm.studies.tune.excitation import of_vehicle, tuning_flight
from skyarm.studies.tune.gain_search import Effort
from skyarm.studies.tune.law_knobs import find_knobs
from skyarm.studies.tune.tuning import Plan, Tuning
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.vehicle.vehicle_records import Vehicle

BOUNDS = {"candidates": (64, 100_000), "plants": (4, 1000), "seed": (0, 2**31 - 1)}
"""Number -> its smallest and largest value."""


def require_size(candidates: int, plants: int, seed: int, prefix: str = "") -> None:
    """Raise an error if the size of a search is out of bounds; ``prefix`` stands before the name of the number."""
    for (name, (low, high)), value in zip(BOUNDS.items(), (candidates, plants, seed), strict=True):
        if not low <= value <= high:
            raise ValueError(f"{prefix}{name} = {value}: must be from {low} to {high}")


def tune(
    what: Vehicle | Scenario | PathLike,
    controller: str | None = None,
    *,
    candidates: int = 1640,
    plants: int = 24,
    knobs: Sequence[str] | None = None,
    seed: int = 0,
    workers: int = 1,
    on: str = LOCAL,
    folder: PathLike | None = None,
    progress: Progress | None = None,
) -> Tuning:
    """Tune a law's gains for a vehicle, as ``skyarm tune`` does; ``controller`` of the result has the selected ones.

    Args:
        what: a scenario or a vehicle, or the name or path of one.
        controller: name of the law, in place of the scenario's.
        candidates: sets of gains that are tried.
        plants: perturbed plants that each of them flies.
        knobs: paths of the constants of the law that may change; all gains if left out.
        seed: of plants, noise and search.
        workers: threads or processes that fly; results do not depend on it.
        on: "local", "processes", "ray" or "ray:HOST:PORT".
        folder: keeps the rows of all flights where pyarrow is installed, so that an interrupted search goes on.
        progress: called with (done, all, stage).

    Raises:
        ValueError: one line: what cannot be read or tuned, a number out of bounds, or a folder that another search
            writes into.
        OSError: the folder cannot be written.
    """
    require_place(on)
    require_size(candidates, plants, seed)
    if isinstance(what, Vehicle) or not (isinstance(what, Scenario) or is_scenario(str(what))):
        moves, scenario = False, of_vehicle(what if isinstance(what, Vehicle) else load_vehicle(what), controller)
    else:
        moves, scenario = True, as_scenario(what, controller)
    label = controller or scenario.controller.name
    plan = plan_of(scenario, moves, label, knobs, Effort().scale(candidates, plants), seed)
    return tuning.tune(plan, workers=workers, on=on, folder=folder, progress=progress)


def plan_of(
    scenario: Scenario, moves: bool, label: str, knobs: Sequence[str] | None, effort: Effort, seed: int
) -> Plan:
    """Plan of a tuning for a scenario.

    Args:
        scenario: its law is tuned.
        moves: whether its own reference is flown, too.
        label: name of the law.
        knobs: paths of the constants that may change; all gains for None.
        effort: size of the search.
        seed: of plants, noise and search.
    """
    scenario.controller.require_compiled("skyarm tune")
    flight, own = tuning_flight(scenario), tuning_flight(scenario, own_motion=True)
    return Plan(
        flight=flight,
        check=own if moves else flight,
        own=shorten(own) if moves else None,
        aside=tuning_flight(scenario, unseen=True),
        knobs=find_knobs(scenario.controller, scenario.controller.name, knobs),
        effort=effort,
        seed=seed,
        label=label,
    )
