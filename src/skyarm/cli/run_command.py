"""Command ``skyarm run``: fly a scenario, write its log, print a summary."""

from __future__ import annotations

import dataclasses
import math
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from skyarm.cli.arguments import (
    Duration,
    Flown,
    Laws,
    Out,
    law_names,
    name_completion,
    require_left_out,
    require_not_another,
)
from skyarm.cli.autopilot_option import load_under_autopilot, outside_command
from skyarm.cli.lines import NOT_COMPLETED, say, say_suspicious, say_unlikely
from skyarm.cli.output import Advance, Facts, Lines, bar, give, heading, say_cause, table_of, tell
from skyarm.control.catalogue import require_different
from skyarm.control.controller import autopilot_of
from skyarm.dynamics.actuators.rotor import push
from skyarm.log.flown_scenario import restored_at, written_at
from skyarm.log.formats import require_format, save_log
from skyarm.log.log_columns import columns, component_labels
from skyarm.log.metrics.path_distance import path_distance
from skyarm.log.metrics.score import score
from skyarm.log.metrics.windows import Windows, windows_of
from skyarm.log.periods import ContactPeriod, timed_out
from skyarm.log.sensor_data import COMPONENTS
from skyarm.records.arrays import Array
from skyarm.records.files import (
    output_file,
    printable,
    require_replaceable,
    require_writable,
    shown,
    taken_back,
)
from skyarm.records.files.names import picture_file
from skyarm.records.files.own_inputs import is_input
from skyarm.records.files.writing import TakenError, one_writer
from skyarm.records.registry.plugins import law_of_file_name
from skyarm.records.text_tables import shown_number
from skyarm.scenario.controller_table import is_gains_file
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate import Log
from skyarm.simulate import run as fly
from skyarm.simulate.loop import run_until_interrupted

if TYPE_CHECKING:
    from skyarm.links.ros.live_flight import LiveFlight

Preparing = Callable[[float, float], None]
"""(seconds, most): simulated, of a take-off."""


def run(
    context: typer.Context,
    scenario: Flown,
    out: Out = "out/run",
    plant: Annotated[str | None, typer.Option(help="rigid_body or mujoco for the file's")] = None,
    laws: Laws = None,
    autopilot: Annotated[
        str | None,
        typer.Option(
            help="flies the base: px4, ...; px4:outside for 'skyarm fly'; px4:instance=3",
            autocompletion=name_completion("autopilot"),
        ),
    ] = None,
    seed: Annotated[int | None, typer.Option(help="seed of the noise, in place of the file's")] = None,
    duration: Duration = None,
    force: Annotated[bool, typer.Option("--force", help="replace the log of an earlier flight")] = False,
    logs: Annotated[
        list[str] | None,
        typer.Option("--log", metavar="FILE", help="file of the log, its format by its suffix; repeat"),
    ] = None,
    picture: Annotated[
        str | None, typer.Option("--plot", metavar="FILE", help="a picture of the flight (.png, .svg or .pdf)")
    ] = None,
    ros: Annotated[
        int | None, typer.Option(metavar="1|2", help="live topics of ROS 1 or 2, and commands from it; at real time")
    ] = None,
    pace: Annotated[float, typer.Option(help="of --ros: flight time over wall time; 0 waits for nothing")] = 1.0,
) -> None:
    """Fly a scenario; write its log (npz, CSV, MCAP).

    The log is OUT/NAME.npz and .csv, or --log's; earlier ones are kept. Exit code 3: ended early.
    """
    if logs:
        require_left_out(context, ["--out"], " beside --log, whose files say where")
    if ros is None:
        require_left_out(context, ["--pace"], " without --ros")
    require_not_another(scenario, "scenario")
    words: dict[str, Any] = {"plant": plant, "seed": seed, "duration": duration}
    names = law_names(laws)
    require_different(names, "--laws")
    if len(names) > 1:
        require_left_out(context, ["--log", "--ros"], " with several laws, whose logs are OUT/NAME_LAW")
    if autopilot is None:
        flights = [load_scenario(scenario, controller=name, **words) for name in names or (None,)]
    else:
        flights = [load_under_autopilot(scenario, autopilot, ",".join(names) or None, **words)]
    files = [log_files(logs)] if logs else _files_by_law(Path(out), flights, names)
    drawn = None if picture is None else picture_file(picture, "--plot")
    flown = list[tuple[Log, Facts, BaseException | None]]()
    for planned, own in zip(flights, files, strict=True):
        hint = outside_command(scenario, planned)
        flown.append(_fly_one(planned, own, None if logs else out, ros, pace, hint, force=force))
        if flown[-1][2] is not None:
            break
    found = [each | {"picture": drawn} for _, each, _ in flown]
    if drawn is not None:
        from skyarm.view.figures.flight_plot import plot

        plot([log for log, *_ in flown] if len(flown) > 1 else flown[0][0], drawn)
        tell(f"picture: {drawn}")
    give(found[0] if len(names) < 2 else {"flights": found})
    for log, each, interrupted in flown:
        if interrupted is not None:
            raise interrupted
        if log.status != "completed":
            say_cause(headline(log, each))
    if any(log.status != "completed" for log, *_ in flown):
        raise typer.Exit(NOT_COMPLETED)


