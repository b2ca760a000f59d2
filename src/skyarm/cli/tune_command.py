"""Command ``skyarm tune``: gains of a control law for a vehicle, or options of the law
of a team.
"""

from __future__ import annotations

import os
import shlex
import time
from dataclasses import field
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from skyarm.cli.arguments import (
    Flying,
    Law,
    On,
    OptionalOut,
    names_of,
    one_law,
    shipped_names,
    workers,
)
from skyarm.cli.lines import NOT_COMPLETED, say, say_suspicious
from skyarm.cli.output import bar, give, plugin_facts, tell, tell_report
from skyarm.control.catalogue import OWN
from skyarm.records.files import (
    must_be_one_of,
    read_toml,
    require_replaceable,
    require_writable,
    shown,
    taken_back,
    write_atomically,
)
from skyarm.records.files.earlier_files import edits_kept
from skyarm.records.immutable import positional
from skyarm.records.registry.plugins import is_law_of_file, law_of_file_name
from skyarm.scenario.controller_table import LAYERS, is_gains_file
from skyarm.scenario.save import Tables, law_entry, save_scenario
from skyarm.scenario.scenario_file import LIBRARY, kind_of_file, load_scenario
from skyarm.scenario.scenario_record import Scenario
from skyarm.vehicle.vehicle_files import load_vehicle

if TYPE_CHECKING:
    from skyarm.studies.tune.front import Point

GAINS, PAGE, BEST = "tuned.toml", "tune.html", "best.toml"
"""File names: gains of the pick, page, and scenario with the picked law."""


def tune(
    target: str,
    laws: Law = None,
    out: OptionalOut = None,
    candidates: int | None = None,
    plants: int | None = None,
    knobs: list[str] | None = None,
    seed: int = 0,
    flying: Flying = 0,
    on: On = None,
) -> None:
    """Tune a vehicle's or a team's law; write the Pareto front.

    best.toml is the scenario under the picked law. The same command continues what was
    interrupted. Exit code 3 if no gains meet the margins.

    Options:
        target SCENARIO|VEHICLE: a file (.toml) or the name of a shipped one
        out FOLDER: folder of the results; out/tune_... if left out
        candidates: sets of gains that are tried, in whole rounds, 132 or more; left
            out: 1640, of a team 234
        plants: perturbed plants that each candidate flies; left out: 24, of a team 8
        knobs PATH: gain or option of the law that may change; repeat; all if left out
        seed: seed of plants, noise and search
    """
    from skyarm.studies.tune.tuning import (
        effort_of,
        plan_of,
        require_size,
        subject_of,
        tune_plan,
    )

    require_size(candidates, plants, seed, "--")
    # imported after the sizes were checked, so that a wrong number is refused at once
    from skyarm.studies.flights.executor import LOCAL, require_place

    place, count = require_place(LOCAL if on is None else on, "--on"), workers(flying)
    inputs = tuning_inputs(target, one_law(laws))
    from skyarm.studies.flights.store import ROWS, require_parquet
    from skyarm.studies.tune.front import POINTS
    from skyarm.studies.tune.tune_page import (
        front_lines,
        front_name,
        gains_text,
        plain_tuning,
        tune_page,
    )

    scenario = inputs.scenario
    say_suspicious(scenario)
    effort = effort_of(subject_of(scenario), candidates, plants)
    plan = plan_of(
        scenario,
        inputs.has_motion,
        inputs.label,
        names_of("--knobs", knobs) or None,
        effort,
        seed,
    )
    folder = Path("out") / f"tune_{inputs.name}" if out is None else Path(out)
    begin = time.perf_counter()
    try:
        require_parquet()
    except ValueError as error:
        say(f"this search cannot be resumed: {error}")
    with (
        taken_back(folder, folder / ROWS),
        bar(f"{inputs.label} for {scenario.name}") as advance,
    ):
        require_writable(folder)
        # all files are checked before the search, which takes long
        files = (GAINS, PAGE, BEST, *map(front_name, range(POINTS)))
        require_replaceable(*(folder / name for name in files))
        tuning = tune_plan(
            plan, workers=count, on=place, folder=folder, progress=advance
        )
    has_gains, law = plan.subject.has_gains_file, one_law(laws)

    def save(file: Path, point: Point) -> Path | None:
        if not has_gains:
            return _save_scenario(file, tuning.under(scenario, point), target, law)
        write_atomically(
            file, gains_text(tuning, point, inputs.law_table, inputs.kept).encode()
        )
        return file

    for i, point in enumerate(tuning.points):
        save(folder / front_name(i), point)
    # files of an earlier, longer front would be taken for this one's
    for stale in range(len(tuning.points), POINTS):
        (folder / front_name(stale)).unlink(missing_ok=True)
    write_atomically(folder / PAGE, tune_page(tuning).encode())
    gains = save(folder / GAINS, tuning.pick) if has_gains else None
    best = (
        _save_scenario(folder / BEST, tuning.under(scenario, tuning.pick), target, law)
        if inputs.has_motion
        else None
    )
    tell_report(front_lines(tuning, time.perf_counter() - begin))
    if tuning.pick.margins.why_none and "margins" in plan.subject.columns(plan.flight):
        say(f"margins are not asked for: {tuning.pick.margins.why_none}")
    if not tuning.meets:
        say(
            "no point meets all constraints; the pick is the one that is least short of"
            " them"
        )
    plugin = shlex.quote(inputs.label.rpartition(":")[0])
    loads = f" --plugin {plugin}" if is_law_of_file(inputs.label) else ""
    flown = shlex.quote(str(target)) if inputs.has_motion else "SCENARIO"
    tell(
        f"written: {gains or best or 'no scenario'}; the page of the front:"
        f" {folder / PAGE}",
        *(
            []
            if gains is None
            else [f"next: skyarm run {flown}{loads} --laws {shlex.quote(str(gains))}"]
        ),
        *(
            []
            if best is None
            else [
                "the scenario under them, with all digits: skyarm run"
                f" {shlex.quote(str(best))}"
            ]
        ),
    )
    give(
        plain_tuning(tuning),
        **plugin_facts(),
        folder=folder,
        gains=gains,
        page=folder / PAGE,
        best=best,
    )
    if not tuning.meets:
        raise typer.Exit(NOT_COMPLETED)


