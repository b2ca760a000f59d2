"""Command ``skyarm identify``: a vehicle from its measured flights, or delays and lags from a log."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

import typer

from skyarm.cli.arguments import out_option, require_left_out
from skyarm.cli.design_report import identify_design, limit_option
from skyarm.cli.identified_report import (
    FIGURE,
    NUMBERS,
    TABLE,
    TABLE_HEAD,
    VEHICLE,
    document_of,
    prediction_csv,
    prediction_lines,
    prediction_png,
    report_lines,
)
from skyarm.cli.lag_report import identify_lags
from skyarm.cli.lines import NOT_COMPLETED, say
from skyarm.cli.output import Advance, bar, give, json_text, plain, tell
from skyarm.flight_data.clocks import ClockOffset, align_poses, join_flights
from skyarm.flight_data.flight_data import FlightData, load_flight
from skyarm.flight_data.motion import joints_in_order
from skyarm.flight_data.own_log import is_own_mcap
from skyarm.flight_data.quantities import GRAVITY
from skyarm.log.formats import require_readable
from skyarm.plant.interface import require_gravity
from skyarm.records.files import (
    number,
    require_replaceable,
    require_writable,
    shown,
    taken_back,
    unreadable,
    write_atomically,
)
from skyarm.records.immutable import immutable
from skyarm.records.registry import RegistryError
from skyarm.studies.identify.data_faults import Fault, require_no_refusal
from skyarm.studies.identify.identified_file import IDENTIFIED_BY, VOLTAGE, identified_file
from skyarm.studies.identify.identify_flights import identify_aligned, known_of_search
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.vehicle.vehicle_records import Vehicle

OF_DESIGN = ("--box", "--tilt", "--seconds", "--clear")

OF_FITS = ("--columns", "--known", "--curve", "--held-out", "--join", "--despite-faults", "--drag-height")
"""Options of the identification of a vehicle alone."""

OF_FLIGHTS = ("--begin", "--end", "--lags", "--gravity")
"""Further options of what is identified from flights."""


Moment = Annotated[float | None, typer.Option(help="s, of the part of each flight that counts")]


def identify(
    context: typer.Context,
    flights: Annotated[
        list[str] | None, typer.Argument(metavar="FLIGHT...", help="logs of any format that is read")
    ] = None,
    vehicle: Annotated[str | None, typer.Option(help="start: a file or name, as data sheet and drawing say")] = None,
    columns: Annotated[str | None, typer.Option(metavar="FILE", help="what the columns of the flights mean")] = None,
    known: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=VALUE", help="mass=0.034, voltage=4.2, a number of the table; repeat"),
    ] = None,
    curve: Annotated[bool, typer.Option("--curve", help="a thrust curve in place of one coefficient")] = False,
    drag_height: Annotated[
        bool, typer.Option("--drag-height", help="hub drag acts at a height of its own; needs the velocity")
    ] = False,
    begin: Moment = None,
    end: Moment = None,
    held_out: Annotated[
        list[str] | None, typer.Option(metavar="FLIGHT", help="predicted and not fitted; repeat")
    ] = None,
    join: Annotated[
        str | None, typer.Option(metavar="FILE", help="log of the same flight by a computer of another clock")
    ] = None,
    despite_faults: Annotated[
        bool, typer.Option("--despite-faults", help="only warn of faults for which a flight is refused")
    ] = False,
    lags: Annotated[bool, typer.Option("--lags", help="delays and lags of one log alone")] = False,
    gravity: Annotated[float | None, typer.Option(help="m/s^2; the log's, or 9.81", hidden=True)] = None,
    design: Annotated[
        str | None,
        typer.Option(metavar="VEHICLE", help="design a flight that shows the numbers of this vehicle"),
    ] = None,
    box: Annotated[float | None, limit_option("box")] = None,
    tilt: Annotated[float | None, limit_option("tilt")] = None,
    seconds: Annotated[float | None, limit_option("seconds")] = None,
    clear: Annotated[float | None, limit_option("clear")] = None,
    out: Annotated[
        str | None, out_option("folder of the vehicle file and all numbers; with --lags and --design a file")
    ] = None,
) -> None:
    """Identify a vehicle, or delays and lags, from flights."""
    # exit code 3: the flights do not tell
    if design is not None:
        if flights:
            raise ValueError("FLIGHT: must be left out with --design")
        require_left_out(context, ["--vehicle", *OF_FITS, *OF_FLIGHTS], " with --design")
        identify_design(design, box, tilt, seconds, clear, out)
        return
    require_left_out(context, OF_DESIGN, " without --design")
    if not flights:
        raise ValueError("FLIGHT: is missing: must be one log or more, or --design VEHICLE")
    if lags or (vehicle is None and len(flights) == 1 and _is_own_log(Path(flights[0]))):
        require_left_out(context, OF_FITS, " without --vehicle, and with --lags")
        if len(flights) > 1:
            raise ValueError(f"flights = {len(flights)}: must be one with --lags")
        identify_lags(flights[0], vehicle, gravity, begin, end, out)
        return
    if join is not None and len(flights) > 1:
        raise ValueError(f"flights = {len(flights)}: must be one with --join")
    for flight in (*flights, *(held_out or ()), *(() if join is None else (join,))):
        reason = "" if Path(flight).is_dir() else unreadable(Path(flight))
        if reason:
            raise ValueError(f"flight = {shown(flight)}: {reason}")
    if vehicle is None:
        raise ValueError("--vehicle: is missing: must be the vehicle as its data sheet and drawing say")
    start, given = known_numbers(load_vehicle(vehicle), known or ())
    felt = None if gravity is None else require_gravity(gravity, "--gravity")
    options = (columns, start, given, curve, drag_height, _sections(begin, end), felt, despite_faults)
    work = Work(flights, held_out or (), join, *options)
    with taken_back(out):
        _identify_vehicle(work, None if out is None else Path(out))


@immutable(kw_only=False)
class Work:
    """Inputs of the identification of a vehicle.

    Attributes:
        flights: files. held_out: files of flights to predict. join: file of the only flight by another computer.
        columns: mapping of the columns of all but that.
        start: vehicle before. known: numbers that are not searched, and the voltage.
        curve: identify a thrust curve. drag_height: identify the height of the hub drag.
        sections: parts of the flights that count, s. gravity: m/s^2; None for that of the flights.
        only_warn: of faults for which a flight is refused.
    """

    flights: Sequence[str]
    held_out: Sequence[str]
    join: str | None
    columns: str | None
    start: Vehicle
    known: dict[str, float]
    curve: bool
    drag_height: bool
    sections: Sequence[tuple[float, float]]
    gravity: float | None
    only_warn: bool


def _identify_vehicle(work: Work, folder: Path | None) -> None:
    """Identify a vehicle from flights, predict those that were held out, print and write what was found."""
    start = work.start
    known = {name: value for name, value in work.known.items() if name != VOLTAGE}
    full = work.known.get(VOLTAGE, 0.0)
    with bar(f"identify {start.name}") as advance:
        if folder is not None:
            require_writable(folder)
            require_replaceable(*(folder / name for name in (VEHICLE, NUMBERS, TABLE, FIGURE)))
            _require_own(folder / VEHICLE)
        read, clocks = _read(work, advance)
        fitted, aside = read[: len(work.flights)], read[len(work.flights) :]
        _check_measurements(read, fitted, full)
        felt = _gravity(read) if work.gravity is None else work.gravity
        for each in fitted:
            _check_sections(each, work.sections)
        faults = list[Fault]()

        def report(more: Sequence[Fault]) -> None:
            faults.extend(more)
            require_no_refusal(() if work.only_warn else more)
            for fault in more:
                say(f"warning: {fault.words}")

        found = identify_aligned(
            fitted,
            start,
            report,
            held_out=aside,
            curve=work.curve,
            drag_height=work.drag_height,
            full_voltage=full,
            sections=work.sections,
            known=known,
            gravity=felt,
            progress=lambda words: advance(last=words),
        )
        held_out = found.held_out
        fitted = [each for each, counts in zip(fitted, found.counted, strict=True) if counts]
        document = document_of(found, start, fitted, work.known, faults, held_out, clocks)
        contents = {VEHICLE: identified_file(found, start, [Path(each.file).name for each in fitted], known).encode()}
        contents[NUMBERS] = json_text(document).encode()
        if held_out is not None:
            contents |= {TABLE: prediction_csv(held_out).encode()}
            contents |= {FIGURE: prediction_png(held_out)} if folder is not None and held_out.has_poses else {}
    tell(
        *report_lines(found, start, fitted),
        *_voltage_unused(fitted, full),
        *([] if held_out is None else prediction_lines(held_out)),
    )
    shows, written = any(each.is_known for each in found.numbers), list[Path]()
    if folder is not None and shows:
        written = _write(folder, contents)
        following = [f"next: skyarm check {folder / VEHICLE}"] if found.settled else []
        tell(f"written: {', '.join(map(str, written))}", *following)
    give(plain(document), files=written)
    if not found.settled:
        say("the search did not settle: give known numbers (--known), or fly with more motion")
    if not shows:
        say("the flights show none of these numbers: fly with more motion, or longer")
    if not (found.settled and shows):
        raise typer.Exit(NOT_COMPLETED)


def _is_own_log(path: Path) -> bool:
    """True for the log of a simulated flight, by its name and, of an MCAP file, its content."""
    if path.suffix == ".mcap" and path.is_file():
        return is_own_mcap(path)
    try:
        require_readable(path)
    except RegistryError:
        return False
    return True


def _sections(begin: float | None, end: float | None) -> tuple[tuple[float, float], ...]:
    """Part of each flight that counts, s; none for all in which the vehicle flies."""
    if begin is None and end is None:
        return ()
    low = 0.0 if begin is None else number(begin, "--begin", low=0.0)
    high = math.inf if end is None else number(end, "--end", low=0.0)
    if not low < high:
        raise ValueError(f"--end = {high:g}: must be after --begin = {low:g}")
    return ((low, high),)


def _read(work: Work, advance: Advance) -> tuple[list[FlightData], dict[str, ClockOffset]]:
    """Read all flights, on the clocks of their gyros, and the offsets of the clocks that were moved."""
    fit = {Path(each).resolve() for each in work.flights}
    for each in work.held_out:
        if Path(each).resolve() in fit:
            raise ValueError(f"--held-out = {shown(each)}: must not be among the flights of the fit")
    files, found, clocks = [*work.flights, *work.held_out], list[FlightData](), dict[str, ClockOffset]()
    for i, file in enumerate(files):
        advance(i, len(files), f"read {Path(file).name}")
        flight, clock = align_poses(joints_in_order(load_flight(file, work.columns), work.start))
        if not i and work.join is not None:
            flight, clock = join_flights(flight, joints_in_order(load_flight(work.join), work.start))
        if clock is not None:
            clocks[flight.name] = clock
        found.append(flight)
    advance()
    return found, clocks


def _require_own(file: Path) -> None:
    """Raise an error in one line for a vehicle file that another hand wrote and that would be lost."""
    if file.is_file() and not file.read_bytes().startswith(f"# {IDENTIFIED_BY}".encode()):
        raise ValueError(f"--out = {shown(str(file.parent))}: must be another folder: {VEHICLE} is another hand's")


def _write(folder: Path, contents: Mapping[str, bytes]) -> list[Path]:
    """Write files into a folder, and remove predictions of an earlier identification, which are not of this one."""
    table = folder / TABLE
    if table.is_file() and table.read_bytes().startswith(TABLE_HEAD.encode()):
        for name in {TABLE, FIGURE} - set(contents):
            (folder / name).unlink(missing_ok=True)
    return [write_atomically(folder / name, content) for name, content in contents.items()]


def _voltage_unused(flights: Sequence[FlightData], full: float) -> list[str]:
    """Remark on flights whose measured voltage is not used, as that of the rotors' data is not known."""
    if full or not any("voltage" in each for each in flights):
        return []
    return [f"voltage: is measured and not used: state that of the rotors' data, --known {VOLTAGE}=VALUE"]


