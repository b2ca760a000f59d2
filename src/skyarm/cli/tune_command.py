"""``skyarm tune``: what it prints and writes."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.text import Text

from skyarm.cli.lines import say_if_many, say_unlikely
from skyarm.cli.machine_output import give
from skyarm.cli.progress import bar, waiting
from skyarm.cli.tune_report import plain_tuning, print_front
from skyarm.control.catalogue import choices, is_named, meant
from skyarm.files import read_toml, require_writable, shown, taken_back, write_atomically
from skyarm.registry.plugins import is_law_of_file, law_of_file_name
from skyarm.scenario.controller_table import is_gains_file
from skyarm.scenario.scenario_file import LIBRARY, list_scenarios, load_scenario
from skyarm.scenario.scenario_record import Scenario
from skyarm.scenario.unlikely_numbers import unlikely_numbers
from skyarm.vehicle.vehicle_files import list_vehicles, load_vehicle

GAINS, PAGE = "tuned.toml", "tune.html"
"""Names of the file of the pick, and of the page."""

FEWEST, MOST = 64, 100_000
"""Candidates."""

MOST_PLANTS = 1000


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """What is tuned: a scenario, the words of its law, gains that a file gave it, the law's label."""

    scenario: Scenario
    has_motion: bool
    words: dict[str, Any]
    kept: dict[str, Any]
    label: str
    name: str


def tune(
    target: str,
    controller: str | None,
    out: str | None,
    console: Console,
    *,
    candidates: int,
    plants: int,
    seed: int,
    threads: int,
    knobs: Sequence[str] | None,
) -> bool:
    """Tune, print the front, write the gains; False where no point meets the constraints.

    Raises:
        ValueError, OSError: one line.
    """
    for option, value, low, high in (
        ("--candidates", candidates, FEWEST, MOST),
        ("--plants", plants, 4, MOST_PLANTS),
        ("--seed", seed, 0, 2**31 - 1),
    ):
        if not low <= value <= high:
            raise ValueError(f"{option} = {value}: must be from {low} to {high}")
    wanted = wanted_of(target, controller)
    from skyarm.tune.candidate_flights import shortened
    from skyarm.tune.excitation import excited
    from skyarm.tune.front import POINTS
    from skyarm.tune.gain_search import Effort
    from skyarm.tune.law_knobs import find_knobs
    from skyarm.tune.tune_page import front_name, gains_text, tune_page
    from skyarm.tune.tuning import Plan
    from skyarm.tune.tuning import tune as perform

    scenario = wanted.scenario
    say_if_many(scenario.name, scenario.world.vehicle.n)
    say_unlikely(scenario.name, unlikely_numbers(scenario))
    scenario.controller.require_compiled("skyarm tune")
    flight, own = excited(scenario), excited(scenario, own_motion=True)
    plan = Plan(
        flight=flight,
        check=own if wanted.has_motion else flight,
        own=shortened(own) if wanted.has_motion else None,
        aside=excited(scenario, unseen=True),
        knobs=find_knobs(scenario.controller, scenario.controller.name, _paths(knobs)),
        effort=Effort().scaled(candidates, plants),
        seed=seed,
        label=wanted.label,
    )
    folder = Path("out") / f"tune_{wanted.name}" if out is None else Path(out)
    begin = time.perf_counter()
    with taken_back(folder), bar(f"{wanted.label} for {scenario.name}", console) as advance:
        require_writable(folder)
        found = perform(plan, folder, threads=threads, progress=advance)
    for i, point in enumerate(found.points):
        write_atomically(folder / front_name(i), gains_text(found, point, wanted.words, wanted.kept).encode())
    for stale in range(len(found.points), POINTS):
        (folder / front_name(stale)).unlink(missing_ok=True)
    write_atomically(folder / PAGE, tune_page(found).encode())
    write_atomically(folder / GAINS, gains_text(found, found.pick, wanted.words, wanted.kept).encode())
    print_front(found, console, time.perf_counter() - begin)
    console.print(f"written: {folder / GAINS}; the page of the front: {folder / PAGE}", soft_wrap=True)
    loads = f" --plugin {wanted.label.rpartition(':')[0]}" if is_law_of_file(wanted.label) else ""
    flown = target if wanted.has_motion else "SCENARIO"
    console.print(f"next: skyarm run {flown}{loads} --controller {folder / GAINS}", soft_wrap=True)
    give(plain_tuning(found), folder=folder, gains=folder / GAINS, page=folder / PAGE)
    return bool(found.meets)