def _save_scenario(
    file: Path, scenario: Scenario, target: str, law: str | None
) -> Path | None:
    """Write a scenario under tuned gains; None, with a message, if no file can
    represent it.
    """
    with edits_kept(file):
        try:
            return save_scenario(file, scenario, target, law)
        except ValueError as error:
            # a search of minutes is done, and its page has all gains
            say(f"no scenario under the picked law is written: {error}")
            return None


@positional
class TuningInputs:
    """Inputs of a gain tuning.

    Attributes:
        scenario: scenario that is flown.
        label: law that is tuned, or the options of a team's.
        has_motion: False for a vehicle, whose scenario is made for the search.
        law_table: options of the law. kept: gains that were tuned before.
    """

    scenario: Scenario
    label: str
    has_motion: bool = True
    law_table: Tables = field(default_factory=dict)
    kept: Tables = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Name of the folder of the results."""
        return f"{self.scenario.name}_{law_of_file_name(self.label)}"


def tuning_inputs(target: str, controller: str | None) -> TuningInputs:
    """Load the inputs of a gain tuning from a scenario or vehicle and an optional
    control law.

    Raises:
        ValueError: one line.
    """
    from skyarm.studies.tune.excitation import of_vehicle
    from skyarm.studies.tune.tuning import subject_of

    of_a_vehicle, names = _is_vehicle(target), shipped_names("scenario")
    if controller == OWN:
        if of_a_vehicle:
            raise ValueError(f"--laws = {OWN!r}: a vehicle has no law of its own")
        controller = None
    if not (
        of_a_vehicle
        or target in names
        or Path(target).suffix
        or os.path.lexists(target)
    ):
        allowed = must_be_one_of((*names, *shipped_names("vehicle")), target)
        raise ValueError(
            f"scenario or vehicle = {shown(target)}: {allowed}, or the path of a file"
        )
    if of_a_vehicle:
        scenario = of_vehicle(load_vehicle(target), controller)
        law_table = law_entry(controller or scenario.agent.controller.name)
    else:
        scenario = load_scenario(target, controller=controller)
        if not subject_of(scenario).has_gains_file:
            if Path(target).suffix not in ("", ".toml"):
                allowed = (
                    "must be a scenario (.toml) or a shipped one, since the options of"
                    " a team are written into it"
                )
                raise ValueError(f"scenario = {shown(target)}: {allowed}")
            return TuningInputs(scenario, subject_of(scenario).label(scenario))
        file = LIBRARY / f"{target}.toml" if target in names else Path(target)
        # nothing of a log
        document: Tables = (
            read_toml(file.read_bytes()) if file.name.endswith(".toml") else {}
        )
        table = document.get("controller", {}) if controller is None else {}
        law_table = {name: value for name, value in table.items() if name not in LAYERS}
        law_table = law_table or law_entry(scenario.agent.controller.name)  # of a log
    gains: Tables = {}
    tuned = controller if is_gains_file(controller) else law_table.get("tuned")
    if is_gains_file(tuned):
        path = (
            Path(str(tuned))
            if controller is not None
            # a path in a file counts from that file's folder
            else Path(target).parent / str(tuned)
        )
        stated: Tables = read_toml(path.read_bytes())
        law_table, gains = dict(stated["law"]), dict(stated.get("gains", {}))
    elif controller is not None:
        law_table = law_entry(controller)
    label = str(law_table.get("preset", law_table.get("law")))
    return TuningInputs(scenario, label, not of_a_vehicle, law_table, gains)


def _is_vehicle(target: str) -> bool:
    """True if a name denotes a vehicle and no scenario."""
    if target in shipped_names("scenario"):
        return False
    models = (".urdf", ".xacro", ".sdf", ".xml")
    return (
        target in shipped_names("vehicle")
        or Path(target).suffix in models
        or kind_of_file(target) == "vehicle"
    )