def _files_by_law(folder: Path, flights: Sequence[Scenario], names: Sequence[str]) -> list[list[Path]]:
    """Files of the log of each flight: the scenario's name, and of several laws that of the law."""
    stems = [flights[0].name]
    if len(names) > 1:
        shorts = [Path(name).stem if is_gains_file(name) else law_of_file_name(name) for name in names]
        laws = [re.sub(r"\W+", "_", short) for short in shorts]
        # two files of gains may have one name
        stems = [f"{stems[0]}_{law}" + (f"_{i}" if laws.count(law) > 1 else "") for i, law in enumerate(laws)]
    return [[folder / f"{stem}{suffix}" for suffix in (".npz", ".csv")] for stem in stems]


def _fly_one(
    planned: Scenario, files: Sequence[Path], out: str | None, ros: int | None, pace: float, hint: str, *, force: bool
) -> tuple[Log, Facts, BaseException | None]:
    """Fly a scenario, write its log and print its summary.

    The folder ``out`` is made; it is None for files that were named by themselves.

    Returns:
        the log, its facts, and what ended the flight from outside, to be raised again.
    """
    new = out is not None and not Path(out).exists()
    with taken_back(out):
        if out is not None:
            require_writable(out)
        require_replaceable(*files, renames=not force)
        say_suspicious(planned)
        with bar(planned.name) as advance:
            log, interrupted, live = _fly(planned, ros, pace, advance, hint)
        written, kept = save_logs(log, files, replace=force)
    found = facts(log)
    if planned.worlds:
        from skyarm.studies.assess.pressing_flights import lost_force

        say_unlikely(planned.name, lost_force(planned, log))
    tell(
        *summary(log, found),
        *(live.lines if live else []),
        f"log: {', '.join(map(str, written))}{' (new folder)' if new else ''}",
    )
    if kept:
        tell(f"the flight before it is kept: {', '.join(map(str, kept))}")
    found |= {"logs": written, "kept": kept}
    if live is not None:
        found["ros"] = {
            "version": live.version, "commanded": live.commanded, "goals": live.goals, "late_s": live.late
        }  # fmt: skip
    return log, found, interrupted


def _fly(
    planned: Scenario, ros: int | None, pace: float, advance: Advance, hint: str
) -> tuple[Log, BaseException | None, LiveFlight | None]:
    """Fly a scenario: its log, what ended it from outside, to be raised again, and what ROS saw of it.

    A flight that cannot be repeated, under an autopilot or ROS, keeps its log at Ctrl-C.
    """

    def preparing(seconds: float, most: float) -> None:
        if seconds < most:
            advance(last=f"take-off of {planned.controller.name}, {seconds:.0f} s")
        elif hint:
            say(f"it hovers: {hint}")

    if ros is not None:
        live = _fly_live(planned, ros, pace, advance, preparing)
        return live.log, live.interrupted, live
    if autopilot_of(planned.controller) is None:
        return fly(planned, advance), None, None
    return (*run_until_interrupted(planned, advance, preparing), None)


def _fly_live(planned: Scenario, version: int, pace: float, advance: Advance, preparing: Preparing) -> LiveFlight:
    """Fly a scenario with live topics of ROS.

    Raises:
        ValueError: a pace below 0, another version, or a ROS that is not there.
    """
    from skyarm.links.ros import open_node
    from skyarm.links.ros.live_flight import fly_live

    if not 0.0 <= pace < math.inf:
        raise ValueError(f"--pace = {pace:g}: must be a finite number, 0 or above")
    return fly_live(
        planned, open_node(version), version, pace=pace or math.inf, advance=advance, preparing=preparing,
        warn=lambda line: say(f"warning: {line}"),
    )  # fmt: skip


