"""Command ``skyarm run``: fly a scenario, write its log, print a summary."""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from skyarm.cli.arguments import (
    Duration,
    Laws,
    Out,
    ScenarioOrLog,
    law_names,
    name_completion,
    require_left_out,
    require_not_another,
    word_completion,
)
from skyarm.cli.autopilot_option import load_under_autopilot, outside_command
from skyarm.cli.lines import NOT_COMPLETED, say, say_suspicious, say_unlikely
from skyarm.cli.output import Advance, bar, give, say_cause, tell
from skyarm.control.catalogue import require_different
from skyarm.log.flight_log import Log
from skyarm.log.flight_summary import facts, headline, summary
from skyarm.log.formats import require_format, save_log
from skyarm.records.files import (
    output_file,
    require_replaceable,
    require_writable,
    shown,
    taken_back,
)
from skyarm.records.files.earlier_files import earlier_kept, free_names, kept_lines
from skyarm.records.files.names import picture_file
from skyarm.records.files.own_inputs import is_input
from skyarm.records.files.writing import TakenError
from skyarm.records.registry.plugins import law_of_file_name
from skyarm.records.registry.registrations import function_of_option
from skyarm.scenario.controller_table import is_gains_file
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.loop import run_until_interrupted
from skyarm.view.pages import Facts


def run(
    scenario: ScenarioOrLog,
    out: Out = "out/run",
    plant: Annotated[str | None, word_completion(registered="plant")] = None,
    laws: Laws = None,
    autopilot: Annotated[str | None, name_completion("autopilot")] = None,
    seed: int | None = None,
    duration: Duration = None,
    force: bool = False,
    logs: Annotated[list[str] | None, typer.Option("--log")] = None,
    picture: Annotated[str | None, typer.Option("--plot")] = None,
    ros: int | None = None,
    pace: float = 1.0,
) -> None:
    """Fly a scenario; write its log (npz, CSV, MCAP).

    The log is OUT/NAME.npz and .csv, or --log's; earlier ones are kept. Exit code 3:
    ended early.

    Options:
        plant: rigid_body or mujoco, in place of the file's
        autopilot: autopilot of the base: px4, px4:instance=3; px4:outside for 'skyarm
            fly'
        seed: seed of the noise, in place of the file's
        force: replace an earlier log; without it, the earlier log gets a number
        logs FILE: file of the log, in place of --out; its suffix chooses the format;
            repeat
        picture FILE: draw the flight into this file (.png, .svg or .pdf)
        ros 2: publish topics of ROS 2 and take commands, at real time
        pace: with --ros: flight over wall time; 0: as fast as possible
    """
    if logs:
        require_left_out(["--out"], " beside --log, whose files say where")
    if ros is None:
        require_left_out(["--pace"], " without --ros")
    require_not_another(scenario, "scenario")
    names = law_names(laws)
    require_different(names, "--laws")
    if len(names) > 1:
        require_left_out(
            ["--log", "--ros"],
            " with several laws, whose logs are OUT/NAME_LAW",
        )
    if autopilot is None:
        load = partial(
            load_scenario, scenario, plant=plant, seed=seed, duration=duration
        )
        flights = [load(controller=name) for name in names or (None,)]
    else:
        law = ",".join(names) or None
        flights = [
            load_under_autopilot(
                scenario, autopilot, law, plant=plant, seed=seed, duration=duration
            )
        ]
    files = [log_files(logs)] if logs else _files_by_law(Path(out), flights, names)
    drawn = None if picture is None else picture_file(picture, "--plot")
    flown = list[tuple[Log, Facts, BaseException | None]]()
    for planned, own in zip(flights, files, strict=True):
        hint = outside_command(scenario, planned)
        flown.append(
            _fly_one(planned, own, None if logs else out, ros, pace, hint, force=force)
        )
        # a flight that was interrupted ends the others; what was flown is kept
        if flown[-1][2] is not None:
            break
    documents = [each | {"picture": drawn} for _, each, _ in flown]
    tell(
        *_picture_of(
            [log for log, *_ in flown],
            [file for each in documents for file in each["logs"]],
            drawn,
        )
    )
    give(documents[0] if len(names) < 2 else {"flights": documents})
    for log, each, interrupted in flown:
        if interrupted is not None:
            raise interrupted
        if log.status != "completed":
            say_cause(headline(log, each))
    if any(log.status != "completed" for log, *_ in flown):
        raise typer.Exit(NOT_COMPLETED)


def _picture_of(
    flown: Sequence[Log], files: Sequence[Path], drawn: str | Path | None
) -> list[str]:
    """Draw flights into a picture; returns the line that names it, or the command that
    would draw their logs.
    """
    if drawn is not None:
        # one flight draws its own reference, several are compared
        from skyarm.view.figures.flight_plot import plot

        plot(flown if len(flown) > 1 else flown[0], drawn)
        return [f"picture: {drawn}"]
    # one file a flight, or plot would draw it twice; a CSV file is not read back
    whole = [file for file in files if file.suffix == ".npz"]
    if not whole:
        return []
    return [
        f"picture: skyarm plot {shlex.join(map(str, whole))} -o"
        f" {shlex.quote(str(whole[0].with_suffix('.png')))}"
    ]