def _gravity(flights: Sequence[FlightData]) -> float:
    """Gravity that the flights state, m/s^2; the usual one where none does."""
    stated = {each.name: each.gravity for each in flights if "gravity" in each.facts}
    if len(set(stated.values())) > 1:
        listed = ", ".join(f"{name} {value:g}" for name, value in stated.items())
        raise ValueError(f"--gravity: is missing: the flights state several, m/s^2: {listed}")
    return next(iter(stated.values()), GRAVITY)


def _check_measurements(read: Sequence[FlightData], fitted: Sequence[FlightData], full: float) -> None:
    """Raise an error in one line for a measurement that is given twice, as a copy too, or lacks a known voltage."""
    measured = dict[bytes, str]()
    for flight in read:
        if "gyro" in flight and flight["gyro"].time.size:
            same = measured.setdefault(flight["gyro"].values.tobytes(), flight.file)
            if same is not flight.file:
                raise ValueError(f"flight = {shown(flight.file)}: must be another measurement than {shown(same)}")
    if full and not any("voltage" in flight for flight in fitted):
        raise ValueError(f"--known {VOLTAGE} = {full:g}: must be left out: no flight measures the voltage")


def _check_sections(flight: FlightData, sections: Sequence[tuple[float, float]]) -> None:
    """Raise an error in one line for a part that counts of which a flight has nothing."""
    for begin, end in sections:
        if begin >= flight.end:
            raise ValueError(f"--begin = {begin:g}: must be below {flight.end:g} s, the end of {flight.name}")
        if end <= flight.start:
            raise ValueError(f"--end = {end:g}: must be above {flight.start:g} s, the begin of {flight.name}")


def known_numbers(start: Vehicle, words: Sequence[str]) -> tuple[Vehicle, dict[str, float]]:
    """Start vehicle and numbers by name of the unknown, from words such as ``mass=0.034``.

    The total mass becomes that of the start vehicle, by its base. The three moments of inertia of the base become the
    second moments of mass that are searched.

    Raises:
        ValueError: one line with the option, the value and what is allowed.
    """
    given = dict[str, float]()
    for each in words:
        name, equals, text = (part.strip() for part in each.partition("="))
        if not (name and equals and text):
            raise ValueError(f"--known = {shown(each)}: must be NAME=VALUE, such as mass=0.034")
        if name in given:
            raise ValueError(f"--known {name}: must be given once")
        try:
            value = float(text)
        except ValueError:
            raise ValueError(f"--known {name} = {shown(text)}: must be a number") from None
        given[name] = number(value, f"--known {name}")
    if VOLTAGE in given:
        number(given[VOLTAGE], f"--known {VOLTAGE}", low=0.0, strict=True)
    return known_of_search(start, given, "--known ")