def log_files(names: Sequence[str]) -> list[Path]:
    """Check the log files named by ``--log`` before the flight; returns their paths.

    Raises:
        ValueError: a suffix that no log format is registered for, with those there are; or a file that is named twice.
        OSError: one of them cannot be written.
    """
    found: dict[Path, str] = {}
    for name in names:
        require_format(name, "--log")
        place = output_file(name, "--log").resolve()
        if place in found:
            raise ValueError(f"--log = {shown(name)}: must be another file than --log = {shown(found[place])}")
        found[place] = name
    return [Path(name) for name in names]


NAMING, PATIENCE = ".naming", 60.0
"""File of the lock under which logs get their names, and s to wait for others who write theirs into the folder."""


def save_logs(log: Log, files: Sequence[Path], *, replace: bool = False) -> tuple[list[Path], list[Path]]:
    """Write the logs of a flight; return their names, and those that earlier ones got.

    A log that was read keeps its name: the flight is numbered in its place. Where another process holds the folder for
    longer than a minute, the names end in this process's number, or the next that is free. A log that cannot be
    written keeps no other from its file: all are tried before the first error is raised.
    """
    beside = not replace and any(map(is_input, files))
    written, errors = [], []
    with ExitStack() as lock:
        try:
            kept = lock.enter_context(earlier_kept(files, replace=replace or beside))
            names = _free_names(files) if beside else files
        except TakenError as error:
            say(f"warning: {error}; this flight's logs get names of their own")
            names, kept = _free_names(files, os.getpid()), []
        for file in names:
            try:
                written.append(save_log(log, file))
            except Exception as error:
                errors.append(error)
        if errors:
            raise errors[0]
    return written, kept


@contextmanager
def earlier_kept(files: Sequence[Path], *, replace: bool = False) -> Iterator[list[Path]]:
    """Context manager that renames existing files NAME.npz to NAME_1.npz while new ones are written.

    The newest flight has the plain name, so that what reads it need not search. Links and devices stay: they are
    written through. Where the writing fails, the files get their names back. Yields the numbered names. From the look
    at the names to the last file's end no other process names logs in these folders.

    Args:
        files: of one flight.
        replace: rename none.

    Raises:
        TakenError: another process writes its logs there for longer than a minute.
        OSError: one cannot be renamed.
    """
    with ExitStack() as locks:
        # in one order everywhere, so that no two processes wait for each other
        for folder in sorted({Path(os.path.realpath(file)).parent for file in files if not _is_device(file)}):
            folder.mkdir(parents=True, exist_ok=True)  # a flight that failed beside may have taken it back
            locks.enter_context(one_writer(folder, name=NAMING, patience=PATIENCE))
        there = [] if replace else [file for file in files if file.is_file() and not file.is_symlink()]
        renamed = {
            file: file.rename(free) for file, free in zip(files, _free_names(files), strict=True) if file in there
        }
        try:
            yield list(renamed.values())
        except BaseException:
            for file, name in renamed.items():
                if not os.path.lexists(file):
                    name.rename(file)
            raise


def _is_device(file: Path) -> bool:
    return file.exists() and not file.is_file()


def _free_names(files: Sequence[Path], least: int = 1) -> list[Path]:
    """Names NAME_1.npz of some files but devices, with the first number of which none of them is there."""
    every = (
        [file if _is_device(file) else file.with_name(f"{file.stem}_{k}{file.suffix}") for file in files]
        for k in count(least)
    )
    return next(names for names in every if not any(map(os.path.lexists, {*names} - {*files})))


LABELS = {
    "tip": "tip, m",
    "position": "base, m",
    "joints": "joints, rad or m",
    "tip_to_path": "tip to its path, m",
    "base_to_path": "base to its path, m",
    "lag": "governor's lag, s",
}
"""Error -> its row in the table, in this order."""

COMMANDS = ("rotor_jitter", "rotor_saturation")
"""Metrics of the rotor commands over the window of the errors."""

MOST_NAMED = 3
"""Numbers changed in flight that are named; a record of many would fill the line."""