def _files_by_law(
    folder: Path, flights: Sequence[Scenario], names: Sequence[str]
) -> list[list[Path]]:
    """Log files of each flight, named after the scenario and, for several laws, the
    law.
    """
    stems = [flights[0].name]
    if len(names) > 1:
        shorts = [
            Path(name).stem if is_gains_file(name) else law_of_file_name(name)
            for name in names
        ]
        laws = [re.sub(r"\W+", "_", short) for short in shorts]
        # two files of gains may have one name
        stems = [
            f"{stems[0]}_{law}" + (f"_{i}" if laws.count(law) > 1 else "")
            for i, law in enumerate(laws)
        ]
    return [
        [folder / f"{stem}{suffix}" for suffix in (".npz", ".csv")] for stem in stems
    ]


def _fly_one(
    planned: Scenario,
    files: Sequence[Path],
    out: str | None,
    ros: int | None,
    pace: float,
    hint: str,
    *,
    force: bool,
) -> tuple[Log, Facts, BaseException | None]:
    """Fly a scenario, write its log and print its summary.

    The folder ``out`` is made; it is None for files that were named by themselves.

    Returns:
        the log, its facts, and what ended the flight from outside, to be raised again.
    """
    # told afterwards, so that a mistyped folder is noticed
    new = out is not None and not Path(out).exists()
    with taken_back(out):
        if out is not None:
            require_writable(out)
        require_replaceable(*files, renames=not force)
        say_suspicious(planned)
        with bar(planned.name) as advance:
            log, interrupted, lines, topics = _fly(
                planned, ros, pace, advance, hint, files[0].parent
            )
        written, earlier = save_logs(log, files, replace=force)
    values = facts(log)
    if planned.worlds:
        from skyarm.studies.assess.pressing_flights import lost_force, missed_contact

        for name, own in zip(planned.agents, log.agents.values(), strict=True):
            one = planned.of(name)
            # words on the only vehicle need no name before them
            before = f"{name}: " if len(log.agents) > 1 else ""
            say_unlikely(
                planned.name,
                [
                    before + line
                    for line in (*lost_force(one, own), *missed_contact(one, own))
                ],
            )
    tell(
        *summary(log, values),
        *lines,
        f"log: {', '.join(map(str, written))}{' (new folder)' if new else ''}",
    )
    tell(*kept_lines(earlier))
    values |= {"logs": written, "kept": earlier}
    if topics:
        values["ros"] = topics
    return log, values, interrupted


def _fly(
    planned: Scenario,
    ros: int | None,
    pace: float,
    advance: Advance,
    hint: str,
    folder: Path,
) -> tuple[Log, BaseException | None, Sequence[str], Facts]:
    """Fly a scenario; returns log, interrupting exception or None, and lines and facts
    about ROS.

    Ctrl-C keeps the log up to then. The rows of a long flight are in a file of the
    folder meanwhile.
    """
    rate = planned.rates.control

    def progress(done: int, total: int) -> None:
        advance(
            done,
            total,
            f"{done / rate:.0f} s flown, {(total - done) / rate:.0f} s left",
        )

    def preparing(seconds: float, most: float) -> None:
        # the last call has all of the time: the take-off is over
        if seconds < most:
            advance(
                last=f"take-off of {planned.agent.controller.name}, {seconds:.0f} s"
            )
        elif hint:
            say(f"it hovers: {hint}")

    if ros is not None:
        live = function_of_option("run --ros")(
            planned, ros, pace=pace, advance=advance, preparing=preparing
        )
        return live.log, live.interrupted, live.lines, live.facts
    return (*run_until_interrupted(planned, progress, preparing, folder), (), {})


def log_files(names: Sequence[str]) -> list[Path]:
    """Check the log files named by ``--log`` before the flight; returns their paths.

    Raises:
        ValueError: a suffix that no log format is registered for, with those there are;
            or a file that is named twice.
        OSError: one of them cannot be written.
    """
    names_by_place: dict[Path, str] = {}
    for name in names:
        require_format(name, "--log")
        place = output_file(name, "--log").resolve()
        if place in names_by_place:
            raise ValueError(
                f"--log = {shown(name)}: must be another file than --log ="
                f" {shown(names_by_place[place])}"
            )
        names_by_place[place] = name
    return [Path(name) for name in names]


def save_logs(
    log: Log, files: Sequence[Path], *, replace: bool = False
) -> tuple[list[Path], list[Path]]:
    """Write the logs of a flight; return their paths, and the new paths of renamed
    earlier logs.

    A log that was read keeps its name: the flight is numbered in its place. Where
    another process holds the folder for longer than a minute, the names end in this
    process's number, or the next that is free. A log that cannot be written keeps no
    other from its file: all are tried before the first error is raised.
    """
    # the log that was read keeps its name, so the new one gets the number
    beside = not replace and any(map(is_input, files))
    written, errors = [], []
    with ExitStack() as lock:
        try:
            earlier = lock.enter_context(earlier_kept(files, replace=replace or beside))
            names = free_names(files) if beside else files
        except TakenError as error:
            say(f"warning: {error}; this flight's logs get names of their own")
            # the number of the process is free for sure, where the folder cannot be
            # locked
            names = free_names(files, os.getpid())
            earlier = []
        for file in names:
            try:
                written.append(save_log(log, file))
            except Exception as error:
                # the other files are written all the same
                errors.append(error)
        if errors:
            # raised after all files were tried, so that one full disk loses no other
            # log
            raise errors[0]
    return written, earlier