def explain(target: str, controller: str | None, knobs: Sequence[str] | None, console: Console) -> None:
    """Print which part of the loop is short of margin, and what would help.

    Raises:
        ValueError: one line.
    """
    wanted = wanted_of(target, controller)
    from skyarm.tune.explain import explain as look
    from skyarm.tune.explain import plain, words
    from skyarm.tune.law_knobs import find_knobs

    scenario = wanted.scenario
    say_unlikely(scenario.name, unlikely_numbers(scenario))
    scenario.controller.require_compiled("skyarm tune")
    with waiting(f"{wanted.label} in {scenario.name}", console):
        found = look(scenario, find_knobs(scenario.controller, scenario.controller.name, _paths(knobs)))
    console.print(Text(f"{wanted.label} in {scenario.name}", style="bold"))
    for line in words(found):
        console.print(line, soft_wrap=True)
    give(plain(found), controller=wanted.label, scenario=scenario.name)


def _paths(knobs: Sequence[str] | None) -> list[str] | None:
    return None if knobs is None else [word for each in knobs for word in each.split(",") if word]


def wanted_of(target: str, controller: str | None) -> Wanted:
    """What is tuned for a scenario or a vehicle, by its name or file, with a law in place of its own.

    Raises:
        ValueError: one line.
    """
    from skyarm.tune.excitation import of_vehicle
    from skyarm.tune.tune_page import words_of

    if controller is not None and not is_named(controller) and not is_gains_file(controller):
        raise ValueError(
            f"--controller = {shown(controller)}: {meant(controller)}must be {choices(controller)}; or a .toml file"
        )
    if _is_vehicle(target):
        scenario = of_vehicle(load_vehicle(target), controller)
        words = words_of(controller or scenario.controller.name)
    else:
        scenario = load_scenario(target, controller=controller)
        table = _document(target).get("controller", {}) if controller is None else {}
        words = {name: value for name, value in table.items() if name not in ("safety", "servos")}
    kept: dict[str, Any] = {}
    file = controller if is_gains_file(controller) else words.get("tuned")
    if is_gains_file(file):
        path = Path(str(file)) if controller is not None else Path(target).parent / str(file)
        document = read_toml(path.read_bytes())
        words, kept = dict(document["law"]), dict(document.get("gains", {}))
    elif controller is not None:
        words = words_of(controller)
    label = str(words.get("preset", words.get("law")))
    return Wanted(
        scenario=scenario,
        has_motion=not _is_vehicle(target),
        words=words,
        kept=kept,
        label=label,
        name=f"{scenario.name}_{law_of_file_name(label)}",
    )


def _is_vehicle(target: str) -> bool:
    """Whether a name or file is that of a vehicle; a scenario's name comes first."""
    if target in list_scenarios():
        return False
    if target in list_vehicles() or Path(target).suffix in (".urdf", ".xacro", ".xml"):
        return True
    from skyarm.files.kinds_of_files import kind_of

    if Path(target).suffix != ".toml" or not Path(target).is_file():
        return False
    return kind_of(_document(target)) == "vehicle"


def _document(target: str) -> dict[str, Any]:
    """Tables of a scenario by its name or file; nothing of a log."""
    if target in list_scenarios():
        return read_toml((LIBRARY / f"{target}.toml").read_bytes())
    return read_toml(Path(target).read_bytes()) if Path(target).suffix == ".toml" else {}