def facts(log: Log) -> Facts:
    """Summary of a flight as plain data: status, errors, thrust, contacts, grasps and phases."""
    info = log.info
    named = ("scenario", "controller", "plant", "integrator", "seed", "duration", "end_time", "status", "cause")
    found = {name: info[name] for name in named} | {"vehicle": info["plant_vehicle"]}
    if "autopilot" in info:
        found["autopilot"] = info["autopilot"]
    if not log.time.size or not _took_off(found):
        return found
    steady = Windows().of_flight(float(info["duration"]), windows_of(log)).steady
    inside = steady.of(log)

    def summary(error: Array) -> dict[str, float | None]:
        mean, most = (float(error[inside].mean()), float(error[inside].max())) if inside.any() else (None, None)
        return {"mean": mean, "max": most, "max_whole_flight": float(error.max())}

    errors = {what: summary(error) for what, error in error_norms(log).items()}
    found |= {"steady_window_s": [steady.start, steady.stop], "errors_continuous": errors}
    commands = score(log, COMMANDS)
    found |= {name: value if math.isfinite(value) else None for name, value in commands.items()}
    found |= {"peak_thrust": _peak_thrust(log)} | dataclasses.asdict(log.shortfall)
    if log.lag_found.size:
        found["lag_found_s"] = log.lag_found[-1]
    found |= {name: rows for name, rows in (("contacts", _contacts(log)), ("mechanisms", _mechanisms(log))) if rows}
    if log.component("gripper_taken").size:
        found["grasps"] = [dataclasses.asdict(each) for each in log.grasp_periods]
    if log.phase.size:
        late = timed_out(log)
        found["phase_ends"] = [
            {"phase": name, "end": end, "timeout": number in late} for number, (name, end) in enumerate(log.phase_ends)
        ]
    elif log.path_time.size:
        distances = {
            "lag": log.time - log.path_time,
            "base_to_path": path_distance(log.position, log.position_reference),
        }
        if not np.array_equal(log.tool, log.position):
            distances["tip_to_path"] = path_distance(log.tool, log.tool_reference)
        found["governor"] = {what: summary(distance) for what, distance in distances.items()}
    return found


def _took_off(found: Mapping[str, Any]) -> bool:
    """True unless the log is that of an autopilot's take-off, which failed."""
    return "autopilot" not in found or found["autopilot"]["prepared_s"] > 0.0


def error_norms(log: Log) -> dict[str, Array]:
    """Norms (N,) of the errors in position, joints and tip against the continuous reference, by name."""
    pairs = {"position": (log.position, log.position_reference)}
    if log.joints.shape[1]:
        pairs["joints"] = log.joints, log.joints_reference
    if not np.array_equal(log.tool, log.position):
        pairs["tip"] = log.tool, log.tool_reference
    return {what: np.linalg.norm(flown - desired, axis=1) for what, (flown, desired) in pairs.items()}


def _peak_thrust(log: Log) -> float | None:
    """Highest ratio of a rotor's thrust to its maximum; None if no rotor has a limit."""
    rotors = getattr(restored_at(log.info, "plant.vehicle"), "rotors", ())
    pairs = zip(rotors, log.rotor_speeds.max(axis=0), strict=False)
    return max((float(push(r, w) / push(r, r.max_speed)) for r, w in pairs if np.isfinite(r.max_speed)), default=None)


def _has_battery(log: Log) -> bool:
    """True if a battery's voltage limits the rotors, of which the commands alone say nothing."""
    return getattr(restored_at(log.info, "plant.vehicle"), "battery", None) is not None


def _contacts(log: Log) -> list[Facts]:
    """List contacts by surface and contact point: first touch (s), losses of contact, largest force (N)."""
    pairs: dict[tuple[str, str], list[ContactPeriod]] = {}
    for period in log.contact_periods:
        pairs.setdefault((period.surface, period.point), []).append(period)
    return [
        {
            "surface": surface,
            "point": point,
            "first_touch": periods[0].start,
            "losses": sum(each.end is not None for each in periods),
            "peak": max(each.peak for each in periods),
        }
        for (surface, point), periods in pairs.items()
    ]


def _mechanisms(log: Log) -> list[Facts]:
    """List the coordinate of each mechanism, such as a door: first, farthest and last value."""
    rows = [each for each in columns(log) if each.array == f"{COMPONENTS}.mechanism_position"]
    found = []
    for name, column in zip(component_labels(log, "mechanism_position"), rows, strict=True):
        place = column.of(log)
        furthest = place[np.abs(place - place[0]).argmax()]
        found.append({"name": name, "first": place[0], "furthest": furthest, "last": place[-1], "unit": column.unit})
    return found


