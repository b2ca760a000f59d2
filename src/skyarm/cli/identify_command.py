"""Command ``skyarm identify``: a vehicle from its measured flights, or delays and lags from a log."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from skyarm.cli.identified_report import IDENTIFIED, VEHICLE, document_of, report_lines
from skyarm.cli.lag_report import identify_lags
from skyarm.cli.lines import NOT_COMPLETED, say
from skyarm.cli.output import Advance, bar, give, plain, tell, write_json
from skyarm.flight_data.flight_data import FlightData, load_flight
from skyarm.flight_data.own_log import is_own_mcap
from skyarm.log.formats import require_readable
from skyarm.records.files import (
    number,
    require_replaceable,
    require_writable,
    shown,
    taken_back,
    unreadable,
    write_atomically,
)
from skyarm.records.registry import RegistryError
from skyarm.studies.identify.identified_file import identified_file
from skyarm.studies.identify.identify_vehicle import identify_vehicle
from skyarm.studies.identify.stretches import stretches_of_flights
from skyarm.studies.identify.unknowns import second_moments_of
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.vehicle.vehicle_records import Vehicle

TOTAL, VOLTAGE = "mass", "voltage"
"""Known numbers that are none of the search: kg, of the whole vehicle; V, at which the start's thrust holds."""

MOMENTS = ("base.inertia.xx", "base.inertia.yy", "base.inertia.zz")
"""Known numbers that must be given together, as the search is for sums of them."""


def identify(
    flights: Annotated[list[str], typer.Argument(metavar="FLIGHT...", help="logs of any format that is read")],
    vehicle: Annotated[str | None, typer.Option(help="start: a file or name, as data sheet and drawing say")] = None,
    columns: Annotated[str | None, typer.Option(metavar="FILE", help="what the columns of the flights mean")] = None,
    known: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=VALUE", help="mass=0.034, voltage=4.2, a number of the table; repeat"),
    ] = None,
    curve: Annotated[bool, typer.Option("--curve", help="a thrust curve in place of one coefficient")] = False,
    begin: Annotated[float | None, typer.Option(help="s, of the part of each flight that counts")] = None,
    end: Annotated[float | None, typer.Option(help="s, of the part of each flight that counts")] = None,
    lags: Annotated[bool, typer.Option("--lags", help="delays and lags of one log alone")] = False,
    gravity: Annotated[float | None, typer.Option(help="m/s^2; the log's, or 9.81")] = None,
    out: Annotated[
        str | None, typer.Option("--out", "-o", help="folder of the vehicle file and all numbers; with --lags a file")
    ] = None,
) -> None:
    """Identify a vehicle, or delays and lags, from flights.

    Delays and lags: of one log of skyarm, without --vehicle. Exit code 3: the flights do not tell.
    """
    if lags or (vehicle is None and len(flights) == 1 and _is_own_log(Path(flights[0]))):
        without = {"--columns": columns, "--known": known, "--curve": curve or None}
        for option, value in without.items():
            if value is not None:
                raise ValueError(f"{option}: must be left out without --vehicle, and with --lags")
        if len(flights) > 1:
            raise ValueError(f"flights = {len(flights)}: must be one with --lags")
        identify_lags(flights[0], vehicle, gravity, begin, end, out)
        return
    for flight in flights:
        reason = "" if Path(flight).is_dir() else unreadable(Path(flight))
        if reason:
            raise ValueError(f"flight = {shown(flight)}: {reason}")
    if vehicle is None:
        raise ValueError("--vehicle: is missing: must be the vehicle as its data sheet and drawing say")
    start, given = known_numbers(load_vehicle(vehicle), known or ())
    full, sections = given.pop(VOLTAGE, 0.0), _sections(begin, end)
    folder = None if out is None else Path(out)
    with taken_back(*(() if folder is None else (folder,))), bar(f"identify {start.name}") as advance:
        if folder is not None:
            require_writable(folder)
            require_replaceable(folder / VEHICLE, folder / IDENTIFIED)
        read = _read(flights, columns, advance)
        advance(last="cut into stretches")
        stretches = stretches_of_flights(read, start, full_voltage=full, sections=sections)
        found = identify_vehicle(
            [each for part in stretches for each in part],
            start,
            curve=curve,
            known=given,
            progress=lambda words: advance(last=words),
        )
        document = document_of(found, start, read, given)
        text = identified_file(found, start, [Path(each.file).name for each in read], given)
    tell(*report_lines(found, start, read))
    shows = any(each.is_known for each in found.numbers)
    written = dict[str, Path]()
    if folder is not None and shows:
        written["vehicle"] = write_atomically(folder / VEHICLE, text.encode())
        written["numbers"] = write_json(folder / IDENTIFIED, document)
        tell(f"written: {', '.join(map(str, written.values()))}", f"next: skyarm check {written['vehicle']}")
    give(plain(document), files=written)
    if not found.settled:
        say(
            "the search did not settle: do not rely on these numbers; give known ones (--known) or fly with more motion"
        )
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


def _read(files: Sequence[str], columns: str | None, advance: Advance) -> list[FlightData]:
    """Read all flights; their names differ."""
    found = list[FlightData]()
    for i, file in enumerate(files):
        advance(i, len(files), f"read {Path(file).name}")
        found.append(load_flight(file, columns))
    advance()
    return found


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
    total = given.pop(TOTAL, None)
    if total is not None:
        carried = float(start.mass) - float(start.base.mass)
        number(total - carried, f"--known {TOTAL}, less {carried:g} kg of the links", low=0.0, strict=True)
        start = dataclasses.replace(start, base=dataclasses.replace(start.base, mass=total - carried))
    if VOLTAGE in given:
        number(given[VOLTAGE], f"--known {VOLTAGE}", low=0.0, strict=True)
    stated = [name for name in MOMENTS if name in given]
    if stated:
        missing = [name for name in MOMENTS if name not in given]
        if missing:
            raise ValueError(f"--known {missing[0]}: is missing: {', '.join(MOMENTS)} must be given together")
        moments = [number(given.pop(name), f"--known {name}", low=0.0, strict=True) for name in MOMENTS]
        for name, axis, moment, second in zip(MOMENTS, "xyz", moments, second_moments_of(*moments), strict=True):
            if not second > 0.0:
                others = sum(moments) - moment
                raise ValueError(f"--known {name} = {moment:g}: must be below the sum of the other two, {others:g}")
            given[f"base.second_moment.{axis}"] = second
    return start, given
