"""Command ``skyarm identify``: identify a vehicle, or delays and lags, from flights, or
design such a flight.

The words ``flights``, ``lags`` and ``design`` behind it are commands of their own.
Without one of them it takes the options of all three, as before there were these words.
"""

from __future__ import annotations

import inspect
import math
import os
import shlex
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import typer

from skyarm.cli.arguments import Force, name_completion, require_left_out
from skyarm.cli.lines import NOT_COMPLETED, say
from skyarm.cli.output import (
    bar,
    give,
    json_text,
    parameters_of,
    plain,
    tell,
    tell_report,
)
from skyarm.flight_data.flight_data import split_path
from skyarm.flight_data.own_log import is_own_mcap, require_one_vehicle
from skyarm.identify.design import SEGMENT, DesignLimits
from skyarm.identify.design_report import design_facts, design_lines
from skyarm.identify.designed_flight import design_flight
from skyarm.identify.identified_file import VOLTAGE
from skyarm.identify.identified_report import (
    FIGURE,
    NUMBERS,
    TABLE,
    VEHICLE,
    prediction_csv,
    prediction_lines,
    prediction_png,
)
from skyarm.identify.identify_files import FlightFiles, identify_files
from skyarm.identify.identify_flights import known_of_search
from skyarm.identify.identify_windows import SearchOptions
from skyarm.identify.lag_report import (
    every_lag,
    lag_lines,
    lag_tables,
    nominal_model,
    stated_delays,
)
from skyarm.identify.loop_lags import loop_lags
from skyarm.log.flight_log import Log, rows_of
from skyarm.log.formats import load_log, require_readable
from skyarm.plant.interface import require_gravity
from skyarm.records.files import (
    errors_as,
    number,
    output_file,
    require_file,
    require_replaceable,
    require_writable,
    shown,
    taken_back,
    write_atomically,
)
from skyarm.records.files.earlier_files import earlier_kept, kept_lines
from skyarm.records.registry import RegistryError
from skyarm.records.units import units
from skyarm.vehicle import Vehicle
from skyarm.vehicle.vehicle_files import list_vehicles, load_vehicle

FLATTEST, STEEPEST, LONGEST = 2.0, 60.0, 600.0
"""Bounds of the options: tilt (deg) below which the loop tilts anyway, and far from
lying on its side; duration (s) of a battery."""

USUAL = DesignLimits()

Moment = Annotated[
    float | None,
    typer.Option(
        help="only the part of each flight between --begin and --end is used, s"
    ),
]

Gravity = Annotated[
    float | None, typer.Option(help="m/s^2; the log's, or 9.81", hidden=True)
]


Out = Annotated[
    str | None,
    typer.Option(
        "--out",
        "-o",
        metavar="PATH",
        help="folder for vehicle file and numbers; with lags or design a .toml file",
    ),
]


