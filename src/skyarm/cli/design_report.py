"""Design of an excitation flight: table of the intervals to expect, and the scenario file."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

import typer

from skyarm.cli.output import Lines, aligned_lines, bar, give, heading, tell
from skyarm.records.files import number, output_file, taken_back, write_atomically
from skyarm.records.units import units
from skyarm.studies.identify.design import SEGMENT, DesignLimits
from skyarm.studies.identify.designed_flight import DesignedFlight, Sharpened, design_flight
from skyarm.vehicle.vehicle_files import list_vehicles, load_vehicle

FLATTEST, STEEPEST, LONGEST = 2.0, 60.0, 600.0
"""deg, below what a loop tilts by itself, and far from lying on its side; s, of a battery."""

HEADS = ("", "95 % interval, designed", "undesigned", "sharper by")

USUAL = DesignLimits()


def limit_option(name: str) -> Any:
    """Option of a limit: unit, meaning and usual value as its record declares them, an angle in degrees."""
    unit, usual = units(DesignLimits)[name], getattr(USUAL, name)
    of, usual = ("deg", math.degrees(usual)) if unit.unit == "rad" else (unit.unit, usual)
    return typer.Option(help=f"of --design: {of}, {unit.meaning}  [default: {usual:g}]")


def identify_design(
    vehicle: str,
    box: float | None,
    tilt: float | None,
    seconds: float | None,
    clear: float | None,
    out: str | None,
) -> None:
    """Design an excitation flight, print what it shows and write its scenario.

    Args:
        vehicle: name or file.
        box: m, edge of the cube in which the base stays; left out, as all that follow: the usual.
        tilt: deg, of the base.
        seconds: s, of flight.
        clear: m, of the arm from rotors, base and ground.
        out: path of the scenario file.

    Raises:
        ValueError: one line: no such vehicle, an option outside its range, or no flight within the limits.
    """
    limits = DesignLimits(
        box=USUAL.box if box is None else number(box, "--box", low=0.0, strict=True),
        tilt=USUAL.tilt if tilt is None else math.radians(_within(tilt, "--tilt", FLATTEST, STEEPEST)),
        seconds=USUAL.seconds if seconds is None else _within(seconds, "--seconds", SEGMENT, LONGEST),
        clear=USUAL.clear if clear is None else number(clear, "--clear", low=0.0),
    )
    start = load_vehicle(vehicle)
    with taken_back(out and Path(out).parent):
        written = None if out is None else output_file(out, "--out", ".toml")
        folder = Path() if written is None else Path(written).parent
        name = vehicle if vehicle in list_vehicles() else os.path.relpath(vehicle, folder)
        with bar(f"design {start.name}") as advance:
            found = design_flight(start, name, limits, folder=folder, progress=advance)
        tell(*_lines(found, start.name, limits))
        if written is not None:
            write_atomically(written, found.text().encode())
            tell(f"written: {written}", f"next: skyarm run {written}")
        numbers = [_row(each) for each in found.numbers]
        give({"numbers": numbers}, vehicle=start.name, file=written)


def _within(value: float, option: str, low: float, high: float) -> float:
    """Number from a lowest to a highest one."""
    if not low <= number(value, option) <= high:
        raise ValueError(f"{option} = {value:g}: must be from {low:g} to {high:g}")
    return value


def _row(each: Sharpened) -> dict[str, float | str]:
    """Half widths of a number's intervals."""
    return {
        "name": each.designed.name,
        "unit": each.designed.unit,
        "designed": each.designed.half_width,
        "undesigned": each.undesigned.half_width,
        "sharper": each.ratio,
    }


def _lines(found: DesignedFlight, vehicle: str, limits: DesignLimits) -> Lines:
    """Table of the numbers with the intervals to expect, and what the flight needs."""
    rows = [
        (each.designed.title, _width(each.designed.verdict), _width(each.undesigned.verdict), f"{each.ratio:.1f}")
        for each in found.numbers
    ]
    extent = " x ".join(f"{each:.2f}" for each in found.box)
    needs = [f"base within {extent} m", f"tilt at most {math.degrees(found.tilt):.0f} deg"]
    if math.isfinite(found.clearance):
        needs.append(f"arm at least {found.clearance:.2f} m from rotors and base")
    return [
        heading(f"excitation of {vehicle}: {limits.seconds:g} s"),
        *aligned_lines([HEADS, *rows]),
        f"In a simulated flight: {', '.join(needs)}; {found.saturated:.2%} of the rotor commands at a limit.",
        "Undesigned: the path on which tuned gains are validated, for as long.",
    ]


def _width(verdict: str) -> str:
    """Width of an interval from the words on a number."""
    return verdict.removeprefix("excited (").removesuffix(")")
