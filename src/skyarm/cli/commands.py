"""The commands: reproduce, run, list, show.

Wrong input gives one line on standard error and exit code 2, never a traceback.
"""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from skyarm.cli.lines import INTERRUPTED, WRONG_INPUT, printable, say
from skyarm.cli.progress import bar
from skyarm.files import shown

app = typer.Typer(
    name="skyarm",
    help="Aerial manipulation: multirotors that carry robot arms.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
console = Console(markup=False, highlight=False, emoji=False)

USAGE_ERROR: Any = typer.BadParameter.__mro__[2]
"""ClickException: some versions of typer carry their own copy of click."""

NOT_COMPLETED = 3
"""Exit code of a flight that ended before its time."""

# text, not Path: an empty name would become the folder one stands in
Out = Annotated[str, typer.Option("--out", help="folder for the results, made if missing")]


@app.command()
def reproduce(
    out: Out = "out/paper",
    plant: Annotated[str, typer.Option(help="rigid_body, mujoco or both")] = "both",
    jobs: Annotated[int, typer.Option(help="processes that fly; 0 takes every core")] = 0,
) -> None:
    """Fly the paper; write tables, figures, report.

    Five experiments with two controllers on two plants, and the variations behind the reasons: results.json, table2.md,
    Figures 3-18 and one page, report.html.
    """
    from skyarm.cli.show import headline
    from skyarm.experiments.reproduce import reproduce as perform
    from skyarm.simulate.scenario import PLANTS

    if plant not in (*PLANTS, "both"):
        raise ValueError(f"--plant = {plant!r}: must be one of {', '.join(PLANTS)} or both")
    if jobs < 0:
        raise ValueError(f"--jobs = {jobs}: must be at least 0")
    plants = PLANTS if plant == "both" else (plant,)
    with bar("flying", console) as advance:
        table = perform(out, plants=plants, workers=jobs or _cores(), progress=advance, note=console.print)
    console.print(headline(table))
    _tell(f"results in {out}: report.html, table2.md, results.json, figures/")


@app.command()
def run(
    scenario: Annotated[str, typer.Argument(help="a scenario file (.toml) or the name of a shipped one")],
    out: Out = "out/run",
    plant: Annotated[str | None, typer.Option(help="rigid_body or mujoco, in place of the file's")] = None,
    controller: Annotated[str | None, typer.Option(help="a controller preset, in place of the file's")] = None,
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
    _tell("log: " + ", ".join(str(path) for path in written))
    if log.status != "completed":
        raise typer.Exit(NOT_COMPLETED)


@app.command(name="list")
def list_() -> None:
    """List vehicles, scenarios, studies, controllers."""
    from skyarm.cli.show import library

    console.print(library(), soft_wrap=True)


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
    controller: Annotated[str, typer.Argument(help="a preset, a law, or a scenario (its controller and belief)")],
    file: Annotated[Path, typer.Option("--out", "-o", help="the C file to write")],
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


@app.command()
def sweep(
    study: Annotated[str, typer.Argument(help="a study file (.toml) or the name of a shipped one")],
    out: Annotated[Path | None, typer.Option("--out", help="folder of the rows; out/NAME if left out")] = None,
    threads: Annotated[int, typer.Option(help="threads that fly; 0 takes every core")] = 0,
    ray: Annotated[str | None, typer.Option(help="address of a Ray cluster, or local")] = None,
) -> None:
    """Fly a study's episodes; rows as Parquet.

    The same command continues what was interrupted.
    """
    from skyarm.cli.sweep import sweep as perform

    if threads < 0:
        raise ValueError(f"--threads = {threads}: must be at least 0")
    perform(study, out, threads or _cores(), ray, console)


@app.command()
def stats(
    folder: Annotated[Path, typer.Argument(help="folder that 'skyarm sweep' wrote")],
    out: Annotated[Path | None, typer.Option("--out", help="folder of the results; FOLDER/stats if left out")] = None,
    success: Annotated[
        list[str] | None, typer.Option(help="METRIC=LARGEST of a success, in place of the study's")
    ] = None,
    map_: Annotated[tuple[str, str] | None, typer.Option("--map", help="two varied numbers, across and upward")] = None,
    seed: Annotated[int, typer.Option(help="of the bootstrap")] = 0,
) -> None:
    """Success, quantiles, robustness maps of a sweep."""
    from skyarm.cli.sweep import stats as perform

    if seed < 0:
        raise ValueError(f"--seed = {seed}: must be at least 0")
    perform(folder, out, success, map_, seed, console)


@app.command()
def margins(
    controller: Annotated[str, typer.Argument(help="a preset, a law, or 'own' for the scenario's")],
    scenario: Annotated[str, typer.Argument(help="a scenario file (.toml) or the name of a shipped one")],
    instants: Annotated[int, typer.Option(help="looked at along the scenario, beside hover")] = 4,
    safety: Annotated[bool, typer.Option("--safety", help="under the safety layer")] = False,
    file: Annotated[Path | None, typer.Option("--json", help="write eigenvalues and margins there")] = None,
) -> None:
    """Linearise the closed loop: eigenvalues, margins.

    Of the sampled loop as it flies, delays and lags in it, in hover and along the scenario. Exit code 3 if the flight
    ended before its time.
    """
    from skyarm.cli.stability import margins as perform
    from skyarm.cli.stability import planned

    if not perform(planned(controller, scenario, safety=safety), instants, file, console):
        raise typer.Exit(NOT_COMPLETED)


@app.command()
def basin(
    controller: Annotated[str, typer.Argument(help="a preset, a law, or 'own' for the scenario's")],
    scenario: Annotated[str, typer.Argument(help="a scenario file (.toml) or the name of a shipped one")],
    out: Out = "out/basin",
    flights: Annotated[int, typer.Option(help="initial states")] = 100_000,
    rate: Annotated[float, typer.Option(help="largest initial body rate, rad/s")] = 12.0,
    offset: Annotated[float, typer.Option(help="largest initial distance, m")] = 1.0,
    speed: Annotated[float, typer.Option(help="largest initial speed, m/s")] = 2.0,
    safety: Annotated[bool, typer.Option("--safety", help="under the safety layer")] = False,
    seed: Annotated[int, typer.Option(help="of the draws")] = 0,
    threads: Annotated[int, typer.Option(help="threads that fly; 0 takes every core")] = 0,
) -> None:
    """Map what initial attitudes and rates are caught."""
    from skyarm.cli.stability import basin as perform
    from skyarm.cli.stability import planned

    for name, value in (("--threads", threads), ("--seed", seed)):
        if value < 0:
            raise ValueError(f"{name} = {value}: must be at least 0")
    limits = {"rate": rate, "offset": offset, "speed": speed, "seed": seed}
    perform(planned(controller, scenario, safety=safety), flights, Path(out), threads or _cores(), limits, console)


@app.command()
def bench(
    quick: Annotated[bool, typer.Option("--quick", help="fewer rounds, shorter flights: about a minute")] = False,
    file: Annotated[Path | None, typer.Option("--json", help="write the numbers there too")] = None,
) -> None:
    """Measure every engine beside MuJoCo and others.

    Speed as ratios from one interleaved run, accuracy, latency, start, operations; some minutes on an idle machine.
    """
    from skyarm.cli.bench import bench as perform

    perform(file, quick, console)


@app.command()
def compare(
    suite: Annotated[str, typer.Argument(help="paper-suite")] = "paper-suite",
    out: Annotated[Path | None, typer.Option("--out", help="folder of the results; out/compare if left out")] = None,
    laws: Annotated[str | None, typer.Option(help="names, with commas; all if left out")] = None,
    conditions: Annotated[str | None, typer.Option(help="names, with commas; all if left out")] = None,
    plants: Annotated[int, typer.Option(help="how many wrong plants")] = 1000,
    seeds: Annotated[int, typer.Option(help="noisy flights of the truth")] = 8,
    seed: Annotated[int, typer.Option(help="of plants and noise")] = 0,
    plant: Annotated[str, typer.Option(help="rigid_body or mujoco")] = "rigid_body",
    threads: Annotated[int, typer.Option(help="threads that fly; 0 takes every core")] = 0,
) -> None:
    """Fly all laws on one bench; tables, figure, page.

    The same command continues what was interrupted.
    """
    from skyarm.cli.compare import compare as perform
    from skyarm.simulate.scenario import PLANTS

    for option, value in (("--plants", plants), ("--seeds", seeds)):
        if value < 1:
            raise ValueError(f"{option} = {value}: must be at least 1")
    for option, value in (("--seed", seed), ("--threads", threads)):
        if value < 0:
            raise ValueError(f"{option} = {value}: must be at least 0")
    if plant not in PLANTS:
        raise ValueError(f"--plant = {plant!r}: must be one of {', '.join(PLANTS)}")
    perform(
        suite,
        out,
        laws=laws,
        columns=conditions,
        plants=plants,
        seeds=seeds,
        seed=seed,
        plant=plant,
        threads=threads or _cores(),
        console=console,
    )


@app.callback(invoke_without_command=True)
def top(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="print the version and stop")] = False,
) -> None:
    """Aerial manipulation: multirotors that carry robot arms."""
    if version:
        from skyarm import __version__

        console.print(__version__)
        raise typer.Exit
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