def flights(
    files: list[str],
    vehicle: str | None = None,
    columns: str | None = None,
    known: list[str] | None = None,
    curve: bool = False,
    held_out: list[str] | None = None,
    join: str | None = None,
    despite_faults: bool = False,
    drag_height: bool = False,
    begin: Moment = None,
    end: Moment = None,
    gravity: Gravity = None,
    out: Out = None,
) -> None:
    """Identify a vehicle from measured flights.

    Exit code 3: the flights do not tell.

    Options:
        files FLIGHT: logs of any format that skyarm reads
        vehicle: required: file or name of the vehicle as data sheet and drawing
            describe it
        columns FILE: file that says what the columns of the flights mean
        known NAME=VALUE: known number: mass=0.034, voltage=4.2, or one of the printed
            table; repeat
        curve: estimate a thrust curve in place of one coefficient
        held_out FLIGHT: flight that is predicted and not fitted; repeat
        join FILE: log of the same flight from a computer with another clock
        despite_faults: only warn of faults in a log that would be refused
        drag_height: estimate the height at which the hub drag acts
    """
    if join is not None and len(files) > 1:
        raise ValueError(f"flights = {len(files)}: must be one with --join")
    for flight in (*files, *(held_out or ()), *(() if join is None else (join,))):
        file, _ = split_path(flight)
        if not Path(file).is_dir():
            require_file(file, f"flight = {shown(flight)}")
    if vehicle is None:
        raise ValueError(
            "--vehicle: is missing: must be the vehicle as its data sheet and"
            " drawing say"
        )
    start, given = known_numbers(load_vehicle(vehicle), known or ())
    felt = None if gravity is None else require_gravity(gravity, "--gravity")
    sections = _sections(begin, end)
    folder = Path(out or "")
    ours = [folder / name for name in (VEHICLE, NUMBERS, TABLE, FIGURE)]
    with taken_back(out):
        with bar(f"identify {start.name}") as advance:
            if out is not None:
                require_writable(folder)
                require_replaceable(*ours)
            report = identify_files(
                FlightFiles(
                    fit=files, held_out=held_out or (), join=join, columns=columns
                ),
                start,
                SearchOptions(
                    curve=curve, drag_height=drag_height, sections=sections, known=given
                ),
                gravity=felt,
                despite_faults=despite_faults,
                warn=lambda fault: say(f"warning: {fault.words}"),
                progress=advance,
            )
            identified = report.found
            document = report.document()
            contents = {
                VEHICLE: report.vehicle_file().encode(),
                NUMBERS: json_text(document).encode(),
            }
            if identified.held_out is not None:
                contents[TABLE] = prediction_csv(identified.held_out).encode()
                # without poses there is neither position nor attitude to draw
                if out is not None and identified.held_out.has_poses:
                    contents[FIGURE] = prediction_png(identified.held_out)
        tell_report(report.lines())
        if identified.held_out is not None:
            tell_report(prediction_lines(identified.held_out))
        shows, written = any(each.is_known for each in identified.numbers), list[Path]()
        if out is not None and shows:
            # none of an earlier identification stays beside them
            with earlier_kept(ours) as earlier:
                written = [
                    write_atomically(folder / name, content)
                    for name, content in contents.items()
                ]
            following = (
                [f"next: skyarm check {folder / VEHICLE}"] if identified.settled else []
            )
            tell(
                f"written: {', '.join(map(str, written))}",
                *kept_lines(earlier),
                *following,
            )
        give(document, files=written)
        if not identified.settled:
            say(
                "the search did not settle: give known numbers (--known), or fly with"
                " more motion"
            )
        if not shows:
            say(
                "the flights show none of these numbers: fly with more motion, or"
                " longer"
            )
        if not (identified.settled and shows):
            raise typer.Exit(NOT_COMPLETED)


def lags(
    log: str,
    vehicle: str | None = None,
    begin: Moment = None,
    end: Moment = None,
    gravity: Gravity = None,
    out: Out = None,
    force: Force = False,
) -> None:
    """Find delays and lags of rotors and joints in one log.

    Exit code 3: the flight does not tell.

    Options:
        log LOG: log of one flight in skyarm
        vehicle: name or file of a vehicle; if left out the model of the log's law
    """
    require_readable(log, "flight")
    require_file(log, f"flight = {shown(log)}")
    # a folder that was made for a file goes again if no file is written
    with taken_back(out and Path(out).parent):
        written = (
            None if out is None else output_file(out, "--out", ".toml", force=force)
        )
        name = Path(log).name
        whole = load_log(log)
        with errors_as(ValueError, f"flight = {shown(log)}: "):
            require_one_vehicle(whole)
        flight = _part(whole, begin, end)
        felt = None if gravity is None else require_gravity(gravity, "--gravity")
        model, felt = nominal_model(flight, vehicle, felt)
        stated = stated_delays(flight)
        with bar(f"{name}: delays and lags"):
            loops = loop_lags(flight, model, felt)
        tables = lag_tables(loops, measured=stated["measurement"] or 0.0)
        tell_report(
            lag_lines(
                f"{name}: {loops.seconds:g} s, vehicle {model.name}", loops, stated
            )
        )
        if tables:
            tell(f"\n{tables}")
            if written is not None:
                tell(f"written: {write_atomically(written, tables.encode())}")
        give(
            plain(loops),
            vehicle=model.name,
            stated=stated,
            tables=tables,
            file=written if tables else None,
        )
        if not any(each.is_known for each in every_lag(loops)):
            say("the flight does not tell: fly with more motion, or longer")
            raise typer.Exit(NOT_COMPLETED)


