"""The commands on one flight or one vehicle: reproduce, run, list, show, export-c."""

from __future__ import annotations

from typing import Annotated

import typer

from skyarm.cli.app import NOT_COMPLETED, Out, app, console, tell, workers
from skyarm.cli.progress import bar


@app.command()
def reproduce(
    out: Out = "out/paper",
    plant: Annotated[str, typer.Option(help="rigid_body, mujoco or both")] = "both",
    jobs: Annotated[int, typer.Option(help="processes that fly; 0 takes every core")] = 0,
    bench: Annotated[bool, typer.Option("--bench", help="fly all laws on one bench too: about half an hour")] = False,
) -> None:
    """Fly the paper; write tables, figures, report.

    Five experiments with two controllers on two plants, and the variations behind the reasons: results.json, table2.md,
    Figures 3-18 and one page, report.html, with the exact law beside the paper's on the same cases. With --bench all of
    'skyarm compare' into OUT/bench; the same command continues it.
    """
    from skyarm.cli.show import headline
    from skyarm.experiments.reproduce import reproduce as perform
    from skyarm.simulate.scenario import PLANTS

    if plant not in (*PLANTS, "both"):
        raise ValueError(f"--plant = {plant!r}: must be one of {', '.join(PLANTS)} or both")
    processes = workers("--jobs", jobs)
    plants = PLANTS if plant == "both" else (plant,)
    if bench:
        from skyarm.compare.results import Bench
    with bar("flying", console) as advance:
        table = perform(
            out,
            plants=plants,
            workers=processes,
            bench=Bench() if bench else None,
            progress=advance,
            note=console.print,
        )
    console.print(headline(table))
    tell(f"results in {out}: report.html, table2.md, results.json, figures/")


@app.command()
def run(
    scenario: Annotated[str, typer.Argument(help="a scenario file (.toml) or the name of a shipped one")],
    out: Out = "out/run",
    plant: Annotated[str | None, typer.Option(help="rigid_body or mujoco, in place of the file's")] = None,
    controller: Annotated[str | None, typer.Option(help="a preset, a law or LAW_tuned, in place of the file's")] = None,
    seed: Annotated[int | None, typer.Option(help="seed of the noise, in place of the file's")] = None,
    duration: Annotated[float | None, typer.Option(help="seconds, in place of the file's")] = None,
) -> None:
    """Fly a scenario; write its log (npz, CSV).

    Exit code: 0 if the flight was completed, 3 if it ended before its time (the log says why), 2 if the input was
    wrong, 130 after Ctrl-C.
    """
    from skyarm.cli.flight import episode
    from skyarm.files import require_replaceable, require_writable
    from skyarm.simulate import run as fly
    from skyarm.simulate.scenario_file import load_scenario

    planned = load_scenario(scenario, plant=plant, controller=controller, seed=seed, duration=duration)
    folder = require_writable(out)
    table, record = folder / f"{planned.name}.csv", folder / f"{planned.name}.npz"
    require_replaceable(record, table)
    with bar(planned.name, console) as advance:
        log = fly(planned, lambda done, total: advance(done, total, ""))
    written = [log.save_npz(record), log.save_csv(table)]
    console.print(episode(log))
    tell("log: " + ", ".join(str(path) for path in written))
    if log.status != "completed":
        raise typer.Exit(NOT_COMPLETED)


@app.command(name="list")
def list_(
    file: Annotated[str | None, typer.Option("--json", help="write names, titles and laws' options there")] = None,
) -> None:
    """List vehicles, scenarios, studies, controllers."""
    from skyarm.cli.library import contents, library, write
    from skyarm.files import output_file

    written = None if file is None else output_file(file, "--json")
    found = contents()
    console.print(library(found), soft_wrap=True)
    if written is not None:
        tell(f"written: {write(found, written)}")


@app.command()
def show(
    vehicle: Annotated[str, typer.Argument(help="a vehicle file (.toml, .urdf) or the name of a shipped one")],
    gravity: Annotated[float, typer.Option(help="m/s^2")] = 9.81,
    ops: Annotated[bool, typer.Option("--ops", help="count the operations of its equations instead")] = False,
) -> None:
    """Show a vehicle: mass, hover, arm reach.

    Mass, centre of mass, hover speed and thrust margin, arm reach, static joint torques of a level base, sources of the
    numbers.
    """
    from skyarm.actuation import AllocationError
    from skyarm.cli.show import operations_sheet, vehicle_sheet
    from skyarm.files import number
    from skyarm.vehicle.files import load_vehicle

    number(gravity, "--gravity", low=0.0, strict=True)
    loaded = load_vehicle(vehicle)
    if ops:
        console.print(operations_sheet(loaded))
        return
    try:
        console.print(vehicle_sheet(loaded, gravity))
    except AllocationError as error:
        raise ValueError(f"{vehicle}: rotors = {error}") from None


@app.command(name="export-c")
def export_c(
    controller: Annotated[str, typer.Argument(help="a preset, a law, LAW_tuned, or a scenario (its controller)")],
    file: Annotated[str, typer.Option("--out", "-o", help="the C file to write")],
    vehicle: Annotated[str | None, typer.Option(help="the vehicle that a preset or law believes in")] = None,
    gravity: Annotated[float | None, typer.Option(help="m/s^2, believed by a preset or law; 9.81")] = None,
    rate: Annotated[float | None, typer.Option(help="Hz of the control; 200, or the scenario's")] = None,
    name: Annotated[str | None, typer.Option(help="begins the names in the file")] = None,
    single: Annotated[bool, typer.Option("--single", help="float in place of double")] = False,
) -> None:
    """Write a controller as one C99 file."""
    from skyarm.cli.export import export

    line = export(controller, file, vehicle=vehicle, gravity=gravity, rate=rate, name=name, single=single)
    console.print(line, soft_wrap=True)