def summary(log: Log, found: Facts) -> Lines:
    """Text of a flight's summary: status, table of tracking errors, thrust and events."""
    if not _took_off(found):
        return [heading(headline(log, found))]
    lines: Lines = [heading(headline(log, found)), printable(_flight_words(log))]
    if "steady_window_s" not in found:
        return lines
    start, stop = found["steady_window_s"]
    errors = found["errors_continuous"] | found.get("governor", {})
    rows = [
        (LABELS[what], *("-" if value is None else shown_number(value, 4) for value in errors[what].values()))
        for what in LABELS
        if what in errors
    ]
    lines.append(table_of((f"error, {start:.4g} to {stop:.4g} s", "mean", "max", "max, whole flight"), rows))
    jitter, limited = (found[name] for name in COMMANDS)
    if jitter is not None:
        words = (
            ""
            if limited is None or _has_battery(log)
            else f", a rotor at its limit in {100.0 * limited:.3g} % of the periods"
        )
        lines.append(f"rotor commands then: jitter {shown_number(jitter, 4)} rad/s a period{words}")
    if found["peak_thrust"] is not None:
        cut = "" if found["saturation"] or _has_battery(log) else "; no command at a limit"
        lines.append(f"peak thrust: {found['peak_thrust']:.0%} of a rotor's highest{cut}")
    return [*lines, *log.shortfall.lines, *sentences(found)]


def headline(log: Log, found: Mapping[str, Any]) -> str:
    """Line of scenario, status, duration and cause."""
    end, duration = (f"{found[name]:g} s" for name in ("end_time", "duration"))
    if _took_off(found):
        title = f"{found['scenario']}: {log.status}, {end}" + (f" of {duration}" if end != duration else "")
    else:
        title = f"{found['scenario']}: {log.status}, no take-off in {end}"
    return title + (f": {found['cause']}" if found["cause"] else "")


def sentences(found: Facts) -> list[str]:
    """List sentences on estimated lags, contacts, mechanisms, grasps and phases of a flight."""
    lines = []
    if "autopilot" in found:
        said = found["autopilot"]
        counts = f"; {said['answered']} of {said['steps']} messages answered" if "answered" in said else ""
        lines.append(f"autopilot {said['name']}: hovered {said['prepared_s']:.3g} s after power-on{counts}")
    if "lag_found_s" in found:
        rotors, joints = 1e3 * found["lag_found_s"]
        lines.append(f"lag found at the end, beyond the law's nominal: rotors {rotors:.1f} ms, joints {joints:.1f} ms")
    for each in found.get("contacts", ()):
        touch = f"{each['surface']} touched {each['point']} at {each['first_touch']:g} s"
        lines.append(f"{touch}: lost {each['losses']} times, largest force {each['peak']:.3g} N")
    for each in found.get("mechanisms", ()):
        first, furthest, last = (shown_number(each[name]) for name in ("first", "furthest", "last"))
        lines.append(
            f"{each['name']} moved from {first} to {furthest} {each['unit']}, at the end {last} {each['unit']}"
        )
    for each in found.get("grasps", ()):
        ended = f"{'gave way' if each['gave_way'] else 'let go'} at {each['end']:g} s" if each["end"] else ""
        grasp = f"{each['gripper']} took {each['held']} at {each['start']:g} s: {ended or 'holds it to the end'}"
        lines.append(f"{grasp}, largest force {each['peak']:.3g} N")
    ends = [
        f"{each['phase']} {'-' if each['end'] is None else '{:g} s'.format(each['end'])}"
        + (" (timeout)" if each["timeout"] else "")
        for each in found.get("phase_ends", ())
    ]
    lines += [f"phases done: {', '.join(ends)}"] if ends else []
    return lines


def _flight_words(log: Log) -> str:
    """Line that names law, vehicle, plant, integrator, seed, scheduled changes and plugins of a flight."""
    info = log.info
    plant = f"{info['plant_vehicle']}, plant {info['plant']} ({info['integrator']})"
    line = f"law {info['controller']} on {plant}, seed {info['seed']}"
    changes = written_at(info, "changes") or ()
    paths = dict.fromkeys(str(each["path"]) for each in changes if "path" in each)
    if changes:
        named = f" (of {', '.join(paths)})" if 0 < len(paths) <= MOST_NAMED else ""
        line += f", {len(changes)} change{'s' if len(changes) > 1 else ''} in flight{named}"
    plugins = info.get("plugins") or {}
    return line + (f", plugins {', '.join(sorted(plugins))}" if plugins else "")