def perform() -> int:
    """Carry out the command line's words; wrong input becomes one line. Returns the exit code."""
    try:
        return int(app(standalone_mode=False) or 0)
    except USAGE_ERROR as error:
        return say(f"{error.format_message().rstrip('.')}; see 'skyarm --help'", WRONG_INPUT)
    except (typer.Abort, KeyboardInterrupt):
        return say("interrupted; finished files are whole", INTERRUPTED)
    except BrokenPipeError:
        # who read our output has gone, as `skyarm list | head` does; nothing is left to flush into
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        return 1
    except OSError as error:
        return say(_unusable(error), WRONG_INPUT)
    except ValueError as error:
        return say(str(error), WRONG_INPUT)
    except MemoryError:
        return say("not enough memory; fly fewer seconds or at a lower control rate", WRONG_INPUT)


def _unusable(error: OSError) -> str:
    """What could not be read or written, in words."""
    if error.errno is None:
        return str(error)
    what = "standard output" if error.filename is None else f"file = {shown(os.fspath(error.filename))}"
    return f"{what}: must be usable ({error.strerror or errno.errorcode.get(error.errno, error.errno)})"


def _tell(line: str) -> None:
    """One line on standard output."""
    console.print(printable(line), soft_wrap=True)


def _cores() -> int:
    """Cores this process may use; a container often has fewer than its machine."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