def _limit(name: str) -> Any:
    """Command-line option for a flight limit, with unit and meaning from its record;
    angles in degrees.
    """
    unit = units(DesignLimits)[name]
    of = "deg" if unit.unit == "rad" else unit.unit
    return typer.Option(help=f"{of}, {unit.meaning}")


def design(
    model: Annotated[str, typer.Argument(autocompletion=name_completion("vehicle"))],
    box: Annotated[float, _limit("box")] = USUAL.box,
    tilt: Annotated[float, _limit("tilt")] = math.degrees(USUAL.tilt),
    seconds: Annotated[float, _limit("seconds")] = USUAL.seconds,
    clear: Annotated[float, _limit("clear")] = USUAL.clear,
    out: Out = None,
    force: Force = False,
) -> None:
    """Design a flight that identifies the parameters of a vehicle.

    Options:
        model VEHICLE: name or file of a vehicle
    """
    limits = DesignLimits(
        box=number(box, "--box", low=0.0, strict=True),
        tilt=math.radians(_within(tilt, "--tilt", FLATTEST, STEEPEST)),
        seconds=_within(seconds, "--seconds", SEGMENT, LONGEST),
        clear=number(clear, "--clear", low=0.0),
    )
    start = load_vehicle(model)
    with taken_back(out and Path(out).parent):
        written = (
            None if out is None else output_file(out, "--out", ".toml", force=force)
        )
        folder = Path() if written is None else Path(written).parent
        # a path in a scenario file starts at the folder of that file
        name = model if model in list_vehicles() else os.path.relpath(model, folder)
        with bar(f"design {start.name}") as advance:
            designed = design_flight(
                start, name, limits, folder=folder, progress=advance
            )
        tell_report(design_lines(designed, start.name, limits.seconds))
        if written is not None:
            write_atomically(written, designed.text().encode())
            tell(f"written: {written}", f"next: skyarm run {shlex.quote(str(written))}")
        give(numbers=design_facts(designed), vehicle=start.name, file=written)


SUBCOMMANDS: Mapping[str, Callable[..., None]] = {
    "flights": flights,
    "lags": lags,
    "design": design,
}
"""Subcommand -> its function."""

OPTIONS = {
    command: {
        each.name: each.replace(kind=inspect.Parameter.KEYWORD_ONLY)
        for each in parameters_of(function)
        if each.default is not each.empty
    }
    for command, function in SUBCOMMANDS.items()
}
"""Subcommand -> parameters of its options, all of which are optional."""


def _words_and_files(begun: str) -> list[str]:
    """Complete a subcommand, or the name of a file in the current folder."""
    return [each for each in (*SUBCOMMANDS, *os.listdir()) if each.startswith(begun)]


def identify(
    files: Annotated[
        list[str] | None,
        typer.Argument(metavar="flights|lags|design", autocompletion=_words_and_files),
    ] = None,
    only_lags: Annotated[bool, typer.Option("--lags")] = False,
    designed: Annotated[str | None, typer.Option("--design")] = None,
    **options: Any,
) -> None:
    """Identify a vehicle, or delays and lags, from flights.

    Without one of these words the options of all three are taken: FLIGHT... --vehicle
    START identifies a vehicle, one log alone or with --lags gives delays and lags,
    --design VEHICLE designs a flight.

    Options:
        only_lags: as identify lags does
        designed VEHICLE: as identify design does
    """
    if designed is not None:
        if files:
            raise ValueError("FLIGHT: must be left out with --design")
        require_left_out([*_beyond("flights", "design"), "--lags"], " with --design")
        design(designed, **_of("design", options))
        return
    require_left_out(_beyond("design", "flights"), " without --design")
    if not files:
        raise ValueError(
            "FLIGHT: is missing: must be one log or more, or --design VEHICLE"
        )
    # as before there were subcommands: one log of our own alone gives its lags
    if only_lags or (
        options["vehicle"] is None and len(files) == 1 and _is_own_log(Path(files[0]))
    ):
        require_left_out(
            _beyond("flights", "lags"), " without --vehicle, and with --lags"
        )
        if len(files) > 1:
            raise ValueError(f"flights = {len(files)}: must be one with --lags")
        lags(files[0], **_of("lags", options))
        return
    flights(files, **_of("flights", options))


