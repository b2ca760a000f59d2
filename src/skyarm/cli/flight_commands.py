"""The commands on flights that were flown: replay, diff, export."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from skyarm.cli.app import NOT_COMPLETED, app, console, tell
from skyarm.cli.machine_output import give, is_document_wanted
from skyarm.cli.progress import bar, waiting

DIFFERENT = 1
"""Exit code of a comparison that found a difference."""


@app.command()
def replay(
    flight: Annotated[str, typer.Argument(help="the log of a flight (.npz)")],
    controller: Annotated[
        str | None, typer.Option(help="a preset, a law, LAW_tuned or FILE.py:make, in place of the log's")
    ] = None,
    out: Annotated[
        str | None, typer.Option("--out", "-o", metavar="FILE", help="log of the new flight, its format by its suffix")
    ] = None,
) -> None:
    """Fly a log's flight again, also under another law.

    The same scenario with the same noise, wind, pushes and changes. Without --controller the new flight is compared
    with the log to the bit; exit code 1 if it differs. With it both stand side by side, and the exit code is 3 if the
    new flight ended before its time. The new log is out/replay/NAME.npz, or FILE; an earlier one there is kept as
    NAME_1.npz.
    """
    from skyarm.cli.earlier_files import keep_earlier
    from skyarm.cli.flight_differences import (
        difference_lines,
        flown_again,
        metric_lines,
        replay_document,
        say_versions,
    )
    from skyarm.cli.log_files import log_files
    from skyarm.files import require_replaceable, require_writable, taken_back
    from skyarm.log.formats import save_log
    from skyarm.log.log_differences import log_differences
    from skyarm.simulate.loop import run as fly
    from skyarm.simulate.replay import read, scenario_to_replay

    before = read(flight)
    planned = scenario_to_replay(before, controller)
    usual = Path("out/replay") / f"{planned.name}.npz"
    (file,) = log_files([out] if out is not None else None, (usual,))
    with taken_back(*(() if out is not None else (usual.parent,))):
        if out is None:
            require_writable(usual.parent)
        require_replaceable(file)
        with bar(planned.name, console) as advance:
            log = fly(planned, lambda done, total: advance(done, total, ""))
    kept = keep_earlier([file])
    save_log(log, file)
    again = controller is None
    equal = flown_again(before, log)
    give(replay_document(before, log, file) if is_document_wanted() else None)
    if not is_document_wanted():
        labels = ("log", "again") if again else (str(before.info.get("controller", "log")), str(log.info["controller"]))
        tell(f"{planned.name}: law {log.info['controller']} on {log.info['plant_vehicle']}, plant {log.info['plant']}")
        if again and equal:
            tell(f"equal to the bit: {before.time.size} control periods")
        elif again:
            for line in difference_lines(log_differences(before, log), labels):
                tell(line)
        if not (again and equal):
            for line in metric_lines(before, log, labels):
                tell(line)
        tell(f"log: {file}")
        for _, name in kept:
            tell(f"the flight before it is kept: {name}")
    say_versions(before, log)
    if again and not equal:
        raise typer.Exit(DIFFERENT)
    if not again and log.status != "completed":
        raise typer.Exit(NOT_COMPLETED)


@app.command()
def diff(
    first: Annotated[str, typer.Argument(help="the log of a flight (.npz)")],
    second: Annotated[str, typer.Argument(help="the log of another")],
    tolerance: Annotated[
        float, typer.Option(help="differences up to this, in the SI unit of each quantity, count as none")
    ] = 0.0,
) -> None:
    """Compare two logs: where they come apart.

    The first divergence in time, the largest difference of each quantity, metrics side by side, and what differs
    between the scenarios. Exit code: 0 if they are equal, 1 if they differ, 2 if the input was wrong.
    """
    from skyarm.cli.flight_differences import (
        are_equal,
        difference_lines,
        document,
        metric_lines,
        say_versions,
        scenario_lines,
    )
    from skyarm.files import number
    from skyarm.log.log_differences import log_differences
    from skyarm.simulate.replay import read

    number(tolerance, "--tolerance", low=0.0)
    a, b = read(first), read(second)
    found = log_differences(a, b, tolerance)
    give(document(a, b, found) if is_document_wanted() else None)
    if not is_document_wanted():
        for line in (
            *difference_lines(found, ("the first", "the second"), tolerance),
            *metric_lines(a, b, ("first", "second")),
            *scenario_lines(a, b),
        ):
            tell(line)
    say_versions(a, b)
    if not are_equal(a, b, found):
        raise typer.Exit(DIFFERENT)


@app.command()
def export(
    flight: Annotated[str, typer.Argument(help="the log of a flight: .npz, .mcap or .parquet")],
    to: Annotated[str | None, typer.Option(metavar="FORMAT", help="mcap, npz, csv, parquet or ros1")] = None,
    file: Annotated[str | None, typer.Option("--out", "-o", help="file to write; beside FLIGHT if left out")] = None,
    layouts: Annotated[
        str | None, typer.Option(metavar="FOLDER", help="write layouts for Foxglove and PlotJuggler there")
    ] = None,
) -> None:
    """Write a flight's log in another format.

    A log that was cut off, as that of a run that was killed, is written as far as it goes. 'skyarm export-c' writes a
    controller.
    """
    from skyarm.cli.export_logs import export as perform

    with waiting(f"{flight}: writing", console):
        written, shown = perform(flight, to, file, layouts)
    give(file=written, layouts=shown)
    if written is not None:
        tell(f"log: {written}")
    if shown:
        tell(f"layouts: {', '.join(map(str, shown))}")


@app.command()
def identify(
    flight: Annotated[str, typer.Argument(help="the log of a flight: .npz, .mcap or .parquet")],
    vehicle: Annotated[str | None, typer.Option(help="a vehicle; the one that the log's law believes in")] = None,
    gravity: Annotated[float | None, typer.Option(help="m/s^2; the log's, or 9.81")] = None,
    begin: Annotated[float | None, typer.Option(help="s, of the part that is looked at")] = None,
    end: Annotated[float | None, typer.Option(help="s, of the part that is looked at")] = None,
    out: Annotated[str | None, typer.Option("--out", "-o", metavar="FILE", help="write the TOML lines there")] = None,
) -> None:
    """Find delays and lags of a vehicle in a log.

    How late the rotors follow their commands, how late the joints: dead times and time constants, each with the
    interval of 95 %, and the TOML lines to paste. Exit code 3 if the flight does not tell, as a calm hover.
    """
    from skyarm.cli.identify_command import identify as perform

    known = perform(flight, console, vehicle=vehicle, gravity=gravity, begin=begin, end=end, out=out)
    if not known:
        raise typer.Exit(NOT_COMPLETED)
