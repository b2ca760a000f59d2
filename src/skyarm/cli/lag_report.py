"""Delays and lags of rotors and joints from the log of one flight: table, and TOML lines for a scenario."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import typer

from skyarm.cli.lines import NOT_COMPLETED, say
from skyarm.cli.output import Row, aligned_lines, bar, give, heading, plain, tell
from skyarm.flight_data.quantities import GRAVITY
from skyarm.log.flight_log import Log, rows_of
from skyarm.log.flown_scenario import written_part
from skyarm.log.formats import load_log, require_readable
from skyarm.plant.interface import require_gravity
from skyarm.records.files import number, output_file, printable, shown, taken_back, unreadable, write_atomically
from skyarm.studies.identify.loop_lags import Estimated, Lag, LoopLags, lag_tables, loop_lags
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.vehicle.vehicle_records import Vehicle


def identify_lags(
    flight: str, vehicle: str | None, gravity: float | None, begin: float | None, end: float | None, out: str | None
) -> None:
    """Identify delays and lags of a readable flight log, print them and write the TOML lines.

    Args:
        flight: path of a log.
        vehicle: name or file; the model of the log's law if left out.
        gravity: m/s^2; the log's, or 9.81.
        begin: s, of the part that is looked at.
        end: s, of that part.
        out: path of the file of the TOML lines.

    Raises:
        ValueError: one line: no such log, nothing of it left, or a vehicle that does not fit.
        Exit: 3, if the flight shows no lag.
    """
    require_readable(flight, "flight")
    if reason := unreadable(Path(flight)):
        raise ValueError(f"flight = {shown(flight)}: {reason}")
    with taken_back(out and Path(out).parent):
        written = None if out is None else output_file(out, "--out", ".toml")
        log = _part(load_log(flight), begin, end)
        believed, felt, stated = _nominal_model(log, vehicle, gravity)
        with bar(f"{Path(flight).name}: delays and lags"):
            found = loop_lags(log, believed, felt)
        lags = [*([found.rotors] if found.rotors else []), *found.joints]
        tables = lag_tables(found, measured=stated["measurement"] or 0.0)
        tell(
            heading(f"{Path(flight).name}: {found.seconds:g} s, vehicle {believed.name}"),
            *aligned_lines([HEADS, *map(_row, lags)]),
            *_notes(found, lags, stated),
        )
        if tables:
            tell(f"\n{tables}")
            if written is not None:
                write_atomically(written, tables.encode())
        give(plain(found), vehicle=believed.name, stated=stated, tables=tables, file=written if tables else None)
        if not any(each.is_known for each in lags):
            say("the flight does not tell: fly with more motion, or longer")
            raise typer.Exit(NOT_COMPLETED)


HEADS = ("", "delay and lag", "delay", "up", "down", "over believed", "explained")


def _part(log: Log, begin: float | None, end: float | None) -> Log:
    """Return the part of a log between two times, s."""
    for option, value in (("--begin", begin), ("--end", end)):
        if value is not None:
            number(value, option, low=0.0)
    low, high = 0.0 if begin is None else begin, math.inf if end is None else end
    if not low < high:
        raise ValueError(f"--end = {end:g}: must be after --begin = {low:g}")
    if begin is None and end is None:
        return log
    inside = np.flatnonzero((log.time >= low) & (log.time <= high))
    if not len(inside):
        told = "--end" if begin is None else "--begin"
        value, first, last = high if begin is None else low, float(log.time[0]), float(log.time[-1])
        raise ValueError(f"{told} = {value:g}: nothing of the flight is left, whose times are {first:g} to {last:g} s")
    return rows_of(log, slice(int(inside[0]), int(inside[-1]) + 1))


def _nominal_model(
    log: Log, vehicle: str | None, gravity: float | None
) -> tuple[Vehicle, float, dict[str, float | None]]:
    """Return vehicle, gravity and the stated delays (s) against which delays and lags are identified."""
    record = log.info.get("scenario_record")
    delays = written_part(log.info, "agent", "delays") or {}
    stated = {name: float(delays[name]) if name in delays else None for name in ("command", "measurement")}
    felt = GRAVITY if gravity is None else require_gravity(gravity, "--gravity")
    if vehicle is not None:
        return load_vehicle(vehicle), felt, stated
    if not record:
        raise ValueError(
            "--vehicle: is missing; the log does not say which vehicle flew (with --lags, for its lags alone)"
        )
    model = log.scenario.controller.par.model
    return model.vehicle, float(model.gravity) if gravity is None else felt, stated


def _row(lag: Lag) -> Row:
    if not lag.is_known:
        return (lag.name, "not known", "", "", "", "", f"{lag.explained:.0%}")
    factors = " ".join(f"{each:.2f}" for each in dict.fromkeys(lag.factor) if not math.isnan(each))
    cells = (_cell(each) for each in (lag.together, lag.delay, lag.up, lag.down))
    return (lag.name, *cells, factors or "-", f"{lag.explained:.0%}")


def _cell(found: Estimated) -> str:
    """Format an identified time in milliseconds with its 95 % confidence interval."""
    return f"{1e3 * found.value:.1f} ({1e3 * found.low:.1f}-{1e3 * found.high:.1f})"


def _notes(found: LoopLags, lags: list[Lag], stated: dict[str, float | None]) -> list[str]:
    """Notes on how to read the identified delays and lags."""
    lines = ["ms, with the interval of 95 %; 'delay and lag': both together, as a small swing meets them."]
    lines += [f"{each.name}: not known: {each.reason}" for each in lags if not each.is_known]
    lines += [f"{name}: not asked: {reason}" for name, reason in found.left_out.items()]
    vague = [each.name for each in lags if each.is_known and not each.apart and each.together.low > 0.0]
    if vague:
        who = ", ".join(vague)
        lines.append(f"{who}: delay and lag cannot be told apart in this flight; trust what they are together")
    if stated["command"] is None:
        lines.append("The delay runs from a command to the logged rates: if the log holds them as they were received,")
        lines.append("their age is in it, and what passes through the loop shows the sum of both only.")
    else:
        told = ", ".join(f"{name} {1e3 * (value or 0.0):g} ms" for name, value in stated.items())
        lines.append(f"The log holds the true state: delays are of commands alone. The scenario states: {told}.")
    return [printable(line) for line in lines]