*_own, _options = inspect.signature(identify, eval_str=True).parameters.values()
# Typer reads options from the signature, and declaring those of three commands anew
# would be a second list
identify.__dict__["__signature__"] = inspect.Signature(
    [*_own, *(OPTIONS["design"] | OPTIONS["lags"] | OPTIONS["flights"]).values()]
)


def _of(command: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """Select the options of a subcommand from those of all subcommands."""
    return {name: options[name] for name in OPTIONS[command]}


def _beyond(command: str, other: str) -> list[str]:
    """Names of the options of a subcommand that another one lacks."""
    return [
        f"--{name.replace('_', '-')}"
        for name in OPTIONS[command]
        if name not in OPTIONS[other]
    ]


def _is_own_log(path: Path) -> bool:
    """True for the log of a simulated flight, by its name and, of an MCAP file, its
    content.
    """
    if path.suffix == ".mcap" and path.is_file():
        return is_own_mcap(path)
    # a suffix of no log of ours is refused, which is the answer here
    with suppress(RegistryError):
        return bool(require_readable(path))
    return False


def _sections(
    begin: float | None, end: float | None
) -> tuple[tuple[float, float], ...]:
    """Time interval (s) of each flight to use; empty for all parts in the air."""
    if begin is None and end is None:
        return ()
    low = 0.0 if begin is None else number(begin, "--begin", low=0.0)
    high = math.inf if end is None else number(end, "--end", low=0.0)
    if not low < high:
        raise ValueError(f"--end = {high:g}: must be after --begin = {low:g}")
    return ((low, high),)


def _part(log: Log, begin: float | None, end: float | None) -> Log:
    """Part of a log between two times (s)."""
    for low, high in _sections(begin, end):
        inside = ((log.time >= low) & (log.time <= high)).nonzero()[0]
        if not len(inside):
            option, value = ("--end", high) if begin is None else ("--begin", low)
            first, last = float(log.time[0]), float(log.time[-1])
            raise ValueError(
                f"{option} = {value:g}: nothing of the flight is left, whose times are"
                f" {first:g} to {last:g} s"
            )
        log = rows_of(log, slice(int(inside[0]), int(inside[-1]) + 1))
    return log


def _within(value: float, option: str, low: float, high: float) -> float:
    """Check that an option's value lies between two bounds, and return it."""
    if not low <= number(value, option) <= high:
        raise ValueError(f"{option} = {value:g}: must be from {low:g} to {high:g}")
    return value


def known_numbers(
    start: Vehicle, texts: Sequence[str]
) -> tuple[Vehicle, dict[str, float]]:
    """Parse known parameters such as ``mass=0.034``; returns the start vehicle with its
    total mass, and the others.

    The total mass becomes that of the start vehicle, by its base. The three moments of
    inertia of the base become the second moments of mass that are searched.

    Raises:
        ValueError: one line with the option, the value and what is allowed.
    """
    given = dict[str, float]()
    for each in texts:
        name, equals, text = (part.strip() for part in each.partition("="))
        if not (name and equals and text):
            raise ValueError(
                f"--known = {shown(each)}: must be NAME=VALUE, such as mass=0.034"
            )
        if name in given:
            raise ValueError(f"--known {name}: must be given once")
        try:
            value = float(text)
        except ValueError:
            raise ValueError(
                f"--known {name} = {shown(text)}: must be a number"
            ) from None
        given[name] = number(value, f"--known {name}")
    if VOLTAGE in given:
        number(given[VOLTAGE], f"--known {VOLTAGE}", low=0.0, strict=True)
    return known_of_search(start, given, "--known ")
